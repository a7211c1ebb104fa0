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
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError, field_validator, model_validator

from fifthwheel.errors import SignalError
from fifthwheel.logs.align import Samples, align
from fifthwheel.logs.names import REFERENCE, known, si_unit, split_header, suggest
from fifthwheel.logs.record import Array, Record, increasing
from fifthwheel.logs.table import Table
from fifthwheel.logs.units import factor, quantity

_TIMES = ("time", "t")


class TimeColumn(BaseModel):
    """The time base of a log."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    column: str
    """Header of the column, with or without its [unit]."""
    unit: str | None = None
    """Default: the header's, else s."""


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

    @field_validator("signals", "reference", mode="before")
    @classmethod
    def _flat(cls, value: Any) -> Any:
        return _channels(value)

    @model_validator(mode="after")
    def _fits(self) -> Self:
        if not self.signals and not self.reference:
            raise ValueError('no signals; name one at least: [signals."yaw_rate.tractor"]')
        for name, channel in (*self.signals.items(), *self.reference.items()):
            si = si_unit(name) or "1"
            try:
                quantity(channel.offset, si)
                factor(channel.unit or si, si)
            except SignalError as error:
                raise SignalError(f"{name}: {error}") from error
        return self

    @classmethod
    def load(cls, path: str | Path) -> "SignalMap":
        """The map in a TOML file."""
        try:
            text = Path(path).read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            raise SignalError(f"{path}: cannot be read ({error}); expected a TOML file in UTF-8") from error
        return cls.parse(text, source=Path(path).name)

    @classmethod
    def parse(cls, text: str, *, source: str = "signals.toml") -> "SignalMap":
        """The map in a TOML text; each thing wrong with it is named, with what might be meant."""
        try:
            return cls.model_validate(tomllib.loads(text))
        except tomllib.TOMLDecodeError as error:
            raise SignalError(f"{source}: not TOML, {error}") from error
        except ValidationError as error:
            raise SignalError("\n".join(f"{source}: {_fault(dict(entry))}" for entry in error.errors())) from error

    @classmethod
    def of_headers(cls, headers: Iterable[str], source: str) -> "SignalMap":
        """The map a table needs none for: its headers are names of signals themselves, "reference." before some."""
        names = [split_header(header)[0] for header in headers]
        found: dict[bool, dict[str, Channel]] = {False: {}, True: {}}
        for name in names:
            signal = name.removeprefix(REFERENCE)
            if si_unit(signal) is not None and signal != "time":
                found[name != signal][signal] = Channel(column=name)
        if not any(found.values()):
            raise SignalError(
                f"{source}: no column has the name of a signal, there is {', '.join(names)}; write a signals.toml that "
                f'says which column is which:\n[signals."yaw_rate.tractor"]\ncolumn = "..."\nunit = "deg/s"'
            )
        return cls(signals=found[False], reference=found[True])

    def apply(self, table: Table, *, name: str) -> Record:
        """The record that the table holds, all on one time base (align.py)."""
        notes = list(table.notes)
        base = self._base(table, notes)
        parts: dict[str, dict[str, Samples]] = {"signals": {}, "reference": {}}
        for part, samples in parts.items():
            for signal, channel in getattr(self, part).items():
                samples[signal] = _samples(signal, channel, table, base, notes)
        time, signals, reference = align(base, **parts)
        return Record(time=time, signals=signals, reference=reference, name=name, notes=tuple(dict.fromkeys(notes)))

    def _base(self, table: Table, notes: list[str]) -> Samples | None:
        """Time of the rows, s, as a signal of itself, NaN where a row has none; None when every channel has its own."""
        column, unit = (self.time.column, self.time.unit) if self.time else (None, None)
        if column is None:
            names = [split_header(header)[0] for header in table.headers]
            column = next((name for name in _TIMES if name in names), None)
            if column is None and all(c.time for c in (*self.signals.values(), *self.reference.values())):
                return None
            if column is None:
                raise SignalError(
                    f"{table.source}: no time, neither {' nor '.join(map(repr, _TIMES))} among {', '.join(names)}; "
                    f'say which column it is:\n[time]\ncolumn = "..."'
                )
        time = _clock(column, unit, table)
        missing = ~np.isfinite(time)
        if missing.any() and not missing.all():
            notes.append(f"time: {missing.sum()} rows left out that have none")
        increasing(time if missing.all() else time[~missing], f"{table.source}: {column}")
        return Samples(time=time, values=time, own=False)


def _clock(column: str, unit: str | None, table: Table) -> Array:
    values, _ = table.numbers(column)
    return values * factor(unit or table.unit(column) or "s", "s")


def _samples(signal: str, channel: Channel, table: Table, base: Samples | None, notes: list[str]) -> Samples:
    """A channel's values in SI at the instants they held."""
    si = si_unit(signal) or "1"
    total = np.zeros(())
    for column in channel.columns:
        values, words = table.numbers(column)
        if words:
            notes.append(f"{signal}: {words} cells of column {column!r} are no numbers, taken as missing")
        total = total + values * factor(channel.unit or table.unit(column) or si, si)
    total = channel.sign * channel.gain * total - quantity(channel.offset, si)
    delay = quantity(channel.delay, "s")
    if channel.time is None:
        if base is None:
            raise SignalError(f"{signal}: no time; name its column, time = '...', or that of all rows under [time]")
        return Samples(time=base.time - delay, values=total, own=delay != 0)
    stamps = _clock(channel.time, None, table)
    fresh = np.isfinite(stamps) & np.isfinite(total)
    fresh[fresh] = np.concatenate([[True], np.diff(stamps[fresh]) != 0])[
        : fresh.sum()
    ]  # a stamp held is the same sample
    time = increasing(stamps[fresh], f"{table.source}: {channel.time}")
    return Samples(time=time - delay, values=total[fresh], own=True)


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
