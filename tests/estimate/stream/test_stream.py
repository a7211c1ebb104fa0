"""Which inputs of a sample are plausible, both sides of every limit; rows, starts and memory of a stream."""

import json
import math
from collections.abc import Mapping

import numpy as np
import pytest

from fifthwheel.base.errors import SignalError
from fifthwheel.estimate.identify.settings import OneStage
from fifthwheel.estimate.observe import Observer, ObserverSettings
from fifthwheel.estimate.online import LearnerSettings
from fifthwheel.estimate.online.live_filter import stream_settings
from fifthwheel.estimate.online.online_model import online_setup
from fifthwheel.estimate.stream import Status, Stream, StreamSettings
from fifthwheel.model.dynamics import simulation
from fifthwheel.model.dynamics.speed_rate import TIME_CONSTANT
from fifthwheel.truck import get

EDGE = 1e-6
STEER, YAW = "steer.tractor.front", "yaw_rate.tractor"
SIGNALS = ("speed", STEER, YAW)
TRUCK = get("cheng_cebon_2011")
LIMIT = simulation.step_limit(TRUCK, True)
PROBLEM = online_setup(TRUCK, SIGNALS, OneStage(given={"others": "exact", "sensors": "exact"}))
LEARNER = stream_settings(
    PROBLEM, LearnerSettings(hold=0.4, max_steer=0.9, max_steer_rate=2.0, max_speed_change=1.5, coast=0.6)
)


def observer(**settings: float) -> StreamSettings:
    return Observer(TRUCK, SIGNALS, ObserverSettings(**settings)).stream.settings


class Rows:
    """A filter that keeps its rows, and uses measurements up to 1 rad/s."""

    def __init__(self, inputs: int) -> None:
        self.row = np.full(1 + 2 * inputs + 2, 9.0).data
        self.rows: list[np.ndarray] = []
        self.starts: list[float] = []

    def start(self, stream: Stream) -> None:
        self.starts.append(stream.time)

    def ends(self, stream: Stream) -> tuple[list[float], list[float]]:
        return stream.last, stream.inputs

    def step(self) -> None:
        self.rows.append(np.array(self.row))

    def update(self, stream: Stream) -> bool:
        self.step()
        return self.row[-1] == 1.0 and abs(self.row[-2]) <= 1.0


def processed(
    settings: StreamSettings, *samples: tuple[float, float | None, float | None]
) -> tuple[Stream, Rows, Status]:
    """A stream and its filter after samples of time, speed and steer angle, and the last status."""
    stream, rows = Stream(settings, LIMIT), Rows(len(settings.names))
    for time, *values in samples:
        status = stream.process_sample(rows, time, values, [0.1])
    return stream, rows, status


def assert_taken(
    settings: StreamSettings, speed: float | None, steer: float | None, time: float, expected: tuple[bool, bool]
) -> None:
    """Which inputs are taken after a speed of 20 m/s and no steer angle at 0 s."""
    start = ((-1.0, None, None), (-0.01, 20.0, 0.0), (0.0, 20.0, 0.0))
    stream, _, status = processed(settings, *start, (time, speed, steer))
    assert stream.times == [time if ok else 0.0 for ok in expected]
    if time <= settings.hold or all(expected):
        assert status is Status.OK
        new, old = (speed, steer), (20.0, 0.0)
        assert stream.inputs[:2] == [new[i] if ok else old[i] for i, ok in enumerate(expected)]
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


def test_of_two_values_that_disagree_at_a_start_the_second_is_taken():
    """Either may be wrong; two that agree are right."""
    wrong, right, later = (0.0, 8.0, 0.4), (0.01, 20.0, 0.0), (0.02, 20.0, 0.0)
    for settings in (observer(hold=0.3), LEARNER):
        assert processed(settings, wrong, right)[0].inputs[:2] == [20.0, 0.0]
        assert processed(settings, right, later, (0.03, 8.0, 0.4))[0].inputs[:2] == [20.0, 0.0]
        after_a_gap = (*((t - 9.0, *rest) for t, *rest in (right, later)), wrong, right)
        assert processed(settings, *after_a_gap)[0].inputs[:2] == [20.0, 0.0]


