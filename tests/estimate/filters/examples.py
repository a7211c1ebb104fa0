"""Models for the filters, runs of the filters over a record, and reference filters in NumPy."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from fifthwheel.base.types import Array
from fifthwheel.estimate.filters import Model, Noise, kalman
from fifthwheel.estimate.filters.model import pack_array, packed_size, sizes, unpack_array
from fifthwheel.estimate.filters.step_rows import step_rows
from fifthwheel.model import dynamics
from fifthwheel.model.dynamics import ChainModel
from fifthwheel.model.simulate import simulate
from fifthwheel.truck import Vehicle, get

GYROS = ("roll_rate.tractor", "roll_rate.semitrailer", "yaw_rate.tractor", "yaw_rate.semitrailer")
NOISE = np.array([4.52e-4, 4.70e-5, 1.52e-5, 1.11e-5])
DEVIATION = {"lateral_velocity": 0.1, "yaw_rate": 0.03, "articulation": 0.02, "roll": 0.01, "roll_rate": 0.03}
ARGUMENTS = ("x", "dt", "d", "p", "c")


@dataclass(frozen=True, kw_only=True)
class Filtered:
    """Result of the filter for a record of N samples, n states and m channels.

    Innovations are those of the sequential update: the innovation of a channel is conditioned on the previous channels
    of the same sample, so that the sum of squared innovations over their variances is the NIS of the sample.
    """

    state: Array  # (N, n) after the update
    covariance: Array  # (N, n, n) after the update
    predicted_state: Array  # (N, n) before the update
    predicted_covariance: Array  # (N, n, n) before the update
    innovation: Array  # (N, m), 0 where missing
    innovation_variance: Array  # (N, m)
    accepted: Array  # (N, m) 1 where the measurement was used, 0 where it was missing or outside the gate


def run_kalman(model: Model, rows: Array, *, p: Array, c: Array, noise: Noise, x0: Array, P0: Array) -> Filtered:
    """Filter one record.

    Args:
        model: of the record.
        rows: (N, 1 + n_d + 2 n_y), from `model.sample_rows`.
        p, c: parameters of the model, (n_p,) and (n_c,).
        noise: of process and measurements.
        x0, P0: state (n,) and covariance (n, n) before the first row.
    """
    n_x, _, _, _, n_y = sizes(model)
    carry = np.concatenate([x0, pack_array(P0)])
    _, out = kalman.kalman_step(model)(carry, rows, np.concatenate([p, c, noise.vector()]))
    edges = np.cumsum([n_x, packed_size(n_x), n_y, n_y, n_y, n_x])
    x, P, innovation, variance, accepted, before, P_before = np.split(out, edges, axis=1)
    return Filtered(
        state=x,
        covariance=unpack_array(P, n_x),
        predicted_state=before,
        predicted_covariance=unpack_array(P_before, n_x),
        innovation=innovation,
        innovation_variance=variance,
        accepted=accepted,
    )


@dataclass(frozen=True, kw_only=True)
class Smoothed:
    """Smoothed states of a record."""

    state: Array  # (N, n)
    covariance: Array  # (N, n, n)


def run_smoother(model: Model, rows: Array, *, p: Array, c: Array, noise: Noise, x0: Array, P0: Array) -> Smoothed:
    """Filter a record forwards, then smooth it backwards; arguments as in `run_kalman`."""
    constant, n_x = np.concatenate([p, c, noise.vector()]), len(x0)
    chunks = kalman.smoothed_chunks(model, None, rows, np.concatenate([x0, pack_array(P0)])[None], constant[None])
    smoothed = np.concatenate([chunk for _, (chunk,) in reversed(list(chunks))])
    return Smoothed(state=smoothed[:, :n_x], covariance=unpack_array(smoothed[:, n_x:], n_x))


@dataclass(frozen=True, eq=False)
class Example:
    """A symbolic model."""

    transition: ca.Function
    observation: ca.Function


def example(
    transition: Callable[..., ca.SX], observation: Callable[..., ca.SX], *, x: int, d: int = 0, p: int = 0, c: int = 0
) -> Example:
    """The model x+ = transition(x, dt, d, p, c), y = observation(x, d, p, c)."""
    symbols = [ca.SX.sym(name, size) for name, size in zip(ARGUMENTS, (x, 1, d, p, c), strict=True)]
    without_dt = [symbols[0], *symbols[2:]]
    return Example(
        ca.Function("transition", symbols, [ca.densify(ca.vertcat(transition(*symbols)))]),
        ca.Function("observation", without_dt, [ca.densify(ca.vertcat(observation(*without_dt)))]),
    )


@dataclass(frozen=True)
class Numbers:
    """Functions of a model and their derivatives as arrays, by CasADi's interpreter."""

    model: Model

    @cached_property
    def transition_function(self) -> ca.Function:
        symbols = [ca.SX.sym(name, *self.model.transition.size_in(i)) for i, name in enumerate(ARGUMENTS)]
        later = self.model.transition(*symbols)
        return ca.Function("f", symbols, [later, ca.jacobian(later, symbols[0]), ca.jacobian(later, symbols[3])])

    @cached_property
    def observation_function(self) -> ca.Function:
        symbols = [
            ca.SX.sym(name, *self.model.observation.size_in(i)) for i, name in enumerate(ARGUMENTS[:1] + ARGUMENTS[2:])
        ]
        y = self.model.observation(*symbols)
        return ca.Function("h", symbols, [y, ca.jacobian(y, symbols[0]), ca.jacobian(y, symbols[2])])

    def transition(self, x: Array, dt: float, d: Array, p: Array, c: Array) -> tuple[Array, Array, Array]:
        """x+ and its derivatives with respect to x and p."""
        later, F, by_p = (np.array(value) for value in self.transition_function(x, dt, d, p, c))
        return later[:, 0], F, by_p

    def observation(self, x: Array, d: Array, p: Array, c: Array) -> tuple[Array, Array, Array]:
        """y and its derivatives with respect to x and p."""
        y, H, by_p = (np.array(value) for value in self.observation_function(x, d, p, c))
        return y[:, 0], H, by_p


