"""Steer angles over time, without a driver: test methods of ISO 14791, ISO 14792, ISO 14793 and ISO 18375.

All are scaled for a vehicle, by the approximate lateral acceleration of its front axle, m/s^2: an amplitude, unless the
method says otherwise. The speed is in m/s; `lead` is the time straight ahead before, and `duration` that of the run, s.
"""

import math

import numpy as np

from fifthwheel.base.errors import SignalError
from fifthwheel.base.types import Array
from fifthwheel.base.units import STANDARD_GRAVITY
from fifthwheel.model.manoeuvres.accelerations import noise_spectrum, swept_frequency, swept_sine, trapezoid
from fifthwheel.model.manoeuvres.courses import STANDARD_SPEED, OpenLoop, require_positive
from fifthwheel.truck import Vehicle

INTERVAL = 0.01
"""Time between two samples, s."""


def single_track_steer(vehicle: Vehicle, speed: float, acceleration: float, frequency: float = 0.0) -> float:
    """Amplitude of the road-wheel angle, rad, for an amplitude of lateral acceleration of the front axle, m/s^2.

    At 0 Hz a (L / u^2 + m_f / C_f - m_r / C_r), with the static load over g and the cornering stiffness of the first
    unit's front and other axles. At other frequencies that of a truck whose masses are on its axles, without roll and
    trailer: steer / a = m_f / C_f + 1 / (s u) - (1 - G) / (L s^2), G = 1 / (L m_r / C_r s^2 + L / u s + 1). Valid for
    linear tyres, below about 0.3 g; within 30 % of the yaw-roll model.

    Raises:
        SignalError: the first unit is unstable at this speed, m/s.
    """
    return float(acceleration * _steer_gain(vehicle, speed, np.array([frequency]))[0])


def _steer_gain(vehicle: Vehicle, speed: float, frequency: Array) -> Array:
    """Amplitude of the steer angle over that of the lateral acceleration (K,), rad per m/s^2; frequencies (K,), Hz."""
    require_positive("speed", speed)
    unit, loads, wheelbase = vehicle.units[0], vehicle.axle_loads(), vehicle.wheelbase
    front, rear = (
        sum(loads[unit.group_path(g)] for g in groups) / STANDARD_GRAVITY / sum(g.cornering_stiffness for g in groups)
        for groups in (unit.axle_groups[:1], unit.axle_groups[1:])
    )
    steady = wheelbase / speed**2 + front - rear
    if steady <= 0:
        critical = math.sqrt(wheelbase / (rear - front))
        raise SignalError(
            f"speed: expected below {critical:.1f} m/s, the critical speed of the {unit.name}, got {speed:g}; "
            "choose a lower speed, or a manoeuvre along a path"
        )
    dynamic = frequency > 1e-3
    s = 2j * np.pi * np.where(dynamic, frequency, 1.0)
    rear_over_front = 1 / (wheelbase * rear * s**2 + wheelbase / speed * s + 1)  # lateral position of the axles
    return np.where(dynamic, np.abs(front + 1 / (s * speed) - (1 - rear_over_front) / (wheelbase * s**2)), steady)


def single_sine(
    vehicle: Vehicle,
    *,
    speed: float = STANDARD_SPEED,
    acceleration: float = 1.5,
    frequency: float = 0.4,
    lead: float = 1.0,
    duration: float = 10.0,
) -> OpenLoop:
    """One period of a sine of the steer angle, with a frequency in Hz: ISO 14791, single sine-wave steering input."""
    require_positive("frequency", frequency)
    time = _time(duration)
    phase = frequency * (time - lead)
    wave = np.where((phase >= 0) & (phase < 1), np.sin(2 * np.pi * phase), 0.0)
    return _open_loop("single_sine", time, single_track_steer(vehicle, speed, acceleration, frequency) * wave, speed)


def step_input(
    vehicle: Vehicle,
    *,
    speed: float = STANDARD_SPEED,
    acceleration: float = 1.5,
    lead: float = 1.0,
    duration: float = 10.0,
) -> OpenLoop:
    """A step of the steer angle, with a ramp of 0.1 s: ISO 14793, step input.

    The acceleration is the steady one.
    """
    time = _time(duration)
    ramp = trapezoid(time, lead, math.inf, 0.1)
    return _open_loop("step", time, single_track_steer(vehicle, speed, acceleration) * ramp, speed)


