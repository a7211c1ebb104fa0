"""What an identification begins with: settings from the choices of a user, and the information of earlier logs."""

import datetime
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, Self, TypeVar

from fifthwheel.apps.cheng_cebon_2011 import TwoStage, article
from fifthwheel.apps.workflow.inputs import read_knowledge, read_vehicle
from fifthwheel.base.errors import FifthwheelError, SignalError, suggestion
from fifthwheel.base.input_files import parse_toml, read_json, read_toml
from fifthwheel.base.options import IdentifyOptions
from fifthwheel.base.spelling import setting
from fifthwheel.base.units import quantity
from fifthwheel.estimate.identify import CommonSettings, Identification, OneStage
from fifthwheel.estimate.identify.given import applied
from fifthwheel.estimate.identify.knowledge.information import Occasion
from fifthwheel.estimate.identify.knowledge.knowledge import Knowledge
from fifthwheel.estimate.identify.knowledge.load import with_payload
from fifthwheel.estimate.identify.one_stage.prior import Earlier, nothing
from fifthwheel.estimate.identify.statement import Statement, combined, parse, statement
from fifthwheel.truck import Vehicle

T = TypeVar("T")
_ONE_STAGE = ("knowledge", "trailer", "load", "road", "any_load", "form", "tyres")
"""Options that belong to one stage."""


@dataclass(frozen=True, kw_only=True)
class Note:
    """A description of a test, who wrote it, and the day, as texts."""

    text: str = ""
    author: str = ""
    date: str = ""
    """ISO 8601: 2026-11-26."""

    @classmethod
    def of(cls, chosen: IdentifyOptions) -> Self | None:
        """The note of an identification of today; None without a description and an author."""
        if not (chosen.note or chosen.author):
            return None
        today = datetime.datetime.now().astimezone().date()
        return cls(text=chosen.note or "", author=chosen.author or "", date=today.isoformat())

    @classmethod
    def read(cls, identification: Path) -> Self | None:
        """The note in an identification.json; None if there is none, or the file cannot be read."""
        try:
            contents = read_json(identification)
        except FifthwheelError:
            return None
        kept: Any = contents.get("note") if isinstance(contents, Mapping) else None
        if not isinstance(kept, Mapping):
            return None
        return cls(**{key: str(kept.get(key, "")) for key in ("text", "author", "date")})

    def __str__(self) -> str:
        origin = ", ".join(filter(None, (self.author, self.date)))
        return f"{self.text} ({origin})" if self.text else origin


