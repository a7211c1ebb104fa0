"""Courses for the nonlinear plant: a path that a driver follows, or a steer angle over time.

ISO 8855: left positive. Speeds in m/s, accelerations in m/s^2.
"""

import math
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from fifthwheel.base.errors import SignalError
from fifthwheel.base.types import Array

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
