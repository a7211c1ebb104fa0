"""What the pages compute of the workspace: records of logs, proposals, checks, identifications; for `jobs`."""

import hashlib
import json
import os
import secrets
import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict, replace
from functools import partial
from itertools import cycle
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter

from fifthwheel.apps.app.workspace import CHOICES, HIDDEN, SIGNALS, VEHICLE, Choices, Workspace
from fifthwheel.apps.workflow.inputs import propose_signals, report_fraction
from fifthwheel.apps.workflow.results import IDENTIFICATION_FILES, compare_runs, write_loads
from fifthwheel.apps.workflow.runs import run_loads
from fifthwheel.apps.workflow.start import Note, starts_of
from fifthwheel.base.atomic import one_run, result_folder, try_lock
from fifthwheel.base.errors import FifthwheelError, SignalError, printable
from fifthwheel.base.options import IdentifyOptions
from fifthwheel.base.pages import Document
from fifthwheel.base.plots import Line, Plot
from fifthwheel.base.plots.items import CYCLE
from fifthwheel.base.settings import arguments, options_of
from fifthwheel.data.channels import STEER, is_of
from fifthwheel.data.logs import SignalMap, write_record
from fifthwheel.data.logs.files import record_of
from fifthwheel.data.logs.name_rules import classify_columns
from fifthwheel.data.logs.readers import open_log
from fifthwheel.data.logs.stored import StoredLog, store_log
from fifthwheel.data.logs.survey import LogSurvey, survey_log
from fifthwheel.data.record import Record
from fifthwheel.estimate.design.assess import InformationAssessment, predict_sigmas
from fifthwheel.estimate.identify import Fit, Identification
from fifthwheel.estimate.identify.given import require_signals
from fifthwheel.estimate.identify.knowledge.knowledge import Knowledge
from fifthwheel.estimate.identify.knowledge.storage import IDENTIFICATION, knowledge_file
from fifthwheel.estimate.identify.result.display import fit_panel, prediction
from fifthwheel.estimate.identify.settings import Progress
from fifthwheel.estimate.time_bases.evidence import SignalEvidence, signal_evidence
from fifthwheel.model.simulate import simulate
from fifthwheel.results.diagnose import Comparison, LogPrediction
from fifthwheel.results.report import provenance_of_run
from fifthwheel.results.report.vehicle import truck_history_document
from fifthwheel.truck import Vehicle, catalogue
from fifthwheel.truck.spoken_names import spoken

_SURVEY = "survey.json"
_PART, _LOCK = ".part", "lock"
EVIDENCE_SPAN = 600.0
"""Longest part of a log that is used to propose and compare signals, s."""
EXAMPLE = "cheng_cebon_2011"
"""The published vehicle of the example."""
KNOWLEDGE = "knowledge"
"""The option whose value is an earlier result."""


def stored_folder(workspace: Workspace, name: str) -> Path:
    """Where the samples of a log are stored; another folder when the log, a database or its time column changes."""
    files = [described(path) for path in (workspace.log(name), *workspace.databases())]
    time = workspace.choices().of(name).time
    key = hashlib.sha256(json.dumps({"files": files, "time": time}).encode()).hexdigest()[:16]
    return workspace.folder / HIDDEN / "logs" / f"{name}-{key}"


def is_stored(workspace: Workspace, name: str) -> bool:
    return stored_folder(workspace, name).exists()


def store(folder: Path, name: str, progress: Progress = lambda *_: None) -> None:
    """Read a log, and store its samples and its survey, unless they are there already.

    A SignalError if the log cannot be read, an OSError if there is no space.
    """
    workspace = Workspace(folder)
    final = stored_folder(workspace, name)
    if final.exists():
        return
    final.parent.mkdir(exist_ok=True)
    _remove_old(final)
    with _temporary_folder(final) as temporary:
        report = partial(report_fraction, progress, f"reading {name}")
        with open_log(workspace.log(name), workspace.databases(), report) as log:
            time = workspace.choices().of(name).time
            log.time = time if time in log.columns else None
            store_log(log, temporary, report)
        surveyed = survey_log(StoredLog(temporary), partial(report_fraction, progress, f"surveying {name}"))
        (temporary / _SURVEY).write_text(json.dumps(asdict(surveyed)), encoding="utf-8")
        if not final.exists():  # another process may have read the log meanwhile
            temporary.rename(final)


