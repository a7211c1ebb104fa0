"""Runs of a vehicle and its logs: identification, states, design of a test run, estimators to export."""

import json
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

import fifthwheel
from fifthwheel.apps.workflow.start import Note, Start
from fifthwheel.base.errors import FifthwheelError, SignalError, VehicleError, suggestion
from fifthwheel.base.formatting import with_sigma
from fifthwheel.base.options import ObserverOptions
from fifthwheel.base.spelling import setting
from fifthwheel.data.channels.sensors import SensorPrior
from fifthwheel.data.checks import raise_errors
from fifthwheel.data.record import Record
from fifthwheel.estimate.filters.relinearised import RelinearisationSettings
from fifthwheel.estimate.identify import CommonSettings, Identification, OneStage, Verdict, identify
from fifthwheel.estimate.identify.given import require_signals, with_sensors
from fifthwheel.estimate.identify.knowledge.information import Occasion
from fifthwheel.estimate.identify.knowledge.knowledge import Knowledge
from fifthwheel.estimate.identify.one_stage.prior import Earlier, nothing
from fifthwheel.estimate.identify.sensor_errors import log_sensors
from fifthwheel.estimate.identify.settings import Progress
from fifthwheel.estimate.observe import Observer, ObserverSettings, States, Status, Uncertainty
from fifthwheel.estimate.online import Learner, LearnerSettings
from fifthwheel.estimate.time_bases import check_signals
from fifthwheel.results.assess import Assessment, assess
from fifthwheel.results.report import Conclusion, conclude_identification, conclude_states
from fifthwheel.truck import Vehicle
from fifthwheel.truck.quantities import FRICTION

if TYPE_CHECKING:
    from fifthwheel.estimate.design import ExperimentDesign
    from fifthwheel.estimate.design.assess import InformationAssessment


@dataclass(frozen=True, kw_only=True)
class IdentificationRun:
    """An identification and what follows from it."""

    records: tuple[Record, ...]
    """Those of the identification, then those that are only predicted."""
    identification: Identification
    states: tuple[States, ...]
    """Of every record, in the same order."""
    outlook: "InformationAssessment | None"
    """What would improve the estimates; None where they are good, or where it cannot be predicted."""
    conclusion: Conclusion
    performance: Assessment | None = None
    """What the identified truck does, by the cheap measures; None if none of them exists."""
    note: Note | None = None

    def as_dict(self) -> dict[str, Any]:
        """Contents of identification.json."""
        contents: dict[str, Any] = json.loads(self.identification.to_json())
        note = {} if self.note is None else {"note": asdict(self.note)}
        return contents | {"conclusion": self.conclusion.as_dict()} | note


def run_identification(
    records: Sequence[Record],
    vehicle: Vehicle,
    settings: CommonSettings | None = None,
    *,
    knowledge: Knowledge | None = None,
    occasion: Occasion | None = None,
    validate: Sequence[Record] = (),
    progress: Progress = lambda *_: None,
) -> IdentificationRun:
    """Identify a vehicle, then estimate the states of every record, assess what would help, and conclude.

    Arguments and errors are those of `identify`; `validate` are logs that are only predicted.
    """
    require_signals(settings, *records)
    identification = identify(
        records, vehicle, settings, knowledge=knowledge, occasion=occasion, validate=validate, progress=progress
    )
    outlook = _assess_remedies(identification, records, occasion or Occasion())
    everything = (*records, *validate)
    progress("states", 0, len(everything))
    states = []
    for i, record in enumerate(everything):
        states.append(_estimate_states(identification, record))
        progress("states", i + 1, len(everything))
    validated = [_validation(identification, record, occasion or Occasion()) for record in validate]
    performance = None
    with suppress(FifthwheelError):
        performance = assess(identification, cheap=True)
    return IdentificationRun(
        records=everything,
        identification=identification,
        states=tuple(states),
        outlook=outlook,
        conclusion=conclude_identification(
            identification, everything, outlook, states, [result for result in validated if result]
        ),
        performance=performance,
    )


