"""Fixtures and checks of the manoeuvres' tests."""

import numpy as np
import pytest

from fifthwheel.model.manoeuvres import Path
from fifthwheel.truck import Vehicle, get

G = 9.80665
KMH_88 = 88 / 3.6


@pytest.fixture(scope="module")
def truck() -> Vehicle:
    return get("cheng_cebon_2011")


def check_geometry(path: Path) -> None:
    """x, y, heading and curvature describe the same curve, and arc is its length; by central differences."""
    step = path.arc[1]
    assert 0 < step <= 0.25
    assert (path.x[0], path.y[0], path.heading[0]) == (0, 0, 0)
    dx, dy, turn = (np.gradient(values, step)[1:-1] for values in (path.x, path.y, path.heading))
    largest, change = np.abs(path.curvature).max(), np.abs(np.diff(path.curvature)).max() / step
    remainder = step**2 * (largest**2 + change) + 1e-9  # of central differences
    np.testing.assert_allclose(dx, np.cos(path.heading[1:-1]), atol=remainder)
    np.testing.assert_allclose(dy, np.sin(path.heading[1:-1]), atol=remainder)
    np.testing.assert_allclose(turn, path.curvature[1:-1], atol=step * change / 2 + 1e-9)
    travel_time = np.cumsum(step / path.speed)
    assert travel_time[-1] > path.duration  # the path is longer than the run
