"""Functional mock-up units, driven by FMPy step by step."""

import ctypes
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, Self


class Unit:
    """An instance of an FMU in step mode, from time 0; what it reports is in `messages`."""

    def __init__(self, path: str | Path, folder: Path, start: Mapping[str, float] | None = None) -> None:
        from fmpy import extract, read_model_description
        from fmpy.fmi2 import FMU2Slave, fmi2CallbackLoggerTYPE
        from fmpy.fmi3 import FMU3Slave

        self.description = read_model_description(path)
        self.references = {v.name: v.valueReference for v in self.description.modelVariables}
        self.messages: list[str] = []
        self.time = 0.0
        place = extract(path, str(folder))
        identity = {"guid": self.description.guid, "unzipDirectory": place, "instanceName": "unit"}
        identity["modelIdentifier"] = self.description.coSimulation.modelIdentifier
        self.fmi = int(self.description.fmiVersion[0])

        def log(environment: Any, *texts: Any) -> None:
            self.messages.append(texts[-1].decode())

        if self.fmi == 3:
            self.slave = FMU3Slave(**identity)
            self.slave.instantiate(logMessage=log)
        else:
            from fmpy.fmi2 import fmi2CallbackFunctions

            callbacks = fmi2CallbackFunctions()
            callbacks.logger = fmi2CallbackLoggerTYPE(log)
            self.slave = FMU2Slave(**identity)
            self.slave.instantiate(callbacks=callbacks)
        self.begin(start or {})

    def begin(self, start: Mapping[str, float]) -> None:
        """Run the initialization."""
        self.time = 0.0
        if self.fmi == 2:
            self.slave.setupExperiment(startTime=0.0)
        self.set(start)
        self.slave.enterInitializationMode()
        self.slave.exitInitializationMode()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.slave.terminate()
        self.slave.freeInstance()

    def set(self, values: Mapping[str, float]) -> None:
        references = [self.references[name] for name in values]
        setter = self.slave.setFloat64 if self.fmi == 3 else self.slave.setReal
        if references:
            setter(references, [float(value) for value in values.values()])

    def get(self, names: Iterable[str]) -> list[float]:
        references = [self.references[name] for name in names]
        return list((self.slave.getFloat64 if self.fmi == 3 else self.slave.getReal)(references))

    def status(self) -> int:
        references = [self.references["status"]]
        return int((self.slave.getInt32 if self.fmi == 3 else self.slave.getInteger)(references)[0])

    def step(self, step: float, time: float | None = None, values: Mapping[str, float] | None = None) -> None:
        """Set values and run a step, from the end of the last step if no time is given."""
        self.set(values or {})
        self.time = self.time if time is None else time
        self.slave.doStep(currentCommunicationPoint=self.time, communicationStepSize=step)
        self.time += step

    def state(self) -> Any:
        return self.slave.getFMUState() if self.fmi == 3 else self.slave.getFMUstate()

    def restore(self, state: Any, time: float) -> None:
        (self.slave.setFMUState if self.fmi == 3 else self.slave.setFMUstate)(state)
        self.time = time

    def copied(self, state: Any) -> Any:
        """The state, serialized and deserialized."""
        slave = self.slave
        if self.fmi == 3:
            return slave.deserializeFMUState(slave.serializeFMUState(state))
        return slave.deSerializeFMUstate(slave.serializeFMUstate(state))

    @property
    def library(self) -> ctypes.CDLL:
        return self.slave.dll