def run_loads(
    starts: Sequence[Start],
    records: Mapping[Path, Record],
    *,
    validate: Sequence[Record] = (),
    progress: Progress = lambda *_: None,
) -> list[IdentificationRun]:
    """Identify the logs of each load after those of the loads before it, and begin with their information.

    Args:
        starts: as of `starts_of`.
        records: of every log of the starts by its path.
        validate: logs with the last load that are only predicted.
    """
    runs, knowledge = list[IdentificationRun](), starts[0].knowledge
    for start in starts:
        run = run_identification(
            [records[path] for path in start.logs],
            start.vehicle,
            start.settings,
            knowledge=knowledge,
            occasion=start.occasion,
            validate=validate if start is starts[-1] else (),
            progress=progress,
        )
        runs.append(replace(run, note=start.note))
        knowledge = run.identification.knowledge
    return runs


def _validation(identification: Identification, record: Record, occasion: Occasion) -> Identification | None:
    """A validation log identified with the knowledge of the others; None in two stages, or if it does not suffice."""
    known = any(e.verdict is Verdict.CONVERGED for e in identification.parameters)
    if identification.knowledge is None or not known:
        return None
    try:
        return identify(
            [record],
            identification.initial_vehicle,
            identification.settings,
            knowledge=identification.knowledge,
            occasion=occasion,
        )
    except FifthwheelError:
        return None


def _estimate_states(identification: Identification, record: Record) -> States:
    """States of a record; two stages give no uncertainty, and their sensor errors hold for a predicted log too."""
    vehicle, settings, uncertainty = identification.vehicle, identification.sensor_settings(record.name), None
    if identification.covariance is not None:
        settings, uncertainty, _ = log_sensors(identification, record, vehicle)
    return Observer(vehicle, record.signals, ObserverSettings(**settings)).batch(record, uncertainty)


def _assess_remedies(
    identification: Identification, records: Sequence[Record], occasion: Occasion
) -> "InformationAssessment | None":
    """What would improve the estimates, predicted at the identified vehicle; None where they are good enough."""
    from fifthwheel.estimate.design.assess import AssessmentSettings, predict_sigmas  # slow to import

    settings, assessment = identification.settings.one_stage, AssessmentSettings()
    estimated = [e for e in identification.parameters if e.verdict is not Verdict.FIXED]
    converged = all(e.verdict is Verdict.CONVERGED and e.sigma is not None for e in estimated)
    precise = all(e.relative_sigma <= assessment.enough for e in identification.parameters)
    if settings is None or (converged and precise):
        return None
    try:
        before = (identification.knowledge or Knowledge()).without_records(records)
        given, identified = identification.initial_vehicle, identification.vehicle
        earlier = partial(before.prior, occasion=occasion, given=given)
        return predict_sigmas(
            records,
            identified.with_stated({path: given.stated[path] for path in identified.stated}),  # as before the logs
            settings,
            assessment,
            checked=True,
            earlier=earlier if before.used else nothing,
        )
    except FifthwheelError:
        return None


def design_run(
    vehicle: Vehicle,
    targets: Mapping[str, float] | None = None,
    settings: OneStage | None = None,
    *,
    channels: Sequence[str] = (),
    sensors: Mapping[str, SensorPrior] = MappingProxyType({}),
    speed: float | None = None,
    max_speed: float = 88 / 3.6,
    max_acceleration: float = 1.5,
    earlier: Earlier = nothing,
    progress: Progress = lambda *_: None,
) -> "ExperimentDesign":
    """The shortest test run that reaches all targets; see `estimate.design.design_experiment`.

    Args:
        sensors: what is stated of them by signal, such as `SignalMap.sensors`.
        speed: of the run, m/s; by default the best of the usual ones up to `max_speed`, m/s, or that one.
        max_acceleration: largest lateral acceleration of any unit, m/s^2.
        earlier: as of `predict_sigmas`.
    """
    from fifthwheel.estimate.design import DesignSettings, design_experiment  # slow to import

    settings, planning = with_sensors(vehicle, settings or OneStage(), sensors), DesignSettings().up_to(max_speed)
    planning = replace(planning, speeds=(speed,) if speed else planning.speeds, max_acceleration=max_acceleration)
    return design_experiment(
        vehicle,
        targets,
        settings,
        channels=channels,
        earlier=earlier,
        planning=planning,
        progress=progress,
    )


