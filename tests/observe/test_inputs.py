"""Implausible speeds, steer angles and measurements count as missing."""

import numpy as np
import pytest

from fifthwheel.dynamics import SPEED_RATE
from fifthwheel.observe import Observer, ObserverSettings, Status
from fifthwheel.observe.inputs import HeldInputs, held_inputs
from tests.observe.conftest import ROLLS, STEER, YAWS, assert_same, batched, pushed, put, samples


@pytest.mark.parametrize(
    ("name", "value", "duration"),
    [
        (STEER, 0.5, 0.01),
        (STEER, 10.0, 0.01),
        (STEER, 10.0, 0.2),
        (STEER, 1e300, 0.01),
        (STEER, -1e300, 0.2),
        ("speed", 1e300, 0.2),
        ("speed", 44.0, 0.1),
        ("speed", 0.0, 0.01),
        (YAWS[0], 1e300, 1.0),
        (ROLLS[1], -1e300, 1.0),
    ],
)
def test_an_implausible_value_counts_as_missing(truck, lane_changes, name, value, duration):
    """One sample of 10 rad of steer angle made the states wrong for seconds, one of 1e300 for ever."""
    wrong, missing = (put(lane_changes, name, 8.0, 8.0 + duration - 1e-9, v) for v in (value, np.nan))
    o = Observer(truck, lane_changes.signals)
    actual = batched(o, wrong)
    assert_same(actual, batched(o, missing))
    assert_same(pushed(o, wrong), actual)
    assert (actual["status"] == Status.OK).all()


def test_a_jump_that_lasts_is_accepted_after_the_hold(truck, lane_changes):
    record = put(lane_changes, STEER, 8.0, 99.0, 1.0)
    held, fresh = held_inputs(record, (STEER,), ObserverSettings(max_steer_rate=0.5))
    last = np.searchsorted(record.time, 8.0) - 1
    accepted = np.flatnonzero(held[:, 0] == 1.0)[0]
    assert record.time[accepted] - record.time[last] == pytest.approx(0.51, abs=0.011)
    assert (held[last:accepted, 0] == held[last, 0]).all()
    assert (held[accepted:, 0] == 1.0).all()
    assert fresh.all()


def test_a_slow_change_is_plausible_at_any_rate(lane_changes):
    """Noise at 1 kHz changes by more than a driver steers in a millisecond."""
    inputs = HeldInputs((STEER,), ObserverSettings())
    for k in range(1000):
        value = 0.01 * (-1) ** k
        assert inputs.update(k * 1e-3, {STEER: value})
        assert inputs.values == [value]


def test_both_forms_agree(lane_changes):
    random = np.random.default_rng(0)
    settings = ObserverSettings(max_steer_rate=0.2, max_acceleration=2.0, hold=0.05)
    noisy = {}
    for name, sigma in (("speed", 0.05), (STEER, 0.003)):
        values = lane_changes.signals[name] + sigma * random.normal(size=len(lane_changes))
        noisy[name] = np.where(random.random(values.size) < 0.2, np.nan, values)
    record, names = lane_changes.with_signals(noisy), (*noisy, SPEED_RATE)
    held, fresh = held_inputs(record, names, settings)
    inputs = HeldInputs(names, settings)
    for k, sample in enumerate(samples(record)):
        assert inputs.update(sample["time"], sample) == fresh[k]
        np.testing.assert_array_equal(inputs.values, held[k])
    assert 0 < fresh.sum() < len(fresh)
    present = {name: np.isfinite(values) for name, values in noisy.items()}
    refused = [(held[:, i] != record.signals[n])[present[n]].any() for i, n in enumerate(noisy)]
    assert all(refused)
    assert 0.01 < held[:, -1].std() < 1.0
