"""The live node: frames in, states out. It has no clock, no thread and no socket, so that a replay is the same code."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Protocol

from fifthwheel.apps.live.sampler import LATE, Cycle, Sampler
from fifthwheel.apps.live.status import HARMLESS, Health, LiveFault, NodeStatus, SignalHealth
from fifthwheel.apps.live.time_base import MAX_GAP, TimeBase
from fifthwheel.data.logs import LiveMap
from fifthwheel.data.logs.can.database import Frame, FrameDecoder
from fifthwheel.estimate.observe import Status
from fifthwheel.estimate.observe.states import LIFT_SAMPLES, time_to_lift
from fifthwheel.estimate.stream import VALID

RATE = 100.0
"""Of the outputs, Hz."""
SHOWN = 1.0
"""A jump of the time or an overload is reported for this time, s."""
LATE_FRAME = 0.05
"""A frame that arrives so long after its cycle means that the computer or the interface does not keep up, s."""
_INPUT_MISSING: Mapping[str, float] = {"status": Status.INPUT_MISSING, "nis": math.nan}


class LiveEstimator(Protocol):
    """`Observer` or `Learner`."""

    def push(self, sample: Mapping[str, float | None], /) -> dict[str, float]:
        """The states at a sample."""

    def reset(self) -> None:
        """Start the states again."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Output:
    """The states of one cycle."""

    time: float  # since the start of the node, s; always increasing
    bus_time: float  # the same instant by the clock of the bus, s
    status: NodeStatus
    faults: LiveFault
    problems: Mapping[str, LiveFault]  # fault of a column
    states: Mapping[str, float]
    """States, each with "<state>.sigma", SI; NaN if the status is TOO_SLOW, INPUT_MISSING or FAILED. With an
    observer also "nis", with a learner "learning"."""
    samples: tuple[Mapping[str, float], ...]  # samples of this cycle, as the estimator received them


class Node:
    """States from the frames of one or several buses.

    The same frames give the same outputs, whenever they arrive. Call `advance` when no frame arrives. The columns
    `extra` are those that the decoder has beside those of the map.
    """

    def __init__(
        self, estimator: LiveEstimator, decoder: FrameDecoder, live_map: LiveMap, *, extra: tuple[str, ...] = ()
    ) -> None:
        self.estimator, self.decoder = estimator, decoder
        self.faults = LiveFault.NONE
        """Faults that the node cannot see, such as those of the bus; see `set_fault`."""
        self.extra: dict[str, float] = {}
        """Last valid value of the extra columns."""
        self._map, self._sampler, self._time_base = live_map, Sampler(RATE), TimeBase()
        self._health = Health(column for column in decoder.columns if column not in extra)
        self._signals = SignalHealth()
        self._lifting = 0  # consecutive outputs at which a wheel is about to lift
        self.extra_columns = extra
        self._answer: Mapping[str, float] = _INPUT_MISSING
        self._jumps, self._jumped, self._delayed = 0, -math.inf, -math.inf

    def set_fault(self, fault: LiveFault, present: bool) -> None:
        """Set or clear a fault that the node cannot see."""
        if (int(self.faults) & int(fault) != 0) != present:  # operations on flags are slow
            self.faults ^= fault

    @property
    def newest(self) -> float:
        """Time of the bus of the newest frame, or of `advance`, s; -inf before the first one."""
        return self._time_base.newest + self._time_base.origin if math.isfinite(self._time_base.newest) else -math.inf

    def receive(self, frame: Frame) -> list[Output]:
        """Take up a frame; gives the outputs of the cycles that end before it."""
        outputs: list[Output] = []
        before = self._time_base.newest
        for time, counted in self._time_base.assign(frame):
            if time - before > MAX_GAP:
                outputs += self._skip(before, time)
            if self._time_base.newest - time > LATE_FRAME:
                self._delayed = self._time_base.newest
            before = time
            for column, value, quality in self.decoder.decode(counted):
                if column in self.extra_columns:
                    if value == value:
                        self.extra[column] = value
                    continue
                outputs += map(self._output, self._sampler.put(time, column, value))
                self._health.update(time, column, quality)
        return outputs

    def advance(self, bus_time: float) -> list[Output]:
        """The outputs that are due at a time of the bus, s, if no frame arrives before it."""
        if math.isnan(self._time_base.origin):
            self._time_base.start(bus_time)
        time = bus_time - self._time_base.origin
        self._sampler.start(time)
        if not time > self._time_base.newest:
            return []
        self._time_base.advance(time)
        return [self._output(cycle) for cycle in self._sampler.advance(time)]

    def finish(self) -> list[Output]:
        """The output of the last cycle, when no further frame comes."""
        return self.advance(self.newest + LATE / RATE) if math.isfinite(self.newest) else []

    def _skip(self, before: float, time: float) -> Iterator[Output]:
        """The outputs at the beginning of a gap; then the cycles begin again."""
        if math.isfinite(before):
            yield from (self._output(cycle) for cycle in self._sampler.advance(before + MAX_GAP))
            self._sampler.restart()
            self._health.restart(time)

    def _output(self, cycle: Cycle) -> Output:
        samples = tuple(self._map.push({"time": cycle.time, **cycle.values}))
        for sample in samples:
            self._answer = self.estimator.push(sample)
            self._signals.update(sample)
        answer = self._answer
        if self._time_base.jumps > self._jumps:
            self._jumps, self._jumped = self._time_base.jumps, cycle.time
        problems = self._health.problems(cycle.time)
        faults = self.faults | self._health.faults(problems)
        for name, fault in self._signals.problems().items():
            problems[name], faults = fault, faults | fault
        if cycle.time - self._jumped < SHOWN:
            faults |= LiveFault.TIME_JUMP
        if cycle.time - self._delayed < SHOWN:
            faults |= LiveFault.OVERLOAD
        self._lifting = self._lifting + 1 if math.isfinite(time_to_lift(answer)) else 0
        if self._lifting >= LIFT_SAMPLES:
            faults |= LiveFault.WHEEL_LIFT
        status = NodeStatus(int(answer["status"]))
        states = {name: value for name, value in answer.items() if name not in ("time", "status")}
        if int(status) in VALID:
            if not all(map(math.isfinite, states.values())):
                status, states = NodeStatus.FAILED, dict.fromkeys(states, math.nan)
                self.estimator.reset()
            elif status is NodeStatus.OK and faults & ~HARMLESS:
                status = NodeStatus.DEGRADED
        time = answer.get("time", cycle.time)
        return Output(
            time=time,
            bus_time=time + self._time_base.origin,
            status=status,
            faults=faults,
            problems=problems,
            states=states,
            samples=samples,
        )
