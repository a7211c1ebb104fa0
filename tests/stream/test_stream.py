"""Which inputs of a sample are plausible, both sides of every limit, and the memory of a stream."""

import json
import math
from collections.abc import Mapping

import numpy as np
import pytest

from fifthwheel.dynamics import steps
from fifthwheel.errors import SignalError
from fifthwheel.identify.online import LearnerSettings
from fifthwheel.identify.online.live_filter import stream_settings as learner_stream
from fifthwheel.identify.online.problem import OnlineProblem
from fifthwheel.identify.settings import OneStage
from fifthwheel.observe import ObserverSettings
from fifthwheel.observe.observer_model import stream_settings as observer_stream
from fifthwheel.stream import Status, Stream, StreamSettings
from fifthwheel.vehicle import get

EDGE = 1e-6
STEER, YAW = "steer.tractor.front", "yaw_rate.tractor"
TRUCK = get("cheng_cebon_2011")
LIMIT = steps.step_limit(TRUCK, True)
LEARNER = learner_stream(
    OnlineProblem.of(TRUCK, ("speed", STEER, YAW), OneStage(priors={}, consider={}, nuisances=False)),
    LearnerSettings(hold=0.4, max_steer=0.9, max_steer_rate=2.0, max_speed_change=1.5),
)


def observer(names: tuple[str, ...] = ("speed", STEER), **settings: float) -> StreamSettings:
    return observer_stream(ObserverSettings(**settings), names, [YAW])


def taken(settings: StreamSettings, *samples: tuple[float, float | None, float | None]) -> tuple[Stream, Status]:
    """The stream after samples of time, speed and steer angle, and the last status."""
    stream = Stream(settings, LIMIT)
    for time, *values in samples:
        status = stream.take(time, values)
    return stream, status


def assert_taken(
    settings: StreamSettings, speed: float | None, steer: float | None, time: float, expected: tuple[bool, bool]
) -> None:
    """Which inputs are taken after a speed of 20 m/s and no steer angle at 0 s."""
    stream, status = taken(settings, (-1.0, None, None), (0.0, 20.0, 0.0), (time, speed, steer))
    assert stream.times == [time if ok else 0.0 for ok in expected]
    if time <= settings.hold or all(expected):
        assert status is Status.OK
        new, old = (speed, steer), (20.0, 0.0)
        assert stream.inputs == [new[i] if ok else old[i] for i, ok in enumerate(expected)]
    else:
        assert status is Status.INPUT_MISSING


@pytest.mark.parametrize(
    ("speed", "steer", "time", "expected"),
    [
        (45.0, 0.1, 9.0, (True, True)),
        (45.0 + EDGE, 0.1, 9.0, (False, True)),
        (20.0, 1.2, 9.0, (True, True)),
        (20.0, -1.2 - EDGE, 9.0, (True, False)),
        (22.0 - EDGE, 0.1, 0.1, (True, True)),
        (22.0 + EDGE, 0.1, 0.1, (False, True)),
        (18.0 - EDGE, 0.1, 0.1, (False, True)),
        (20.0, 0.3 - EDGE, 0.1, (True, True)),
        (20.0, 0.3 + EDGE, 0.1, (True, False)),
        (20.0, -0.3 - EDGE, 0.1, (True, False)),
        (20.0, 0.03 - EDGE, 0.001, (True, True)),  # the change of 10 ms within any shorter time
        (20.0, 0.03 + EDGE, 0.001, (True, False)),
        (29.9, 1.1, 0.3, (False, False)),
        (29.9, 1.1, 0.3 + EDGE, (True, True)),  # any possible value after the longest hold
        (None, None, 0.1, (False, False)),
        (math.nan, math.nan, 0.1, (False, False)),
    ],
)
def test_inputs_of_an_observer(speed, steer, time, expected):
    """20 m/s^2 and 3 rad/s, for 0.3 s, and the largest magnitudes of a truck."""
    assert_taken(observer(hold=0.3), speed, steer, time, expected)


@pytest.mark.parametrize(
    ("speed", "steer", "time", "expected"),
    [
        (20.0, 0.9, 9.0, (True, True)),
        (20.0, -0.9 - EDGE, 9.0, (True, False)),
        (45.0 + EDGE, 0.1, 9.0, (False, True)),
        (-45.0 - EDGE, 0.1, 9.0, (False, True)),
        (45.0, 0.1, 9.0, (True, True)),
        (21.5, 0.1, 0.1, (True, True)),
        (21.5 + EDGE, 0.1, 0.1, (False, True)),
        (18.5 - EDGE, 0.1, 0.1, (False, True)),
        (20.0, 0.2 - EDGE, 0.1, (True, True)),
        (20.0, 0.2 + EDGE, 0.1, (True, False)),
        (20.0, -0.2 - EDGE, 0.1, (True, False)),
        (20.0, -0.4, 0.2 + EDGE, (True, True)),  # the change may be larger after a longer time
        (30.0, 0.8 + EDGE, 0.4, (False, False)),
        (30.0, 0.8 + 0.01, 0.4 + EDGE, (True, True)),  # any possible value after the longest hold
        (None, None, 0.1, (False, False)),
        (math.nan, math.inf, 0.1, (False, False)),
    ],
)
def test_inputs_of_a_learner(speed, steer, time, expected):
    """1.5 m/s at once, 2 rad/s of steering, for 0.4 s."""
    assert_taken(LEARNER, speed, steer, time, expected)