@dataclass(frozen=True, kw_only=True)
class StatesRun:
    """States of a known vehicle."""

    vehicle: Vehicle
    records: tuple[Record, ...]
    states: tuple[States, ...]
    """Of every record, in the same order."""
    smoothed: bool
    uncertain: tuple[str, ...]
    """Parameters and sensor errors whose uncertainty is in every sigma."""
    conclusion: Conclusion
    notes: tuple[str, ...]
    """Where the sensor errors of a log come from, if not from the identification."""

    def as_dict(self) -> dict[str, Any]:
        """A summary for JSON, without the time series."""
        return {
            "version": fifthwheel.__version__,
            "smoothed": self.smoothed,
            "uncertain": list(self.uncertain),
            "logs": [_summary(states) for states in self.states],
            "conclusion": self.conclusion.as_dict(),
        }


def run_states(
    records: Sequence[Record],
    vehicle: Vehicle,
    settings: ObserverSettings | None = None,
    *,
    identification: Identification | None = None,
    smooth: bool = False,
    check: bool = True,
    progress: Progress = lambda *_: None,
) -> StatesRun:
    """Estimate the states of a known vehicle, usually as identified; a SignalError for a log that cannot be used.

    Args:
        settings: of the observer; an identification replaces its sensor errors and noise, and its friction if that is
            None.
        identification: sensor errors, noise and uncertainty; a log that was not identified on gives its own.
        smooth: use later samples too.
        check: refuse implausible signals.
    """
    settings = settings or ObserverSettings()
    uncertainty = identification.covariance if identification else None
    states, notes = [], []
    friction = None if settings.friction is None else f"{settings.friction:.3g}"
    if identification and friction and identification.friction is None:
        saturating = setting("tyres", "saturating")
        notes.append(f"The identification had linear tyres: identify again with {saturating} or auto.")
    if not identification and (stated := sorted({name for record in records for name in record.sensors})):
        notes.append(
            f"What is stated of the sensors of {', '.join(stated)} is used with {setting('identification')} only."
        )
    for i, record in enumerate(records):
        progress("states", i, len(records))
        if check:
            raise_errors(check_signals(record, vehicle))
        used, own = settings, uncertainty
        if identification:
            sensors = log_sensors(identification, record, vehicle, settings.friction)
            used, own = replace(settings, **sensors.settings), sensors.uncertainty
            friction = _friction(used, own)
            notes += [sensors.note] if sensors.note else []
        observer = Observer(vehicle, record.signals, used)
        states.append((observer.smooth if smooth else observer.batch)(record, own))
    progress("states", len(records), len(records))
    conclusion = conclude_states(states, records, identification)
    if friction is not None:
        note = f"Tyres saturate at a friction of the road of {friction}."
        conclusion = replace(conclusion, notes=(*conclusion.notes, note))
    return StatesRun(
        vehicle=vehicle,
        records=tuple(records),
        states=tuple(states),
        smoothed=smooth,
        uncertain=() if uncertainty is None else uncertainty.names,
        conclusion=conclusion,
        notes=tuple(notes),
    )


