"""Identification in one stage: all unknowns together, over complete logs.

    logs, vehicle -> maximum of the posterior by Gauss-Newton steps on exact derivatives (problem.py, gauss_newton.py)
                  -> covariance that allows for model error (posterior.py), a verdict for each parameter (verdict.py)
                  -> identified vehicle

The article needs two stages and more than ten lane changes. One stage needs one lane change: it linearises about the
estimate and not about the initial values, every sample informs all parameters, and parameters that are uncertain in the
vehicle file are treated as uncertain.
"""

import functools
import itertools
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

import fifthwheel
from fifthwheel import dynamics
from fifthwheel._types import Array
from fifthwheel.dynamics import ChainModel
from fifthwheel.errors import VehicleError
from fifthwheel.identify import estimates, parameters
from fifthwheel.identify.dataset import Dataset, LogData, prepare_dataset
from fifthwheel.identify.doubts import (
    HARMFUL_SHIFT,
    NONLINEAR_ACCELERATION,
    STRONG_SCORE,
    UNUSUAL_ESTIMATE,
    UNUSUAL_SENSOR_ERROR,
    Cause,
    Doubt,
    DoubtKind,
    ScoreTest,
    most_likely,
    score_tests,
)
from fifthwheel.identify.fit_evaluation import evaluate_fits
from fifthwheel.identify.history import ParameterHistory
from fifthwheel.identify.one_stage import likelihood
from fifthwheel.identify.one_stage.gauss_newton import Minimum, minimise
from fifthwheel.identify.one_stage.posterior import Posterior
from fifthwheel.identify.one_stage.problem import Problem
from fifthwheel.identify.parameters import Unknown
from fifthwheel.identify.residuals import long_run_covariance
from fifthwheel.identify.result import Estimate, Identification, LogSummary
from fifthwheel.identify.settings import OneStage, Progress
from fifthwheel.identify.verdict import Verdict, estimate_verdict, uninformed_parameters
from fifthwheel.names import SignalName, is_sensor_error, split_log
from fifthwheel.observe.uncertainty import Uncertainty
from fifthwheel.record import Record
from fifthwheel.record.lateral_acceleration import largest_lateral_acceleration
from fifthwheel.vehicle import Vehicle

HISTORY_LENGTH = 200
"""Approximate number of rows in the history of the estimates."""
WHITE_TOLERANCE = 1.0
"""Of the first fit, which takes residuals as white: its sigmas are too small, and other fits follow."""
ROUND_TOLERANCES = (0.3, 0.02)
"""Of the fits with a noise model; each takes the noise from the residuals of the one before. The prediction-error form
has the last one only."""
EARLY_ITERATIONS = 25
"""Largest number of steps of every fit but the last."""
STIFFENING = 0.5
"""Step by which an unstable initial vehicle is stiffened, in units of z."""


def identify_one_stage(
    records: Sequence[Record],
    vehicle: Vehicle,
    settings: OneStage,
    *,
    validate: Sequence[Record] = (),
    progress: Progress = lambda *_: None,
) -> Identification:
    """Identify a vehicle in one stage; arguments and errors as in `identify`."""
    dataset = prepare_dataset(records, vehicle, settings, validate)
    outputs = (*dataset.yaw, *dataset.roll)
    free = tuple(dynamics.all_parameters(dataset.vehicle, outputs, extended=True))
    estimated = parameters.estimated_parameters(dataset.vehicle, settings)
    if not estimated and not settings.nuisances:
        raise VehicleError(
            "fixed: every parameter is fixed and no sensor error is estimated, so nothing is left to estimate; "
            "leave one parameter free, or estimate the sensor errors (nuisances)"
        )
    estimator = _Estimator(
        dataset=dataset,
        settings=settings,
        outputs=outputs,
        model=dynamics.model(dataset.vehicle, outputs, roll=True, bank=settings.nuisances, free=free, extended=True),
        estimated=tuple(estimated),
    )
    return _identification(estimator, estimator.solve(progress))


