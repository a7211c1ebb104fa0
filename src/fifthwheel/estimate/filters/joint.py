"""The joint filter of state and parameters for on-line use, with optional learning and a choice of linearisation.

The compiled step contains the equations in one piece; the step in C calls `correct` once for each channel.

The dual filter of the article with both switches on is Friedland's (1969) separate form of the joint extended Kalman
filter. This filter adds:

* learn: z has no gain on a sample with learn = 0.
* Considered parameters c ~ N(0, I), which keep their prior mean 0 (Schmidt 1966). `B` is the derivative of the estimate
  of z that goes with a change of c. The covariance of z is Pz + B B', its covariance with c is B. The gains ignore c,
  so that samples are not weighted by an assumed model of the vehicle's errors. After earlier logs c has a correlation
  R = L L' and z the covariance Pz + B R B'; the gate ignores R.
* The score test of each considered parameter (Rao 1948; `identify.doubts`): with rho the derivative of an innovation
  with respect to c, and S its variance, the gradient is - sum rho e / S and the information sum rho^2 / S.
* walk: the variance of an estimated z grows towards that of its prior with this rate, 1/s.
* zl: another point of linearisation than the filter's own z. A second filter repeats samples with a better
  linearisation, which is an iteration of the filter (Bell and Cathey 1993).
"""

import functools
from itertools import accumulate, pairwise
from typing import Generic, NamedTuple

import casadi as ca
import numpy as np

from fifthwheel.base.native import Scan, compiled
from fifthwheel.base.types import Array
from fifthwheel.estimate.filters.kalman import Noise, gate, joseph, transition, transition_matrix
from fifthwheel.estimate.filters.model import Model, pack, packed_size, partitioned, sizes, split, unpack
from fifthwheel.estimate.filters.scaling import PRECISION, Scaling, symbolic_to_p
from fifthwheel.model.dynamics.symbolic import Matrix

MAX_STATE = 1e3
"""Limit of the norm of state, standard deviations and sensitivities, SI; beyond it the filter has diverged."""

MAX_ESTIMATE = 1e100
"""Limit of the norm of all numbers of an estimate; its score tests may be large."""


class JointLayout:
    """Slices of the carry [x, P, V, z, Pz, B, gradient, information].

    P and Pz are packed; V (n_x, n_z + n_c) and B (n_z, n_c) are stored by columns, for n_x states, n_z estimated and
    n_c considered parameters.
    """

    def __init__(self, n_x: int, n_z: int, n_c: int) -> None:
        self.n_x, self.n_z, self.n_c = n_x, n_z, n_c
        self.lengths = (n_x, packed_size(n_x), n_x * (n_z + n_c), n_z, packed_size(n_z), n_z * n_c, n_c, n_c)
        edges = [0, *accumulate(self.lengths)]
        slices = [slice(*ends) for ends in pairwise(edges)]
        self.x, self.P, self.V, self.z, self.Pz, self.B, self.gradient, self.information = slices
        self.size = edges[-1]
        self.estimate = slice(self.z.start, self.size)
        """All that does not belong to the state."""


class Carried(NamedTuple, Generic[Matrix]):
    """The carry within a step, as matrices; see `JointLayout`."""

    x: Matrix
    P: Matrix
    V: Matrix
    z: Matrix
    Pz: Matrix
    B: Matrix
    gradient: Matrix
    information: Matrix

    @classmethod
    def of(cls, carry: Matrix, layout: JointLayout) -> "Carried[Matrix]":
        """The parts of a carry."""
        n_x, n_z, n_c = layout.n_x, layout.n_z, layout.n_c
        x, P, V, z, Pz, B, gradient, information = split(carry, layout.lengths)
        V, B = ca.reshape(V, n_x, n_z + n_c), ca.reshape(B, n_z, n_c)
        return Carried(x, unpack(P, n_x), V, z, unpack(Pz, n_z), B, gradient, information)


def packed(carried: Carried[Matrix]) -> list[Matrix]:
    """The inverse of `Carried.of`, in parts."""
    x, P, V, z, Pz, B, gradient, information = carried
    return [x, pack(P), ca.vec(V), z, pack(Pz), ca.vec(B), gradient, information]


class JointChannel(NamedTuple, Generic[Matrix]):
    """A measurement and its prediction."""

    y: Matrix
    weight: Matrix
    noise: Matrix  # variance
    predicted: Matrix
    row: Matrix  # of H (1, n_x)
    direct: Matrix  # derivative with respect to the parameters (1, n_p)