def pulse(
    vehicle: Vehicle,
    *,
    speed: float = STANDARD_SPEED,
    acceleration: float = 3.0,
    width: float = 0.4,
    lead: float = 2.0,
    duration: float = 12.0,
) -> OpenLoop:
    """A pulse of the steer angle, half a sine of a width, s, to the left: ISO 14791, pulse input.

    The acceleration is that of a steady turn with the largest steer angle.
    """
    require_positive("width", width)
    time = _time(duration)
    wave = np.sin(np.pi * np.clip((time - lead) / width, 0.0, 1.0))
    return _open_loop("pulse", time, single_track_steer(vehicle, speed, acceleration) * wave, speed)


def sine_with_dwell(
    vehicle: Vehicle,
    *,
    speed: float = STANDARD_SPEED,
    acceleration: float = 1.5,
    frequency: float = 0.5,
    dwell: float = 1.0,
    lead: float = 2.0,
    duration: float = 12.0,
) -> OpenLoop:
    """One period of a sine of the steer angle, with a frequency in Hz, that stays at its second peak for the dwell, s:
    ISO 18375.
    """
    require_positive("frequency", frequency)
    require_positive("dwell", dwell)
    time, peak = _time(duration), lead + 0.75 / frequency
    without_dwell = np.minimum(time, peak) + np.maximum(time - peak - dwell, 0.0)
    wave = np.sin(2 * np.pi * np.clip(frequency * (without_dwell - lead), 0.0, 1.0))
    return _open_loop(
        "sine_with_dwell", time, single_track_steer(vehicle, speed, acceleration, frequency) * wave, speed
    )


def slowly_increasing_steer(
    vehicle: Vehicle,
    *,
    speed: float = STANDARD_SPEED,
    acceleration: float = 2.5,
    lead: float = 3.0,
    duration: float = 28.0,
) -> OpenLoop:
    """A steer angle to the left that rises at a constant rate: ISO 14792, constant speed.

    The acceleration is that at the end; by default it rises by 0.1 m/s^2 per second.
    """
    time = _time(duration)
    require_positive("duration after the lead", duration - lead)
    rise = np.clip((time - lead) / (duration - lead), 0.0, 1.0)
    return _open_loop("slowly_increasing_steer", time, single_track_steer(vehicle, speed, acceleration) * rise, speed)


def sweep(
    vehicle: Vehicle, *, speed: float = STANDARD_SPEED, acceleration: float = 1.2, duration: float = 60.0
) -> OpenLoop:
    """A sine of the steer angle from 0.1 to 1.5 Hz, with soft ends of 2 s: ISO 14793, continuous sinusoidal input.

    Its amplitude changes with the frequency so that that of the acceleration stays about the same.
    """
    time = _time(duration)
    band = 0.1, 1.5, time[-1]
    steer = acceleration * _steer_gain(vehicle, speed, swept_frequency(time, *band)) * swept_sine(time, *band)
    return _open_loop("sweep", time, steer * _soft_ends(time), speed)


def random(
    vehicle: Vehicle, *, speed: float = STANDARD_SPEED, acceleration: float = 0.7, duration: float = 60.0, seed: int = 0
) -> OpenLoop:
    """Random steer angle for a lateral acceleration with a flat spectrum from 0.05 to 1 Hz: ISO 14793, random input.

    With soft ends of 2 s. The acceleration is the rms without them.
    """
    time = _time(duration)
    frequency: Array = np.fft.rfftfreq(len(time), INTERVAL).astype(np.float64)
    spectrum = noise_spectrum(len(time), frequency, 0.05, 1.0, seed)
    if not spectrum.any():
        raise SignalError(f"duration: expected a period of 0.05 to 1 Hz within {duration:g} s; give a longer duration")
    spectrum *= acceleration / np.std(np.fft.irfft(spectrum, len(time)))
    steer = np.fft.irfft(spectrum * _steer_gain(vehicle, speed, frequency), len(time))
    return _open_loop("random", time, steer * _soft_ends(time), speed)


def _time(duration: float) -> Array:
    require_positive("duration", duration)
    return INTERVAL * np.arange(max(round(duration / INTERVAL), 1) + 1, dtype=np.float64)


def _open_loop(name: str, time: Array, steer: Array, speed: float) -> OpenLoop:
    return OpenLoop(time=time, steer=steer, speed=np.full_like(time, speed), name=name)


def _soft_ends(time: Array) -> Array:
    """A window that rises and falls as a squared sine within 2 s, or within a quarter of a short time."""
    ramp = min(2.0, time[-1] / 4)
    return np.sin(np.pi / 2 * trapezoid(time, 0.0, time[-1], ramp)) ** 2
