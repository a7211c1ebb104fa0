"""The (extended) Kalman filter of a symbolic model, for irregular sampling and missing channels.

Kalman (1960); equations (3)-(6) of Cheng and Cebon (2011). For a linear model it is the Kalman filter.

The measurement update works channel by channel (Bierman 1977; Simon 2006, section 6.1). With a diagonal R the result
equals the update with all channels together. No matrix is inverted, a missing channel has the weight 0, and Joseph's
form keeps the covariance positive.

The equations are those of `casadi.SX` and of `casadi.MX`: with the latter, they call the functions of the model.

Fixed-interval smoothing gives the state at each sample from all samples of the record. The modified Bryson-Frazier form
(Bierman 1977, chapter X) runs backwards with the adjoint of the filter. It inverts no covariance, so the process noise
may be zero. Without process noise the smoothed states are one trajectory of the model, which starts at the initial
state with the best fit to the record.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Generic, NamedTuple

import casadi as ca
import numpy as np

from fifthwheel.base.native import Scan, compiled
from fifthwheel.base.types import Array
from fifthwheel.estimate.filters.model import Model, pack, pack_array, packed_size, partitioned, sizes, unpack
from fifthwheel.estimate.filters.step_rows import SampleRows
from fifthwheel.model.dynamics.symbolic import Matrix

CHUNK = 500
"""Number of rows in one pass, which bounds the memory. The forward pass stores only the carry before each chunk; the
backward pass repeats the filter chunk by chunk."""


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


class ChannelUpdate(NamedTuple, Generic[Matrix]):
    """Result of one channel at one sample; scalars."""

    innovation: Matrix  # 0 if missing
    variance: Matrix  # of the innovation
    accepted: Matrix  # 1 if used, else 0


def transition(model: Model) -> ca.Function:
    """(x, dt, d, p, c) -> the state (n,) after dt, and what `transition_matrix` makes F of."""
    arguments = [ca.SX.sym("a", size) for size in (sizes(model)[0], 1, *sizes(model)[1:4])]
    later = model.transition(*arguments)
    parts: ca.Function | None = getattr(model, "transition_parts", getattr(model, "state_jacobian", None))
    of_F = [ca.jacobian(later, arguments[0])] if parts is None else parts.call(arguments)
    return ca.Function("transition", arguments, [later, *of_F], {"cse": True})


def transition_matrix(model: Model, parts: Sequence[Matrix]) -> Matrix:
    """F (n, n + k), with the columns of k considered parameters, from the results of `transition` after the state."""
    build: Callable[..., Matrix] | None = getattr(model, "transition_matrix", None)
    dense = [ca.densify(part) for part in parts]
    return dense[0] if build is None else ca.densify(build(*dense))


def predict(
    model: Model, x: Matrix, covariance: Matrix, dt: Matrix, d: Matrix, p: Matrix, c: Matrix, q: Matrix
) -> tuple[Matrix, Matrix, Matrix]:
    """Time update, with the process noise of equation (5) of Cheng and Cebon (2011).

    It gives the state (n,) after dt, its covariance F P F' + Q dt with Q per second (n, n), and the
    `transition_matrix`.
    """
    results: list[Matrix] = transition(model).call([x, dt, d, p, c])
    later, slopes = results[0], transition_matrix(model, results[1:])
    F = slopes[:, : x.shape[0]]
    return later, ca.mac(F, covariance @ F.T, q * dt), slopes


def observe(
    model: Model, x: Matrix, d: Matrix, p: Matrix, c: Matrix, outputs: slice = slice(None)
) -> tuple[Matrix, Matrix]:
    """Predicted measurements (m,) at x, or some of them, and their derivatives H (m, n + k) as `transition_matrix`."""
    arguments = [ca.SX.sym("a", size) for size in sizes(model)[:4]]
    jacobian: ca.Function | None = getattr(model, "observation_jacobian", None)
    y = model.observation(*arguments)
    H = ca.jacobian(y, arguments[0]) if jacobian is None else jacobian(*arguments)
    function = ca.Function("observe", arguments, [y[outputs], H[outputs, :]], {"cse": True})
    results: list[Matrix] = function.call([x, d, p, c])
    return ca.densify(results[0]), ca.densify(results[1])


def report_outputs(
    model: Model, x: Matrix, covariance: Matrix, effects: Matrix, d: Matrix, c: Matrix
) -> tuple[Matrix, Matrix, Matrix]:
    """Outputs (m,) of another model of the same state, their variances without measurement noise, and by the unknowns.

    `effects` (n + k, j) are the changes of the state and of k considered parameters by j independent unknowns of unit
    variance; (n, 0) without any.
    """
    outputs, slopes = observe(model, x, d, type(x)(0, 1), c)
    H, of_unknowns = slopes[:, : x.shape[0]], ca.sum2((slopes[:, : effects.shape[0]] @ effects) ** 2)
    return outputs, ca.sum2((H @ covariance) * H), of_unknowns


def correct(
    x: ca.SX, covariance: ca.SX, predicted: ca.SX, H: ca.SX, y: ca.SX, weight: ca.SX, r: ca.SX, limit: ca.SX
) -> tuple[ca.SX, ca.SX, list[ChannelUpdate[ca.SX]], list[tuple[ca.SX, ca.SX]]]:
    """Measurement update by m channels, (m,) each of y, weight and r, with the squared gate `limit`.

    It gives state, covariance, the update of each channel, and (gain, row of H) of each channel; r is that of equation
    (6) of Cheng and Cebon (2011).
    """
    prior, nothing, channels, gains = x, (ca.SX(x.shape[0], 0), ca.SX(1, 0)), [], []
    for i in range(y.shape[0]):
        row = H[i, : x.shape[0]]
        innovation = y[i] - predicted[i] - row @ (x - prior)
        x, covariance, _, channel, gain = correct_channel(
            x, covariance, innovation, row, weight[i], r[i], limit, *nothing
        )
        channels.append(channel)
        gains.append((gain, row))
    return x, covariance, channels, gains


def correct_channel(
    x: Matrix,
    covariance: Matrix,
    innovation: Matrix,
    row: Matrix,
    weight: Matrix,
    r: Matrix,
    limit: Matrix,
    considered: Matrix,
    direct: Matrix,
) -> tuple[Matrix, Matrix, Matrix, ChannelUpdate[Matrix], Matrix]:
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
    gain = accepted / exact * cross
    covariance = joseph(covariance, cross, gain, row, r)
    channel = ChannelUpdate(weight * innovation, variance, accepted)
    return ca.mac(gain, innovation, x), covariance, ca.mac(-gain, effect, considered), channel, gain


def joseph(covariance: Matrix, cross: Matrix, gain: Matrix, row: Matrix, noise: Matrix) -> Matrix:
    """Joseph's form (I - K h) P (I - K h)' + K r K' for a channel y = h x + v, with cross = P h' and noise = r."""
    left = ca.mac(-gain, cross.T, covariance)
    return ca.mac(noise * gain - left @ row.T, gain.T, left)


def gate(innovation: Matrix, variance: Matrix, weight: Matrix, limit: Matrix) -> Matrix:
    """1 if the channel is measured (weight 1) and its innovation is within the squared gate `limit`, else 0."""
    return weight * (innovation * innovation <= limit * variance)


def channel_columns(channels: Sequence[ChannelUpdate[Matrix]]) -> Matrix:
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


@compiled(Scan)
def smoother_step(model: Model, report: Model | None = None) -> ca.Function:
    """The compiled backward step of the smoother.

    carry = [adjoint state, adjoint covariance, dt, d] of the following row;
    sample = [dt, d, y, weight, accepted, x-, P-]; constant = that of the filter; output = smoothed [x, P].

    With `report`, a model of the same state without free parameters: constant = [that of the filter, c of the report];
    output = [outputs of the report at the smoothed state, their variances].
    """
    n_x, n_d, n_p, n_c, n_y = sizes(model)
    n_P, n_report = packed_size(n_x), 0 if report is None else sizes(report)[3]
    carry, adjoint, information, dt_next, d_next = partitioned("carry", n_x, n_P, 1, n_d)
    sample, dt, d, y, _, accepted, before, P_before = partitioned("sample", 1, n_d, n_y, n_y, n_y, n_x, n_P)
    constant, p, c, _, r, _, c_report = partitioned("constant", n_p, n_c, n_P, n_y, 1, n_report)
    information, P_before = unpack(information, n_x), unpack(P_before, n_x)

    predicted, H = observe(model, before, d, p, c)
    open_gate = ca.SX(1e300)  # the filter has already gated the samples
    x, P, channels, gains = correct(before, P_before, predicted, H, y, accepted, r, open_gate)
    _, _, slopes = predict(model, x, P, dt_next, d_next, p, c, ca.SX(n_x, n_x))
    F = slopes[:, :n_x]
    adjoint, information = F.T @ adjoint, ca.mtimes([F.T, information, F])
    smoothed, P_smoothed = x - P @ adjoint, P - ca.mtimes([P, information, P])
    results = smoothed, pack(P_smoothed)
    if report is not None:
        results = report_outputs(report, smoothed, P_smoothed, ca.SX(n_x, 0), d, c_report)[:2]
    for channel, (gain, row) in reversed(list(zip(channels, gains, strict=True))):
        used = channel.accepted
        correction = ca.SX.eye(n_x) - gain @ row
        adjoint = correction.T @ adjoint - used * row.T * channel.innovation / channel.variance
        information = ca.mtimes([correction.T, information, correction]) + used * row.T @ row / channel.variance
    carried = ca.vertcat(adjoint, pack(information), dt, d)
    outputs = [ca.densify(carried), ca.densify(ca.vertcat(*results))]
    return ca.Function("smoother", [carry, sample, constant], outputs, {"cse": True})


def smoothed_chunks(
    model: Model, report: Model | None, rows: Array | SampleRows, carry: Array, constant: Array
) -> Iterator[tuple[slice, Array]]:
    """Outputs of `smoother_step` given all N rows, for B carries and constants of the filter, (B, M, n_output).

    They come in chunks of M rows, of which the last is the first. The constants have those of the report after those of
    the filter.
    """
    n_x, n_d, _, _, n_y = sizes(model)
    forwards, backwards = kalman_step(model), smoother_step(model, report)
    filter_constant, constant = constant[:, : forwards.n_constant], constant[:, : backwards.n_constant]
    slices = [slice(*edges) for edges in pairwise([*range(0, len(rows), CHUNK), len(rows)])]
    starts = [carry]
    for chunk in slices[:-1]:
        starts.append(forwards.batch(starts[-1], rows[chunk], filter_constant)[0])
    back = np.zeros((len(carry), backwards.n_carry))
    back[:, backwards.n_carry - n_d :] = rows[-1:][0, 1 : 1 + n_d]
    for chunk, start in zip(reversed(slices), reversed(starts), strict=True):
        _, out = forwards.batch(start, rows[chunk], filter_constant)
        samples = np.broadcast_to(rows[chunk], (len(carry), *rows[chunk].shape))
        accepted_and_predicted = out[:, :, -(n_y + n_x + packed_size(n_x)) :]
        samples = np.concatenate([samples, accepted_and_predicted], axis=2)
        back, smoothed = backwards.batch(back, samples[:, ::-1], constant)
        yield chunk, smoothed[:, ::-1]
