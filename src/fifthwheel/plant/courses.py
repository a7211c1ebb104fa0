"""Courses: roads that a driver follows and steer angles that a machine applies, from the standards and from everyday.

A `Path` is driven in closed loop, so that the truck stays on it; an `OpenLoop` is a steer angle over time. ISO 8855:
left positive. Speeds in m/s, accelerations in m/s^2.
"""

import inspect
import math
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_simpson
from scipy.interpolate import CubicSpline
from scipy.ndimage import minimum_filter1d, uniform_filter1d

from fifthwheel.errors import SignalError
from fifthwheel.logs.names import suggest
from fifthwheel.vehicle import Vehicle
from fifthwheel.vehicle.statics import STANDARD_GRAVITY

Array = NDArray[np.float64]

KMH_88 = 88 / 3.6
"""m/s, 55 mph: the speed of SAE J2179."""

_STEP = 0.25  # m between the points of a path
_MARGIN = 60.0  # m that a path goes on beyond the end of the drive, for the driver's preview
_PERIOD = 0.01  # s between the samples of an open loop


@dataclass(frozen=True, kw_only=True, eq=False)
class Path:
    """A road for the first unit, (K,) points over its arc length; it begins at x = y = heading = 0."""

    arc: Array
    """Arc length, m, regular, from 0, at most 0.25 m apart."""
    x: Array
    """m."""
    y: Array
    """m, to the left."""
    heading: Array
    """Of the tangent, rad, continuous: it goes on beyond pi."""
    curvature: Array
    """1/m, positive to the left."""
    speed: Array
    """To be driven there, m/s."""
    name: str
    """What to call it."""
    duration: float
    """Of the whole drive, s; the path is longer."""

    def __post_init__(self) -> None:
        _freeze(self, "arc")
        _positive("duration", self.duration)


@dataclass(frozen=True, kw_only=True, eq=False)
class OpenLoop:
    """A steer angle that depends on nothing but time, (N,) samples at 100 Hz."""

    time: Array
    """s, regular, from 0."""
    steer: Array
    """Road-wheel angle of the first steered axle, rad."""
    speed: Array
    """To be driven then, m/s."""
    name: str
    """What to call it."""

    def __post_init__(self) -> None:
        _freeze(self, "time")

    @property
    def duration(self) -> float:
        """Of the whole drive, s."""
        return float(self.time[-1])


Course = Path | OpenLoop


def steer_for(vehicle: Vehicle, speed: float, acceleration: float, frequency: float = 0.0) -> float:
    """Amplitude of the road-wheel angle, rad, for one of the front axle's lateral acceleration; steady at 0 Hz.

    There a (L / u^2 + m_f / C_f - m_r / C_r), with the static load over g and the cornering stiffness of the first
    unit's front and other axles. At other frequencies by a truck whose masses stand on its axles, without roll and
    trailer, steer / a = m_f / C_f + 1 / (s u) - (1 - G) / (L s^2), G = 1 / (L m_r / C_r s^2 + L / u s + 1). Linear
    tyres, so below about 0.3 g; within 30 % of the whole truck's.
    """
    return float(acceleration * _gain(vehicle, speed, np.array([frequency]))[0])


def _gain(vehicle: Vehicle, speed: float, frequency: Array) -> Array:
    """Amplitude of steer angle over lateral acceleration, rad per m/s^2, by frequency, Hz."""
    _positive("speed", speed)
    unit, loads, wheelbase = vehicle.units[0], vehicle.axle_loads(), vehicle.wheelbase
    front, rear = (
        sum(loads[unit.group_path(g)] for g in groups) / STANDARD_GRAVITY / sum(g.cornering_stiffness for g in groups)
        for groups in (unit.axle_groups[:1], unit.axle_groups[1:])
    )
    steady = wheelbase / speed**2 + front - rear
    if steady <= 0:
        top = math.sqrt(wheelbase / (rear - front))
        raise SignalError(
            f"speed: expected below {top:.1f} m/s, got {speed:g}; from there the {unit.name} turns in by itself,"
            " so drive it slower, or along a path"
        )
    moving = frequency > 1e-3
    s = 2j * np.pi * np.where(moving, frequency, 1.0)
    follows = 1 / (wheelbase * rear * s**2 + wheelbase / speed * s + 1)  # path of the rear axle over that of the front
    return np.where(moving, np.abs(front + 1 / (s * speed) - (1 - follows) / (wheelbase * s**2)), steady)


