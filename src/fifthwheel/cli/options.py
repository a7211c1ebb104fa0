"""Options that several commands share, and their texts as data."""

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from fifthwheel.identify import Identification

Logs = Annotated[
    list[Path],
    typer.Argument(help="Logs of one vehicle: CSV, Parquet, MF4, MATLAB, MCAP or CAN traces.", show_default=False),
]
VehicleOption = Annotated[
    str,
    typer.Option("--vehicle", "-v", help="The vehicle: a TOML file, or a name from `fifthwheel vehicle`."),
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


class FigureFormat(StrEnum):
    """File format of figures."""

    svg = "svg"
    png = "png"
    pdf = "pdf"


FrictionOption = Annotated[
    float | None,
    typer.Option(
        "--friction",
        min=0.05,
        max=1.5,
        help="Tyres saturate at this peak friction of the road: 0.75 dry, 0.6 wet, 0.3 snow. For lateral accelerations "
        "above 3 m/s², braking in a turn and slippery roads. Default: that of the identification, or linear tyres.",
    ),
]
HALF_TRACK = 1.0
HalfTrackOption = Annotated[
    float,
    typer.Option(
        min=0.3,
        max=2.0,
        help="Centre line to the middle of the tyres of one side, m, for the load transfer ratios; twin tyres about "
        "0.92.",
    ),
]
FiguresOption = Annotated[
    FigureFormat | None,
    typer.Option("--figures", help="Also write every figure of the report to OUT/figures; needs matplotlib."),
]

FixOption = Annotated[
    list[str] | None,
    typer.Option("--fix", help="A parameter that keeps its value, assumed to be exact; may be repeated."),
]
FreeOption = Annotated[
    list[str] | None,
    typer.Option("--free", help="A parameter to estimate in addition to the default ones; may be repeated."),
]
PriorOption = Annotated[
    list[str] | None,
    typer.Option(
        "--prior",
        help="NAME=FRACTION: also estimate NAME; FRACTION is its prior sigma relative to its value, such as "
        "relaxation_length=20%. NAME is a parameter path or its last part. 0: NAME is exact and not estimated. May be "
        "repeated.",
    ),
]
ConsiderOption = Annotated[
    list[str] | None,
    typer.Option(
        "--consider",
        help="NAME=FRACTION: do not estimate NAME, but include its uncertainty in every sigma, such as "
        "roll_stiffness=10%. NAME is a parameter path or its last part, or vehicle_file or softening (times the "
        "default), or gyro_delay (2ms). 0: NAME is exact. May be repeated.",
    ),
]
SensorOption = Annotated[
    list[str] | None,
    typer.Option(
        "--sensor",
        help="NAME=SIGMA: prior sigma of a sensor error, such as steer_delay=5ms if all signals have a common time "
        "base. NAME is steer_offset, steer_gain, steer_delay, steer_play, rate_offset, rate_gain, misalignment, "
        "time_base_delay, articulation_offset, acceleration_offset, acceleration_gain, acceleration_delay, "
        "accelerometer_position, accelerometer_height or bank. May be repeated.",
    ),
]
AnyLoadOption = Annotated[
    bool,
    typer.Option(
        "--any-load", help="Estimate CoG height and roll inertia separately, for a load that is not a uniform block."
    ),
]
SuspensionOption = Annotated[
    Path | None,
    typer.Option(
        "--suspension-from",
        help="An identification.json of the same truck with a known payload: roll stiffness, roll axis and unladen "
        "bodies with their joint uncertainty.",
    ),
]


def chosen_identification(path: Path | None) -> "Identification | None":
    """The identification of --suspension-from, if it is given; a SignalError if it cannot be read."""
    if path is None:
        return None
    from fifthwheel.identify import Identification

    return Identification.load(path)


def windows(texts: list[str] | None) -> dict[str, list[tuple[float, float]]]:
    """ "FIRST..LAST" or "LOG=FIRST..LAST" as windows, s, by the name of the log; "" for all logs."""
    from fifthwheel.errors import FifthwheelError

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
