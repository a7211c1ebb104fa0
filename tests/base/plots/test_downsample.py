"""Fewer points, the same figure."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from fifthwheel.base.plots import downsample
from fifthwheel.base.plots.items import Band, Line

VALUES = arrays.arrays(np.float64, st.integers(1, 400), elements=st.floats(-1e6, 1e6))


@given(VALUES, st.integers(4, 50))
def test_extremes_and_ends_stay(values, limit):
    kept = downsample.extreme_samples(values, limit)
    assert len(kept) <= max(limit + 2, 4)
    assert (np.diff(kept) > 0).all()
    assert values[kept].min() == values.min()
    assert values[kept].max() == values.max()
    assert kept[0] == 0
    assert kept[-1] == len(values) - 1


def test_a_lone_spike_survives():
    values = np.zeros(100_000)
    values[54_321] = 1.0
    kept = downsample.extreme_samples(values)
    assert 54_321 in kept
    assert len(kept) <= downsample.MAX_POINTS + 2


def test_a_dropout_is_a_gap_and_a_lower_rate_is_none():
    time = np.arange(1000) * 0.01
    slow = np.where(np.arange(1000) % 4 == 0, 1.0, np.nan)
    assert [len(rows) for rows in downsample.segments(time, slow)] == [250]
    assert downsample.segments(time, np.full(1000, np.nan)) == []
    many = np.where(np.arange(20_000) % 20 < 10, np.nan, 1.0)
    assert len(downsample.segments(np.arange(20_000.0), many)) == downsample.MAX_GAPS + 1
    values = np.ones(1000)
    values[400:500] = np.nan
    assert [len(rows) for rows in downsample.segments(time, values)] == [400, 500]
    late = np.where(time > 5, time + 60, time)
    assert len(downsample.segments(late, np.ones(1000))) == 2


@given(VALUES, st.integers(1, 50))
def test_envelope_is_never_narrower(values, count):
    time = np.arange(len(values), dtype=float)
    at, low, high = downsample.envelope(time, values - 1, values + 1, count)
    assert len(at) == len(low) == len(high) <= max(count, 1)
    assert low.min() == (values - 1).min()
    assert high.max() == (values + 1).max()
    assert at[0] == time[0] or len(at) == 1
    assert at[-1] == time[-1]


def test_values_that_are_not_finite_become_null():
    assert downsample.numbers(np.full(2, 1280.4064)) == [1280.4064] * 2  # of a level that others are compared with
    assert downsample.numbers(np.array([1.0, np.nan, 2.0, np.inf])) == [1.0, None, 2.0, None]
    assert downsample.numbers(np.array([np.nan])) == [None]
    time = 1.7e9 + np.arange(1000) * 0.01  # since 1970
    assert np.abs(np.array(downsample.numbers(time, 6)) - time).max() < 1e-4


@given(VALUES)
def test_rounding_is_invisible(values):
    shown = np.array(downsample.numbers(values))
    assert np.abs(shown - values).max() <= 5.1e-5 * (np.ptp(values) or np.abs(values).max()) + 1e-12


def test_a_long_line_is_drawn_as_before_its_points_are_left_out():
    time = np.arange(20_000) * 0.01
    time[12_000:] += 5.0
    values = np.sin(time) + 1e-3 * np.random.default_rng(0).normal(size=time.size)
    values[[77, 500]] = 9.0, np.nan
    line = Line(time, values, gaps=True)
    x, y = downsample.course(time, values)
    np.testing.assert_array_equal(np.array([line.x, line.y]), np.array([x, y]))
    np.testing.assert_array_equal(np.array(downsample.course(x, y, gaps=line.gaps)), np.array([x, y]))
    assert len(x) <= downsample.MAX_POINTS + 1
    assert np.nanmax(y) == 9.0
    assert np.isnan(x).sum() == 1
    band = Band(time, values - 1, values + 1, gaps=True)
    edges = np.array([band.x, band.lower, band.upper])
    assert edges.shape[1] <= downsample.BAND_POINTS + 1
    np.testing.assert_array_equal(np.array(downsample.band(*edges, gaps=band.gaps)), edges)
    assert np.nanmax(edges[2]) == 10.0
    short = Line(time[: downsample.MAX_POINTS], values[: downsample.MAX_POINTS], gaps=True)
    np.testing.assert_array_equal(np.array(short.y), values[: downsample.MAX_POINTS])
