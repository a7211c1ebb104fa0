"""The logs, the map and the vehicle of a workspace as data; these functions are for `jobs`, because they take long."""

import hashlib
import json
import os
import secrets
import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict
from functools import partial
from pathlib import Path

from pydantic import TypeAdapter

from fifthwheel.apps.app.workspace import HIDDEN, Workspace
from fifthwheel.apps.workflow import SignalEvidence, propose_signals, signal_evidence
from fifthwheel.apps.workflow.inputs import report_fraction
from fifthwheel.base.atomic import try_lock
from fifthwheel.base.errors import FifthwheelError, SignalError
from fifthwheel.data.channels import STEER, is_of
from fifthwheel.data.logs import SignalMap
from fifthwheel.data.logs.files import record_of
from fifthwheel.data.logs.mapping.name_rules import classify_columns
from fifthwheel.data.logs.mapping.survey import LogSurvey, survey_log
from fifthwheel.data.logs.readers import open_log
from fifthwheel.data.logs.stored import StoredLog, store_log
from fifthwheel.data.record import Record
from fifthwheel.estimate.identify.settings import Progress
from fifthwheel.model.simulate import simulate
from fifthwheel.truck import catalogue

_SURVEY = "survey.json"
_PART, _LOCK = ".part", "lock"
EVIDENCE_SPAN = 600.0
"""Longest part of a log that is used to propose and compare signals, s."""


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
