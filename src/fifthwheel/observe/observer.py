"""The on-line state estimator of a vehicle: a Kalman filter for single samples and for records.

Section 2.3 of Cheng and Cebon (2011). `push` processes one sample; `batch` processes a record and gives the same result
as `push`, bit for bit. Both are causal: missing inputs are not interpolated from later samples.
"""

import copy
import functools
import math
from collections.abc import Iterable, Mapping
from typing import Any, Self

import numpy as np

from fifthwheel._lazy import lazy
from fifthwheel._types import Array
from fifthwheel.dynamics import steps
from fifthwheel.dynamics.sensors import NEEDS_ROLL
from fifthwheel.errors import SignalError, suggestion
from fifthwheel.names import ACCELEROMETER, SignalName
from fifthwheel.native import Scan
from fifthwheel.observe import monitor, offline
from fifthwheel.observe.observed_chain import ObservedChain, observed_chain
from fifthwheel.observe.observer_model import ObserverModel, signals_with_position, stream_settings
from fifthwheel.observe.observer_step import reported_signals
from fifthwheel.observe.settings import ObserverSettings
from fifthwheel.observe.states import States
from fifthwheel.observe.uncertainty import Uncertainty
from fifthwheel.record import Record
from fifthwheel.stream import Status, Stream
from fifthwheel.vehicle import Vehicle

MEASURED = ("yaw_rate", "articulation", "roll_rate", "roll", ACCELEROMETER)
"""Quantities that an observer uses as measurements."""


