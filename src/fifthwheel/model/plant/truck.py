"""The nonlinear truck: MuJoCo integrates the bodies, a compiled step computes the tyre forces, a driver steers.

The true signals of a run are computed from what MuJoCo senses: the reference for sensors and estimators. SI, ISO 8855.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from fifthwheel.base.errors import SignalError, VehicleError
from fifthwheel.base.lazy import require
from fifthwheel.base.types import Array
from fifthwheel.data.channels import SignalName
from fifthwheel.data.record import Record
from fifthwheel.model.manoeuvres import Course
from fifthwheel.model.plant import tyre_forces
from fifthwheel.model.plant.bodies import SIDES, SprungBody, model_xml, sprung_bodies
from fifthwheel.model.plant.driver import Driver, Pose
from fifthwheel.model.plant.powered import (
    LONGITUDINAL,
    STEPS_PER_COMMAND,
    TIME_STEP,
    PoweredWheels,
    SpeedController,
    brake_limited,
    gravity,
    matched,
)
from fifthwheel.model.plant.powertrain import DrivenTruck
from fifthwheel.model.plant.properties import Properties
from fifthwheel.model.plant.rough_road import RoughRoad
from fifthwheel.model.plant.sensors import Sensor, article_sensors, bus_sensors, measure
from fifthwheel.model.plant.tyre_forces import BODY_SENSORS, WHEEL_OUTPUTS, StepLayout
from fifthwheel.truck import Vehicle
from fifthwheel.truck.steering import require_no_steering

ROLLOVER_ANGLE = 0.6
"""Roll angle beyond which a truck rolls over, rad."""
JACKKNIFE_ANGLE = 1.5
"""Articulation angle at which units touch, rad."""
LOWEST_SPEED = 1.0
"""Speed below which the tyre model is not valid, m/s."""
SETTLING_TIME = 2.0
"""Straight driving before time 0, s."""
REFERENCE_QUANTITIES = ("sideslip", "roll", "articulation", "grade", "gear")
"""Quantities that a record holds as reference by default."""


@dataclass(frozen=True)
class BodyFrame:
    """The frame of a body over time: each array (N, 3) in world axes."""

    position: Array
    x_axis: Array
    y_axis: Array
    velocity: Array
    angular_velocity: Array

    @classmethod
    def of(cls, sensed: Array) -> "BodyFrame":
        """The frame by the first 15 sensed values of a body, (N, 15 or more)."""
        return cls(*(sensed[:, 3 * k : 3 * k + 3] for k in range(5)))

    @property
    def z_axis(self) -> Array:
        """(N, 3)."""
        return np.cross(self.x_axis, self.y_axis)

    @property
    def heading(self) -> Array:
        """Continuous heading angle of the x axis, rad, (N,)."""
        return np.unwrap(np.arctan2(self.x_axis[:, 1], self.x_axis[:, 0]))

    def horizontal_motion(self, x: float, z: float) -> tuple[Array, Array, Array]:
        """Longitudinal and lateral velocity in the horizontal plane, (N,), and position, (N, 3), of a point."""
        arm = x * self.x_axis + z * self.z_axis
        velocity = self.velocity + np.cross(self.angular_velocity, arm)
        c, s = np.cos(self.heading), np.sin(self.heading)
        u, v = c * velocity[:, 0] + s * velocity[:, 1], c * velocity[:, 1] - s * velocity[:, 0]
        return u, v, self.position + arm


def true_signals(
    time: Array, sensed: Array, wheels: Array, vehicle: Vehicle, properties: Properties, layout: StepLayout
) -> dict[str, Array]:
    """Every signal of a run, (N,) each, by name.

    From the sensed values and steer angles at each instant, and the `WHEEL_OUTPUTS` of each wheel.

    Yaw and roll rates are those of gyros fixed to the sprung body. Sideslip is that of the point of the body on the
    roll axis below the CoG of the whole unit, in the horizontal plane. Accelerations are those of an accelerometer on
    the body, where the vehicle file has it, by default at that point; they contain gravity. Lateral force and slip
    angle of an axle combine both wheels; load transfer is the right load minus the left one, divided by their sum. A
    SignalError if the truck rolls over, jackknifes or stops.
    """
    signals: dict[str, Array] = {}
    headings: list[Array] = []
    for i, unit in enumerate(vehicle.units):
        of_body = sensed[:, BODY_SENSORS * i : BODY_SENSORS * (i + 1)]
        frame, acceleration = BodyFrame.of(of_body), of_body[:, 15:18]
        heading, z_axis = frame.heading, frame.z_axis
        headings.append(heading)
        u, v, position = frame.horizontal_motion(unit.cog, unit.roll_axis_height)
        signals |= {
            f"{quantity}.{unit.name}": values
            for quantity, values in {
                "position_x": position[:, 0],
                "position_y": position[:, 1],
                "yaw": heading,
                "roll": np.arctan2(frame.y_axis[:, 2], z_axis[:, 2]),
                "pitch": -np.arcsin(frame.x_axis[:, 2]),
                "yaw_rate": np.sum(frame.angular_velocity * z_axis, axis=1),
                "roll_rate": np.sum(frame.angular_velocity * frame.x_axis, axis=1),
                "pitch_rate": np.sum(frame.angular_velocity * frame.y_axis, axis=1),
                "longitudinal_velocity": u,
                "lateral_velocity": v,
                "sideslip": np.arctan2(v, u),
                "longitudinal_acceleration": acceleration[:, 0],
                "lateral_acceleration": acceleration[:, 1],
            }.items()
        }
        if i:
            signals[f"articulation.{unit.name}"] = heading - headings[i - 1]
        if i == len(vehicle.units) - 1 and i:
            u, v, _ = frame.horizontal_motion(properties.landing_leg, 0.0)
            signals[f"sideslip.{unit.name}.landing_leg"] = np.arctan2(v, u)
    signals["speed"] = signals[f"longitudinal_velocity.{vehicle.units[0].name}"]
    signals |= {name: sensed[:, layout.sensed + k] for k, name in enumerate(vehicle.steer_signals())}
    axles, n = [f"{unit.name}.{axle.name}" for unit in vehicle.units for axle in unit.on_road], len(WHEEL_OUTPUTS)
    for i, axle in enumerate(axles):
        left, right = (
            dict(zip(WHEEL_OUTPUTS, wheels[:, n * k : n * k + n].T, strict=True)) for k in (2 * i, 2 * i + 1)
        )
        load = left["vertical_force"] + right["vertical_force"]
        signals |= {
            f"slip_angle.{axle}": np.arctan((left["slip"] + right["slip"]) / 2),
            f"lateral_force.{axle}": left["lateral_force"] + right["lateral_force"],
            f"longitudinal_force.{axle}": left["longitudinal_force"] + right["longitudinal_force"],
            f"vertical_force.{axle}": load,
            f"load_transfer.{axle}": (right["vertical_force"] - left["vertical_force"]) / load,
            f"wheel_speed.{axle}.left": left["speed"],
            f"wheel_speed.{axle}.right": right["speed"],
        }
    check_run(time, signals, vehicle)
    return signals


def check_run(time: Array, signals: dict[str, Array], vehicle: Vehicle) -> None:
    """Raise SignalError with the first instant at which a unit rolls over or jackknifes, or the truck stops."""
    for unit in vehicle.units:
        for event, name, limit in (
            ("rolls over", f"roll.{unit.name}", ROLLOVER_ANGLE),
            ("jackknifes", f"articulation.{unit.name}", JACKKNIFE_ANGLE),
        ):
            exceeded = ~(np.abs(signals.get(name, np.zeros_like(time))) < limit)
            if exceeded.any():
                raise SignalError(
                    f"{name}: expected a magnitude below {limit:g} rad; the {unit.name} {event} at"
                    f" {time[exceeded.argmax()]:.1f} s; reduce speed, steering, braking or the roughness of the road"
                )
    stopped = signals["speed"] < LOWEST_SPEED
    if stopped.any():
        raise SignalError(
            f"speed: expected {LOWEST_SPEED:g} m/s or more, the range of the tyre model; the truck is slower at"
            f" {time[stopped.argmax()]:.1f} s; choose a course with a higher speed"
        )


Progress = Callable[[str, int, int], None]
"""Called with a title, the steps done and all steps."""


@dataclass(frozen=True, kw_only=True)
class PlantRun:
    """The true signals of one run."""

    vehicle: Vehicle
    properties: Properties
    time: Array
    """(N,) s, regular, from 0."""
    truth: dict[str, Array] = field(repr=False)
    """(N,) SI, by signal."""
    name: str
    driven: DrivenTruck | None = None
    """The powertrain, with the errors of its sensors."""

    def record(self, sensors: Mapping[str, Sensor] | None = None, *, seed: int = 0, everything: bool = False) -> Record:
        """The measured signals, with true signals as reference.

        Args:
            sensors: by signal; None: those of the article, and of a truck with a powertrain those of its bus, see
                sensors.py.
            seed: seed of the sensor noise.
            everything: all true signals as reference, not only `REFERENCE_QUANTITIES`.
        """
        if sensors is None:
            sensors = article_sensors(self.vehicle)
            sensors |= bus_sensors(self.vehicle, self.driven) if self.driven else {}
        reference = {
            name: values
            for name, values in self.truth.items()
            if everything or SignalName.of(name).quantity in REFERENCE_QUANTITIES
        }
        signals = measure(self.time, self.truth, sensors, seed=seed)
        return Record(time=self.time, signals=signals, reference=reference, name=self.name)


@dataclass(frozen=True, eq=False)
class Plant:
    """A nonlinear multibody truck.

    Raises:
        VehicleError: the vehicle has no steered axle on its first unit, its axles are heavier than their unit allows,
            or a property names an unknown axle group.
    """

    vehicle: Vehicle
    """Units, axles, masses, stiffnesses and payload; all of them are used without simplification."""
    properties: Properties = field(default_factory=Properties)
    """Properties that a vehicle file does not have."""

    def __post_init__(self) -> None:
        require_no_steering(self.vehicle.steering, "the nonlinear truck")
        sprung_bodies(self.vehicle, self.properties)

    @cached_property
    def multibody(self) -> "Multibody":
        """The compiled model; the first use compiles it. A FifthwheelError if MuJoCo is not installed."""
        return Multibody(self.vehicle, self.properties)

    def drive(
        self,
        course: Course,
        *,
        rate: float = 100.0,
        driven: DrivenTruck | None = None,
        seed: int = 0,
        name: str | None = None,
        progress: Progress | None = None,
        until_rollover: bool = False,
    ) -> PlantRun:
        """Drive along a course.

        Args:
            course: path or open loop.
            rate: sampling rate of the result, Hz; 1000 Hz divided by a whole number.
            driven: engine, gears and driver that accelerate and brake the truck, with the hills and the wind; its mass,
                tyres, drag and rolling resistance are those of the vehicle and its properties. None: a controller
                keeps the speed, on a level road without wind.
            seed: seed of the profile of a rough road, and of hills and gusts, which a truck without `driven` lacks.
            name: name of the run; by default that of the course.
            progress: called once per second of the run.
            until_rollover: the run ends before a unit rolls over, which then is no error.

        Raises:
            FifthwheelError: MuJoCo is not installed.
            SignalError: the rate does not divide 1000 Hz; the truck rolls over, jackknifes or stops; it rolls over in
                its first second.
        """
        steps = round(1 / (rate * TIME_STEP))  # per sample
        if steps < 1 or not math.isclose(steps * rate * TIME_STEP, 1):
            raise SignalError(f"rate: expected 1000 Hz divided by a whole number, such as 50, 100 or 200, got {rate:g}")
        simulation = Simulation(self, course, driven, seed)
        layout = self.multibody.layout
        count = math.floor(course.duration / TIME_STEP / steps) + 1
        sensed = np.full((count, simulation.measured.size), np.nan)
        wheels = np.full((count, layout.wheel_outputs), np.nan)
        longitudinal = np.full((count, len(LONGITUDINAL)), np.nan)
        for k in range(-round(SETTLING_TIME / TIME_STEP), (count - 1) * steps + 1):
            if k % STEPS_PER_COMMAND == 0:
                simulation.command(max(k, 0) * TIME_STEP, settling=k < 0)
                if progress and k % 1000 == 0:
                    progress("simulating", max(k, 0), count * steps)
            simulation.sense()
            if until_rollover and simulation.rolls_over:
                count = max(k // steps, 0)
                break
            if k >= 0 and k % steps == 0:
                sensed[k // steps] = simulation.measured
                wheels[k // steps] = simulation.wheel_outputs
                if simulation.powered:
                    longitudinal[k // steps] = simulation.powered.row
            simulation.step()
        if count < rate:
            raise SignalError(f"{course.name}: expected a run of 1 s or more, the truck rolls over; reduce its speed")
        time = np.arange(count, dtype=np.float64) * (steps * TIME_STEP)
        truth = true_signals(time, sensed[:count], wheels[:count], self.vehicle, self.properties, layout)
        if driven:
            names = (f"braking.{self.vehicle.units[0].name}" if name == "braking" else name for name in LONGITUDINAL)
            truth |= dict(zip(names, longitudinal[:count].T, strict=True))
        return PlantRun(
            vehicle=self.vehicle,
            properties=self.properties,
            time=time,
            truth=truth,
            name=name or course.name,
            driven=driven,
        )


class Multibody:
    """A truck as compiled for the simulation: MuJoCo's model, and the step of the tyre forces with its constants."""

    def __init__(self, vehicle: Vehicle, properties: Properties) -> None:
        bodies = sprung_bodies(vehicle, properties)
        self.axles = tuple(axle for body in bodies for axle in body.axles)
        self.model = _compiled(vehicle, bodies, properties)
        self.layout = _layout(self.model, bodies)
        self.forces = tyre_forces.forces(self.layout, bodies, properties)
        self.constants = tyre_forces.constants(bodies, properties, TIME_STEP)


