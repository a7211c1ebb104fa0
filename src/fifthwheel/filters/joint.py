"""The joint filter of state and parameters for live use: it may stop learning, and it may linearise anywhere.

The dual filter of `dual` with both its switches on is Friedland's (1969) separate form of the joint extended Kalman
filter. Two things are added:

* learn: on a sample from which nothing is to be learned, and for a parameter that is only considered, z has no gain.
  The state's covariance is P + V Pz V' for any gain of z (Schmidt 1966), so that every sigma goes on counting what is
  not known.
* zl: where the model is linearised. The filter does so at its own z. One that goes over the same samples a second time
  does so at what has been learned since, which is an iteration of the filter (Bell and Cathey 1993).
"""

import functools
from collections.abc import Callable
from itertools import pairwise

import casadi as ca
import numpy as np

from fifthwheel.filters.dual import PRECISION, Scaling, scaled
from fifthwheel.filters.kalman import Noise, observe, predict
from fifthwheel.filters.model import Array, Model, pack, packed_size, sizes, split, unpack
from fifthwheel.filters.update import gate, joseph
from fifthwheel.native import Scan

LANES = 2
"""The filter, and the one that goes over its samples again: in one vector register they cost little more than one."""

RUNAWAY = 1e3
"""States, standard deviations or sensitivities beyond this, in SI, are none of a vehicle."""


class Layout:
    """Where things lie in the carry [x, P, z, Pz, V]; P and Pz are packed, V is by columns."""

    def __init__(self, n_x: int, n_p: int) -> None:
        self.n_x, self.n_p = n_x, n_p
        self.lengths = (n_x, packed_size(n_x), n_p, packed_size(n_p), n_x * n_p)
        edges = np.concatenate([[0], np.cumsum(self.lengths)]).tolist()
        self.x, self.P, self.z, self.Pz, self.V = (slice(a, b) for a, b in pairwise(edges))
        self.size = sum(self.lengths)