class Observer:
    """Estimates the states of a vehicle from its measured signals.

    The first sample or record builds and compiles the model, which takes up to a few seconds; a compiled model is
    stored in the cache of `native`.

    Args:
        vehicle: with its numbers, as identified.
        signals: names of the available signals: the speed, a steer angle, and at least one yaw rate, roll rate, roll
            angle or articulation angle; lateral accelerations are used in addition. With a roll rate, a roll angle or a
            lateral acceleration, which contains gravity by the roll angle, the yaw-roll model is used, otherwise the
            yaw model.
        settings: of the observer.

    Raises:
        SignalError: the speed or every steer angle is missing, no signal is a measurement, or the settings give a
            position for a signal that has none.
        VehicleError: no axle of the vehicle is steerable.

    Example:
        >>> import fifthwheel as fw
        >>> truck = fw.vehicle("cheng_cebon_2011")
        >>> record = fw.simulate(truck, count=1)
        >>> observer = fw.Observer(truck, record.signals)  # of an identification: result.observer()
        >>> states = observer.batch(record)
        >>> sample = {"time": record.time[0]} | {name: values[0] for name, values in record.signals.items()}
        >>> bool(observer.push(sample)["sideslip.semitrailer"] == states.values["sideslip.semitrailer"][0])
        True
    """

    def __init__(self, vehicle: Vehicle, signals: Iterable[str], settings: ObserverSettings | None = None) -> None:
        self.settings = settings or ObserverSettings()
        available = set(signals)
        self.vehicle = vehicle.with_logged_steering(available, "the signals")
        if "speed" not in available:
            raise SignalError("speed: not among the signals; map the forward speed in m/s to it")
        units = [unit.name for unit in vehicle.units]
        usable = [f"{quantity}.{u}" for quantity in MEASURED for u in units]
        self.outputs = tuple(n for n in usable if n in available and n != f"articulation.{units[0]}")
        if all(SignalName.of(name).quantity == ACCELEROMETER for name in self.outputs):  # its offset alone would decide
            raise SignalError(
                f"yaw_rate.{units[0]}: not among the signals; an observer needs at least one yaw rate, roll rate, roll "
                "angle or articulation angle of a unit of the vehicle"
            )
        self.inputs = ("speed", *self.vehicle.steer_signals())
        self.roll = any(SignalName.of(name).quantity in (*NEEDS_ROLL, ACCELEROMETER) for name in self.outputs)
        self.reported = reported_signals(vehicle, roll=self.roll, bank=self.settings.estimate_bank)
        for name in self.settings.positions:
            if name not in (allowed := signals_with_position(self.reported)):
                raise SignalError(f"{name}: has no position; positions can be given for {', '.join(allowed)}")
        groups = [unit.group_path(group) for unit in vehicle.units for group in unit.axle_groups]
        for path in self.settings.brakes:
            if path not in groups:
                raise SignalError(f"brakes, {path}: {vehicle.name} has no such axle group; {suggestion(path, groups)}")
        self._names = [(name, f"{name}.sigma") for name in self.reported]
        self._carry: Array | None = None  # of a copied observer
        self.reset()

    @lazy
    def _model(self) -> ObserverModel:
        """The models of measured and reported signals."""
        model, report = (
            observed_chain(
                self.vehicle,
                names,
                accelerometers=[name for name in self.outputs if SignalName.of(name).quantity == ACCELEROMETER],
                roll=self.roll,
                estimate_bank=self.settings.estimate_bank,
                tyres=self.settings.tyres,
            )
            for names in (self.outputs, self.reported)
        )
        return ObserverModel(vehicle=self.vehicle, model=model, report=report, settings=self.settings)

    @lazy
    def _buffers(self) -> "_Buffers":
        """Memory of the compiled step."""
        return _Buffers(self._model.scan, self._model.constant(), self._carry)

    @property
    def model(self) -> ObservedChain:
        """The model of the measured signals."""
        return self._model.model

    @property
    def scan(self) -> Scan:
        """The compiled step."""
        return self._model.scan

    @property
    def constant(self) -> Array:
        """The constant of the compiled step (n_constant,): vehicle, noise and settings, see `observer_step`."""
        return self._buffers.constant.copy()

    def __getstate__(self) -> dict[str, Any]:
        """The attributes without the model and its memory, which a copy makes anew."""
        state = {name: value for name, value in vars(self).items() if name not in ("_model", "_buffers")}
        return state | {"_carry": self._buffers.carry.copy() if "_buffers" in vars(self) else self._carry}

    def __copy__(self) -> Self:
        return copy.deepcopy(self)

    def reset(self) -> None:
        """Return to the state before the first sample."""
        settings = stream_settings(self.settings, self.inputs, self.outputs)
        self.stream = Stream(settings, steps.step_limit(self.vehicle, self.roll))

    def push(self, sample: Mapping[str, float | None]) -> dict[str, float]:
        """Process one sample.

        Args:
            sample: "time" in s, and signals in SI by name; a signal is missing if its value is absent, None or NaN.

        Returns:
            "time", "status" (`Status`), "nis" (health, see `States`), and each reported state with "<state>.sigma",
            SI; NaN if the status is TOO_SLOW or INPUT_MISSING.

        Raises:
            SignalError: the time is missing, not finite, or not after the previous one. The observer does not change.
        """
        stream, get = self.stream, sample.get
        status = stream.take(get("time"), list(map(get, self.inputs)))
        if status != Status.OK:
            return self._answer(status)
        buffers, out, m = self._buffers, self._buffers.out, len(self.outputs)
        if stream.starts:
            self._start(monitor.START)
        measured = list(map(get, self.outputs))
        stream.write(buffers.row, stream.last, stream.inputs, measured, buffers.step)
        buffers.step()
        if out[-1]:  # the measurements contradict the state
            stream.start()
            self._start(monitor.after_restart(out[-2]), suspect=True)
            stream.write(buffers.row, stream.last, stream.inputs, measured, buffers.step)
            buffers.step()
        status = stream.finish(any(out[-2 - m : -2]))
        return self._answer(Status.INCONSISTENT if out[-2] > self.settings.max_nis else status)

    def _start(self, monitored: Array, *, suspect: bool = False) -> None:
        """Start the filter at the steady state of the inputs; `monitored` is the carry of the monitor."""
        inputs = dict(zip(self.stream.settings.names, self.stream.inputs, strict=True))
        self._buffers.carry[:] = np.append(self._model.start(inputs, suspect=suspect), monitored)

    def _answer(self, status: Status) -> dict[str, float]:
        """The result of `push`."""
        answer: dict[str, float] = {"time": self.stream.time, "status": status}
        if status in (Status.OK, Status.COASTING, Status.INCONSISTENT):
            out, n = self._buffers.out.tolist(), len(self.reported)
            answer["nis"] = out[-2]
            for (name, sigma), value, variance in zip(self._names, out, out[n:], strict=False):
                answer[name] = value
                answer[sigma] = math.sqrt(0.0 if variance < 0.0 else variance)
        else:
            answer["nis"] = math.nan
            for name, sigma in self._names:
                answer[name] = answer[sigma] = math.nan
        return answer

    def batch(self, record: Record, uncertainty: Uncertainty | None = None) -> States:
        """States of a record from a new start. The state of the observer itself does not change.

        Args:
            record: with all signals of the observer.
            uncertainty: of parameters and sensor errors. Every sigma then contains their contribution; values do not
                change.

        Raises:
            SignalError: the record does not have a signal of the observer, or an uncertain name does not exist.
        """
        return offline.states(record, self._model, uncertainty, smooth=False)

    def smooth(self, record: Record, uncertainty: Uncertainty | None = None) -> States:
        """States of a record given all samples of their segment; arguments and errors as in `batch`.

        A segment ends where the filter starts again. Status and innovations are those of `batch`, and so are the states
        of a segment in which the smoother diverges.
        """
        return offline.states(record, self._model, uncertainty, smooth=True)

    def _identity(self) -> dict[str, Any]:
        """Vehicle, signals and settings, for JSON."""
        settings = {name: value for name, value in vars(self.settings).items() if isinstance(value, float | None)}
        return {
            "signals": [*self.inputs, *self.outputs],
            "settings": settings,
            "constant": self._buffers.constant.tolist(),
        }

    def save(self) -> dict[str, Any]:
        """The state of the observer for `resume`, for JSON."""
        return {"made_for": self._identity(), **self.stream.save(), "carry": self._buffers.carry.tolist()}

    def resume(self, saved: Mapping[str, Any]) -> None:
        """Continue from the result of `save`, also in another process.

        Raises:
            SignalError: an observer of another vehicle, other signals or other settings saved it.
        """
        if saved["made_for"] != self._identity():
            raise SignalError(
                "state: expected one of the same vehicle, signals and settings, got another one; start without it"
            )
        self.stream.resume(saved)
        self._buffers.carry[:] = saved["carry"]


class _Buffers:
    """Arrays of the compiled step for one sample; `row` and `out` are views of its sample and output."""

    def __init__(self, scan: Scan, constant: Array, carry: Array | None) -> None:
        self.constant = constant
        self.carry = np.zeros(scan.n_carry) if carry is None else carry.copy()
        sample, output = np.zeros(scan.n_sample), np.zeros(scan.n_output)
        self.row: Any = sample.data
        self.out: Any = output.data
        arrays = (self.carry, sample, constant, output)
        self.step = functools.partial(scan.single, 1, 1, *(array.ctypes.data for array in arrays))
        """Process the sample in place."""
