"""The article's vehicle as a filter model, and a temporary cache."""

from collections.abc import Iterator

import numpy as np
import pytest

from tests.estimate.filters.examples import Article, lane_change


@pytest.fixture(autouse=True, scope="package")
def own_cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("FIFTHWHEEL_CACHE", str(tmp_path_factory.mktemp("cache") / "native"))
        yield


@pytest.fixture(scope="package")
def article() -> Article:
    """Eight states, four gyros, irregular sampling, 20 to 26 m/s: the transition is different in every row."""
    return lane_change(np.random.default_rng(11))
