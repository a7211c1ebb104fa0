"""Engine, gearbox and the driver's right foot: the force at the driven wheels and the brakes, every 10 ms.

The equations have more detail than an estimator of the mass: losses for each gear, torsion of the driveline, lag of
turbo and driver, gear changes with an open clutch. `powered` moves a point mass with them, or the nonlinear
truck.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.signal import lfilter

STEP = 0.01
"""s"""
GRAVITY = 9.81
"""m/s^2"""
GEARS = (14.9, 11.7, 9.0, 7.0, 5.6, 4.4, 3.4, 2.67, 2.1, 1.63, 1.27, 1.0)
"""Ratios of a gearbox of heavy trucks; the last one is direct."""
SHIFT = (0.35, 0.65, 0.45)
"""s: torque falls, the clutch is open, torque rises."""
RPM = 2 * np.pi / 60
IDLE = 600 * RPM
"""rad/s"""
FULL_LOAD = np.interp(np.arange(3000.0), [600, 950, 1400, 1900, 2100], [0.55, 1.0, 1.0, 0.74, 0.0]).tolist()
"""Highest torque at each rpm, as a fraction of the maximum."""

SIGNALS = ("engine_speed", "engine_torque", "friction_torque", "driveline_engaged", "braking")
"""True signals of a powertrain, SI; the engine torque includes the friction."""


@dataclass(frozen=True, kw_only=True)
class DrivenTruck:
    """A truck with the errors of its sensors; see `drawn`."""

    mass: float
    """kg"""
    wheels: int = 12
    drag_area: float = 6.0
    """m^2"""
    rolling_resistance: float = 0.0055
    efficiency: float = 0.955
    """From the engine to the wheels in direct gear; other gears lose 1.2 % more."""
    engine_inertia: float = 3.5
    """kg m^2"""
    wheel_inertia: float = 13.5
    """Of one wheel, kg m^2."""
    radius: float = 0.5
    """m"""
    final_drive: float = 2.6
    max_torque: float = 2500.0
    """N m; also the reference of the torque signals."""
    torque_scale: float = 1.0
    """Shown torque = scale * torque + offset."""
    torque_offset: float = 0.0
    """N m"""
    speed_scale: float = 1.0
    speed_delay: float = 0.1
    """Of filter and bus, s."""
    wind: float = 0.0
    """Mean head wind, m/s."""
    hills: float = 0.02
    """Standard deviation of the grade."""
    vertical_curve: float = 50.0
    """Length over which the grade changes, m."""
    hill_length: float = 400.0
    """m"""
    anticipation: float = 0.5
    """Fraction of the grade that the driver sees and corrects for; the rest shows in the speed first."""

    @classmethod
    def drawn(cls, mass: float, rng: np.random.Generator, **given: float) -> "DrivenTruck":
        """A truck with random numbers and sensor errors, except those that are given."""
        numbers = {
            "drag_area": cls.drag_area * (1 + 0.15 * rng.normal()),
            "rolling_resistance": cls.rolling_resistance + 0.001 * rng.normal(),
            "efficiency": cls.efficiency * (1 + 0.01 * rng.normal()),
            "engine_inertia": cls.engine_inertia * np.exp(0.3 * rng.normal()),
            "wheel_inertia": cls.wheel_inertia * np.exp(0.2 * rng.normal()),
            "radius": rng.uniform(0.48, 0.52),
            "torque_scale": 1 + 0.02 * rng.normal(),
            "torque_offset": 25.0 * rng.normal(),
            "speed_scale": 1 + 0.007 * rng.normal(),
            "speed_delay": rng.uniform(0.05, 0.15),
            "wind": 2.5 * rng.normal(),
            "hills": rng.uniform(0.01, 0.03),
            "vertical_curve": rng.uniform(30.0, 100.0),
            "hill_length": rng.uniform(200.0, 800.0),
            "anticipation": rng.uniform(0.0, 1.0),
        }
        return cls(mass=mass, **(numbers | given))

    def resistance(self, v: float, air: float) -> float:
        """Drag and rolling resistance, N, at a speed and a relative speed of the air, m/s."""
        drag = 0.6 * self.drag_area * air * abs(air)
        return drag + self.mass * GRAVITY * self.rolling_resistance * (1 + 0.004 * v) * (v > 0.05)


class Road:
    """Grade along a road and gusts over time, both random."""

    def __init__(self, truck: DrivenTruck, rng: np.random.Generator, n: int) -> None:
        self._noise = rng.normal(size=n).tolist()
        # Vertical alignment of a road, at every metre: white noise through two poles.
        grades = rng.normal(size=40_000)
        for length in (truck.vertical_curve, truck.hill_length):
            grades = lfilter([1 / length], [1, 1 / length - 1], grades)
        self._grades: list[float] = (truck.hills * grades / grades.std()).tolist()
        self._gust = 0.0

    def grade(self, place: float) -> float:
        """Rise over run at a distance from the start, m."""
        return self._grades[int(place) % len(self._grades)]

    def gust(self, k: int) -> float:
        """Head wind above its mean before step k, m/s; once for each step, in their order."""
        now = self._gust
        self._gust += -now * STEP / 4.0 + math.sqrt(2 * STEP / 4.0) * self._noise[k]
        return now


class WheelForces(NamedTuple):
    """Output of `Powertrain.forces`."""

    drive: float
    """Force of the driveline at all driven wheels, N; negative in overrun."""
    brake: float
    """Force of the brakes at all wheels, N, 0 or more."""
    inertia: float
    """Engine inertia that turns with the driven wheels, as a mass, kg."""


class Powertrain:
    """Driver, engine and gearbox of a truck that starts at a speed, m/s; `forces` and `turn` advance them by 10 ms."""

    def __init__(self, truck: DrivenTruck, speed: float = 0.0) -> None:
        self.truck = truck
        ratios = [gear * truck.final_drive / truck.radius for gear in GEARS]
        fast = [i for i, ratio in enumerate(ratios) if speed * ratio >= 1000 * RPM]
        self.gear = self._target_gear = max(3, *fast) if fast else 3
        self._ratio = ratios[self.gear]
        self.engine_speed = max(speed * self._ratio, IDLE)
        self.torque = self.friction = 0.0  # N m, net and of friction
        self.braking = self.engaged = False
        self._shift, self._wait = 9.0, 0.0  # s since the start of a gear change, and until the next may start
        self._force = self._force_rate = self._seen = self._integral = self._demand = 0.0

    @property
    def signals(self) -> tuple[float, ...]:
        """Values of `SIGNALS`."""
        return self.engine_speed, self.torque + self.friction, self.friction, self.engaged, self.braking

    def forces(self, *, wanted: float, plan: float, v: float, resistance: float, grade: float) -> WheelForces:
        """The forces of the next step: the driver wants a speed, m/s, and plans its rate of change, m/s^2; the truck
        has the speed v, m/s, and the resistance of air and tyres, N, on a grade, rise over run.
        """
        t = self.truck
        error = wanted - v
        self._integral = min(max(self._integral + 0.05 * error * STEP, -0.5), 0.5)
        wish = 0.4 * error + self._integral + plan
        self._demand += (wish - self._demand) * STEP / 0.6  # m/s^2, with the reaction of a driver
        ratio = self._ratio = GEARS[self.gear] * t.final_drive / t.radius
        self._seen += (t.anticipation * grade - self._seen) * STEP / 0.6
        needed = t.mass * self._demand + resistance + t.mass * GRAVITY * self._seen
        self._choose_gear(v, grade, error)
        self._clutch_open = SHIFT[0] < self._shift <= SHIFT[0] + SHIFT[1]
        self._launching = v * ratio < IDLE
        self.engaged = not (self._clutch_open or self._launching)
        self._burn(needed)
        self.braking = needed < -1.15 * self.friction * ratio - 0.02 * t.mass or (wanted < 0.3 and v < 2)
        if self._clutch_open:
            force, inertia = 0.0, 0.0
        elif self._launching:  # the clutch slips
            force, inertia = max(self.torque, 0.0) * ratio * t.efficiency, 0.0
        else:
            loss = t.efficiency * (1.0 if self.gear == len(GEARS) - 1 else 0.988)
            force = self.torque * ratio * (loss if self.torque > 0 else 1 / loss)
            inertia = t.engine_inertia * ratio**2
        # Torsion of the driveline, 4 Hz: the force at the wheels follows that of the engine.
        self._force_rate += ((force - self._force) * 25.0**2 - 2 * 0.35 * 25.0 * self._force_rate) * STEP
        self._force += self._force_rate * STEP
        brake = min(max(-needed, 0.0), 6.0 * t.mass) if self.braking else 0.0
        if self._clutch_open:
            self._force = self._force_rate = 0.0
        return WheelForces(self._force, brake, inertia)

    def turn(self, v: float) -> None:
        """Turn the engine, at the circumferential speed of the driven wheels after the step, m/s."""
        goal = max(v * self._ratio, IDLE)
        self.engine_speed += (goal - self.engine_speed) * (1.0 if self.engaged else STEP / 0.15)

    def _choose_gear(self, v: float, grade: float, error: float) -> None:
        """After a dwell, so that the engine runs at 1000 to 1500 rpm, higher uphill."""
        self._wait -= STEP
        if self._shift > sum(SHIFT) and self._wait <= 0:
            revolutions, load = v * self._ratio / RPM, min(max(grade, 0.0) / 0.04, 1.0)
            up, down = 1350 + 250 * load + 150 * (error > 2), 950 + 150 * load
            if revolutions > up and self.gear < len(GEARS) - 1:
                self._target_gear = min(self.gear + (2 if self.gear < 7 and load < 0.5 else 1), len(GEARS) - 1)
            elif revolutions < down and self.gear > 2:
                self._target_gear = max(self.gear - (2 if error < 0 else 1), 2)
            if self._target_gear != self.gear:
                self._shift, self._wait = 0.0, 3.5
        self._shifting = self._shift <= sum(SHIFT)
        if self._shifting:
            self._shift += STEP
            if self._shift >= SHIFT[0] + SHIFT[1] / 2:
                self.gear = self._target_gear

    def _burn(self, needed: float) -> None:
        """Net torque of the engine for a force at the wheels, N."""
        t = self.truck
        limit = t.max_torque * FULL_LOAD[int(self.engine_speed / RPM)]
        self.friction = 90.0 + 0.9 * self.engine_speed
        wanted = min(max(needed / (self._ratio * t.efficiency), 0.0), limit)
        if self._clutch_open or (self._shifting and self._shift <= SHIFT[0]):
            wanted = 0.0
        if wanted <= 0:
            wanted = -self.friction if self.engaged else 0.0  # overrun without fuel
        self.torque += (wanted - self.torque) * STEP / (0.12 if wanted < self.torque else 0.3)
