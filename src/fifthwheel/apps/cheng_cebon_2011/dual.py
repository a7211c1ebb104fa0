"""The dual extended Kalman filter: one filter for the state and one for the parameters.

Wan and Nelson (2001), with the recurrent derivative dx/dp; section 2.2.3 of Cheng and Cebon (2011). Two switches of
`DualCoupling` change it into Friedland's (1969) separate form of the joint filter, which does not diverge:

* consistent: the innovation variance of the parameter filter contains the uncertainty of the state, H P H', in addition
  to R. Without it, the parameter filter attributes innovations that are caused by the state to the parameters.
* coupled: a correction of the parameters also corrects the state along dx/dp, as in a joint filter.

The filter estimates scaled parameters z of order one with the prior N(0, 1): p = centre * exp(scale * z) for a
logarithmic parameter, p = centre + scale * z otherwise. z stays within bounds.
"""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from fifthwheel.base.native import Scan, compiled
from fifthwheel.base.types import Array
from fifthwheel.estimate.filters.kalman import ChannelUpdate, Noise, channel_columns, gate, joseph, observe, predict
from fifthwheel.estimate.filters.model import (
    Model,
    pack,
    pack_array,
    packed_size,
    partitioned,
    sizes,
    unpack,
    unpack_array,
)
from fifthwheel.estimate.filters.scaling import PRECISION, Scaling, symbolic_to_p


@dataclass(frozen=True, kw_only=True)
class DualCoupling:
    """How the two filters are coupled, and the random walk of the parameters."""

    consistent: bool = True  # the parameter filter's innovation variance contains the state's covariance
    coupled: bool = True  # a correction of the parameters corrects the state along dx/dp
    random_walk: Array | float = 0.0  # increase of the variance of z per second
    forgetting: float = 0.0  # 1/s: the random walk decays as exp(-forgetting t)


@dataclass(frozen=True, kw_only=True)
class DualState:
    """State of the two filters between two samples."""

    x: Array  # (n,)
    P: Array  # (n, n)
    z: Array  # (n_p,)
    Pz: Array  # (n_p, n_p)
    sensitivity: Array  # dx/dz (n, n_p)
    walk: float = 1.0  # factor of the random walk that is left after forgetting

    def vector(self) -> Array:
        """The carry of a compiled step."""
        return np.concatenate(
            [self.x, pack_array(self.P), self.z, pack_array(self.Pz), self.sensitivity.ravel(order="F"), [self.walk]]
        )

    @classmethod
    def from_vector(cls, vector: Array, n_x: int, n_p: int) -> "DualState":
        """Inverse of `vector` for n_x states and n_p parameters."""
        edges = np.cumsum([n_x, packed_size(n_x), n_p, packed_size(n_p), n_x * n_p])
        x, P, z, Pz, sensitivity, walk = np.split(vector, edges)
        return cls(
            x=x,
            P=unpack_array(P, n_x),
            z=z,
            Pz=unpack_array(Pz, n_p),
            sensitivity=sensitivity.reshape(n_x, n_p, order="F"),
            walk=float(walk[0]),
        )


def _positive_semidefinite(covariance: ca.SX) -> ca.SX:
    """A covariance (n, n) unchanged, or, if rounding made it indefinite, rebuilt from its factors U D U' with D >= 0.

    A pivot below the rounding error of its diagonal element is set to zero together with its column. Without this, a
    negative pivot inverts the sign of a gain, and the filter diverges where sensitivities grow without bound.
    """
    n = covariance.shape[0]
    U, D, valid = ca.SX.eye(n), ca.SX.zeros(n), ca.SX(1)
    for j in reversed(range(n)):
        pivot = covariance[j, j] - sum(D[k] * U[j, k] ** 2 for k in range(j + 1, n))
        positive = pivot > n * np.finfo(float).eps * covariance[j, j]
        valid *= positive
        D[j] = ca.if_else(positive, pivot, 0)
        for i in range(j):
            remainder = covariance[i, j] - sum(D[k] * U[i, k] * U[j, k] for k in range(j + 1, n))
            U[i, j] = ca.if_else(positive, remainder / ca.if_else(positive, pivot, 1), 0)
    return ca.if_else(valid, covariance, U @ ca.diag(D) @ U.T)


@dataclass(frozen=True, kw_only=True)
class DualFiltered:
    """Result of the dual filter for a record of N samples, n_p parameters and m channels."""

    z: Array  # (N, n_p)
    z_variance: Array  # (N, n_p)
    innovation: Array  # (N, m) of the sequential update, 0 where missing
    innovation_variance: Array  # (N, m)
    accepted: Array  # (N, m) 1 where the measurement was used, else 0
    sensitivity: Array  # (N, m, n_p) of each channel's prediction with respect to z
    end: DualState  # after the last row