@dataclass(frozen=True, kw_only=True)
class _Solution:
    """The maximum of the posterior."""

    problem: Problem
    minimum: Minimum
    uninformed: Mapping[str, Verdict]
    """Parameters that keep the value of the vehicle file, because the logs do not determine them."""


@dataclass(frozen=True, kw_only=True)
class _Estimator:
    """What stays the same during one identification."""

    dataset: Dataset
    settings: OneStage
    outputs: tuple[str, ...]
    model: ChainModel
    """With every parameter free."""
    estimated: tuple[str, ...]
    """Names of the estimated parameters."""

    def solve(self, progress: Progress) -> _Solution:
        """Estimate all unknowns, again and again until the set of uninformed parameters no longer changes.

        The first set is that at the initial values; it is empty if that vehicle is unstable. After the first estimation
        a parameter may leave it; from then on the set only grows.
        """
        problem = self._problem(self.dataset.logs, {})
        initial = self._initial(problem)
        uninformed = {} if initial.any() else self._uninformed(problem, initial, noise_only=True)
        for attempt in itertools.count():
            problem = self._problem(problem.logs, uninformed)
            minimum = self._minimise(problem, progress)
            latest = self._uninformed(problem, minimum.z)
            if attempt:
                latest = uninformed | latest
            if set(latest) == set(uninformed):
                break
            uninformed = latest
        return _Solution(problem=problem, minimum=minimum, uninformed=latest)

    def _problem(self, logs: Sequence[LogData], uninformed: Mapping[str, Verdict]) -> Problem:
        """The problem in which uninformed parameters are considered, at the value of the vehicle file."""
        given = self.dataset.vehicle.parameters()
        unknowns = [
            replace(u, centre=given[u.name], considered=True) if u.name in uninformed else u
            for u in parameters.one_stage_unknowns(self.dataset.vehicle, self.outputs, self.settings)
        ]
        time_bases = {name: base for record in self.dataset.records for name, base in record.time_bases.items()}
        main = time_bases.get(self.dataset.vehicle.steer_signals()[0], "")
        unknowns += parameters.time_base_delays(time_bases, main, self.outputs, self.settings)
        unknowns += parameters.suspects() if self.settings.consider else []
        return Problem(self.model, self.dataset.vehicle, logs, unknowns, self.settings)

    def _uninformed(self, problem: Problem, z: Array, *, noise_only: bool = False) -> dict[str, Verdict]:
        """Estimated parameters that the logs do not determine, by the information that the inputs excite.

        The estimated initial states are set to their prior means: along them the noise of the sensors would look like
        excitation.

        Args:
            noise_only: without the effect of the considered unknowns. Far from the solution the vehicle may be close
                to instability, and that effect then says nothing about the logs.
        """
        excited_by_inputs = z.copy()
        for segments in problem.layout.initial_states:
            for indices in segments:
                excited_by_inputs[indices] = 0.0
        information = problem.expand(excited_by_inputs, directions="all").hessian - np.eye(len(z))
        considered = [name for name in problem.considered if name not in self.estimated]
        omitted = considered if noise_only else []
        information = _without([*problem.suspects, *map(problem.names.index, omitted)], information)
        posterior = Posterior.from_information(
            problem.names, information, considered=considered, nuisances=problem.nuisances
        )
        return uninformed_parameters(posterior, self.estimated, self.outputs, self.settings.excited)

    def _initial(self, problem: Problem) -> Array:
        """The prior means; if that vehicle is unstable, with stiffer tyres on all axle groups behind the first."""
        z = np.zeros(len(problem.names))
        _, *others = [f"{path}.cornering_stiffness" for path in parameters.group_paths(self.dataset.vehicle)]
        indices = [i for i, name in enumerate(problem.names) if name in others]
        while problem.unstable(z) and indices and z[indices[0]] < problem.bounds[1][indices[0]]:
            z[indices] += STIFFENING
        return z

    def _minimise(self, problem: Problem, progress: Progress) -> Minimum:
        """The maximum of the posterior.

        With adapted noise in several phases: the first takes residuals as white and updates the noise at every step;
        each of the others fits the noise model to the residuals of the phase before, and keeps it.
        """
        bounds, z = problem.bounds, self._initial(problem)
        white = functools.partial(problem.update_noise, autocorrelated=False)
        phases: list[tuple[str, Callable[[Array], None], float]] = [("fit", _keep_noise, ROUND_TOLERANCES[-1])]
        if self.settings.adapt_noise:
            phases = [("fit", white, WHITE_TOLERANCE)]
            tolerances = ROUND_TOLERANCES if problem.output_error else ROUND_TOLERANCES[-1:]
            phases += [("fit with estimated noise", _keep_noise, tolerance) for tolerance in tolerances]
        for number, (title, accept, tolerance) in enumerate(phases):
            lower, upper = bounds
            if number:
                problem.update_noise(z, autocorrelated=True)
            elif len(phases) > 1:  # far from the solution the errors of gyros would absorb those of the parameters
                late = np.array([is_sensor_error(name) and not _is_early(name) for name in problem.names])
                lower, upper = (np.where(late, 0.0, bound) for bound in bounds)
            minimum = minimise(
                problem.expand,
                problem.cost,
                accept,
                z,
                lower=lower,
                upper=upper,
                iterations=self.settings.iterations if number == len(phases) - 1 else EARLY_ITERATIONS,
                tolerance=tolerance,
                progress=functools.partial(progress, title),
            )
            z = minimum.z
            progress(title, self.settings.iterations, self.settings.iterations)
        return minimum