@contextmanager
def _temporary_folder(final: Path) -> Iterator[Path]:
    """A folder beside the final one, whose lock ends with this process."""
    temporary = final.with_name(f"{secrets.token_hex(8)}{_PART}")
    temporary.mkdir()
    lock = try_lock(temporary / _LOCK)
    try:
        yield temporary
    finally:
        if lock is not None:
            os.close(lock)
        shutil.rmtree(temporary, ignore_errors=True)


def _remove_old(final: Path) -> None:
    """Remove older samples of a log, and what processes have left that were killed."""
    name = final.name.rpartition("-")[0]
    for old in final.parent.iterdir():
        if old.suffix == _PART:
            lock = try_lock(old / _LOCK)
            if lock is not None:
                shutil.rmtree(old, ignore_errors=True)
                os.close(lock)
        elif old.name.rpartition("-")[0] == name:
            shutil.rmtree(old, ignore_errors=True)


def opened(workspace: Workspace, name: str, span: tuple[float, float] | None = None) -> StoredLog:
    """The stored samples of a log, or those of a window; SignalError where it has not been read yet."""
    try:
        return StoredLog(stored_folder(workspace, name), span)
    except OSError:
        raise SignalError(f"{name}: not read yet; open the page Log, which reads it") from None


def survey(workspace: Workspace, name: str) -> LogSurvey:
    path = stored_folder(workspace, name) / _SURVEY
    return TypeAdapter(LogSurvey).validate_json(path.read_bytes())


def record(
    folder: Path, name: str, progress: Progress = lambda *_: None, span: tuple[float, float] | None = None
) -> Record:
    """The record of a log by signals.toml, without the excluded windows, within a span, s; errors as in `read_log`."""
    workspace = Workspace(folder)
    store(folder, name, progress)
    signal_map = workspace.signal_map()
    windows = workspace.choices().of(name).exclude
    log = opened(workspace, name, span)
    stems = [path.stem for path in workspace.logs()]
    stem = workspace.log(name).stem
    return record_of(log, signal_map, name=stem if stems.count(stem) == 1 else name, exclude=windows)


def prepare() -> None:
    truck = catalogue.get("cheng_cebon_2011")
    signal_evidence(simulate(truck, count=1), truck)


def write_example(folder: Path) -> None:
    """Write a simulated log of lane changes, and its truck; its tyres are linear."""
    workspace = Workspace(folder)
    write_record(simulate(catalogue.get(EXAMPLE), count=3), workspace.folder / "logs" / "example.csv")
    choices = workspace.choices().model_copy(update={"identify": {"tyres": "linear"}})
    workspace.write({VEHICLE: catalogue.text(EXAMPLE), CHOICES: choices.text()}, "the example")


def propose(folder: Path, name: str) -> str:
    """The text of the signals.toml that is proposed for a log, by the part of `evidence` if it is long."""
    workspace = Workspace(folder)
    store(folder, name)
    databases = [path.relative_to(workspace.folder) for path in workspace.databases()]
    contents = survey(workspace, name)
    units = {column: content.column.unit for column, content in contents.contents.items() if content.alive}
    steers = [hint.column for hint in classify_columns(units).values() if hint.channel is STEER]
    named = [channel.columns[0] for signal, channel in SignalMap.of_columns(units)[0].items() if is_of(signal, STEER)]
    log = opened(workspace, name, _steered_span(opened(workspace, name), named + steers))
    return propose_signals(log, contents, workspace.vehicle(), databases=databases).signals_toml


def evidence(folder: Path, name: str) -> SignalEvidence:
    """What speaks for signals.toml in a log; of a long log in the minutes in which the truck is steered most."""
    workspace = Workspace(folder)
    store(folder, name)
    signal_map = workspace.signal_map()
    steers = [channel.columns[0] for signal, channel in signal_map.signals.items() if is_of(signal, STEER)]
    span = _steered_span(opened(workspace, name), steers)
    return signal_evidence(record(folder, name, span=span), workspace.vehicle())


