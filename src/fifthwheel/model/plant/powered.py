"""What a powertrain moves: the wheels of the nonlinear truck, or a point mass in ordinary driving.

The wheels of the nonlinear truck have the torques of a controller of its speed, or of a powertrain on a hilly road with
wind. `drive` is the longitudinal motion only, as the truth for estimates of the mass, on hilly roads, in traffic and
wind, with the signals of its CAN bus: rolling resistance that depends on speed, gusts, filters and quantisation of SAE
J1939-71 (EEC1, EEC3, CCVS). Starts and stops are in it, which the tyres of the nonlinear truck do not have.
"""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fifthwheel.base.types import Array
from fifthwheel.base.units import STANDARD_GRAVITY as GRAVITY
from fifthwheel.data.record import Record
from fifthwheel.model.plant.bodies import SIDES, BeamAxle
from fifthwheel.model.plant.powertrain import GRAVITY as POWERTRAIN_GRAVITY
from fifthwheel.model.plant.powertrain import SIGNALS, STEP, DrivenTruck, Powertrain, Road
from fifthwheel.model.plant.properties import Properties
from fifthwheel.model.plant.sensors import driveline_sensors, measure
from fifthwheel.truck import Vehicle
from fifthwheel.truck.driveline import AIR_DENSITY

TIME_STEP = 1e-3
"""Time step of the integration, s."""
STEPS_PER_COMMAND = 10
"""Time steps from one command of the driver to the next; together `STEP`."""
LOCKING_SPEED = 0.5
"""Speed of the rim below which the torque of a brake falls, m/s: a locked wheel creeps more slowly than this."""
LONGITUDINAL = (*SIGNALS, "gear", "grade", "head_wind")
"""True signals of a powered truck in `PoweredWheels.row`, SI."""
SPEEDS = np.array([30, 50, 50, 60, 70, 80, 85, 85, 88]) / 3.6
"""Of traffic, m/s; a red light or a roundabout stops or slows it in between."""
TRUE = ("speed", *SIGNALS[:-1], "braking.tractor", "grade")
"""True signals, SI."""


def matched(driven: DrivenTruck, vehicle: Vehicle, properties: Properties) -> DrivenTruck:
    """The truck with the mass, tyres, drag and rolling resistance of a nonlinear truck."""
    return replace(
        driven,
        mass=sum(unit.mass for unit in vehicle.units),
        wheels=sum(vehicle.tyres().values()),
        radius=properties.wheel_radius,
        drag_area=properties.drag_area,
        rolling_resistance=properties.rolling_resistance,
    )


class SpeedController:
    """A PI controller of the speed through driven wheels and brakes, for a truck that starts at a speed, m/s.

    Driven wheels share the driving force equally; the wheels of a group brake in proportion to their load.
    """

    def __init__(self, vehicle: Vehicle, properties: Properties, axles: Sequence[BeamAxle], speed: float) -> None:
        self.mass = sum(unit.mass for unit in vehicle.units)  # kg, of the whole truck
        self.wheel_radius = properties.wheel_radius
        driven = np.array([float(axle.driven) for axle in axles for _ in SIDES])
        loads = vehicle.axle_loads()
        of_group = {path: properties.brakes.get(path, 0.0) / load for path, load in loads.items()}
        braking = np.array(
            [axle.load * (of_group[axle.group] if properties.brakes else 1.0) for axle in axles for _ in SIDES]
        )
        self.drive_fractions = driven / max(driven.sum(), 1.0)  # of the driving force on each wheel
        self.brake_fractions = braking / braking.sum()  # of the braking force on each wheel
        rolling = properties.rolling_resistance * self.mass * GRAVITY
        self.integral = rolling + AIR_DENSITY / 2 * properties.drag_area * speed**2  # N, driving resistance

    def __call__(self, error: float) -> Array:
        """Torque of each wheel, N m, (wheels,), for a speed error, m/s; called once per command."""
        force = self.mass * 0.8 * error + self.integral
        force = min(max(force, -0.5 * GRAVITY * self.mass), 0.15 * GRAVITY * self.mass)
        self.integral += self.mass * 0.3 * min(max(error, -0.5), 0.5) * STEPS_PER_COMMAND * TIME_STEP
        torques: Array = force * self.wheel_radius * (self.drive_fractions if force > 0 else self.brake_fractions)
        return torques


