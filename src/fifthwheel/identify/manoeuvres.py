"""What a driver can be asked to do: courses of lateral acceleration, repeated to the left and to the right in turn."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fifthwheel import dynamics
from fifthwheel.logs import Record
from fifthwheel.simulate import AFTER, LaneChange, response, steer_for
from fifthwheel.vehicle import Vehicle

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Manoeuvre:
    """One manoeuvre at one speed, of unit size: an acceleration of 1 m/s^2 at most of the first unit's CoG.

    Behind it comes another one, the other way round.
    """

    kind: str
    """lane_change, sweep, random or bend."""
    frequency: float | None
    """Of a lane change, Hz."""
    speed: float
    """m/s."""
    period: float
    """s from the start of one to the start of the next."""
    course: Callable[[Array], Array]
    """Time (N,) s since the start to lateral acceleration (N,), zero from `period` on."""

    def steer(self, vehicle: Vehicle, rate: float) -> Array:
        """Steer angle (N,) of the first steered axle for one, and for what still swings behind it, rad."""
        time = np.arange(round((self.period + AFTER) * rate)) / rate
        return steer_for(vehicle, self.speed, time, self.course(time))

    def repeated(self, steer: Array, count: int, rate: float) -> Array:
        """Steer angle (N,) of `count` of them, to either side in turn; the model is linear, so they add."""
        size = round(self.period * rate)
        whole = np.zeros((count - 1) * size + len(steer))
        for k in range(count):
            whole[k * size :][: len(steer)] += (-1) ** k * steer
        return whole[: count * size]


def candidates(speed: float, frequencies: tuple[float, ...]) -> list[Manoeuvre]:
    """All manoeuvres at a speed, m/s: lane changes of these frequencies (Hz), sweep, random steer, bend."""
    found = [_lane_change(speed, frequency) for frequency in frequencies]
    for kind, period, course in (("sweep", 20.0, _sweep), ("random", 20.0, _random), ("bend", 14.0, _bend)):
        found.append(Manoeuvre(kind=kind, frequency=None, speed=speed, period=period, course=course))
    return found


def _lane_change(speed: float, frequency: float) -> Manoeuvre:
    """As in SAE J2179: one period of a sine, 1 s straight before it and 5.5 s or more after it."""
    lane = LaneChange(offset=1 / (2 * np.pi * frequency**2), length=speed / frequency)
    return Manoeuvre(
        kind="lane_change",
        frequency=frequency,
        speed=speed,
        period=lane.period(speed),
        course=lambda time: lane.acceleration(time, speed, 1),
    )


def _sweep(time: Array) -> Array:
    """A sine from 0.2 to 1.2 Hz within 16 s, which needs about one lane; 1 s straight before it, 3 s after it."""
    low, high, length, t = 0.2, 1.2, 16.0, time - 1.0
    phase = 2 * np.pi * (low * t + (high - low) * t**2 / (2 * length))
    return np.sin(phase) * _soft(t, length)


def _random(time: Array) -> Array:
    """A sum of sines from 0.1 to 1 Hz in random phase, for 16 s; always the same."""
    length, t = 16.0, time - 1.0
    frequency = np.arange(2, 17) / length
    phase = np.random.default_rng(0).uniform(0, 2 * np.pi, len(frequency))
    wave = np.sin(2 * np.pi * np.outer(t, frequency) + phase).sum(axis=1) * _soft(t, length)
    return np.asarray(wave / np.abs(wave).max())


def _bend(time: Array) -> Array:
    """Into a curve within 1 s, 6 s along it and out again within 1 s; 1 s straight before it, 5 s after it."""
    return np.interp(time, [1.0, 2.0, 8.0, 9.0], [0.0, 1.0, 1.0, 0.0])


def _soft(time: Array, length: float) -> Array:
    """From 0 to 1 within a second, and back at the end."""
    return np.interp(time, [0.0, 1.0, length - 1.0, length], [0.0, 1.0, 1.0, 0.0])


def lateral(vehicle: Vehicle, speed: float, steer: Array, rate: float) -> Array:
    """Lateral acceleration (N, units) of every unit's CoG for a steer angle (N,) of the first steered axle, m/s^2."""
    names = [unit.name for unit in vehicle.units]
    outputs = [f"{word}.{name}" for word in ("lateral_velocity", "yaw_rate") for name in names]
    model = dynamics.model(vehicle, outputs, roll=True)
    drive = to_record(vehicle, speed, steer, rate, "drive")
    values = dynamics.all_parameters(vehicle, outputs)
    _, seen = response(model, values, drive.time, {name: drive.signals[name] for name in model.inputs})
    v, r = seen[:, : len(names)], seen[:, len(names) :]
    return np.asarray(np.gradient(v, 1 / rate, axis=0) + speed * r)


def to_record(vehicle: Vehicle, speed: float, steer: Array, rate: float, name: str) -> Record:
    """Time, speed and steer angle of the first steered axle, all others straight."""
    first, *others = vehicle.steer_signals()
    still = {other: np.zeros_like(steer) for other in others}
    signals = {"speed": np.full_like(steer, speed), first: steer, **still}
    return Record(time=np.arange(len(steer)) / rate, signals=signals, name=name)