def _steered_span(log: StoredLog, columns: Sequence[str]) -> tuple[float, float] | None:
    """The window in which the first of some steer angles varies most; None, which is the whole log, without one."""
    with suppress(SignalError):  # a column that the log does not have is an error of its record
        return log.most_active(log.find(columns[0]), EVIDENCE_SPAN) if columns else None
    return None


def used_logs(workspace: Workspace) -> list[str]:
    choices = workspace.choices()
    return [path.name for path in workspace.logs() if choices.of(path.name).use]


def records(folder: Path, names: Sequence[str] | None = None, progress: Progress = lambda *_: None) -> list[Record]:
    """The records of some logs, by default of those that are used.

    A FifthwheelError if no log is used, or one cannot be used; the message names it.
    """
    chosen = used_logs(Workspace(folder)) if names is None else list(names)
    if not chosen:
        raise FifthwheelError("no log is used; drop one on the page Log, or tick it there")
    return [record(folder, name, progress) for name in chosen]


def described(path: Path) -> tuple[str, int, int]:
    """What identifies the content of a file: name, bytes and time of the last change."""
    content = path.stat()
    return path.name, content.st_size, content.st_mtime_ns


class MissingError(FifthwheelError):
    """Something that another page provides is missing."""

    def __init__(self, message: str, page: str) -> None:
        super().__init__(message)
        self.page = page
        """Name of this page."""


def results(workspace: Workspace) -> list[str]:
    """Names of the results, the newest first."""
    return [path.name for path in workspace.runs() if (path / IDENTIFICATION).is_file()]


def labels(workspace: Workspace) -> dict[str, str]:
    """The results, the newest first: their names, and the names with their notes."""
    found = {}
    for name in results(workspace):
        note = Note.read(workspace.run(name) / IDENTIFICATION)
        found[name] = name if note is None else f"{name}: {printable(str(note))}"
    return found


def interrupted(workspace: Workspace) -> list[str]:
    """Names of result folders without a result: the server was killed while it identified."""
    return [path.name for path in workspace.runs() if not (path / IDENTIFICATION).is_file()]


def discard_empty(folder: Path, name: str) -> None:
    """Remove the folder of a cancelled identification if there is nothing in it but what the identification left."""
    place = folder / "runs" / name
    if place.is_dir() and all(path.name.startswith(".") for path in place.iterdir()):
        shutil.rmtree(place, ignore_errors=True)


def next_name(workspace: Workspace) -> str:
    """The first of run-1, run-2, ... that is not a result."""
    used = results(workspace)
    return next(name for k in range(1, len(used) + 2) if (name := f"run-{k}") not in used)


def options(workspace: Workspace, choices: Choices) -> IdentifyOptions:
    """The choices for the identification; unknown ones, of another version, are left out."""
    known = options_of(IdentifyOptions)
    given: dict[str, Any] = {key: value for key, value in choices.identify.items() if key in known}
    if given.get(KNOWLEDGE):
        given[KNOWLEDGE] = workspace.run(str(given[KNOWLEDGE]))
    return IdentifyOptions(**given)


def vehicle(workspace: Workspace) -> Vehicle:
    """The vehicle; MissingError where there is none yet."""
    found = workspace.vehicle()
    if found is None:
        raise MissingError("There is no vehicle file yet; describe the truck on the page Truck.", "truck")
    return found


def logs(workspace: Workspace, choices: Choices) -> tuple[list[str], list[str]]:
    """Names of the logs to identify on, and of those that are only predicted; MissingError without the first."""
    used, validate = used_logs(workspace), choices.identify.get("validate", ())
    chosen = [name for name in used if name not in validate]
    if not chosen:
        raise MissingError("There is no log to identify on; drop one on the page Log and tick it there.", "log")
    return chosen, [name for name in used if name in validate]


def stamp(workspace: Workspace) -> str:
    """Digest of all that a check or an identification depends on."""
    digest = hashlib.sha256()
    choices = workspace.choices()
    digest.update(repr([workspace.read(SIGNALS), workspace.read(VEHICLE), choices.logs, choices.identify]).encode())
    for path in (*workspace.logs(), *workspace.databases()):
        digest.update(repr(described(path)).encode())
    return digest.hexdigest()


