"""The motion of a truck in a test: its signals on an even time base, without gaps."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np

from fifthwheel.base.errors import SignalError
from fifthwheel.base.formatting import enumerated
from fifthwheel.base.types import Array
from fifthwheel.base.units import STANDARD_GRAVITY
from fifthwheel.data.channels import (
    ARTICULATION,
    CHANNELS,
    LATERAL_ACCELERATION,
    LATERAL_VELOCITY,
    ROLL,
    SIDESLIP,
    STEER,
    YAW_RATE,
    SignalName,
    is_of,
)
from fifthwheel.data.checks.samples import without_spikes
from fifthwheel.data.record import Record
from fifthwheel.data.record.derived import estimate_noise_variance
from fifthwheel.truck import Vehicle

EVALUATED = (YAW_RATE, ARTICULATION, ROLL, LATERAL_ACCELERATION, SIDESLIP, LATERAL_VELOCITY)
"""Outputs of a test."""
_GAIN_UNITS = {"rad": "1", "rad/s": "1/s", "m/s^2": "m/(s^2 rad)"}
"""Unit of a gain by that of its output."""
LOWEST_RATE = 10.0
"""Least sampling rate, Hz: five times the 2 Hz up to which heavy vehicles are tested (ISO 15037-2)."""
LOWEST_SPEED = 5.0
"""Least speed, m/s."""


@dataclass(frozen=True, kw_only=True)
class MeasuredMotion:
    """Signals of a test, (N,) samples in equal steps."""

    name: str
    """Of the record."""
    time: Array
    """s."""
    speed: Array
    """m/s."""
    steer: Array
    """Road-wheel angle of the first steered axle, rad."""
    steer_name: str
    signals: Mapping[str, Array]
    """Outputs by name, SI; a lateral acceleration is without g times the roll angle of its unit, if that is logged."""
    units: tuple[str, ...]
    """Front to rear; without a vehicle in the order of their signals."""
    vehicle: Vehicle | None
    notes: tuple[str, ...]
    references: frozenset[str] = frozenset()
    """Outputs that are reference signals."""
    left_out: Mapping[str, str] = field(default_factory=dict)
    """Outputs with a long gap, and the message on it."""

    @property
    def rate(self) -> float:
        """Sampling rate, Hz."""
        return float(1 / (self.time[1] - self.time[0]))

    def output(self, name: str) -> Array:
        """An output (N,); a SignalError where the log does not have it."""
        if name in self.left_out:
            raise SignalError(f"{self.left_out[name]}; this test needs it")
        if name not in self.signals:
            raise SignalError(f"{name}: not in {self.name}; map a column to it in signals.toml, this test needs it")
        return self.signals[name]

    def outputs(self, quantity: str) -> dict[str, Array]:
        """The outputs of a quantity by name, front to rear."""
        names = [f"{quantity}.{unit}" for unit in self.units]
        return {name: self.signals[name] for name in names if name in self.signals}

    def noise(self, name: str) -> float | None:
        """Standard deviation of the white noise of an output or of the steer angle, SI; None for a short log."""
        values = self.steer if name == self.steer_name else self.signals[name]
        variance = estimate_noise_variance(self.time, values)
        return None if variance is None else float(np.sqrt(variance))


def gain_unit(output: str) -> str:
    """Unit of the gain from the steer angle to an output."""
    return _GAIN_UNITS[CHANNELS[SignalName.of(output).quantity].unit]


def motion(record: Record, vehicle: Vehicle | None, *, shortest: float) -> MeasuredMotion:
    """The motion in a record, as measured, without spikes; reference signals count where the log has no other.

    Args:
        record: one run without a pause.
        vehicle: for the order of its units.
        shortest: least duration, s.

    Raises:
        SignalError: steer angle or speed are missing, or the record is too short, too slow, sampled too slowly or
            interrupted.
    """
    first, last = record.span
    if record.rate < 0.99 * LOWEST_RATE:
        raise SignalError(
            f"{record.name}: sampled at {record.rate:.3g} Hz, at least {LOWEST_RATE:g} Hz needed; log at a higher rate"
        )
    if last - first < shortest:
        raise SignalError(
            f"{record.name}: {last - first:.1f} s long, this test needs at least {shortest:g} s; give the whole run"
        )
    if len(record.segments()) > 1:
        raise SignalError(f"{record.name}: has a pause of more than 1 s; cut the record to one run with start and stop")
    given, record = record.signals, without_spikes(record)
    spiky = [name for name, values in given.items() if np.isnan(record.signals[name]).sum() > np.isnan(values).sum()]
    steer_name = first_steer(record, vehicle)
    grid = first + np.arange(np.floor((last - first) * record.rate + 1e-6) + 1) / record.rate

    def on_grid(name: str) -> Array:
        return np.interp(grid, record.time, record.input(name))

    speed, steer = on_grid("speed"), on_grid(steer_name)
    if np.median(speed) < LOWEST_SPEED:
        raise SignalError(
            f"speed: {np.median(speed):.1f} m/s in {record.name}, at least {LOWEST_SPEED:g} m/s needed; check its unit"
        )
    signals, left_out = dict[str, Array](), dict[str, str]()
    referred = {name: values for name, values in record.reference.items() if name not in record.signals}
    record = record.with_signals(referred)
    for name in record.signals:
        if is_of(name, *EVALUATED):
            try:
                signals[name] = on_grid(name)
            except SignalError as error:
                left_out[name] = str(error)
    notes = [f"Spikes are left out: {enumerated(spiky)}."] if spiky else []
    notes += [*record.notes, *(f"left out: {message}" for message in left_out.values())]
    references = {name for name in referred if name in signals}
    for name in [name for name in signals if is_of(name, LATERAL_VELOCITY)]:
        angle = f"{SIDESLIP.quantity}.{SignalName.of(name).unit}"
        if angle not in signals or (angle in references and name not in references):  # measured signals first
            signals[angle] = signals[name] / speed
            references = references | {angle} if name in references else references - {angle}
    for name in [name for name in signals if is_of(name, LATERAL_ACCELERATION)]:
        if (roll := f"{ROLL.quantity}.{SignalName.of(name).unit}") in signals:
            signals[name] = signals[name] - STANDARD_GRAVITY * signals[roll]
        else:
            notes.append(f"{name} contains g times the roll angle, since {roll} is not in the log.")
    if used := [name for name in signals if name in references]:
        notes.append(f"Reference signals are evaluated too: {enumerated(used)}.")
    notes += _unused(record, [steer_name, "speed", *signals])
    seen = dict.fromkeys([SignalName.of(steer_name).unit, *(SignalName.of(name).unit for name in signals)])
    units = tuple(unit.name for unit in vehicle.units) if vehicle else tuple(seen)
    return MeasuredMotion(
        name=record.name,
        time=grid,
        speed=speed,
        steer=steer,
        steer_name=steer_name,
        signals=signals,
        units=units,
        vehicle=vehicle,
        notes=tuple(notes),
        references=frozenset(references),
        left_out=left_out,
    )


def _unused(record: Record, used: list[str]) -> Iterator[str]:
    """What a log has that the evaluation does not use: other steer angles, stated sensors and time bases."""
    if names := [name for name in record.signals if is_of(name, STEER) and name != used[0]]:
        yield f"Other steer angles are not evaluated: {enumerated(names)}."
    if names := [name for name in used if name in record.sensors]:
        yield f"Stated errors of sensors are neither corrected nor in sigma: {enumerated(names)}."
    if names := [name for name in used if name in record.time_bases]:
        yield f"Times contain the time offset of signals on another time base: {enumerated(names)}."


def first_steer(record: Record, vehicle: Vehicle | None) -> str:
    """The steer angle of the first axle that has one."""
    if vehicle is not None:
        return vehicle.with_logged_steering(record.signals, record.name).steer_signals()[0]
    names = [name for name in record.signals if is_of(name, STEER)]
    if not names:
        raise SignalError(
            f"steer.<unit>.<axle>: not in {record.name}; map the road-wheel angle of the steered axle to it in "
            "signals.toml"
        )
    return names[0]
