"""The joint filter of state and parameters for on-line use, with optional learning and a choice of linearisation.

The dual filter of `dual` with both switches on is Friedland's (1969) separate form of the joint extended Kalman filter.
This filter adds:

* learn: z has no gain on a sample with learn = 0.
* Considered parameters c ~ N(0, I), which keep their prior mean 0 (Schmidt 1966). `B` is the derivative of the estimate
  of z that goes with a change of c. The covariance of z is Pz + B B', its covariance with c is B. The gains ignore c,
  so that samples are not weighted by an assumed model of the vehicle's errors.
* The score test of each considered parameter (Rao 1948; `identify.doubts`): with rho the derivative of an innovation
  with respect to c, and S its variance, the gradient is - sum rho e / S and the information sum rho^2 / S.
* walk: the variance of an estimated z grows towards that of its prior with this rate, 1/s.
* zl: the point of linearisation of the second lane. The first lane linearises at its own z. The second lane repeats
  samples with a better linearisation, which is an iteration of the filter (Bell and Cathey 1993).
"""

import functools

import casadi as ca
import numpy as np

from fifthwheel._types import Array
from fifthwheel.filters.joint_equations import Carried, JointChannel, JointLayout, correct, linearise, reported_values
from fifthwheel.filters.kalman import Noise
from fifthwheel.filters.model import Model, packed_size, sizes, split, unpack
from fifthwheel.filters.scaling import Scaling
from fifthwheel.native import Scan, compiled

LANES = 2
"""The filter and the filter that repeats its samples; in one vector register they cost little more than one filter."""

MAX_STATE = 1e3
"""Limit of the norm of state, standard deviations and sensitivities, SI; beyond it the filter has diverged."""

MAX_ESTIMATE = 1e100
"""Limit of the norm of all numbers of an estimate; its score tests may be large."""


@compiled(functools.partial(Scan, lanes=LANES))
def joint_step(model: Model, logarithmic: tuple[bool, ...], n_z: int) -> ca.Function:
    """The compiled step of the joint filter.

    carry = `JointLayout`; sample = [dt, d, y, weight, learn, zl]; constant = `constants`;
    output = [accepted, innovation over its standard deviation, diverged]. A filter that has diverged uses no
    measurement, and an estimate that is not a number is not taken over.

    Args:
        model: its first n_z free parameters are estimated, the others are considered.
        logarithmic: as in `Scaling`.
        n_z: number of estimated parameters.
    """
    n_x, n_d, n_p, n_c, n_y = sizes(model)
    layout = JointLayout(n_x, n_z, n_p - n_z)
    n_P = packed_size(n_x)
    carry, sample, constant = (
        ca.SX.sym(name, size)
        for name, size in (
            ("carry", layout.size),
            ("sample", 1 + n_d + 2 * n_y + 1 + n_z),
            ("constant", n_c + n_P + n_y + 1 + 2 * n_p + 3 * n_z + 1),
        )
    )
    x, P, V, z, Pz, B, gradient, information = Carried.of(carry, layout)
    dt, d, y, weight, learn, given_z = split(sample, [1, n_d, n_y, n_y, 1, n_z])
    c, q, r, limit, centre, scale, lower, upper, walk, use_given = split(
        constant, [n_c, n_P, n_y, 1, n_p, n_p, n_z, n_z, n_z, 1]
    )
    diverged = ca.logic_not(ca.sumsqr(x) + ca.trace(P) + ca.sumsqr(V) <= MAX_STATE**2)  # also if not a number
    x, P, V = (ca.if_else(diverged, 0, value) for value in (x, P, V))  # avoids 0 times infinity below
    weight = weight * (1 - diverged)

    base_z = z + use_given * (given_z - z)
    # the state that belongs to base_z; the end of the step returns to that of z
    x_base = x + V[:, :n_z] @ (base_z - z)
    before, F, slopes, predicted, H, direct = linearise(model, logarithmic, x_base, base_z, dt, d, c, centre, scale)
    P = ca.mtimes([F, P, F.T]) + unpack(q, n_x) * dt
    V = F @ (V + dt / 2 * slopes[0]) + dt / 2 * slopes[1] if len(slopes) == 2 else F @ V + slopes[0]
    Pz = Pz + ca.diag(walk * dt * ca.fmax(1 - ca.diag(Pz), 0))
    carried = Carried(before, P, V, z, Pz, B, gradient, information)
    used, normalised = [], []
    for i in range(n_y):
        channel = JointChannel(y[i], weight[i], r[i], predicted[i], H[i, :], direct[i, :])
        carried, accepted, innovation = correct(carried, channel, before, base_z, learn, limit, (lower, upper))
        used.append(accepted)
        normalised.append(innovation)
    x = carried.x + carried.V[:, :n_z] @ (carried.z - base_z)
    result = carried._replace(x=x).vector()
    estimate, least = result[layout.estimate], ca.mmin(ca.diag(carried.Pz))
    valid = ca.logic_and(ca.sumsqr(estimate) <= MAX_ESTIMATE**2, least > 0)  # false if not a number
    result[layout.estimate] = ca.if_else(valid, estimate, carry[layout.estimate])
    output = ca.densify(ca.vertcat(*used, *normalised, ca.logic_or(diverged, ca.logic_not(valid))))
    return ca.Function("joint", [carry, sample, constant], [ca.densify(result), output], {"cse": True})


