"""Steer angle from lateral acceleration by the linear model, and lateral acceleration from steer angle."""

import numpy as np

from fifthwheel.base.types import Array
from fifthwheel.data.record import Record
from fifthwheel.model import dynamics
from fifthwheel.model.dynamics.simulation import free_response
from fifthwheel.truck import Vehicle

DECAY_TIME = 20.0
"""Time without lateral acceleration after a manoeuvre, s, in which the steer angle decays."""
CUTOFF = 10.0
"""Highest frequency of a driver's steer angle, Hz."""


def inverse_steer(vehicle: Vehicle, speed: float, time: Array, acceleration: Array, *, roll: bool = True) -> Array:
    """Steer angle (N,), rad, of the first steered axle for a lateral acceleration (N,) of the first unit's CoG, m/s^2.

    Inverts the linear model in the frequency domain, up to `CUTOFF`. The inverse is periodic, so `DECAY_TIME` without
    acceleration is appended and removed again: otherwise the decay after the end would appear at the start.

    Args:
        vehicle: truck, stable at this speed.
        speed: constant, m/s.
        time: (N,), in equal steps, s.
        acceleration: (N,), m/s^2.
        roll: use the yaw-roll model, or the yaw model.
    """
    if not acceleration.any():
        return np.zeros_like(time)
    step = float(time[1] - time[0])
    size = len(time) + round(DECAY_TIME / step)
    spectrum = np.fft.rfft(acceleration, size)
    frequency = np.fft.rfftfreq(size, step)
    m = dynamics.matrices(vehicle, speed, roll=roll)
    response = dynamics.frequency_response(vehicle, speed, frequency, roll=roll)[:, :, 0]
    lateral = m.states.index(f"lateral_velocity.{vehicle.units[0].name}")
    yaw = m.states.index(f"yaw_rate.{vehicle.units[0].name}")
    gain = 2j * np.pi * frequency * response[:, lateral] + speed * response[:, yaw]
    low_pass = 1 / (1 + (frequency / CUTOFF) ** 4)
    return np.fft.irfft(spectrum / gain * low_pass, size)[: len(time)]


def lateral_acceleration(vehicle: Vehicle, speed: float, steer: Array, rate: float) -> Array:
    """Lateral acceleration (N, units), m/s^2, of every unit's CoG by a steer angle (N,), rad.

    The truck is stable at the constant speed, m/s; the sampling rate is in Hz.
    """
    names = [unit.name for unit in vehicle.units]
    outputs = [f"{quantity}.{name}" for quantity in ("lateral_velocity", "yaw_rate") for name in names]
    model = dynamics.model(vehicle, outputs, roll=True)
    record = steer_record(vehicle, speed, steer, rate, "response")
    values = dynamics.all_parameters(vehicle, outputs)
    _, response = free_response(model, values, record.time, {name: record.signals[name] for name in model.inputs})
    velocity, yaw_rate = response[:, : len(names)], response[:, len(names) :]
    return np.asarray(np.gradient(velocity, 1 / rate, axis=0) + speed * yaw_rate)


def steer_record(vehicle: Vehicle, speed: float, steer: Array, rate: float, name: str) -> Record:
    """Record of time, speed and steer angles: the first steered axle has the angle (N,), all others have 0."""
    first, *others = vehicle.steer_signals()
    straight = {other: np.zeros_like(steer) for other in others}
    signals = {"speed": np.full_like(steer, speed), first: steer, **straight}
    return Record(time=np.arange(len(steer)) / rate, signals=signals, name=name)
