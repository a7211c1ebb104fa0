"""The files of a run and of an assessment, what they are read from, and several runs side by side."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from fifthwheel.apps.workflow.inputs import identification_file, read_vehicle
from fifthwheel.apps.workflow.runs import IdentificationRun, StatesRun
from fifthwheel.apps.workflow.start import Note, Start
from fifthwheel.base.atomic import one_run, write_json, write_text
from fifthwheel.base.errors import FifthwheelError, VehicleError
from fifthwheel.base.lazy import require
from fifthwheel.base.pages.html import write as write_page
from fifthwheel.base.spelling import setting
from fifthwheel.data.record import Record
from fifthwheel.estimate.identify import Identification
from fifthwheel.estimate.identify.knowledge.storage import KNOWLEDGE
from fifthwheel.estimate.identify.result.storage import read_contents
from fifthwheel.estimate.observe import States, write_states
from fifthwheel.results.assess import Assessment
from fifthwheel.results.diagnose import Comparison, compare
from fifthwheel.results.evaluate import Evaluation, Validation
from fifthwheel.results.report import (
    Provenance,
    StateConditions,
    comparison_page,
    write_assessment_report,
    write_report,
    write_states_report,
)
from fifthwheel.results.report.assessment import TruckEvidence, write_evidence
from fifthwheel.results.report.comparison import write_evaluation_report
from fifthwheel.truck import Vehicle
from fifthwheel.truck.catalogue import edited

ASSESSMENT_FILES = ("assessment.json", "assess.html", "evidence.html")
"""Results of an assessment, besides figures."""
EVALUATION_FILES = ("evaluation.json", "evaluation.html")
"""Results of an evaluation, besides figures."""
VALIDATION_FILES = ("validation.json", "validation.html")
"""Results of a validation, besides figures."""


def read_truck(name: str) -> Vehicle | Identification:
    """The identification in a result folder or of an identification.json, or the vehicle as of `read_vehicle`.

    A SignalError if the identification cannot be read, a VehicleError if neither exists.
    """
    path = identification_file(name)
    if path is not None and Path(name).is_dir() and not path.exists():
        found = "give a vehicle file, or the result folder of `fifthwheel identify`"
        if path.with_name(KNOWLEDGE).exists():
            found = f"give a vehicle file too: {setting('vehicle', 'truck.toml')} {setting('knowledge', name)}"
        raise VehicleError(f"{name}: a folder without identification.json; {found}")
    return read_vehicle(name) if path is None else Identification.load(path)


def write_assessment(
    assessment: Assessment,
    folder: Path,
    *,
    source: Path | None = None,
    identification: Identification | None = None,
    provenance: Provenance | None = None,
    figures: str | None = None,
) -> dict[str, Path]:
    """Write assessment.json, assess.html and evidence.html; arguments, result and errors as of `write_results`.

    `source` is the file of the identification that was assessed, whose conclusion and note are part of the evidence.
    """
    contents, page, sheet = (folder / name for name in ASSESSMENT_FILES)
    evidence = TruckEvidence(
        assessment=assessment,
        identification=identification,
        conclusion=_conclusion(source) if identification and source else (),
        provenance=provenance or Provenance(),
    )
    write_json(contents, evidence.as_dict())
    drawn = write_assessment_report(page, assessment, provenance=provenance, figures=figures)
    write_evidence(sheet, evidence, contents)
    return {name: folder / name for name in (*ASSESSMENT_FILES, *(["figures"] if drawn else []))}


def _conclusion(identification: Path) -> list[str]:
    """What an identification.json concludes, in sentences, and the note of the user."""
    concluded, note = read_contents(identification).get("conclusion"), Note.read(identification)
    kept = concluded if isinstance(concluded, dict) else {}  # a file of `Identification.save` has none
    sentences = [kept.get("headline", ""), *kept.get("cautions", ()), f"Note: {note}" if note else ""]
    return [str(sentence) for sentence in sentences if sentence]


def write_evaluation(
    evaluation: Evaluation | Validation,
    folder: Path,
    *,
    provenance: Provenance | None = None,
    figures: str | None = None,
) -> dict[str, Path]:
    """Write the JSON and HTML file of an evaluation or a validation; else as `write_results`."""
    names = EVALUATION_FILES if isinstance(evaluation, Evaluation) else VALIDATION_FILES
    write_json(folder / names[0], evaluation.as_dict() | _origin(provenance))
    drawn = write_evaluation_report(folder / names[1], evaluation, provenance=provenance, figures=figures)
    return {name: folder / name for name in (*names, *(["figures"] if drawn else []))}


def _origin(provenance: Provenance | None) -> dict[str, Any]:
    return {} if provenance is None else {"provenance": provenance.as_dict()}


STATES_FILES = ("states.json", "states.parquet", "report.html")
"""Results of a run with a known vehicle, besides figures."""
IDENTIFICATION_FILES = ("identification.json", "vehicle.toml", KNOWLEDGE, *STATES_FILES[1:])


def states_writer(path: Path, logs: int) -> Callable[[Sequence[States], Sequence[Record], Path], object] | None:
    """What writes the states of logs to a file; None for a folder. A FifthwheelError if the file cannot be written."""
    if path.suffix not in (".mf4", ".mcap") or path.is_dir():
        return None
    if path.suffix == ".mf4":
        require("asammdf", "mdf")
        from fifthwheel.results.export.mf4 import write_mf4

        return lambda states, _, file: write_mf4(states, file)
    require("mcap_ros2", "mcap")
    from fifthwheel.results.export.ros2 import write_mcap

    if logs > 1:
        raise FifthwheelError(f"{path.name}: {logs} logs, whose times overlap; write a file for each log, or .mf4")
    return lambda states, records, file: write_mcap(states[0], records[0], file)


def write_results(
    run: IdentificationRun | StatesRun,
    folder: Path,
    *,
    provenance: Provenance | None = None,
    figures: str | None = None,
    vehicle_text: str | None = None,
    name: str = "",
) -> dict[str, Path]:
    """Write states.parquet and report.html; of a known vehicle also states.json, and of an identification
    identification.json, vehicle.toml and knowledge.json.

    Args:
        folder: an existing folder.
        provenance: command, input files and versions, for the report and the JSON file.
        figures: "svg", "png" or "pdf" to write every figure of the report into the folder figures.
        vehicle_text: the vehicle file of the identification, whose comments vehicle.toml then has.
        name: of the result, which the report shows behind the name of the vehicle.

    Returns:
        The path of each file or folder by its name.

    Raises:
        FifthwheelError: figures without matplotlib, or of another format.
        OSError: a file cannot be written.
    """
    report = folder / "report.html"
    write_states(run.states, folder / "states.parquet")
    if isinstance(run, StatesRun):
        write_json(folder / STATES_FILES[0], run.as_dict() | _origin(provenance))
        drawn = write_states_report(
            report,
            run.states,
            run.records,
            title=run.vehicle.name,
            name=name,
            conclusion=run.conclusion,
            conditions=StateConditions(smoothed=run.smoothed, uncertain=run.uncertain),
            provenance=provenance,
            figures=figures,
        )
    else:
        noted = provenance and replace(provenance, note="" if run.note is None else str(run.note))
        write_json(folder / "identification.json", run.as_dict() | _origin(provenance))
        vehicle, covariance = _with_assumed(run.identification), run.identification.covariance
        text = vehicle.to_toml() if vehicle_text is None else edited(vehicle_text, vehicle)
        write_text(folder / "vehicle.toml", text)
        if run.identification.knowledge is not None:
            run.identification.knowledge.save(folder / KNOWLEDGE)
        drawn = write_report(
            report,
            run.identification,
            run.records,
            run.states,
            title=vehicle.name,
            name=name,
            conclusion=run.conclusion,
            outlook=run.outlook,
            performance=run.performance,
            conditions=StateConditions(uncertain=() if covariance is None else covariance.names),
            provenance=noted,
            figures=figures,
        )
    names = STATES_FILES if isinstance(run, StatesRun) else IDENTIFICATION_FILES
    written = [name for name in names if (folder / name).exists()]
    return {name: folder / name for name in (*written, *(["figures"] if drawn else []))}


def _with_assumed(identification: Identification) -> Vehicle:
    """The identified vehicle, in which an assumed number that is no estimate remains assumed, with its sigma."""
    before, vehicle = identification.initial_vehicle, identification.vehicle
    kept = before.assumed.keys() & vehicle.parameters().keys() - {e.name for e in identification.parameters}
    stated = {path: before.stated[path] for path in kept & before.stated.keys() - vehicle.stated.keys()}
    assumed = {path: before.assumed[path] for path in before.assumed if path in kept}
    return Vehicle(**vehicle.with_stated(stated).model_dump() | {"assumed": assumed})


def write_loads(
    starts: Sequence[Start],
    runs: Sequence[IdentificationRun],
    folder: Path,
    *,
    provenance: Provenance | None = None,
    figures: str | None = None,
    vehicle_text: str | None = None,
    name: str = "",
) -> dict[str, Path]:
    """Write the results of the last load as `write_results` to an existing folder, those of others to folders in it."""
    common: dict[str, Any] = {"provenance": provenance, "figures": figures}
    written = write_results(runs[-1], folder, vehicle_text=vehicle_text, name=name, **common)
    for start, run in zip(starts[:-1], runs, strict=False):
        part = folder / start.folder
        part.mkdir()
        of_load = write_results(run, part, name=f"{name} {start.folder}".lstrip(), **common)
        written |= {f"{start.folder}/{name}": path for name, path in of_load.items()}
    return written


def compare_runs(folders: Sequence[Path]) -> Comparison:
    """The estimates in result folders, or of files identification.json, with the differences from the first.

    Each has the name of its folder, or the path where two names are the same.

    Raises:
        SignalError: fewer than two, or an identification cannot be read.
        FifthwheelError: a file has changed since the run that wrote it.
    """
    names = [(path if path.is_dir() else path.parent).resolve().name for path in folders]
    runs = {}
    for path, name in zip(folders, names, strict=True):
        file = identification_file(str(path)) or path
        with one_run(file):
            runs[name if names.count(name) == 1 else str(path)] = Identification.load(file)
    return compare(runs)


def write_comparison(comparison: Comparison, *, csv: Path | None = None, html: Path | None = None) -> dict[str, Path]:
    """Write the table as CSV and the page, where a path is given; returns the paths by the names of the files."""
    if csv is not None:
        write_text(csv, comparison.to_csv())
    if html is not None:
        write_page(html, comparison_page(comparison))
    return {path.name: path for path in (csv, html) if path is not None}