@dataclass(frozen=True, kw_only=True, repr=False)
class Linear:
    """x+ = F x + g, y = H x + b, for each row."""

    F: Array  # (N, n, n)
    g: Array  # (N, n)
    H: Array  # (N, m, n)
    b: Array  # (N, m)


def linear(model: Model, rows: Array, p: Array, c: Array) -> Linear:
    """Matrices of a linear model at every row, from its derivatives."""
    numbers, n_d = Numbers(model), model.transition.numel_in(2)
    zero = np.zeros(model.transition.numel_in(0))
    F, g, H, b = [], [], [], []
    for row in rows:
        d = row[1 : 1 + n_d]
        (offset, slope, _), (y, H_row, _) = (
            numbers.transition(zero, row[0], d, p, c),
            numbers.observation(zero, d, p, c),
        )
        g.append(offset), F.append(slope), b.append(y), H.append(H_row)
    return Linear(F=np.array(F), g=np.array(g), H=np.array(H), b=np.array(b))


@dataclass(frozen=True, kw_only=True, repr=False)
class Article:
    """The article's vehicle with locked trailer axles, its model, and the rows of a record."""

    vehicle: Vehicle
    model: ChainModel
    rows: Array  # (N, 1 + 4 + 8), nothing missing
    c: Array
    linear: Linear
    noise: Noise
    x0: Array
    P0: Array

    @property
    def measured(self) -> Array:
        return self.rows[:, 5:9]

    def arguments(self) -> dict[str, object]:
        """Arguments of `run_kalman` and `run_smoother`."""
        return {"p": np.empty(0), "c": self.c, "noise": self.noise, "x0": self.x0, "P0": self.P0}


