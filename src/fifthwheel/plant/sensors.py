"""Sensors: from the truth to what a log would hold. Each signal has one, a file of tables describes them.

[speed]
noise = "0.1 km/h"                  # standard deviation; or variance, a number in SI squared
rate = "10 Hz"                      # missing between its own samples
latency = "120 ms"

["yaw_rate.tractor"]
noise = "0.2 deg/s"
bias = "0.1 deg/s"
misalignment = "1 deg"
quantisation = "0.01 deg/s"
dropout = "2 %"                     # mean part of the time without a reading
dropout_length = "0.5 s"
"""

import math
import tomllib
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fifthwheel.errors import SignalError
from fifthwheel.logs.names import is_input, known, si_unit, suggest
from fifthwheel.logs.noise import article_gyros
from fifthwheel.logs.units import quantity
from fifthwheel.vehicle import Vehicle

Array = NDArray[np.float64]

_ACROSS = {"yaw_rate": ("roll_rate", 1.0), "roll_rate": ("yaw_rate", -1.0)}
"""What a gyro of either kind reads of the other rate when it is turned about the lateral axis."""


@dataclass(frozen=True, kw_only=True)
class Sensor:
    """One sensor, in SI. Its effects come in the order of the fields from misalignment to dropout."""

    misalignment: float = 0.0
    """Angle a by which a yaw or roll gyro is turned about the unit's lateral axis, rad. With roll rate p and yaw rate r
    a yaw gyro reads r cos a + p sin a, a roll gyro p cos a - r sin a; other sensors have none."""
    latency: float = 0.0
    """How old a reading is when it is logged, s; before the drive the first value held."""
    scale: float = 1.0
    """Gain; 1 is right."""
    bias: float = 0.0
    """What is read at zero."""
    variance: float = 0.0
    """Of white noise, SI squared, a sample; bandwidth and sampling rate do not change it."""
    quantisation: float = 0.0
    """Step between two readings; 0 for none."""
    rate: float | None = None
    """Readings a second, Hz; None for one at every sample. Between its own samples a reading is missing."""
    dropout: float = 0.0
    """Mean part of the time without a reading, 0 to below 1."""
    dropout_length: float = 0.2
    """Mean length of a stretch without readings, s; lengths are exponential, and so are those between."""

    def __post_init__(self) -> None:
        quarter = math.pi / 4
        allowed = {
            "misalignment": (-quarter <= self.misalignment <= quarter, "-pi/4 to pi/4 rad; is it in degrees?"),
            "latency": (self.latency >= 0, "0 s or more; no sensor knows what comes"),
            "scale": (self.scale != 0, "a number other than 0; leave out a sensor that is dead"),
            "bias": (True, "a finite number; leave it out for none"),
            "variance": (self.variance >= 0, "0 or more; give 0 for no noise"),
            "quantisation": (self.quantisation >= 0, "0 or more; give 0 for no steps"),
            "rate": (self.rate is None or self.rate > 0, "above 0 Hz; leave it out for every sample"),
            "dropout": (0 <= self.dropout < 1, "0 to below 1; leave out a sensor that never reads"),
            "dropout_length": (self.dropout_length > 0, "above 0 s; give dropout = 0 for none"),
        }
        for name, (fine, expected) in allowed.items():
            value = getattr(self, name)
            if not fine or not (value is None or math.isfinite(value)):
                raise SignalError(f"{name}: got {value}, expected {expected}")


def article(vehicle: Vehicle) -> dict[str, Sensor]:
    """The article's sensors: yaw and roll gyros of every unit with its R, exact speed and first unit's steer angles.

    Cheng and Cebon (2011), equation (12).
    """
    units = [unit.name for unit in vehicle.units]
    exact = ["speed", *(name for name in vehicle.steer_signals() if name.startswith(f"steer.{units[0]}."))]
    return {name: Sensor() for name in exact} | {
        name: Sensor(variance=variance) for name, variance in article_gyros(units).items()
    }


def observe(
    time: Array, truth: Mapping[str, Array], sensors: Mapping[str, Sensor], *, seed: int = 0
) -> dict[str, Array]:
    """What the sensors read, (N,) each, NaN where there is no reading.

    The same seed gives the same readings. The noise of a sensor comes from the seed and its name, its dropouts from a
    stream of their own, so neither depends on which other sensors there are.

    Args:
        time: (N,) s, increasing.
        truth: (N,) values in SI by signal, those of the sensors among them; and the other rate of a misaligned gyro.
        sensors: by signal.
        seed: 0 or more.

    Raises:
        SignalError: a sensor of a signal that the truth does not have; a misalignment of what is no gyro.
    """
    if seed < 0:
        raise SignalError(f"seed: expected 0 or more, got {seed}")
    return {name: _reading(name, sensor, time, truth, seed) for name, sensor in sensors.items()}


