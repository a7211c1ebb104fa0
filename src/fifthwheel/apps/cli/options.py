"""Options that several commands share, and their texts as data."""

from pathlib import Path
from typing import Annotated, Literal

import typer

Logs = Annotated[
    list[Path],
    typer.Argument(help="Logs of one vehicle: CSV, Parquet, MF4, MATLAB, MCAP or CAN traces.", show_default=False),
]
VehicleOption = Annotated[
    str,
    typer.Option(
        "--vehicle",
        "-v",
        help="The vehicle: a TOML file, a name from `fifthwheel vehicle`, or a result folder of `fifthwheel identify`.",
    ),
]
SignalsOption = Annotated[
    Path | None,
    typer.Option(
        "--signals",
        "-s",
        help="Signal map (signals.toml). Needed if the column headers are not signal names such as yaw_rate.tractor.",
    ),
]
AllowOutsideOption = Annotated[
    bool,
    typer.Option("--allow-outside", help="Read databases that --signals names outside of the folder of the map."),
]
ExcludeOption = Annotated[
    list[str] | None,
    typer.Option(
        "--exclude",
        help="FIRST..LAST: leave out this window of all logs, s, such as 12.5..14; LOG=FIRST..LAST of one log, by its "
        "name without ending. May be repeated.",
    ),
]
OutOption = Annotated[Path, typer.Option("--out", "-o", help="Folder for the results; created if it does not exist.")]
ForceOption = Annotated[
    bool,
    typer.Option("--force", help="Replace also files that are not results of an earlier run of this command."),
]
ForceFileOption = Annotated[bool, typer.Option("--force", help="Replace a file that exists.")]
JsonOption = Annotated[bool, typer.Option("--json", help="Print the result as JSON instead of tables.")]
CheckOption = Annotated[bool, typer.Option("--check/--no-check", help="Refuse logs with implausible signals.")]
OF_RESULT = "Default: that of the result folder, if --vehicle is one."
IdentificationOption = Annotated[
    Path | None,
    typer.Option(
        "--identification",
        "-i",
        help=f"An identification.json: sensor errors, noise, and the uncertainty of the vehicle. {OF_RESULT}",
    ),
]
FiguresOption = Annotated[
    Literal["svg", "png", "pdf"] | None,
    typer.Option("--figures", help="Also write every figure of the report to OUT/figures; needs matplotlib."),
]


def windows(texts: list[str] | None) -> dict[str, list[tuple[float, float]]]:
    """ "FIRST..LAST" or "LOG=FIRST..LAST" as windows, s, by the name of the log; "" for all logs."""
    from fifthwheel.base.errors import FifthwheelError

    result: dict[str, list[tuple[float, float]]] = {}
    for text in texts or []:
        log, _, window = text.rpartition("=")
        first, separator, last = window.partition("..")
        try:
            ends = float(first), float(last)
        except ValueError:
            separator = ""
        if not separator:
            raise FifthwheelError(f"--exclude {text}: expected FIRST..LAST in s, such as 12.5..14, or LOG=FIRST..LAST")
        result.setdefault(log, []).append(ends)
    return result


def require_figures(figures: str | None, out: Path | None) -> None:
    """Refuse --figures before the computation, where they cannot be drawn or there is no folder for them."""
    from fifthwheel.base.errors import FifthwheelError
    from fifthwheel.base.pages.html import checked_format

    if figures:
        checked_format(figures)
        if out is None:
            raise FifthwheelError("--figures: needs a folder; add -o FOLDER")
