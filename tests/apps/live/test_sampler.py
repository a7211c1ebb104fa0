"""Samples at 100 Hz from messages with any period and phase."""

from itertools import pairwise

import numpy as np
import pytest

from fifthwheel.apps.live.sampler import Sampler


def readings(periods, *, seconds=10.0, jitter=0.0, phase=0.0007):
    """Time and column of each message, in the order of time."""
    random = np.random.default_rng(1)
    made = [
        (k * period + i * phase + jitter * random.random(), f"c{i}")
        for i, period in enumerate(periods)
        for k in range(round(seconds / period))
    ]
    return sorted(made)


def samples(stream):
    sampler = Sampler(100.0)
    return [cycle for time, column in stream for cycle in sampler.put(time, column, time)]


PERIODS = ((0.01, 0.01, 0.01), (0.01, 0.01, 0.1), (0.001, 0.001), (0.02, 0.02), (0.1,), (0.01, 0.02, 0.05, 0.1, 0.004))


@pytest.mark.parametrize("jitter", [0.0, 0.002])
def test_the_rate_is_100_hz(jitter):
    for periods in PERIODS:
        found = samples(readings(periods, jitter=jitter))
        assert len(found) == pytest.approx(1000, rel=0.06)
        assert all(b.time > a.time for a, b in pairwise(found))


def test_the_samples_follow_a_bus_with_another_period():
    found = samples(readings((0.0102, 0.0102)))
    assert len(found) == pytest.approx(10 / 0.0102, rel=0.01)
    assert all(len(cycle.values) == 2 for cycle in found[10:])


def test_every_cycle_has_all_columns_and_its_instant_is_that_of_the_last():
    for cycle in samples(readings((0.01, 0.01, 0.01)))[10:]:
        assert len(cycle.values) == 3
        assert cycle.time == max(cycle.values.values())


def test_no_reading_is_lost_or_used_twice():
    found = samples(readings((0.01, 0.02, 0.1), jitter=0.003))
    for column, count in (("c0", 1000), ("c1", 500), ("c2", 100)):
        values = [cycle.values[column] for cycle in found if column in cycle.values]
        assert len(set(values)) == len(values)
        assert len(values) == pytest.approx(count, rel=0.05 if column == "c0" else 0.02)


def test_a_column_that_is_lost_is_not_awaited_for_long():
    stream = [r for r in readings((0.01, 0.01)) if not (r[1] == "c1" and r[0] > 5)]
    late = [cycle for cycle in samples(stream) if cycle.time > 5.1]
    assert len(late) == pytest.approx(490, rel=0.02)
    assert all(set(cycle.values) <= {"c0"} for cycle in late)


def test_a_late_reading_counts_in_the_present_cycle_unless_a_newer_one_is_known():
    sampler = Sampler(100.0)
    for time in (0.0, 0.01, 0.02):
        list(sampler.put(time, "a", time))
    list(sampler.advance(0.0301))
    assert list(sampler.put(0.0199, "a", 9.0)) == []
    list(sampler.put(0.029, "b", 5.0))
    (cycle, *_) = sampler.advance(0.06)
    assert cycle.values == {"b": 5.0}
