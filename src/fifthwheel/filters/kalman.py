"""The (extended) Kalman filter of a symbolic model, for irregular sampling and missing channels.

Kalman (1960); equations (3)-(6) of Cheng and Cebon (2011). For a linear model it is the Kalman filter.

The measurement update works channel by channel (Bierman 1977; Simon 2006, section 6.1). With a diagonal R the result
equals the update with all channels together. No matrix is inverted, a missing channel has the weight 0, and Joseph's
form keeps the covariance positive.
"""

from dataclasses import dataclass
from typing import NamedTuple

import casadi as ca
import numpy as np

from fifthwheel._types import Array
from fifthwheel.dynamics.symbolic import Matrix
from fifthwheel.filters.model import Model, pack, pack_array, packed_size, partitioned, sizes, unpack
from fifthwheel.native import Scan, compiled


@dataclass(frozen=True, kw_only=True)
class Noise:
    """Noise of a filter."""

    process: Array  # Q (n, n), variance per second
    measurement: Array  # R (m,), variances
    gate: float = np.inf  # largest innovation in standard deviations

    def vector(self) -> Array:
        """[Q packed, R, gate^2] for a compiled step."""
        limit = min(self.gate, 1e100) ** 2
        return np.concatenate([pack_array(self.process), self.measurement, [limit]])


class ChannelUpdate(NamedTuple):
    """Result of one channel at one sample; scalars."""

    innovation: ca.SX  # 0 if missing
    variance: ca.SX  # of the innovation
    accepted: ca.SX  # 1 if used, else 0


def predict(
    model: Model, x: ca.SX, covariance: ca.SX, dt: ca.SX, d: ca.SX, p: ca.SX, c: ca.SX, q: ca.SX
) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Time update: the state (n,) after dt, its covariance F P F' + Q dt with Q per second (n, n), and F."""
    later = model.transition(x, dt, d, p, c)
    state_jacobian: ca.Function | None = getattr(model, "state_jacobian", None)
    if state_jacobian is not None:
        F = state_jacobian(x, dt, d, p, c)
    else:
        symbol = ca.SX.sym("x", x.shape[0])
        F = ca.substitute(ca.jacobian(model.transition(symbol, dt, d, p, c), symbol), symbol, x)
    return later, ca.mtimes([F, covariance, F.T]) + q * dt, F