def lane_change(rng: np.random.Generator) -> Article:
    """A lane change with irregular sampling, simulated by the discrete model; all channels are measured."""
    truck = get("cheng_cebon_2011")
    without_relaxation = truck.replace(
        {path: 0.0 for path in truck.parameters() if path.endswith(".relaxation_length")}
    )
    record = simulate(without_relaxation, count=1, duration=9.0, sensors=dict(zip(GYROS, NOISE, strict=True)))
    indices = np.sort(rng.choice(len(record), size=500, replace=False))
    time = record.time[indices] + rng.uniform(-0.004, 0.004, 500)
    signals = {name: values[indices] for name, values in record.signals.items()}
    signals["speed"] = 23.0 + 3.0 * np.sin(time / 3)
    record = replace(record, time=time, signals=signals, reference={})
    locked = without_relaxation.with_logged_steering(record.signals, record.name)
    model = dynamics.model(locked, GYROS, roll=True)
    errors = {"yaw_rate.tractor.offset": 0.002, "steer.tractor.front.offset": -0.001, "steer.tractor.front.gain": 1.05}
    c = model.known_values(dynamics.all_parameters(locked, GYROS) | errors)
    rows = step_rows(model, locked, record)[:]
    deviation = np.array([DEVIATION[name.split(".")[0]] for name in model.states])
    noise = Noise(process=np.diag((0.1 * deviation) ** 2), measurement=NOISE)
    system = linear(model, rows, np.empty(0), c)
    x0 = 0.3 * deviation
    _, measured = simulate_model(system, rows, noise, x0 + rng.normal(size=(1, 8)) * deviation, rng)
    rows = np.hstack([rows[:, :5], measured[0], np.ones_like(measured[0])])
    return Article(
        vehicle=locked, model=model, rows=rows, c=c, linear=system, noise=noise, x0=x0, P0=np.diag(deviation**2)
    )


def simulate_model(
    system: Linear, rows: Array, noise: Noise, x: Array, rng: np.random.Generator
) -> tuple[Array, Array]:
    """States (B, N, n) and measurements (B, N, m) of the discrete model, from x (B, n) before the first row, with
    process noise of variance Q dt and measurement noise R."""
    states, measured = [], []
    for k in range(len(rows)):
        w = rng.normal(size=x.shape) * np.sqrt(np.diag(noise.process) * rows[k, 0])
        x = x @ system.F[k].T + system.g[k] + w
        v = rng.normal(size=(len(x), len(noise.measurement))) * np.sqrt(noise.measurement)
        states.append(x), measured.append(x @ system.H[k].T + system.b[k] + v)
    return np.stack(states, axis=1), np.stack(measured, axis=1)


def without(rows: Array, missing: NDArray[np.bool_], n_d: int) -> Array:
    """The rows without the channels in `missing` (N, m), in the form of `sample_rows`."""
    m = missing.shape[1]
    rows = rows.copy()
    rows[:, 1 + n_d : 1 + n_d + m][missing] = 0.0
    rows[:, 1 + n_d + m :][missing] = 0.0
    return rows


def max_difference(actual: Array, expected: Array) -> float:
    """Largest difference in (N, n), relative to the largest value of the column, or in covariances (N, n, n), relative
    to the standard deviations."""
    if expected.ndim == 3:
        deviation = np.sqrt(np.einsum("kii->ki", expected))
        return float((np.abs(actual - expected) / (deviation[:, :, None] * deviation[:, None, :])).max())
    return float((np.abs(actual - expected) / np.abs(expected).max(axis=0)).max())


def joint_update(x: Array, P: Array, innovation: Array, H: Array, R: Array) -> tuple[Array, Array, float]:
    """The Kalman update with all channels together: state, covariance, NIS."""
    S = H @ P @ H.T + np.diag(R)
    K = np.linalg.solve(S, H @ P).T
    left = np.eye(len(x)) - K @ H
    nis = float(innovation @ np.linalg.solve(S, innovation))
    return x + K @ innovation, left @ P @ left.T + K @ np.diag(R) @ K.T, nis
