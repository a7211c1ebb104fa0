"""Fixed-interval smoothing: every state given the whole record.

The modified Bryson-Frazier form (Bierman 1977, chapter X): backwards in time with the adjoint of the filter, so that no
covariance is inverted and the process noise may be zero. Without process noise the smoothed states are one trajectory
of the model, from the initial state that fits the record best.
"""

import functools
from dataclasses import dataclass

import casadi as ca
import numpy as np

from fifthwheel.filters import kalman
from fifthwheel.filters.model import Array, Model, pack, pack_array, packed_size, sizes, split, unpack, unpack_array
from fifthwheel.native import Scan


@dataclass(frozen=True, kw_only=True)
class Smoothed:
    """States (N, n) and covariances (N, n, n) given all samples."""

    state: Array
    covariance: Array


@functools.cache
def step(model: Model, report: Model | None = None) -> Scan:
    """The compiled backward step.

    carry = [adjoint state, adjoint covariance, dt and d], of the row after this one;
    sample = [dt, d, y, weight, accepted, x-, P-]; constant as the filter's; output = [x, P] smoothed.

    With `report`, a model of the same state without free parameters: constant = [the filter's, c of the report];
    output = [its outputs at the smoothed states, their variances].
    """
    n_x, n_d, n_p, n_c, n_y = sizes(model)
    n_P, n_report = packed_size(n_x), 0 if report is None else sizes(report)[3]
    carry, sample, constant = (
        ca.SX.sym(name, size)
        for name, size in (
            ("carry", n_x + n_P + 1 + n_d),
            ("sample", 1 + n_d + 3 * n_y + n_x + n_P),
            ("constant", n_p + n_c + n_P + n_y + 1 + n_report),
        )
    )
    adjoint, information, dt_next, d_next = split(carry, [n_x, n_P, 1, n_d])
    dt, d, y, _, accepted, before, P_before = split(sample, [1, n_d, n_y, n_y, n_y, n_x, n_P])
    p, c, _, r, _, c_report = split(constant, [n_p, n_c, n_P, n_y, 1, n_report])
    information, P_before = unpack(information, n_x), unpack(P_before, n_x)

    predicted, H = kalman.observe(model, before, d, p, c)
    never = ca.SX(1e300)  # what the filter accepted is known; no gate here
    x, P, channels, gains = kalman.correct(before, P_before, predicted, H, y, accepted, r, never)
    _, _, F = kalman.predict(model, x, P, dt_next, d_next, p, c, ca.SX(n_x, n_x))
    adjoint, information = F.T @ adjoint, ca.mtimes([F.T, information, F])
    smoothed, P_smoothed = x - P @ adjoint, P - ca.mtimes([P, information, P])
    told = smoothed, pack(P_smoothed)
    if report is not None:
        told = kalman.tell(report, smoothed, P_smoothed, d, ca.SX(0, 1), c_report)
    for channel, (gain, row) in reversed(list(zip(channels, gains, strict=True))):
        used = channel.accepted
        back = ca.SX.eye(n_x) - gain @ row
        adjoint = back.T @ adjoint - used * row.T * channel.innovation / channel.variance
        information = ca.mtimes([back.T, information, back]) + used * row.T @ row / channel.variance
    carried = ca.vertcat(adjoint, pack(information), dt, d)
    results = [ca.densify(carried), ca.densify(ca.vertcat(*told))]
    return Scan(ca.Function("smoother", [carry, sample, constant], results, {"cse": True}))


def run(model: Model, rows: Array, *, p: Array, c: Array, noise: kalman.Noise, x0: Array, P0: Array) -> Smoothed:
    """Filter one record forwards, then smooth it backwards; arguments as in `kalman.run`."""
    n_x, n_d, _, _, n_y = sizes(model)
    n_P = packed_size(n_x)
    constant = np.concatenate([p, c, noise.vector()])
    carry = np.concatenate([x0, pack_array(P0)])
    _, out = kalman.step(model)(carry, rows, constant)
    edges = np.cumsum([n_x, n_P, 2 * n_y, n_y])
    _, _, _, accepted, predicted = np.split(out, edges, axis=1)
    start = np.concatenate([np.zeros(n_x + n_P + 1), rows[-1, 1 : 1 + n_d]])
    _, back = step(model)(start, np.hstack([rows, accepted, predicted])[::-1], constant)
    back = back[::-1]
    return Smoothed(state=back[:, :n_x], covariance=unpack_array(back[:, n_x:], n_x))
