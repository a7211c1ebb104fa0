"""Identification in two stages, as in figure 2 of the article.

    logs, vehicle -> stage 1 (yaw model): cornering stiffnesses, yaw inertia of the trailer
                  -> stage 2 (yaw-roll model): payload height, and with it CoG height (8) and roll inertia (9)
                  -> identified vehicle

The article stops there. Its stage 1 has no roll, which biases the parameters of its own vehicle by 2 to 4 %. By default
both stages are therefore repeated with the yaw-roll model and the latest payload height until no parameter changes, and
steps of Gauss and Newton follow for all unknowns together: rounds creep along directions in which parameters of both
stages and sensor errors act alike, and end before the maximum.
"""

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

import fifthwheel
from fifthwheel.apps.cheng_cebon_2011.dual import dual_step
from fifthwheel.apps.cheng_cebon_2011.posterior import TwoStagePosterior, evaluate_posterior
from fifthwheel.apps.cheng_cebon_2011.problem import DualProblem, parameter_unknowns, sensor_unknowns
from fifthwheel.apps.cheng_cebon_2011.settings import TwoStage
from fifthwheel.apps.cheng_cebon_2011.stage import StageResult, has_changed, run_stage
from fifthwheel.base.errors import SignalError, VehicleError, suggestion
from fifthwheel.base.formatting import enumerated
from fifthwheel.base.names import PAYLOAD_HEIGHT, ParameterPath, ends_with
from fifthwheel.base.native import compile_in_background
from fifthwheel.base.types import Array
from fifthwheel.data.channels import ROLL_RATE, is_of
from fifthwheel.data.record import Record
from fifthwheel.estimate.identify import estimates
from fifthwheel.estimate.identify.dataset import Dataset, LogData, prepare_dataset, unmeasured_units
from fifthwheel.estimate.identify.fits import TYRES_AS_THEY_ARE, evaluate_fits, free_run_fits
from fifthwheel.estimate.identify.given import applied
from fifthwheel.estimate.identify.result.identification import Identification
from fifthwheel.estimate.identify.result.parts import Estimate, Fit, ParameterHistory, is_settled, settled_since
from fifthwheel.estimate.identify.settings import OneStage, Progress
from fifthwheel.estimate.identify.setup import Setup
from fifthwheel.estimate.identify.statement import Statement, applies
from fifthwheel.estimate.identify.unknowns import parameters
from fifthwheel.estimate.identify.unknowns.parameters import known_of
from fifthwheel.estimate.identify.unknowns.unknown import Unknown
from fifthwheel.estimate.identify.verdict import Verdict, estimate_verdict, still_moving
from fifthwheel.model.dynamics import ChainModel
from fifthwheel.truck import Vehicle
from fifthwheel.truck.quantities import DRIVE_AXLE_BRAKING, ROAD_BANK
from fifthwheel.truck.steering import require_no_steering

STEPS = 5
"""Steps of Gauss and Newton at most."""
LARGEST_STEP = 2.0
"""Of an unknown, in standard deviations of its prior."""
SETTLED = 0.1
"""In standard deviations: the last step."""
EXACT_FILE_NOTE = (
    "The two-stage method assumes that all other values of the vehicle file are exact: suspension, roll axes, yaw "
    "inertia of the first unit. Its sigma does not include their uncertainty; the sigma of the one-stage method does."
)
SENSORS_NOTE = (
    "Two stages do not use the sensor classes and the uncertainties that are stated of {}: the sensor errors have the "
    "priors of the settings. Use one stage."
)
CHANNELS_NOTE = (
    "Two stages do not use {}: as in the article, they use yaw rates, articulation angles and roll rates. One stage "
    "uses every channel."
)
ARTICLE_NOTE = (
    "The settings of the article need logs with more than ten lane changes. The sigma of the payload height does not "
    "include the errors of the stiffness from stage 1, which has no roll."
)
NO_STAGE_2_NOTE = "Without stage 2 only the yaw model is used. It has no roll; every sigma includes the possible error."


