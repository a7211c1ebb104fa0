"""Variances to start from: process, initial state. One idea: by quantity, for any chain of units."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from fifthwheel import dynamics
from fifthwheel.logs.noise import GYROS, OTHERS
from fifthwheel.vehicle import Vehicle

Array = NDArray[np.float64]

PROCESS = {
    "lateral_velocity": 3e-3**2,
    "yaw_rate": 6e-4**2,
    "articulation": 3e-5**2,
    "roll": 3e-5**2,
    "roll_rate": 1.2e-3**2,
    "slip_angle": 0.0,
    "bank": 2e-3**2,
}
"""Variance that a state gains in a second by what the model leaves out, SI squared, while parameters are estimated."""

OBSERVED = {
    "lateral_velocity": 2e-2**2,
    "yaw_rate": 1e-3**2,
    "articulation": 1e-3**2,
    "roll": 1e-3**2,
    "roll_rate": 1e-3**2,
    "slip_angle": 0.0,
    "bank": 2e-3**2,
}
"""The same while states are observed: equation (14), 1e-8 rad^2 a step of 10 ms, with sideslip as lateral velocity."""

INITIAL = {
    "lateral_velocity": 0.05,
    "yaw_rate": 0.01,
    "articulation": 0.01,
    "roll": 0.005,
    "roll_rate": 0.02,
    "slip_angle": 0.002,
    "bank": 0.03,
}
"""Standard deviation of a state about its steady value at the start of a record on which nobody steers, SI."""

SWING = 0.015
"""What steer angles a live observer reckons with before it has seen any, rad, one standard deviation."""

DRIVER = 0.4
"""How fast steer angles change, Hz: those of a lane change."""


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


def steady(
    vehicle: Vehicle, inputs: Mapping[str, float], errors: Mapping[str, float], *, roll: bool
) -> tuple[Array, dynamics.Matrices]:
    """The state (n,) that constant inputs lead to, zero where the vehicle is unstable; and the matrices behind it.

    Args:
        inputs: speed and steer angles by name, as shown.
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
    return (-np.linalg.solve(m.A, m.B @ steer) if stable else np.zeros(len(m.A))), m


def initial(
    vehicle: Vehicle,
    inputs: Mapping[str, float],
    errors: Mapping[str, float],
    *,
    roll: bool,
    swing: float,
    bank: float | None = None,
) -> tuple[Array, Array]:
    """State (n,) at the start of a record, and its covariance (n, n); arguments as in `steady`.

    A record starts somewhere about the steady state that its first steer angles lead to. It may also start within a
    manoeuvre: how far off the states then are, and how they are off together, is their stationary covariance under
    steer angles of standard deviation `swing` (rad) that change at random. `bank` is the standard deviation of the
    road's, rad, where it is a state.
    """
    x0, m = steady(vehicle, inputs, errors, roll=roll)
    floor = np.diag([INITIAL[name.split(".")[0]] ** 2 for name in m.states])
    P0 = floor + swing**2 * steered_at_random(m)
    if bank is None:
        return x0, P0
    return np.append(x0, 0.0), np.pad(P0, (0, 1)) + np.diag([*[0.0] * len(x0), bank**2])


def steered_at_random(m: dynamics.Matrices) -> Array:
    """Covariance (n, n) of the states per variance of a random first steer angle; zero where the vehicle is unstable.

    The Lyapunov equation A P + P A' + Q = 0 of the vehicle behind a first-order low-pass of `DRIVER` Hz, by the
    eigenvectors of A.
    """
    n, rate = len(m.A), 2 * np.pi * DRIVER
    A = np.zeros((n + 1, n + 1))
    A[:n, :n], A[:n, n], A[n, n] = m.A, m.B[:, 0], -rate
    values, vectors = np.linalg.eig(A)
    if values.real.max() >= 0:
        return np.zeros((n, n))
    drive = np.linalg.solve(vectors, np.eye(n + 1)[:, n])
    modal = -2 * rate * np.outer(drive, drive.conj()) / (values[:, None] + values.conj())
    return np.asarray((vectors @ modal @ vectors.conj().T).real[:n, :n])
