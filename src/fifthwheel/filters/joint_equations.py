"""The equations of the joint filter (`joint`): the model at one point, and the update by one channel.

The compiled step contains them in one piece; the step in C calls the update once for each channel.
"""

from itertools import pairwise
from typing import NamedTuple, Self

import casadi as ca
import numpy as np

from fifthwheel.filters.kalman import observe, predict
from fifthwheel.filters.model import Model, pack, packed_size, split, unpack
from fifthwheel.filters.scaling import PRECISION, symbolic_to_p
from fifthwheel.filters.update import gate, joseph


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
) -> tuple[ca.SX, ca.SX, list[ca.SX], ca.SX, ca.SX, ca.SX]:
    """The model at a state x and estimates z; considered parameters are 0.

    Returns:
        The state after dt (n_x,); F (n_x, n_x); derivatives with respect to z and the considered parameters
        (n_x, n_p), of x' at both ends of the step if the model has `rates`, else of the state after dt; predicted
        measurements (n_y,); H (n_y, n_x), and their derivatives with respect to the parameters (n_y, n_p).
    """
    n_p = len(logarithmic)
    point = ca.vertcat(z, ca.SX.zeros(n_p - z.shape[0]))
    symbol = ca.SX.sym("z", n_p)
    p_of_z = symbolic_to_p(logarithmic, symbol, centre, scale)
    p = ca.substitute(p_of_z, symbol, point)

    def wrt_z(function: ca.Function, *arguments: ca.SX) -> list[ca.SX]:
        """Derivatives of the outputs of a function of (*arguments, p, c) with respect to z at a fixed state."""
        outputs = function.call([*arguments, p_of_z, c])
        return ca.substitute([ca.jacobian(output, symbol) for output in outputs], [symbol], [point])

    n_x = x.shape[0]
    later, _, F = predict(model, x, ca.SX(n_x, n_x), dt, d, p, c, ca.SX(n_x, n_x))
    # the derivatives of x' need fewer operations than those of the transition; the trapezoidal rule integrates them
    rates: ca.Function | None = getattr(model, "rates", None)
    slopes = wrt_z(model.transition, x, dt, d) if rates is None else wrt_z(rates, x, later, dt, d)
    predicted, H = observe(model, later, d, p, c)
    (direct,) = wrt_z(model.observation, later, d)
    return later, F, slopes, predicted, H, direct


class JointLayout:
    """Slices of the carry [x, P, V, z, Pz, B, gradient, information].

    P and Pz are packed; V (n_x, n_z + n_c) and B (n_z, n_c) are stored by columns.

    Args:
        n_x: number of states.
        n_z: number of estimated parameters.
        n_c: number of considered parameters.
    """

    def __init__(self, n_x: int, n_z: int, n_c: int) -> None:
        self.n_x, self.n_z, self.n_c = n_x, n_z, n_c
        self.lengths = (n_x, packed_size(n_x), n_x * (n_z + n_c), n_z, packed_size(n_z), n_z * n_c, n_c, n_c)
        edges = np.concatenate([[0], np.cumsum(self.lengths)]).tolist()
        slices = [slice(a, b) for a, b in pairwise(edges)]
        self.x, self.P, self.V, self.z, self.Pz, self.B, self.gradient, self.information = slices
        self.size = sum(self.lengths)
        self.estimate = slice(self.z.start, self.size)
        """All that does not belong to the state."""


class Carried(NamedTuple):
    """The carry within a step, as matrices; see `JointLayout`."""

    x: ca.SX
    P: ca.SX
    V: ca.SX
    z: ca.SX
    Pz: ca.SX
    B: ca.SX
    gradient: ca.SX
    information: ca.SX

    @classmethod
    def of(cls, carry: ca.SX, layout: JointLayout) -> Self:
        """The parts of a carry."""
        n_x, n_z, n_c = layout.n_x, layout.n_z, layout.n_c
        x, P, V, z, Pz, B, gradient, information = split(carry, layout.lengths)
        V, B = ca.reshape(V, n_x, n_z + n_c), ca.reshape(B, n_z, n_c)
        return cls(x, unpack(P, n_x), V, z, unpack(Pz, n_z), B, gradient, information)

    def vector(self) -> ca.SX:
        """The inverse of `of`."""
        x, P, V, z, Pz, B, gradient, information = self
        return ca.vertcat(x, pack(P), ca.vec(V), z, pack(Pz), ca.vec(B), gradient, information)


class JointChannel(NamedTuple):
    """A measurement and its prediction."""

    y: ca.SX
    weight: ca.SX
    noise: ca.SX  # variance
    predicted: ca.SX
    row: ca.SX  # of H (1, n_x)
    direct: ca.SX  # derivative with respect to the parameters (1, n_p)


def correct(
    carried: Carried,
    channel: JointChannel,
    before: ca.SX,
    base_z: ca.SX,
    learn: ca.SX,
    limit: ca.SX,
    bounds: tuple[ca.SX, ca.SX],
) -> tuple[Carried, ca.SX, ca.SX]:
    """The update by one channel: the carry, whether it is accepted, and the innovation over its standard deviation.

    Args:
        carried: after the channels before this one.
        channel: the measurement.
        before: state (n_x,) of the prediction.
        base_z: estimates (n_z,) of the prediction.
        learn: 1 if z is corrected, else 0.
        limit: squared gate.
        bounds: of z, (n_z,) each.
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
    evidence = accepted * learn * rho.T / (of_state + of_parameters)
    corrected = Carried(
        x=x + gain * innovation_at_base,
        P=joseph(P, cross, gain, row, r),
        V=V - gain @ both,
        z=ca.fmin(ca.fmax(z + gain_z * innovation, bounds[0]), bounds[1]),
        Pz=_corrected_covariance(Pz, cross_z, gain_z, of_parameters + noise_z),
        B=B - gain_z @ rho,
        gradient=gradient - evidence * innovation,
        information=information + evidence * rho.T,
    )
    return corrected, accepted, channel.weight * innovation / ca.sqrt(total)


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


def reported_values(
    report: Model, logarithmic: tuple[bool, ...], x: ca.SX, z: ca.SX, d: ca.SX, c: ca.SX, centre: ca.SX, scale: ca.SX
) -> tuple[ca.SX, ca.SX]:
    """Outputs (n,) of a model at a state x and estimates z, and their derivatives (n, n_x + n_p) with respect to state
    and parameters; considered parameters are 0."""
    n_x, n_p = x.shape[0], len(logarithmic)
    x_and_z = ca.SX.sym("x_and_z", n_x + n_p)
    p = symbolic_to_p(logarithmic, x_and_z[n_x:], centre, scale)
    reported = report.observation(x_and_z[:n_x], d, p, c)
    at = ca.vertcat(x, z, ca.SX.zeros(n_p - z.shape[0]))
    values, slopes = ca.substitute([reported, ca.jacobian(reported, x_and_z)], [x_and_z], [at])
    return values, slopes