def identify_two_stage(
    records: Sequence[Record],
    vehicle: Vehicle,
    settings: TwoStage,
    *,
    validate: Sequence[Record] = (),
    progress: Progress = lambda *_: None,
) -> Identification:
    """Identify a vehicle in two stages; arguments and errors as in `identify`."""
    require_no_steering(vehicle.steering, "the identification in two stages")
    vehicle, settings = applied(vehicle, settings)
    dataset = prepare_dataset(records, vehicle, settings, validate)
    for unit in unmeasured_units(dataset.yaw, dataset.vehicle):
        raise SignalError(f"yaw_rate.{unit}: in none of the logs; two stages need it, map it or use one stage")
    estimator = _estimator(dataset, settings)
    for problem in (estimator.yaw, estimator.full):
        compile_in_background(dual_step(problem.model, problem.scaling.logarithmic))
    return _identification(estimator, *estimator.solve(progress))


@dataclass(frozen=True, kw_only=True)
class _State:
    """All that both stages have estimated so far."""

    values: Mapping[str, float]  # of parameters and of sensor errors that all logs share, SI
    logs: tuple[LogData, ...]  # with their own sensor errors and noise
    not_excited: frozenset[str]  # parameters that keep the value of the vehicle file
    rounds: int = 1
    sigma: Mapping[str, float] = field(default_factory=dict)  # of the filter, by parameter, SI
    settled: Mapping[str, bool] = field(default_factory=dict)  # whether a parameter no longer changes
    histories: Mapping[str, ParameterHistory] = field(default_factory=dict)  # by stage
    accepted: tuple[Array, ...] = ()  # of each log in the last stage: (N, m), 1 where a measurement was used

    def after(self, title: str, result: StageResult, settings: TwoStage) -> "_State":
        values, history = dict(result.values), result.history
        sigma, settled = dict(self.sigma), dict(self.settled)
        for i, name in enumerate(history.names):
            sigma[name] = float(history.sigma[-1, i])
            since = settled_since(history.values[:, i], settings.tolerance)
            if settings.average:
                values[name] = float(history.values[since:, i].mean())
            settled[name] = result.settled if settings.restart else is_settled(since, len(history.values))
        if title in self.histories:
            history = self.histories[title].followed_by(history)
        return replace(
            self,
            values=values,
            logs=result.logs,
            sigma=sigma,
            settled=settled,
            histories={**self.histories, title: history},
            accepted=result.accepted,
        )

    def moved(self, problem: DualProblem, change: Mapping[str, float]) -> "_State":
        """The state with the unknowns changed in units of z, within their bounds; those of log i are "name@i"."""
        scale, logs, shared = problem.scaling, list[LogData](), dict[str, float]()
        for i, log in enumerate(self.logs):
            values = problem.values(self.values, log)
            step = [change[f"{u.name}@{i}" if u.per_log else u.name] for u in problem.unknowns]
            p = np.clip(scale.to_p(problem.z(values) + step), scale.lower, scale.upper)
            new = dict(zip(problem.names, p.tolist(), strict=True))
            shared |= {u.name: new[u.name] for u in problem.unknowns if not u.per_log}
            own = {u.name: new[u.name] for u in problem.unknowns if u.per_log}
            logs.append(replace(log, errors={**log.errors, **own}))
        return replace(self, values={**self.values, **shared}, logs=tuple(logs))