def linearise(
    model: Model,
    logarithmic: tuple[bool, ...],
    x: ca.SX,
    z: ca.SX,
    dt: ca.SX,
    d: ca.SX,
    c: ca.SX,
    centre: ca.SX,
    scale: ca.SX,
) -> tuple[ca.SX, list[ca.SX], list[ca.SX], ca.SX, ca.SX, ca.SX]:
    """The model at a state x and estimates z; considered parameters are 0.

    It gives the state after dt (n_x,); the parts of F (n_x, n_x), see `transition_matrix`; derivatives with respect to
    z and the considered parameters (n_x, n_p), of x' at both ends of the step if the model has `rates`, else of the
    state after dt; predicted measurements (n_y,); H (n_y, n_x), and their derivatives with respect to the parameters
    (n_y, n_p).
    """
    p, by_z = _parameters(logarithmic, z, centre, scale)
    later, *of_F = transition(model).call([x, dt, d, p, c])
    # the derivatives of x' need fewer operations than those of the transition; the trapezoidal rule integrates them
    of_rates: ca.Function | None = getattr(model, "rate_slopes", None)
    if of_rates is None:
        slopes = _derivative(model.transition, [x, dt, d, p, c], 3)
    else:
        slopes = of_rates.call([x, later, dt, d, p, c])
    predicted, H, direct = _observed(model, later, d, p, c)
    return later, of_F, [slope @ by_z for slope in slopes], predicted, H, direct @ by_z


def _parameters(logarithmic: tuple[bool, ...], z: ca.SX, centre: ca.SX, scale: ca.SX) -> tuple[ca.SX, ca.SX]:
    """p (n_p,) of the estimates z, and its derivatives (n_p, n_p) with respect to all; considered parameters are 0."""
    symbol = ca.SX.sym("z", len(logarithmic))
    p = symbolic_to_p(logarithmic, symbol, centre, scale)
    at = ca.vertcat(z, ca.SX.zeros(len(logarithmic) - z.shape[0]))
    values, slopes = ca.substitute([p, ca.jacobian(p, symbol)], [symbol], [at])
    return values, slopes


def _derivative(function: ca.Function, arguments: list[ca.SX], place: int) -> list[ca.SX]:
    """The derivative of the result of a function with respect to one of its arguments."""
    symbols = [ca.SX.sym("a", *argument.shape) for argument in arguments]
    (result,) = function.call(symbols)
    return ca.substitute([ca.jacobian(result, symbols[place])], symbols, arguments)