class PoweredWheels:
    """The powertrain of a nonlinear truck with a speed controller, and its road; called once per command.

    The engine turns with the mean speed of the driven wheels, and its inertia with them. The driver knows the course:
    the speed to be driven and its rate of change at the present place.
    """

    def __init__(self, truck: DrivenTruck, wheels: SpeedController, speed: float, commands: int, seed: int) -> None:
        self._truck, self._drive, self._brake = truck, wheels.drive_fractions, wheels.brake_fractions
        self._road = Road(truck, np.random.default_rng([seed, 41]), commands)
        self._train = Powertrain(truck, speed)
        self._wanted, self._place, self._count = speed, 0.0, 0
        self.armature = np.zeros_like(self._drive)
        """Inertia of the engine on each wheel, kg m^2."""
        self.grade = 0.0
        """Rise over run of the road below the truck."""
        self.wind_force = 0.0
        """Longitudinal force of the wind, beside the drag in still air, N."""
        self.row = np.zeros(len(LONGITUDINAL))
        """Values of `LONGITUDINAL`."""

    def __call__(self, wanted: float, v: float, spins: Array) -> Array:
        """Torque of each wheel, N m, (wheels,), for the wanted and the true speed, m/s, and spins, (wheels,), rad/s."""
        truck, train = self._truck, self._train
        train.turn(float(self._drive @ spins) * truck.radius)
        plan, self._wanted = (wanted - self._wanted) / STEP, wanted
        self.grade = self._road.grade(self._place)
        self._place += v * STEP
        wind = truck.wind + self._road.gust(self._count)
        self._count += 1
        self.wind_force = AIR_DENSITY / 2 * truck.drag_area * (v * abs(v) - (v + wind) * abs(v + wind))
        force = train.forces(wanted=wanted, plan=plan, v=v, resistance=truck.resistance(v, v + wind), grade=self.grade)
        self.armature = self._drive * (force.inertia * truck.radius**2)
        self.row[:] = (*train.signals, train.gear + 1, self.grade, wind)
        torques: Array = truck.radius * (force.drive * self._drive - force.brake * self._brake)
        return torques


def brake_limited(torques: Array, rim_speed: Array) -> Array:
    """Commanded torques of wheels, N m, (wheels,), negative of a brake, at speeds of their rims, m/s: a brake opposes
    the rotation, so a locked wheel stands and does not turn back."""
    return np.where(torques < 0, torques * np.clip(rim_speed / LOCKING_SPEED, -1, 1), torques)


def gravity(grade: float, bank: float, heading: float) -> tuple[float, float, float]:
    """Gravity in the frame of a road with a grade, rise over run, and a bank, rad, m/s^2."""
    slope = math.atan(grade)
    ahead, down = -GRAVITY * math.sin(slope), -GRAVITY * math.cos(slope)
    side, down = down * math.sin(bank), down * math.cos(bank)
    c, s = math.cos(heading), math.sin(heading)
    return c * ahead - s * side, s * ahead + c * side, down


def drive(
    truck: DrivenTruck, *, duration: float = 600.0, seed: int = 0, rate: float = 50.0, name: str = "drive"
) -> Record:
    """The log of a drive of a duration, s, with stops and hills, all of it random, at a sampling rate, Hz.

    The reference has the true speed and grade.
    """
    rng = np.random.default_rng(seed)
    n, every = round(duration / STEP), round(1 / (rate * STEP))
    road = Road(truck, rng, n)
    motion = _motion(truck, road, _traffic(rng, n))[::every]
    time, truth = STEP * np.arange(0, n, every, dtype=np.float64), dict(zip(TRUE, motion.T, strict=True))
    reference = {name: truth[name] for name in ("speed", "grade")}
    return Record(
        time=time, signals=measure(time, truth, driveline_sensors(truck), seed=seed), reference=reference, name=name
    )


def _traffic(rng: np.random.Generator, n: int) -> Array:
    """The speed that traffic permits at every instant, m/s."""
    speed = np.empty(n)
    k = 0
    while k < n:
        for value, mean in ((rng.choice(SPEEDS), 45.0), (rng.choice([0.0, 5.0, 8.0, 14.0]), 5.0)):
            length = round(rng.exponential(mean) / STEP) + round(5 / STEP)
            speed[k : k + length] = value + rng.normal()
            k += length
    return np.maximum(speed, 0.0)


def _motion(truck: DrivenTruck, road: Road, traffic: Array) -> Array:
    """(N, 7): the signals `TRUE`."""
    train, out = Powertrain(truck), np.empty((len(traffic), len(TRUE)))
    rotating_wheels = truck.wheels * truck.wheel_inertia / truck.radius**2
    v = place = wanted = plan = 0.0
    for k, permitted in enumerate(traffic.tolist()):
        plan += (min(max(0.4 * (permitted - wanted), -0.8), 0.9) - plan) * STEP / 0.8  # m/s^2
        wanted = max(wanted + plan * STEP, 0.0)
        grade, resistance = road.grade(place), truck.resistance(v, v + truck.wind + road.gust(k))
        force = train.forces(wanted=wanted, plan=plan, v=v, resistance=resistance, grade=grade)
        total = truck.mass + rotating_wheels + force.inertia
        downhill = truck.mass * POWERTRAIN_GRAVITY * grade / math.sqrt(1 + grade**2)
        v = max(v + (force.drive - resistance - downhill - force.brake) / total * STEP, 0.0)
        place += v * STEP
        train.turn(v)
        out[k] = v, *train.signals, grade
    return out
