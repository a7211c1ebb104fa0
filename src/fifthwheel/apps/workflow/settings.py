"""Settings of an identification from the choices that a user makes."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from fifthwheel.apps.cheng_cebon_2011 import TwoStage, article
from fifthwheel.base.errors import FifthwheelError
from fifthwheel.base.input_files import parse_toml, read_toml
from fifthwheel.base.options import IdentifyOptions
from fifthwheel.base.spelling import setting
from fifthwheel.estimate.identify import CommonSettings, OneStage
from fifthwheel.estimate.identify.given import applied
from fifthwheel.estimate.identify.statement import Statement, combined, parse, statement
from fifthwheel.truck import Vehicle


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
        FifthwheelError: a statement that cannot be used (`estimate.identify.given`), or an option of another method.
        VehicleError: a parameter that does not exist.
    """
    one_stage = chosen.method == "one-stage"
    for name in ("passes",) if one_stage else _ONE_STAGE:
        if getattr(chosen, name) != getattr(IdentifyOptions, name):
            option, other = setting(name), setting("method", "two-stage" if one_stage else "one-stage")
            raise FifthwheelError(f"{option}: needs {other}; remove {option}, or choose that method")
    if one_stage:
        return chosen_one_stage(vehicle, chosen, base=base)
    preset = article() if chosen.method == "article" else TwoStage()
    given = {**preset.given, **stated_in(chosen.statements)}
    return applied(vehicle, replace(preset, check=chosen.check, passes=chosen.passes or preset.passes, given=given))


def chosen_one_stage(
    vehicle: Vehicle,
    chosen: IdentifyOptions,
    *,
    base: OneStage | None = None,
) -> tuple[Vehicle, OneStage]:
    """The same for one stage, whatever the method."""
    form: Any = chosen.form.replace("-", "_")
    of_options = {"check": chosen.check, "form": form, "tyres": chosen.tyres, "uniform_payload": not chosen.any_load}
    base = base or OneStage()
    given = {**base.given, **stated_in(chosen.statements)}
    return applied(vehicle, replace(base, given=given, **of_options))


def stated_in(texts: Iterable[str]) -> dict[str, str | float]:
    """Statements as a mapping from texts NAME=STATEMENT, or @FILE: a TOML file with the table [given].

    Raises:
        FifthwheelError: a text of another form, statements that disagree, or a file that cannot be read.
    """
    found: list[Statement] = []
    for text in texts:
        found += _of_file(Path(text[1:])) if text.startswith("@") else [parse(text)]
    return combined(found)


def _of_file(path: Path) -> Iterator[Statement]:
    text = read_toml(path)
    try:
        given = parse_toml(text).get("given")
    except FifthwheelError as error:
        raise FifthwheelError(f"{path}: {error}") from None
    if not given or not isinstance(given, dict):
        raise FifthwheelError(f"{path}: expected a table [given] with lines NAME = STATEMENT, got none; add it")
    yield from _of_table(path, given)


def _of_table(path: Path, given: Mapping[str, Any], owner: str = "") -> Iterator[Statement]:
    for key, text in given.items():
        name = f"{owner}{key}"
        if isinstance(text, dict):  # TOML reads semitrailer.mass without quotes as a table in a table
            yield from _of_table(path, text, f"{name}.")
        elif isinstance(text, bool) or not isinstance(text, str | int | float):
            raise FifthwheelError(f"{path}: {name}: expected a text such as '+- 5 %', or a number in SI, got {text!r}")
        else:
            yield statement(name, text)


_ONE_STAGE = ("knowledge", "trailer", "load", "road", "any_load", "form", "tyres")
"""Options that belong to one stage."""


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


def targets_of(texts: Iterable[str]) -> dict[str, float]:
    """ "name=fraction" of `--target` as name: fraction, from 0 to below 1; it may be in per cent."""

    def fraction(_: str, text: str) -> float:
        value = float(text.removesuffix("%")) / (100 if text.endswith("%") else 1)
        if not 0 <= value < 1:
            given = text if text.endswith("%") else f"{text}, which is {100 * value:g}%"
            raise FifthwheelError(f"expected 0% or more and below 100%, got {given}; write 5% or 0.05")
        return value

    return named_values(setting("target"), texts, "NAME=FRACTION, such as roll_stiffness=10%", fraction)
