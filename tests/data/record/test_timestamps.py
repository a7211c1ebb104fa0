"""Timestamps; channels that are held, against the messages that they come from."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fifthwheel.data.record.timestamps import Renewals, TimestampFilter, held_samples


@pytest.mark.parametrize(
    ("time", "kept"),
    [
        ([0, 0.1, 0.1, 0.2, 0.15, 0.3], [0, 0.1, 0.2, 0.3]),
        ([0, 0.1, 900.0, 0.2, 0.3], [0, 0.1, 0.2, 0.3]),  # one corrupted timestamp
        ([0, np.nan, 0.1, -7.0, 0.2], [0, 0.1, 0.2]),
        ([10, 10.1, 0.1, 0.2], [10, 10.1, 0.1, 0.2]),  # another run: the reader of the log refuses it
        ([], []),
        ([1.0], [1.0]),
        ([2.0, 1.0], [2.0]),
    ],
)
def test_increasing_timestamps_are_kept(time, kept):
    time = np.array(time, dtype=float)
    timestamps = TimestampFilter()
    assert time[timestamps.keep("c", time)].tolist() == kept
    assert timestamps.dropped == time.size - len(kept)
    assert len(timestamps.notes) == (timestamps.dropped > 0)
    assert timestamps.keep("another time base", np.array([-9.0])).all()


TIME = np.arange(3000) / 100


def weave(time):
    """A steer angle, rad: straight for 10 s, then weaving."""
    return 0.03 * np.sin(2 * np.pi * 0.3 * time) * (time > 10)


def logged(rate, course=weave, *, phase=0.3, jitter=0.0, noise=0.0, step=0.0, time=TIME, seed=0):
    """Instants (m,) and values (m,) of messages at a rate in Hz, and the table (n,) that holds them."""
    rng = np.random.default_rng(seed)
    sent = np.arange(-1.0, time[-1], 1 / rate) + phase / rate
    sent = np.sort(sent + jitter * rng.normal(size=sent.size))
    values = course(sent) + noise * rng.normal(size=sent.size)
    values = np.rint(values / step) * step if step else values
    latest = np.searchsorted(sent, time, side="right") - 1
    return latest, values[latest]


@settings(deadline=None, max_examples=40)
@given(
    rate=st.sampled_from([5, 10, 20, 25, 100 / 3, 40, 50]),
    jitter=st.sampled_from([0.0, 0.001, 0.003]),
    phase=st.floats(0, 0.99),
)
def test_the_samples_are_the_rows_in_which_messages_appear(rate, jitter, phase):
    """Also where the course is constant, so that an interpolation does not begin at the last change."""
    latest, values = logged(rate, jitter=jitter, step=1e-5, phase=phase)
    held = held_samples(TIME, values)
    assert held is not None
    assert held.rate == pytest.approx(rate, rel=0.03)
    assert held.repetitions == pytest.approx(100 / rate, rel=0.08)
    first = np.flatnonzero(np.diff(latest, prepend=-1))
    moving = TIME[first] > 10.5
    changed = np.diff(values[first], prepend=np.nan) != 0
    assert np.isin(TIME[first[moving & changed]], held.time).all()
    rows = np.searchsorted(TIME, held.time - 1e-6)
    np.testing.assert_array_equal(held.values, values[rows])
    np.testing.assert_allclose(held.time, TIME[rows], atol=1e-9)
    assert np.diff(held.time).max() < 1 / rate + 0.015 + 10 * jitter


STEP = 1 / 256 / 3.6
NOT_HELD = {
    "a sample in each row": {"rate": 100},
    "with noise of a quantum": {"rate": 100, "noise": 1 / 8192, "step": 1 / 8192},
    "noise of a third of a quantum": {"rate": 100, "course": lambda t: 0 * t, "noise": 4e-5, "step": 1 / 8192},
    "slow and quantised": {"rate": 100, "course": lambda t: 20 + 0.3 * np.sin(0.1 * t), "step": STEP},
    "slow and coarse": {"rate": 100, "course": lambda t: 20 + 0.3 * np.sin(0.1 * t), "step": 0.01},
    "a ramp of one quantum in three rows": {"rate": 100, "course": lambda t: STEP * t * 33.3, "step": STEP},
    "coarse steer angle": {"rate": 100, "step": np.radians(0.3)},
    "constant": {"rate": 100, "course": lambda t: 0 * t},
    "a staircase of 1 s": {"rate": 1, "time": np.arange(20_000) / 100},
}


@pytest.mark.parametrize("case", NOT_HELD)
def test_what_is_not_held(case):
    time = NOT_HELD[case].get("time", TIME)
    for seed in range(3):
        assert held_samples(time, logged(**NOT_HELD[case], seed=seed, phase=0.1 + 0.4 * seed)[1]) is None


def test_values_that_are_not_held():
    """On change at random, damaged, and with blanks between the samples."""
    rng = np.random.default_rng(0)
    at_random = np.repeat(rng.normal(size=600), rng.geometric(0.2, size=600))
    damaged = rng.choice([-1.7e308, 1.0, 1.7e308], size=TIME.size) * rng.uniform(size=TIME.size)
    blanks = np.where(np.arange(TIME.size) % 5 == 2, weave(TIME), np.nan)
    for values in (at_random, damaged, blanks):
        assert held_samples(np.arange(values.size) / 100, values) is None


@settings(deadline=None, max_examples=30)
@given(st.lists(st.integers(0, 3000), max_size=20))
def test_pieces_make_no_difference(cuts):
    values = logged(20, step=1e-4)[1]
    values[700:760] = np.nan
    whole, renewals = held_samples(TIME, values), Renewals()
    for time, part in zip(np.split(TIME, sorted(cuts)), np.split(values, sorted(cuts)), strict=True):
        renewals.push(time, part)
    pieces = renewals.finish()
    assert whole is not None
    assert pieces is not None
    np.testing.assert_array_equal(pieces.time, whole.time)
    np.testing.assert_array_equal(pieces.values, whole.values)
    assert not ((whole.time > TIME[700] - 1e-6) & (whole.time < TIME[760] - 1e-6)).any()