def _reading(name: str, sensor: Sensor, time: Array, truth: Mapping[str, Array], seed: int) -> Array:
    _fits(name, sensor)
    stream = zlib.crc32(name.encode())
    value = _of(name, truth, len(time))
    if sensor.misalignment:
        kind, _, unit = name.partition(".")
        across, sign = _ACROSS[kind]
        other = _of(f"{across}.{unit}", truth, len(time))
        value = value * math.cos(sensor.misalignment) + other * sign * math.sin(sensor.misalignment)
    if sensor.latency:
        value = np.interp(time - sensor.latency, time, value)
    noise = np.random.default_rng([seed, stream, 0]).normal(size=len(time))
    value = sensor.scale * value + sensor.bias + math.sqrt(sensor.variance) * noise
    if sensor.quantisation:
        value = np.round(value / sensor.quantisation) * sensor.quantisation
    missing = np.zeros(len(time), dtype=bool)
    if sensor.rate is not None:
        ticks = np.floor((time - time[0]) * sensor.rate + 1e-6)  # a reading at the first sample since each tick
        missing[1:] = np.diff(ticks) == 0
        missing[-1] &= not is_input(name)  # a model needs its inputs at both ends
    if sensor.dropout:
        missing |= _dropped(sensor, time, np.random.default_rng([seed, stream, 1]))
    value[missing] = np.nan
    return value


def _dropped(sensor: Sensor, time: Array, draw: np.random.Generator) -> NDArray[np.bool_]:
    """(N,) whether a reading is lost: a switch that stays exponential times in either position."""
    on = sensor.dropout_length * (1 - sensor.dropout) / sensor.dropout  # mean length of a stretch with readings, s
    out = bool(draw.random() < sensor.dropout)
    ends, end, lost = list[float](), float(time[0]), out
    while end <= time[-1]:
        end += draw.exponential(sensor.dropout_length if lost else on)
        ends.append(end)
        lost = not lost
    switched: NDArray[np.bool_] = np.searchsorted(ends, time, side="right") % 2 == 1
    return switched ^ out


def _of(name: str, truth: Mapping[str, Array], size: int) -> Array:
    if name not in truth:
        raise SignalError(f"{name}: the truth does not have it; {suggest(name, sorted(truth))}")
    value = np.asarray(truth[name], dtype=np.float64)
    if value.shape != (size,):
        raise SignalError(f"{name}: expected {size} values, one for each time, got shape {value.shape}")
    return value


def _fits(name: str, sensor: Sensor) -> None:
    known(name)
    if sensor.misalignment and name.partition(".")[0] not in _ACROSS:
        raise SignalError(f"{name}: misalignment is of yaw_rate and roll_rate only; leave it out, or give it a gyro")


def load(path: str | Path) -> dict[str, Sensor]:
    """The sensors in a TOML file: a table for each signal, texts with units or bare numbers in SI; see above."""
    try:
        text = Path(path).read_text(encoding="utf-8")
        tables = tomllib.loads(text)
    except (OSError, UnicodeDecodeError) as error:
        raise SignalError(f"{path}: cannot be read ({error}); expected a TOML file in UTF-8") from error
    except tomllib.TOMLDecodeError as error:
        raise SignalError(f"{Path(path).name}: not TOML, {error}; correct that line") from error
    try:
        return {name: _sensor(name, table) for name, table in _flat(tables).items()}
    except SignalError as error:
        raise SignalError(f"{Path(path).name}: {error}") from error


def _flat(tables: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """Tables by signal: [yaw_rate.tractor] without quotes is [yaw_rate] with a table inside to TOML, but means one."""
    found: dict[str, dict[str, Any]] = {}
    for name, table in tables.items():
        if not isinstance(table, dict):
            raise SignalError(f'{name}: expected a table for each signal, got {table!r}; write ["yaw_rate.tractor"]')
        if table and all(isinstance(inner, dict) for inner in table.values()):
            found |= {f"{name}.{inner}": entry for inner, entry in _flat(table).items()}
        else:
            found[name] = table
    return found


def _sensor(name: str, table: Mapping[str, Any]) -> Sensor:
    si = si_unit(known(name)) or "1"
    units = {"bias": si, "noise": si, "quantisation": si, "misalignment": "rad", "latency": "s", "dropout_length": "s"}
    units["rate"] = "Hz"
    keys = [field.name for field in fields(Sensor)] + ["noise"]
    given: dict[str, float] = {}
    for key, value in table.items():
        if key not in keys:
            raise SignalError(f"{name}.{key}: no such key; {suggest(key, keys)}")
        if isinstance(value, bool) or not isinstance(value, (int, float, str)):
            raise SignalError(f"{name}.{key}: expected a number, or a text with its unit, got {value!r}")
        try:
            given[key] = quantity(value, units.get(key, "1"))
        except SignalError as error:
            raise SignalError(f"{name}.{key}: {error}") from error
    if "noise" in given:
        if "variance" in given:
            raise SignalError(f"{name}: noise and variance say the same thing; keep one")
        if given["noise"] < 0:
            raise SignalError(f"{name}.noise: expected a standard deviation of 0 or more, got {table['noise']}")
        given["variance"] = given.pop("noise") ** 2
    try:
        sensor = Sensor(**given)
        _fits(name, sensor)
    except SignalError as error:
        raise SignalError(str(error) if str(error).startswith(name) else f"{name}.{error}") from error
    return sensor
