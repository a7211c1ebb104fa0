"""The result of one stage: an `Identification` from its solution."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from statistics import NormalDist

import numpy as np

import fifthwheel
from fifthwheel.base.names import NumberedName
from fifthwheel.base.types import Array
from fifthwheel.data.channels import is_sensor_error
from fifthwheel.estimate.identify import estimates
from fifthwheel.estimate.identify.doubts import PriorTest
from fifthwheel.estimate.identify.estimates import stated_estimates
from fifthwheel.estimate.identify.fits import evaluate_fits, fits_of
from fifthwheel.estimate.identify.one_stage.causes import Causes
from fifthwheel.estimate.identify.one_stage.doubts import find_doubts
from fifthwheel.estimate.identify.one_stage.gauss_newton import Minimum, remaining_step
from fifthwheel.estimate.identify.one_stage.posterior import ScaledPosterior
from fifthwheel.estimate.identify.one_stage.problem import Problem
from fifthwheel.estimate.identify.one_stage.solution import Solution
from fifthwheel.estimate.identify.result.identification import Identification
from fifthwheel.estimate.identify.result.parts import Estimate, Fit, LogSummary
from fifthwheel.estimate.identify.statement import prior_of
from fifthwheel.estimate.identify.unknowns import parameters
from fifthwheel.estimate.identify.unknowns.unknown import Unknown, is_possible
from fifthwheel.estimate.identify.verdict import (
    Verdict,
    estimate_verdict,
    is_stated,
    remaining_fraction,
    still_moving,
    straight_running,
    uncertain_verdict,
    uninformed_parameters,
)
from fifthwheel.estimate.observe.uncertainty import Uncertainty
from fifthwheel.model import dynamics
from fifthwheel.model.dynamics.unit_equations import BANK
from fifthwheel.truck import Vehicle
from fifthwheel.truck.quantities import BANK_VARIATION, DRIVE_AXLE_BRAKING, FRICTION

FALSE_ALARM = 0.05
"""Probability that one of all uncertain numbers of a sound truck is noted as unusual."""


def build_identification(solution: Solution, causes: Causes | None = None, note: str = "") -> Identification:
    """Estimates with sigma and verdict, sensor errors, doubts by the causes of a contradiction, and fits of all logs;
    with a note for the user."""
    dataset, settings, problem, minimum = solution.dataset, solution.settings, solution.problem, solution.minimum
    posterior, causes = solution.linearisation.posterior, causes or Causes()
    given, own = parameters.given_parameters(dataset.initial_vehicle, settings), dataset.vehicle.parameters()
    shared, sigma = problem.values(minimum.z, 0), dict(zip(posterior.names, posterior.sigma.tolist(), strict=True))
    logs = [replace(log, errors=_own_errors(problem, minimum.z, i)) for i, log in enumerate(problem.logs)]
    of_all_logs = [u for u in problem.unknowns if u.is_of_truck]
    model_unknowns = [u for u in of_all_logs if not u.moves and u.name in given]
    values = problem.model_values(problem.without_variation(minimum.z), 0)
    changed = {name for u in problem.unknowns if not u.is_sensor_error for name in u.slopes}
    vehicle_values = {name: values[name] for name in own if name in changed}
    of_truck = dynamics.all_parameters(dataset.vehicle, (), tyres=problem.model.tyres)
    around = {n for n in of_truck if n in changed or values[n] != of_truck[n]} - {*own, FRICTION, DRIVE_AXLE_BRAKING}
    sensor_errors = [u for u in problem.unknowns if not (u.reported or u.is_uncertain)]
    evaluation = evaluate_fits(dataset, logs, fits_of(solution, dataset.vehicle.replace(vehicle_values)), settings)
    left = causes.left if evaluation.trusted or causes.likely else problem.relative_discrepancy
    doubts = find_doubts(solution, causes.likely, left)
    doubtful = {name for doubt in doubts for name in doubt.parameters}
    step = remaining_step(minimum)
    moving = still_moving(posterior.names, step, posterior.sigma)
    uninformed = {} if left is not None else _uninformed(solution, shared)
    estimated, uncertain = [], []
    for u in model_unknowns:
        if u.name in solution.estimated:
            verdict = uninformed.get(u.name) or estimate_verdict(
                u, shared[u.name], sigma[u.name], converged=u.name not in moving, doubtful=u.name in doubtful
            )
            estimated.append(_estimate(solution, u, shared[u.name], verdict))
        else:
            verdict = uncertain_verdict(sigma[u.name], settings.excited)
            uncertain.append(estimates.parameter_estimate(u, shared[u.name], sigma[u.name], verdict))
    listed = {e.name: e for e in uncertain}
    for e in stated_estimates(problem.setup, posterior, minimum.z, [log.name for log in logs], dataset.sensors):
        listed.setdefault(e.name, e)
    estimated += [estimates.fixed_estimate(name, given[name]) for name in problem.setup.fixed]
    vehicle = dataset.identified_vehicle(vehicle_values)
    joint = _doubtful_covariance(solution, causes.likely, step, explained=left is None)
    covariance = _covariance(dataset.vehicle, problem, minimum, joint)
    vehicle = _with_posterior_sigmas(vehicle, covariance)
    summaries = tuple(_summary(solution, posterior, i) for i in range(len(logs)))
    remaining = {name: min(sigma[name], 1.0) for name in _shared_uncertain(problem)}
    lengths = estimates.wheelbases(dataset.initial_vehicle, vehicle, covariance, remaining) if left is None else []
    return Identification(
        method="one-stage",
        vehicle=vehicle,
        initial_vehicle=dataset.initial_vehicle,
        signals=estimates.used_signals(dataset.vehicle, summaries),
        parameters=tuple(estimated),
        derived=(
            *estimates.derived_from_covariance(dataset.initial_vehicle, vehicle, estimated, covariance),
            *[e for e in lengths if e.name not in listed],
        ),
        sensors=tuple(estimates.sensor_error_estimates(sensor_errors, logs, shared, sigma)),
        uncertain=tuple(listed.values()),
        surroundings={name: values[name] for name in of_truck if name in around and not is_sensor_error(name)},
        covariance=covariance,
        doubts=tuple(doubts),
        variance_budget=_variance_budget(problem, posterior, solution.estimated),
        remaining_uncertainty=remaining,
        histories={"one stage": solution.linearisation.history},
        logs=summaries,
        fits=tuple(_with_whitened(solution, evaluation.fits)),
        log_likelihood=problem.log_likelihood(minimum.z),
        settings=settings,
        rounds=minimum.steps,
        findings=dataset.findings,
        notes=tuple(dict.fromkeys((*dataset.notes, *filter(None, [note]), *_implausible(solution), *evaluation.notes))),
        version=fifthwheel.__version__,
    )


def _own_errors(problem: Problem, z: Array, log: int) -> dict[str, float]:
    """Sensor errors that belong to one log, SI."""
    values = problem.values(z, log)
    return {u.name: values[u.name] for u in problem.unknowns if u.per_log}


def _uninformed(solution: Solution, values: Mapping[str, float]) -> dict[str, Verdict]:
    """The parameters that the logs do not determine: by what the inputs excite, or by the sigma of the result."""
    problem, posterior = solution.problem, solution.linearisation.posterior
    unknowns = problem.unknowns_by_name
    remaining = {
        name: remaining_fraction(unknowns[name], values[name], posterior.sigma_of(name)) for name in solution.estimated
    }
    by_result = uninformed_parameters(posterior, remaining, (), solution.settings.excited)
    straight = straight_running(solution.estimated, solution.lateral_accelerations)
    uninformed = {**straight, **by_result, **solution.uninformed}
    return {
        name: Verdict.STATED if is_stated(problem.vehicle, name) else verdict for name, verdict in uninformed.items()
    }


def _estimate(solution: Solution, unknown: Unknown, value: float, verdict: Verdict) -> Estimate:
    name, settings = unknown.name, solution.settings
    posterior, history = solution.linearisation.posterior, solution.linearisation.history
    informed = verdict not in (Verdict.NOT_EXCITED, Verdict.NOT_IDENTIFIABLE, Verdict.STATED)
    settled = history.settled_row(name, settings.tolerance) if informed else None
    return estimates.parameter_estimate(
        unknown,
        value,
        posterior.sigma_of(name),
        verdict,
        settling_time=None if settled is None else float(history.time[settled]),
        correlated_with=_correlated(solution, posterior, name, verdict),
    )


def _correlated(solution: Solution, posterior: ScaledPosterior, name: str, verdict: Verdict) -> tuple[str, ...]:
    """Unknowns from which a parameter is hardly separable, but no initial states; at least one of a parameter that is
    not identifiable although its conditional sigma is small."""
    if name in solution.problem.setup.without_roll_rate:
        return ()
    i, single_log = posterior.names.index(name), len(solution.dataset.logs) == 1
    names = [_without_number(posterior.names[j], single_log) for j in posterior.correlated(i)]
    names = [other for other in names if other not in solution.problem.model.states]
    confounded = verdict is Verdict.NOT_IDENTIFIABLE and posterior.conditional_sigma(name) < solution.settings.excited
    if confounded and not names:
        names = [_without_number(posterior.names[posterior.most_limiting(i)], single_log)]
    return tuple(names)


def _without_number(name: str, single_log: bool) -> str:
    """The name of an unknown without the number of its log if there is only one; of an initial state without that of
    its segment."""
    parsed = NumberedName.of(name)
    return parsed.base if single_log or parsed.segment is not None else name


def _with_whitened(solution: Solution, fits: Sequence[Fit]) -> list[Fit]:
    """The fits, those of identified logs with their whitened residuals."""
    problem, whitened = solution.problem, dict[tuple[str, str], Array]()
    for i, log in enumerate(problem.logs):
        _, error, variance = problem.residuals(solution.minimum.z, i)
        columns = (error / np.sqrt(variance)).T
        whitened |= {(log.name, name): column for name, column in zip(problem.model.outputs, columns, strict=True)}
    return [replace(fit, whitened=whitened[fit.log, fit.signal]) if fit.identified_on else fit for fit in fits]


def _summary(solution: Solution, posterior: ScaledPosterior, i: int) -> LogSummary:
    """What was used of log i; with the bank of its first segment, and who brakes, if they are estimated."""
    problem, minimum, settings = solution.problem, solution.minimum, solution.settings
    log, bank, brakes = problem.logs[i], None, None
    _, error, variance = problem.residuals(minimum.z, i, whitened=False)
    accepted = (np.abs(error) / np.sqrt(variance) <= settings.gate).astype(float)
    if problem.model.bank and problem.output_error:
        index, prior = problem.layout.initial_states[i][0][-1], problem.setup.bank_sigma
        bank = float(minimum.z[index] * prior), float(posterior.sigma[index] * prior)
    for u, index in zip(problem.unknowns, problem.layout.unknowns[i], strict=True):
        if u.name == DRIVE_AXLE_BRAKING:
            brakes = problem.values(minimum.z, i)[u.name], float(posterior.sigma[index] * u.scale)
    summary = estimates.log_summary(solution.dataset.records[i], log, problem.model.outputs, accepted)
    return replace(summary, bank=bank, drive_axle_braking=brakes)


def _implausible(solution: Solution) -> Iterator[str]:
    """A note on each uncertain number that the logs move further than trucks differ."""
    z = dict(zip(solution.problem.names, solution.minimum.z.tolist(), strict=True))
    uncertain = {name: u for name, u in solution.problem.unknowns_by_name.items() if u.is_uncertain}
    limit = NormalDist().inv_cdf(1 - FALSE_ALARM / 2 / max(len(uncertain), 1))  # Bonferroni
    for name, u in uncertain.items():
        if abs(z[name]) > limit or not is_possible(u, z[name]):
            far = "which few trucks have" if is_possible(u, z[name]) else "beyond what a truck can have"
            yield (
                f"{name}: the logs move it by {z[name]:+.1f} prior sigma, {far}. Something that the model lacks may "
                "act like it, so sigmas of other estimates may be too small: identify parts of the logs, and compare."
            )


def _doubtful_covariance(solution: Solution, likely: Sequence[PriorTest], step: Array, *, explained: bool) -> Array:
    """Covariance (k, k) of the unknowns for what follows from them.

    With the step (k,) that the search would still take, the shifts by causes of a contradiction, and the prior if
    nothing explains the logs.
    """
    covariance = solution.linearisation.posterior.covariance + np.outer(step, step)
    for test in likely:  # one of several causes, so that the mean square of their shifts is added
        covariance += np.outer(test.shifts, test.shifts) / len(likely)
    return covariance if explained else covariance + np.diag(solution.problem.prior.variance)


def _covariance(vehicle: Vehicle, problem: Problem, minimum: Minimum[Problem], covariance: Array) -> Uncertainty:
    """Joint covariance of the parameters of the vehicle, of the sensor errors and of the bank of the road, SI.

    `covariance` (k, k) is that of the unknowns. The sensor errors of log i, and the bank of its first segment, have the
    names "name@log". Those of any other log, "name@", have their prior. A change of the vehicle file contributes to
    every parameter that it alters. The bank varies within a log.
    """
    known = dynamics.all_parameters(vehicle, problem.model.outputs, tyres=problem.model.tyres)  # by an observer
    banked = problem.model.bank and problem.output_error
    rows: dict[str, Array] = {}
    for i, log in enumerate(problem.logs):
        values = problem.values(minimum.z, i)
        slopes = problem.setup.scaling.slope(np.array([values[u.name] for u in problem.unknowns]))
        for u, index, slope in zip(problem.unknowns, problem.layout.unknowns[i], slopes, strict=True):
            if i == 0 or u.per_log:
                for name, factor in u.slopes.items():
                    if name in known and not (u.per_log and u.moves):
                        row = rows.setdefault(f"{name}@{log.name}" if u.per_log else name, np.zeros(len(problem.names)))
                        row[index] += slope * factor
        if banked:
            row = rows.setdefault(f"{BANK}@{log.name}", np.zeros(len(problem.names)))
            row[problem.layout.initial_states[i][0][-1]] = problem.setup.bank_sigma
    others = {u.name: u.scale for u in problem.unknowns if u.per_log and not u.moves}
    others |= {BANK: problem.setup.bank_sigma} if banked else {}
    map_to_si = np.array(list(rows.values())).reshape(len(rows), len(problem.names))
    of_logs = map_to_si @ covariance @ map_to_si.T
    _, variation = prior_of(problem.settings.given, BANK_VARIATION)
    of_logs += np.diag([variation**2 if name.startswith(f"{BANK}@") else 0.0 for name in rows])
    k = len(rows)
    in_si = np.diag([*[0.0] * k, *[sigma**2 for sigma in others.values()]])
    in_si[:k, :k] = (of_logs + of_logs.T) / 2
    return Uncertainty(names=(*rows, *[f"{name}@" for name in others]), covariance=in_si)


def _with_posterior_sigmas(vehicle: Vehicle, posterior: Uncertainty) -> Vehicle:
    """The vehicle with the standard deviation of the posterior of every number of which its file states one."""
    sigmas = dict(zip(posterior.names, np.sqrt(np.diag(posterior.covariance)).tolist(), strict=True))
    stated = [path for path, sigma in vehicle.stated.items() if sigma and path not in vehicle.assumed]
    return vehicle.with_stated({path: float(f"{sigmas[path]:.3g}") for path in stated if path in sigmas})


def _variance_budget(
    problem: Problem, posterior: ScaledPosterior, estimated: Sequence[str]
) -> dict[str, dict[str, float]]:
    """For each estimated parameter, by what fraction its variance would fall if each uncertain number were exact: the
    squared correlation. The fractions do not add up to 1, because two uncertain numbers may act alike."""
    P, names = posterior.covariance, posterior.names
    sources = [(name, names.index(name)) for name in _shared_uncertain(problem)]
    budget = {}
    for i, name in ((names.index(name), name) for name in estimated):
        fractions = {source: float(P[i, j] ** 2 / (P[i, i] * P[j, j])) for source, j in sources if i != j}
        budget[name] = dict(sorted(fractions.items(), key=lambda item: -item[1]))
    return budget


def _shared_uncertain(problem: Problem) -> list[str]:
    """Names of the uncertain numbers that all logs share."""
    return [u.name for u in problem.unknowns if u.is_uncertain and not u.per_log]
