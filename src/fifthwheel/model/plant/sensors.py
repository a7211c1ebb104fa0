"""Sensors: from true signals to the measured signals of a log. A TOML file has one table for each sensor.

[speed]
noise = "0.1 km/h"                  # standard deviation; or variance, a number in SI squared
rate = "10 Hz"                      # no value between the samples of the sensor
held = true                         # but the last one again, as loggers of a bus write it
latency = "120 ms"

["yaw_rate.tractor"]
noise = "0.2 deg/s"
bias = "0.1 deg/s"
misalignment = "1 deg"
quantisation = "0.01 deg/s"
dropout = "2 %"                     # mean fraction of the time without a value
dropout_length = "0.5 s"
"""

import math
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fifthwheel.base.errors import FifthwheelError, SignalError, suggestion
from fifthwheel.base.input_files import flat_tables, parse_toml, read_toml
from fifthwheel.base.types import Array
from fifthwheel.base.units import quantity
from fifthwheel.data.channels import SignalName, checked_name, is_input, si_unit
from fifthwheel.data.record.derived import article_gyro_variance
from fifthwheel.model.plant.bodies import SIDES
from fifthwheel.model.plant.powertrain import DrivenTruck
from fifthwheel.truck import Vehicle

_CROSS_AXIS = {"yaw_rate": ("roll_rate", 1.0), "roll_rate": ("yaw_rate", -1.0)}
"""The rate that a misaligned gyro measures besides its own, and its sign."""
SPEED_STEP = 1 / 256 / 3.6
"""Resolution of speeds in SAE J1939-71, m/s."""


@dataclass(frozen=True, kw_only=True)
class Sensor:
    """One sensor, in SI. Its effects apply in the order of the fields from misalignment to dropout.

    Raises:
        SignalError: a value outside its range.
    """

    misalignment: float = 0.0
    """Angle a by which a yaw or roll gyro is rotated about the lateral axis of the unit, rad. With roll rate p and yaw
    rate r, a yaw gyro measures r cos a + p sin a and a roll gyro p cos a - r sin a; other sensors have none."""
    latency: float = 0.0
    """Age of a value when it is logged, s; before the start of the run the first value applies."""
    scale: float = 1.0
    """Scale factor; 1 is exact."""
    bias: float = 0.0
    """Measured value at a true value of 0."""
    variance: float = 0.0
    """Variance of the white noise of each sample, SI squared; it does not depend on the sampling rate."""
    quantisation: float = 0.0
    """Step between two measured values; 0: none."""
    rate: float | None = None
    """Sampling rate of the sensor, Hz; None: a value at every sample of the record. Samples between are NaN."""
    held: bool = False
    """Whether the last value is repeated until the next sample of `rate`, as in the table of a logger on a bus."""
    dropout: float = 0.0
    """Mean fraction of the time without a value, 0 to below 1."""
    dropout_length: float = 0.2
    """Mean duration of a dropout, s; the durations of dropouts, and of the times between, are exponential."""

    def __post_init__(self) -> None:
        quarter = math.pi / 4
        ranges = {
            "misalignment": (-quarter <= self.misalignment <= quarter, "-pi/4 to pi/4 rad; is it in degrees?"),
            "latency": (self.latency >= 0, "0 s or more; correct the sign"),
            "scale": (self.scale != 0, "a number other than 0; leave out a sensor that measures nothing"),
            "bias": (True, "a finite number; leave it out for 0"),
            "variance": (self.variance >= 0, "0 or more; give 0 for no noise"),
            "quantisation": (self.quantisation >= 0, "0 or more; give 0 for no quantisation"),
            "rate": (self.rate is None or self.rate > 0, "above 0 Hz; leave it out for every sample"),
            "held": (not self.held or self.rate is not None, "a rate too; give the rate of the messages"),
            "dropout": (0 <= self.dropout < 1, "0 to below 1; leave out a sensor without any value"),
            "dropout_length": (self.dropout_length > 0, "above 0 s; give dropout = 0 for no dropouts"),
        }
        for name, (valid, expected) in ranges.items():
            value = getattr(self, name)
            if not valid or not (value is None or math.isfinite(value)):
                raise SignalError(f"{name}: got {value}, expected {expected}")


