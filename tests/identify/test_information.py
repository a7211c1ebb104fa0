"""The windowed sandwich against its definition, and the rule of the article's 2.2.3 against a plain search."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fifthwheel.identify.estimates import settled_since
from fifthwheel.identify.stage import long_run


@pytest.mark.parametrize("lags", [1, 2, 7, 40])
def test_long_run_is_newey_and_west(lags: int) -> None:
    scores = np.random.default_rng(lags).normal(size=(40, 3)).cumsum(axis=0)
    expected = scores.T @ scores
    for lag in range(1, min(lags, len(scores))):
        gamma = scores[lag:].T @ scores[:-lag]
        expected += (1 - lag / lags) * (gamma + gamma.T)
    np.testing.assert_allclose(long_run(scores, lags), expected, rtol=1e-10, atol=1e-9)


@given(st.integers(2, 60), st.integers(0, 10**6), st.sampled_from([0.001, 0.01, 0.1]))
def test_settled_since(length: int, seed: int, tolerance: float) -> None:
    rng = np.random.default_rng(seed)
    values = 5 + 3 * np.exp(-np.arange(length) / 8) + 0.05 * rng.normal(size=length)
    fits = [
        k
        for k in range(length)
        if np.abs(values[k:] - values[k:].mean()).max() <= tolerance * abs(values[k:].mean()) * (1 + 1e-12)
    ]
    assert settled_since(values, tolerance) == fits[0]