def _compiled(vehicle: Vehicle, bodies: tuple[SprungBody, ...], properties: Properties) -> Any:
    """MuJoCo's model; a VehicleError if a body cannot be rigid."""
    model = mujoco().MjModel
    try:
        return model.from_xml_string(model_xml(vehicle, bodies, properties, TIME_STEP))
    except ValueError as error:
        reason = " ".join(str(error).removeprefix("Error: ").split())
        raise VehicleError(
            f"{vehicle.name}: no rigid body has these masses and inertias ({reason}); correct mass, sprung.mass, "
            "yaw_inertia, sprung.roll_inertia and sprung.roll_yaw_product of that unit"
        ) from None


def mujoco() -> Any:
    """The module mujoco, which may not be installed. A run that diverges ends with an error of our own."""
    module = require("mujoco", "plant")
    module.set_mju_user_warning(lambda _: None)  # by default it writes MUJOCO_LOG.TXT into the folder of the user
    return module


def _layout(model: Any, bodies: tuple[SprungBody, ...]) -> tyre_forces.StepLayout:
    body_type = mujoco().mjtObj.mjOBJ_BODY

    def row(name: str) -> int:
        return int(mujoco().mj_name2id(model, body_type, name))

    axles = [axle for body in bodies for axle in body.axles]
    rows = [row(axle.name) for axle in axles]
    return tyre_forces.StepLayout(
        bodies=tuple(row(body.name) for body in bodies),
        axles=tuple(rows),
        carriers=tuple(int(model.body_parentid[k]) for k in rows),
        wheels=tuple(row(f"{axle.name}.{side}") for axle in axles for side in SIDES),
        rows=model.nbody,
        steered=tuple(i for i, axle in enumerate(axles) if axle.steered),
    )


