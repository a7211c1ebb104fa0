"""The on-line state estimator of a vehicle: a Kalman filter for single samples and for records.

Section 2.3 of Cheng and Cebon (2011). `push` processes one sample; `batch` processes a record and gives the same result
as `push`, bit for bit. Both are causal: missing inputs are not interpolated from later samples.
"""

import copy
import ctypes
import functools
import math
from collections.abc import Iterable, Mapping
from typing import Any, Self

import numpy as np

from fifthwheel._lazy import lazy
from fifthwheel._types import Array
from fifthwheel.channels import (
    LATERAL_ACCELERATION,
    MEASURED,
    ROLL,
    ROLL_RATE,
    is_of,
    measured_signals,
    names_of,
)
from fifthwheel.dynamics import SPEED_RATE, steps
from fifthwheel.errors import SignalError, suggestion
from fifthwheel.native import Scan
from fifthwheel.observe import monitor, offline
from fifthwheel.observe.inputs import HeldInputs, magnitude
from fifthwheel.observe.observed_chain import ObservedChain, observed_chain
from fifthwheel.observe.observer_model import ObserverModel, signals_with_position
from fifthwheel.observe.observer_step import reported_signals
from fifthwheel.observe.settings import ObserverSettings
from fifthwheel.observe.states import States, Status
from fifthwheel.observe.uncertainty import Uncertainty
from fifthwheel.record import Record
from fifthwheel.vehicle import Vehicle


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
        self.outputs = measured_signals(available, units, MEASURED)
        accelerometers = names_of(LATERAL_ACCELERATION, self.outputs)
        if len(accelerometers) == len(self.outputs):  # its offset alone would decide
            raise SignalError(
                f"yaw_rate.{units[0]}: not among the signals; an observer needs at least one yaw rate, roll rate, roll "
                "angle or articulation angle of a unit of the vehicle"
            )
        self.inputs = ("speed", *self.vehicle.steer_signals())
        self.roll = any(is_of(name, ROLL_RATE, ROLL, LATERAL_ACCELERATION) for name in self.outputs)
        self.reported = reported_signals(vehicle, roll=self.roll, bank=self.settings.estimate_bank)
        for name in self.settings.positions:
            if name not in (allowed := signals_with_position(self.reported)):
                raise SignalError(f"{name}: has no position; positions can be given for {', '.join(allowed)}")
        groups = [unit.group_path(group) for unit in vehicle.units for group in unit.axle_groups]
        for path in self.settings.brakes:
            if path not in groups:
                raise SignalError(f"brakes, {path}: {vehicle.name} has no such axle group; {suggestion(path, groups)}")
        self._measured = [(name, magnitude(name)) for name in self.outputs]
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
                accelerometers=names_of(LATERAL_ACCELERATION, self.outputs),
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
        self._time = math.nan
        derived = [SPEED_RATE] if self.settings.tyres == "saturating" else []
        self._held = HeldInputs((*self.inputs, *derived), self.settings)
        self._accepted = -math.inf  # time of the last accepted measurement
        self._running = False
        self._last: list[float] = []  # inputs of the previous sample

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
        time = sample.get("time", math.nan)
        if time is None or not math.isfinite(time):
            raise SignalError(f"time: expected seconds, got {time}; give every sample its time")
        gap = time - self._time
        if gap <= 0:
            raise SignalError(
                f"time: expected after {self._time:g} s, got {time:g} s; push samples in the order of time"
            )
        fresh = self._held.update(time, sample)
        inputs = list(self._held.values)
        slow = Status.TOO_SLOW if inputs[0] < self.settings.min_speed else Status.OK
        status = slow if fresh else Status.INPUT_MISSING
        previous, self._time = self._time, time
        if status != Status.OK:
            self._running = False
            return self._answer(status)
        buffers = self._buffers
        row = buffers.row
        k, m = len(inputs), len(self.outputs)
        if not self._running or gap > self.settings.max_gap:
            self._start(inputs, monitor.START)
            self._running, self._accepted = True, time
            row[0] = 0.0
            row[1 : 1 + k] = inputs
        else:
            last, short = self._last, self._model.step_limit.safe_step_by_speed
            if gap > short[int(inputs[0])] or gap > short[int(last[0])]:
                self._subdivide(previous, time, last, inputs)
            else:
                row[0] = gap
                row[1 : 1 + k] = last
        row[1 + k : 1 + 2 * k] = inputs
        for i, (name, largest) in enumerate(self._measured, 1 + 2 * k):
            value = sample.get(name)
            present = value is not None and abs(value) <= largest
            row[i] = value if present else 0.0
            row[i + m] = present
        buffers.step()
        out = buffers.out
        if out[-1]:  # the measurements contradict the state
            self._start(inputs, monitor.after_restart(out[-2]), suspect=True)
            row[0] = 0.0
            row[1 : 1 + k] = inputs
            buffers.step()
        self._last = inputs
        if any(out[-2 - m : -2]):
            self._accepted = time
        elif time - self._accepted > self.settings.coast:
            status = Status.COASTING
        if out[-2] > self.settings.max_nis:
            status = Status.INCONSISTENT
        return self._answer(status)

    def _start(self, inputs: list[float], monitored: Array, *, suspect: bool = False) -> None:
        """Start the filter at the steady state of the inputs; `monitored` is the carry of the monitor."""
        start = self._model.start(dict(zip(self.model.inputs, inputs, strict=True)), suspect=suspect)
        self._buffers.carry[:] = np.append(start, monitored)

    def _subdivide(self, before: float, time: float, last: list[float], inputs: list[float]) -> None:
        """Run all steps but the last one without measurements, and store the last one in the row."""
        buffers = self._buffers
        limits = self._model.step_limit(np.array([last[0], inputs[0]]))
        fine, columns, _ = steps.subdivide(np.array([before, time]), np.array([last, inputs]), limits)
        dt, d = steps.step_inputs(fine, columns)
        rows = np.zeros((len(fine) - 1, self.scan.n_sample))
        rows[:, 0], rows[:, 1 : 1 + d.shape[1]] = dt[1:], d[1:]
        buffers.carry[:], _ = self.scan(buffers.carry, rows[:-1], buffers.constant)
        buffers.sample[0] = rows[-1]

    def _answer(self, status: Status) -> dict[str, float]:
        """The result of `push`."""
        answer: dict[str, float] = {"time": self._time, "status": status}
        if status in (Status.OK, Status.COASTING, Status.INCONSISTENT):
            n = len(self.reported)
            values = self._buffers.out[: 2 * n]
            answer["nis"] = self._buffers.out[-2]
            for i, (name, sigma) in enumerate(self._names):
                answer[name] = values[i]
                answer[sigma] = math.sqrt(max(values[n + i], 0.0))
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

        def finite(values: Iterable[float]) -> list[float | None]:
            return [value if math.isfinite(value) else None for value in values]

        return {
            "made_for": self._identity(),
            "time": finite([self._time])[0],
            "inputs": finite(self._held.values),
            "seen": finite(self._held.times),
            "speed_rate": self._held.speed_rate.carry.tolist() if self._held.speed_rate else None,
            "accepted": finite([self._accepted])[0],
            "running": self._running,
            "last": finite(self._last),
            "carry": self._buffers.carry.tolist(),
        }

    def resume(self, saved: Mapping[str, Any]) -> None:
        """Continue from the result of `save`, also in another process.

        Raises:
            SignalError: an observer of another vehicle, other signals or other settings saved it.
        """
        if saved["made_for"] != self._identity():
            raise SignalError(
                "state: expected one of the same vehicle, signals and settings, got another one; start without it"
            )
        self._time = math.nan if saved["time"] is None else saved["time"]
        self._held.values = [math.nan if value is None else value for value in saved["inputs"]]
        self._held.times = [-math.inf if value is None else value for value in saved["seen"]]
        if self._held.speed_rate:
            self._held.speed_rate.carry = np.array(saved["speed_rate"])
        self._accepted = -math.inf if saved["accepted"] is None else saved["accepted"]
        self._running = saved["running"]
        self._last = [math.nan if value is None else value for value in saved["last"]]
        self._buffers.carry[:] = saved["carry"]


class _Buffers:
    """Arrays of the compiled step for one sample.

    `row` and `out` are the memory of `sample` and `output` as C arrays, which Python accesses ten times as fast.
    """

    def __init__(self, scan: Scan, constant: Array, carry: Array | None) -> None:
        self.constant = constant
        self.carry = np.zeros(scan.n_carry) if carry is None else carry.copy()
        self.sample = np.zeros((1, scan.n_sample))
        self.output = np.zeros((1, scan.n_output))
        self.row: Any = (ctypes.c_double * self.sample.size).from_buffer(self.sample.data)
        self.out: Any = (ctypes.c_double * self.output.size).from_buffer(self.output.data)
        addresses = (a.ctypes.data for a in (self.carry, self.sample, constant, self.output))
        self.step = functools.partial(scan.single, 1, 1, *addresses)
        """Process the sample in place."""
