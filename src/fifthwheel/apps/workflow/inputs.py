"""The inputs of a run: the vehicle, the records of its logs, and the signal map that is proposed for a log."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Any

from fifthwheel.base.atomic import recover, write_text
from fifthwheel.base.errors import SignalError, VehicleError, suggestion
from fifthwheel.base.formatting import enumerated
from fifthwheel.data.checks import Fault
from fifthwheel.data.checks.findings import is_gap, uncertain_delay
from fifthwheel.data.logs import SignalMap, read_log
from fifthwheel.data.logs.assemble import assemble
from fifthwheel.data.logs.joined import open_logs
from fifthwheel.data.logs.map_text import as_toml
from fifthwheel.data.logs.propose import MapProposal, propose_map, without_set_units
from fifthwheel.data.logs.source import LogSource
from fifthwheel.data.logs.survey import LogSurvey, survey_log
from fifthwheel.data.record import Record
from fifthwheel.estimate.identify.knowledge.knowledge import Knowledge
from fifthwheel.estimate.identify.settings import Progress
from fifthwheel.estimate.online import Learner
from fifthwheel.estimate.online.start import LEARNER_FILE
from fifthwheel.estimate.time_bases import check_signals
from fifthwheel.truck import Vehicle, catalogue, toml_format

LONGEST_DELAY = 0.25
"""s, of a channel in a proposed map that is not asked."""


def identification_file(name: str) -> Path | None:
    """The identification.json that a folder or a file name stands for; None for a vehicle."""
    path = Path(name)
    return path / "identification.json" if path.is_dir() else path if path.suffix == ".json" else None


def vehicle_file(name: str) -> str:
    """The vehicle.toml of a result folder or of the folder of an identification.json; any other name as given."""
    result = identification_file(name)
    return name if result is None else str(result.with_name("vehicle.toml"))


def vehicle_and_identification(vehicle: str, identification: Path | None = None) -> tuple[str, Path | None]:
    """The file, or name in the catalogue, of a vehicle, and the identification.json that belongs to it.

    A result folder stands for both of its files, unless another identification is given. A VehicleError for a folder
    without a vehicle file.
    """
    result = identification_file(vehicle)
    if result is not None:
        recover(result.parent)
        vehicle = str(_file(vehicle))
    if identification is not None:
        result = identification_file(str(identification)) or identification
    elif result is not None and not result.exists():
        result = None
    return vehicle, result


def read_vehicle(name: str) -> Vehicle:
    """The vehicle of this name in the catalogue, of this file, or of this result folder or identification.json.

    A VehicleError if neither exists, or the file does not describe a vehicle.
    """
    if name in catalogue.names():
        return catalogue.get(name)
    return Vehicle.load(_file(name))


def vehicle_text(name: str) -> str:
    """The vehicle file of this name in the catalogue, or of this path; errors as in `read_vehicle`."""
    if name in catalogue.names():
        return catalogue.text(name)
    return toml_format.read(_file(name))


def _file(name: str) -> Path:
    path = Path(vehicle_file(name))
    if not path.is_file() and Path(name).is_dir():
        raise VehicleError(
            f"{name}: a folder without vehicle.toml; give a vehicle file, or the result folder of `fifthwheel identify`"
        )
    if not path.is_file():
        raise VehicleError(
            f"{name}: no such file, and not in the catalogue, which has {', '.join(catalogue.names())}; check the path"
        )
    return path


def read_records(
    paths: Sequence[Path],
    signal_map: SignalMap | None = None,
    *,
    exclude: Mapping[str, Sequence[tuple[float, float]]] = MappingProxyType({}),
    progress: Progress = lambda *_: None,
) -> list[Record]:
    """The record of each log, named by the file's stem, or by the path where two stems are the same.

    `exclude` are windows that are left out, as of `read_log`, by the name of a record; "" for all records. A
    SignalError for a log that cannot be read, or windows of another one.
    """
    stems = [path.stem for path in paths]
    names = [path.stem if stems.count(path.stem) == 1 else str(path) for path in paths]
    if unknown := sorted(set(exclude) - {"", *names}):
        raise SignalError(
            f"{unknown[0]}: windows are excluded, but there is no such log; {suggestion(unknown[0], names)}"
        )
    return [
        read_log(
            path,
            signal_map,
            name=name,
            exclude=(*exclude.get("", ()), *exclude.get(name, ())),
            progress=partial(report_fraction, progress, f"reading {path.name}"),
        )
        for path, name in zip(paths, names, strict=True)
    ]


def report_fraction(progress: Progress, title: str, fraction: float) -> None:
    """Report a fraction of the work as thousandths."""
    progress(title, round(1000 * fraction), 1000)


def read_knowledge(path: Path) -> Knowledge:
    """The knowledge in a result folder, of its identification.json, of a knowledge.json, or of the file of a learner.

    A SignalError if the file cannot be read, or has no knowledge.
    """
    if not LEARNER_FILE.wrote(path):
        return Knowledge.load(path)
    learned = Learner.load(path).knowledge
    if not learned.logs:
        raise SignalError(f"{path}: the learner has learned nothing since it began; give another result")
    return learned


@dataclass(frozen=True, kw_only=True)
class LogContents:
    """The columns of a log and the proposed map."""

    survey: LogSurvey
    proposal: MapProposal
    signals_toml: str
    """The proposed map as the text of a file."""

    def as_dict(self) -> dict[str, Any]:
        """Columns and map for JSON; a number that is not finite becomes None."""
        columns = [
            {"name": name, "unit": content.column.unit}
            | {key: _finite(value) for key, value in asdict(content).items() if key != "column"}
            for name, content in self.survey.contents.items()
        ]
        return {
            "name": self.survey.name,
            "span": [_finite(self.survey.start), _finite(self.survey.stop)],
            "notes": list(self.survey.notes),
            "columns": columns,
            "missing": list(self.proposal.missing),
            "findings": [str(finding) for finding in self.proposal.findings],
            "signals_toml": self.signals_toml,
        }


def survey_files(
    paths: Sequence[Path],
    vehicle: Vehicle | None = None,
    *,
    databases: Sequence[Path] = (),
    map_file: Path | None = None,
    whole: bool = False,
    progress: Progress = lambda *_: None,
) -> LogContents:
    """Survey the logs of one logger and propose their map; of a large file from a sample, which a note says, unless
    `whole`.

    Args:
        vehicle: gives the names of the units, the wheelbase for the steering ratio, and the expected motion for delays.
        databases: DBC or ARXML files for CAN frames. In the map, those in its folder or below have a relative path.
        map_file: where to write the map.
    """
    folder = (map_file.parent if map_file else Path()).resolve()
    full = [database.resolve() for database in databases]
    named = [database.relative_to(folder) if database.is_relative_to(folder) else database for database in full]
    report = partial(report_fraction, progress, f"reading {enumerated([path.name for path in paths])}")
    with open_logs(paths, databases, report, sample=not whole) as opened:
        survey = survey_log(opened, report)
        contents = propose_signals(opened, survey, vehicle, databases=named)
    if map_file is not None:
        write_text(map_file, contents.signals_toml)
    return contents


def steered_axle(vehicle: Vehicle | None) -> str:
    """The first steerable axle of the first unit."""
    axles = [axle.name for axle in vehicle.units[0].axles if axle.steerable] if vehicle else []
    return axles[0] if axles else "front"


def propose_signals(
    log: LogSource, survey: LogSurvey, vehicle: Vehicle | None = None, *, databases: Sequence[Path] = ()
) -> LogContents:
    """The map proposed for an open log, which is read again; the vehicle is used as in `survey_files`.

    The databases are as the map names them."""
    known: dict[str, Any] = {}
    if vehicle is not None:
        units = [unit.name for unit in vehicle.units]
        known = {"units": units, "steered": steered_axle(vehicle), "wheelbase": vehicle.wheelbase}
    proposal = _with_delays(propose_map(log, survey, databases=databases, **known), log, vehicle)
    return LogContents(survey=survey, proposal=proposal, signals_toml=as_toml(proposal, survey))


def _with_delays(proposal: MapProposal, log: LogSource, vehicle: Vehicle | None = None) -> MapProposal:
    """The proposed map with the delays that the samples show, and the findings of `check_signals`."""
    try:
        record = assemble(log, proposal.signals, name=log.name)
    except SignalError:
        return proposal  # its findings tell why
    channels, reasons = dict(proposal.signals.signals), dict(proposal.reasons)
    findings = without_set_units(check_signals(record, vehicle), proposal.signals, log)
    questions = [*proposal.questions]
    for finding in findings:
        if finding.fault is Fault.TIME_OFFSET:
            late = float(finding.remedy["delay"])
            if abs(late) > LONGEST_DELAY and finding.signal not in record.time_bases:
                problem = f"a delay of {late:.2f} s is proposed, more than channels of one logger have"
                cure = "check first the unit of the speed, the lengths of the vehicle and the columns of both units"
                questions.append(replace(finding, message=f"{problem}; {cure}"))
            for signal in (finding.signal, *finding.others):
                delay = uncertain_delay(late, finding.sigma or 0.0)
                channels[signal] = channels[signal].with_uncertain(delay=delay)
                reasons[signal] += f"; delay by what the other signals predict: {finding.message.partition(';')[0]}"
    return replace(
        proposal,
        signals=proposal.signals.model_copy(update={"signals": channels}),
        reasons=reasons,
        questions=tuple(questions),
        findings=(
            *questions,
            *(f for f in findings if f.fault is not Fault.TIME_OFFSET and not (log.sampled and is_gap(f))),
        ),
    )


def _finite(value: Any) -> Any:
    return None if isinstance(value, float) and not math.isfinite(value) else value
