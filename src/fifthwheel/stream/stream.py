"""What is around the compiled step of a filter that processes one sample at a time."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from fifthwheel.dynamics import steps
from fifthwheel.dynamics.speed_rate import SpeedRate
from fifthwheel.errors import SignalError
from fifthwheel.stream.settings import Status, StreamSettings


class Stream:
    """Takes the samples of a filter in the order of time, and writes them as rows of its compiled step.

    For each sample: `take`; if that `starts`, the filter sets its state; `write`, then the step; `finish`.

    Args:
        settings: plausible inputs, and limits of time.
        step_limit: longest step of the model.
    """

    def __init__(self, settings: StreamSettings, step_limit: steps.StepLimit) -> None:
        self.settings, self.step_limit = settings, step_limit
        self.time = self.accepted = -math.inf
        """Times of the last sample and of the last accepted measurement, s."""
        self.times = [-math.inf] * len(settings.inputs)
        """When each input was measured, s."""
        self.starts = False
        """Whether the state starts with this sample."""
        self.gap = 0.0
        """Time since the last sample, s; 0 at a start."""
        self.inputs: list[float] = []
        """Of the model, at this sample."""
        self.last: list[float] = []
        """The same at the last sample; at a start at this one."""
        self._held = [math.nan] * len(settings.inputs) + [0.0] * (len(settings.names) - len(settings.inputs))
        self._running = False  # whether there is a state
        self._previous = -math.inf  # time of the last sample
        self._rules = [(i, rule.largest, rule.jump, rule.rate) for i, rule in enumerate(settings.inputs)]
        self._largest = list(settings.measured.values())
        smoothing = settings.speed_smoothing
        self._speed_rate = None if smoothing is None else SpeedRate(smoothing, settings.max_gap)

    def take(self, time: float | None, values: Sequence[float | None]) -> Status:
        """Take time and inputs of a sample: OK, TOO_SLOW or INPUT_MISSING.

        Args:
            time: s.
            values: speed and steer angles, SI; None or NaN if missing.

        Raises:
            SignalError: the time is missing, not finite, or not after the previous one. Nothing has changed.
        """
        if time is None or not math.isfinite(time):
            raise SignalError(f"time: expected seconds, got {time}; give every sample its time")
        gap = time - self.time
        if gap <= 0:
            raise SignalError(
                f"time: expected after {self.time:g} s, got {time:g} s; push samples in the order of time"
            )
        settings, held, times, fresh = self.settings, self._held, self.times, True
        hold = settings.hold
        for i, largest, jump, rate in self._rules:
            value, age = values[i], time - times[i]
            # the magnitude of a value that is NaN or infinite is not below the largest one
            if (
                value is not None
                and abs(value) <= largest
                and (age > hold or (change := abs(value - held[i])) <= jump or change <= rate * age)
            ):
                held[i], times[i] = float(value), time
                if self._speed_rate and not i:
                    held[-1] = self._speed_rate.update(age, held[0])
            elif age > hold:
                fresh = False
        self._previous, self.time, self.gap = self.time, time, gap
        if not fresh or held[0] < settings.min_speed:
            self._running = False
            return Status.TOO_SLOW if fresh else Status.INPUT_MISSING
        self.inputs = list(held)
        self.starts = not self._running or gap > settings.max_gap
        if self.starts:
            self._running, self.accepted = True, time
            self.start()
        return Status.OK

    def start(self) -> None:
        """Start the state with this sample."""
        self.gap, self.last = 0.0, self.inputs

    def write(
        self,
        row: Any,
        before: Sequence[float],
        after: Sequence[float],
        measured: Iterable[float | None],
        step: Callable[[], object],
    ) -> None:
        """Write the sample to the row [dt, d, y, weight] of a compiled step.

        Args:
            row: memory of the step.
            before, after: inputs of the model at both ends of the step; the speed first.
            measured: SI; None or NaN if missing.
            step: processes the row. It is called for all steps but the last one if the model needs several.
        """
        gap, short = self.gap, self.step_limit.safe_step_by_speed
        if gap > short[int(after[0])] or gap > short[int(before[0])]:
            gap, before = self._divide(row, before, after, step)
        row[0] = gap
        i = 1
        for value in (*before, *after):
            row[i] = value
            i += 1
        m = len(self._largest)
        for reading, largest in zip(measured, self._largest, strict=True):
            present = reading is not None and abs(reading) <= largest
            row[i] = reading if present else 0.0
            row[i + m] = present
            i += 1

    def _divide(
        self, row: Any, before: Sequence[float], after: Sequence[float], step: Callable[[], object]
    ) -> tuple[float, Sequence[float]]:
        """Process all steps but the last one; the length of that, and the inputs before it."""
        limits = self.step_limit(np.array([before[0], after[0]]))
        times, inputs, _ = steps.subdivide(np.array([self._previous, self.time]), np.array([before, after]), limits)
        dt, d = steps.step_inputs(times, inputs)
        memory, n_d = np.asarray(row), d.shape[1]
        memory[1 + n_d :] = 0.0
        for k in range(1, len(dt) - 1):
            memory[0], memory[1 : 1 + n_d] = dt[k], d[k]
            step()
        return float(dt[-1]), d[-1, : len(before)].tolist()

    def finish(self, accepted: bool) -> Status:
        """OK or COASTING after a sample of which a measurement was accepted, or none."""
        self.last = self.inputs
        if accepted:
            self.accepted = self.time
        return Status.COASTING if self.time - self.accepted > self.settings.coast else Status.OK

    def save(self) -> dict[str, Any]:
        """All that changes, for `resume` and JSON."""

        def finite(values: Iterable[float]) -> list[float | None]:
            return [value if math.isfinite(value) else None for value in values]

        return {
            "time": finite([self.time])[0],
            "inputs": finite(self._held),
            "seen": finite(self.times),
            "speed_rate": self._speed_rate.carry.tolist() if self._speed_rate else None,
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
        if self._speed_rate:
            self._speed_rate.carry = np.array(saved["speed_rate"])
