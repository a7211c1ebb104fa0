"""What the pages compute of the workspace: the check, the identification and the comparison; for `jobs`."""

import hashlib
import shutil
from collections.abc import Sequence
from dataclasses import replace
from itertools import cycle
from pathlib import Path
from typing import Any

from fifthwheel.apps.app import inputs
from fifthwheel.apps.app.workspace import SIGNALS, VEHICLE, Choices, Workspace
from fifthwheel.apps.workflow import (
    IDENTIFICATION_FILES,
    IdentifyOptions,
    compare_runs,
    knowledge_file,
    require_signals,
    run_loads,
    starts_of,
    write_loads,
)
from fifthwheel.apps.workflow.note import Note
from fifthwheel.base.atomic import one_run, result_folder
from fifthwheel.base.errors import FifthwheelError, printable
from fifthwheel.base.pages import Document
from fifthwheel.base.plots import Line, Plot
from fifthwheel.base.plots.items import CYCLE
from fifthwheel.base.settings import arguments, options_of
from fifthwheel.estimate.identify import Fit, Identification
from fifthwheel.estimate.identify.design.assess import InformationAssessment, predict_sigmas
from fifthwheel.estimate.identify.knowledge.knowledge import Knowledge
from fifthwheel.estimate.identify.result.display import fit_panel, prediction
from fifthwheel.estimate.identify.settings import Progress
from fifthwheel.results.diagnose import Comparison, LogPrediction
from fifthwheel.results.report import provenance_of_run
from fifthwheel.results.report.knowledge import truck_history_document
from fifthwheel.truck import Vehicle
from fifthwheel.truck.spoken_names import spoken

RESULT = "identification.json"
"""Its presence makes a folder of `runs` a result."""
KNOWLEDGE = "knowledge"
"""The option whose value is an earlier result."""


class MissingError(FifthwheelError):
    """Something that another page provides is missing."""

    def __init__(self, message: str, page: str) -> None:
        super().__init__(message)
        self.page = page
        """Name of this page."""


def results(workspace: Workspace) -> list[str]:
    """Names of the results, the newest first."""
    return [path.name for path in workspace.runs() if (path / RESULT).is_file()]


def labels(workspace: Workspace) -> dict[str, str]:
    """The results, the newest first: their names, and the names with their notes."""
    found = {}
    for name in results(workspace):
        note = Note.read(workspace.run(name) / RESULT)
        found[name] = name if note is None else f"{name}: {printable(str(note))}"
    return found


def interrupted(workspace: Workspace) -> list[str]:
    """Names of result folders without a result: the server was killed while it identified."""
    return [path.name for path in workspace.runs() if not (path / RESULT).is_file()]


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
    used, validate = inputs.used_logs(workspace), choices.identify.get("validate", ())
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
        digest.update(repr(inputs.described(path)).encode())
    return digest.hexdigest()


def check(folder: Path, progress: Progress) -> InformationAssessment:
    workspace = Workspace(folder)
    choices, truck = workspace.choices(), vehicle(workspace)
    records = inputs.records(folder, logs(workspace, choices)[0], progress)
    progress("predicting", 0, 0)
    chosen = replace(options(workspace, choices), method="one-stage", passes=None)
    start = starts_of(truck, chosen, [workspace.log(log) for log in logs(workspace, choices)[0]])[-1]
    require_signals(start.settings, *records)
    return predict_sigmas(records, start.vehicle, start.one_stage, earlier=start.earlier)


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
        records = inputs.records(folder, [*chosen, *validate], progress)
        used = dict(zip(paths, records, strict=True))
        runs = run_loads(starts, used, validate=records[len(chosen) :], progress=progress)
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
    record = inputs.record(folder, log)
    signals: dict[str, tuple[Fit, list[Line]]] = {}
    for name, colour in zip(names, cycle(CYCLE), strict=False):
        identification = Identification.load(workspace.run(name))
        for fit in LogPrediction.of(record, identification.vehicle, identification).fits():
            signals.setdefault(fit.signal, (fit, []))[1].append(prediction(fit, name, colour))
    panels = [fit_panel(fit, *lines, title=spoken(signal)) for signal, (fit, lines) in signals.items()]
    return Plot(title=f"Measured and predicted, {log}", panels=panels)
