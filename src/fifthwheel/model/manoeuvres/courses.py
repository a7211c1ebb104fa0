"""Courses for the nonlinear plant: a path that a driver follows, or a steer angle over time; all such paths.

ISO 8855: left positive. Speeds in m/s, accelerations in m/s^2.
"""

import math
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from fifthwheel.base.errors import SignalError
from fifthwheel.base.types import Array
from fifthwheel.model.manoeuvres.accelerations import trapezoid

STANDARD_SPEED = 88 / 3.6
"""Speed of the SAE J2179 lane change, m/s: 88 km/h, 55 mph."""

ARC_STEP = 0.25
"""Distance between the points of a path, m."""
PREVIEW_MARGIN = 60.0
"""Distance by which a path continues after the end of the run, m, for the driver's preview."""
BRAKING_START = 1.0
"""Time from which a truck brakes, s: where the steering of the manoeuvres begins."""
BRAKED_SPEED = 6.0
"""Speed to which a truck brakes, m/s; the tyre models of the estimators begin at 5 m/s."""
LARGEST_BRAKING = 5.0
"""Largest deceleration of the speed controller of the nonlinear truck, m/s^2."""
MIN_EVERYDAY_SPEED = 8.0
"""Lowest speed on an everyday road, m/s."""
LATERAL, SPEED_UP, SLOW_DOWN = 2.0, 0.4, 1.0
"""Largest lateral, positive and negative longitudinal acceleration on an everyday road, m/s^2."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Path:
    """A path for the first unit: (K,) points over arc length; starts at x = y = heading = 0."""

    arc: Array
    """Arc length, m; starts at 0, in equal steps of at most 0.25 m."""
    x: Array
    """m."""
    y: Array
    """m, positive to the left."""
    heading: Array
    """Direction of the tangent, rad; continuous beyond pi."""
    curvature: Array
    """1/m, positive to the left."""
    speed: Array
    """Speed to be driven at each point, m/s."""
    name: str
    """Name of the manoeuvre."""
    duration: float
    """Duration of the run, s; the path is longer than the run."""

    def __post_init__(self) -> None:
        _freeze_arrays(self, "arc")
        require_positive("duration", self.duration)

    @classmethod
    def from_curvature(cls, name: str, curvature: Array, speed: Array, duration: float) -> "Path":
        """The path with a curvature (K,), 1/m, that is linear between points `ARC_STEP` apart.

        The heading is exact; the position is integrated by Simpson's rule.
        """
        arc = ARC_STEP * np.arange(len(curvature), dtype=np.float64)
        start, end = curvature[:-1], curvature[1:]
        heading = np.concatenate([[0.0], np.cumsum((start + end) * ARC_STEP / 2)])
        middle = heading[:-1] + ARC_STEP * (3 * start + end) / 8
        tangent = np.exp(1j * heading)
        steps = ARC_STEP / 6 * (tangent[:-1] + 4 * np.exp(1j * middle) + tangent[1:])
        position = np.concatenate([[0.0], np.cumsum(steps)])
        x, y = position.real, position.imag
        return cls(arc=arc, x=x, y=y, heading=heading, curvature=curvature, speed=speed, name=name, duration=duration)


@dataclass(frozen=True, kw_only=True, eq=False)
class OpenLoop:
    """A steer angle and a speed over time, (N,) samples."""

    time: Array
    """s; starts at 0, in equal steps."""
    steer: Array
    """Road-wheel angle of the first steered axle, rad."""
    speed: Array
    """Speed to be driven, m/s."""
    name: str
    """Name of the manoeuvre."""

    def __post_init__(self) -> None:
        _freeze_arrays(self, "time")

    @property
    def duration(self) -> float:
        """Duration of the run, s."""
        return float(self.time[-1])


Course = Path | OpenLoop
"""What the nonlinear truck drives: a path that a driver follows, or a steer angle over time."""


def braked(course: Course, deceleration: float) -> Course:
    """The course with a speed that falls from `BRAKING_START` on to `BRAKED_SPEED`, in m/s^2.

    Raises:
        SignalError: the deceleration is not between 0 and `LARGEST_BRAKING`.
    """
    if not 0 < deceleration <= LARGEST_BRAKING:
        raise SignalError(
            f"braking: expected a deceleration above 0, up to {LARGEST_BRAKING:g} m/s^2, got {deceleration:g}; "
            "give another number"
        )
    first = course.speed[0]
    if isinstance(course, OpenLoop):
        speed = first - deceleration * np.maximum(course.time - BRAKING_START, 0.0)
    else:
        distance = np.maximum(course.arc - first * BRAKING_START, 0.0)
        speed = np.sqrt(np.maximum(first**2 - 2 * deceleration * distance, 0.0))
    return replace(course, speed=np.minimum(course.speed, np.maximum(speed, BRAKED_SPEED)))


def arc_length_grid(distance: float) -> Array:
    """Arc lengths (K,), m, of the points of a path for a run over a distance, m; 5 % and `PREVIEW_MARGIN` longer."""
    return ARC_STEP * np.arange(math.ceil((1.05 * distance + PREVIEW_MARGIN) / ARC_STEP) + 1, dtype=np.float64)


def require_positive(name: str, value: float) -> None:
    """Raise a SignalError unless the value is finite and above 0."""
    if not 0 < value < math.inf:
        raise SignalError(f"{name}: expected a number above 0, got {value:g}; correct it")


def _freeze_arrays(course: Any, base: str) -> None:
    """Make the arrays of a course float64, read-only and of one length; its base must rise from 0 in equal steps."""
    arrays = {f.name: np.array(getattr(course, f.name), dtype=np.float64) for f in fields(course) if f.type is Array}
    size, steps = arrays[base].size, np.diff(arrays[base])
    for name, values in arrays.items():
        if values.shape != (size,) or size < 2 or not np.isfinite(values).all():
            raise SignalError(
                f"{name}: expected at least 2 finite numbers, as many as {base} has ({size}), got shape "
                f"{values.shape}; give one number for each point, or a longer run"
            )
        values.setflags(write=False)
        object.__setattr__(course, name, values)
    if arrays[base][0] != 0 or steps[0] <= 0 or np.ptp(steps) > 1e-6 * steps[0]:
        raise SignalError(f"{base}: expected numbers that rise from 0 in equal steps; resample the course")
    require_positive("speed", float(arrays["speed"].min()))


@dataclass(frozen=True, kw_only=True)
class LaneChange:
    """Lane changes along one period of a sine of lateral acceleration, to the left and to the right in turn.

    By default the lane change of SAE J2179, which Cheng and Cebon (2011) use in section 3.1: at 88 km/h 0.15 g, 0.4 Hz.
    """

    offset: float = 1.464
    """Lateral offset, m; the first lane change is to the left."""
    length: float = 61.0
    """Length along x, m."""
    rest: float = 5.5
    """Minimum time straight ahead after each lane change, s."""
    min_period: float = 8.0
    """Minimum time from the start of a lane change to the start of the next, s."""
    lead: float = 1.0
    """Time straight ahead before the first lane change, s."""

    def __post_init__(self) -> None:
        require_positive("length", self.length)
        require_positive("rest", self.rest)

    def period(self, speed: float) -> float:
        """Time from the start of a lane change to the start of the next, s."""
        return max(self.min_period, self.length / speed + self.rest)

    def acceleration(self, time: Array, speed: float, count: int) -> Array:
        """Lateral acceleration (N,), m/s^2, of `count` lane changes over time (N,), s, for a course that is parallel to
        x.
        """
        duration = self.length / speed
        peak = 2 * np.pi * self.offset / duration**2
        result = np.zeros_like(time)
        for k in range(count):
            phase = (time - self.lead - k * self.period(speed)) / duration
            result += np.where((phase >= 0) & (phase < 1), (-1) ** k * peak * np.sin(2 * np.pi * phase), 0.0)
        return result

    def path(self, *, count: int, speed: float, name: str = "lane_changes") -> Path:
        """Path of `count` lane changes at a constant speed, m/s.

        y(x) = offset [x / length - sin(2 pi x / length) / (2 pi)].
        """
        from scipy.integrate import cumulative_simpson  # slow to import
        from scipy.interpolate import CubicSpline

        require_positive("count", count)
        require_positive("speed", speed)
        offset, length = self.offset, self.length
        x = np.linspace(0.0, length, 2001)
        slope = offset / length * (1 - np.cos(2 * np.pi * x / length))
        arc_of_x = cumulative_simpson(np.hypot(1, slope), x=x, initial=0)  # within one lane change, m
        period = max(self.min_period, arc_of_x[-1] / speed + self.rest) * speed  # m of arc
        duration = self.lead + count * period / speed
        arc = arc_length_grid(duration * speed)
        k = np.clip(np.floor((arc - self.lead * speed) / period), 0, count - 1)
        local_arc = np.clip(arc - self.lead * speed - k * period, 0, arc_of_x[-1])
        x = CubicSpline(arc_of_x, x)(local_arc)  # within lane change k
        phase = 2 * np.pi * x / length
        side = np.where(k % 2 == 0, 1.0, -1.0)
        slope = side * offset / length * (1 - np.cos(phase))
        second_derivative = side * offset / length**2 * 2 * np.pi * np.sin(phase)
        return Path(
            arc=arc,
            x=arc - local_arc + x - k * (arc_of_x[-1] - length),
            y=np.where(k % 2 == 0, 0.0, offset) + side * offset * (x / length - np.sin(phase) / (2 * np.pi)),
            heading=np.arctan(slope),
            curvature=second_derivative / (1 + slope**2) ** 1.5,
            speed=np.full_like(arc, speed),
            name=name,
            duration=duration,
        )


def lane_changes(*, count: int = 15, speed: float = STANDARD_SPEED) -> Path:
    """Path of `count` lane changes of SAE J2179, to the left and to the right in turn; speed in m/s."""
    return LaneChange().path(count=count, speed=speed)


def lane_changes_on_test_track(*, count: int = 10, speed: float = 35 / 3.6) -> Path:
    """Path of the test-track lane changes of Cheng and Cebon (2011), section 4: 4 m sideways in 30 m.

    The article does not give the speed. The default is our assumption: 35 km/h, which gives 0.27 g.
    """
    return LaneChange(offset=4.0, length=30.0).path(count=count, speed=speed, name="test_track")


def straight(*, speed: float = STANDARD_SPEED, duration: float = 60.0) -> Path:
    """A straight road; speed in m/s, duration in s."""
    require_positive("speed", speed)
    arc = arc_length_grid(speed * duration)
    return Path.from_curvature("straight", np.zeros_like(arc), np.full_like(arc, speed), duration)


def constant_radius(
    *, radius: float = 150.0, speed: float = 14.0, acceleration: float = 0.0, duration: float = 60.0
) -> Path:
    """A circle to the left, entered by a clothoid after 2 s straight ahead: ISO 14792, constant radius.

    The lateral jerk on the clothoid is 1 m/s^3. On the circle the speed, m/s, rises with the acceleration, m/s^2, which
    is small for a quasi-steady state. Radius in m, duration in s.
    """
    require_positive("speed", speed)
    require_positive("radius", radius)
    if not 0 <= acceleration < math.inf:
        raise SignalError(
            f"acceleration: expected 0 m/s^2 or more, got {acceleration:g}; the speed rises or is constant"
        )
    arc = arc_length_grid(speed * duration + acceleration * duration**2 / 2)
    entry, clothoid = 2.0 * speed, speed**3 / radius
    curvature = trapezoid(arc, entry, math.inf, clothoid) / radius
    speeds = np.sqrt(speed**2 + 2 * acceleration * np.clip(arc - entry - clothoid, 0, None))
    return Path.from_curvature("constant_radius", curvature, speeds, duration)


def slow_turns(*, radius: float = 20.0, speed: float = 6.0, duration: float = 60.0) -> Path:
    """Turns of 90 degrees to the left and to the right, with clothoids of 6 m and 12 m straight ahead between them.

    They determine the distance of the axles from the coupling of a trailer. Radius in m, speed in m/s, duration in s.
    """
    require_positive("speed", speed)
    require_positive("radius", radius)
    arc, clothoid, straight_ahead = arc_length_grid(speed * duration), 6.0, 12.0
    turn = radius * math.pi / 2 + clothoid
    starts = np.arange(straight_ahead, arc[-1], turn + straight_ahead)
    sides = [1 - 2 * (i % 2) for i in range(len(starts))]
    turns = (side * trapezoid(arc, start, start + turn, clothoid) for side, start in zip(sides, starts, strict=True))
    return Path.from_curvature(
        "slow_turns", sum(turns, np.zeros_like(arc)) / radius, np.full_like(arc, speed), duration
    )


def everyday(*, duration: float = 300.0, seed: int = 0, speed: float = 25.0) -> Path:
    """A random road of a seed: straights, bends with clothoids, lane changes, speed limits.

    The truck drives at the speed limit between 8 m/s and `speed`, within accelerations that are usual for loaded
    trucks: 2 m/s^2 lateral, -1.0 to +0.4 m/s^2 longitudinal. The numbers are ours, not those of a standard. Duration in
    s.
    """
    if not MIN_EVERYDAY_SPEED <= speed < math.inf:
        raise SignalError(
            f"speed: expected {MIN_EVERYDAY_SPEED:g} m/s or more as the highest speed of everyday driving, "
            f"got {speed:g}; choose a higher speed"
        )
    require_positive("duration", duration)
    generator = np.random.default_rng(seed)
    arc = arc_length_grid(speed * duration)
    curvature = _random_curvature(arc, generator)
    limit = np.minimum(_random_speed_limit(arc, generator, speed), speed)
    return Path.from_curvature("everyday", curvature, _driven_speed(arc, curvature, limit), duration)


def _random_curvature(arc: Array, generator: np.random.Generator) -> Array:
    """Curvature (K,) of bends and lane changes in random order, 1/m."""
    curvature, start = np.zeros_like(arc), 60.0
    while start < arc[-1]:
        side = generator.choice([-1.0, 1.0])
        if generator.random() < 0.3:
            length, offset = generator.uniform(80, 140), 3.5  # m, the width of a lane
            phase = (arc - start) / length
            curvature += np.where(
                (phase > 0) & (phase < 1), side * 2 * np.pi * offset / length**2 * np.sin(2 * np.pi * phase), 0
            )
        else:
            radius = math.exp(generator.uniform(math.log(45), math.log(700)))
            clothoid, circle = math.sqrt(radius) * generator.uniform(3, 5), radius * generator.uniform(0.15, 1.2)
            length = circle + 2 * clothoid
            curvature += side / radius * trapezoid(arc, start, start + length, clothoid)
        start += length + generator.uniform(40, 300)
    return curvature


def _random_speed_limit(arc: Array, generator: np.random.Generator, speed: float) -> Array:
    """Speed limits (K,), m/s, by zones."""
    limit, start = np.full_like(arc, speed), 0.0
    while start < arc[-1]:
        limit[arc >= start] = max(MIN_EVERYDAY_SPEED, speed * generator.uniform(0.5, 1.1))
        start += generator.uniform(300, 900)
    return limit


def _driven_speed(arc: Array, curvature: Array, limit: Array) -> Array:
    """Highest speed (K,), m/s, within the limit (K,) and the accelerations of everyday driving."""
    from scipy.ndimage import minimum_filter1d, uniform_filter1d  # slow to import

    squared = np.minimum(limit**2, LATERAL / np.maximum(np.abs(curvature), 1e-9))
    width = round(20 / ARC_STEP) | 1  # the mean of the minimum over the same 20 m nowhere exceeds the limit
    squared = np.maximum(minimum_filter1d(squared, width, mode="nearest"), MIN_EVERYDAY_SPEED**2)
    ramps = 2 * SPEED_UP * arc, 2 * SLOW_DOWN * arc  # d(u^2) = 2 a ds: forward, then backward
    squared = ramps[0] + np.minimum.accumulate(squared - ramps[0])
    squared = np.minimum.accumulate((squared + ramps[1])[::-1])[::-1] - ramps[1]
    speed: Array = np.sqrt(uniform_filter1d(squared, width, mode="nearest"))
    return speed
