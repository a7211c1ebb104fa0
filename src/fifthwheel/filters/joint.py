"""The joint filter of state and parameters for on-line use, with optional learning and a choice of linearisation.

The dual filter of `dual` with both switches on is Friedland's (1969) separate form of the joint extended Kalman filter.
This filter adds two inputs:

* learn: z has no gain on a sample with learn = 0, and never for a considered parameter. The covariance of the state is
  P + V Pz V' for any gain of z (Schmidt 1966), so every sigma contains the uncertainty of the parameters.
* zl: the point of linearisation of the second lane. The first lane linearises at its own z. The second lane repeats
  samples with a better linearisation, which is an iteration of the filter (Bell and Cathey 1993).
"""

import functools
from collections.abc import Callable
from itertools import pairwise

import casadi as ca
import numpy as np

from fifthwheel._types import Array
from fifthwheel.filters.dual import PRECISION, Scaling, symbolic_to_p
from fifthwheel.filters.kalman import Noise, observe, predict
from fifthwheel.filters.model import Model, pack, packed_size, sizes, split, unpack
from fifthwheel.filters.update import gate, joseph
from fifthwheel.native import Scan

LANES = 2
"""The filter and the filter that repeats its samples; in one vector register they cost little more than one filter."""

MAX_STATE = 1e3
"""Limit of the norm of state, standard deviations and sensitivities, SI; beyond it the filter has diverged."""


class Layout:
    """Slices of the carry [x, P, z, Pz, V]; P and Pz are packed, V (n_x, n_p) is stored by columns."""

    def __init__(self, n_x: int, n_p: int) -> None:
        self.n_x, self.n_p = n_x, n_p
        self.lengths = (n_x, packed_size(n_x), n_p, packed_size(n_p), n_x * n_p)
        edges = np.concatenate([[0], np.cumsum(self.lengths)]).tolist()
        self.x, self.P, self.z, self.Pz, self.V = (slice(a, b) for a, b in pairwise(edges))
        self.size = sum(self.lengths)


@functools.cache
def joint_step(model: Model, logarithmic: tuple[bool, ...]) -> Scan:
    """The compiled step of the joint filter.

    carry = `Layout`; sample = [dt, d, y, weight, learn, zl]; constant = `constants`;
    output = [accepted, squared innovation over its variance, diverged]. A filter that has diverged uses no measurement.
    """
    n_x, n_d, n_p, n_c, n_y = sizes(model)
    lengths = Layout(n_x, n_p).lengths
    carry, sample, constant = (
        ca.SX.sym(name, size)
        for name, size in (
            ("carry", sum(lengths)),
            ("sample", 1 + n_d + 2 * n_y + 1 + n_p),
            ("constant", n_c + lengths[1] + n_y + 1 + 5 * n_p + 1),
        )
    )
    x, P, z, Pz, V = split(carry, lengths)
    dt, d, y, weight, learn, given_z = split(sample, [1, n_d, n_y, n_y, 1, n_p])
    c, q, r, limit, centre, scale, lower, upper, estimated, use_given = split(
        constant, [n_c, lengths[1], n_y, 1, *[n_p] * 5, 1]
    )
    P, Pz, V = unpack(P, n_x), unpack(Pz, n_p), ca.reshape(V, n_x, n_p)
    diverged = ca.logic_not(ca.sumsqr(x) + ca.trace(P) + ca.sumsqr(V) <= MAX_STATE**2)  # also if not a number
    x, P, V = (ca.if_else(diverged, 0, value) for value in (x, P, V))  # avoids 0 times infinity below
    weight = weight * (1 - diverged)

    base_z = z + use_given * (given_z - z)
    symbol = ca.SX.sym("z", n_p)
    p_of_z = symbolic_to_p(logarithmic, symbol, centre, scale)
    p = ca.substitute(p_of_z, symbol, base_z)

    def wrt_z(function: ca.Function, *arguments: ca.SX) -> list[ca.SX]:
        """Derivatives of the outputs of a function of (*arguments, p, c) with respect to z at a fixed state."""
        outputs = function.call([*arguments, p_of_z, c])
        return ca.substitute([ca.jacobian(output, symbol) for output in outputs], [symbol], [base_z])

    # the state that belongs to base_z; the end of the step returns to that of z
    x_base = x + V @ (base_z - z)
    before, P, F = predict(model, x_base, P, dt, d, p, c, unpack(q, n_x))
    V = _sensitivity(model, wrt_z, F, V, x_base, before, dt, d)
    predicted, H = observe(model, before, d, p, c)
    (direct,) = wrt_z(model.observation, before, d)
    x, used, squares = before, [], []
    for i in range(n_y):
        row = H[i, :]
        psi = row @ V + direct[i, :]
        innovation_at_base = y[i] - predicted[i] - row @ (x - before)  # with z = base_z
        innovation = innovation_at_base - psi @ (z - base_z)
        cross, cross_z = P @ row.T, Pz @ psi.T
        of_state, of_parameters = row @ cross + r[i], psi @ cross_z
        accepted = gate(innovation, of_state + of_parameters, weight[i], limit)
        noise_z = ca.fmax(of_state, PRECISION * of_parameters)
        gain_z = accepted * learn * estimated * cross_z / (of_parameters + noise_z)
        # without learning, the gain of the state is optimal for the total covariance P + V Pz V'
        considered = 1 - learn
        gain = accepted * (cross + considered * (V @ cross_z)) / (of_state + considered * of_parameters)
        z = ca.fmin(ca.fmax(z + gain_z * innovation, lower), upper)
        V = V - gain @ psi
        x = x + gain * innovation_at_base
        P = joseph(P, cross, gain, row, r[i])
        Pz = _corrected_covariance(Pz, cross_z, gain_z, of_parameters + noise_z)
        used.append(accepted)
        squares.append(weight[i] * innovation**2 / (of_state + of_parameters))
    x = x + V @ (z - base_z)
    carried = ca.vertcat(x, pack(P), z, pack(Pz), ca.vec(V))
    output = ca.densify(ca.vertcat(*used, *squares, diverged))
    return Scan(ca.Function("joint", [carry, sample, constant], [ca.densify(carried), output], {"cse": True}), LANES)