def test_infinite_values_are_missing_whatever_the_limits():
    settings = learner_stream(
        OnlineProblem.of(TRUCK, ("speed", STEER, YAW), OneStage(priors={}, consider={}, nuisances=False)),
        LearnerSettings(max_steer=math.inf, max_steer_rate=math.inf),
    )
    stream, _ = taken(settings, (0.0, 20.0, 0.0), (0.01, 20.0, math.inf))
    assert stream.times == [0.01, 0.0]
    row = np.ones(7)
    stream.write(memoryview(row), [20.0, 0.0], [20.0, 0.1], [math.inf], lambda: None)
    assert row.tolist() == [0.01, 20.0, 0.0, 20.0, 0.1, 0.0, 0.0]


def test_missing_inputs_are_held_for_a_limited_time():
    start = (0.0, 20.0, 0.1)
    for missing in ((None, 0.1), (20.0, None)):
        stream, status = taken(LEARNER, start, (0.4, *missing))
        assert (status, stream.inputs) == (Status.OK, [20.0, 0.1])
        assert taken(LEARNER, start, (0.4 + EDGE, *missing))[1] is Status.INPUT_MISSING
    for missing in ((None, 0.1), (20.0, None)):
        assert taken(LEARNER, (0.0, *missing))[1] is Status.INPUT_MISSING
    assert taken(LEARNER, (0.0, 5.0, 0.1))[1] is Status.OK
    assert taken(LEARNER, (0.0, 5.0 - EDGE, 0.1))[1] is Status.TOO_SLOW


def test_a_slow_change_is_plausible_at_any_rate():
    """Noise at 1 kHz changes by more than a driver steers in a millisecond."""
    stream = Stream(observer(), LIMIT)
    for k in range(1000):
        value = 0.01 * (-1) ** k
        assert stream.take(k * 1e-3, [20.0, value]) is Status.OK
        assert stream.inputs == [20.0, value]


def test_a_state_starts_after_a_gap_and_after_missing_inputs():
    for last, starts in (((1.0, 20.0, 0.1), False), ((1.0 + 2 * EDGE, 20.0, 0.1), True)):
        stream, _ = taken(observer(max_gap=1.0), (0.0, 20.0, 0.0), (EDGE, 20.0, 0.0), last)
        assert stream.starts == starts
        assert (stream.gap, stream.last) == ((0.0, [20.0, 0.1]) if starts else (1.0 - EDGE, [20.0, 0.0]))
    stream, _ = taken(observer(max_acceleration=1e3), (0.0, 20.0, 0.0), (0.1, 4.0, 0.0), (0.2, 20.0, 0.0))
    assert stream.starts


def test_a_long_gap_is_divided_into_steps():
    """Each as long as the model permits, with inputs in between; the measurements belong to the last one."""
    stream, _ = taken(observer(max_gap=9.0), (0.0, 20.0, 0.0))
    stream.finish(True)
    stream.take(0.5, [24.0, 0.4])
    row, rows = np.full(7, 9.0), []
    stream.write(memoryview(row), stream.last, stream.inputs, [0.2], lambda: rows.append(row.copy()))
    rows = np.array([*rows, row])
    count = math.ceil(0.5 / LIMIT(np.array([24.0]))[0])
    assert len(rows) == count > 3
    np.testing.assert_allclose(rows[:, 0], 0.5 / count)
    fraction = np.arange(count + 1) / count
    ends = np.column_stack([20 + 4 * fraction, 0.4 * fraction])
    np.testing.assert_allclose(rows[:, 1:5], np.hstack([ends[:-1], ends[1:]]), atol=1e-15)
    assert not rows[:-1, 5:].any()
    assert row[5:].tolist() == [0.2, 1.0]


@pytest.mark.parametrize("time", [None, math.nan, math.inf, 1.0, 0.5])
def test_a_time_that_is_not_later_changes_nothing(time):
    stream, _ = taken(observer(), (1.0, 20.0, 0.1))
    before = stream.save()
    with pytest.raises(SignalError, match=r"^time: expected"):
        stream.take(time, [30.0, 0.2])
    assert stream.save() == before


def test_a_resumed_stream_continues():
    settings = observer_stream(ObserverSettings(friction=0.6), ("speed", STEER), [YAW])

    def answers(stream: Stream, times: range) -> list[Mapping[str, object]]:
        found = []
        for k in times:
            status = stream.take(0.1 * k, [20.0 + 0.5 * k if k % 3 else None, None if k in (4, 5) else 0.01 * k])
            found.append({"status": status, "finished": stream.finish(k < 8), **stream.save()})
        return found

    stream, other = Stream(settings, LIMIT), Stream(settings, LIMIT)
    assert other.save()["time"] is None
    answers(stream, range(1, 10))
    other.resume(json.loads(json.dumps(stream.save(), allow_nan=False)))
    assert answers(other, range(10, 30)) == answers(stream, range(10, 30))