@dataclass(frozen=True, kw_only=True)
class _TwoStages:
    """What stays the same during one identification."""

    dataset: Dataset
    notes: tuple[str, ...]
    yaw: DualProblem  # of stage 1, without roll
    full: DualProblem  # with roll; without stage 2 the yaw model

    @property
    def settings(self) -> TwoStage:
        return self.full.settings

    @property
    def estimated(self) -> list[Unknown]:
        return [u for u in self.full.unknowns if not u.is_sensor_error]

    def solve(self, progress: Progress) -> tuple[_State, TwoStagePosterior]:
        """Both stages, again and again until the set of parameters that are not excited no longer changes.

        The first set is that of the yaw model at the initial values. After the first attempt a parameter may leave it;
        from then on the set only grows.
        """
        state = self._initial(frozenset())
        posterior = evaluate_posterior(self.yaw, state.logs, state.values, gated=False)
        not_excited = self._not_excited(posterior)
        for attempt in itertools.count():
            state, posterior = self._refined(self._stages(self._initial(not_excited), progress))
            latest = self._not_excited(posterior)
            if attempt:
                latest |= not_excited
            if latest == not_excited:
                break
            not_excited = latest
        return state, posterior

    def _initial(self, not_excited: frozenset[str]) -> _State:
        given = self.dataset.vehicle.parameters()
        values = {u.name: given[u.name] if u.name in not_excited else u.centre for u in self.estimated}
        channels = (*self.dataset.yaw, *self.dataset.roll)
        vehicle, noise = self.dataset.vehicle, self.settings.R
        logs = tuple(log.with_noise(vehicle, channels, noise) for log in self.dataset.logs)
        return _State(values=values, logs=logs, not_excited=not_excited)

    def _stages(self, state: _State, progress: Progress) -> _State:
        """Stage 1 with the yaw model, stage 2, then both with the yaw-roll model in rounds until nothing changes."""
        state = self._stage(state, "stage 1", self.yaw, self.yaw.names, progress)
        if self.full is self.yaw:
            return state
        roll = [n for n in self.full.names if ends_with(n, PAYLOAD_HEIGHT) or is_of(n, ROLL_RATE)]
        yaw = [n for n in self.full.names if n not in roll]
        state = self._stage(state, "stage 2", self.full, roll, progress)
        while state.rounds < self.settings.rounds:
            before = state.values
            state = replace(state, rounds=state.rounds + 1)
            state = self._stage(state, "stage 1", self.full, yaw, progress)
            state = self._stage(state, "stage 2", self.full, roll, progress)
            settled = {
                name: not has_changed(state.values[name] - before[name], state.values[name], sigma, self.settings)
                for name, sigma in state.sigma.items()
            }
            state = replace(state, settled={**state.settled, **settled})
            if all(state.settled.values()):
                break
        return state

    def _refined(self, state: _State) -> tuple[_State, TwoStagePosterior]:
        """The state after steps of Gauss and Newton, which the article does not have, and its posterior."""
        posterior = evaluate_posterior(self.full, state.logs, state.values)
        for _ in range(STEPS if self.settings.restart else 0):
            step = posterior.next_step(state.not_excited)
            if posterior.unstable or not (np.abs(step) > SETTLED * posterior.sigma).any():
                break
            change = dict(zip(posterior.names, step * min(1.0, LARGEST_STEP / np.abs(step).max()), strict=True))
            state = state.moved(self.full, change)
            posterior = evaluate_posterior(self.full, state.logs, state.values)
        return state, posterior

    def _stage(
        self, state: _State, title: str, problem: DualProblem, active: Sequence[str], progress: Progress
    ) -> _State:
        """One stage; in rounds, one pass."""
        result = run_stage(
            problem,
            state.logs,
            active=[name for name in active if name not in state.not_excited],
            start=state.values,
            passes=self.settings.passes if state.rounds == 1 else 1,
            progress=progress,
            title=title,
        )
        return state.after(title, result, self.settings)

    def _not_excited(self, posterior: TwoStagePosterior) -> frozenset[str]:
        """Estimated parameters that the logs do not determine."""
        limit = self.settings.excited
        return frozenset(u.name for u in self.estimated if not posterior.excited(u.name, limit))

    def sigma_z(self, state: _State, posterior: TwoStagePosterior) -> dict[str, float]:
        """Standard deviations of all unknowns in units of their priors; the sensor errors of log i as "name@i".

        Where stage 1 has run with the yaw model only, those of its parameters include the bias by the missing roll.
        """
        sigma = dict(zip(posterior.names, posterior.sigma.tolist(), strict=True))
        if self.full.roll and state.rounds == 1:
            yaw = evaluate_posterior(self.yaw, state.logs, state.values)
            bias = zip(yaw.names, yaw.bias.tolist(), strict=True)
            of_stage_1 = {u.name for u in self.yaw.unknowns if not u.is_sensor_error}
            sigma |= {name: math.hypot(sigma[name], value) for name, value in bias if name in of_stage_1}
        return sigma


