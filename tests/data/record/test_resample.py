import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fifthwheel.data.record.resample import StreamDecimator, decimate, snap_to_grid


def jittered(rate, duration, seed=0, jitter=0.3):
    time = np.arange(0, duration, 1 / rate)
    return time + np.random.default_rng(seed).uniform(-jitter, jitter, time.size) / rate


@pytest.mark.parametrize("rate", [260, 1000])
def test_slow_motion_passes_without_delay_and_attenuation(rate):
    time = jittered(rate, 5)
    motion = np.sin(2 * np.pi * 2 * time) + 0.3
    grid, result = decimate(time, motion[:, None], 100)
    inner = slice(5, -5)
    assert np.diff(grid) == pytest.approx(0.01)
    assert result[inner, 0] == pytest.approx(
        np.sin(2 * np.pi * 2 * grid[inner]) + 0.3, abs=0.02 if rate < 300 else 5e-3
    )


@pytest.mark.parametrize("frequency", [61, 99, 187])
def test_frequencies_that_would_alias_are_removed(frequency):
    time = jittered(2000, 5, jitter=0.1)
    _, result = decimate(time, np.sin(2 * np.pi * frequency * time)[:, None], 100)
    assert np.nanstd(result) < 0.01


def test_white_noise_keeps_its_density():
    time = np.arange(0, 200, 1e-3)
    noise = np.random.default_rng(1).normal(size=time.size)
    _, result = decimate(time, noise[:, None], 100)
    values = result[10:-10, 0]
    assert np.nanvar(values) == pytest.approx(0.1 * 0.61, rel=0.1)  # the kernel's noise bandwidth is 0.61 of the rate


def test_gaps_remain():
    time = jittered(1000, 10)
    keep = (time < 4) | (time > 6)
    grid, result = decimate(time[keep], np.ones((keep.sum(), 1)), 100)
    assert not ((grid > 4.01) & (grid < 5.99)).any()
    near = ((grid > 3.9) & (grid < 4.01)) | (grid < 0.04) | (grid > 9.96) | ((grid > 5.99) & (grid < 6.05))
    assert np.isfinite(result[~near, 0]).all()
    assert result[np.isfinite(result)] == pytest.approx(1)
    values = np.ones((time.size, 2))
    values[(time > 2) & (time < 2.5), 1] = np.nan
    grid, result = decimate(time, values, 100)
    assert np.isfinite(result[10:-10, 0]).all()
    assert np.isnan(result[(grid > 2) & (grid < 2.5), 1]).all()


@settings(max_examples=10, deadline=None)
@given(seed=st.integers(0, 99), cuts=st.lists(st.integers(1, 5999), max_size=8), dense=st.booleans())
def test_the_result_does_not_depend_on_the_pieces(seed, cuts, dense):
    random = np.random.default_rng(seed)
    rate = 600 if dense else 120
    time = jittered(rate, 6000 / rate, seed)
    values = random.normal(size=time.size)
    values[random.uniform(size=time.size) < 0.02] = np.nan
    single, pieces = (StreamDecimator(["r"], rate=100, time_base="c") for _ in range(2))
    single.push(time, {"r": values})
    for part in np.split(np.arange(time.size), sorted(cuts)):
        pieces.push(time[part], {"r": values[part]})
    (t1, v1), (t2, v2) = single.finish(), pieces.finish()
    assert (single.decimated_from is not None) == dense
    assert t2 == pytest.approx(t1)
    assert v2["r"] == pytest.approx(v1["r"], nan_ok=True, abs=1e-9)


def test_snapped_samples_are_interpolated_and_none_is_added():
    time = np.array([0.013, 0.121, 0.232, 0.338, 5.004, 5.1])
    grid, values = snap_to_grid(time, 2 * time, 100)
    assert grid == pytest.approx([0.01, 0.12, 0.23, 0.34, 5.0, 5.1])
    assert values[1:3] == pytest.approx(2 * grid[1:3])
    assert values[3] == 2 * time[3]  # the neighbour on that side is beyond a gap
    assert values[0] == 2 * time[0]  # no neighbour on that side
    grid, values = snap_to_grid(np.array([0.008, 0.0105, 0.02]), np.array([1.0, 2.0, 3.0]), 100)
    assert grid == pytest.approx([0.01, 0.02])
    assert values[0] == pytest.approx(2.0, abs=0.5)


def test_a_slow_column_in_a_fast_table_keeps_its_samples():
    time = np.arange(0, 10, 1e-3)
    values = np.column_stack([time, np.where(np.arange(time.size) % 100 == 0, 2 * time, np.nan)])
    grid, result = decimate(time, values, 100)
    slow = np.isfinite(result[:, 1])
    assert slow.sum() == 100
    assert result[slow, 1] == pytest.approx(2 * grid[slow])
