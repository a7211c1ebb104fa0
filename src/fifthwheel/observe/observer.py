"""The state estimator of a known truck: a Kalman filter, the same for a record and for one sample after another.

The article's section 2.3. `push` takes a sample as it comes; `batch` takes a record and gives, bit for bit, what `push`
would have given. Both are causal: nothing is interpolated from samples that are still to come.
"""

import ctypes
import math
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fifthwheel import dynamics
from fifthwheel.dynamics import steps
from fifthwheel.errors import SignalError
from fifthwheel.logs import Record
from fifthwheel.observe import offline
from fifthwheel.observe.known import Known
from fifthwheel.observe.prepare import locked_but
from fifthwheel.observe.settings import ObserverSettings
from fifthwheel.observe.states import States, Status
from fifthwheel.observe.step import reported, step
from fifthwheel.observe.stretches import FASTEST
from fifthwheel.observe.uncertainty import Uncertainty
from fifthwheel.vehicle import Vehicle

Array = NDArray[np.float64]
MEASURED = ("yaw_rate", "articulation", "roll_rate", "roll")


class Observer:
    """States of one truck from the signals that it has.

    Args:
        vehicle: the truck, as identified.
        signals: names of what is measured; speed and a steer angle must be among them. With a roll rate or a roll
            angle the yaw-roll model is used, else the yaw model.
        settings: how states are observed.

    Raises:
        SignalError: speed or every steer angle is missing, or nothing is measured.
    """

    def __init__(self, vehicle: Vehicle, signals: Iterable[str], settings: ObserverSettings | None = None) -> None:
        self.settings = settings or ObserverSettings()
        available = set(signals)
        self.vehicle = locked_but(vehicle, available, "the signals")
        if "speed" not in available:
            raise SignalError("speed: not among the signals; the model needs the forward speed in m/s")
        units = [unit.name for unit in vehicle.units]
        wanted = [f"{quantity}.{u}" for quantity in MEASURED for i, u in enumerate(units)]
        self.outputs = tuple(n for n in wanted if n in available and n != f"articulation.{units[0]}")
        if not self.outputs:
            raise SignalError(f"yaw_rate.{units[0]}: not among the signals; an observer needs at least one yaw rate")
        self.roll = any(name.startswith("roll") for name in self.outputs)
        bank = self.settings.bank is not None
        self.reported = reported(vehicle, roll=self.roll, bank=bank)
        self.model, report = (
            dynamics.model(self.vehicle, names, roll=self.roll, bank=bank) for names in (self.outputs, self.reported)
        )
        self.inputs = self.model.inputs
        self.scan = step(self.model, report)
        self._known = Known(vehicle=self.vehicle, model=self.model, report=report, settings=self.settings)
        self._limit = steps.StepLimit(self.vehicle, roll=self.roll)
        self._constant = self._known.constant()
        self._sample = np.zeros((1, self.scan.n_sample))
        self._output = np.zeros((1, self.scan.n_output))
        self._carry = np.zeros(self.scan.n_carry)
        # the same memory as plain doubles: an element of a NumPy array costs ten times as much
        self._row: Any = (ctypes.c_double * self._sample.size).from_buffer(self._sample.data)
        self._out: Any = (ctypes.c_double * self._output.size).from_buffer(self._output.data)
        self._names = [(name, f"{name}.sigma") for name in self.reported]
        self._short = self._limit.short
        self._addresses = tuple(a.ctypes.data for a in (self._carry, self._sample, self._constant, self._output))
        self.reset()

    def reset(self) -> None:
        """Forget everything; the next sample is the first."""
        self._time = math.nan
        self._inputs = [math.nan] * len(self.inputs)  # last ones seen
        self._seen = [-math.inf] * len(self.inputs)  # and when
        self._accepted = -math.inf  # when a measurement was last used
        self._running = False
        self._last = self._inputs

    def push(self, sample: Mapping[str, float | None]) -> dict[str, float]:
        """One sample: "time" and signals in SI; a signal that is missing, None or NaN was not measured.

        Returns:
            The reported states and "<state>.sigma", NaN where they may not be believed, and "status".

        Raises:
            SignalError: time is missing, not finite, or does not go forward. The observer is as it was.
        """
        time = sample.get("time", math.nan)
        if time is None or not math.isfinite(time):
            raise SignalError(f"time: expected seconds, got {time}; every sample needs its time")
        gap = time - self._time
        if gap <= 0:
            raise SignalError(f"time: {time:g} s comes after {self._time:g} s; samples must go forward in time")
        status, inputs = self._inputs_at(time, sample)
        previous, self._time = self._time, time
        if status != Status.OK:
            self._running = False
            return self._answer(status)
        row = self._row
        k, m = len(self.inputs), len(self.outputs)
        if not self._running or gap > self.settings.max_gap:
            self._start(inputs)
            self._accepted = time
            row[0] = 0.0
            row[1 : 1 + k] = inputs
        else:
            last = self._last
            if gap > self._short[int(inputs[0])] or gap > self._short[int(last[0])]:
                self._between(previous, time, last, inputs)
            else:
                row[0] = gap
                row[1 : 1 + k] = last
        row[1 + k : 1 + 2 * k] = inputs
        for i, name in enumerate(self.outputs):
            value = sample.get(name)
            there = value is not None and math.isfinite(value)
            row[1 + 2 * k + i] = value if there else 0.0
            row[1 + 2 * k + m + i] = there
        self.scan.single(1, 1, *self._addresses)
        self._last = inputs
        if any(self._out[-m:]):
            self._accepted = time
        elif time - self._accepted > self.settings.coast:
            status = Status.COASTING
        return self._answer(status)

    def _inputs_at(self, time: float, sample: Mapping[str, float | None]) -> tuple[Status, list[float]]:
        """Inputs at this sample, held where they are missing, and whether they will do."""
        missing = False
        for i, name in enumerate(self.inputs):
            value = sample.get(name)
            if value is not None and math.isfinite(value) and (i or value <= FASTEST):
                self._inputs[i], self._seen[i] = float(value), time
            elif not time - self._seen[i] <= self.settings.hold:
                missing = True
        if missing:
            return Status.INPUT_MISSING, self._inputs
        slow = self._inputs[0] < self.settings.min_speed
        return (Status.TOO_SLOW if slow else Status.OK), list(self._inputs)

    def _start(self, inputs: list[float]) -> None:
        self._carry[:] = self._known.start(dict(zip(self.inputs, inputs, strict=True)))
        self._running = True

    def _between(self, before: float, time: float, last: list[float], inputs: list[float]) -> None:
        """Steps without measurements up to the last one, which is left in the sample."""
        limits = self._limit(np.array([last[0], inputs[0]]))
        fine, columns, _ = steps.subdivide(np.array([before, time]), np.array([last, inputs]), limits)
        dt, d = steps.step_inputs(fine, columns)
        rows = np.zeros((len(fine) - 1, self.scan.n_sample))
        rows[:, 0], rows[:, 1 : 1 + d.shape[1]] = dt[1:], d[1:]
        self._carry[:], _ = self.scan(self._carry, rows[:-1], self._constant)
        self._sample[0] = rows[-1]

    def _answer(self, status: Status) -> dict[str, float]:
        n = len(self.reported)
        answer: dict[str, float] = {"time": self._time, "status": status}
        if status in (Status.OK, Status.COASTING):
            shown = self._out[: 2 * n]
            for i, (name, sigma) in enumerate(self._names):
                answer[name] = shown[i]
                answer[sigma] = math.sqrt(max(shown[n + i], 0.0))
        else:
            for name, sigma in self._names:
                answer[name] = answer[sigma] = math.nan
        return answer

    def batch(self, record: Record, uncertainty: Uncertainty | None = None) -> States:
        """A whole record, from a fresh start; the observer's own state does not change.

        Args:
            uncertainty: of the truck's parameters and its sensors' errors; every sigma then holds what comes of that,
                too, and all else stays as it is.

        Raises:
            SignalError: the record has not the signals that the observer was made for, or something is uncertain that
                the truck and its sensors do not have.
        """
        return offline.states(record, self._known, self._limit, uncertainty, smooth=False)

    def smooth(self, record: Record, uncertainty: Uncertainty | None = None) -> States:
        """As `batch`, but every state is told given all samples of its stretch, those to come included.

        A stretch is what the filter runs through without a new start. Status and innovations are those of `batch`.
        """
        return offline.states(record, self._known, self._limit, uncertainty, smooth=True)

    def _made_for(self) -> dict[str, Any]:
        """Truck, signals and settings, fit for JSON."""
        limits = ("min_speed", "hold", "coast", "max_gap", "bank")
        return {
            "signals": [*self.inputs, *self.outputs],
            "limits": {name: getattr(self.settings, name) for name in limits},
            "constant": self._constant.tolist(),
        }

    def save(self) -> dict[str, Any]:
        """All that `resume` needs to go on, fit for JSON."""

        def finite(values: Iterable[float]) -> list[float | None]:
            return [value if math.isfinite(value) else None for value in values]

        return {
            "made_for": self._made_for(),
            "time": finite([self._time])[0],
            "inputs": finite(self._inputs),
            "seen": finite(self._seen),
            "accepted": finite([self._accepted])[0],
            "running": self._running,
            "last": finite(self._last),
            "carry": self._carry.tolist(),
        }

    def resume(self, saved: Mapping[str, Any]) -> None:
        """Go on where `save` was called, in another process or on another day.

        Raises:
            SignalError: it was saved by an observer of another truck, other signals or other settings.
        """
        if saved["made_for"] != self._made_for():
            raise SignalError("state: saved by an observer of another truck, other signals or settings; start afresh")
        self._time = math.nan if saved["time"] is None else saved["time"]
        self._inputs = [math.nan if value is None else value for value in saved["inputs"]]
        self._seen = [-math.inf if value is None else value for value in saved["seen"]]
        self._accepted = -math.inf if saved["accepted"] is None else saved["accepted"]
        self._running = saved["running"]
        self._last = [math.nan if value is None else value for value in saved["last"]]
        self._carry[:] = saved["carry"]
