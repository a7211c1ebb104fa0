"""Identification in two stages, as in figure 2 of the article.

    logs, vehicle -> stage 1 (yaw model): cornering stiffnesses, yaw inertia of the trailer
                  -> stage 2 (yaw-roll model): payload height, and with it CoG height (8) and roll inertia (9)
                  -> identified vehicle

The article stops there. Its stage 1 has no roll, which biases the parameters of its own vehicle by 2 to 4 %. By default
both stages are therefore repeated with the yaw-roll model and the latest payload height until no parameter changes.
"""

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import fifthwheel
from fifthwheel import dynamics
from fifthwheel._types import Array
from fifthwheel.channels import ROLL_RATE, is_of
from fifthwheel.cheng_cebon_2011 import dual
from fifthwheel.cheng_cebon_2011.posterior import TwoStagePosterior, evaluate_posterior
from fifthwheel.cheng_cebon_2011.settings import TwoStage
from fifthwheel.cheng_cebon_2011.stage import StageResult, has_changed, run_stage, stage_model
from fifthwheel.cheng_cebon_2011.unknowns import DualUnknown, parameter_unknowns, sensor_unknowns
from fifthwheel.dynamics import ChainModel
from fifthwheel.errors import SignalError, VehicleError
from fifthwheel.identify import estimates
from fifthwheel.identify.dataset import Dataset, LogData, prepare_dataset, unmeasured_units
from fifthwheel.identify.fit_evaluation import evaluate_fits, free_run_fits
from fifthwheel.identify.history import ParameterHistory, is_settled, settled_since
from fifthwheel.identify.result import Estimate, Fit, Identification
from fifthwheel.identify.settings import Progress
from fifthwheel.identify.unknowns import parameters
from fifthwheel.identify.unknowns.unknown import scaling
from fifthwheel.identify.verdict import Verdict, estimate_verdict
from fifthwheel.names import ParameterPath
from fifthwheel.native import compile_in_background
from fifthwheel.record import Record
from fifthwheel.vehicle import Vehicle