class Simulation:
    """The state of one run; `command`, `sense` and `step` advance it."""

    def __init__(self, plant: Plant, course: Course, driven: DrivenTruck | None = None, seed: int = 0) -> None:
        multibody = plant.multibody
        forces, layout = multibody.forces, multibody.layout
        self.plant, self.model = plant, multibody.model
        self.data = mujoco().MjData(self.model)
        self._step1, self._step2 = mujoco().mj_step1, mujoco().mj_step2
        self._run_forces = forces.single
        self.driver = Driver(course, plant.vehicle)
        self.carry = np.zeros(forces.n_carry)
        self.sample = np.zeros(forces.n_sample)
        self.output = np.zeros(forces.n_output)
        self.wheel_outputs = self.output[forces.n_output - layout.wheel_outputs :]
        self._pointers = [a.ctypes.data for a in (self.carry, self.sample, multibody.constants, self.output)]
        self.measured, self._road_inputs = np.split(self.sample, [layout.sensed + len(layout.steered)])
        self._sensed, self._steer = np.split(self.measured, [layout.sensed])
        self._wrench = self.output[: 6 * layout.rows].reshape(-1, 6)
        self._steer_increment = np.zeros(len(layout.steered))  # per time step, rad
        self._bodies = list(layout.bodies)
        self._spin = [self._address(f"{axle.name}.{side}") for axle in multibody.axles for side in SIDES]
        self._torques = np.zeros(len(self._spin))  # of the wheels, N m
        self._is_braking = False
        self._start_speed = float(course.speed[0])
        vehicle, properties = plant.vehicle, plant.properties
        self.speed_controller = SpeedController(vehicle, properties, multibody.axles, self._start_speed)
        self.powered = None
        if driven:
            truck = matched(driven, vehicle, properties)
            commands = math.ceil((SETTLING_TIME + course.duration) / (STEPS_PER_COMMAND * TIME_STEP)) + 1
            self.powered = PoweredWheels(truck, self.speed_controller, self._start_speed, commands, seed)
        self.data.qvel[0] = self._start_speed
        self.data.qvel[self._spin] = self._start_speed / properties.wheel_radius
        self.model.dof_armature[self._spin] = 0.0  # a former run may have left its engine
        self.model.opt.gravity[:] = gravity(0.0, properties.bank, 0.0)
        self.road = self._rough_road(list(layout.axles), seed) if properties.roughness else None
        self._road_ahead = iter(())

    def _rough_road(self, axles: list[int], seed: int) -> RoughRoad:
        properties = self.plant.properties
        mujoco().mj_kinematics(self.model, self.data)
        return RoughRoad(properties.roughness, 2 * properties.half_track, self.data.xpos[axles, 0].copy(), seed)

    def _address(self, joint: str) -> int:
        number = mujoco().mj_name2id(self.model, mujoco().mjtObj.mjOBJ_JOINT, joint)
        return int(self.model.jnt_dofadr[number])

    def command(self, time: float, *, settling: bool) -> None:
        """Set steer rate, wheel torques and the road until the next command, and the direction of gravity on a slope.

        While settling, the truck goes straight ahead at the initial speed of the course.
        """
        pose = self.pose()
        steer, speed = (0.0, self._start_speed) if settling else self.driver(time, pose)
        self._steer_increment[0] = (steer - self._steer[0]) / STEPS_PER_COMMAND
        if self.road:
            self._road_ahead = iter(self.road.ahead(pose.speed, TIME_STEP, STEPS_PER_COMMAND))
        if self.powered is None:
            self._torques = self.speed_controller(speed - pose.speed)
        else:
            self._torques = self.powered(speed, pose.speed, self.data.qvel[self._spin])
            self.data.qfrc_applied[0] = self.powered.wind_force * math.cos(pose.heading)
            self.data.qfrc_applied[1] = self.powered.wind_force * math.sin(pose.heading)
            self.model.dof_armature[self._spin] = self.powered.armature
        self.data.qfrc_applied[self._spin] = self._torques
        self._is_braking = bool(self._torques.min() < 0)
        if self.powered or self.plant.properties.bank:
            grade = self.powered.grade if self.powered else 0.0
            self.model.opt.gravity[:] = gravity(grade, self.plant.properties.bank, pose.heading)

    def pose(self) -> Pose:
        """Pose of the first unit."""
        x, y = self.data.qpos[:2]
        w, i, j, k = self.data.qpos[3:7]
        heading = math.atan2(2 * (w * k + i * j), 1 - 2 * (j * j + k * k))
        c, s = math.cos(heading), math.sin(heading)
        u, v = self.data.qvel[:2]
        cog = self.plant.vehicle.units[0].cog
        return Pose(x + c * cog, y + s * cog, heading, c * u + s * v, float(self.data.qvel[5]))

    def sense(self) -> None:
        """Update the sensed values and the tyre forces."""
        self._step1(self.model, self.data)
        self._sensed[:] = self.data.sensordata
        if self.road:
            self._road_inputs[:] = next(self._road_ahead)
        self._run_forces(1, 1, *self._pointers)

    @property
    def rolls_over(self) -> bool:
        """Whether the vertical axis of a unit is inclined by more than the rollover angle."""
        return bool(self.data.xmat[self._bodies, 8].min() < math.cos(ROLLOVER_ANGLE))

    def step(self) -> None:
        """Integrate one time step."""
        if self._is_braking:
            rim_speed = self.plant.properties.wheel_radius * self.data.qvel[self._spin]
            self.data.qfrc_applied[self._spin] = brake_limited(self._torques, rim_speed)
        self.data.xfrc_applied[:] = self._wrench
        self._step2(self.model, self.data)
        self._steer += self._steer_increment
