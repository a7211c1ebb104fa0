"""Trucks and noise of the tests of evaluations."""

import pytest

from fifthwheel.vehicle import Vehicle, get

U = 22.0
"""Speed, m/s."""
NOISE = {
    "yaw_rate.tractor": 1e-6,
    "yaw_rate.semitrailer": 1e-6,
    "articulation.semitrailer": 1e-7,
    "lateral_acceleration.tractor": 4e-4,
    "lateral_acceleration.semitrailer": 4e-4,
    "roll.tractor": 1e-7,
    "roll.semitrailer": 1e-7,
}
"""Variances of good sensors."""


@pytest.fixture(scope="session")
def truck() -> Vehicle:
    """The truck of the article, with exact numbers."""
    vehicle = get("cheng_cebon_2011")
    return vehicle.with_stated(dict.fromkeys(vehicle.parameters(), 0.0))