def lane_changes(
    *,
    count: int = 15,
    offset: float = 1.464,
    length: float = 61.0,
    speed: float = KMH_88,
    rest: float = 5.5,
    shortest: float = 8.0,
    lead: float = 1.0,
) -> Path:
    """Lane changes along one period of a sine of lateral acceleration, to the left and to the right in turn.

    y(x) = offset [x / length - sin(2 pi x / length) / (2 pi)]: 0.15 g at 0.4 Hz by default, as SAE J2179 asks for and
    Cheng and Cebon (2011), section 3.1, drove.

    Args:
        count: lane changes.
        offset: m sideways, in turn to the left and back.
        length: m along x.
        speed: m/s, constant.
        rest: s at least straight after each.
        shortest: s at least from the start of one to the start of the next.
        lead: s straight before the first.
    """
    _positive("count", count)
    _positive("speed", speed)
    _positive("length", length)
    _positive("rest", rest)
    x = np.linspace(0.0, length, 2001)
    slope = offset / length * (1 - np.cos(2 * np.pi * x / length))
    along = cumulative_simpson(np.hypot(1, slope), x=x, initial=0)  # arc length of one, m
    period = max(shortest, along[-1] / speed + rest) * speed  # m of arc
    duration = lead + count * period / speed
    arc = _arc(duration * speed)
    k = np.clip(np.floor((arc - lead * speed) / period), 0, count - 1)
    local = np.clip(arc - lead * speed - k * period, 0, along[-1])
    x = CubicSpline(along, x)(local)  # of this lane change
    phase = 2 * np.pi * x / length
    side = np.where(k % 2 == 0, 1.0, -1.0)
    slope = side * offset / length * (1 - np.cos(phase))
    bend = side * offset / length**2 * 2 * np.pi * np.sin(phase)  # y''
    return Path(
        arc=arc,
        x=arc - local + x - k * (along[-1] - length),
        y=np.where(k % 2 == 0, 0.0, offset) + side * offset * (x / length - np.sin(phase) / (2 * np.pi)),
        heading=np.arctan(slope),
        curvature=bend / (1 + slope**2) ** 1.5,
        speed=np.full_like(arc, speed),
        name="lane_changes",
        duration=duration,
    )


def on_test_track(*, count: int = 10, speed: float = 35 / 3.6) -> Path:
    """The test-track lane change of Cheng and Cebon (2011), section 4: 4 m sideways in 30 m.

    They do not give the speed; 35 km/h, which is ours, makes it 0.27 g.
    """
    return replace(lane_changes(count=count, offset=4.0, length=30.0, speed=speed), name="test_track")


def single_sine(
    vehicle: Vehicle,
    *,
    speed: float = KMH_88,
    acceleration: float = 1.5,
    frequency: float = 0.4,
    lead: float = 1.0,
    duration: float = 10.0,
) -> OpenLoop:
    """One period of a sine of the steer angle: ISO 14791, single sine-wave steering input.

    `acceleration`, m/s^2, is about that of the front axle, `frequency` in Hz, `lead` in s before it begins.
    """
    _positive("frequency", frequency)
    time = _time(duration)
    phase = frequency * (time - lead)
    wave = np.where((phase >= 0) & (phase < 1), np.sin(2 * np.pi * phase), 0.0)
    return _open_loop("single_sine", time, steer_for(vehicle, speed, acceleration, frequency) * wave, speed)


def step(
    vehicle: Vehicle, *, speed: float = KMH_88, acceleration: float = 1.5, lead: float = 1.0, duration: float = 10.0
) -> OpenLoop:
    """A step of the steer angle, in a ramp of 0.1 s, to what holds `acceleration`, m/s^2: ISO 14793, step input."""
    time = _time(duration)
    ramp: Array = np.clip((time - lead) / 0.1, 0, 1)
    return _open_loop("step", time, steer_for(vehicle, speed, acceleration) * ramp, speed)


def sweep(vehicle: Vehicle, *, speed: float = KMH_88, acceleration: float = 1.2, duration: float = 60.0) -> OpenLoop:
    """A sine of the steer angle, its frequency rising linearly from 0.1 to 1.5 Hz, with 2 s of soft ends.

    ISO 14793, continuous sinusoidal input; the amplitude changes so that the front axle's of `acceleration` stays.
    """
    time = _time(duration)
    low, high = 0.1, 1.5
    phase = 2 * np.pi * (low * time + (high - low) * time**2 / (2 * time[-1]))
    rising: Array = low + (high - low) * time / time[-1]
    steer = acceleration * _gain(vehicle, speed, rising) * np.sin(phase)
    return _open_loop("sweep", time, steer * _soft_ends(time), speed)


