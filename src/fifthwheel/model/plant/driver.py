"""The driver: steers the first unit along a path, or replays the steer angle of an open loop.

Let e be the distance of the front axle from the path, psi the direction of motion of the front axle minus the heading
of the path, both positive to the left, v the speed of the front axle and kappa the curvature of the path. The driver
demands the lateral acceleration

    a = v^2 kappa(s + v t_p) - w^2 e - 2 zeta w v psi,

so that e'' + 2 zeta w e' + w^2 e = 0, and produces it by the slip angle of the front tyres,

    steer = (direction of motion of the axle - heading of the unit) + m_f a / C_f,

where m_f is the load over g and C_f the cornering stiffness of the front axles. The law needs no wheelbase and no
understeer gradient: the direction of motion of the front axle contains the effect of rear axles and trailers. It
therefore also holds near and above the critical speed of an oversteering tractor, where the steady-state steer angle
responds slowly or has the opposite sign. It follows Kritayakirana and Gerdes (2012), who control the centre of
percussion, which lateral forces of the rear tyres do not accelerate; on a truck this point lies 0.4 to 1.6 m from the
front axle.
"""

import math
from typing import NamedTuple

from fifthwheel.base.units import STANDARD_GRAVITY
from fifthwheel.model.manoeuvres import Course, Path
from fifthwheel.truck import Vehicle

BANDWIDTH = 1.0
"""w, natural frequency of the path error, rad/s; about 1 for a human driver."""
DAMPING = 0.8
"""zeta, damping ratio of the path error."""
PREVIEW = 0.05
"""t_p, preview time of the curvature, s: the time in which tyres and steering build up a force."""
STEER_RATE = 0.3
"""Highest rate of the road wheels, rad/s; at the steering wheel about 20 times as much."""
SLOWEST = 2.0
"""Lower limit of the speed in the law, m/s, so that the steer angle stays finite when the truck stops."""


class Pose(NamedTuple):
    """Position and motion of the first unit on the ground, in the world frame of the course."""

    x: float
    """Position of the CoG, m."""
    y: float
    """Position of the CoG, m."""
    heading: float
    """Heading angle of the unit, rad."""
    speed: float
    """Longitudinal velocity, m/s."""
    yaw_rate: float
    """rad/s."""


class Command(NamedTuple):
    """Output of the driver."""

    steer: float
    """Road-wheel angle of the first steered axle, rad."""
    speed: float
    """Desired speed, m/s."""


class Driver:
    """Gives a command every 10 ms of a run; it has a state, so each run needs its own driver.

    The path starts at the CoG of the truck at the first command, along the x axis of the world.
    """

    def __init__(self, course: Course, vehicle: Vehicle) -> None:
        unit = vehicle.units[0]
        front = unit.axle_groups[0]
        self._front_distance = front.position - unit.cog  # of the front axle ahead of the CoG, m
        mass = vehicle.axle_loads()[unit.group_path(front)] / STANDARD_GRAVITY
        self._slip_gain = mass / front.cornering_stiffness  # slip angle per lateral acceleration, rad per m/s^2
        self._follows_path = isinstance(course, Path)
        base = course.arc if isinstance(course, Path) else course.time
        self._interval, self._last = float(base[1]), len(base) - 2
        self._speed = course.speed.tolist()
        if isinstance(course, Path):
            self._x, self._y, self._heading = course.x.tolist(), course.y.tolist(), course.heading.tolist()
            self._curvature = course.curvature.tolist()
        else:
            self._open_loop_steer = course.steer.tolist()
        self.arc = self._front_distance
        """Arc length of the path at the front axle, m."""
        self.error = 0.0
        """Distance of the front axle to the left of the path, m."""
        self.origin: tuple[float, float] | None = None
        """x and y of the start of the path, m; None before the first command."""
        self._previous = 0.0, 0.0, 0.0  # time, and position of the front axle
        self._steer = 0.0

    def __call__(self, time: float, pose: Pose) -> Command:
        """The command from a time on, s."""
        if not self._follows_path:
            return Command(self._at(self._open_loop_steer, time), self._at(self._speed, time))
        x = pose.x + self._front_distance * math.cos(pose.heading)
        y = pose.y + self._front_distance * math.sin(pose.heading)
        if self.origin is None:
            self.origin = pose.x, pose.y
            self._previous = time - 0.01, x, y
        elapsed, displacement = time - self._previous[0], (x - self._previous[1], y - self._previous[2])
        self._previous = time, x, y
        slip = 0.0  # direction of motion of the front axle, relative to the heading of the unit, rad
        if math.hypot(*displacement) > 1e-4:  # the displacement has the direction of half a step ago
            direction = math.atan2(displacement[1], displacement[0]) + pose.yaw_rate * elapsed / 2
            slip = math.remainder(direction - pose.heading, math.tau)

        heading = self._at(self._heading, self.arc)
        c, s = math.cos(heading), math.sin(heading)
        x -= self.origin[0] + self._at(self._x, self.arc)
        y -= self.origin[1] + self._at(self._y, self.arc)
        self.error = c * y - s * x
        self.arc += (c * x + s * y) / max(1 - self._at(self._curvature, self.arc) * self.error, 0.1)  # Newton's step

        speed = max(pose.speed, SLOWEST) / max(math.cos(slip), 0.5)
        direction_error = math.remainder(pose.heading + slip - heading, math.tau)
        acceleration = speed**2 * self._at(self._curvature, self.arc + speed * PREVIEW)
        acceleration -= BANDWIDTH * (BANDWIDTH * self.error + 2 * DAMPING * speed * direction_error)
        change = STEER_RATE * elapsed
        steer = slip + self._slip_gain * acceleration
        self._steer = min(max(steer, self._steer - change), self._steer + change)
        return Command(self._steer, self._at(self._speed, self.arc))

    def _at(self, values: list[float], position: float) -> float:
        """A value of the course by linear interpolation, with the first and the last value beyond the ends."""
        position /= self._interval
        if position <= 0:
            return values[0]
        k = min(int(position), self._last)
        return values[k] + min(position - k, 1.0) * (values[k + 1] - values[k])
