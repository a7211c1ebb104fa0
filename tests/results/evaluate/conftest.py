"""Trucks and noise of the tests of evaluations."""

import numpy as np
import pytest

from fifthwheel.data.record import Record
from fifthwheel.truck import Vehicle, get

STEER = "steer.tractor.front"
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


def repeated(records):
    """Logs one after the other, every second one to the other side, with offsets of steer angle and yaw rate."""
    step = records[0].time[1] - records[0].time[0]
    signals = {
        name: np.concatenate(
            [r.signals[name] if name == "speed" or k % 2 == 0 else -r.signals[name] for k, r in enumerate(records)]
        )
        for name in records[0].signals
    }
    for name, offset in {STEER: 0.004, "yaw_rate.tractor": 0.01}.items():
        signals[name] = signals[name] + offset
    time = step * np.arange(sum(map(len, records)))
    return Record(time=time, signals=signals, name="repeated")