EXACT_FILE_NOTE = (
    "The two-stage method assumes that all other values of the vehicle file are exact: suspension, roll axes, yaw "
    "inertia of the first unit. Its sigma does not include their uncertainty; the sigma of the one-stage method does."
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
    dataset = prepare_dataset(records, vehicle, settings, validate)
    for unit in unmeasured_units(dataset.yaw, dataset.vehicle):
        raise SignalError(f"yaw_rate.{unit}: in none of the logs; two stages need it, map it or use one stage")
    estimator = _estimator(dataset, settings)
    for model, unknowns in ((estimator.yaw_model, estimator.yaw_unknowns), (estimator.model, estimator.unknowns)):
        compile_in_background(dual.dual_step(model, scaling(unknowns).logarithmic))
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
        """The state after one more stage."""
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


@dataclass(frozen=True, kw_only=True)
class _Estimator:
    """What stays the same during one identification."""

    dataset: Dataset
    settings: TwoStage
    notes: tuple[str, ...]
    stage_1: tuple[DualUnknown, ...]
    """Parameters of stage 1."""
    stage_2: tuple[DualUnknown, ...]
    """Payload heights that stage 2 estimates."""
    yaw_model: ChainModel
    yaw_unknowns: tuple[DualUnknown, ...]
    model: ChainModel
    """With roll; without stage 2 the yaw model."""
    unknowns: tuple[DualUnknown, ...]
    """Of `model`."""

    def solve(self, progress: Progress) -> tuple[_State, TwoStagePosterior]:
        """Both stages, again and again until the set of parameters that are not excited no longer changes.

        The first set is that of the yaw model at the initial values. After the first attempt a parameter may leave it;
        from then on the set only grows.
        """
        state = self._initial(frozenset())
        posterior = self._posterior(self.yaw_model, self.yaw_unknowns, state, gated=False)
        not_excited = self._not_excited(posterior)
        for attempt in itertools.count():
            state = self._stages(self._initial(not_excited), progress)
            posterior = self._posterior(self.model, self.unknowns, state)
            latest = self._not_excited(posterior)
            if attempt:
                latest |= not_excited
            if latest == not_excited:
                break
            not_excited = latest
        return state, posterior

    def _initial(self, not_excited: frozenset[str]) -> _State:
        """The state before the first stage."""
        given = self.dataset.vehicle.parameters()
        estimated = (*self.stage_1, *self.stage_2)
        values = {u.name: given[u.name] if u.name in not_excited else u.centre for u in estimated}
        channels = (*self.dataset.yaw, *self.dataset.roll)
        vehicle, noise = self.dataset.vehicle, self.settings.noise
        logs = tuple(log.with_noise(vehicle, channels, noise) for log in self.dataset.logs)
        return _State(values=values, logs=logs, not_excited=not_excited)

    def _stages(self, state: _State, progress: Progress) -> _State:
        """Stage 1 with the yaw model, stage 2, then both with the yaw-roll model in rounds until nothing changes."""
        yaw_model, full_model = (self.yaw_model, self.yaw_unknowns), (self.model, self.unknowns)
        state = self._stage(state, "stage 1", *yaw_model, [u.name for u in self.yaw_unknowns], progress)
        if self.model is self.yaw_model:
            return state
        heights = [u.name for u in self.stage_2]
        roll = [u.name for u in self.unknowns if u.name in heights or is_of(u.name, ROLL_RATE)]
        yaw = [u.name for u in self.unknowns if u.name not in roll]
        state = self._stage(state, "stage 2", *full_model, roll, progress)
        while state.rounds < self.settings.rounds:
            before = state.values
            state = replace(state, rounds=state.rounds + 1)
            state = self._stage(state, "stage 1", *full_model, yaw, progress)
            state = self._stage(state, "stage 2", *full_model, roll, progress)
            settled = {
                name: not has_changed(state.values[name] - before[name], state.values[name], sigma, self.settings)
                for name, sigma in state.sigma.items()
            }
            state = replace(state, settled={**state.settled, **settled})
            if all(state.settled.values()):
                break
        return state

    def _stage(
        self,
        state: _State,
        title: str,
        model: ChainModel,
        unknowns: Sequence[DualUnknown],
        active: Sequence[str],
        progress: Progress,
    ) -> _State:
        """One stage; in rounds, one pass."""
        result = run_stage(
            model,
            self.dataset.vehicle,
            state.logs,
            unknowns,
            active=[name for name in active if name not in state.not_excited],
            start=state.values,
            settings=self.settings,
            passes=self.settings.passes if state.rounds == 1 else 1,
            progress=progress,
            title=title,
        )
        return state.after(title, result, self.settings)

    def _posterior(
        self, model: ChainModel, unknowns: Sequence[DualUnknown], state: _State, *, gated: bool = True
    ) -> TwoStagePosterior:
        vehicle, settings = self.dataset.vehicle, self.settings
        return evaluate_posterior(
            model, vehicle, state.logs, unknowns, values=state.values, settings=settings, gated=gated
        )

    def _not_excited(self, posterior: TwoStagePosterior) -> frozenset[str]:
        """Estimated parameters that the logs do not determine."""
        names = [u.name for u in self.unknowns if not u.is_sensor_error]
        return frozenset(name for name in names if not posterior.excited(name, self.settings.excited))

    def sigma_z(self, state: _State, posterior: TwoStagePosterior) -> dict[str, float]:
        """Standard deviations of all unknowns in units of their priors; the sensor errors of log i as "name@i".

        Where stage 1 has run with the yaw model only, those of its parameters include the bias by the missing roll.
        """
        sigma = dict(zip(posterior.names, posterior.sigma.tolist(), strict=True))
        if self.model.roll and state.rounds == 1:
            yaw = self._posterior(self.yaw_model, self.yaw_unknowns, state)
            bias = dict(zip(yaw.names, yaw.bias.tolist(), strict=True))
            sigma |= {u.name: math.hypot(sigma[u.name], bias[u.name]) for u in self.stage_1}
        return sigma


def _estimator(dataset: Dataset, settings: TwoStage) -> _Estimator:
    """Unknowns and models of both stages.

    Raises:
        VehicleError: nothing is left to estimate, or a parameter cannot be fixed.
    """
    vehicle = dataset.vehicle
    notes = [*dataset.notes, EXACT_FILE_NOTE, *([ARTICLE_NOTE] if settings.average else [])]
    stage_1 = parameter_unknowns(vehicle, parameters.stage_1_names(vehicle), settings)
    if not stage_1 and not settings.nuisances:
        raise VehicleError(
            "fixed: every parameter of stage 1 is fixed and no sensor error is estimated, so nothing is left to "
            "estimate; leave one parameter free, or estimate the sensor errors (nuisances)"
        )
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
    yaw_unknowns = [*stage_1, *sensor_unknowns(vehicle, dataset.yaw, settings)]
    yaw_model = stage_model(vehicle, dataset.yaw, yaw_unknowns, roll=False)
    if stage_2:
        outputs = (*dataset.yaw, *dataset.roll)
        unknowns = [*stage_1, *stage_2, *sensor_unknowns(vehicle, outputs, settings)]
        model = stage_model(vehicle, outputs, unknowns, roll=True)
    else:
        unknowns, model = yaw_unknowns, yaw_model
        notes.append(NO_STAGE_2_NOTE)
    return _Estimator(
        dataset=dataset,
        settings=settings,
        notes=tuple(notes),
        stage_1=tuple(stage_1),
        stage_2=tuple(stage_2),
        yaw_model=yaw_model,
        yaw_unknowns=tuple(yaw_unknowns),
        model=model,
        unknowns=tuple(unknowns),
    )


def _identification(estimator: _Estimator, state: _State, posterior: TwoStagePosterior) -> Identification:
    """The result: estimates with sigma and verdict, sensor errors, fits of all logs."""
    dataset, model, sigma_z = estimator.dataset, estimator.model, estimator.sigma_z(state, posterior)
    estimated = (*estimator.stage_1, *estimator.stage_2)
    vehicle = dataset.vehicle.replace({u.name: state.values[u.name] for u in estimated})
    shared = {
        u.name: state.values.get(u.name, u.centre) for u in estimator.unknowns if u.is_sensor_error and not u.per_log
    }
    free_running = dynamics.model(dataset.vehicle, model.outputs, roll=model.roll)

    def fits_of(log: LogData, identified_on: bool) -> list[Fit]:
        return free_run_fits(free_running, vehicle, log, estimator.unknowns, values=shared, identified_on=identified_on)

    evaluation = evaluate_fits(dataset, state.logs, fits_of, estimator.settings)
    parameter_estimates = _estimates(estimator, state, sigma_z, trusted=evaluation.trusted)
    used = zip(dataset.records, state.logs, state.accepted, strict=True)
    summaries = tuple(estimates.log_summary(record, log, model.outputs, accepted) for record, log, accepted in used)
    return Identification(
        method="two-stage",
        vehicle=dataset.identified_vehicle({e.name: e.value for e in parameter_estimates}),
        initial_vehicle=dataset.initial_vehicle,
        signals=estimates.used_signals(dataset.vehicle, summaries),
        parameters=tuple(parameter_estimates),
        derived=tuple(estimates.derived_from_payload_height(vehicle, parameter_estimates)),
        sensors=tuple(estimates.sensor_error_estimates(estimator.unknowns, state.logs, shared, sigma_z)),
        histories=state.histories,
        logs=summaries,
        fits=evaluation.fits,
        settings=estimator.settings,
        rounds=state.rounds,
        notes=tuple(dict.fromkeys((*estimator.notes, *evaluation.notes))),
        version=fifthwheel.__version__,
    )


def _estimates(estimator: _Estimator, state: _State, sigma_z: Mapping[str, float], *, trusted: bool) -> list[Estimate]:
    """Estimates of all parameters of both stages, also of those that are fixed or have no roll rate."""
    settings, vehicle = estimator.settings, estimator.dataset.initial_vehicle
    given, unknowns = vehicle.parameters(), {u.name: u for u in (*estimator.stage_1, *estimator.stage_2)}
    result = []
    for name in (*parameters.stage_1_names(vehicle), *parameters.stage_2_names(vehicle)):
        stage = 2 if name in parameters.stage_2_names(vehicle) else 1
        if name not in unknowns:
            verdict = Verdict.FIXED if name in settings.fixed else Verdict.NOT_EXCITED
            result.append(estimates.fixed_estimate(name, given[name], verdict, stage=stage))
            continue
        unknown, value, sigma, time = unknowns[name], state.values[name], sigma_z[name], None
        if name in state.not_excited:
            value, sigma, initial, verdict = given[name], 1.0, given[name], Verdict.NOT_EXCITED
        else:
            # a sigma above that of the prior is no estimate
            converged = trusted and state.settled.get(name, False) and sigma < 1
            verdict = estimate_verdict(unknown, value, sigma, converged=converged)
            initial, time = unknown.centre, _settling_time(state.histories[f"stage {stage}"], name, settings)
        result.append(
            estimates.parameter_estimate(
                unknown, value, sigma, verdict, initial=initial, stage=stage, settling_time=time
            )
        )
    return result


def _settling_time(history: ParameterHistory, name: str, settings: TwoStage) -> float | None:
    """Time until a parameter stays within the tolerance, s; None if it does not.

    Passes that restart are separate estimations, so the last one counts. Passes that carry on are one run.
    """
    first = history.starts[-1] if settings.restart else 0
    row = history.settled_row(name, settings.tolerance, first=first)
    return None if row is None else float(history.time[first + row] - history.time[first])
