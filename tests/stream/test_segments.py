"""Segments of a record: the same inputs as sample by sample."""

import numpy as np
import pytest

from fifthwheel.dynamics import SPEED_RATE, steps
from fifthwheel.observe import Observer, ObserverSettings
from fifthwheel.simulate import simulate
from fifthwheel.stream import Status, Stream, StreamSettings, without_measurement
from fifthwheel.stream.segments import held_inputs
from fifthwheel.vehicle import get
from tests.observe.conftest import STEER, YAWS, put
from tests.stream.test_stream import Rows

TRUCK = get("cheng_cebon_2011")
LANE_CHANGES = simulate(TRUCK, count=2, seed=7)


def settings_of(**settings: float) -> StreamSettings:
    return Observer(TRUCK, ("speed", STEER, YAWS[0]), ObserverSettings(**settings)).stream.settings


def test_a_jump_that_lasts_is_accepted_after_the_hold():
    record = put(LANE_CHANGES, STEER, 8.0, 99.0, 1.0)
    held, fresh = held_inputs(record, settings_of(max_steer_rate=0.5))
    last = np.searchsorted(record.time, 8.0) - 1
    accepted = np.flatnonzero(held[:, 1] == 1.0)[0]
    assert record.time[accepted] - record.time[last] == pytest.approx(0.51, abs=0.011)
    assert (held[last:accepted, 1] == held[last, 1]).all()
    assert (held[accepted:, 1] == 1.0).all()
    assert fresh.all()


def test_both_forms_agree():
    random = np.random.default_rng(0)
    settings = settings_of(max_steer_rate=0.2, max_acceleration=2.0, hold=0.05, friction=0.6)
    noisy = {}
    for name, sigma in (("speed", 0.05), (STEER, 0.003)):
        values = LANE_CHANGES.signals[name] + sigma * random.normal(size=len(LANE_CHANGES))
        noisy[name] = np.where(random.random(values.size) < 0.2, np.nan, values)
    record = LANE_CHANGES.with_signals(noisy)
    assert settings.names == (*noisy, SPEED_RATE)
    held, fresh = held_inputs(record, settings)
    stream, rows = Stream(settings, steps.step_limit(TRUCK, True)), Rows(inputs=3)
    for k, time in enumerate(record.time.tolist()):
        status = stream.process_sample(rows, time, [float(values[k]) for values in noisy.values()], [0.1])
        assert (status is Status.OK) == fresh[k]
        if fresh[k]:
            np.testing.assert_array_equal(stream.inputs, held[k])
    assert 0 < fresh.sum() < len(fresh)
    present = {name: np.isfinite(values) for name, values in noisy.items()}
    refused = [(held[:, i] != record.signals[n])[present[n]].any() for i, n in enumerate(noisy)]
    assert all(refused)
    assert 0.01 < held[:, -1].std() < 1.0


def test_coasting_starts_after_its_time():
    time = np.arange(6) * 0.25
    accepted = np.array([[0, 0], [1, 0], [0, 0], [0, 0], [0, 0], [0, 1]])
    assert without_measurement(time, accepted, 0.5).tolist() == [False, False, False, False, True, False]
    assert without_measurement(time, 0 * accepted, 0.5).tolist() == [False] * 3 + [True] * 3  # since the start