def test_missing_inputs_are_held_for_a_limited_time():
    start = (0.0, 20.0, 0.1)
    for missing in ((None, 0.1), (20.0, None)):
        stream, _, status = processed(LEARNER, start, (0.4, *missing))
        assert (status, stream.inputs) == (Status.OK, [20.0, 0.1, 0.0])
        assert processed(LEARNER, start, (0.4 + EDGE, *missing))[2] is Status.INPUT_MISSING
        assert processed(LEARNER, (0.0, *missing))[2] is Status.INPUT_MISSING
    assert processed(LEARNER, (0.0, 5.0, 0.1))[2] is Status.OK
    assert processed(LEARNER, (0.0, 5.0 - EDGE, 0.1))[2] is Status.TOO_SLOW


def test_a_state_starts_after_a_gap_and_after_missing_inputs():
    for time, starts in ((1.0, False), (1.0 + 2 * EDGE, True)):
        _, rows, _ = processed(observer(max_gap=1.0), (0.0, 20.0, 0.0), (EDGE, 20.0, 0.0), (time, 20.0, 0.1))
        assert rows.starts == ([0.0, time] if starts else [0.0])
        dt, before = rows.rows[-1][0], rows.rows[-1][1:3].tolist()
        assert (dt, before) == (0.0, [20.0, 0.1]) if starts else dt > 0
    slow = processed(observer(max_acceleration=1e3), (0.0, 20.0, 0.0), (0.1, 4.0, 0.0), (0.2, 20.0, 0.0))
    assert slow[1].starts == [0.0, 0.2]


def test_a_long_gap_is_divided_into_steps():
    """Each as long as the model permits, with inputs in between; the measurements belong to the last one."""
    _, rows, _ = processed(observer(max_gap=9.0), (0.0, 20.0, 0.0), (0.5, 24.0, 0.4))
    found = np.array(rows.rows[1:])
    count = math.ceil(0.5 / LIMIT(np.array([24.0]))[0])
    assert len(found) == count > 3
    np.testing.assert_allclose(found[:, 0], 0.5 / count)
    fraction = np.arange(count + 1) / count
    rate = 4.0 / 0.5 * (1 - math.exp(-0.5 / TIME_CONSTANT)) ** 2  # of a first change
    ends = np.column_stack([20 + 4 * fraction, 0.4 * fraction, rate * fraction])
    np.testing.assert_allclose(found[:, 1:7], np.hstack([ends[:-1], ends[1:]]), atol=1e-15)
    assert not found[:-1, 7:].any()
    assert found[-1, 7:].tolist() == [0.1, 1.0]


def test_without_accepted_measurements_it_coasts():
    stream, rows, _ = processed(LEARNER, (0.0, 20.0, 0.0))
    for time, measured, expected in (
        (0.5, None, Status.OK),
        (0.7, None, Status.COASTING),
        (0.8, 5.0, Status.COASTING),  # not accepted
        (0.9, 0.5, Status.OK),
        (1.5, math.nan, Status.OK),
        (1.5 + EDGE, math.nan, Status.COASTING),
    ):
        assert stream.process_sample(rows, time, [20.0, 0.0], [measured]) is expected


@pytest.mark.parametrize("time", [None, math.nan, math.inf, 1.0, 0.5])
def test_a_time_that_is_not_later_changes_nothing(time):
    stream, rows, _ = processed(observer(), (1.0, 20.0, 0.1))
    before = stream.save()
    with pytest.raises(SignalError, match=r"^time: expected"):
        stream.process_sample(rows, time, [30.0, 0.2], [0.0])
    assert stream.save() == before
    assert len(rows.rows) == 1


def test_a_resumed_stream_continues():
    settings = observer()

    def answers(stream: Stream, times: range) -> list[Mapping[str, object]]:
        rows, found = Rows(3), []
        for k in times:
            speed, steer = 20.0 + 0.5 * k if k % 3 else None, None if k in (4, 5) else 0.01 * k
            status = stream.process_sample(rows, 0.1 * k, [speed, steer], [0.1 if k < 8 else None])
            found.append({"status": status, "row": rows.rows[-1].tolist(), **stream.save()})
        return found

    stream, other = Stream(settings, LIMIT), Stream(settings, LIMIT)
    assert (other.save()["time"], other.save()["running"]) == (None, False)
    answers(stream, range(1, 10))
    other.resume(json.loads(json.dumps(stream.save(), allow_nan=False)))
    assert answers(other, range(10, 30)) == answers(stream, range(10, 30))