def random(
    vehicle: Vehicle, *, speed: float = KMH_88, acceleration: float = 0.7, duration: float = 60.0, seed: int = 0
) -> OpenLoop:
    """Random steer for a lateral acceleration with a flat spectrum from 0.05 to 1 Hz, with 2 s of soft ends.

    ISO 14793, random input. `acceleration` is the front axle's root mean square, m/s^2, but for the ends.
    """
    time = _time(duration)
    frequency: Array = np.fft.rfftfreq(len(time), _PERIOD).astype(np.float64)
    inside = (frequency >= 0.05) & (frequency <= 1.0)
    if not inside.any():
        raise SignalError(f"duration: {duration:g} s hold no period of 0.05 to 1 Hz; make it longer")
    spectrum = inside * np.fft.rfft(np.random.default_rng(seed).normal(size=len(time)))
    spectrum *= acceleration / np.std(np.fft.irfft(spectrum, len(time)))
    steer = np.fft.irfft(spectrum * _gain(vehicle, speed, frequency), len(time))
    return _open_loop("random", time, steer * _soft_ends(time), speed)


def straight(*, speed: float = KMH_88, duration: float = 60.0) -> Path:
    """A straight road."""
    _positive("speed", speed)
    arc = _arc(speed * duration)
    return _road("straight", np.zeros_like(arc), np.full_like(arc, speed), duration)


def constant_radius(
    *, radius: float = 150.0, speed: float = 14.0, acceleration: float = 0.0, duration: float = 60.0, lead: float = 2.0
) -> Path:
    """Straight for `lead` s, by a clothoid into a circle to the left, and round it: ISO 14792, constant radius.

    The clothoid is entered with a lateral jerk of 1 m/s^3. On the circle the speed, m/s, rises by `acceleration`,
    m/s^2; the standard's steady state asks for little of it.
    """
    _positive("speed", speed)
    _positive("radius", radius)
    if not 0 <= acceleration < math.inf:
        raise SignalError(f"acceleration: expected 0 m/s^2 or more, got {acceleration:g}; the speed rises or stays")
    arc = _arc(speed * duration + acceleration * duration**2 / 2)
    entry, clothoid = lead * speed, speed**3 / radius
    curvature = np.clip((arc - entry) / clothoid, 0, 1) / radius
    rising = np.sqrt(speed**2 + 2 * acceleration * np.clip(arc - entry - clothoid, 0, None))
    return _road("constant_radius", curvature, rising, duration)


def everyday(*, duration: float = 300.0, seed: int = 0, top: float = 25.0) -> Path:
    """A random but plausible road: straights, bends with clothoids, a lane change now and then, speed limits.

    Between 8 m/s and `top`, m/s, as fast as the limits allow, within 2 m/s^2 of lateral and -1.0 to +0.4 m/s^2 of
    longitudinal acceleration: what loaded trucks do. The numbers are ours; no standard has such a course.
    """
    lowest, lateral, rise, fall = 8.0, 2.0, 0.4, 1.0
    if not lowest <= top < math.inf:
        raise SignalError(
            f"top speed: expected {lowest:g} m/s or more, got {top:g}; that is the slowest of everyday driving"
        )
    _positive("duration", duration)
    draw = np.random.default_rng(seed)
    arc = _arc(top * duration)
    curvature, limit, at, zone = np.zeros_like(arc), np.full_like(arc, top), 60.0, 0.0
    while at < arc[-1]:
        side = draw.choice([-1.0, 1.0])
        if draw.random() < 0.3:
            long, offset = draw.uniform(80, 140), 3.5  # m, a lane
            phase = (arc - at) / long
            curvature += np.where(
                (phase > 0) & (phase < 1), side * 2 * np.pi * offset / long**2 * np.sin(2 * np.pi * phase), 0
            )
        else:
            radius = math.exp(draw.uniform(math.log(45), math.log(700)))
            clothoid, circle = math.sqrt(radius) * draw.uniform(3, 5), radius * draw.uniform(0.15, 1.2)
            long = circle + 2 * clothoid
            curvature += side / radius * np.clip(np.minimum(arc - at, at + long - arc) / clothoid, 0, 1)
        at += long + draw.uniform(40, 300)
    while zone < arc[-1]:
        limit[arc >= zone] = max(lowest, top * draw.uniform(0.5, 1.1))
        zone += draw.uniform(300, 900)
    squared = np.minimum(np.minimum(limit, top) ** 2, lateral / np.maximum(np.abs(curvature), 1e-9))
    width = round(20 / _STEP) | 1  # 20 m: a mean of the least over as much is nowhere above the limit itself
    squared = np.maximum(minimum_filter1d(squared, width, mode="nearest"), lowest**2)
    ramp = 2 * rise * arc, 2 * fall * arc  # u^2 grows by 2 a ds: forward, then backward
    squared = ramp[0] + np.minimum.accumulate(squared - ramp[0])
    squared = np.minimum.accumulate((squared + ramp[1])[::-1])[::-1] - ramp[1]
    return _road("everyday", curvature, np.sqrt(uniform_filter1d(squared, width, mode="nearest")), duration)