@compiled(Scan)
def dual_step(model: Model, logarithmic: tuple[bool, ...]) -> ca.Function:
    """The compiled step of both filters.

    carry = `DualState.vector`; sample = [dt, d, y, weight];
    constant = [c, Q, R, gate^2, centre, scale, lower z, upper z, walk per second, forgetting, consistent, coupled];
    output = [z, diag Pz, innovation, variance, accepted, each channel's dy/dz].
    """
    n_x, n_d, n_p, n_c, n_y = sizes(model)
    n_P, n_Pz = packed_size(n_x), packed_size(n_p)
    carry, x, P, z, Pz, V, walk = partitioned("carry", n_x, n_P, n_p, n_Pz, n_x * n_p, 1)
    sample, dt, d, y, weight = partitioned("sample", 1, n_d, n_y, n_y)
    constant, c, q, r, limit, centre, scale, lower, upper, walk_rate, forgetting, consistent, coupled = partitioned(
        "constant", n_c, n_P, n_y, 1, *[n_p] * 5, 1, 1, 1
    )
    P, Pz, V = unpack(P, n_x), unpack(Pz, n_p), ca.reshape(V, n_x, n_p)

    symbol = ca.SX.sym("z", n_p)
    p_of_z = symbolic_to_p(logarithmic, symbol, centre, scale)
    p = ca.substitute(p_of_z, symbol, z)

    def wrt_z(function: ca.Function, *arguments: ca.SX) -> ca.SX:
        """Derivative of a function of (*arguments, p, c) with respect to z at a fixed state."""
        return ca.substitute(ca.jacobian(function(*arguments, p_of_z, c), symbol), symbol, z)

    before, P, F = predict(model, x, P, dt, d, p, c, unpack(q, n_x))
    V = F @ V + wrt_z(model.transition, x, dt, d)
    walk = walk * ca.exp(-forgetting * dt)
    Pz = Pz + ca.diag(walk_rate) * (walk * dt)

    predicted, H = observe(model, before, d, p, c)
    direct = wrt_z(model.observation, before, d)
    x, base, base_z, channels, sensitivities = before, before, z, [], []
    for i in range(n_y):
        row = H[i, :]
        psi = row @ V + direct[i, :]
        innovation = y[i] - predicted[i] - row @ (x - base) - coupled * (direct[i, :] @ (z - base_z))
        cross, cross_z = P @ row.T, Pz @ psi.T
        of_state, of_parameters = row @ cross + r[i], psi @ cross_z
        variance = of_parameters + of_state
        accepted = gate(innovation, variance, weight[i], limit)
        # rounding limits the information of a sample; the sensitivities of an unstable vehicle grow without bound
        noise_z = ca.fmax(consistent * of_state + (1 - consistent) * r[i], PRECISION * of_parameters)
        gain_z = accepted * cross_z / (of_parameters + noise_z)
        gain = accepted * cross / of_state
        z_after = ca.fmin(ca.fmax(z + gain_z * innovation, lower), upper)
        V = V - gain @ psi
        x = x + gain * innovation + coupled * (V @ (z_after - z))
        z = z_after
        P = joseph(P, cross, gain, row, r[i])
        Pz = joseph(Pz, cross_z, gain_z, psi, noise_z)
        channels.append(ChannelUpdate(weight[i] * innovation, variance, accepted))
        sensitivities.append(psi.T)
    Pz = _positive_semidefinite(Pz)
    carried = ca.vertcat(x, pack(P), z, pack(Pz), ca.vec(V), walk)
    output = [z, ca.diag(Pz), channel_columns(channels), *sensitivities]
    return ca.Function(
        "dual", [carry, sample, constant], [ca.densify(carried), ca.densify(ca.vertcat(*output))], {"cse": True}
    )


def run_dual(
    model: Model,
    rows: Array,
    *,
    c: Array,
    noise: Noise,
    scaling: Scaling,
    start: DualState,
    coupling: DualCoupling | None = None,
) -> DualFiltered:
    """Run both filters over one record, whose rows (N, 1 + n_d + 2 n_y) are those of `model.sample_rows`.

    c (n_c,) has the parameters of the model that are not estimated, and `start` is before the first row. The default
    coupling is equivalent to the joint filter.
    """
    coupling = coupling or DualCoupling()
    n_x, _, n_p, _, n_y = sizes(model)
    walk = np.broadcast_to(np.asarray(coupling.random_walk, dtype=np.float64), (n_p,))
    switches = [coupling.forgetting, float(coupling.consistent), float(coupling.coupled)]
    constant = np.concatenate([c, noise.vector(), scaling.vector(), walk, switches])
    carry, out = dual_step(model, scaling.logarithmic)(start.vector(), rows, constant)
    z, variance_z, innovation, variance, accepted, psi = np.split(out, np.cumsum([n_p, n_p, n_y, n_y, n_y]), axis=1)
    return DualFiltered(
        z=z,
        z_variance=variance_z,
        innovation=innovation,
        innovation_variance=variance,
        accepted=accepted,
        sensitivity=psi.reshape(-1, n_y, n_p),
        end=DualState.from_vector(carry, n_x, n_p),
    )
