"""Default variances of process and measurement noise, by quantity, for any chain of units."""

from collections.abc import Mapping, Sequence

import numpy as np

from fifthwheel._types import Array
from fifthwheel.names import SignalName
from fifthwheel.record.sensor_noise import GYRO_VARIANCE, OTHER_VARIANCE
from fifthwheel.vehicle import Vehicle

PROCESS_VARIANCE = {
    "lateral_velocity": 3e-3**2,
    "yaw_rate": 6e-4**2,
    "articulation": 3e-5**2,
    "roll": 3e-5**2,
    "roll_rate": 1.2e-3**2,
    "slip_angle": 0.0,
    "bank": 2e-3**2,
}
"""Process noise of each state per second, SI squared, for the estimation of parameters."""

OBSERVER_PROCESS_VARIANCE = {
    "lateral_velocity": 2e-2**2,
    "yaw_rate": 1e-3**2,
    "articulation": 1e-3**2,
    "roll": 1e-3**2,
    "roll_rate": 1e-3**2,
    "slip_angle": 0.0,
    "bank": 2e-3**2,
}
"""Process noise of each state per second, SI squared, for the observation of states.

Equation (14) of Cheng and Cebon (2011), 1e-8 rad^2 per step of 10 ms, with sideslip converted to lateral velocity.
"""


def sensor_variance(vehicle: Vehicle, name: str, given: Mapping[str, float]) -> float:
    """Variance of a sensor's noise, SI squared: as given, else that of the article's gyros, else a default.

    Args:
        vehicle: gives the first unit, whose gyros have other variances.
        name: signal.
        given: variances by signal.
    """
    if name in given:
        return given[name]
    signal = SignalName.of(name)
    if signal.quantity in GYRO_VARIANCE:
        return GYRO_VARIANCE[signal.quantity][0 if signal.unit == vehicle.units[0].name else 1]
    return OTHER_VARIANCE[signal.quantity]


def process_covariance(states: Sequence[str], table: Mapping[str, float], factor: float = 1.0) -> Array:
    """Q per second (n, n), diagonal.

    Args:
        states: names of the n states.
        table: variance per second by quantity.
        factor: of all variances.
    """
    return np.diag([factor * table[SignalName.of(name).quantity] for name in states])