def article_sensors(vehicle: Vehicle) -> dict[str, Sensor]:
    """The sensors of Cheng and Cebon (2011), by signal.

    Yaw and roll gyros of every unit with the variances of equation (12); exact speed and exact steer angles of the
    first unit.
    """
    units = [unit.name for unit in vehicle.units]
    exact = ["speed", *(name for name in vehicle.steer_signals() if SignalName.of(name).unit == units[0])]
    return {name: Sensor() for name in exact} | {
        name: Sensor(variance=variance) for name, variance in article_gyro_variance(units).items()
    }


def driveline_sensors(driven: DrivenTruck, unit: str = "tractor") -> dict[str, Sensor]:
    """The sensors of driving with the errors of the truck and the resolution of SAE J1939-71, by signal.

    CCVS, 10 values a second; EEC1 and EEC3 with 1 % of the reference torque; the state of driveline and brakes, with
    the switch of the brakes in `unit`.
    """
    per_cent = driven.max_torque / 100
    speed = Sensor(
        latency=driven.speed_delay, scale=driven.speed_scale, variance=0.01**2, quantisation=SPEED_STEP, rate=10.0
    )
    return {
        "speed": speed,
        "engine_speed": Sensor(quantisation=math.pi / 240),
        "engine_torque": Sensor(scale=driven.torque_scale, bias=driven.torque_offset, quantisation=per_cent),
        "friction_torque": Sensor(quantisation=per_cent),
        "driveline_engaged": Sensor(),
        f"braking.{unit}": Sensor(),
    }


def bus_sensors(vehicle: Vehicle, driven: DrivenTruck) -> dict[str, Sensor]:
    """`driveline_sensors`, and wheel speeds of every axle (EBC2, HRW) with a noise of 0.02 m/s, 20 values a second."""
    axles = [f"{unit.name}.{axle.name}" for unit in vehicle.units for axle in unit.on_road]
    wheel = Sensor(variance=0.02**2, quantisation=SPEED_STEP, rate=20.0)
    wheels = {f"wheel_speed.{axle}.{side}": wheel for axle in axles for side in SIDES}
    return driveline_sensors(driven, vehicle.units[0].name) | wheels


def measure(
    time: Array, truth: Mapping[str, Array], sensors: Mapping[str, Sensor], *, seed: int = 0
) -> dict[str, Array]:
    """Measured signals, (N,) each, NaN where a sensor has no value.

    The same seed gives the same values. The noise of a sensor depends on the seed and its name only, and so do its
    dropouts, on a random stream of their own.

    Args:
        time: (N,) s, increasing.
        truth: (N,) true values in SI by signal; for a misaligned gyro also the other rate of its unit.
        sensors: by signal.
        seed: 0 or more.

    Raises:
        SignalError: a true signal is missing or has another length; a misaligned sensor is not a gyro.
    """
    if seed < 0:
        raise SignalError(f"seed: expected 0 or more, got {seed}; correct it")
    return {name: _measured(name, sensor, time, truth, seed) for name, sensor in sensors.items()}


def _measured(name: str, sensor: Sensor, time: Array, truth: Mapping[str, Array], seed: int) -> Array:
    _check_name(name, sensor)
    stream = zlib.crc32(name.encode())
    value = _true_values(name, truth, len(time))
    if sensor.misalignment:
        signal = SignalName.of(name)
        cross_axis, sign = _CROSS_AXIS[signal.quantity]
        other = _true_values(f"{cross_axis}.{signal.place}", truth, len(time))
        value = value * math.cos(sensor.misalignment) + other * sign * math.sin(sensor.misalignment)
    if sensor.latency:
        value = np.interp(time - sensor.latency, time, value)
    noise = np.random.default_rng([seed, stream, 0]).normal(size=len(time))
    value = sensor.scale * value + sensor.bias + math.sqrt(sensor.variance) * noise
    if sensor.quantisation:
        value = np.round(value / sensor.quantisation) * sensor.quantisation
    missing = np.zeros(len(time), dtype=bool)
    if sensor.rate is not None:
        ticks = np.floor((time - time[0]) * sensor.rate + 1e-6)  # a value at the first sample after each tick
        missing[1:] = np.diff(ticks) == 0
        if sensor.held:
            value = value[np.maximum.accumulate(np.where(missing, 0, np.arange(len(time))))]
            missing[:] = False
        missing[-1] &= not is_input(name)  # a model needs its inputs at both ends
    if sensor.dropout:
        missing |= _dropouts(sensor, time, np.random.default_rng([seed, stream, 1]))
    value[missing] = np.nan
    return value