COURSES: dict[str, Callable[..., Course]] = {
    "lane_changes": lane_changes,
    "test_track": on_test_track,
    "single_sine": single_sine,
    "step": step,
    "sweep": sweep,
    "random": random,
    "straight": straight,
    "constant_radius": constant_radius,
    "everyday": everyday,
}
"""Every course by its name."""


def course(
    name: str,
    vehicle: Vehicle,
    *,
    speed: float | None = None,
    count: int | None = None,
    duration: float | None = None,
    seed: int = 0,
) -> Course:
    """A course of `COURSES`, as it stands unless something is given; for the command line.

    Args:
        name: one of `COURSES`.
        vehicle: whose steer angle the open loops are scaled for.
        speed: m/s, 5 to 40; of everyday driving the highest.
        count: of lane changes.
        duration: s.
        seed: of what is random; courses that are not have no use for it.

    Raises:
        SignalError: no such course; a speed out of range; something given that the course does not have.
    """
    if name not in COURSES:
        raise SignalError(f"course: {name!r} is not known; {suggest(name, list(COURSES))} (of {', '.join(COURSES)})")
    if speed is not None and not 5 <= speed <= 40:
        raise SignalError(f"speed: expected 5 to 40 m/s, got {speed:g}; give a road speed, in m/s")
    if seed < 0:
        raise SignalError(f"seed: expected 0 or more, got {seed}")
    takes = inspect.signature(COURSES[name]).parameters
    given: dict[str, Any] = {"count": count, "duration": duration, "top" if "top" in takes else "speed": speed}
    given = {key: value for key, value in given.items() if value is not None}
    for key, value in given.items():
        if key not in takes:
            raise SignalError(f"{key}: {name} has none, got {value:g}; leave it out; it has {', '.join(takes)}")
        _positive(key, value)
    known = {"vehicle": vehicle, "seed": seed} | given
    return COURSES[name](**{key: known[key] for key in takes if key in known})


def _arc(length: float) -> Array:
    """Points of a path that a drive of so many metres needs."""
    return _STEP * np.arange(math.ceil((1.05 * length + _MARGIN) / _STEP) + 1, dtype=np.float64)


def _road(name: str, curvature: Array, speed: Array, duration: float) -> Path:
    """The path of a curvature that is linear between points: heading exact, position by Simpson's rule."""
    arc = _STEP * np.arange(len(curvature), dtype=np.float64)
    early, late = curvature[:-1], curvature[1:]
    heading = np.concatenate([[0.0], np.cumsum((early + late) * _STEP / 2)])
    middle = heading[:-1] + _STEP * (3 * early + late) / 8
    moves = np.exp(1j * heading)
    moves = _STEP / 6 * (moves[:-1] + 4 * np.exp(1j * middle) + moves[1:])
    place = np.concatenate([[0.0], np.cumsum(moves)])
    x, y = place.real, place.imag
    return Path(arc=arc, x=x, y=y, heading=heading, curvature=curvature, speed=speed, name=name, duration=duration)


def _time(duration: float) -> Array:
    _positive("duration", duration)
    return _PERIOD * np.arange(max(round(duration / _PERIOD), 1) + 1, dtype=np.float64)


def _open_loop(name: str, time: Array, steer: Array, speed: float) -> OpenLoop:
    return OpenLoop(time=time, steer=steer, speed=np.full_like(time, speed), name=name)


def _soft_ends(time: Array, length: float = 2.0) -> Array:
    """A window that rises and falls within 2 s, or a quarter of a short time."""
    length = min(length, time[-1] / 4)
    rise: Array = np.clip(np.minimum(time, time[-1] - time) / length, 0, 1)
    return np.sin(np.pi / 2 * rise) ** 2


def _freeze(data: Any, base: str) -> None:
    """Make the arrays float64, read-only and of one length, over a base that is regular and begins at 0."""
    arrays = {f.name: np.array(getattr(data, f.name), dtype=np.float64) for f in fields(data) if f.type is Array}
    size, steps = arrays[base].size, np.diff(arrays[base])
    for name, values in arrays.items():
        if values.shape != (size,) or size < 2 or not np.isfinite(values).all():
            expected = f"2 finite numbers or more, as many as {base} has ({size})"
            raise SignalError(f"{name}: expected {expected}, got shape {values.shape}; give one each, or drive longer")
        values.setflags(write=False)
        object.__setattr__(data, name, values)
    if arrays[base][0] != 0 or steps[0] <= 0 or np.ptp(steps) > 1e-6 * steps[0]:
        raise SignalError(f"{base}: expected to rise from 0 in equal steps; resample the course")
    _positive("speed", float(arrays["speed"].min()))


def _positive(name: str, value: float) -> None:
    if not 0 < value < math.inf:
        raise SignalError(f"{name}: expected a number above 0, got {value:g}; correct it")
