"""Paths that a driver follows: straight road, constant radius, everyday road."""

import math

import numpy as np

from fifthwheel.base.errors import SignalError
from fifthwheel.base.types import Array
from fifthwheel.model.manoeuvres.accelerations import trapezoid
from fifthwheel.model.manoeuvres.courses import ARC_STEP, STANDARD_SPEED, Path, arc_length_grid, require_positive


def straight(*, speed: float = STANDARD_SPEED, duration: float = 60.0) -> Path:
    """A straight road; speed in m/s, duration in s."""
    require_positive("speed", speed)
    arc = arc_length_grid(speed * duration)
    return Path.from_curvature("straight", np.zeros_like(arc), np.full_like(arc, speed), duration)


def constant_radius(
    *, radius: float = 150.0, speed: float = 14.0, acceleration: float = 0.0, duration: float = 60.0
) -> Path:
    """A circle to the left, entered by a clothoid after 2 s straight ahead: ISO 14792, constant radius.

    The lateral jerk on the clothoid is 1 m/s^3.

    Args:
        radius: m.
        speed: up to the circle, m/s.
        acceleration: rate at which the speed rises on the circle, m/s^2; small for a quasi-steady state.
        duration: of the run, s.
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


MIN_EVERYDAY_SPEED = 8.0
"""Lowest speed on an everyday road, m/s."""
LATERAL, SPEED_UP, SLOW_DOWN = 2.0, 0.4, 1.0
"""Largest lateral, positive and negative longitudinal acceleration on an everyday road, m/s^2."""


def everyday(*, duration: float = 300.0, seed: int = 0, speed: float = 25.0) -> Path:
    """A random road: straights, bends with clothoids, lane changes, speed limits.

    The truck drives at the speed limit between 8 m/s and the highest speed, within accelerations that are usual for
    loaded trucks: 2 m/s^2 lateral, -1.0 to +0.4 m/s^2 longitudinal. The numbers are ours, not those of a standard.

    Args:
        duration: of the run, s.
        seed: seed of road and speed limits.
        speed: highest speed, m/s.
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
