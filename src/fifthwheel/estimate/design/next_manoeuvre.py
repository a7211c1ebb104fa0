"""Which manoeuvres to drive next while a learner learns, and which targets driving cannot reach.

A copy of the learner is driven once through each candidate manoeuvre, simulated by the linear model at the present
estimates, without noise. The covariance P = `Pz` and the gains B of its `JointEstimate`, before (0) and after
it (1), give the information of the manoeuvre on the estimated unknowns, and on them together with the considered ones:

    H = P1^-1 - P0^-1,    C = P0^-1 B0 - P1^-1 B1.

Information adds up: with that of further manoeuvres, P^-1 = P0^-1 + sum H and P^-1 B = P0^-1 B0 - sum C. So H and C are
computed once; the prediction from any later estimate is then linear algebra, as long as the estimate stays near the one
at which they were computed: information from different points of linearisation appears to add up to more (Huang,
Mourikis and Roumeliotis 2010). The prediction is the sigma that this learner will give, which includes the model errors
that more data does not reduce.
"""

import copy
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from fifthwheel.base.types import Array
from fifthwheel.data.record import Record
from fifthwheel.estimate.design.search import DesignSettings, sizes_within_limits, stable_speeds
from fifthwheel.estimate.filters.step_rows import play_contact
from fifthwheel.estimate.identify.unknowns.parameters import VARIATION
from fifthwheel.estimate.online import Learner
from fifthwheel.model import dynamics
from fifthwheel.model.dynamics.simulation import free_response
from fifthwheel.model.manoeuvres.accelerations import steer_record
from fifthwheel.model.manoeuvres.candidates import CandidateManoeuvre, candidate_manoeuvres
from fifthwheel.truck.quantities import size_of

DRIVEN = DesignSettings(frequencies=(0.3, 0.5), accelerations=(0.5,), max_acceleration=1.0)
"""Candidates for a driver. Harder manoeuvres inform a linear model less: tyres soften."""
NOT_REPEATABLE = "random"
"""Kind of the candidates that a driver cannot repeat."""
STRAIGHT = 1.5
"""Time straight ahead before a manoeuvre, s: a learner settles in it."""
WORTHWHILE = 0.02
"""A manoeuvre is worthwhile if it reduces the sigmas above their targets by this fraction, added up."""
MOST_STEPS = 40
"""Largest number of manoeuvres in a plan."""


@dataclass(frozen=True, kw_only=True, eq=False)
class InformativeManoeuvre:
    """A manoeuvre and what a learner learns from it."""

    manoeuvre: CandidateManoeuvre
    size: float  # largest lateral acceleration of the first unit's CoG, m/s^2
    information: Array = field(repr=False)  # H (n_z, n_z), of the estimated unknowns in units of their priors
    cross: Array = field(repr=False)  # C (n_z, n_c), of the considered unknowns in units of their priors


@dataclass(frozen=True, kw_only=True, eq=False)
class DrivingPlan:
    """The manoeuvres that bring a learner nearest to its targets, and the sigmas then."""

    steps: tuple[InformativeManoeuvre, ...]  # in the order of driving; empty if no further manoeuvre is worthwhile
    excess: float  # sum of the logarithms of the present sigmas over their targets, of those above
    sigma: Mapping[str, float]  # sigma of each parameter with a target after them, relative to its value
    uninformed: tuple[str, ...]  # those that no manoeuvre with these sensors informs
    limits: Mapping[str, str]
    """Of each parameter whose variance then comes mostly from considered unknowns, or from its own variation: the one
    that contributes most."""

    @property
    def duration(self) -> float:
        """s."""
        return sum(step.manoeuvre.period for step in self.steps)


def manoeuvre_information(learner: Learner, settings: DesignSettings = DRIVEN) -> tuple[InformativeManoeuvre, ...]:
    """The candidate manoeuvres for a learner, and what it would learn from one of each at its present estimates.

    Takes about 0.2 s for each. A VehicleError: the truck of the file is unstable at every speed of the settings.
    """
    vehicle = learner.live.setup.vehicle
    candidates = [
        m for speed in stable_speeds(vehicle, settings) for m in candidate_manoeuvres(speed, settings.frequencies)
    ]
    informative = []
    for manoeuvre in (m for m in candidates if m.kind != NOT_REPEATABLE):
        steer, _, sizes = sizes_within_limits(vehicle, manoeuvre, settings)
        for size in sizes:
            driven = copy.copy(learner)
            before = driven.live.filter.estimate()
            driven.learn(_measured(learner, manoeuvre, size * steer, settings.rate))
            after = driven.live.filter.estimate()
            P0, P1 = np.linalg.inv(before.Pz), np.linalg.inv(after.Pz)
            gained, axes = np.linalg.eigh(P1 - P0)
            informative.append(
                InformativeManoeuvre(
                    manoeuvre=manoeuvre,
                    size=size,
                    information=axes * np.maximum(gained, 0.0) @ axes.T,  # a bias walks, and loses information
                    cross=(P0 @ before.B - P1 @ after.B) / learner.live.considered.sigma,
                )
            )
    return tuple(informative)


