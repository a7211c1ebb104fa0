"""The variance of reported signals that uncertain parameters cause.

A change of the parameters along a direction changes the filter's state by x', its sensitivity. The gain K of the filter
stays as it is: its change acts on innovations only, which are small. It would change the rms of a sigma by a few
percent, and needs ten times the operations.

    x'- = F x' + dx-/dp p'                 prediction
    x'  = x'- - K (H x'- + dh/dp p')       update

The variance of a signal is the sum of the squares of its sensitivities along the columns of a square root of the
covariance of the parameters.
"""

import os

import casadi as ca
import numpy as np

from fifthwheel._types import Array
from fifthwheel.dynamics import ChainModel
from fifthwheel.filters import kalman
from fifthwheel.filters.model import pack, packed_size, sizes, split, unpack
from fifthwheel.native import DirectionScan, compiled
from fifthwheel.observe.sigma_points import SigmaPoints

CHUNK = 1_000
"""Number of rows in one pass; it bounds the memory for long records."""


@compiled(DirectionScan)
def sensitivity_step(model: ChainModel, report: ChainModel) -> ca.Function:
    """The compiled step: `observer_step`, and the change of its reported signals along directions of the parameters.

    carry = [x, P]; sample = [dt, d, y, weight]; constant = [c, Q, R, gate^2, c of the report]; output = reported;
    carry' = x'; constant' = [c', c' of the report]; output' = reported'.
    """
    n_x, n_d, _, n_c, n_y = sizes(model)
    n_P, n_report = packed_size(n_x), len(report.known)
    carry, sample, constant, x_dot, parameters_dot = (
        ca.SX.sym(name, size)
        for name, size in (
            ("carry", n_x + n_P),
            ("sample", 1 + n_d + 2 * n_y),
            ("constant", n_c + n_P + n_y + 1 + n_report),
            ("x_dot", n_x),
            ("parameters_dot", n_c + n_report),
        )
    )
    x, P = split(carry, [n_x, n_P])
    dt, d, y, weight = split(sample, [1, n_d, n_y, n_y])
    c, q, r, limit, c_report = split(constant, [n_c, n_P, n_y, 1, n_report])
    c_dot, report_dot = split(parameters_dot, [n_c, n_report])
    no_p, state = ca.SX(0, 1), ca.SX.sym("state", n_x)
    before, P_before, _ = kalman.predict(model, x, unpack(P, n_x), dt, d, no_p, c, unpack(q, n_x))
    predicted, H = kalman.observe(model, before, d, no_p, c)
    after, P_after, _, _ = kalman.correct(before, P_before, predicted, H, y, weight, r, limit)
    gain = ca.jacobian(after, y)
    before_dot = ca.jtimes(model.transition(x, dt, d, no_p, c), ca.vertcat(x, c), ca.vertcat(x_dot, c_dot))
    along = ca.vertcat(before_dot, c_dot)
    predicted_dot = ca.jtimes(model.observation(state, d, no_p, c), ca.vertcat(state, c), along)
    after_dot = before_dot - gain @ ca.substitute(predicted_dot, state, before)
    reported = report.observation(state, d, no_p, c_report)
    reported_dot = ca.jtimes(reported, ca.vertcat(state, c_report), ca.vertcat(after_dot, report_dot))
    results = [
        ca.vertcat(after, pack(P_after)),
        ca.substitute(reported, state, after),
        after_dot,
        ca.substitute(reported_dot, state, after),
    ]
    arguments = [carry, sample, constant, x_dot, parameters_dot]
    return ca.Function("sensitivity", arguments, [ca.densify(result) for result in results], {"cse": True})


def parameter_directions(model: ChainModel, report: ChainModel, points: SigmaPoints) -> Array:
    """Directions [c', c' of the report] (k, n) by differences of the constants at k pairs of sigma points.

    Args:
        model, report: of the measured and of the reported signals.
        points: of the uncertain parameters.
    """
    n_x, _, _, n_c, n_y = sizes(model)
    first = n_c + packed_size(n_x) + n_y + 1
    slopes = (points.constants[::2] - points.constants[1::2]) / (2 * points.steps[:, None])
    return np.hstack([slopes[:, :n_c], slopes[:, first : first + len(report.known)]])


def parameter_variance(
    model: ChainModel, report: ChainModel, points: SigmaPoints, start: Array, rows: Array, constant: Array
) -> Array:
    """Variance (N, n) of the n reported signals, as a filter gives them, over the parameters.

    Args:
        model, report: of the measured and of the reported signals.
        points: of the uncertain parameters.
        start: [x, P] before the first row; it does not depend on the parameters, because P is wide enough.
        rows: (N, n_sample); their weights determine the samples that are used.
        constant: of `observer_step`, with an infinite gate.
    """
    scan, directions = sensitivity_step(model, report), parameter_directions(model, report, points)
    variances, carry, constant = [], start, constant[: scan.sizes[2]]
    carry_dot = np.zeros((len(directions), scan.sizes[3]))
    for first in range(0, len(rows), CHUNK):
        chunk = rows[first : first + CHUNK]
        result = scan(carry, chunk, constant, carry_dot, directions, threads=os.cpu_count() or 1)
        variances.append(np.einsum("rnk,rnk->rn", result.output_dot, result.output_dot))
        carry, carry_dot = result.carry, result.carry_dot
    return np.concatenate(variances)
