"""The dual extended Kalman filter: a filter for the state and one for the parameters, side by side.

Wan and Nelson (2001), with the recurrent derivative dx/dp; the article's section 2.2.3. Two switches of `Coupling`
lead from that filter to Friedland's (1969) separate form of the joint filter, which is what keeps it from diverging:

* consistent: the parameter filter's innovation variance holds the state's own uncertainty H P H' as well as R.
  Without it the parameters believe every innovation that is only the state's.
* coupled: a correction of the parameters moves the state along dx/dp, as it would in one joint filter.

Parameters live as z of order one with prior N(0, 1): p = centre * exp(scale * z) or p = centre + scale * z, inside
bounds that hold.
"""

import functools
from dataclasses import dataclass

import casadi as ca
import numpy as np

from fifthwheel.filters.kalman import Noise, channel_columns, observe, predict
from fifthwheel.filters.model import Array, Model, pack, pack_array, packed_size, sizes, split, unpack, unpack_array
from fifthwheel.filters.update import Channel, gate, joseph, positive
from fifthwheel.native import Scan

PRECISION = 1e-11
"""Least noise of a channel, as a part of what the parameters' uncertainty makes of it."""


@dataclass(frozen=True, kw_only=True)
class Scaling:
    """How z becomes p: one entry a parameter, in the model's order."""

    logarithmic: tuple[bool, ...]
    centre: Array  # p at z = 0
    scale: Array  # prior standard deviation: of ln p if logarithmic, else of p
    lower: Array  # bounds of p; finite, positive if logarithmic
    upper: Array

    def to_p(self, z: Array) -> Array:
        """z (..., n_p) as parameters."""
        log = np.array(self.logarithmic)
        return np.where(log, self.centre * np.exp(np.where(log, self.scale * z, 0.0)), self.centre + self.scale * z)

    def to_z(self, p: Array) -> Array:
        """Parameters (..., n_p) as z."""
        log = np.array(self.logarithmic)
        ratio = np.where(log, p / np.where(log, self.centre, 1.0), 1.0)
        return np.where(log, np.log(ratio), p - self.centre) / self.scale

    def slope(self, p: Array) -> Array:
        """dp/dz at p."""
        return np.where(np.array(self.logarithmic), p * self.scale, self.scale)

    def vector(self) -> Array:
        return np.concatenate([self.centre, self.scale, self.to_z(self.lower), self.to_z(self.upper)])


@dataclass(frozen=True, kw_only=True)
class Coupling:
    """How the two filters know of each other, and how the parameters wander."""

    consistent: bool = True  # S of the parameter filter includes the state's covariance
    coupled: bool = True  # a parameter's correction moves the state along dx/dp
    random_walk: Array | float = 0.0  # variance of z gained per second
    forgetting: float = 0.0  # 1/s: the random walk decays as exp(-forgetting t)


@dataclass(frozen=True, kw_only=True)
class DualState:
    """The two filters between two samples."""

    x: Array  # (n,)
    P: Array  # (n, n)
    z: Array  # (n_p,)
    Pz: Array  # (n_p, n_p)
    sensitivity: Array  # dx/dz (n, n_p)
    walk: float = 1.0  # what forgetting has left of the random walk

    def vector(self) -> Array:
        return np.concatenate(
            [self.x, pack_array(self.P), self.z, pack_array(self.Pz), self.sensitivity.ravel(order="F"), [self.walk]]
        )

    @classmethod
    def from_vector(cls, vector: Array, n_x: int, n_p: int) -> "DualState":
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


@dataclass(frozen=True, kw_only=True)
class DualFiltered:
    """A record after the dual filter; N samples, n_p parameters, m channels."""

    z: Array  # (N, n_p)
    z_variance: Array  # (N, n_p)
    innovation: Array  # (N, m) sequential, 0 where missing
    innovation_variance: Array  # (N, m)
    accepted: Array  # (N, m)
    sensitivity: Array  # (N, m, n_p) of each channel's prediction to z
    end: DualState


def scaled(logarithmic: tuple[bool, ...], z: ca.SX, centre: ca.SX, scale: ca.SX) -> ca.SX:
    """`Scaling.to_p`, symbolically."""
    return ca.vertcat(
        *[
            centre[i] * ca.exp(scale[i] * z[i]) if log else centre[i] + scale[i] * z[i]
            for i, log in enumerate(logarithmic)
        ]
    )