def _require_names(vehicle: Vehicle, model: ChainModel, settings: TwoStage) -> None:
    """Refuse an entry of a covariance that fits no parameter or no state; a truck without payload has no height."""
    names = (*parameters.stage_1_names(vehicle), *parameters.stage_2_names(vehicle), "yaw_inertia", PAYLOAD_HEIGHT)
    for title, known in (("Q_x", model.states), ("Q_p", names), ("P_p", names)):
        for pattern in getattr(settings, title):
            if not any(applies(Statement(name=pattern), name) for name in known):
                raise VehicleError(f"{title}, {pattern}: fits nothing in {vehicle.name}; {suggestion(pattern, known)}")


def _estimator(dataset: Dataset, settings: TwoStage) -> _TwoStages:
    """Unknowns and models of both stages; a VehicleError if nothing is left to estimate or cannot be fixed."""
    vehicle = dataset.vehicle
    notes = [*dataset.notes, EXACT_FILE_NOTE, *([ARTICLE_NOTE] if settings.average else [])]
    if dataset.others:
        notes.append(CHANNELS_NOTE.format(enumerated(dataset.others)))
    if dataset.sensors:
        notes.append(SENSORS_NOTE.format(", ".join(dataset.sensors)))
    stage_1 = parameter_unknowns(vehicle, parameters.stage_1_names(vehicle), settings)
    if not stage_1 and not sensor_unknowns(vehicle, dataset.yaw, settings):
        raise VehicleError("given: everything of stage 1 is exact, so nothing is left; leave one number uncertain")
    heights = []
    for name in parameters.stage_2_names(vehicle):
        unit = ParameterPath.of(name).unit
        if f"roll_rate.{unit}" in dataset.roll:
            heights.append(name)
        else:
            notes.append(f"Stage 2 skipped for {name}: no roll_rate.{unit} in the logs.")
    if not parameters.stage_2_names(vehicle):
        notes.append("Stage 2 skipped: no unit of the vehicle has a payload.")
    stage_2 = parameter_unknowns(vehicle, heights, settings)

    def problem(outputs: Sequence[str], estimated: Sequence[Unknown], *, roll: bool) -> DualProblem:
        unknowns = (*estimated, *sensor_unknowns(vehicle, outputs, settings))
        return DualProblem(vehicle=vehicle, outputs=tuple(outputs), roll=roll, unknowns=unknowns, settings=settings)

    yaw = full = problem(dataset.yaw, stage_1, roll=False)
    if stage_2:
        full = problem((*dataset.yaw, *dataset.roll), [*stage_1, *stage_2], roll=True)
    else:
        notes.append(NO_STAGE_2_NOTE)
    _require_names(vehicle, full.model, settings)
    return _TwoStages(dataset=dataset, notes=tuple(notes), yaw=yaw, full=full)


def free_run_setup(vehicle: Vehicle, outputs: Sequence[str], settings: TwoStage, *, roll: bool) -> Setup:
    """The setup of a vehicle that runs free with the unknowns of two stages: those of the sensors."""
    given = {**settings.given, **TYRES_AS_THEY_ARE, DRIVE_AXLE_BRAKING: "exact", ROAD_BANK: "exact"}
    return Setup.of(vehicle, outputs, OneStage(tyres="linear", roll=roll, given=given))