def check(folder: Path, progress: Progress) -> InformationAssessment:
    workspace = Workspace(folder)
    choices, truck = workspace.choices(), vehicle(workspace)
    driven = records(folder, logs(workspace, choices)[0], progress)
    progress("predicting", 0, 0)
    chosen = replace(options(workspace, choices), method="one-stage", passes=None)
    start = starts_of(truck, chosen, [workspace.log(log) for log in logs(workspace, choices)[0]])[-1]
    require_signals(start.settings, *driven)
    return predict_sigmas(driven, start.vehicle, start.one_stage, earlier=start.earlier)


def identify(folder: Path, name: str, progress: Progress) -> str:
    """Identify the vehicle, and write the results to the folder of this name; as `fifthwheel identify`.

    A FifthwheelError if the vehicle, a log or the settings cannot be used, an OSError if the results cannot be written.
    """
    workspace = Workspace(folder)
    choices, truck = workspace.choices(), vehicle(workspace)
    chosen, validate = logs(workspace, choices)
    stated = options(workspace, choices)
    paths = [workspace.log(log) for log in (*chosen, *validate)]
    starts = starts_of(truck, stated, paths[: len(chosen)])
    signals = workspace.folder / SIGNALS
    signals_file = signals if signals.exists() else None
    out = workspace.folder / "runs" / name
    read = [*paths, workspace.folder / VEHICLE, *([signals] if signals_file else [])]
    with result_folder(out, "identify", IDENTIFICATION_FILES, inputs=read, force=False) as temporary:
        driven = records(folder, [*chosen, *validate], progress)
        used = dict(zip(paths, driven, strict=True))
        runs = run_loads(starts, used, validate=driven[len(chosen) :], progress=progress)
        progress("writing the report", 0, 0)
        kept = None if stated.knowledge is None else knowledge_file(stated.knowledge)
        typed = command(workspace, choices, name)
        provenance = provenance_of_run(paths, str(workspace.folder / VEHICLE), signals_file, kept, command=typed)
        text = workspace.read(VEHICLE)
        write_loads(starts, runs, temporary, provenance=provenance, vehicle_text=text, name=name)
    return name


def command(workspace: Workspace, choices: Choices, name: str) -> list[str]:
    """The command line that gives the same result in the folder of the workspace."""
    chosen, validate = logs(workspace, choices)
    words = ["identify", *[f"logs/{log}" for log in chosen], "--vehicle", VEHICLE, "--out", f"runs/{name}"]
    words += ["--signals", SIGNALS] if workspace.read(SIGNALS) is not None else []
    words += [f"--validate=logs/{log}" for log in validate]
    for log in (*chosen, *validate):
        words += [f"--exclude={Path(log).stem}={first:g}..{last:g}" for first, last in choices.of(log).exclude]
    stated = options(workspace, choices)
    if stated.knowledge:
        stated = replace(stated, knowledge=stated.knowledge.relative_to(workspace.folder))
    return words + arguments(stated)


def known_results(workspace: Workspace) -> list[str]:
    """Names of the results with knowledge of their logs, the newest first."""
    return [name for name in results(workspace) if knowledge_file(workspace.run(name)).is_file()]


def history(folder: Path, name: str) -> Document:
    """The history of the truck by the logs of a result and those that it began with."""
    file = knowledge_file(Workspace(folder).run(name))
    with one_run(file):
        return truck_history_document(Knowledge.load(file))


def comparison(folder: Path, names: Sequence[str]) -> Comparison:
    workspace = Workspace(folder)
    return compare_runs([workspace.run(name) for name in names])


def overlay(folder: Path, names: Sequence[str], log: str) -> Plot:
    """Measured signals of a log, and those that each result predicts."""
    workspace = Workspace(folder)
    driven = record(folder, log)
    signals: dict[str, tuple[Fit, list[Line]]] = {}
    for name, colour in zip(names, cycle(CYCLE), strict=False):
        identification = Identification.load(workspace.run(name))
        for fit in LogPrediction.of(driven, identification.vehicle, identification).fits():
            signals.setdefault(fit.signal, (fit, []))[1].append(prediction(fit, name, colour))
    panels = [fit_panel(fit, *lines, title=spoken(signal)) for signal, (fit, lines) in signals.items()]
    return Plot(title=f"Measured and predicted, {log}", panels=panels)