def _dropouts(sensor: Sensor, time: Array, random: np.random.Generator) -> NDArray[np.bool_]:
    """(N,) True where a value is lost: a switch between two states, each with exponential durations."""
    mean_between = sensor.dropout_length * (1 - sensor.dropout) / sensor.dropout  # mean time between dropouts, s
    starts_lost = bool(random.random() < sensor.dropout)
    ends, end, lost = list[float](), float(time[0]), starts_lost
    while end <= time[-1]:
        end += random.exponential(sensor.dropout_length if lost else mean_between)
        ends.append(end)
        lost = not lost
    switched: NDArray[np.bool_] = np.searchsorted(ends, time, side="right") % 2 == 1
    return switched ^ starts_lost


def _true_values(name: str, truth: Mapping[str, Array], size: int) -> Array:
    if name not in truth:
        raise SignalError(f"{name}: missing in the true signals; {suggestion(name, sorted(truth))}")
    value = np.asarray(truth[name], dtype=np.float64)
    if value.shape != (size,):
        raise SignalError(
            f"{name}: expected {size} true values, one for each instant, got shape {value.shape}; correct the array"
        )
    return value


def _check_name(name: str, sensor: Sensor) -> None:
    checked_name(name)
    if sensor.misalignment and SignalName.of(name).quantity not in _CROSS_AXIS:
        raise SignalError(f"{name}: misalignment applies to yaw_rate and roll_rate only; leave it out")


def read_sensors(path: str | Path) -> dict[str, Sensor]:
    """Sensors by signal from a TOML file, with numbers in SI or texts with a unit; see the docstring of this module.

    A SignalError if the file is not readable, or a table, key or value in it is not valid.
    """
    try:
        text = read_toml(Path(path))
    except FifthwheelError as error:
        raise SignalError(f"{error}; a TOML file of sensors expected") from None
    try:
        tables = parse_toml(text)
    except FifthwheelError as error:
        raise SignalError(f"{Path(path).name}: not valid TOML, {error}; correct that line") from None
    try:
        return {name: _sensor(name, table) for name, table in flat_tables(tables).items()}
    except SignalError as error:
        raise SignalError(f"{Path(path).name}: {error}") from error


def _sensor(name: str, table: Any) -> Sensor:
    if not isinstance(table, dict):
        raise SignalError(f'{name}: expected a table for each signal, got {table!r}; write ["yaw_rate.tractor"]')
    si = si_unit(checked_name(name)) or "1"
    units = {"bias": si, "noise": si, "quantisation": si, "misalignment": "rad", "latency": "s", "dropout_length": "s"}
    units["rate"] = "Hz"
    keys = [field.name for field in fields(Sensor)] + ["noise"]
    values: dict[str, Any] = {}
    for key, value in table.items():
        if key not in keys:
            raise SignalError(f"{name}.{key}: no such key; {suggestion(key, keys)}")
        if key == "held":
            if not isinstance(value, bool):
                raise SignalError(f"{name}.held: expected true or false, got {value!r}")
            values[key] = value
            continue
        if isinstance(value, bool) or not isinstance(value, (int, float, str)):
            raise SignalError(f"{name}.{key}: expected a number, or a text with a number and a unit, got {value!r}")
        try:
            values[key] = quantity(value, units.get(key, "1"))
        except SignalError as error:
            raise SignalError(f"{name}.{key}: {error}") from error
    if "noise" in values:
        if "variance" in values:
            raise SignalError(f"{name}: expected noise or variance, got both; keep one")
        if values["noise"] < 0:
            raise SignalError(f"{name}.noise: expected a standard deviation of 0 or more, got {table['noise']}")
        values["variance"] = values["noise"] * values.pop("noise")  # a power can overflow
    try:
        sensor = Sensor(**values)
        _check_name(name, sensor)
    except SignalError as error:
        raise SignalError(str(error) if str(error).startswith(name) else f"{name}.{error}") from error
    return sensor
