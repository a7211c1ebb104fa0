"""The variance of reported signals that uncertain parameters cause.

A change of the parameters along a direction changes the filter's state by x', its sensitivity. The gain K of the filter
stays as it is: its change acts on innovations only, which are small. It would change the rms of a sigma by a few
percent, and needs ten times the operations.

    x'- = F x' + dx-/dp p'                 prediction
    x'  = x'- - K (H x'- + dh/dp p')       update, channel by channel

The variance of a signal is the sum of the squares of its sensitivities along the columns of a square root of the
covariance of the parameters.
"""

import os

import casadi as ca
import numpy as np

from fifthwheel._types import Array
from fifthwheel.filters import kalman
from fifthwheel.filters.model import split
from fifthwheel.native import DirectionScan, compiled
from fifthwheel.observe.observed_chain import ObservedChain
from fifthwheel.observe.observer_step import Layout, filter_step
from fifthwheel.observe.sigma_points import SigmaPoints

CHUNK = 1_000
"""Number of rows in one pass; it bounds the memory for long records."""


@compiled(DirectionScan)
def sensitivity_step(model: ObservedChain, report: ObservedChain) -> ca.Function:
    """The compiled step: `observer_step`, and the change of its reported signals along directions of the parameters.

    carry, sample and constant as there, without those of the monitor; output = variances of the reported signals that
    the considered bank causes; carry' = x'; constant' = [c', c' of the report]; output' = reported'.
    """
    layout = Layout.of(model, report)
    n_x, n_c, n_report = layout.carry[0], layout.constant[0], layout.constant[4]
    carry, sample, constant, x_dot, parameters_dot = (
        ca.SX.sym(name, size)
        for name, size in (
            ("carry", sum(layout.carry)),
            ("sample", sum(layout.sample)),
            ("constant", sum(layout.constant)),
            ("x_dot", n_x),
            ("parameters_dot", n_c + n_report),
        )
    )
    x, *_ = split(carry, layout.carry)
    dt, d, _, _ = split(sample, layout.sample)
    c, *_, c_report, _ = split(constant, layout.constant)
    c_dot, report_dot = split(parameters_dot, [n_c, n_report])
    no_p, state = ca.SX(0, 1), ca.SX.sym("state", n_x)
    step = filter_step(model, layout, carry, sample, constant)
    before_dot = ca.jtimes(model.transition(x, dt, d, no_p, c), ca.vertcat(x, c), ca.vertcat(x_dot, c_dot))
    direct_dot, after_dot = ca.jtimes(model.observation(state, d, no_p, c), c, c_dot), before_dot
    for i, (point, row, gain) in enumerate(step.linearised):
        after_dot = after_dot - gain @ (row @ after_dot + ca.substitute(direct_dot[i], state, point))
    reported = report.observation(state, d, no_p, c_report)
    _, H = kalman.observe(report, step.after, d, no_p, c_report)
    reported_dot = ca.jtimes(reported, ca.vertcat(state, c_report), ca.vertcat(after_dot, report_dot))
    results = [
        step.carry,
        ca.sum2((H @ step.considered) ** 2),
        after_dot,
        ca.substitute(reported_dot, state, step.after),
    ]
    arguments = [carry, sample, constant, x_dot, parameters_dot]
    return ca.Function("sensitivity", arguments, [ca.densify(result) for result in results], {"cse": True})


def parameter_directions(model: ObservedChain, report: ObservedChain, points: SigmaPoints) -> Array:
    """Directions [c', c' of the report] (k, n) by differences of the constants at k pairs of sigma points.

    Args:
        model, report: of the measured and of the reported signals.
        points: of the uncertain parameters.
    """
    n_c, *between, n_report, _ = Layout.of(model, report).constant
    first = n_c + sum(between)
    slopes = (points.constants[::2] - points.constants[1::2]) / (2 * points.steps[:, None])
    return np.hstack([slopes[:, :n_c], slopes[:, first : first + n_report]])


def parameter_variance(
    model: ObservedChain,
    report: ObservedChain,
    points: SigmaPoints,
    effects: Array,
    start: Array,
    rows: Array,
    constant: Array,
    *,
    with_bank: bool,
) -> Array:
    """Variance (N, n) of the n reported signals, as a filter gives them, over the parameters.

    Args:
        model, report: of the measured and of the reported signals.
        points: of the uncertain parameters.
        effects: change (u, n_x) of the first state per unit of bank and offsets.
        start: [x, P, s] before the first row; it does not depend on the other parameters, because P is wide enough.
        rows: (N, n_sample); their weights determine the samples that are used.
        constant: of `observer_step`, with an infinite gate.
        with_bank: whether the bank is one of the parameters; then the variance is without that of the filter, which
            considers the bank itself.
    """
    scan, directions = sensitivity_step(model, report), parameter_directions(model, report, points)
    carry, constant, carry_dot = start, constant[: scan.sizes[2]], points.unknowns @ effects
    variance = np.empty((len(rows), len(report.outputs)))
    for first in range(0, len(rows), CHUNK):
        chunk = slice(first, first + CHUNK)
        result = scan(carry, rows[chunk], constant, carry_dot, directions, threads=os.cpu_count() or 1)
        variance[chunk] = np.einsum("rnk,rnk->rn", result.output_dot, result.output_dot) - with_bank * result.output
        carry, carry_dot = result.carry, result.carry_dot
    return variance
