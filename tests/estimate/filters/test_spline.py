"""The cubic spline through samples, compared with SciPy."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from fifthwheel.estimate.filters.step_rows import Spline


@pytest.mark.parametrize("count", [4, 5, 1000])
def test_values_and_derivatives_are_those_of_scipy(count: int) -> None:
    generator = np.random.default_rng(count)
    time = np.cumsum(generator.uniform(0.001, 0.02, count))  # steps of very different length
    values = np.cumsum(generator.normal(size=count))
    at = np.concatenate([time, np.sort(generator.uniform(time[0], time[-1], 3 * count))])
    expected = CubicSpline(time, values)
    shifted, rate = Spline(time, values)(at)
    np.testing.assert_allclose(shifted, expected(at), rtol=1e-12, atol=1e-12 * np.abs(values).max())
    np.testing.assert_allclose(rate, expected(at, 1), rtol=1e-10, atol=1e-11 * np.abs(expected(at, 1)).max())