def _observed(model: Model, x: ca.SX, d: ca.SX, p: ca.SX, c: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Outputs y (n,) of a model, dy/dx and dy/dp."""
    arguments, slopes = [x, d, p, c], getattr(model, "observation_slopes", None)
    if slopes is not None:
        by_x, by_p = slopes.call(arguments)
    else:
        (by_x,), (by_p,) = (_derivative(model.observation, arguments, place) for place in (0, 2))
    return model.observation(*arguments), by_x, by_p


def correct(
    carried: Carried[Matrix],
    channel: JointChannel[Matrix],
    before: Matrix,
    base_z: Matrix,
    learn: Matrix,
    limit: Matrix,
    bounds: tuple[Matrix, Matrix],
) -> tuple[Carried[Matrix], Matrix, Matrix]:
    """The update by one channel: the carry, whether it is accepted, and the innovation over its standard deviation.

    The prediction is that of the state `before` (n_x,) and of the estimates `base_z` (n_z,). z is corrected if `learn`
    is 1, within its bounds, (n_z,) each; `limit` is the squared gate.
    """
    x, P, V, z, Pz, B, gradient, information = carried
    row, r, n_z = channel.row, channel.noise, z.shape[0]
    both = row @ V + channel.direct
    psi = both[:n_z]
    rho = both[n_z:] + psi @ B
    innovation_at_base = channel.y - channel.predicted - row @ (x - before)  # with z = base_z
    innovation = innovation_at_base - psi @ (z - base_z)
    cross, cross_z = P @ row.T, Pz @ psi.T
    of_state, of_parameters, of_considered = row @ cross + r, psi @ cross_z, ca.sumsqr(rho)
    total = of_state + of_parameters + of_considered
    accepted = gate(innovation, total, channel.weight, limit)
    noise_z = ca.fmax(of_state, PRECISION * of_parameters)
    gain_z = accepted * learn * cross_z / (of_parameters + noise_z)
    # without learning, the gain of the state is optimal for P + V Pz V'
    uncertain = 1 - learn
    gain = accepted * (cross + uncertain * (V[:, :n_z] @ cross_z)) / (of_state + uncertain * of_parameters)
    noise_gain = (of_parameters + noise_z) * gain_z
    evidence = accepted * learn * rho.T / (of_state + of_parameters)
    corrected = Carried(
        x=x + gain * innovation_at_base,
        P=joseph(P, cross, gain, row, r),
        V=ca.mac(-gain, both, V),
        z=ca.fmin(ca.fmax(z + gain_z * innovation, bounds[0]), bounds[1]),
        # (I - K h) P (I - K h)' + K r K' for any gain K, expanded: a third of the operations of Joseph's form
        Pz=ca.mac(noise_gain - cross_z, gain_z.T, ca.mac(-gain_z, cross_z.T, Pz)),
        B=ca.mac(-gain_z, rho, B),
        gradient=gradient - evidence * innovation,
        information=information + evidence * rho.T,
    )
    return corrected, accepted, channel.weight * innovation / ca.sqrt(total)


def reported_values(
    report: Model, logarithmic: tuple[bool, ...], x: ca.SX, z: ca.SX, d: ca.SX, c: ca.SX, centre: ca.SX, scale: ca.SX
) -> tuple[ca.SX, ca.SX]:
    """Outputs (n,) of a model at a state x and estimates z, and their derivatives (n, n_x + n_p) with respect to state
    and parameters; considered parameters are 0."""
    p, by_z = _parameters(logarithmic, z, centre, scale)
    values, by_x, by_p = _observed(report, x, d, p, c)
    return values, ca.horzcat(by_x, by_p @ by_z)


@compiled(functools.partial(Scan, matrices=True))
def joint_step(model: Model, logarithmic: tuple[bool, ...], n_z: int) -> ca.Function:
    """The compiled step of the joint filter.

    carry = `JointLayout`; sample = [dt, d, y, weight, learn, zl]; constant = `constants`;
    output = [accepted, innovation over its standard deviation, diverged]. A filter that has diverged uses no
    measurement, and an estimate that is not a number is not taken over. The first n_z free parameters of the model are
    estimated, the others are considered.
    """
    n_x, n_d, n_p, n_c, n_y = sizes(model)
    layout = JointLayout(n_x, n_z, n_p - n_z)
    carry = ca.MX.sym("carry", layout.size)
    x, P, V, z, Pz, B, gradient, information = Carried.of(carry, layout)
    sample, dt, d, y, weight, learn, given_z = partitioned("sample", 1, n_d, n_y, n_y, 1, n_z, kind=ca.MX)
    constant, c, q, r, limit, centre, scale, lower, upper, walk, use_given = partitioned(
        "constant", n_c, packed_size(n_x), n_y, 1, n_p, n_p, n_z, n_z, n_z, 1, kind=ca.MX
    )
    diverged = ca.logic_not(ca.sumsqr(x) + ca.trace(P) + ca.sumsqr(V) <= MAX_STATE**2)  # also if not a number
    x, P, V = (ca.if_else(diverged, 0, value) for value in (x, P, V))  # avoids 0 times infinity below
    weight = weight * (1 - diverged)

    base_z = z + use_given * (given_z - z)
    # the state that belongs to base_z; the end of the step returns to that of z
    x_base = x + V[:, :n_z] @ (base_z - z)
    arguments: list[ca.MX] = [x_base, base_z, dt, d, c, centre, scale]
    linearised = _linearisation(model, logarithmic, n_z).call(arguments)
    before, predicted, H, direct, *rest = map(ca.densify, linearised)
    count = 1 if getattr(model, "rates", None) is None else 2
    slopes, F = rest[:count], transition_matrix(model, rest[count:])
    P = ca.mac(F, P @ F.T, unpack(q, n_x) * dt)
    V = ca.mac(F, V + dt / 2 * slopes[0], dt / 2 * slopes[1]) if len(slopes) == 2 else ca.mac(F, V, slopes[0])
    Pz = Pz + ca.diag(walk * dt * ca.fmax(1 - ca.diag(Pz), 0))
    carried = Carried(before, P, V, z, Pz, B, gradient, information)
    used, normalised = [], []
    for i in range(n_y):
        channel = JointChannel(y[i], weight[i], r[i], predicted[i], H[i, :], direct[i, :])
        carried, accepted, innovation = correct(carried, channel, before, base_z, learn, limit, (lower, upper))
        used.append(accepted)
        normalised.append(innovation)
    x = carried.x + carried.V[:, :n_z] @ (carried.z - base_z)
    result = packed(carried._replace(x=x))
    estimate, least = result[3:], ca.mmin(ca.diag(carried.Pz))
    valid = ca.logic_and(sum(map(ca.sumsqr, estimate)) <= MAX_ESTIMATE**2, least > 0)  # false if not a number
    kept = [ca.if_else(valid, *parts) for parts in zip(estimate, split(carry, layout.lengths)[3:], strict=True)]
    output = ca.vertcat(*used, *normalised, ca.logic_or(diverged, ca.logic_not(valid)))
    return ca.Function("joint", [carry, sample, constant], [ca.vertcat(*result[:3], *kept), output], {"cse": True})


def _linearisation(model: Model, logarithmic: tuple[bool, ...], n_z: int) -> ca.Function:
    """(x, z, dt, d, c, centre, scale) -> (x', predictions, H, direct, slopes, parts of F); see `linearise`."""
    n_x, n_d, n_p, n_c, _ = sizes(model)
    arguments = [ca.SX.sym("a", size) for size in (n_x, n_z, 1, n_d, n_c, n_p, n_p)]
    later, of_F, slopes, predicted, H, direct = linearise(model, logarithmic, *arguments)
    return ca.Function("linearise", arguments, [later, predicted, H, direct, *slopes, *of_F], {"cse": True})


def constants(c: Array, noise: Noise, scaling: Scaling, walk: Array) -> Array:
    """Constants of two filters, (2, n_constant). The first filter linearises at its own z, the second one at zl.

    c (n_c,) are the parameters of the model that are not in z; the scaling is that of all parameters, the estimated
    ones first. The variance of each estimated z grows towards that of its prior with the rate `walk` (n_z,), 1/s.
    """
    parts = c, noise.vector(), scaling.centre, scaling.scale, *bounds(scaling, len(walk)), walk, [0.0]
    both = np.tile(np.concatenate(parts), (2, 1))
    both[1, -1] = 1.0
    return both


def bounds(scaling: Scaling, n_z: int) -> tuple[Array, Array]:
    """Of each estimated z, (n_z,) each."""
    return scaling.to_z(scaling.lower)[:n_z], scaling.to_z(scaling.upper)[:n_z]


@compiled(functools.partial(Scan, matrices=True))
def state_view(
    model: Model, report: Model, logarithmic: tuple[bool, ...], n_z: int, correlated: bool = False
) -> ca.Function:
    """The compiled outputs of `report` at the filter's state, and their sigmas, which contain those of the parameters.

    carry = `JointLayout`, unchanged; sample = d; constant = [c of the report, centre, scale, L by columns, if
    `correlated`, factor of the variances]; output = [reported, its sigma] of each. `report` is a model of the first
    states of `model`, with the same free parameters; the other arguments are those of `joint_step`.
    """
    n_x, n_d, n_p, *_ = sizes(model)
    n_states, n_c = sizes(report)[0], sizes(report)[3]
    layout = JointLayout(n_x, n_z, n_p - n_z)
    carry, d = ca.MX.sym("carry", layout.size), ca.MX.sym("d", n_d)
    x, P, V, z, Pz, B, _, _ = Carried.of(carry, layout)
    lower = ca.Sparsity.lower(n_p - n_z)
    constant, c, centre, scale, factor, excess = partitioned(
        "constant", n_c, n_p, n_p, lower.nnz() if correlated else 0, 1, kind=ca.MX
    )
    symbols = [ca.SX.sym("a", size) for size in (n_states, n_z, n_d, n_c, n_p, n_p)]
    of_report = ca.Function("report", symbols, [*reported_values(report, logarithmic, *symbols)], {"cse": True})
    reported, slopes = map(ca.densify, of_report.call([x[:n_states], z, d, c, centre, scale]))
    rows = slopes[:, :n_states]
    psi = rows @ V[:n_states, :] + slopes[:, n_states:]
    rho = psi[:, n_z:] + psi[:, :n_z] @ B
    rho = rho @ ca.densify(ca.MX(lower, factor)) if correlated else rho
    by_matrix = ((rows, P[:n_states, :n_states]), (psi[:, :n_z], Pz))
    variances = sum((ca.sum2((left @ covariance) * left) for left, covariance in by_matrix), ca.sum2(rho**2))
    sigmas = ca.sqrt(ca.if_else(variances < 0, 0, excess * variances))  # not a number remains so
    output = ca.densify(ca.vec(ca.horzcat(reported, sigmas).T))
    return ca.Function("view", [carry, d, constant], [carry, output], {"cse": True})
