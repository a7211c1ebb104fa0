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


def test_several_time_bases_are_independent():
    timestamps = TimestampFilter()
    assert timestamps.keep("a", np.array([0.0, 1.0])).all()
    assert timestamps.keep("b", np.array([0.5])).all()
    assert timestamps.keep("a", np.array([0.9, 1.0, 1.5])).tolist() == [False, False, True]
    assert timestamps.keep("b", np.array([0.6])).all()


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


@pytest.mark.parametrize("rate", [5, 10, 20, 25, 100 / 3, 40, 50])
@pytest.mark.parametrize("jitter", [0.0, 0.001, 0.003])
def test_the_samples_are_the_rows_in_which_messages_appear(rate, jitter):
    latest, values = logged(rate, jitter=jitter, step=1e-5)
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


@settings(deadline=None)
@given(phase=st.floats(0, 0.99), rate=st.sampled_from([10, 20, 50]), step=st.sampled_from([0.0, 1e-4]))
def test_the_phase_of_the_messages_does_not_count(phase, rate, step):
    held = held_samples(TIME, logged(rate, phase=phase, step=step)[1])
    assert held is not None
    assert held.rate == pytest.approx(rate, rel=0.03)


def test_a_constant_part_keeps_its_samples():
    """So that an interpolation does not begin at the last change."""
    held = held_samples(TIME, logged(20)[1])
    assert held is not None
    assert np.diff(held.time).max() < 0.065
    assert not held.values[held.time < 9.9].any()


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
@pytest.mark.parametrize("seed", range(5))
def test_what_is_not_held(case, seed):
    time = NOT_HELD[case].get("time", TIME)
    assert held_samples(time, logged(**NOT_HELD[case], seed=seed, phase=0.1 + 0.2 * seed)[1]) is None


def test_values_on_change_at_random_are_not_held():
    rng = np.random.default_rng(0)
    values = np.repeat(rng.normal(size=600), rng.geometric(0.2, size=600))
    assert held_samples(np.arange(values.size) / 100, values) is None


def test_damaged_values_are_no_error():
    rng = np.random.default_rng(0)
    values = rng.choice([-1.7e308, 1.0, 1.7e308], size=TIME.size) * rng.uniform(size=TIME.size)
    assert held_samples(TIME, values) is None


def test_a_channel_with_blanks_between_its_samples_is_not_held():
    values = np.where(np.arange(TIME.size) % 5 == 2, weave(TIME), np.nan)
    assert held_samples(TIME, values) is None


@settings(deadline=None)
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
