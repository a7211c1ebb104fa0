"""What is around the compiled step of a filter that processes one sample at a time."""

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Protocol

import numpy as np

from fifthwheel.base.errors import SignalError
from fifthwheel.estimate.stream.settings import Status, StreamSettings
from fifthwheel.model.dynamics import simulation
from fifthwheel.model.dynamics.speed_rate import SpeedRate


class StreamFilter(Protocol):
    """A filter that a stream drives."""

    @property
    def row(self) -> Any:
        """Memory of the sample [dt, d, y, weight] of its compiled step."""

    def start(self, stream: "Stream") -> None:
        """Set the state at the inputs of this sample."""

    def ends(self, stream: "Stream") -> tuple[Sequence[float], Sequence[float]]:
        """Inputs of the model at the last sample and at this one, the speed first."""

    def step(self) -> None:
        """Process a row between two samples."""

    def update(self, stream: "Stream") -> bool:
        """Process the row of a sample; whether a measurement was accepted, or the state started again."""


class Stream:
    """Takes the samples of a filter in the order of time, and writes them as rows of its compiled step.

    Args:
        settings: plausible inputs, and limits of time.
        step_limit: longest step of the model.
    """

    def __init__(self, settings: StreamSettings, step_limit: simulation.StepLimit) -> None:
        self.settings, self.step_limit = settings, step_limit
        self.time = self.accepted = -math.inf
        """Times of the last sample and of the last accepted measurement, s."""
        self.times = [-math.inf] * len(settings.inputs)
        """When each input was measured, s."""
        self.gap = 0.0
        """Time since the last sample, s; 0 at a start."""
        self.inputs: list[float] = []
        """Speed and steer angles, and what is derived from them, at this sample, plausible or held."""
        self.last: list[float] = []
        """The same at the last sample; at a start at this one."""
        self._held = [math.nan] * len(settings.inputs) + [0.0] * (len(settings.names) - len(settings.inputs))
        self._confirmed = [False] * len(settings.inputs)  # whether a second value has followed the first one
        self._running = False  # whether there is a state
        self._rules = [(i, rule.largest, rule.jump, rule.rate) for i, rule in enumerate(settings.inputs)]
        self._largest = list(settings.measured.values())
        self._speed_rate = SpeedRate(settings.speed_smoothing, settings.max_gap)

    def process_sample(
        self, driven: StreamFilter, time: float | None, inputs: Iterable[float | None], measured: Iterable[float | None]
    ) -> Status:
        """Process speed and steer angles, and measurements, of a sample; None or NaN if missing.

        Raises:
            SignalError: the time is missing, not finite, or not after the previous one. Nothing has changed.
        """
        previous = self.time
        status = self._take(time, inputs)
        if status != Status.OK:
            self._running = False
            return status
        if not self._running or self.gap > self.settings.max_gap:
            self.start(driven)
        before, after = driven.ends(self)
        gap, short = self.gap, self.step_limit.safe_step_by_speed
        if gap > short[int(after[0])] or gap > short[int(before[0])]:
            gap, before = self._divide(driven, previous, before, after)
        self._write(driven.row, gap, (*before, *after), measured)
        if driven.update(self):
            self.accepted = self.time
        self.last = self.inputs
        return Status.COASTING if self.coasts else Status.OK

    def start(self, driven: StreamFilter) -> None:
        """Start the state with this sample: no step leads to it."""
        driven.start(self)
        self.gap, self.last, self.accepted, self._running = 0.0, self.inputs, self.time, True

    @property
    def coasts(self) -> bool:
        """Whether no measurement was accepted for too long."""
        return self.time - self.accepted > self.settings.coast

    def _take(self, time: float | None, values: Iterable[float | None]) -> Status:
        """Take time and plausible inputs: OK, TOO_SLOW or INPUT_MISSING."""
        if time is None or not math.isfinite(time):
            raise SignalError(f"time: expected seconds, got {time}; give every sample its time")
        gap = time - self.time
        if gap <= 0:
            raise SignalError(
                f"time: expected after {self.time:g} s, got {time:g} s; push samples in the order of time"
            )
        settings, held, times, confirmed, fresh = self.settings, self._held, self.times, self._confirmed, True
        hold = settings.hold
        for (i, largest, jump, rate), value in zip(self._rules, values, strict=True):
            age = time - times[i]
            # the magnitude of a value that is NaN or infinite is not below the largest one
            if (
                value is not None
                and abs(value) <= largest
                and (
                    (agrees := age <= hold and ((change := abs(value - held[i])) <= jump or change <= rate * age))
                    or age > hold
                    or not confirmed[i]
                )
            ):
                held[i], times[i], confirmed[i] = float(value), time, agrees
                if not i:
                    held[-1] = self._speed_rate.update(age, held[0])
            elif age > hold:
                fresh = False
        self.time, self.gap = time, gap
        if not fresh:
            return Status.INPUT_MISSING
        self.inputs = list(held)
        return Status.TOO_SLOW if held[0] < settings.min_speed else Status.OK

    def _write(self, row: Any, gap: float, inputs: Sequence[float], measured: Iterable[float | None]) -> None:
        """Write duration, inputs at both ends and measurements of a step to its row."""
        row[0] = gap
        i = 1
        for value in inputs:
            row[i] = value
            i += 1
        m = len(self._largest)
        for reading, largest in zip(measured, self._largest, strict=True):
            present = reading is not None and abs(reading) <= largest
            row[i] = reading if present else 0.0
            row[i + m] = present
            i += 1

    def _divide(
        self, driven: StreamFilter, previous: float, before: Sequence[float], after: Sequence[float]
    ) -> tuple[float, Sequence[float]]:
        """Process all steps since the previous sample but the last; the length of that, and the inputs before it."""
        limits = self.step_limit(np.array([before[0], after[0]]))
        times, inputs, _ = simulation.subdivide(np.array([previous, self.time]), np.array([before, after]), limits)
        dt, d = simulation.step_inputs(times, inputs)
        memory, n_d = np.asarray(driven.row), d.shape[1]
        memory[1 + n_d :] = 0.0
        for k in range(1, len(dt) - 1):
            memory[0], memory[1 : 1 + n_d] = dt[k], d[k]
            driven.step()
        return float(dt[-1]), d[-1, : len(before)].tolist()

    def save(self) -> dict[str, Any]:
        """All that changes, for `resume` and JSON."""

        def finite(values: Iterable[float]) -> list[float | None]:
            return [value if math.isfinite(value) else None for value in values]

        return {
            "time": finite([self.time])[0],
            "inputs": finite(self._held),
            "seen": finite(self.times),
            "confirmed": list(self._confirmed),
            "speed_rate": self._speed_rate.carry.tolist(),
            "accepted": finite([self.accepted])[0],
            "running": self._running,
            "last": finite(self.last),
        }

    def resume(self, saved: Mapping[str, Any]) -> None:
        """Continue from the result of `save`."""

        def numbers(values: Iterable[float | None], missing: float) -> list[float]:
            return [missing if value is None else value for value in values]

        self.time, self.accepted = numbers([saved["time"], saved["accepted"]], -math.inf)
        self._held, self.last = (numbers(saved[key], math.nan) for key in ("inputs", "last"))
        self.times, self._running = numbers(saved["seen"], -math.inf), saved["running"]
        self._confirmed = list(saved["confirmed"])
        self._speed_rate.carry[:] = saved["speed_rate"]
