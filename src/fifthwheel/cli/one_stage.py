"""What the commands let be told of the one-stage method: which parameters take which part."""

from dataclasses import replace
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from fifthwheel.identify import OneStage
    from fifthwheel.vehicle import Vehicle

HoldOption = Annotated[
    list[str] | None,
    typer.Option("--hold", help="A parameter that keeps its value, taken for exact; may be repeated."),
]
FreeOption = Annotated[
    list[str] | None,
    typer.Option("--free", help="A parameter to seek besides the usual ones; may be repeated. One stage only."),
]
PriorOption = Annotated[
    list[str] | None,
    typer.Option(
        "--prior",
        help="NAME=PART: known to that part of its value and learned beside, such as relaxation_length=20%; "
        "a path or the end of one, 0 for exact; may be repeated. One stage only.",
    ),
]
ConsiderOption = Annotated[
    list[str] | None,
    typer.Option(
        "--consider",
        help="NAME=PART: known to that part of its value, never learned, counted in every sigma, such as "
        "roll_stiffness=10%; a path or the end of one, 0 for exact; may be repeated. One stage only.",
    ),
]
SENSORS = {
    "steer_offset": "rad",
    "steer_gain": "1",
    "steer_delay": "s",
    "rate_offset": "rad/s",
    "rate_gain": "1",
    "articulation_offset": "rad",
    "bank": "rad",
}
"""Errors of sensors, and the road's bank, whose prior standard deviation can be told, with the SI unit."""
SensorOption = Annotated[
    list[str] | None,
    typer.Option(
        "--sensor",
        help=f"NAME=SIGMA: how far off a sensor may be, such as steer_delay=5ms where one clock stamps everything; "
        f"{', '.join(SENSORS)}; may be repeated.",
    ),
]
AnyLoadOption = Annotated[
    bool,
    typer.Option(
        "--any-load", help="Seek CoG height and roll inertia apart: the load may be of any shape. One stage only."
    ),
]


def one_stage(
    truck: "Vehicle",
    *,
    free: list[str] | None,
    hold: list[str] | None,
    prior: list[str] | None,
    consider: list[str] | None,
    any_load: bool,
    sensor: list[str] | None = None,
    **others: Any,
) -> "OneStage":
    """Settings of the one-stage method; what is told replaces the default for the same names.

    Raises:
        FifthwheelError: a text that is not NAME=PART.
        VehicleError: a parameter that does not exist.
    """
    from fifthwheel.identify import OneStage
    from fifthwheel.identify.parameters import one_stage_sought

    plain = OneStage(held=tuple(hold or ()), uniform_payload=not any_load, **sensors(sensor or []), **others)
    learned, considered = parts("--prior", prior or []), parts("--consider", consider or [])
    priors = {name: part for name, part in {**plain.priors, **learned}.items() if name not in considered}
    others_considered = {name: part for name, part in plain.consider.items() if name not in learned}
    usual = one_stage_sought(truck.lumped() if any_load else truck, plain)
    return replace(
        plain,
        free=(*usual, *free) if free else None,
        priors={name: part for name, part in priors.items() if part},
        consider={name: part for name, part in (others_considered | considered).items() if part},
    )


def sensors(texts: list[str]) -> dict[str, Any]:
    """ "name=sigma" as the setting of that name in SI.

    Raises:
        FifthwheelError: a text that is not of this form.
    """
    from fifthwheel.errors import FifthwheelError, SignalError
    from fifthwheel.logs.units import quantity

    found = {}
    for text in texts:
        name, _, sigma = text.partition("=")
        if name not in SENSORS:
            raise FifthwheelError(f"--sensor {text}: expected NAME=SIGMA with one of {', '.join(SENSORS)}")
        try:
            value = quantity(sigma, SENSORS[name])
        except SignalError as error:
            raise FifthwheelError(f"--sensor {text}: {error}") from None
        if not 0 < value < float("inf"):
            raise FifthwheelError(f"--sensor {text}: expected a standard deviation above 0")
        found[f"{name}_prior"] = value
    return found


def parts(option: str, texts: list[str]) -> dict[str, float]:
    """ "name=part" as name: part; a part may be told in per cent.

    Raises:
        FifthwheelError: a text that is not of this form.
    """
    from fifthwheel.errors import FifthwheelError

    found = {}
    for text in texts:
        name, _, part = text.partition("=")
        try:
            found[name] = float(part.removesuffix("%")) / (100 if part.endswith("%") else 1)
        except ValueError:
            found[name] = -1.0
        if not 0 <= found[name] < 1:
            much = f"; {part} is {100 * found[name]:g} %" if found[name] >= 1 else ""
            raise FifthwheelError(f"{option} {text}: expected NAME=PART below 1, such as roll_stiffness=10%{much}")
    return found
