"""The columns of a log, and the signal map that is proposed for it."""

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from fifthwheel.apps.workflow.inputs import report_fraction
from fifthwheel.base.atomic import write_text
from fifthwheel.base.errors import SignalError
from fifthwheel.data.checks import Fault
from fifthwheel.data.checks.findings import is_gap
from fifthwheel.data.logs.assemble import assemble
from fifthwheel.data.logs.map_text import as_toml
from fifthwheel.data.logs.propose import LogSurvey, MapProposal, propose_map, survey_log
from fifthwheel.data.logs.readers import open_log
from fifthwheel.data.logs.source import LogSource
from fifthwheel.estimate.identify.settings import Progress
from fifthwheel.estimate.time_bases import check_signals
from fifthwheel.truck import Vehicle


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


def survey_file(
    path: Path,
    vehicle: Vehicle | None = None,
    *,
    databases: Sequence[Path] = (),
    map_file: Path | None = None,
    whole: bool = False,
    progress: Progress = lambda *_: None,
) -> LogContents:
    """Survey a log and propose a map; of a large file from a sample of it, which a note says.

    Args:
        vehicle: gives the names of the units, the wheelbase for the steering ratio, and the expected motion for delays.
        databases: DBC or ARXML files for CAN frames. In the map, those in its folder or below have a relative path.
        map_file: where to write the map.
        whole: read all of a large file.

    Raises:
        SignalError: the log cannot be read.
    """
    folder = (map_file.parent if map_file else Path()).resolve()
    full = [database.resolve() for database in databases]
    named = [database.relative_to(folder) if database.is_relative_to(folder) else database for database in full]
    report = partial(report_fraction, progress, f"reading {path.name}")
    with open_log(path, databases, report, sample=not whole) as opened:
        survey = survey_log(opened, report)
        contents = propose_signals(opened, survey, vehicle, databases=named)
    if map_file is not None:
        write_text(map_file, contents.signals_toml)
    return contents


def propose_signals(
    log: LogSource, survey: LogSurvey, vehicle: Vehicle | None = None, *, databases: Sequence[Path] = ()
) -> LogContents:
    """The map proposed for an open log, which is read again; the vehicle is used as in `survey_file`, and the databases
    are as the map names them."""
    known: dict[str, Any] = {}
    if vehicle is not None:
        known = {"units": [unit.name for unit in vehicle.units], "wheelbase": vehicle.wheelbase}
    proposal = _with_delays(propose_map(log, survey, databases=databases, **known), log, vehicle)
    return LogContents(survey=survey, proposal=proposal, signals_toml=as_toml(proposal, survey))


def _with_delays(proposal: MapProposal, log: LogSource, vehicle: Vehicle | None = None) -> MapProposal:
    """The proposed map with the delays that the samples show, and the findings of `check_signals`."""
    try:
        record = assemble(log, proposal.signals, name=log.name)
    except SignalError:
        return proposal  # its findings tell why
    channels, reasons = dict(proposal.signals.signals), dict(proposal.reasons)
    findings = check_signals(record, vehicle)
    for finding in findings:
        if finding.fault is Fault.TIME_OFFSET:
            for signal in (finding.signal, *finding.others):
                channels[signal] = channels[signal].model_copy(update=dict(finding.remedy))
                reasons[signal] += f"; delay by what the other signals predict: {finding.message.partition(';')[0]}"
    return replace(
        proposal,
        signals=proposal.signals.model_copy(update={"signals": channels}),
        reasons=reasons,
        findings=tuple(f for f in findings if f.fault is not Fault.TIME_OFFSET and not (log.sampled and is_gap(f))),
    )


def _finite(value: Any) -> Any:
    return None if isinstance(value, float) and not math.isfinite(value) else value
