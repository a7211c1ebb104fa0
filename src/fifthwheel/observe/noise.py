"""Variances to start from: sensors, process, initial state. One idea: by quantity, for any chain of units."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from fifthwheel.vehicle import Vehicle

Array = NDArray[np.float64]

GYROS = {"roll_rate": (4.52e-4, 4.70e-5), "yaw_rate": (1.52e-5, 1.11e-5)}
"""Variances, (rad/s)^2, of the first unit's gyro and of those behind it: equation (12) of the article."""

OTHERS = {"articulation": 0.005**2, "roll": 0.005**2, "lateral_acceleration": 0.2**2, "sideslip": 0.005**2}
"""Variance of sensors that the article does not have, SI squared."""

PROCESS = {
    "lateral_velocity": 1e-2**2,
    "yaw_rate": 2e-3**2,
    "articulation": 1e-4**2,
    "roll": 1e-4**2,
    "roll_rate": 4e-3**2,
}
"""Variance that a state gains in a second by what the model leaves out, SI squared."""

INITIAL = {"lateral_velocity": 1.0, "yaw_rate": 0.3, "articulation": 0.3, "roll": 0.1, "roll_rate": 0.1}
"""Standard deviation of a state at the start of a record, SI; the start itself is straight running."""


def sensor(vehicle: Vehicle, name: str, given: Mapping[str, float]) -> float:
    """Variance of a sensor's noise: as given, else the article's, else the table's."""
    quantity, unit = name.split(".")[:2]
    if name in given:
        return given[name]
    if quantity in GYROS:
        return GYROS[quantity][0 if unit == vehicle.units[0].name else 1]
    return OTHERS[quantity]


def process(states: Sequence[str], factor: float) -> Array:
    """Q per second (n, n)."""
    return np.diag([factor * PROCESS[name.split(".")[0]] for name in states])


def initial(states: Sequence[str]) -> Array:
    """P at the start of a record (n, n)."""
    return np.diag([INITIAL[name.split(".")[0]] ** 2 for name in states])
