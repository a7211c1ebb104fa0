"""The state estimator of a known truck: a Kalman filter, the same for a record and for one sample after another.

The article's section 2.3. `push` takes a sample as it comes; `batch` takes a record and gives, bit for bit, what `push`
would have given. Both are causal: nothing is interpolated from samples that are still to come.
"""

import ctypes
import functools
import itertools
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from fifthwheel import dynamics
from fifthwheel.dynamics import ChainModel, steps
from fifthwheel.errors import SignalError
from fifthwheel.filters import Noise, kalman
from fifthwheel.filters.model import pack, pack_array, packed_size, sample_rows, sizes, split, unpack
from fifthwheel.logs import Record
from fifthwheel.native import Scan
from fifthwheel.observe import noise as variances
from fifthwheel.observe.prepare import locked_but
from fifthwheel.observe.states import States, Status
from fifthwheel.vehicle import Vehicle

Array = NDArray[np.float64]
MEASURED = ("yaw_rate", "articulation", "roll_rate", "roll")
FASTEST = float(steps.SPEEDS[-1])
"""A speed above this, m/s, counts as missing: no truck has it, and the model's steps would have to be ever shorter."""


@dataclass(frozen=True, kw_only=True)
class ObserverSettings:
    """How states are observed."""

    min_speed: float = 5.0
    """Below this the linear tyre model does not hold, m/s: the states are NaN and the status is TOO_SLOW."""
    hold: float = 0.5
    """A missing speed or steer angle keeps its last value for so long, s; then the status is INPUT_MISSING."""
    coast: float = 1.0
    """Without an accepted measurement for so long, s, the status is COASTING."""
    max_gap: float = 1.0
    """After a longer gap in time, s, the filter starts anew."""
    gate: float = 6.0
    """Innovations beyond so many standard deviations are not used."""
    noise: Mapping[str, float] = field(default_factory=dict)
    """Variance of a signal's noise, SI squared; the article's R where not given."""
    process_noise: float = 1.0
    """Process noise, in units of the default (`observe.noise.OBSERVED`, the article's equation (14))."""
    zeros: Mapping[str, float] = field(default_factory=dict)
    """Zeros, gains and delays of sensors by name, such as "steer.tractor.front.offset"; none by default. A delay of the
    steer angle is taken out by its slope, which makes its noise louder: a smooth channel is worth having."""
    places: Mapping[str, float] = field(default_factory=dict)
    """Where a unit's sideslip is told, x on the unit in m, by name, such as "sideslip.semitrailer": -2.34 for a sensor
    at the landing leg; under the CoG by default."""

    def __post_init__(self) -> None:
        for name in ("min_speed", "coast", "max_gap", "gate"):
            if not getattr(self, name) > 0:
                raise SignalError(f"{name}: expected above 0, got {getattr(self, name)}")
        for name in ("hold", "process_noise"):
            if not getattr(self, name) >= 0:
                raise SignalError(f"{name}: expected 0 or more, got {getattr(self, name)}")
        for name, variance in self.noise.items():
            if not 0 < variance < math.inf:
                raise SignalError(f"{name}: expected a variance above 0, got {variance}")


def reported(vehicle: Vehicle, *, roll: bool) -> tuple[str, ...]:
    """Signals that an observer gives: sideslip, yaw rate, articulation, and roll and roll rate if the model rolls."""
    units = [unit.name for unit in vehicle.units]
    names = [f"{quantity}.{u}" for quantity in ("sideslip", "yaw_rate") for u in units]
    names += [f"articulation.{u}" for u in units[1:]]
    return (*names, *[f"{quantity}.{u}" for quantity in ("roll", "roll_rate") for u in units if roll])


