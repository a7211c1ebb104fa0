"""The assessment of a truck: what is assessed, and its files."""

import json
from pathlib import Path

from fifthwheel._atomic import atomic_write
from fifthwheel.assess import Assessment
from fifthwheel.identify import Identification
from fifthwheel.report import Provenance, write_assessment_report
from fifthwheel.vehicle import Vehicle
from fifthwheel.workflow.inputs import read_vehicle

ASSESSMENT_FILES = ("assessment.json", "assess.html")
"""Results of an assessment, besides figures."""


def identification_file(name: str) -> Path | None:
    """The identification.json that a folder or a file name stands for; None for a vehicle."""
    path = Path(name)
    return path / "identification.json" if path.is_dir() else path if path.suffix == ".json" else None


def read_truck(name: str) -> Vehicle | Identification:
    """The identification in a result folder or of an identification.json, or the vehicle as of `read_vehicle`.

    Raises:
        SignalError: the identification cannot be read.
        VehicleError: no such folder, file or vehicle of the catalogue.
    """
    path = identification_file(name)
    return read_vehicle(name) if path is None else Identification.load(path)


def write_assessment(
    assessment: Assessment, folder: Path, *, provenance: Provenance | None = None, figures: str | None = None
) -> dict[str, Path]:
    """Write assessment.json and assess.html to an existing folder; returns the path of each by its name.

    Args:
        provenance: command, input files and versions, for the page.
        figures: "svg", "png" or "pdf" to write every figure of the page into the folder figures.

    Raises:
        FifthwheelError: figures without matplotlib, or of another format.
        OSError: a file cannot be written.
    """
    with atomic_write(folder / ASSESSMENT_FILES[0]) as temporary:
        temporary.write_text(json.dumps(assessment.as_dict(), indent=2) + "\n", encoding="utf-8")
    drawn = write_assessment_report(folder / ASSESSMENT_FILES[1], assessment, provenance=provenance, figures=figures)
    return {name: folder / name for name in (*ASSESSMENT_FILES, *(["figures"] if drawn else []))}
