"""Identification of a vehicle, and what follows from it: states, remedies, a conclusion; the design of a test run."""

import json
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from fifthwheel.apps.workflow.note import Note
from fifthwheel.apps.workflow.start import Start
from fifthwheel.base.errors import FifthwheelError
from fifthwheel.data.channels.sensors import SensorPrior
from fifthwheel.data.record import Record
from fifthwheel.estimate.identify import CommonSettings, Identification, OneStage, Verdict, identify
from fifthwheel.estimate.identify.given import require_signals, with_sensors
from fifthwheel.estimate.identify.knowledge.information import Occasion
from fifthwheel.estimate.identify.knowledge.knowledge import Knowledge
from fifthwheel.estimate.identify.one_stage.prior import Earlier, nothing
from fifthwheel.estimate.identify.sensor_errors import log_sensors
from fifthwheel.estimate.identify.settings import Progress
from fifthwheel.estimate.observe import Observer, ObserverSettings, States
from fifthwheel.results.assess import Assessment, assess
from fifthwheel.results.report import Conclusion, conclude_identification
from fifthwheel.truck import Vehicle

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
    assessment: "InformationAssessment | None"
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

    Args:
        records: logs of the vehicle.
        vehicle: prior knowledge of the vehicle; its values are the starting point.
        settings: the method, by default `OneStage()`.
        knowledge, occasion: as of `identify`.
        validate: logs that are only predicted.

    Raises:
        SignalError: a log that cannot be used.
        VehicleError: a parameter of the settings that does not exist or cannot be estimated.
    """
    require_signals(settings, *records)
    identification = identify(
        records, vehicle, settings, knowledge=knowledge, occasion=occasion, validate=validate, progress=progress
    )
    assessment = _assess_remedies(identification, records, occasion or Occasion())
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
        assessment=assessment,
        conclusion=conclude_identification(
            identification, everything, assessment, states, [result for result in validated if result]
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
        speed: of the run, m/s; by default the best of the usual speeds up to `max_speed`, or `max_speed` if all are
            higher.
        max_speed: m/s.
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