def observe(model: Model, x: ca.SX, d: ca.SX, p: ca.SX, c: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Predicted measurements (m,) at x, and their Jacobian H (m, n)."""
    jacobian: ca.Function | None = getattr(model, "observation_jacobian", None)
    if jacobian is not None:
        return model.observation(x, d, p, c), jacobian(x, d, p, c)
    symbol = ca.SX.sym("x", x.shape[0])
    predicted = model.observation(symbol, d, p, c)
    y, H = ca.substitute([predicted, ca.jacobian(predicted, symbol)], [symbol], [x])
    return y, H


def report_outputs(
    model: Model, x: ca.SX, covariance: ca.SX, considered: ca.SX, direct: ca.SX, d: ca.SX, c: ca.SX
) -> tuple[ca.SX, ca.SX]:
    """Outputs (m,) of another model of the same state, and their variances without measurement noise; `considered`
    (n, k) and `direct` (m, k) as in `correct_channel`."""
    outputs, H = observe(model, x, d, ca.SX(0, 1), c)
    rows = ca.vertsplit(H) if H.shape[0] else []
    spread = ca.sum2((H @ considered + direct) ** 2)
    return outputs, ca.vertcat(*[h @ covariance @ h.T + spread[i] for i, h in enumerate(rows)])


def correct(
    x: ca.SX, covariance: ca.SX, predicted: ca.SX, H: ca.SX, y: ca.SX, weight: ca.SX, r: ca.SX, limit: ca.SX
) -> tuple[ca.SX, ca.SX, list[ChannelUpdate], list[tuple[ca.SX, ca.SX]]]:
    """Measurement update by m channels, (m,) each of y, weight and r, with the squared gate `limit`.

    It gives state, covariance, the update of each channel, and (gain, row of H) of each channel.
    """
    prior, nothing, channels, gains = x, (ca.SX(x.shape[0], 0), ca.SX(1, 0)), [], []
    for i in range(y.shape[0]):
        row = H[i, :]
        innovation = y[i] - predicted[i] - row @ (x - prior)
        x, covariance, _, channel, gain = correct_channel(
            x, covariance, innovation, row, weight[i], r[i], limit, *nothing
        )
        channels.append(channel)
        gains.append((gain, row))
    return x, covariance, channels, gains


def correct_channel(
    x: ca.SX,
    covariance: ca.SX,
    innovation: ca.SX,
    row: ca.SX,
    weight: ca.SX,
    r: ca.SX,
    limit: ca.SX,
    considered: ca.SX,
    direct: ca.SX,
) -> tuple[ca.SX, ca.SX, ca.SX, ChannelUpdate, ca.SX]:
    """Measurement update of one channel with considered parameters, which it does not correct (Schmidt 1966).

    The weights are those for exact parameters. Optimal weights would correct the state as if the measurements showed
    the parameters, which a model error does too. The gate allows for the parameters.

    The innovation is measured less predicted at x, `row` (1, n) the derivative of the measurement there. One standard
    deviation of each of k parameters changes the state by `considered` (n, k), and the measurement further by `direct`
    (1, k); the covariance is that without them. It gives state, covariance, `considered`, the update of the channel,
    and the gain (n, 1).
    """
    cross, effect = covariance @ row.T, row @ considered + direct
    exact = row @ cross + r
    variance = exact + ca.sumsqr(effect)
    accepted = gate(innovation, variance, weight, limit)
    gain = accepted * cross / exact
    covariance = joseph(covariance, cross, gain, row, r)
    channel = ChannelUpdate(weight * innovation, variance, accepted)
    return x + gain * innovation, covariance, considered - gain @ effect, channel, gain


def joseph(covariance: Matrix, cross: Matrix, gain: Matrix, row: Matrix, noise: Matrix) -> Matrix:
    """Joseph's form (I - K h) P (I - K h)' + K r K' for a channel y = h x + v, with cross = P h' and noise = r."""
    left = covariance - gain @ cross.T
    return left - (left @ row.T - noise * gain) @ gain.T


def gate(innovation: Matrix, variance: Matrix, weight: Matrix, limit: Matrix) -> Matrix:
    """1 if the channel is measured (weight 1) and its innovation is within the squared gate `limit`, else 0."""
    return weight * (innovation * innovation <= limit * variance)


def channel_columns(channels: list[ChannelUpdate]) -> ca.SX:
    """[innovations, their variances, accepted], (3 m,)."""
    return ca.vertcat(*[channel[i] for i in range(3) for channel in channels])


@compiled(Scan)
def kalman_step(model: Model) -> ca.Function:
    """The compiled step of the filter.

    carry = [x, P]; sample = [dt, d, y, weight]; constant = [p, c, Q, R, gate^2];
    output = [x, P, innovation, variance, accepted, x-, P-]. Matrices are packed.
    """
    n_x, n_d, n_p, n_c, n_y = sizes(model)
    n_P = packed_size(n_x)
    carry, x, P = partitioned("carry", n_x, n_P)
    sample, dt, d, y, weight = partitioned("sample", 1, n_d, n_y, n_y)
    constant, p, c, q, r, limit = partitioned("constant", n_p, n_c, n_P, n_y, 1)
    before, P_before, _ = predict(model, x, unpack(P, n_x), dt, d, p, c, unpack(q, n_x))
    predicted, H = observe(model, before, d, p, c)
    after, P_after, channels, _ = correct(before, P_before, predicted, H, y, weight, r, limit)
    carried = ca.vertcat(after, pack(P_after))
    output = ca.vertcat(carried, channel_columns(channels), before, pack(P_before))
    return ca.Function("kalman", [carry, sample, constant], [ca.densify(carried), ca.densify(output)], {"cse": True})