def _is_early(name: str) -> bool:
    """Whether a sensor error is estimated from the first fit on: offsets, and gain and delay of the steering."""
    steer = SignalName.of(name).quantity == "steer"
    return is_sensor_error(name, "offset") or (steer and not is_sensor_error(name, "play"))


def _keep_noise(_: Array) -> None:
    """The noise stays as it is when a step is accepted."""


def _without(indices: Sequence[int], information: Array) -> Array:
    """The information matrix (k, k) with zeros for some unknowns."""
    reduced = information.copy()
    reduced[list(indices), :] = 0.0
    reduced[:, list(indices)] = 0.0
    return reduced


def _posterior(
    estimator: _Estimator, problem: Problem, z: Array
) -> tuple[Posterior, ParameterHistory, list[ScoreTest]]:
    """The posterior at z, how it would have developed sample after sample, linearised at z, and the score tests."""
    settings, k, considered = estimator.settings, len(problem.names), problem.considered
    information, score_covariance, gradient = np.zeros((k, k)), np.zeros((k, k)), np.zeros(k)
    free = np.array([name not in considered for name in problem.names])
    rows = [problem.names.index(name) for name in estimator.estimated]
    length = max(sum(len(s.time) for log in problem.logs for s in log.segments) // HISTORY_LENGTH, 1)
    elapsed, time, values, sigmas = 0.0, [], [], []
    for i, j in problem.segments():
        segment, scores = problem.logs[i].segments[j], []
        for block in problem.blocks(z, i, j):
            for piece in block.split(length):
                piece_gradient, piece_information = likelihood.gradient_and_information(piece, settings.outlier)
                information[np.ix_(piece.indices, piece.indices)] += piece_information
                gradient[piece.indices] += piece_gradient
                P = np.linalg.inv(np.eye(k) + information * np.outer(free, free))
                values.append((z - free * (P @ (free * (z + gradient))))[rows])
                sigmas.append(np.sqrt(np.diag(P))[rows])
                time.append(elapsed + piece.time[-1] - segment.time[0])
            scores.append(likelihood.scores(block, settings.outlier))
        elapsed = time[-1]
        lags = max(int(settings.correlation_time * segment.rate), 1)
        score_covariance[np.ix_(block.indices, block.indices)] += long_run_covariance(np.concatenate(scores), lags)
    scale = parameters.scaling([u for u in problem.unknowns if u.name in estimator.estimated])
    p = scale.to_p(np.array(values))
    history = ParameterHistory(
        names=estimator.estimated,
        time=np.array(time),
        values=p,
        sigma=np.array(sigmas) * np.abs(scale.slope(p)),
        starts=(0,),
    )
    tests = score_tests(problem.names, gradient, information, considered)
    posterior = Posterior.from_information(
        problem.names,
        _without(problem.suspects, information),
        score_covariance,
        considered=considered,
        nuisances=problem.nuisances,
    )
    return posterior, history, tests


def _doubts(
    estimator: _Estimator, problem: Problem, z: Array, posterior: Posterior, tests: Sequence[ScoreTest]
) -> list[Doubt]:
    """What the logs say against the assumptions, and which estimates depend on them."""
    unknowns = {name: u for i in range(len(problem.logs)) for name, u in _unknown_names(problem, i)}
    places = [(i, name) for i, name in enumerate(problem.names) if name in estimator.estimated]

    def moved(shifts: Array) -> tuple[str, ...]:
        return tuple(name for i, name in places if abs(shifts[i]) > HARMFUL_SHIFT * posterior.sigma[i])

    def cause(name: str, change: float) -> Cause:
        unknown = unknowns[name]
        changes = {path: rate * unknown.scale * change for path, rate in unknown.slopes.items()}
        return Cause(name=name, changes=changes, prior_sigmas=change)

    doubts = []
    if likely := most_likely(tests):
        strong = abs(likely[0].statistic) > STRONG_SCORE
        concerned = estimator.estimated if strong else [name for t in likely for name in moved(t.shifts)]
        doubts.append(
            Doubt(
                kind=DoubtKind.ASSUMPTION,
                causes=tuple(cause(t.name, t.implied) for t in likely),
                parameters=tuple(dict.fromkeys(concerned)),
                statistic=abs(likely[0].statistic),
            )
        )
    for i, name in enumerate(problem.names):
        deviation = float(z[i])
        if name not in unknowns or unknowns[name].considered:
            continue
        if unknowns[name].nuisance and abs(deviation) > UNUSUAL_SENSOR_ERROR:
            kind, parameters = (
                DoubtKind.SENSOR,
                moved(posterior.covariance[:, i] / posterior.covariance[i, i] * deviation),
            )
        elif unknowns[name].logarithmic and abs(deviation) > UNUSUAL_ESTIMATE:
            kind, parameters = DoubtKind.ESTIMATE, (name,)
        else:
            continue
        doubts.append(
            Doubt(kind=kind, causes=(cause(name, deviation),), parameters=parameters, statistic=abs(deviation))
        )
    first = estimator.dataset.vehicle.units[0].name
    for log, record in zip(problem.logs, estimator.dataset.records, strict=True):
        offset = log.errors.get(f"yaw_rate.{first}.offset", 0.0)
        largest = largest_lateral_acceleration(record, first, offset=offset, min_speed=estimator.settings.min_speed)
        if largest > NONLINEAR_ACCELERATION:
            doubts.append(
                Doubt(
                    kind=DoubtKind.RANGE, causes=(), parameters=estimator.estimated, statistic=largest, log=record.name
                )
            )
    return doubts


def _unknown_names(problem: Problem, log: int) -> Iterator[tuple[str, Unknown]]:
    """The unknowns of a log by their names in z."""
    for u, index in zip(problem.unknowns, problem.layout.unknowns[log], strict=True):
        yield problem.names[index], u


def _identification(estimator: _Estimator, solution: _Solution) -> Identification:
    """The result: estimates with sigma and verdict, sensor errors, fits of all logs."""
    dataset, settings, outputs = estimator.dataset, estimator.settings, estimator.outputs
    problem, minimum = solution.problem, solution.minimum
    posterior, history, tests = _posterior(estimator, problem, minimum.z)
    doubts = _doubts(estimator, problem, minimum.z, posterior, tests)
    doubtful = {name for doubt in doubts for name in doubt.parameters}
    given = dataset.initial_vehicle.parameters()
    shared, sigma = problem.values(minimum.z, 0), dict(zip(posterior.names, posterior.sigma.tolist(), strict=True))
    logs = [replace(log, errors=_own_errors(problem, minimum.z, i)) for i, log in enumerate(problem.logs)]
    file_unknowns = [u for u in problem.unknowns if not u.nuisance and not u.moves and u.name in given]
    vehicle_values = {u.name: shared[u.name] for u in file_unknowns}
    sensor_errors = [u for u in problem.unknowns if u.nuisance and not u.considered]
    shared_errors = {u.name: shared[u.name] for u in sensor_errors if not u.per_log}
    evaluation = evaluate_fits(
        dataset,
        logs,
        dynamics.model(dataset.vehicle, outputs, roll=True, bank=estimator.model.bank),
        dataset.vehicle.replace(vehicle_values),
        problem.unknowns,
        shared_errors,
        settings,
    )
    converged = minimum.converged and evaluation.trusted
    estimated, uncertain = [], []
    for u in file_unknowns:
        if u.name in estimator.estimated:
            estimated.append(
                _estimate(estimator, solution, posterior, history, u, shared[u.name], converged, u.name in doubtful)
            )
        else:
            uncertain.append(_uncertain_estimate(u, shared[u.name], sigma[u.name], settings))
    fixed = parameters.expand_names(dataset.vehicle, settings.fixed)
    estimated += [estimates.fixed_estimate(name, given[name]) for name in fixed]
    vehicle = dataset.identified_vehicle(vehicle_values)
    covariance = _covariance(problem, minimum, posterior)
    return Identification(
        method="one-stage",
        vehicle=vehicle,
        initial_vehicle=dataset.initial_vehicle,
        parameters=tuple(estimated),
        derived=tuple(estimates.derived_from_covariance(dataset.initial_vehicle, vehicle, estimated, covariance)),
        sensors=tuple(estimates.sensor_error_estimates(sensor_errors, logs, shared, sigma)),
        uncertain=tuple(uncertain),
        covariance=covariance,
        doubts=tuple(doubts),
        variance_budget=_variance_budget(problem, posterior, estimator.estimated),
        histories={"one stage": history},
        logs=tuple(_summary(estimator, problem, minimum, posterior, i) for i in range(len(logs))),
        fits=evaluation.fits,
        settings=settings,
        rounds=minimum.steps,
        notes=tuple(dict.fromkeys((*dataset.notes, *evaluation.notes))),
        version=fifthwheel.__version__,
    )


def _own_errors(problem: Problem, z: Array, log: int) -> dict[str, float]:
    """Sensor errors that belong to one log, SI."""
    values = problem.values(z, log)
    return {u.name: values[u.name] for u in problem.unknowns if u.per_log}


def _estimate(
    estimator: _Estimator,
    solution: _Solution,
    posterior: Posterior,
    history: ParameterHistory,
    unknown: Unknown,
    value: float,
    converged: bool,
    doubtful: bool,
) -> Estimate:
    """The estimate of an estimated parameter."""
    name, settings = unknown.name, estimator.settings
    sigma_z = float(posterior.sigma[posterior.names.index(name)])
    uninformed = solution.uninformed.get(name)
    sigma = sigma_z * unknown.slope(value)
    verdict = uninformed or estimate_verdict(unknown, value, sigma, converged=converged, doubtful=doubtful)
    settled = None if uninformed else history.settled_row(name, settings.tolerance)
    return estimates.parameter_estimate(
        unknown,
        value,
        sigma_z,
        verdict,
        settling_time=None if settled is None else float(history.time[settled]),
        correlated_with=_correlated(estimator, posterior, name, verdict),
    )


def _correlated(estimator: _Estimator, posterior: Posterior, name: str, verdict: Verdict) -> tuple[str, ...]:
    """Unknowns from which a parameter is hardly separable; initial states are left out.

    A parameter that is not identifiable although its conditional sigma is small has at least one.
    """
    if parameters.lacks_roll_rate(name, estimator.outputs):
        return ()
    i, single_log = posterior.names.index(name), len(estimator.dataset.logs) == 1
    names = [_without_number(posterior.names[j], single_log) for j in posterior.correlated(i)]
    names = [other for other in names if other not in estimator.model.states]
    confounded = verdict is Verdict.NOT_IDENTIFIABLE and posterior.conditional_sigma(i) < estimator.settings.excited
    if confounded and not names:
        names = [_without_number(posterior.names[posterior.most_limiting(i)], single_log)]
    return tuple(names)


def _without_number(name: str, single_log: bool) -> str:
    """The name of an unknown without the number of its log if there is only one; of an initial state without that of
    its segment."""
    base, number = split_log(name)
    return base if single_log or (number is not None and "." in number) else name


def _uncertain_estimate(unknown: Unknown, value: float, sigma_z: float, settings: OneStage) -> Estimate:
    """The estimate of an uncertain or considered parameter."""
    informed = sigma_z < settings.excited
    verdict = Verdict.FIXED if unknown.considered else Verdict.CONVERGED if informed else Verdict.NOT_EXCITED
    return estimates.parameter_estimate(unknown, value, sigma_z, verdict)


def _summary(estimator: _Estimator, problem: Problem, minimum: Minimum, posterior: Posterior, i: int) -> LogSummary:
    """What was used of log i; with the bank of its first segment if it is estimated."""
    log, bank = problem.logs[i], None
    blocks = [b for j in range(len(log.segments)) for b in problem.residuals(minimum.z, i, j)]
    sizes = np.concatenate([np.abs(block.error) / np.sqrt(block.variance) for block in blocks])
    accepted = (sizes <= estimator.settings.gate).astype(float)
    if estimator.model.bank and problem.output_error:
        index, prior = problem.layout.initial_states[i][0][-1], estimator.settings.bank_prior
        bank = float(minimum.z[index] * prior), float(posterior.sigma[index] * prior)
    summary = estimates.log_summary(estimator.dataset.records[i], log, estimator.outputs, accepted)
    return replace(summary, bank=bank)


def _covariance(problem: Problem, minimum: Minimum, posterior: Posterior) -> Uncertainty:
    """Joint covariance of the parameters of the vehicle and of the sensor errors, SI.

    The sensor errors of log i have the names "name@log". Those of any other log, "name@", have their prior. A
    considered change of the vehicle file contributes to every parameter that it alters.
    """
    known = dynamics.all_parameters(problem.vehicle, problem.model.outputs)  # by an observer
    rows: dict[str, Array] = {}
    for i, log in enumerate(problem.logs):
        values = problem.values(minimum.z, i)
        slopes = problem.scaling.slope(np.array([values[u.name] for u in problem.unknowns]))
        for u, index, slope in zip(problem.unknowns, problem.layout.unknowns[i], slopes, strict=True):
            if i == 0 or u.per_log:
                for name, factor in u.slopes.items():
                    if name in known:
                        row = rows.setdefault(f"{name}@{log.name}" if u.per_log else name, np.zeros(len(problem.names)))
                        row[index] += slope * factor
    others = [u for u in problem.unknowns if u.per_log]
    map_to_si = np.array(list(rows.values())).reshape(len(rows), len(problem.names))
    of_logs = map_to_si @ posterior.covariance @ map_to_si.T
    k = len(rows)
    covariance = np.diag([*[0.0] * k, *[u.scale**2 for u in others]])
    covariance[:k, :k] = (of_logs + of_logs.T) / 2
    return Uncertainty(names=(*rows, *[f"{u.name}@" for u in others]), covariance=covariance)


def _variance_budget(problem: Problem, posterior: Posterior, estimated: Sequence[str]) -> dict[str, dict[str, float]]:
    """For each estimated parameter the fraction of its variance that each considered unknown causes.

    The squared correlation: considered unknowns keep their prior, and the estimate depends on them linearly.
    """
    P, names = posterior.covariance, posterior.names
    sources = [(name, names.index(name)) for name in problem.considered]
    budget = {}
    for i, name in ((names.index(name), name) for name in estimated):
        fractions = {source: float(P[i, j] ** 2 / (P[i, i] * P[j, j])) for source, j in sources if i != j}
        budget[name] = dict(sorted(fractions.items(), key=lambda item: -item[1]))
    return budget
