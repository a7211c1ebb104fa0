"""Options that several commands share, and their texts as data."""

from collections.abc import Callable
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from fifthwheel.identify import OneStage
    from fifthwheel.vehicle import Vehicle

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


def one_stage(
    vehicle: "Vehicle",
    *,
    fix: list[str] | None,
    free: list[str] | None,
    prior: list[str] | None,
    consider: list[str] | None,
    any_load: bool,
    sensor: list[str] | None = None,
    base: "OneStage | None" = None,
) -> "OneStage":
    """Settings of the one-stage method from the texts of the options.

    Raises:
        FifthwheelError: a text that is not NAME=FRACTION or NAME=SIGMA.
        VehicleError: a parameter that does not exist.
    """
    from fifthwheel.workflow import one_stage_settings

    return one_stage_settings(
        vehicle,
        fix=fix or (),
        free=free or (),
        prior=fractions("--prior", prior),
        consider=considered_sigmas(consider),
        any_load=any_load,
        sensors=sensor_sigmas(sensor),
        base=base,
    )


def with_suspension(
    vehicle: "Vehicle", settings: "OneStage", identification: Path | None
) -> "tuple[Vehicle, OneStage]":
    """Vehicle and settings with the suspension of an identification, if one is given.

    Raises:
        SignalError: the file is not an identification in one stage.
        VehicleError: it is of another vehicle.
    """
    if identification is None:
        return vehicle, settings
    from fifthwheel.identify import Identification, suspension

    return suspension.with_suspension(vehicle, settings, Identification.load(identification))


def named_values(
    option: str, texts: list[str] | None, expected: str, convert: Callable[[str, str], float]
) -> dict[str, float]:
    """ "NAME=VALUE" as name: value.

    Args:
        expected: form of a text, for the message of the error.
        convert: the value from name and text; a ValueError without a message stands for another form.

    Raises:
        FifthwheelError: `convert` refuses a text.
    """
    from fifthwheel.errors import FifthwheelError

    values = {}
    for text in texts or []:
        name, _, value = text.partition("=")
        try:
            values[name] = convert(name, value)
        except FifthwheelError as error:
            raise FifthwheelError(f"{option} {text}: {error}") from None
        except ValueError:
            raise FifthwheelError(f"{option} {text}: expected {expected}") from None
    return values


def fractions(option: str, texts: list[str] | None) -> dict[str, float]:
    """ "name=fraction" as name: fraction, from 0 to below 1; it may be in per cent."""
    from fifthwheel.errors import FifthwheelError

    def fraction(_: str, text: str) -> float:
        value = float(text.removesuffix("%")) / (100 if text.endswith("%") else 1)
        if not 0 <= value < 1:
            raise FifthwheelError(f"expected a fraction from 0 to below 1; {text} is {100 * value:g} %")
        return value

    return named_values(option, texts, "NAME=FRACTION, such as roll_stiffness=10%", fraction)


def considered_sigmas(texts: list[str] | None) -> dict[str, float]:
    """ "name=fraction" as name: fraction; for model errors a factor, or a latency in s."""
    from fifthwheel.errors import FifthwheelError
    from fifthwheel.identify.settings import MODEL_ERRORS
    from fifthwheel.units import quantity

    def sigma(name: str, text: str) -> float:
        if name == "gyro_delay":
            return quantity(text, "s")
        value = float(text.removesuffix("%")) / (100 if text.endswith("%") else 1)
        if not 0 <= value < (100 if name in MODEL_ERRORS else 1):
            raise FifthwheelError(f"expected a fraction from 0 to below 1; {text} is {100 * value:g} %")
        return value

    return named_values("--consider", texts, "NAME=FRACTION, such as roll_stiffness=10%", sigma)


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


def sensor_sigmas(texts: list[str] | None) -> dict[str, float]:
    """ "name=sigma" as name: sigma in SI."""
    from fifthwheel.units import quantity
    from fifthwheel.workflow import SENSOR_PRIORS

    def sigma(name: str, text: str) -> float:
        if name not in SENSOR_PRIORS:
            raise ValueError
        return quantity(text, SENSOR_PRIORS[name])

    return named_values("--sensor", texts, f"NAME=SIGMA, where NAME is {', '.join(SENSOR_PRIORS)}", sigma)