def _identification(estimator: _TwoStages, state: _State, posterior: TwoStagePosterior) -> Identification:
    """The result: estimates with sigma and verdict, sensor errors, fits of all logs."""
    dataset, problem, sigma_z = estimator.dataset, estimator.full, estimator.sigma_z(state, posterior)
    unknowns, outputs = problem.unknowns, problem.outputs
    vehicle = dataset.vehicle.replace({u.name: state.values[u.name] for u in estimator.estimated})
    shared = {u.name: state.values.get(u.name, u.centre) for u in unknowns if u.is_sensor_error and not u.per_log}
    setup = free_run_setup(vehicle, outputs, estimator.settings, roll=problem.roll)

    def fits_of(log: LogData, identified_on: bool) -> list[Fit]:
        return free_run_fits(setup, log, shared, identified_on=identified_on)

    evaluation = evaluate_fits(dataset, state.logs, fits_of, estimator.settings)
    parameter_estimates = _estimates(estimator, state, posterior, sigma_z, trusted=evaluation.trusted)
    used = zip(dataset.records, state.logs, state.accepted, strict=True)
    summaries = tuple(estimates.log_summary(record, log, outputs, accepted) for record, log, accepted in used)
    return Identification(
        method="two-stage",
        vehicle=dataset.identified_vehicle({e.name: e.value for e in parameter_estimates}),
        initial_vehicle=dataset.initial_vehicle,
        signals=estimates.used_signals(dataset.vehicle, summaries),
        parameters=tuple(parameter_estimates),
        derived=tuple(estimates.derived_from_payload_height(vehicle, parameter_estimates)),
        sensors=tuple(estimates.sensor_error_estimates(unknowns, state.logs, shared, sigma_z)),
        histories=state.histories,
        logs=summaries,
        fits=evaluation.fits,
        settings=estimator.settings,
        rounds=state.rounds,
        findings=estimator.dataset.findings,
        notes=tuple(dict.fromkeys((*estimator.notes, *evaluation.notes))),
        version=fifthwheel.__version__,
    )


def _estimates(
    estimator: _TwoStages, state: _State, posterior: TwoStagePosterior, sigma_z: Mapping[str, float], *, trusted: bool
) -> list[Estimate]:
    """Estimates of all parameters of both stages, also of those that are fixed or have no roll rate."""
    settings, vehicle = estimator.settings, estimator.dataset.initial_vehicle
    given, unknowns = vehicle.parameters(), {u.name: u for u in estimator.estimated}
    result = []
    moving = still_moving(posterior.names, posterior.next_step(state.not_excited), posterior.sigma)
    for name in (*parameters.stage_1_names(vehicle), *parameters.stage_2_names(vehicle)):
        stage = 2 if name in parameters.stage_2_names(vehicle) else 1
        if name not in unknowns:
            exact = known_of(name, given[name], settings, reported=True).exact
            verdict = Verdict.FIXED if exact else Verdict.NOT_EXCITED
            result.append(estimates.fixed_estimate(name, given[name], verdict, stage=stage))
            continue
        unknown, value, sigma, time = unknowns[name], state.values[name], sigma_z[name], None
        if name in state.not_excited:
            value, sigma, initial, verdict = given[name], 1.0, given[name], Verdict.NOT_EXCITED
        else:
            verdict = estimate_verdict(
                unknown, value, sigma, excited=settings.excited, converged=name not in moving, doubtful=not trusted
            )
            initial, time = unknown.centre, _settling_time(state.histories[f"stage {stage}"], name, settings)
        result.append(
            estimates.parameter_estimate(
                unknown, value, sigma, verdict, initial=initial, stage=stage, settling_time=time
            )
        )
    return result


def _settling_time(history: ParameterHistory, name: str, settings: TwoStage) -> float | None:
    """Time until a parameter stays within the tolerance, s, in the last of separate passes; None if it does not."""
    first = history.starts[-1] if settings.restart else 0
    row = history.settled_row(name, settings.tolerance, first=first)
    return None if row is None else float(history.time[first + row] - history.time[first])
