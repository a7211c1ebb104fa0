"""signals.toml: which column of a log is which signal, in what unit, sign and clock.

[time]
column = "t"                        # unit = "s"

[signals]
speed = "vx [km/h]"                 # a column as it is, in the header's unit

[signals."steer.tractor.front"]
column = "steering_wheel"
unit = "deg"                        # the header's, else SI
sign = -1                           # right counted positive
gain = 0.05                         # one over the steering ratio
offset = "0.1 deg"                  # subtracted last
delay = "200 ms"                    # stamped too late by so much

[signals."yaw_rate.semitrailer"]
sum = ["yaw_rate", "hitch_rate"]    # the sum of columns
time = "t_imu"                      # on a clock of its own

[reference]
"lateral_velocity.tractor" = "vy"   # never shown to an estimator
"""

import tomllib
from collections.abc import Iterable, Mapping
from itertools import combinations, pairwise
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError, field_validator, model_validator

from fifthwheel.errors import SignalError
from fifthwheel.logs.names import REFERENCE, known, si_unit, split_header, suggest
from fifthwheel.logs.record import Array
from fifthwheel.logs.units import factor, quantity


class TimeColumn(BaseModel):
    """The time base of a log."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    column: str | None = None
    """Header of the column, with or without its [unit]; default: "time" or "t". Only of tables without own stamps."""
    unit: str | None = None
    """Default: the header's, else s."""
    rate: float | str = 100.0
    """Samples a second, Hz, to which denser channels (from 2.5 times as many on) are taken, without aliasing."""
    start: float | str | None = None
    """What is before is left out, s."""
    stop: float | str | None = None
    """What is after is left out, s."""

    @field_validator("rate")
    @classmethod
    def _hertz(cls, value: float | str) -> float:
        rate = quantity(value, "Hz")
        if not rate >= 1.0:
            raise ValueError("at least 1 Hz")
        return rate

    @field_validator("start", "stop")
    @classmethod
    def _instant(cls, value: float | str | None) -> float | None:
        return None if value is None else quantity(value, "s")


class Channel(BaseModel):
    """Where a signal comes from: sign * gain * column in SI, minus offset, taken `delay` earlier than stamped."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    column: str | None = None
    """Header of the column, with or without its [unit]."""
    sum: tuple[str, ...] | None = Field(default=None, min_length=1)
    """In its place, columns to add up, all in one unit."""
    unit: str | None = None
    """Default: the header's, else the signal's SI unit."""
    sign: Literal[1, -1] = 1
    """-1 where the log counts the other way round than ISO 8855 (left positive)."""
    gain: float = Field(default=1.0, allow_inf_nan=False)
    """Multiplies, such as 1 / steering ratio."""
    offset: float | str = 0.0
    """Subtracted last; a number in SI, or a text with its unit: "0.1 deg"."""
    points: tuple[tuple[float, float], ...] | None = None
    """A calibration: pairs of what the column shows and what that is in `unit`, linear between and beyond."""
    delay: float | str = 0.0
    """By how much the channel lags, s, or a text with its unit: "200 ms"."""
    time: str | None = None
    """Column of its own time stamps, where the log has several rates."""

    @model_validator(mode="after")
    def _one_source(self) -> Self:
        if (self.column is None) == (self.sum is None):
            raise ValueError("needs either column = ... or sum = [...]")
        return self

    @field_validator("delay")
    @classmethod
    def _seconds(cls, value: float | str) -> float:
        return quantity(value, "s")

    @field_validator("points")
    @classmethod
    def _rising(cls, value: tuple[tuple[float, float], ...] | None) -> tuple[tuple[float, float], ...] | None:
        if value is not None and len(value) < 2:
            raise ValueError("a calibration needs two pairs of numbers at least")
        if value is not None and any(b[0] <= a[0] for a, b in pairwise(value)):
            raise ValueError("what the column shows must increase from pair to pair")
        return value

    def calibrated(self, values: Array, shown: str | None, si: str) -> Array:
        """A column's values (n,) in SI; `shown` is the unit that the log says."""
        if self.points is None:
            return values * factor(self.unit or shown or si, si)
        x, y = np.array(self.points).T
        k = np.clip(np.searchsorted(x, values) - 1, 0, x.size - 2)
        return np.asarray(y[k] + (values - x[k]) * ((y[k + 1] - y[k]) / (x[k + 1] - x[k]))) * factor(
            self.unit or si, si
        )

    @property
    def columns(self) -> tuple[str, ...]:
        """The columns it is made of."""
        return self.sum or (self.column or "",)


def _channels(value: Any) -> Any:
    """Channels by signal; a column's name alone is a channel too, and [signals.yaw_rate.tractor] needs no quotes."""
    if not isinstance(value, Mapping):
        return value
    flat: dict[str, Any] = {}
    for name, entry in value.items():
        if isinstance(entry, Mapping) and entry and all(isinstance(inner, Mapping) for inner in entry.values()):
            flat |= {f"{name}.{inner}": channel for inner, channel in _channels(entry).items()}
        else:
            flat[name] = {"column": entry} if isinstance(entry, str) else entry
    return flat


