"""State and covariance at the first sample of a record."""

from collections.abc import Mapping

import numpy as np

from fifthwheel.base.errors import SignalError
from fifthwheel.base.types import Array
from fifthwheel.data.channels import channel_of
from fifthwheel.model import dynamics
from fifthwheel.truck import Vehicle


def initial_sigma(state: str) -> float:
    """Standard deviation of a state about its steady value at the first sample, without steering, SI."""
    channel = channel_of(state)
    if channel is None or channel.state is None:
        raise SignalError(f"{state}: no state of a model; give the name of one")
    return channel.state.initial_sigma


TYPICAL_STEER_SIGMA = 0.015
"""Standard deviation of the steer angles that an on-line observer assumes before the first sample, rad."""

STEER_BANDWIDTH = 0.4
"""Bandwidth of the steer angles, Hz: that of a lane change."""

SMITH_SHIFT, SMITH_PRECISION = 10.0, 1e-12
"""s of Smith's method, rad/s, and the largest element of the first power of C that is left out."""


def steady_initial_state(
    vehicle: Vehicle, inputs: Mapping[str, float], errors: Mapping[str, float], *, roll: bool, bank: float = 0.0
) -> tuple[Array, dynamics.Matrices]:
    """Steady state (n,) of constant inputs, zero for an unstable vehicle, and the matrices with the bank as a state.

    The inputs are the speed, m/s, and the measured steer angles, rad, by name; the bank of the road is in rad. `errors`
    are known errors of the steer sensors, such as "steer.tractor.front.offset", and values of parameters
    that replace those of the vehicle.
    """
    parameters = vehicle.parameters()
    changed = {name: value for name, value in errors.items() if name in parameters}
    m = dynamics.matrices(vehicle, inputs["speed"], roll=roll, bank=True, changed=changed)
    return equilibrium(m, m.B[:-1] @ steer_angles(vehicle, inputs, errors) + m.A[:-1, -1] * bank), m


def steer_angles(vehicle: Vehicle, inputs: Mapping[str, float], errors: Mapping[str, float]) -> Array:
    """The steer angles (k,), rad, from the measured ones; arguments as in `steady_initial_state`."""
    return np.array([dynamics.steer_angle(name, inputs[name], errors).angle for name in vehicle.steer_signals()])


def equilibrium(m: dynamics.Matrices, excitation: Array) -> Array:
    """x (n,) or (n, k) with A x + excitation = 0, without the bank; zero for an unstable vehicle."""
    A = m.A[:-1, :-1]
    stable = np.linalg.eigvals(A).real.max() < 0
    return np.asarray(-np.linalg.solve(A, excitation) if stable else np.zeros_like(excitation), dtype=np.float64)


def bank_effect(m: dynamics.Matrices) -> Array:
    """Change (n + 1,) of the steady state per rad of bank; as in `m`, the bank is the last state."""
    return np.append(equilibrium(m, m.A[:-1, -1]), 1.0)


def steer_effects(m: dynamics.Matrices) -> Array:
    """Change (k, n + 1) of the steady state per rad of each of k steer angles; the bank is the last state."""
    return np.array([np.append(equilibrium(m, column), 0.0) for column in m.B[:-1].T]).reshape(-1, len(m.A))


def initial_state(
    vehicle: Vehicle,
    inputs: Mapping[str, float],
    errors: Mapping[str, float],
    *,
    roll: bool,
    steer_sigma: float,
    bank: float | None = None,
) -> tuple[Array, Array]:
    """State (n,) at the first sample and its covariance (n, n).

    The state is the steady state of the first steer angles. The record may start within a manoeuvre. Therefore the
    covariance is the sum of `initial_sigma` and the stationary covariance under random steer angles. The bank moves all
    states to its own steady state: otherwise a truck in equilibrium on a banked road would look like one on a level
    road.

    Arguments as in `steady_initial_state`, with the inputs of the first sample; `steer_sigma` and `bank` are standard
    deviations, rad. The bank is a state if it is given.
    """
    x0, m = steady_initial_state(vehicle, inputs, errors, roll=roll)
    P0 = initial_covariance(m, steer_sigma)
    if bank is None:
        return x0, P0
    effect = bank * bank_effect(m)
    return np.append(x0, 0.0), np.pad(P0, (0, 1)) + np.outer(effect, effect)


def initial_factor(covariance: Array) -> Array:
    """Upper triangular L (n, n) with L L' = covariance of `initial_state`.

    Only its last column moves the bank: the effect of all others decays.
    """
    return np.asarray(np.linalg.cholesky(covariance[::-1, ::-1])[::-1, ::-1])


def initial_covariance(m: dynamics.Matrices, steer_sigma: float) -> Array:
    """Covariance (n, n) of the states about a steady state, without the bank; arguments as in `initial_state`."""
    floor = np.diag([initial_sigma(name) ** 2 for name in m.states[:-1]])
    return np.asarray(floor + steer_sigma**2 * random_steer_covariance(m))


def random_steer_covariance(m: dynamics.Matrices) -> Array:
    """Stationary covariance (n, n) of the states per variance of a random first steer angle; zero if unstable.

    The steer angle is white noise through a first-order low-pass of `STEER_BANDWIDTH`. The covariance of low-pass and
    vehicle solves the Lyapunov equation A P + P A' + Q = 0. By Smith's method (SIAM J. Appl. Math. 16, 1968) it is the
    sum of C^k D C'^k with C = (A - s)^-1 (A + s), for any s > 0; each round doubles the number of terms. `m` has the
    bank as a state.
    """
    n, rate = len(m.A) - 1, 2 * np.pi * STEER_BANDWIDTH
    A = np.zeros((n + 1, n + 1))
    A[:n, :n], A[:n, n], A[n, n] = m.A[:n, :n], m.B[:n, 0], -rate
    if np.linalg.eigvals(A).real.max() >= 0:
        return np.zeros((n, n))
    shift, unit = SMITH_SHIFT * np.eye(n + 1), np.eye(n + 1)[:, n:]
    C, excitation = np.linalg.solve(A - shift, A + shift), np.linalg.solve(A - shift, unit)
    P = 4 * rate * SMITH_SHIFT * excitation @ excitation.T
    while np.abs(C).max() > SMITH_PRECISION:
        P, C = P + C @ P @ C.T, C @ C
    return np.asarray(P[:n, :n])