def constants(c: Array, noise: Noise, scaling: Scaling, walk: Array) -> Array:
    """Constant of the step, (n_constant, LANES). The first lane linearises at its own z, the second lane at zl.

    Args:
        c: parameters of the model that are not in z, (n_c,).
        noise: of process and measurements.
        scaling: of all parameters, the estimated ones first.
        walk: (n_z,) rate with which the variance of each estimated z grows towards that of its prior, 1/s.
    """
    parts = c, noise.vector(), scaling.centre, scaling.scale, *bounds(scaling, len(walk)), walk, [0.0]
    first = np.concatenate(parts)
    second = first.copy()
    second[-1] = 1.0
    return np.column_stack([first, second])


def bounds(scaling: Scaling, n_z: int) -> tuple[Array, Array]:
    """Of each estimated z, (n_z,) each."""
    return scaling.to_z(scaling.lower)[:n_z], scaling.to_z(scaling.upper)[:n_z]


@compiled(functools.partial(Scan, lanes=LANES))
def state_view(model: Model, report: Model, logarithmic: tuple[bool, ...], n_z: int) -> ca.Function:
    """The compiled outputs of `report` at the filter's state, with variances that contain those of the parameters.

    carry = `JointLayout`, unchanged; sample = d; constant = [c of the report, centre, scale];
    output = [reported, their variances].

    Args:
        model: of the filter.
        report: a model of the first states of `model`, with the same free parameters.
        logarithmic, n_z: as in `joint_step`.
    """
    n_x, n_d, n_p, *_ = sizes(model)
    n_states, n_c = sizes(report)[0], sizes(report)[3]
    layout = JointLayout(n_x, n_z, n_p - n_z)
    carry, d, constant = (
        ca.SX.sym(name, size) for name, size in (("carry", layout.size), ("d", n_d), ("constant", n_c + 2 * n_p))
    )
    x, P, V, z, Pz, B, _, _ = Carried.of(carry, layout)
    c, centre, scale = split(constant, [n_c, n_p, n_p])
    reported, slopes = reported_values(report, logarithmic, x[:n_states], z, d, c, centre, scale)
    variances = []
    for i in range(reported.shape[0]):
        row = slopes[i, :n_states]
        psi = row @ V[:n_states, :] + slopes[i, n_states:]
        rho = psi[n_z:] + psi[:n_z] @ B
        variances.append(row @ P[:n_states, :n_states] @ row.T + psi[:n_z] @ Pz @ psi[:n_z].T + ca.sumsqr(rho))
    output = ca.densify(ca.vertcat(reported, *variances))
    return ca.Function("view", [carry, d, constant], [carry, output], {"cse": True})