@functools.cache
def step(model: ChainModel, report: ChainModel) -> Scan:
    """The compiled step: a Kalman filter of `model` that also gives the outputs of `report` and their variances.

    carry = [x, P]; sample = [dt, d, y, weight]; constant = [c, Q, R, gate^2, c of the report];
    output = [reported, their variances, innovation, variance, accepted].
    """
    n_x, n_d, _, n_c, n_y = sizes(model)
    n_P, n_report = packed_size(n_x), len(report.known)
    carry, sample, constant = (
        ca.SX.sym(name, size)
        for name, size in (
            ("carry", n_x + n_P),
            ("sample", 1 + n_d + 2 * n_y),
            ("constant", n_c + n_P + n_y + 1 + n_report),
        )
    )
    x, P = split(carry, [n_x, n_P])
    dt, d, y, weight = split(sample, [1, n_d, n_y, n_y])
    c, q, r, limit, c_report = split(constant, [n_c, n_P, n_y, 1, n_report])
    none = ca.SX(0, 1)
    before, P_before, _ = kalman.predict(model, x, unpack(P, n_x), dt, d, none, c, unpack(q, n_x))
    predicted, H = kalman.observe(model, before, d, none, c)
    after, P_after, channels, _ = kalman.correct(before, P_before, predicted, H, y, weight, r, limit)
    shown, S = kalman.observe(report, after, d, none, c_report)
    spread = ca.vertcat(*[S[i, :] @ P_after @ S[i, :].T for i in range(S.shape[0])])
    carried = ca.vertcat(after, pack(P_after))
    output = ca.vertcat(shown, spread, kalman.channel_columns(channels))
    return Scan(ca.Function("observer", [carry, sample, constant], [carried, output], {"cse": True}))


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
        self.reported = reported(vehicle, roll=self.roll)
        self.model = dynamics.model(self.vehicle, self.outputs, roll=self.roll)
        self.inputs = self.model.inputs
        report = dynamics.model(self.vehicle, self.reported, roll=self.roll)
        self.scan = step(self.model, report)
        self._limit = steps.StepLimit(self.vehicle, roll=self.roll)
        self._constant = self._constants(report)
        self._sample = np.zeros((1, self.scan.n_sample))
        self._output = np.zeros((1, self.scan.n_output))
        self._carry = np.zeros(self.scan.n_carry)
        # the same memory as plain doubles: an element of a NumPy array costs ten times as much
        self._row: Any = (ctypes.c_double * self._sample.size).from_buffer(self._sample.data)
        self._out: Any = (ctypes.c_double * self._output.size).from_buffer(self._output.data)
        self._names = [(name, f"{name}.sigma") for name in self.reported]
        slowest = max(int(np.searchsorted(steps.SPEEDS, self.settings.min_speed)) - 1, 0)
        crawling = min(self.settings.min_speed / steps.SPEEDS[0], 1.0)
        self._always = float(self._limit.longest[slowest:].min() * crawling)  # no step up to this needs dividing
        self._addresses = tuple(a.ctypes.data for a in (self._carry, self._sample, self._constant, self._output))
        self.reset()

    def _constants(self, report: ChainModel) -> Array:
        values = dynamics.all_parameters(self.vehicle, self.outputs) | dict(self.settings.zeros)
        shown = dynamics.all_parameters(self.vehicle, self.reported)
        shown |= {name: value for name, value in self.settings.zeros.items() if name.startswith("steer.")}
        for name, place in self.settings.places.items():
            if f"{name}.position" not in shown:
                told = ", ".join(n for n in self.reported if f"{n}.position" in shown)
                raise SignalError(f"{name}: has no place to be told at; those that have are {told}")
            shown[f"{name}.position"] = place
        noise = Noise(
            process=variances.process(self.model.states, variances.OBSERVED, self.settings.process_noise),
            measurement=np.array([variances.sensor(self.vehicle, n, self.settings.noise) for n in self.outputs]),
            gate=self.settings.gate,
        )
        return np.concatenate([self.model.known_values(values), noise.vector(), report.known_values(shown)])

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
            if gap > self._always:
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
        x0, P0 = self._initial(inputs)
        self._carry[:] = np.concatenate([x0, pack_array(P0)])
        self._running = True

    def _initial(self, inputs: list[float]) -> tuple[Array, Array]:
        first = dict(zip(self.inputs, inputs, strict=True))
        return variances.initial(self.vehicle, first, self.settings.zeros, roll=self.roll, swing=variances.SWING)

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

    def batch(self, record: Record) -> States:
        """A whole record, from a fresh start; the observer's own state does not change.

        Raises:
            SignalError: the record has not the signals that the observer was made for.
        """
        for name in (*self.inputs, *self.outputs):
            if name not in record.signals:
                raise SignalError(f"{name}: not in {record.name}; make an observer of the signals that it has")
        time, N = record.time, len(record.time)
        inputs, fresh = self._held(record)
        slow = inputs[:, 0] < self.settings.min_speed
        status = np.where(~fresh, Status.INPUT_MISSING, np.where(slow, Status.TOO_SLOW, Status.OK)).astype(np.int8)
        good = status == Status.OK
        begins = good & (
            ~np.concatenate([[False], good[:-1]]) | (np.diff(time, prepend=time[0]) > self.settings.max_gap)
        )
        measured = np.column_stack([record.signals[name] for name in self.outputs])
        output = np.full((N, self.scan.n_output), np.nan)
        edges = [*np.flatnonzero(begins), N]
        for first, following in itertools.pairwise(edges):
            stop = first + int(np.argmin(np.append(good[first:following], False)))
            part = slice(first, stop)
            output[part] = self._run(time[part], inputs[part], measured[part])
            used = output[part, -len(self.outputs) :].any(axis=1)
            since = np.maximum.accumulate(np.where(used, time[part], time[first]))
            status[part] = np.where(time[part] - since > self.settings.coast, Status.COASTING, Status.OK)
        return self._states(record, output, status, measured)

    def _held(self, record: Record) -> tuple[Array, NDArray[np.bool_]]:
        """Inputs (N, k), each missing one at its last value, and whether none is older than may be."""
        columns, fresh = [], np.ones(len(record.time), dtype=bool)
        for name in self.inputs:
            values = record.signals[name]
            seen = np.isfinite(values) & ((name != "speed") | (values <= FASTEST))
            last = np.maximum.accumulate(np.where(seen, np.arange(len(values)), -1))
            age = record.time - record.time[np.maximum(last, 0)]
            fresh &= (last >= 0) & (age <= self.settings.hold)
            columns.append(np.where(last >= 0, values[np.maximum(last, 0)], np.nan))
        return np.column_stack(columns), fresh

    def _run(self, time: Array, inputs: Array, measured: Array) -> Array:
        fine, columns, places = steps.subdivide(time, inputs, self._limit(inputs[:, 0]))
        dt, d = steps.step_inputs(fine, columns)
        y = np.full((len(fine), measured.shape[1]), np.nan)
        y[places] = measured
        x0, P0 = self._initial(inputs[0].tolist())
        rows = sample_rows(dt, d, y)
        _, output = self.scan(np.concatenate([x0, pack_array(P0)]), rows, self._constant)
        return output[places]

    def _states(self, record: Record, output: Array, status: NDArray[np.int8], measured: Array) -> States:
        n, m = len(self.reported), len(self.outputs)
        values, spread, innovation, variance, accepted = np.split(output, np.cumsum([n, n, m, m]), axis=1)
        sigma = np.sqrt(np.maximum(spread, 0.0))
        innovation = np.where(np.isfinite(measured), innovation, np.nan)
        return States(
            name=record.name,
            time=record.time,
            values={name: values[:, i] for i, name in enumerate(self.reported)},
            sigma={name: sigma[:, i] for i, name in enumerate(self.reported)},
            status=status,
            innovation={name: innovation[:, i] for i, name in enumerate(self.outputs)},
            innovation_sigma={name: np.sqrt(variance[:, i]) for i, name in enumerate(self.outputs)},
            accepted={name: accepted[:, i] > 0 for i, name in enumerate(self.outputs)},
        )

    def _made_for(self) -> dict[str, Any]:
        """Truck, signals and settings, fit for JSON."""
        limits = ("min_speed", "hold", "coast", "max_gap")
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