@functools.cache
def step(model: Model, logarithmic: tuple[bool, ...]) -> Scan:
    """The compiled step.

    carry = `DualState.vector`; sample = [dt, d, y, weight];
    constant = [c, Q, R, gate^2, centre, scale, lower z, upper z, walk per second, forgetting, consistent, coupled];
    output = [z, diag Pz, innovation, variance, accepted, each channel's dy/dz].
    """
    n_x, n_d, n_p, n_c, n_y = sizes(model)
    n_P, n_Pz = packed_size(n_x), packed_size(n_p)
    carry, sample, constant = (
        ca.SX.sym(name, size)
        for name, size in (
            ("carry", n_x + n_P + n_p + n_Pz + n_x * n_p + 1),
            ("sample", 1 + n_d + 2 * n_y),
            ("constant", n_c + n_P + n_y + 1 + 5 * n_p + 3),
        )
    )
    x, P, z, Pz, V, walk = split(carry, [n_x, n_P, n_p, n_Pz, n_x * n_p, 1])
    dt, d, y, weight = split(sample, [1, n_d, n_y, n_y])
    c, q, r, limit, centre, scale, lower, upper, walk_rate, forgetting, consistent, coupled = split(
        constant, [n_c, n_P, n_y, 1, *[n_p] * 5, 1, 1, 1]
    )
    P, Pz, V = unpack(P, n_x), unpack(Pz, n_p), ca.reshape(V, n_x, n_p)

    symbol = ca.SX.sym("z", n_p)
    p_of_z = scaled(logarithmic, symbol, centre, scale)
    p = ca.substitute(p_of_z, symbol, z)

    def wrt_z(function: ca.Function, *arguments: ca.SX) -> ca.SX:
        """d function / dz at z, the state held; `arguments` come before p and c."""
        return ca.substitute(ca.jacobian(function(*arguments, p_of_z, c), symbol), symbol, z)

    before, P, F = predict(model, x, P, dt, d, p, c, unpack(q, n_x))
    V = F @ V + wrt_z(model.transition, x, dt, d)
    walk = walk * ca.exp(-forgetting * dt)
    Pz = Pz + ca.diag(walk_rate) * (walk * dt)

    predicted, H = observe(model, before, d, p, c)
    direct = wrt_z(model.observation, before, d)
    x, base, base_z, channels, seen = before, before, z, [], []
    for i in range(n_y):
        row = H[i, :]
        psi = row @ V + direct[i, :]
        innovation = y[i] - predicted[i] - row @ (x - base) - coupled * (direct[i, :] @ (z - base_z))
        cross, cross_z = P @ row.T, Pz @ psi.T
        own, spread = row @ cross + r[i], psi @ cross_z
        variance = spread + own
        accepted = gate(innovation, variance, weight[i], limit)
        # no sample may pin z closer than rounding lets it: where a vehicle runs away, so does its gradient
        noise_z = ca.fmax(consistent * own + (1 - consistent) * r[i], PRECISION * spread)
        gain_z = accepted * cross_z / (spread + noise_z)
        gain = accepted * cross / own
        moved = ca.fmin(ca.fmax(z + gain_z * innovation, lower), upper)
        V = V - gain @ psi
        x = x + gain * innovation + coupled * (V @ (moved - z))
        z = moved
        P = joseph(P, cross, gain, row, r[i])
        Pz = joseph(Pz, cross_z, gain_z, psi, noise_z)
        channels.append(Channel(weight[i] * innovation, variance, accepted))
        seen.append(psi.T)
    Pz = positive(Pz)
    carried = ca.vertcat(x, pack(P), z, pack(Pz), ca.vec(V), walk)
    output = [z, ca.diag(Pz), channel_columns(channels), *seen]
    return Scan(
        ca.Function(
            "dual", [carry, sample, constant], [ca.densify(carried), ca.densify(ca.vertcat(*output))], {"cse": True}
        )
    )


def run(
    model: Model,
    rows: Array,
    *,
    c: Array,
    noise: Noise,
    scaling: Scaling,
    start: DualState,
    coupling: Coupling | None = None,
) -> DualFiltered:
    """Take both filters through one record.

    Args:
        rows: from `model.sample_rows`, (N, 1 + n_d + 2 n_y).
        c: the model's other parameters (n_c,).
        noise: Q per second, R and the gate.
        scaling: how z becomes p.
        start: both filters before the first row.
        coupling: how they know of each other; the joint filter's ways by default.
    """
    coupling = coupling or Coupling()
    n_x, _, n_p, _, n_y = sizes(model)
    walk = np.broadcast_to(np.asarray(coupling.random_walk, dtype=np.float64), (n_p,))
    switches = [coupling.forgetting, float(coupling.consistent), float(coupling.coupled)]
    constant = np.concatenate([c, noise.vector(), scaling.vector(), walk, switches])
    carry, out = step(model, scaling.logarithmic)(start.vector(), rows, constant)
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