def _sensitivity(
    model: Model,
    wrt_z: Callable[..., list[ca.SX]],
    F: ca.SX,
    V: ca.SX,
    x: ca.SX,
    later: ca.SX,
    dt: ca.SX,
    d: ca.SX,
) -> ca.SX:
    """dx/dz (n_x, n_p) at the end of a step.

    If the model has `rates`, the derivative of x' with respect to z is integrated by the trapezoidal rule, which needs
    fewer operations than the derivative of the transition.
    """
    rates: ca.Function | None = getattr(model, "rates", None)
    if rates is None:
        return F @ V + wrt_z(model.transition, x, dt, d)[0]
    first, last = wrt_z(rates, x, later, dt, d)
    return F @ (V + dt / 2 * first) + dt / 2 * last


def _corrected_covariance(covariance: ca.SX, cross: ca.SX, gain: ca.SX, variance: ca.SX) -> ca.SX:
    """(I - K h) P (I - K h)' + K r K' for any gain K, from cross = P h' and the variance of the innovation.

    The products are expanded and only the lower triangle is computed: a third of the operations of Joseph's form.
    """
    n = covariance.shape[0]
    difference = cross - variance * gain
    corrected = ca.SX(n, n)
    for j in range(n):
        for i in range(j, n):
            corrected[i, j] = corrected[j, i] = covariance[i, j] - gain[i] * cross[j] - difference[i] * gain[j]
    return corrected


def constants(c: Array, noise: Noise, scaling: Scaling, free: Array) -> Array:
    """Constant of the step, (n_constant, LANES). The first lane linearises at its own z, the second lane at zl.

    Args:
        c: parameters of the model that are not in z, (n_c,).
        noise: of process and measurements.
        scaling: of the parameters z.
        free: (n_p,) 1 for an estimated z, 0 for a considered z.
    """
    first = np.concatenate([c, noise.vector(), scaling.vector(), free, [0.0]])
    second = first.copy()
    second[-1] = 1.0
    return np.column_stack([first, second])


@functools.cache
def state_view(model: Model, report: Model, logarithmic: tuple[bool, ...], indices: tuple[int, ...]) -> Scan:
    """The compiled outputs of `report` at the filter's state, with variances that contain those of the parameters.

    carry = `Layout`, unchanged; sample = d; constant = [c of the report, centre, scale];
    output = [reported, their variances].

    Args:
        model: of the filter.
        report: a model of the same state; its free parameters are the z at `indices`, in this order.
        logarithmic: as in `Scaling`.
        indices: of the free parameters of the report among the z.
    """
    n_x, n_d, n_p, *_ = sizes(model)
    n_c = sizes(report)[3]
    lengths = Layout(n_x, n_p).lengths
    carry, d, constant = (
        ca.SX.sym(name, size) for name, size in (("carry", sum(lengths)), ("d", n_d), ("constant", n_c + 2 * n_p))
    )
    x, P, z, Pz, V = split(carry, lengths)
    c, centre, scale = split(constant, [n_c, n_p, n_p])
    P, Pz, V = unpack(P, n_x), unpack(Pz, n_p), ca.reshape(V, n_x, n_p)
    x_and_z = ca.SX.sym("x_and_z", n_x + n_p)
    p = symbolic_to_p(logarithmic, x_and_z[n_x:], centre, scale)
    reported = report.observation(x_and_z[:n_x], d, p[list(indices)], c)
    reported, slopes = ca.substitute([reported, ca.jacobian(reported, x_and_z)], [x_and_z], [ca.vertcat(x, z)])
    variances = []
    for i in range(reported.shape[0]):
        row = slopes[i, :n_x]
        psi = row @ V + slopes[i, n_x:]
        variances.append(row @ P @ row.T + psi @ Pz @ psi.T)
    output = ca.densify(ca.vertcat(reported, *variances))
    return Scan(ca.Function("view", [carry, d, constant], [carry, output], {"cse": True}), LANES)
