"""signals.toml: the map from the columns of a log to signals; `docs/signals.md` lists its keys, with an example."""

from collections.abc import Iterable, Mapping
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    ModelWrapValidatorHandler,
    PrivateAttr,
    ValidationError,
    model_validator,
)

from fifthwheel.base.errors import FifthwheelError, SignalError, suggestion
from fifthwheel.base.input_files import flat_tables, parse_toml, read_toml, require_inside
from fifthwheel.base.names import split_source
from fifthwheel.base.types import Array
from fifthwheel.base.units import factor, quantity, split_statement, uncertain_quantity
from fifthwheel.data.channels import REFERENCE, SensorErrorName, checked_name, si_unit, split_header, split_reference
from fifthwheel.data.channels.sensors import SensorPrior

MAX_DELAY = 60.0
"""Largest delay, s: a sensor or a bus has less than a second, a logger that was started by hand some seconds."""


def _sampling_rate(value: float | str) -> float:
    rate = quantity(value, "Hz")
    if not rate >= 1.0:
        raise ValueError(f"at least 1 Hz expected, got {rate:g} Hz")
    return rate


def _rising(value: tuple[tuple[float, float], ...]) -> tuple[tuple[float, float], ...]:
    if len(value) < 2:
        raise ValueError(f"at least 2 pairs of numbers expected, got {len(value)}; add points of the calibration")
    if any(b[0] <= a[0] for a, b in pairwise(value)):
        raise ValueError("the first numbers of the pairs must increase; sort the pairs")
    return value


def _channels(value: Any) -> Any:
    """Channels by signal, from the short form (name of a column) and nested tables, [signals.yaw_rate.tractor]."""
    if not isinstance(value, Mapping):
        return value
    return {n: {"column": c} if isinstance(c, str) else c for n, c in flat_tables(value).items()}


def _plausible_delay(value: float | str) -> float | str:
    delay = quantity(value, "s")
    if not abs(delay) <= MAX_DELAY:
        raise ValueError(
            f"expected at most {MAX_DELAY:g} s, got {delay:g} s; the clock of this logger may be in another time zone"
            " or in summer time: correct its timestamps"
        )
    return value


Rate = Annotated[float | str, AfterValidator(_sampling_rate)]
Seconds = Annotated[float | str, AfterValidator(partial(quantity, si="s"))]
Points = Annotated[tuple[tuple[float, float], ...], AfterValidator(_rising)]
Name = Annotated[str, AfterValidator(checked_name)]
_CORRECTED = {"gain": "1", "offset": "0", "delay": "0"}
"""Errors that the map corrects, with the value of an ideal sensor."""


