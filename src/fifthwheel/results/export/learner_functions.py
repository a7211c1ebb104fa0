"""The symbolic functions of a learner in C; what is the same for every vehicle is written in C."""

from typing import NamedTuple

import casadi as ca
import numpy as np

from fifthwheel.base.native.c_code import by_rows
from fifthwheel.base.native.c_code import step as symbolic
from fifthwheel.base.types import Array
from fifthwheel.estimate.filters.joint import (
    Carried,
    JointChannel,
    bounds,
    correct,
    linearise,
    packed,
    reported_values,
)
from fifthwheel.estimate.filters.kalman import transition_matrix
from fifthwheel.estimate.filters.model import sizes, split
from fifthwheel.estimate.observe.monitor import START, normalised_monitor
from fifthwheel.estimate.online.live_filter import LiveFilter
from fifthwheel.estimate.online.start import SteadyEquations, steady_equations
from fifthwheel.model.dynamics.chain import state_names

LARGEST_GATE = 1e15
"""Limit of a squared gate, so that it fits into single precision."""


class Slopes(NamedTuple):
    """A function whose derivatives are stored without their zeros."""

    function: ca.Function
    places: Array  # of each stored derivative in V by columns (n_x, n_p)


def linearisation(live: LiveFilter) -> Slopes:
    """(state, z, [dt, d]) -> (state after dt, F by rows, slopes at both ends of the step, predictions, H by rows,
    direct by rows); see `linearise`. The slopes are stored without zeros."""
    setup, scaling = live.setup, live.setup.scaling
    n_x, n_d, *_ = sizes(live.model)
    x, z, step = ca.SX.sym("x", n_x), ca.SX.sym("z", len(setup.estimated_unknowns)), ca.SX.sym("step", 1 + n_d)
    given = _numbers(live.filter.c, scaling.centre, scaling.scale)
    later, parts, slopes, predicted, H, direct = linearise(
        live.model, scaling.logarithmic, x, z, step[0], step[1:], *given
    )
    F = transition_matrix(live.model, parts)
    pattern = (slopes[0].sparsity() + slopes[1].sparsity()).T.T
    first, last = (ca.project(slope, pattern).nz[:] for slope in slopes)
    results = [later, by_rows(F), first, last, predicted, by_rows(H), by_rows(direct)]
    function = symbolic("linearise", [x, z, step], results)
    rows, columns = pattern.get_triplet()
    return Slopes(function, np.array(rows) + n_x * np.array(columns))


def channel_update(live: LiveFilter) -> ca.Function:
    """(carry, [y, weight, noise, predicted, learn, row of H, row of direct, state before, z of the linearisation]) ->
    (carry, [accepted, innovation over its standard deviation]); see `correct`."""
    layout, n_p, n_z = live.filter.layout, len(live.setup.unknowns), len(live.setup.estimated_unknowns)
    carry, channel = ca.SX.sym("carry", layout.size), ca.SX.sym("channel", 5 + 2 * layout.n_x + n_p + n_z)
    scalars, row, direct, before, base_z = split(channel, [5, layout.n_x, n_p, layout.n_x, n_z])
    y, weight, noise, predicted, learn = ca.vertsplit(scalars)
    measured = JointChannel(y, weight, noise, predicted, row.T, direct.T)
    limit = ca.fmin(ca.SX(live.filter.noise.vector()[-1]), LARGEST_GATE)
    lower, upper = _numbers(*bounds(live.setup.scaling, n_z))
    carried = Carried.of(carry, layout)
    new, accepted, innovation = correct(carried, measured, before, base_z, learn, limit, (lower, upper))
    return symbolic("channel", [carry, channel], [ca.vertcat(*packed(new)), ca.vertcat(accepted, innovation)])


def health(live: LiveFilter) -> ca.Function:
    """(carry, [dt, inputs at the last sample, inputs now, innovations, weights]) -> (carry, [settling, NIS, restart]);
    see `monitor.normalised_monitor`."""
    inputs, channels = live.setup.inputs, len(live.setup.outputs)
    carry, sample = ca.SX.sym("carry", len(START)), ca.SX.sym("sample", 1 + 2 * len(inputs) + 2 * channels)
    (constant,) = _numbers(np.minimum(live.monitor.constant, LARGEST_GATE))
    results = normalised_monitor(inputs, channels).call([carry, sample, constant])
    return symbolic("health", [carry, sample], results)


def report(live: LiveFilter) -> ca.Function:
    """(state of the vehicle, z, d) -> (reported states, their derivatives by rows); see `reported_values`."""
    view, scaling = live.view, live.setup.scaling
    n_x, n_d, *_ = sizes(view.report)
    x, z, d = ca.SX.sym("x", n_x), ca.SX.sym("z", len(live.setup.estimated_unknowns)), ca.SX.sym("d", n_d)
    numbers = _numbers(view.c, scaling.centre, scaling.scale)
    values, slopes = reported_values(view.report, scaling.logarithmic, x, z, d, *numbers)
    return symbolic("report", [x, z, d], [values, by_rows(slopes)])


def start_matrices(live: LiveFilter) -> ca.Function:
    """(inputs, values of the unknowns) -> (A by rows, first column of B, effects of inputs and bank on x')."""
    inputs, p, _, steady = _steady(live)
    results = [by_rows(steady.A), steady.B[:, 0], steady.B @ steady.steer, steady.bank]
    return symbolic("start_matrices", [inputs, p], results)


def start_slopes(live: LiveFilter) -> ca.Function:
    """(inputs, values of the unknowns, x) -> (F by rows, derivatives of F x + G d with respect to them by rows)."""
    inputs, p, x, steady = _steady(live)
    return symbolic("start_slopes", [inputs, p, x], [by_rows(steady.F), by_rows(steady.slopes)])


def _steady(live: LiveFilter) -> tuple[ca.SX, ca.SX, ca.SX, SteadyEquations]:
    """Symbols of inputs, values of the unknowns and state, and the equations of the steady state."""
    setup = live.setup
    inputs, p = ca.SX.sym("inputs", len(setup.inputs)), ca.SX.sym("p", len(setup.unknowns))
    x = ca.SX.sym("x", len(state_names(setup.vehicle, roll=True)))
    return inputs, p, x, steady_equations(live.model, inputs, x, p, *_numbers(live.filter.c))


def _numbers(*values: Array) -> list[ca.SX]:
    return [ca.SX(ca.DM(value)) for value in values]
