"""Variances to start from: sensors, process, initial state. One idea: by quantity, for any chain of units."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from fifthwheel import dynamics
from fifthwheel.vehicle import Vehicle

Array = NDArray[np.float64]

GYROS = {"roll_rate": (4.52e-4, 4.70e-5), "yaw_rate": (1.52e-5, 1.11e-5)}
"""Variances, (rad/s)^2, of the first unit's gyro and of those behind it: equation (12) of the article."""

OTHERS = {"articulation": 0.005**2, "roll": 0.005**2, "lateral_acceleration": 0.2**2, "sideslip": 0.005**2}
"""Variance of sensors that the article does not have, SI squared."""

PROCESS = {
    "lateral_velocity": 3e-3**2,
    "yaw_rate": 6e-4**2,
    "articulation": 3e-5**2,
    "roll": 3e-5**2,
    "roll_rate": 1.2e-3**2,
}
"""Variance that a state gains in a second by what the model leaves out, SI squared, while parameters are estimated."""

OBSERVED = {
    "lateral_velocity": 2e-2**2,
    "yaw_rate": 1e-3**2,
    "articulation": 1e-3**2,
    "roll": 1e-3**2,
    "roll_rate": 1e-3**2,
}
"""The same while states are observed: equation (14), 1e-8 rad^2 a step of 10 ms, with sideslip as lateral velocity."""

INITIAL = {"lateral_velocity": 0.05, "yaw_rate": 0.01, "articulation": 0.01, "roll": 0.005, "roll_rate": 0.02}
"""Standard deviation of a state about its steady value at the start of a record that starts straight, SI."""

UNSTEADY = 0.5
"""What of the steady value itself is added to that deviation, for a record that starts in a bend."""


def sensor(vehicle: Vehicle, name: str, given: Mapping[str, float]) -> float:
    """Variance of a sensor's noise: as given, else the article's, else the table's."""
    quantity, unit = name.split(".")[:2]
    if name in given:
        return given[name]
    if quantity in GYROS:
        return GYROS[quantity][0 if unit == vehicle.units[0].name else 1]
    return OTHERS[quantity]


def process(states: Sequence[str], table: Mapping[str, float], factor: float = 1.0) -> Array:
    """Q per second (n, n)."""
    return np.diag([factor * table[name.split(".")[0]] for name in states])


def initial(
    vehicle: Vehicle, inputs: Mapping[str, float], errors: Mapping[str, float], *, roll: bool
) -> tuple[Array, Array]:
    """State (n,) at the start of a record, and its covariance (n, n).

    A record starts somewhere near the steady state that its first steer angles lead to at its first speed.

    Args:
        inputs: the first speed and steer angles by name, as shown.
        errors: zeros and gains of the steer sensors as far as they are known, such as "steer.tractor.front.offset",
            and other values of the vehicle's parameters.
    """
    own = vehicle.parameters()
    changed = {name: value for name, value in errors.items() if name in own}
    m = dynamics.matrices(vehicle, inputs["speed"], roll=roll, changed=changed)
    steer = np.array(
        [
            errors.get(f"{name}.gain", 1.0) * (inputs[name] - errors.get(f"{name}.offset", 0.0))
            for name in vehicle.steer_signals()
        ]
    )
    stable = np.linalg.eigvals(m.A).real.max() < 0
    x0 = -np.linalg.solve(m.A, m.B @ steer) if stable else np.zeros(len(m.A))
    deviation = np.array([INITIAL[name.split(".")[0]] for name in m.states]) + UNSTEADY * np.abs(x0)
    return x0, np.diag(deviation**2)