def _friction(settings: ObserverSettings, uncertainty: Uncertainty | None) -> str | None:
    """The friction with its sigma if it was estimated; None with linear tyres."""
    if settings.friction is None:
        return None
    if uncertainty is None or FRICTION not in uncertainty.names:
        return f"{settings.friction:.3g}"
    sigma = float(np.sqrt(uncertainty.among([FRICTION]).covariance[0, 0]))
    return with_sigma(settings.friction, sigma, "1")


def _summary(states: States) -> dict[str, Any]:
    fractions = {status.name.lower(): float((states.status == status).mean()) for status in Status}
    return {"name": states.name, "samples": len(states.time), "status": fractions, "states": list(states.values)}


def exported_observer(
    vehicle: Vehicle,
    signals: Sequence[str] | None = None,
    identification: Identification | None = None,
    options: ObserverOptions | None = None,
) -> Observer:
    """The observer that `fifthwheel export` writes.

    Args:
        signals: that the control unit has; by default those of the identification, without one the speed, every steer
            angle of the vehicle, and the yaw rate and the roll rate of every unit.
        identification: for the sensor errors that its logs share, and the noise; not for offsets of one log.

    Raises:
        SignalError: the signals are not sufficient, or an observer of the vehicle does not use one of them.
        VehicleError: no axle of the vehicle is steerable, or the identification is of another vehicle.
    """
    available = _available_signals(vehicle, signals, identification)
    changes = vars(options or ObserverOptions()).copy()
    if changes["friction"] is None:
        del changes["friction"]  # then it is that of the identification
    settings = identification.observer_settings(**changes) if identification else ObserverSettings(**changes)
    observer = Observer(vehicle, available, settings)
    _require_used(signals, (*observer.inputs, *observer.outputs), f"an observer of {vehicle.name}")
    return observer


def exported_learner(
    vehicle: Vehicle,
    signals: Sequence[str] | None = None,
    identification: Identification | None = None,
    *,
    min_speed: float = 5.0,
    passes: int | None = None,
    segment: int | None = None,
) -> Learner:
    """The learner that `fifthwheel export` writes; `signals` and errors are as of `exported_observer`.

    Args:
        vehicle: its numbers are the prior means.
        identification: for signals and settings: what is estimated, considered and fixed, priors and noise. Settings of
            two stages have no effect.
        min_speed: nothing is estimated below it, m/s.
        passes, segment: `max_passes` and `samples` of `RelinearisationSettings`; None for their defaults.
    """
    stored = identification.settings.one_stage if identification is not None else None
    settings = replace(stored or OneStage(tyres="linear"), min_speed=min_speed)
    given = {"max_passes": passes, "samples": segment}
    relinearisation = RelinearisationSettings(**{name: value for name, value in given.items() if value is not None})
    available = _available_signals(vehicle, signals, identification)
    learner = Learner(vehicle, available, settings, learner=LearnerSettings(relinearisation=relinearisation))
    setup = learner.live.setup
    _require_used(signals, (*setup.inputs, *setup.outputs), f"a learner of {vehicle.name}")
    return learner


def _available_signals(
    vehicle: Vehicle, signals: Sequence[str] | None, identification: Identification | None
) -> Sequence[str]:
    """The signals of a control unit; a VehicleError if the identification is of another vehicle."""
    if identification is not None and identification.vehicle.parameters().keys() != vehicle.parameters().keys():
        raise VehicleError(
            f"{vehicle.name}: its units or axles are not those of the identification, which is of "
            f"{identification.vehicle.name}; give the vehicle.toml of the same result"
        )
    rates = [f"{quantity}.{unit.name}" for quantity in ("yaw_rate", "roll_rate") for unit in vehicle.units]
    default = identification.signals if identification is not None else ("speed", *vehicle.steer_signals(), *rates)
    return signals or default


def _require_used(signals: Sequence[str] | None, known: Sequence[str], estimator: str) -> None:
    """A SignalError if a given signal is not among those that an estimator uses."""
    for name in signals or ():
        if name not in known:
            raise SignalError(f"{name}: no signal that {estimator} uses; {suggestion(name, known)}")