class TimeColumn(BaseModel):
    """The time base of a log."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    column: str | None = None
    """Header of the time column of a table, with or without its [unit]. Default: "time" or "t"."""
    unit: str | None = None
    """Default: that of the header, else s."""
    rate: Rate = 100.0
    """Sampling rate, Hz; channels with 2.5 times this rate or more are decimated to it, without aliasing."""
    start: Seconds | None = None
    """Earlier samples are left out, s."""
    stop: Seconds | None = None
    """Later samples are left out, s."""


class SignalSource(BaseModel):
    """Source of a signal: sign * gain * column in SI - offset, at timestamp - delay; of a rate also the derivative."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    column: str | None = None
    """Header of the column, with or without its [unit]."""
    sum: tuple[str, ...] | None = Field(default=None, min_length=1)
    """Instead of column: columns whose sum is the signal, all in one unit."""
    unit: str | None = None
    """Default: that of the header, else the SI unit of the signal."""
    sign: Literal[1, -1] = 1
    """-1 where the log's sign is opposite to ISO 8855 (positive to the left)."""
    gain: float = Field(default=1.0, allow_inf_nan=False)
    """Factor, such as 1 / steering ratio; "0.05 +- 2 %" with its uncertainty."""
    offset: float | str = 0.0
    """Subtracted last; a number in SI, or a text with a unit: "0.1 deg", also with its uncertainty."""
    derivative: bool = False
    """The rate is the derivative of the column, an angle: a course or heading, which is clockwise, needs sign = -1."""
    points: Points | None = None
    """Calibration: pairs of the column's value and the value in `unit`; piecewise linear, extrapolated at the ends."""
    missing: tuple[float, ...] | None = None
    """Numbers of the column that stand for a missing sample: [999]. Default: those that the samples show."""
    delay: Annotated[Seconds, AfterValidator(_plausible_delay)] = 0.0
    """Time by which the timestamps are late, at most 60 s; s, or a text: "200 ms", also with its uncertainty."""
    time: str | None = None
    """Column with the channel's own timestamps, where the log has several rates."""
    clock: str | None = None
    """Name of the time base, such as the logger that gave the timestamps, if it is not the common one."""
    sensor: str = ""
    """Class of the sensor, one of `SENSOR_CLASSES`: the usual errors that remain."""
    misalignment: float | str | None = None
    """Of a gyro: prior mean and "+-" its standard deviation, rad, or a text with units."""
    play: float | str | None = None
    """Between steer sensor and road wheels: the same, rad at the wheels."""
    noise: float | str | None = None
    """Standard deviation, SI, or a text with a unit."""
    _uncertain: dict[str, str] = PrivateAttr(default_factory=dict)
    """The texts of gain, offset and delay that state an uncertainty."""

    @model_validator(mode="wrap")
    @classmethod
    def _split(cls, data: Any, handler: ModelWrapValidatorHandler[Self]) -> Self:
        """Gain, offset and delay without their "+- ...", which `stated` has."""
        if not isinstance(data, Mapping):
            return handler(data)
        parts = {key: split_statement(data[key]) for key in _CORRECTED if isinstance(data.get(key), str)}
        values = {key: value or _CORRECTED[key] for key, (value, mark, _) in parts.items() if mark}
        source = handler({**data, **values})
        source._uncertain.update({key: data[key] for key in values})
        return source

    @model_validator(mode="after")
    def _one_source(self) -> Self:
        if (self.column is None) == (self.sum is None):
            raise ValueError("either column = ... or sum = [...] expected; give one of them")
        return self

    def with_uncertain(self, **texts: str) -> Self:
        """The same source with other texts, which state an uncertainty, of gain, offset or delay."""
        return type(self).model_validate(self.model_dump(exclude_unset=True) | self._uncertain | texts)

    def text_of(self, key: str) -> str:
        """Gain, offset or delay as in a signals.toml, without quotes."""
        value = getattr(self, key)
        return self._uncertain.get(key) or (value if isinstance(value, str) else f"{value:g}")

    def calibrated(self, values: Array, log_unit: str | None, si: str) -> Array:
        """Values (n,) of a column in the SI unit `si`; `log_unit` is the unit in the log."""
        if self.points is None:
            return values * factor(self.unit or log_unit or si, si)
        x, y = np.array(self.points).T
        k = np.clip(np.searchsorted(x, values) - 1, 0, x.size - 2)
        calibrated = y[k] + (values - x[k]) * ((y[k + 1] - y[k]) / (x[k + 1] - x[k]))
        return np.asarray(calibrated) * factor(self.unit or si, si)

    def converted(self, columns: Iterable[tuple[Array, str | None]], si: str) -> Array:
        """The signal (n,) in the SI unit `si`, without the delay, from the values and log units of its columns."""
        total = sum(self.calibrated(values, log_unit, si) for values, log_unit in columns)
        return np.asarray(self.sign * self.gain * total - quantity(self.offset, si))

    def si(self, signal: str) -> str:
        """SI unit of the column of a signal."""
        return "rad" if self.derivative else si_unit(signal) or "1"

    def stated(self, signal: str) -> SensorPrior:
        """What the keys state of the sensor of a signal.

        A SignalError if a text is not a quantity with its standard deviation.
        """
        errors: dict[str, tuple[float, float | None]] = {}
        others = {"misalignment": self.misalignment, "play": self.play, "noise": self.noise}
        for kind, text in (self._uncertain | {k: v for k, v in others.items() if v is not None}).items():
            si = SensorErrorName(signal, kind).unit or "1"
            without_value = isinstance(text, str) and not split_statement(text)[0]
            try:
                value, sigma = uncertain_quantity(
                    f"{_CORRECTED.get(kind, 0)} {si} {text}" if without_value else text, si, strict=kind == "gain"
                )
            except SignalError as error:
                raise SignalError(f"{kind}: {error}") from None
            if kind == "gain":
                if not value:
                    raise SignalError("gain: expected another number than 0; give the factor of the column")
                value, sigma = 1.0, (sigma or 0.0) / abs(value)
            errors[kind] = (0.0 if kind in ("offset", "delay") else value), sigma
        noise, of_noise = errors.pop("noise", (None, None))
        if of_noise is not None:
            raise SignalError("noise: expected one standard deviation, without '+-'; remove it")
        return SensorPrior(sensor_class=self.sensor, errors=errors, noise=noise)

    @property
    def columns(self) -> tuple[str, ...]:
        """The column, or the columns of the sum."""
        return self.sum or (self.column or "",)


