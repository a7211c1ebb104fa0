"""The article's vehicle as a filter sees it, and a cache that dies with the tests."""

from collections.abc import Iterator

import numpy as np
import pytest

from .examples import Article, lane_change


@pytest.fixture(autouse=True, scope="package")
def own_cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("FIFTHWHEEL_CACHE", str(tmp_path_factory.mktemp("cache") / "native"))
        yield


@pytest.fixture(scope="package")
def article() -> Article:
    """Eight states, four gyros, irregular samples, speed from 20 to 26 m/s: the transition differs from row to row."""
    return lane_change(np.random.default_rng(11))