Name = Annotated[str, AfterValidator(known)]


class SignalMap(BaseModel):
    """From the columns of a log to signals; normally read from a signals.toml."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    time: TimeColumn | None = None
    """Default: a column "time" or "t"."""
    signals: dict[Name, Channel] = Field(default_factory=dict)
    """What the estimator gets."""
    reference: dict[Name, Channel] = Field(default_factory=dict)
    """What it never sees and is only compared with."""
    ignore: tuple[str, ...] = ()
    """Columns, or signals, that have the name of a signal and are not to be used; the others with such names are."""
    databases: tuple[Path, ...] = ()
    """DBC or ARXML files for CAN frames, from the folder of the map."""

    @field_validator("signals", "reference", mode="before")
    @classmethod
    def _flat(cls, value: Any) -> Any:
        return _channels(value)

    @model_validator(mode="after")
    def _fits(self) -> Self:
        plain = [(name, c) for name, c in self.signals.items() if c.column is not None]
        for (name, channel), (other, same) in combinations(plain, 2):
            if (channel.column, channel.time) == (same.column, same.time):
                raise ValueError(f"column {channel.column!r} cannot be both {name} and {other}; map one of them anew")
        for name, channel in (*self.signals.items(), *self.reference.items()):
            si = si_unit(name) or "1"
            try:
                quantity(channel.offset, si)
                factor(channel.unit or si, si)
            except SignalError as error:
                raise SignalError(f"{name}: {error}") from error
        return self

    @property
    def rate(self) -> float:
        """Samples a second to which denser channels are taken, Hz."""
        return float((self.time or TimeColumn()).rate)

    @property
    def span(self) -> tuple[float, float]:
        """What of the record is wanted, s."""
        time = self.time or TimeColumn()
        return (-np.inf if time.start is None else float(time.start), np.inf if time.stop is None else float(time.stop))

    @classmethod
    def load(cls, path: str | Path) -> "SignalMap":
        """The map in a TOML file."""
        try:
            text = Path(path).read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            raise SignalError(f"{path}: cannot be read ({error}); expected a TOML file in UTF-8") from error
        found = cls.parse(text, source=Path(path).name)
        return found.model_copy(update={"databases": tuple(Path(path).parent / d for d in found.databases)})

    @classmethod
    def parse(cls, text: str, *, source: str = "signals.toml") -> "SignalMap":
        """The map in a TOML text; each thing wrong with it is named, with what might be meant."""
        try:
            return cls.model_validate(tomllib.loads(text))
        except tomllib.TOMLDecodeError as error:
            raise SignalError(f"{source}: not TOML, {error}") from error
        except ValidationError as error:
            raise SignalError("\n".join(f"{source}: {_fault(dict(entry))}" for entry in error.errors())) from error

    @staticmethod
    def of_columns(columns: Iterable[str]) -> tuple[dict[str, Channel], dict[str, Channel]]:
        """Signals and reference of the columns that are called like signals themselves, "reference." before some."""
        found: tuple[dict[str, Channel], dict[str, Channel]] = ({}, {})
        for column in columns:
            name = column.partition("@")[0]
            signal = name.removeprefix(REFERENCE)
            if si_unit(signal) is not None and signal != "time":
                found[name != signal][signal] = Channel(column=name)
        return found

    def completed(self, columns: Iterable[str]) -> "SignalMap":
        """With the columns besides that are called like signals, those of the map and those it ignores left out."""
        named = SignalMap.of_columns(columns)
        used = {c for channel in (*self.signals.values(), *self.reference.values()) for c in channel.columns}
        used |= {split_header(column)[0] for column in used} | set(self.ignore)

        def more(mine: Mapping[str, Channel], theirs: Mapping[str, Channel]) -> dict[str, Channel]:
            return {
                **mine,
                **{n: c for n, c in theirs.items() if n not in mine and c.column not in used and n not in used},
            }

        return self.model_copy(
            update={"signals": more(self.signals, named[0]), "reference": more(self.reference, named[1])}
        )


def _fault(error: dict[str, Any]) -> str:
    """One of pydantic's complaints as a sentence with the cure."""
    path = [str(step) for step in error["loc"]]
    path = path[:-2] if path[-1:] == ["[key]"] else path
    where = ".".join(path)
    if error["type"] == "extra_forbidden":
        models: dict[int, type[BaseModel]] = {1: SignalMap, 2: TimeColumn}
        model = models.get(len(path), Channel)
        return f"{where}: unknown key; {suggest(path[-1], list(model.model_fields))}"
    if error["type"] == "value_error":
        return f"{where}: {error['ctx']['error']}" if where else str(error["ctx"]["error"])
    return f"{where}: {error['msg'][:1].lower()}{error['msg'][1:]}, got {error['input']!r}"
