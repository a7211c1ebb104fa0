"""Several results side by side."""

from collections.abc import Sequence
from pathlib import Path

from fifthwheel._atomic import atomic_write, one_run
from fifthwheel.diagnose import Comparison, compare
from fifthwheel.identify import Identification
from fifthwheel.report import write_comparison_page
from fifthwheel.workflow.assessment import identification_file


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
        with atomic_write(csv) as temporary:
            temporary.write_text(comparison.to_csv(), encoding="utf-8")
    if html is not None:
        write_comparison_page(html, comparison)
    return {path.name: path for path in (csv, html) if path is not None}