def identification_settings(
    vehicle: Vehicle,
    chosen: IdentifyOptions,
    *,
    base: OneStage | None = None,
) -> tuple[Vehicle, CommonSettings]:
    """Vehicle and settings of an identification from what a user chooses.

    `base` is what was stated before, by default `OneStage()`; statements of `chosen` replace it. A FifthwheelError for
    a statement that cannot be used (`estimate.identify.given`), an unknown parameter, or an option of another method.
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

    A FifthwheelError for another form, statements that disagree, or a file that cannot be read.
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


def named_texts(option: str, texts: Iterable[str], expected: str) -> dict[str, str]:
    """ "NAME=TEXT" as name: text; `expected` is the form of a text, for the message of the error."""

    def given(text: str) -> str:
        if not text:
            raise ValueError
        return text

    return named_values(option, texts, expected, given)


def named_values(option: str, texts: Iterable[str], expected: str, convert: Callable[[str], T]) -> dict[str, T]:
    """ "NAME=VALUE" as name: value; a ValueError of `convert` stands for another form than `expected`."""
    values = {}
    for text in texts:
        name, _, value = text.partition("=")
        try:
            values[name] = convert(value)
        except FifthwheelError as error:
            raise FifthwheelError(f"{option} {text}: {error}") from None
        except ValueError:
            raise FifthwheelError(f"{option} {text}: expected {expected}") from None
    return values


def targets_of(texts: Iterable[str]) -> dict[str, float]:
    """ "name=fraction" of `--target` as name: fraction, from 0 to below 1; it may be in per cent."""

    def fraction(text: str) -> float:
        value = float(text.removesuffix("%")) / (100 if text.endswith("%") else 1)
        if not 0 <= value < 1:
            given = text if text.endswith("%") else f"{text}, which is {100 * value:g}%"
            raise FifthwheelError(f"expected 0% or more and below 100%, got {given}; write 5% or 0.05")
        return value

    return named_values(setting("target"), texts, "NAME=FRACTION, such as roll_stiffness=10%", fraction)


@dataclass(frozen=True, kw_only=True)
class Start:
    """What the identification of logs with one load begins with."""

    logs: tuple[Path, ...]
    vehicle: Vehicle
    settings: CommonSettings
    knowledge: Knowledge | None = None
    occasion: Occasion | None = None
    note: Note | None = None

    @property
    def folder(self) -> str:
        """Name of the folder for the results, if the load is not the last."""
        load = self.occasion.load if self.occasion else ""
        return f"load_{re.sub('[^0-9A-Za-z]+', '_', Path(load).stem)}"

    @property
    def one_stage(self) -> OneStage:
        """The settings, if they are of one stage."""
        if self.settings.one_stage is None:
            raise SignalError(f"method: only one stage predicts; leave out {setting('method')}")
        return self.settings.one_stage

    @property
    def earlier(self) -> Earlier:
        """The information of earlier logs on the unknowns of a setup."""
        if self.knowledge is None or self.occasion is None:
            return nothing
        self.knowledge.require_same_load(self.vehicle, self.occasion)
        return partial(self.knowledge.prior, occasion=self.occasion)


def starts_of(truck: Vehicle | Identification, chosen: IdentifyOptions, logs: Sequence[Path] = ()) -> list[Start]:
    """What the identification of logs begins with, for each load; that of the last log, or of the options, last.

    Args:
        truck: the vehicle as known before the logs. An identification stands for the vehicle and the statements that it
            began with, and for the information of its logs.
        chosen: what a user chooses; `knowledge` replaces that of `truck`.
        logs: none before a run is driven.

    Raises:
        FifthwheelError, SignalError, VehicleError: as `identification_settings`; the knowledge cannot be read, has no
            log that is used, or belongs to another truck; a load is of no log, or cannot be read, or is another one
            without a name.
    """
    loads = _loads(chosen.load, logs)
    given, base = (truck, None) if isinstance(truck, Vehicle) else (truck.initial_vehicle, truck.settings)
    knowledge = _knowledge(truck) if isinstance(truck, Identification) and chosen.knowledge is None else None
    if chosen.knowledge is not None:
        knowledge = read_knowledge(chosen.knowledge)
        knowledge.require_used()
    starts, note = [], Note.of(chosen)
    final = loads[logs[-1]] if logs else _common(chosen.load)
    for load in sorted({*loads.values(), final}, key=lambda load: (load == final, load)):
        vehicle = _with_load(given, load)
        vehicle, settings = identification_settings(vehicle, chosen, base=base.one_stage if base else None)
        own = tuple(path for path in logs if loads[path] == load)
        if settings.one_stage is None:
            starts.append(Start(logs=own, vehicle=vehicle, settings=settings, note=note))
            continue
        earlier, date = knowledge or Knowledge(), _date(own[0]) if own else None
        last = earlier.occasion(vehicle, chosen.trailer)
        occasion = replace(last, load=load or last.load, road=chosen.road or "", date=date)
        earlier.require_same_truck(vehicle, occasion)
        start = Start(logs=own, vehicle=vehicle, settings=settings, knowledge=knowledge, occasion=occasion, note=note)
        starts.append(start)
    return starts


def _loads(texts: Sequence[str], logs: Sequence[Path]) -> Mapping[Path, str]:
    """The load of each log, empty if none is given; a SignalError for a load of no log, or several for all."""
    names = {str(path): path for path in logs} | {path.name: path for path in logs} | {path.stem: path for path in logs}
    own = dict[Path, str]()
    for text in texts:
        log, equals, load = text.partition("=")
        if equals and log not in names:
            raise SignalError(f"{setting('load', text)}: no log {log}; {suggestion(log, [path.name for path in logs])}")
        if equals:
            own[names[log]] = load.strip()
    return {path: own.get(path, _common(texts)) for path in logs}


def _common(texts: Sequence[str]) -> str:
    """The load of all logs without one of their own; empty if none is given, a SignalError for several."""
    common = [text.strip() for text in texts if "=" not in text]
    if len(common) > 1:
        raise SignalError(f"{setting('load', common[1])}: {common[0]} is the load of all logs already; write LOG=LOAD")
    return "".join(common)


def _with_load(vehicle: Vehicle, load: str) -> Vehicle:
    """The vehicle with a load: a payload mass, a vehicle file, or a name, which leaves the vehicle as it is."""
    if load.endswith(".toml"):
        return read_vehicle(load)
    try:
        mass = quantity(load, "kg") if load[:1].isdigit() and load[-1:].isalpha() else None
    except FifthwheelError:
        return vehicle
    return vehicle if mass is None else with_payload(vehicle, mass)


def _knowledge(kept: Identification) -> Knowledge:
    """A SignalError if the identification keeps none."""
    if kept.knowledge is None or not kept.knowledge.logs:
        raise SignalError(
            "knowledge: the result has none, because two stages or another version wrote it; identify its logs again "
            "in one stage"
        )
    return kept.knowledge


def _date(path: Path) -> datetime.datetime | None:
    """Of a file, for logs whose samples have none; None if there is no such file."""
    return datetime.datetime.fromtimestamp(path.stat().st_mtime, datetime.UTC) if path.exists() else None
