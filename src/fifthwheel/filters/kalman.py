"""The (extended) Kalman filter over any symbolic model, for records with irregular time and missing channels.

Kalman (1960); the article's equations (3)-(6). On a linear model it is the Kalman filter exactly.
"""

import functools
from dataclasses import dataclass

import casadi as ca
import numpy as np

from fifthwheel.filters.model import Array, Model, pack, pack_array, packed_size, sizes, split, unpack, unpack_array
from fifthwheel.filters.update import Channel, gate, joseph
from fifthwheel.native import Scan


@dataclass(frozen=True, kw_only=True)
class Filtered:
    """A record after the filter; N samples, n states, m channels. Innovations are those of the sequential update:
    each channel's is conditioned on the channels before it in the same sample, so that squares over variances add up
    to the sample's NIS."""

    state: Array  # (N, n) after the update
    covariance: Array  # (N, n, n) after the update
    predicted_state: Array  # (N, n) before the update
    predicted_covariance: Array  # (N, n, n) before the update
    innovation: Array  # (N, m), 0 where missing
    innovation_variance: Array  # (N, m)
    accepted: Array  # (N, m) 1 where the measurement was used, 0 where it was missing or outside the gate


@dataclass(frozen=True, kw_only=True)
class Noise:
    """Process noise per second Q (n, n), measurement variances R (m,), and the gate in standard deviations."""

    process: Array
    measurement: Array
    gate: float = np.inf

    def vector(self) -> Array:
        limit = min(self.gate, 1e100) ** 2
        return np.concatenate([pack_array(self.process), self.measurement, [limit]])


def predict(
    model: Model, x: ca.SX, covariance: ca.SX, dt: ca.SX, d: ca.SX, p: ca.SX, c: ca.SX, q: ca.SX
) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Time update: the state dt later, its covariance F P F' + Q dt, and F."""
    later = model.transition(x, dt, d, p, c)
    own: ca.Function | None = getattr(model, "state_jacobian", None)
    if own is not None:
        F = own(x, dt, d, p, c)
    else:
        symbol = ca.SX.sym("x", x.shape[0])
        F = ca.substitute(ca.jacobian(model.transition(symbol, dt, d, p, c), symbol), symbol, x)
    return later, ca.mtimes([F, covariance, F.T]) + q * dt, F


def observe(model: Model, x: ca.SX, d: ca.SX, p: ca.SX, c: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Predicted measurements at x and their Jacobian H."""
    symbol = ca.SX.sym("x", x.shape[0])
    predicted = model.observation(symbol, d, p, c)
    y, H = ca.substitute([predicted, ca.jacobian(predicted, symbol)], [symbol], [x])
    return y, H


def tell(model: Model, x: ca.SX, covariance: ca.SX, d: ca.SX, p: ca.SX, c: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Outputs of a model of the same state at x, and their variances, which no sensor's noise is a part of."""
    shown, S = observe(model, x, d, p, c)
    return shown, ca.vertcat(*[S[i, :] @ covariance @ S[i, :].T for i in range(S.shape[0])])


def correct(
    x: ca.SX, covariance: ca.SX, predicted: ca.SX, H: ca.SX, y: ca.SX, weight: ca.SX, r: ca.SX, limit: ca.SX
) -> tuple[ca.SX, ca.SX, list[Channel], list[tuple[ca.SX, ca.SX]]]:
    """Measurement update, channel by channel: state, covariance, what each channel left, and each (gain, row)."""
    prior, channels, gains = x, [], []
    for i in range(y.shape[0]):
        row = H[i, :]
        innovation = y[i] - predicted[i] - row @ (x - prior)
        cross = covariance @ row.T
        variance = row @ cross + r[i]
        accepted = gate(innovation, variance, weight[i], limit)
        gain = accepted * cross / variance
        x = x + gain * innovation
        covariance = joseph(covariance, cross, gain, row, r[i])
        channels.append(Channel(weight[i] * innovation, variance, accepted))
        gains.append((gain, row))
    return x, covariance, channels, gains


def channel_columns(channels: list[Channel]) -> ca.SX:
    """Innovations, their variances, accepted: 3 m rows."""
    return ca.vertcat(*[channel[i] for i in range(3) for channel in channels])


@functools.cache
def step(model: Model) -> Scan:
    """The compiled step.

    carry = [x, P]; sample = [dt, d, y, weight]; constant = [p, c, Q, R, gate^2];
    output = [x, P, innovation, variance, accepted, x-, P-]. Matrices are packed.
    """
    n_x, n_d, n_p, n_c, n_y = sizes(model)
    n_P = packed_size(n_x)
    carry, sample, constant = (
        ca.SX.sym(name, size)
        for name, size in (
            ("carry", n_x + n_P),
            ("sample", 1 + n_d + 2 * n_y),
            ("constant", n_p + n_c + n_P + n_y + 1),
        )
    )
    x, P = split(carry, [n_x, n_P])
    dt, d, y, weight = split(sample, [1, n_d, n_y, n_y])
    p, c, q, r, limit = split(constant, [n_p, n_c, n_P, n_y, 1])
    before, P_before, _ = predict(model, x, unpack(P, n_x), dt, d, p, c, unpack(q, n_x))
    predicted, H = observe(model, before, d, p, c)
    after, P_after, channels, _ = correct(before, P_before, predicted, H, y, weight, r, limit)
    carried = ca.vertcat(after, pack(P_after))
    output = ca.vertcat(carried, channel_columns(channels), before, pack(P_before))
    return Scan(
        ca.Function("kalman", [carry, sample, constant], [ca.densify(carried), ca.densify(output)], {"cse": True})
    )


def run(model: Model, rows: Array, *, p: Array, c: Array, noise: Noise, x0: Array, P0: Array) -> Filtered:
    """Filter one record.

    Args:
        rows: from `model.sample_rows`, (N, 1 + n_d + 2 n_y).
        p, c: the model's parameters, (n_p,) and (n_c,).
        noise: Q per second, R and the gate.
        x0, P0: state (n,) and covariance (n, n) before the first row.
    """
    n_x, _, _, _, n_y = sizes(model)
    carry = np.concatenate([x0, pack_array(P0)])
    _, out = step(model)(carry, rows, np.concatenate([p, c, noise.vector()]))
    n_P = packed_size(n_x)
    edges = np.cumsum([n_x, n_P, n_y, n_y, n_y, n_x])
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
