"""The article's vehicle as a filter model."""

import numpy as np
import pytest

from tests.estimate.filters.examples import Article, lane_change


@pytest.fixture(scope="package")
def article() -> Article:
    """Eight states, four gyros, irregular sampling, 20 to 26 m/s: the transition is different in every row."""
    return lane_change(np.random.default_rng(11))