def relative_keys(signal: str) -> str:
    """How to map a column in percent of a reference value."""
    return f'unit = "{(si := si_unit(signal))}" and gain = reference in {si} / 100'


def relative_cure(signal: str, unit: str | None) -> str:
    """What to do where the unit of a signal is "%"; empty for another unit."""
    return f"; in percent of a reference: set {relative_keys(signal)} in signals.toml" if unit == "%" else ""


Channels = Annotated[dict[Name, SignalSource], BeforeValidator(_channels)]


class SignalMap(BaseModel):
    """The map from the columns of a log to signals, normally read from a signals.toml.

    Example:
        >>> import fifthwheel as fw
        >>> signal_map = fw.SignalMap.parse('''
        ... [signals]
        ... speed = "vx [km/h]"
        ... "yaw_rate.tractor" = { column = "gyro", unit = "deg/s", sign = -1 }
        ... ''')
        >>> signal_map.signals["yaw_rate.tractor"].sign
        -1
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    time: TimeColumn = TimeColumn()
    """Default: the column "time" or "t"."""
    signals: Channels = Field(default_factory=dict)
    """Signals for the estimators."""
    reference: Channels = Field(default_factory=dict)
    """Reference signals, for comparison only."""
    ignore: tuple[str, ...] = ()
    """Columns or signals to leave out; other columns with names of signals are used without a map."""
    databases: tuple[Path, ...] = ()
    """DBC or ARXML files for CAN frames, relative to the folder of the map, and in it or below."""

    @model_validator(mode="after")
    def _fits(self) -> Self:
        names: dict[tuple[str, str | None], str] = {}
        for other, channel in self.signals.items():
            if channel.column is None:
                continue
            if (name := names.setdefault((channel.column, channel.time), other)) != other:
                raise ValueError(
                    f"column {channel.column!r} is mapped to {name} and to {other}; map one of them to another"
                )
        for name, channel in (*self.signals.items(), *self.reference.items()):
            si = si_unit(name) or "1"
            if channel.derivative and si != "rad/s":
                raise ValueError(f"{name}: derivative is of a rate, such as yaw_rate.tractor; remove it")
            try:
                quantity(channel.offset, si)
                factor(channel.unit or channel.si(name), channel.si(name))
                stated = channel.stated(name)
            except SignalError as error:
                raise SignalError(f"{name}: {error}{relative_cure(name, channel.unit)}") from error
            stated.require_fits(name if self.signals.get(name) is channel else f"{REFERENCE}{name}")
        return self

    @property
    def sensors(self) -> dict[str, SensorPrior]:
        """What is stated of the sensors, by signal."""
        stated = {name: channel.stated(name) for name, channel in self.signals.items()}
        return {name: sensor for name, sensor in stated.items() if sensor != SensorPrior()}

    @property
    def rate(self) -> float:
        """Sampling rate to which denser channels are decimated, Hz."""
        return float(self.time.rate)

    @property
    def span(self) -> tuple[float, float]:
        """First and last instant of the record, s."""
        start, stop = self.time.start, self.time.stop
        return -np.inf if start is None else float(start), np.inf if stop is None else float(stop)

    @classmethod
    def load(cls, path: str | Path, *, allow_outside: bool = False) -> "SignalMap":
        """The map in a TOML file.

        Args:
            path: the file.
            allow_outside: accept databases that are not in the folder of the file or below.

        Raises:
            SignalError: the file cannot be read, or a key, a value or a database is not accepted.
        """
        try:
            text = read_toml(Path(path))
        except FifthwheelError as error:
            raise SignalError(f"{error}; a signals.toml expected") from None
        parsed = cls.parse(text, source=Path(path).name)
        folder = Path(path).parent
        databases = tuple(folder / database for database in parsed.databases)
        try:
            for database in () if allow_outside else databases:
                require_inside(database, folder)
        except FifthwheelError as error:
            raise SignalError(f"{Path(path).name}: databases: {error}") from None
        return parsed.model_copy(update={"databases": databases})

    @classmethod
    def parse(cls, text: str, *, source: str = "signals.toml") -> "SignalMap":
        """The map in a TOML text; a SignalError names each fault with its cure."""
        try:
            table = parse_toml(text)
        except FifthwheelError as error:
            raise SignalError(f"{source}: not TOML ({error}); correct the syntax there") from None
        try:
            return cls.model_validate(table)
        except ValidationError as error:
            raise SignalError("\n".join(f"{source}: {_fault(dict(entry))}" for entry in error.errors())) from error

    @staticmethod
    def of_columns(columns: Iterable[str]) -> tuple[dict[str, SignalSource], dict[str, SignalSource]]:
        """Signals and reference signals ("reference.…") of the columns that have names of signals."""
        channels: tuple[dict[str, SignalSource], dict[str, SignalSource]] = ({}, {})
        for column in columns:
            name = split_source(column)[0]
            signal, is_reference = split_reference(name)
            if si_unit(signal) is not None and signal != "time":
                channels[is_reference][signal] = SignalSource(column=name)
        return channels

    def completed(self, columns: Iterable[str]) -> "SignalMap":
        """The map with the columns that have names of signals, except mapped and ignored ones."""
        used = {c for channel in (*self.signals.values(), *self.reference.values()) for c in channel.columns}
        used |= {split_header(column)[0] for column in used} | set(self.ignore)
        signals, reference = (
            mapped | {n: c for n, c in named.items() if n not in mapped and not {n, c.column} & used}
            for mapped, named in zip((self.signals, self.reference), SignalMap.of_columns(columns), strict=True)
        )
        return self.model_copy(update={"signals": signals, "reference": reference})


def _fault(error: dict[str, Any]) -> str:
    """An error of pydantic as a sentence with the cure."""
    path = [str(step) for step in error["loc"]]
    path = path[:-2] if path[-1:] == ["[key]"] else path
    where = ".".join(path)
    if error["type"] == "extra_forbidden":
        models: dict[int, type[BaseModel]] = {1: SignalMap, 2: TimeColumn}
        model = models.get(len(path), SignalSource)
        return f"{where}: unknown key; {suggestion(path[-1], list(model.model_fields))}"
    if error["type"] == "value_error":
        return f"{where}: {error['ctx']['error']}" if where else str(error["ctx"]["error"])
    cure = f"write a table [{where}]" if error["type"] in ("dict_type", "model_type") else "correct it"
    return f"{where}: {error['msg'][:1].lower()}{error['msg'][1:]}, got {error['input']!r}; {cure}"
