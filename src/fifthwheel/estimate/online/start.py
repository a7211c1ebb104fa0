"""How a learner starts: at the steady state, or with the estimates that it kept.

E x' = F x + G d; in a steady state dx/dp = - F^-1 d(F x + G d)/dp.

It keeps estimates of trailers that are not coupled, and a JSON file of all.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, Self

import casadi as ca
import numpy as np

from fifthwheel.base.errors import SignalError
from fifthwheel.base.input_files import FileKind
from fifthwheel.base.native import Scan, compiled
from fifthwheel.base.types import Array, selected
from fifthwheel.data.channels import SignalName
from fifthwheel.estimate.filters.initial_state import (
    TYPICAL_STEER_SIGMA,
    equilibrium,
    initial_state,
    steady_initial_state,
)
from fifthwheel.estimate.filters.model import block_diagonal
from fifthwheel.estimate.filters.scaling import Scaling
from fifthwheel.estimate.identify.one_stage.prior import JointPrior
from fifthwheel.estimate.identify.setup import Setup
from fifthwheel.estimate.identify.stored import Matrix, Vector, restored
from fifthwheel.estimate.identify.unknowns.unknown import Unknown
from fifthwheel.estimate.online.online_model import OnlineModel
from fifthwheel.estimate.online.settings import LearnerSettings
from fifthwheel.model.dynamics import true_angles
from fifthwheel.model.dynamics.chain import equations, state_names

LEARNER_FILE = FileKind(
    kind="fifthwheel learner", version=3, title="a learner", writer="Learner.save", renew="start with a new Learner"
)


@dataclass(frozen=True, kw_only=True, eq=False)
class Considered:
    """What is known of the n_c considered unknowns, in units of their priors."""

    mean: Array
    """(n_c,); 0 without earlier logs."""
    sigma: Array
    """(n_c,); 1 without earlier logs."""
    correlation: Array
    """(n_c, n_c)"""

    @classmethod
    def of(cls, mean: Array, covariance: Array) -> Self:
        """From the mean (n_c,) and the covariance (n_c, n_c)."""
        sigma = np.sqrt(np.diag(covariance))
        correlation = covariance / np.outer(sigma, sigma)
        np.fill_diagonal(correlation, 1.0)
        return cls(mean=mean, sigma=sigma, correlation=correlation)

    @property
    def is_prior(self) -> bool:
        """Whether only the priors are known."""
        return not self.mean.any() and bool((self.sigma == 1).all()) and not self.is_correlated

    @property
    def is_correlated(self) -> bool:
        """Whether some are correlated."""
        return bool(np.count_nonzero(self.correlation) > len(self.mean))

    def scaling(self, setup: Setup) -> Scaling:
        """The scaling of all unknowns of a setup in which the considered ones have mean 0 and variance 1."""
        own, n = setup.scaling, len(setup.estimated_unknowns)
        centre, scale = own.to_p(np.append(np.zeros(n), self.mean)), own.scale.copy()
        centre[:n] = own.centre[:n]
        scale[n:] *= self.sigma
        return replace(own, centre=centre, scale=scale)


def start_state(
    setup: Setup, model: OnlineModel, learner: LearnerSettings, scaling: Scaling, z: Array, first: Mapping[str, float]
) -> tuple[Array, Array, Array]:
    """Steady state (n_x,) of the first inputs, its covariance (n_x, n_x) and derivative dx/dz (n_x, n_p)."""
    vehicle, unknowns = setup.vehicle, setup.unknowns
    p = scaling.to_p(with_prior_means(z, len(unknowns)))
    values = setup.changed_model(dict(zip([u.name for u in unknowns], p.tolist(), strict=True)))
    bank = setup.bank_sigma if model.chain.bank else None
    x, P = initial_state(vehicle, first, values, roll=True, steer_sigma=TYPICAL_STEER_SIGMA, bank=bank)
    _, m = steady_initial_state(vehicle, first, values, roll=True)
    n, inputs = len(m.A) - 1, [first[name] for name in setup.inputs]
    constant = np.append(p, model.constant(values, unknowns, learner.discrepancy_time))
    _, output = steady_slopes(model)(np.zeros(0), np.append(inputs, x[:n])[None], constant)
    slopes = equilibrium(m, np.linalg.solve(m.E[:n, :n], output[0].reshape(n, -1, order="F")))
    V = np.zeros((len(x) + model.discrepancies, len(p)))
    V[:n] = slopes * scaling.slope(p)
    discrepancies = discrepancy_variances(setup, learner)
    return np.pad(x, (0, len(discrepancies))), block_diagonal(P, np.diag(discrepancies)), V


def discrepancy_variances(setup: Setup, learner: LearnerSettings) -> Array:
    """Of each discrepancy among the states, SI squared."""
    names = setup.outputs if setup.has_discrepancies else ()
    return np.array([learner.discrepancy.get(SignalName.of(name).quantity, 0.0) ** 2 for name in names])


def with_prior_means(z: Array, count: int) -> Array:
    """z (count,) of all unknowns from that of the estimated ones, which come first."""
    return np.append(z, np.zeros(count - len(z)))


class SteadyEquations(NamedTuple):
    """At a speed and steer angles, without the bank as a state, for n states, k steered axles and n_p unknowns."""

    A: ca.SX  # (n, n) of x' = A x + B d
    B: ca.SX  # (n, k)
    F: ca.SX  # (n, n)
    steer: ca.SX  # (k,) angles of the wheels, rad
    bank: ca.SX  # (n,) effect of the bank on x'
    slopes: ca.SX  # (n, n_p) d(F x + G d)/dp


def steady_equations(model: OnlineModel, inputs: ca.SX, x: ca.SX, p: ca.SX, c: ca.SX) -> SteadyEquations:
    """The equations of a steady state x (n,) at a speed, m/s, and measured steer angles, rad; p, c: of the model."""
    vehicle, value = model.chain.vehicle, model.values(p, c)
    n, speed = len(state_names(vehicle, roll=True)), inputs[0]
    steers = vehicle.steer_signals()
    steer = true_angles(steers, inputs[1 : 1 + len(steers)], value)
    terms = equations(value, vehicle, roll=True, bank=True)
    A, B = terms.state_space(speed)
    F, G = (matrix[:n, :] for matrix in terms.implicit(speed))
    slopes = ca.jacobian(F[:, :n] @ x + G @ steer, p)
    return SteadyEquations(A[:n, :n], B[:n, :], F[:, :n], steer, A[:n, n], slopes)


@compiled(Scan)
def steady_slopes(model: OnlineModel) -> ca.Function:
    """sample = [inputs, x]; constant = [p, c]; output = `slopes` of `SteadyEquations`, by columns; no carry."""
    vehicle = model.chain.vehicle
    n, k = len(state_names(vehicle, roll=True)), 1 + len(vehicle.steer_signals())
    n_p, n_c = model.observation.numel_in(2), model.observation.numel_in(3)
    nothing, sample, constant = ca.SX.sym("nothing", 0), ca.SX.sym("sample", k + n), ca.SX.sym("constant", n_p + n_c)
    steady = steady_equations(model, sample[:k], sample[k:], constant[:n_p], constant[n_p:])
    output = ca.vec(ca.densify(steady.slopes))
    return ca.Function("steady_slopes", [nothing, sample, constant], [nothing, output], {"cse": True})


@dataclass(frozen=True, kw_only=True, eq=False)
class EstimateBlock:
    """Estimates of some unknowns, without their correlation with all others."""

    names: tuple[str, ...]
    centre: tuple[float, ...]  # with `scale` the meaning of z
    scale: tuple[float, ...]
    z: Vector  # (n,)
    Pz: Matrix  # covariance of z (n, n)

    @classmethod
    def of(cls, unknowns: Sequence[Unknown], z: Array, Pz: Array) -> "EstimateBlock":
        """All unknowns, with z (n,) and its covariance (n, n)."""
        names, centre, scale = (tuple(getattr(u, key) for u in unknowns) for key in ("name", "centre", "scale"))
        return cls(names=names, centre=centre, scale=scale, z=z, Pz=Pz)

    def among(self, places: Sequence[int]) -> "EstimateBlock":
        """The estimates of the unknowns at some places."""
        own: EstimateBlock = selected(self, places)
        return own

    def restricted(self, unknowns: Sequence[Unknown]) -> "EstimateBlock":
        """The estimates of those that are among some unknowns with the same prior."""
        priors = {u.name: (u.centre, u.scale) for u in unknowns}
        own = zip(self.names, self.centre, self.scale, strict=True)
        return self.among(
            [i for i, (n, *prior) in enumerate(own) if n in priors and np.allclose(priors[n], prior, rtol=1e-9)]
        )

    @classmethod
    def restored(cls, content: Any) -> "EstimateBlock":
        """The block that was `stored`; a ValueError for any other content."""
        block: EstimateBlock = restored(cls, content)
        n = len(block.names)
        if {len(column) for column in (block.centre, block.scale, block.z, *block.Pz, block.Pz)} != {n}:
            raise ValueError("the sizes of names, z and Pz differ")
        Pz = block.Pz.reshape(n, n)
        if n:
            np.linalg.cholesky(Pz)  # LinAlgError, a ValueError, if it is not positive definite
        return replace(block, Pz=(Pz + Pz.T) / 2)


def combine_blocks(
    unknowns: Sequence[Unknown], blocks: Iterable[tuple[EstimateBlock, str]], earlier: JointPrior | None = None
) -> tuple[Array, Array]:
    """z (n_p,) and its covariance (n_p, n_p) from blocks, which are uncorrelated; the prior for all other unknowns.

    Each block has a title for the message of an error. `earlier` is the information of earlier logs on unknowns of no
    block, with the widening by model error. A SignalError: an unknown of a block does not exist, or has another prior.
    """
    z, Pz = np.zeros(len(unknowns)), np.eye(len(unknowns))
    by_name = {u.name: (i, u) for i, u in enumerate(unknowns)}
    if earlier is not None:
        places = [by_name[name][0] for name in earlier.names]
        z[places] = earlier.mean
        Pz[np.ix_(places, places)] = earlier.covariance * np.outer(earlier.widening, earlier.widening)
    for block, title in blocks:
        for name, centre, scale in zip(block.names, block.centre, block.scale, strict=True):
            _, u = by_name.get(name, (0, None))
            if u is None or not np.allclose((u.centre, u.scale), (centre, scale), rtol=1e-9):
                raise SignalError(
                    f"{name}: the estimates of {title} belong to another vehicle file, other signals or other "
                    "settings; give the same ones, or another name"
                )
        places = [by_name[name][0] for name in block.names]
        Pz[np.ix_(places, places)] = block.Pz
        z[places] = block.z
    return z, Pz
