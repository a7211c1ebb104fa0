"""The driver: leads the first unit's front axle along a path, or plays an open loop.

With e the distance of the front axle from the path, psi the direction in which it moves less the path's heading, both
positive to the left, v its speed and kappa the path's curvature, the driver wants the lateral acceleration

    a = v^2 kappa(s + v t_p) - w^2 e - 2 zeta w v psi

so that e'' + 2 zeta w e' + w^2 e = 0, and gets it by the slip angle of the front tyres alone,

    steer = (direction in which the axle moves - heading) + m_f a / C_f,

m_f and C_f being the load over g and the cornering stiffness of the front axles. No wheelbase or understeer gradient
comes in: what rear axles and trailer do shows in the direction in which the front axle moves, so this holds where the
steady-state angle is slow or has the wrong sign, near the critical speed of an oversteering tractor and beyond. The
idea is Kritayakirana and Gerdes (2012), who lead the centre of percussion, which rear tyres do not push sideways; on a
truck it is within 0.4 to 1.6 m of the front axle.
"""

import math
from dataclasses import dataclass, fields
from typing import NamedTuple

from fifthwheel.errors import SignalError
from fifthwheel.plant.courses import Course, Path
from fifthwheel.vehicle import Vehicle
from fifthwheel.vehicle.statics import STANDARD_GRAVITY


class Pose(NamedTuple):
    """Where the first unit's CoG is on the ground, and how the unit moves; world frame of the course."""

    x: float
    """m."""
    y: float
    """m."""
    heading: float
    """Of the unit's longitudinal axis, rad."""
    speed: float
    """Longitudinal velocity, m/s."""
    yaw_rate: float
    """rad/s."""


class Command(NamedTuple):
    """What the driver wants."""

    steer: float
    """Road-wheel angle of the first steered axle, rad."""
    speed: float
    """m/s."""


@dataclass(frozen=True, kw_only=True)
class DriverSettings:
    """How a driver follows a path. An open loop uses none of it."""

    bandwidth: float = 1.0
    """w, how fast an error is steered out, rad/s; a driver's is about 1."""
    damping: float = 0.8
    """zeta, of the same."""
    preview: float = 0.05
    """t_p, how far ahead the curvature is looked up, s: what tyres and steering take to build up a force."""
    steer_rate: float = 0.3
    """The fastest that the road wheels are turned, rad/s; about 20 times that at the steering wheel."""
    slowest: float = 2.0
    """Below this speed the driver reckons with it, m/s, and so does not come to a stop with the wheels on the lock."""

    def __post_init__(self) -> None:
        for name in (field.name for field in fields(self)):
            value, zero = getattr(self, name), name == "preview"
            if not 0 <= value < math.inf or (value == 0 and not zero):
                least = "0 or more" if zero else "above 0"
                raise SignalError(f"{name}: expected a number {least}, got {value}; correct the driver's settings")


class Driver:
    """Asked for a command at 100 Hz, as time goes on; one driver for one drive, since it remembers where it is.

    A path begins where the truck's CoG is when the driver is first asked, and heads along the world's x there.
    """

    def __init__(self, course: Course, vehicle: Vehicle, settings: DriverSettings | None = None) -> None:
        self.settings = settings or DriverSettings()
        unit = vehicle.units[0]
        front = unit.axle_groups[0]
        self._ahead = front.position - unit.cog  # of the front axle, m
        mass = vehicle.axle_loads()[unit.group_path(front)] / STANDARD_GRAVITY
        self._slip = mass / front.cornering_stiffness  # angle for a lateral acceleration, rad per m/s^2
        self._path = isinstance(course, Path)
        base = course.arc if isinstance(course, Path) else course.time
        self._interval, self._last = float(base[1]), len(base) - 2
        self._speed = course.speed.tolist()
        if isinstance(course, Path):
            self._x, self._y, self._heading = course.x.tolist(), course.y.tolist(), course.heading.tolist()
            self._curvature = course.curvature.tolist()
        else:
            self._open = course.steer.tolist()
        self.arc = self._ahead
        """How far along the path the front axle is, m."""
        self.error = 0.0
        """How far to the left of it, m."""
        self.origin: tuple[float, float] | None = None
        """Where the path begins, x and y, m; None before the first command."""
        self._before = 0.0, 0.0, 0.0  # time, and where the front axle was
        self._steer = 0.0

    def __call__(self, time: float, pose: Pose) -> Command:
        """The command for the time to come, s."""
        if not self._path:
            return Command(self._at(self._open, time), self._at(self._speed, time))
        settings = self.settings
        x = pose.x + self._ahead * math.cos(pose.heading)
        y = pose.y + self._ahead * math.sin(pose.heading)
        if self.origin is None:
            self.origin = pose.x, pose.y
            self._before = time - 0.01, x, y
        passed, way = time - self._before[0], (x - self._before[1], y - self._before[2])
        self._before = time, x, y
        moves = 0.0  # the direction in which the axle moves, from the heading, rad
        if math.hypot(*way) > 1e-4:  # that of the step is the one half way; the yaw rate brings it to its end
            moves = math.remainder(math.atan2(way[1], way[0]) + pose.yaw_rate * passed / 2 - pose.heading, math.tau)

        heading = self._at(self._heading, self.arc)
        c, s = math.cos(heading), math.sin(heading)
        x -= self.origin[0] + self._at(self._x, self.arc)
        y -= self.origin[1] + self._at(self._y, self.arc)
        self.error = c * y - s * x
        self.arc += (c * x + s * y) / max(1 - self._at(self._curvature, self.arc) * self.error, 0.1)  # Newton's step

        w, speed = settings.bandwidth, max(pose.speed, settings.slowest) / max(math.cos(moves), 0.5)
        away = math.remainder(pose.heading + moves - heading, math.tau)
        wanted = speed**2 * self._at(self._curvature, self.arc + speed * settings.preview)
        wanted -= w * (w * self.error + 2 * settings.damping * speed * away)
        reach = settings.steer_rate * passed
        self._steer = min(max(moves + self._slip * wanted, self._steer - reach), self._steer + reach)
        return Command(self._steer, self._at(self._speed, self.arc))

    def _at(self, values: list[float], place: float) -> float:
        """Linear between the points of the course; before the first and after the last, as there."""
        place /= self._interval
        if place <= 0:
            return values[0]
        k = min(int(place), self._last)
        return values[k] + min(place - k, 1.0) * (values[k + 1] - values[k])
