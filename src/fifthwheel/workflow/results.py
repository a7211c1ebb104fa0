"""The files of a run."""

import json
from pathlib import Path

from fifthwheel._atomic import atomic_write
from fifthwheel.observe import write_states
from fifthwheel.report import Provenance, StateConditions, write_report
from fifthwheel.vehicle import save
from fifthwheel.workflow.identification import IdentificationRun
from fifthwheel.workflow.states import StatesRun


def write_results(
    run: IdentificationRun | StatesRun,
    folder: Path,
    *,
    provenance: Provenance | None = None,
    figures: str | None = None,
) -> dict[str, Path]:
    """Write states.parquet and report.html; of an identification also identification.json and vehicle.toml.

    Args:
        run: what to write.
        folder: an existing folder.
        provenance: command, input files and versions, for the report.
        figures: "svg", "png" or "pdf" to write every figure of the report into the folder figures.

    Returns:
        The path of each file or folder by its name.

    Raises:
        FifthwheelError: figures without matplotlib, or of another format.
        OSError: a file cannot be written.
    """
    if isinstance(run, IdentificationRun):
        names = ["identification.json", "vehicle.toml", "states.parquet", "report.html"]
        identification, assessment, vehicle = run.identification, run.assessment, run.identification.vehicle
        covariance = identification.covariance
        conditions = StateConditions(uncertain=() if covariance is None else covariance.names)
        with atomic_write(folder / "identification.json") as temporary:
            temporary.write_text(json.dumps(run.as_dict(), indent=2) + "\n", encoding="utf-8")
        save(vehicle, folder / "vehicle.toml")
    else:
        names = ["states.parquet", "report.html"]
        identification, assessment, vehicle = None, None, run.vehicle
        conditions = StateConditions(smoothed=run.smoothed, uncertain=run.uncertain)
    write_states(run.states, folder / "states.parquet")
    drawn = write_report(
        folder / "report.html",
        identification,
        run.records,
        run.states,
        title=vehicle.name,
        outlook=assessment,
        given=conditions,
        provenance=provenance,
        figures=figures,
    )
    return {name: folder / name for name in (*names, *(["figures"] if drawn else []))}