def plan_manoeuvres(
    learner: Learner, candidates: Sequence[InformativeManoeuvre], targets: Mapping[str, float]
) -> DrivingPlan:
    """The next manoeuvres for a learner with its present estimates.

    Each step is the candidate that most reduces the sigmas above their targets, in logarithms, for its duration.
    `targets` are wanted sigmas by parameter of the learner, relative to their values.
    """
    live = learner.live
    unknowns, considered, limit = live.setup.estimated_unknowns, live.setup.considered_unknowns, live.setup.settings
    estimate, inflation = live.filter.estimate(finished=False), max(1.0, *live.innovations.autocorrelation)
    places = {u.name: i for i, u in enumerate(unknowns)}
    names = [name for name in targets if name in places]
    rows, values = [places[name] for name in names], live.setup.scaling.to_p(live.joint(estimate)[0])
    sigmas = [unknowns[i].sigma(values[i], 1.0) for i in rows]
    units = np.array([s / size_of(unknowns[i].name, values[i], s) for i, s in zip(rows, sigmas, strict=True)])
    wanted = np.array([targets[name] for name in names])
    H = np.stack([c.information for c in candidates])
    C = np.stack([c.cross for c in candidates]) * live.considered.sigma
    L = np.linalg.cholesky(estimate.correlation)

    def variances(P: Array, B: Array) -> tuple[Array, Array]:
        """In units of the priors: without the considered unknowns (..., n), and by each of these (..., n, n_c)."""
        own = np.diagonal(P, axis1=-2, axis2=-1)[..., rows]
        return own * np.clip(1 / own, 1.0, inflation), (B[..., rows, :] @ L) ** 2

    def excess(own: Array, others: Array) -> Array:
        """Sum of the logarithms of sigma over its target, where it is above."""
        sigma = np.sqrt(own + others.sum(axis=-1))
        return np.asarray(np.log(np.maximum(sigma * units / wanted, 1.0)).sum(axis=-1))

    steps: list[InformativeManoeuvre] = []
    information = np.asarray(np.linalg.inv(estimate.Pz))
    product = information @ estimate.B
    own, others = variances(estimate.Pz, estimate.B)
    periods = np.array([c.manoeuvre.period for c in candidates])
    present = float(excess(own, others))
    while rows and len(steps) < MOST_STEPS:
        P = np.asarray(np.linalg.inv(information + H))
        own_then, others_then = variances(P, P @ (product - C))
        gains = excess(own, others) - excess(own_then, others_then)
        best = int(np.argmax(gains / periods))
        if gains[best] < WORTHWHILE:
            break
        steps.append(candidates[best])
        information, product = information + H[best], product - C[best]
        own, others = own_then[best], others_then[best]
    sigma = np.sqrt(own + others.sum(-1))
    largest = [considered[i].name for i in others.argmax(axis=-1)] if considered else names
    limits = {n: c for n, c, mine, rest in zip(names, largest, own, others, strict=True) if rest.sum() > mine}
    P = np.linalg.inv(information)
    for name, i, s in zip(names, rows, sigma, strict=True):
        k = places.get(f"{name}.{VARIATION}")
        if name not in limits and k is not None and P[i, k] ** 2 / P[k, k] > s**2 / 2:
            limits[name] = unknowns[k].name
    uninformed = tuple(n for n in targets if n not in places or not sigma[names.index(n)] < limit.excited)
    return DrivingPlan(
        steps=tuple(steps),
        excess=present,
        sigma=dict(zip(names, (sigma * units).tolist(), strict=True)),
        uninformed=uninformed,
        limits=limits,
    )


def _measured(learner: Learner, manoeuvre: CandidateManoeuvre, steer: Array, rate: float) -> Record:
    """What the sensors of a learner measure at its present estimates, without noise; after its last sample."""
    live, setup = learner.live, learner.live.setup
    values, first = setup.model_values(live.joint()[0]), setup.inputs[1]
    steer = np.append(np.zeros(round(STRAIGHT * rate)), steer[: round(manoeuvre.period * rate)])
    measured = dynamics.measured_angle(first, steer, values)
    record = steer_record(setup.vehicle, manoeuvre.speed, measured, rate, manoeuvre.kind)
    start = max(live.stream.time, 0.0) + live.learner.max_gap + 1.0  # the state starts again
    record = replace(record, time=record.time + start)
    inputs = dict(record.signals)
    for name in setup.inputs[1:]:
        inputs[dynamics.contact_input(name)] = play_contact(record.signals[name], values[f"{name}.play"])
        inputs[dynamics.rate_input(name)] = np.gradient(record.signals[name], 1 / rate)
    model = dynamics.model(setup.vehicle, setup.outputs, roll=setup.settings.roll, extended=True)
    _, outputs = free_response(model, values, record.time, inputs)
    return record.with_signals(dict(zip(setup.outputs, outputs.T, strict=True)))