@functools.cache
def step(model: Model, logarithmic: tuple[bool, ...]) -> Scan:
    """The compiled step.

    carry = `Layout`; sample = [dt, d, y, weight, learn, zl]; constant = `constants`;
    output = [accepted, innovation squared over its variance, lost]. From a state that is lost nothing is learned.
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
    dt, d, y, weight, learn, given = split(sample, [1, n_d, n_y, n_y, 1, n_p])
    c, q, r, limit, centre, scale, lower, upper, free, elsewhere = split(
        constant, [n_c, lengths[1], n_y, 1, *[n_p] * 5, 1]
    )
    P, Pz, V = unpack(P, n_x), unpack(Pz, n_p), ca.reshape(V, n_x, n_p)
    lost = ca.logic_not(ca.sumsqr(x) + ca.trace(P) + ca.sumsqr(V) <= RUNAWAY**2)  # also where they are not numbers
    x, P, V = (ca.if_else(lost, 0, part) for part in (x, P, V))  # no 0 times infinity below
    weight = weight * (1 - lost)

    base_z = z + elsewhere * (given - z)
    symbol = ca.SX.sym("z", n_p)
    p_of_z = scaled(logarithmic, symbol, centre, scale)
    p = ca.substitute(p_of_z, symbol, base_z)

    def wrt_z(function: ca.Function, *arguments: ca.SX) -> list[ca.SX]:
        outputs = function.call([*arguments, p_of_z, c])
        return ca.substitute([ca.jacobian(output, symbol) for output in outputs], [symbol], [base_z])

    # over to the state that goes with base_z, and back at the end
    there = x + V @ (base_z - z)
    before, P, F = predict(model, there, P, dt, d, p, c, unpack(q, n_x))
    V = _sensitivity(model, wrt_z, F, V, there, before, dt, d)
    predicted, H = observe(model, before, d, p, c)
    (direct,) = wrt_z(model.observation, before, d)
    x, used, squares = before, [], []
    for i in range(n_y):
        row = H[i, :]
        psi = row @ V + direct[i, :]
        apart = y[i] - predicted[i] - row @ (x - before)  # the innovation if z were base_z
        innovation = apart - psi @ (z - base_z)
        cross, cross_z = P @ row.T, Pz @ psi.T
        own, spread = row @ cross + r[i], psi @ cross_z
        accepted = gate(innovation, own + spread, weight[i], limit)
        noise_z = ca.fmax(own, PRECISION * spread)
        gain_z = accepted * learn * free * cross_z / (spread + noise_z)
        # what nothing is learned of, the state takes up by the best gain for that
        idle = 1 - learn
        gain = accepted * (cross + idle * (V @ cross_z)) / (own + idle * spread)
        z = ca.fmin(ca.fmax(z + gain_z * innovation, lower), upper)
        V = V - gain @ psi
        x = x + gain * apart
        P = joseph(P, cross, gain, row, r[i])
        Pz = _corrected(Pz, cross_z, gain_z, spread + noise_z)
        used.append(accepted)
        squares.append(weight[i] * innovation**2 / (own + spread))
    x = x + V @ (z - base_z)
    carried = ca.vertcat(x, pack(P), z, pack(Pz), ca.vec(V))
    output = ca.densify(ca.vertcat(*used, *squares, lost))
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
    """dx/dz at the end of a step.

    A model that knows its rates is not differentiated through its whole series: what z changes of x' counts by the
    trapezoidal rule.
    """
    rates: ca.Function | None = getattr(model, "rates", None)
    if rates is None:
        return F @ V + wrt_z(model.transition, x, dt, d)[0]
    first, last = wrt_z(rates, x, later, dt, d)
    return F @ (V + dt / 2 * first) + dt / 2 * last


def _corrected(covariance: ca.SX, cross: ca.SX, gain: ca.SX, variance: ca.SX) -> ca.SX:
    """(I - K h) P (I - K h)' + K r K' for any gain K, of cross = P h' and the innovation's variance.

    Its products worked out, of which only the lower triangle is made: a third of Joseph's operations.
    """
    n = covariance.shape[0]
    rest = cross - variance * gain
    corrected = ca.SX(n, n)
    for j in range(n):
        for i in range(j, n):
            corrected[i, j] = corrected[j, i] = covariance[i, j] - gain[i] * cross[j] - rest[i] * gain[j]
    return corrected


def constants(c: Array, noise: Noise, scaling: Scaling, free: Array) -> Array:
    """What the step is told once (n_constant, LANES): the first lane linearises at its own z, the second at zl.

    Args:
        c: the model's other parameters.
        noise: Q per second, R and the gate.
        scaling: how z becomes p.
        free: (n_p,) 1 for each z that may be learned, 0 for one that is only considered.
    """
    own = np.concatenate([c, noise.vector(), scaling.vector(), free, [0.0]])
    other = own.copy()
    other[-1] = 1.0
    return np.column_stack([own, other])


@functools.cache
def view(model: Model, report: Model, logarithmic: tuple[bool, ...], places: tuple[int, ...]) -> Scan:
    """What the filter of `model` says of the outputs of `report`: values, and variances with the parameters' part.

    carry = `Layout`, left as it is; sample = d; constant = [c of the report, centre, scale];
    output = [reported, their variances].

    Args:
        report: a model of the same state; its free parameters are those at `places` among the z, in that order.
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
    both = ca.SX.sym("both", n_x + n_p)
    p = scaled(logarithmic, both[n_x:], centre, scale)
    shown = report.observation(both[:n_x], d, p[list(places)], c)
    shown, slopes = ca.substitute([shown, ca.jacobian(shown, both)], [both], [ca.vertcat(x, z)])
    spread = []
    for i in range(shown.shape[0]):
        row = slopes[i, :n_x]
        psi = row @ V + slopes[i, n_x:]
        spread.append(row @ P @ row.T + psi @ Pz @ psi.T)
    output = ca.densify(ca.vertcat(shown, *spread))
    return Scan(ca.Function("view", [carry, d, constant], [carry, output], {"cse": True}), LANES)
