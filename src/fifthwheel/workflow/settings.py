"""Settings of an identification from the choices that a user makes."""

from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Any

from fifthwheel.cheng_cebon_2011 import TwoStage, article
from fifthwheel.errors import FifthwheelError
from fifthwheel.identify import CommonSettings, OneStage
from fifthwheel.identify.settings import MODEL_ERROR_UNITS, MODEL_ERRORS
from fifthwheel.options import IdentifyOptions
from fifthwheel.settings import options_of
from fifthwheel.units import quantity
from fifthwheel.vehicle import Vehicle
from fifthwheel.workflow.statement import Statement, parse
from fifthwheel.workflow.statements import SENSOR_PRIORS, apply


def identification_settings(
    vehicle: Vehicle,
    chosen: IdentifyOptions,
    *,
    base: OneStage | None = None,
) -> tuple[Vehicle, CommonSettings]:
    """Vehicle and settings of an identification.

    Args:
        chosen: what a user chooses.
        base: what was stated before, by default `OneStage()`; statements of `chosen` replace it.

    Raises:
        FifthwheelError: a statement that cannot be used (`statements.apply`), or an option of another method.
        VehicleError: a parameter that does not exist.
    """
    one_stage = chosen.method == "one-stage"
    for name in ("passes",) if one_stage else _ONE_STAGE:
        if getattr(chosen, name) != getattr(IdentifyOptions, name):
            option = options_of(IdentifyOptions)[name].flags_of(name)[0]
            other = "two-stage" if one_stage else "one-stage"
            raise FifthwheelError(f"{option}: needs --method {other}; remove {option}, or choose that method")
    if one_stage:
        return chosen_one_stage(vehicle, chosen, base=base)
    preset = article() if chosen.method == "article" else TwoStage()
    settings = replace(preset, check=chosen.check, passes=chosen.passes or preset.passes)
    return apply(vehicle, settings, chosen_statements(chosen))


def chosen_one_stage(
    vehicle: Vehicle,
    chosen: IdentifyOptions,
    *,
    base: OneStage | None = None,
) -> tuple[Vehicle, OneStage]:
    """The same for one stage, whatever the method."""
    form: Any = chosen.form.replace("-", "_")
    of_options = {"check": chosen.check, "form": form, "tyres": chosen.tyres, "uniform_payload": not chosen.any_load}
    return apply(vehicle, replace(base or OneStage(), **of_options), chosen_statements(chosen))


_ONE_STAGE = (
    *("knowledge", "trailer", "load", "road", "free", "prior", "consider", "sensor", "any_load", "form", "tyres"),
)
"""Options that belong to one stage."""


def chosen_statements(chosen: IdentifyOptions) -> tuple[Statement, ...]:
    """What a user states of numbers: --set, and the options that it replaces.

    Raises:
        FifthwheelError: a text has another form.
    """
    return (*map(parse, chosen.statements), *replaced_statements(chosen))


def replaced_statements(chosen: IdentifyOptions) -> tuple[Statement, ...]:
    """The statements of the options that --set replaces.

    Raises:
        FifthwheelError: a text is not NAME=FRACTION or NAME=SIGMA.
    """
    sensors = named_texts("--sensor", chosen.sensor, f"NAME=SIGMA, where NAME is {', '.join(SENSOR_PRIORS)}")
    return (
        *[Statement(name=name, kind="exact") for name in chosen.fix],
        *[Statement(name=name, kind="free") for name in chosen.free],
        *[_relative(name, sigma) for name, sigma in fractions("--prior", chosen.prior).items()],
        *[_relative(name, sigma) for name, sigma in _considered(chosen.consider).items()],
        *[_with_sigma(name, text) for name, text in sensors.items()],
    )


def _relative(name: str, sigma: float) -> Statement:
    """A standard deviation as a fraction, or in the unit of the model error; 0 for exact."""
    if not sigma:
        return Statement(name=name, kind="exact")
    unit = MODEL_ERROR_UNITS.get(name)
    return Statement(name=name, sigma=f"{sigma:.12g} {unit}" if unit else f"{100 * sigma:.12g} %", kind="sigma")


def _with_sigma(name: str, text: str) -> Statement:
    """The standard deviation of a sensor error; a number without a unit is in SI."""
    if name not in SENSOR_PRIORS:
        raise FifthwheelError(
            f"--sensor {name}={text}: expected NAME=SIGMA, where NAME is {', '.join(SENSOR_PRIORS)}; correct the name"
        )
    try:
        sigma = quantity(text, SENSOR_PRIORS[name])
    except FifthwheelError as error:
        raise FifthwheelError(f"--sensor {name}={text}: {error}") from None
    if sigma == 0:
        return Statement(name=name, kind="exact")
    unit = SENSOR_PRIORS[name]
    return Statement(name=name, sigma=f"{sigma!r} {unit}" if unit != "1" else repr(sigma), kind="sigma")


def named_texts(option: str, texts: Iterable[str], expected: str) -> dict[str, str]:
    """ "NAME=TEXT" as name: text; `expected` is the form of a text, for the message of the error."""
    named = {}
    for text in texts:
        name, _, value = text.partition("=")
        if not value:
            raise FifthwheelError(f"{option} {text}: expected {expected}")
        named[name] = value
    return named


def named_values(
    option: str, texts: Iterable[str], expected: str, convert: Callable[[str, str], float]
) -> dict[str, float]:
    """ "NAME=VALUE" as name: value.

    `expected` is the form of a text, for the message of the error; a ValueError of `convert` without a message stands
    for another form.
    """
    values = {}
    for text in texts:
        name, _, value = text.partition("=")
        try:
            values[name] = convert(name, value)
        except FifthwheelError as error:
            raise FifthwheelError(f"{option} {text}: {error}") from None
        except ValueError:
            raise FifthwheelError(f"{option} {text}: expected {expected}") from None
    return values


def fractions(option: str, texts: Iterable[str]) -> dict[str, float]:
    """ "name=fraction" as name: fraction, from 0 to below 1; it may be in per cent."""
    return named_values(option, texts, _FRACTION, lambda _, text: _fraction(text, 1))


def _considered(texts: Iterable[str]) -> dict[str, float]:
    """ "name=fraction" as name: fraction; for model errors a factor, or a number with a unit."""

    def sigma(name: str, text: str) -> float:
        if unit := MODEL_ERROR_UNITS.get(name):
            return quantity(text, unit)
        return _fraction(text, 100 if name in MODEL_ERRORS else 1)

    return named_values("--consider", texts, _FRACTION, sigma)


_FRACTION = "NAME=FRACTION, such as roll_stiffness=10%"


def _fraction(text: str, below: float) -> float:
    value = float(text.removesuffix("%")) / (100 if text.endswith("%") else 1)
    if not 0 <= value < below:
        given = text if text.endswith("%") else f"{text}, which is {100 * value:g}%"
        raise FifthwheelError(f"expected 0% or more and below {100 * below:g}%, got {given}; write 5% or 0.05")
    return value
