"""NIS, NEES and their confidence intervals."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import chi2

from fifthwheel.filters import consistency


@given(
    degrees=st.integers(1, 50), count=st.integers(1, 500), probability=st.sampled_from([0.5, 0.9, 0.95, 0.99, 0.999])
)
def test_interval_equals_scipy(degrees: int, count: int, probability: float) -> None:
    low, high = consistency.chi_square_band(degrees, count, probability)
    tail = (1 - probability) / 2
    assert low == pytest.approx(chi2.ppf(tail, degrees * count) / count, rel=1e-9)
    assert high == pytest.approx(chi2.isf(tail, degrees * count) / count, rel=1e-9)
    assert low < degrees < high or count * degrees < 4


def test_published_intervals() -> None:
    """Bar-Shalom, Li and Kirubarajan 2001, 5.4.2: two degrees, one and fifty runs."""
    assert consistency.chi_square_band(2) == (pytest.approx(0.0506, abs=1e-4), pytest.approx(7.378, abs=1e-3))
    assert consistency.chi_square_band(2, 50) == (pytest.approx(1.4844, abs=1e-4), pytest.approx(2.5912, abs=1e-4))


def test_intervals_of_several_degrees() -> None:
    low, high = consistency.chi_square_band([1, 2, 3], 10)
    assert low.shape == high.shape == (3,)
    for i in range(3):
        assert (low[i], high[i]) == consistency.chi_square_band(i + 1, 10)


def test_nis() -> None:
    innovation = np.array([[1.0, 2.0], [3.0, 100.0], [9.0, 9.0]])
    variance = np.array([[1.0, 8.0], [2.0, 1.0], [1.0, 0.0]])
    accepted = np.array([[1.0, 1.0], [1.0, 0.0], [0.0, 0.0]])
    with np.errstate(divide="ignore"):  # the variance of an unused channel is arbitrary
        actual, degrees = consistency.nis(innovation, variance, accepted)
    assert actual.tolist() == [1.5, 4.5, 0.0]
    assert degrees.tolist() == [2.0, 1.0, 0.0]


def test_nees_of_known_errors() -> None:
    covariance = np.array([[4.0, 0.0], [0.0, 9.0]])
    assert consistency.nees(np.array([2.0, 3.0]), covariance) == 2.0
    assert consistency.nees(np.array([1.0, 1.0]), np.array([[2.0, 1.0], [1.0, 2.0]])) == pytest.approx(2 / 3)


@pytest.mark.parametrize("shape", [(), (4,), (3, 4)])
def test_nees_of_many(shape: tuple[int, ...]) -> None:
    rng = np.random.default_rng(1)
    error, root = rng.normal(size=(*shape, 3)), rng.normal(size=(*shape, 3, 3))
    covariance = root @ np.swapaxes(root, -1, -2) + 0.1 * np.eye(3)
    actual = consistency.nees(error, covariance)
    assert actual.shape == shape
    for index in np.ndindex(*shape):
        assert actual[index] == pytest.approx(error[index] @ np.linalg.inv(covariance[index]) @ error[index], rel=1e-9)


def test_random_errors_are_within_the_interval() -> None:
    rng = np.random.default_rng(7)
    root = rng.normal(size=(4, 4))
    errors = rng.normal(size=(400, 4)) @ root.T
    covariance = np.broadcast_to(root @ root.T, (400, 4, 4))
    low, high = consistency.chi_square_band(4, 400)
    assert low < consistency.nees(errors, covariance).mean() < high
    assert consistency.nees(errors * 1.2, covariance).mean() > high
