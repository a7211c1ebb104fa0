"""The nonlinear truck at work: MuJoCo moves the bodies, a compiled step gives the tyres' forces, a driver steers."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from fifthwheel.errors import FifthwheelError, SignalError, VehicleError
from fifthwheel.logs import Record
from fifthwheel.plant import tyres
from fifthwheel.plant.body import bodies
from fifthwheel.plant.courses import Course
from fifthwheel.plant.driver import Driver, Pose
from fifthwheel.plant.properties import Properties
from fifthwheel.plant.sensors import Sensor, article, observe
from fifthwheel.plant.tree import SIDES, xml
from fifthwheel.plant.truth import Layer, truth
from fifthwheel.vehicle import Vehicle
from fifthwheel.vehicle.statics import STANDARD_GRAVITY as GRAVITY

Array = NDArray[np.float64]
Progress = Callable[[str, int, int], None]

STEP = 1e-3
"""Of the integration, s."""
CONTROL = 10
"""Steps from one command of the driver to the next."""
SETTLE = 2.0
"""Driven straight before time zero, s."""


STATES = ("sideslip", "roll", "articulation")
"""What a record tells of the truth unless asked for all."""


@dataclass(frozen=True, kw_only=True)
class Drive:
    """What truly happened."""

    vehicle: Vehicle
    properties: Properties
    time: Array  # (N,) s, regular, from 0
    truth: dict[str, Array] = field(repr=False)  # signal: (N,), SI; see truth.py
    name: str

    def record(self, sensors: Mapping[str, Sensor] | None = None, *, seed: int = 0, everything: bool = False) -> Record:
        """What sensors show of it, the truth beside it as reference.

        Args:
            sensors: by signal; the article's by default, see sensors.py.
            seed: of their noise.
            everything: the whole truth, not only sideslip, roll and articulation.
        """
        shown = observe(self.time, self.truth, article(self.vehicle) if sensors is None else sensors, seed=seed)
        reference = {n: v for n, v in self.truth.items() if everything or n.partition(".")[0] in STATES}
        return Record(time=self.time, signals=shown, reference=reference, name=self.name)


class Plant:
    """A nonlinear multibody truck.

    Args:
        vehicle: units, axles, masses, stiffnesses and payload; nothing of it is simplified.
        properties: what only the plant has.

    Raises:
        FifthwheelError: MuJoCo is not installed.
        VehicleError: the vehicle has no steered axle in front, or cannot stand.
    """

    def __init__(self, vehicle: Vehicle, properties: Properties | None = None) -> None:
        try:
            import mujoco
        except ImportError:
            raise FifthwheelError("the nonlinear truck needs MuJoCo: pip install '.[plant]' in the checkout") from None
        self._mujoco = mujoco
        self.vehicle = vehicle
        self.properties = properties or Properties()
        self.bodies = bodies(vehicle, self.properties)
        self.beams = [beam for body in self.bodies for beam in body.beams]
        if not any(beam.steered for beam in self.bodies[0].beams):
            raise VehicleError(f"{vehicle.name}: no axle of {vehicle.units[0].name} is steerable; set steerable = true")
        self.model = mujoco.MjModel.from_xml_string(xml(vehicle, self.bodies, self.properties, STEP))
        self.layout = self._layout()
        self.forces = tyres.forces(self.layout, self.bodies, self.properties)
        self.constants = tyres.constants(self.bodies, self.properties, STEP)

    def _layout(self) -> tyres.Layout:
        def row(name: str) -> int:
            return int(self._mujoco.mj_name2id(self.model, self._mujoco.mjtObj.mjOBJ_BODY, name))

        axles = [row(beam.name) for beam in self.beams]
        return tyres.Layout(
            bodies=tuple(row(body.name) for body in self.bodies),
            axles=tuple(axles),
            carriers=tuple(int(self.model.body_parentid[axle]) for axle in axles),
            wheels=tuple(row(f"{beam.name}.{side}") for beam in self.beams for side in SIDES),
            rows=self.model.nbody,
            steered=tuple(i for i, beam in enumerate(self.beams) if beam.steered),
        )

    def drive(
        self, course: Course, *, rate: float = 100.0, name: str | None = None, progress: Progress | None = None
    ) -> Drive:
        """Drive a course and keep what happened, `rate` times a second.

        Raises:
            SignalError: the rate does not divide 1000 Hz; the truck rolled over, jackknifed or came to a stop.
        """
        every = round(1 / (rate * STEP))
        if every < 1 or not math.isclose(every * rate * STEP, 1):
            raise SignalError(f"rate: expected 1000 Hz divided by a whole number, such as 50, 100 or 200, got {rate:g}")
        motion = Motion(self, course)
        count = math.floor(course.duration / STEP / every) + 1
        layers = Layer.empty(count, self.layout, len(tyres.WHEEL) * 2 * len(self.beams))
        for k in range(-round(SETTLE / STEP), (count - 1) * every + 1):
            if k % CONTROL == 0:
                motion.command(max(k, 0) * STEP, driving=k >= 0)
                if progress and k % 1000 == 0:
                    progress("drive", max(k, 0), count * every)
            motion.sense()
            if k >= 0 and k % every == 0:
                layers.keep(k // every, motion.sample, motion.output)
            motion.step()
        time = np.arange(count, dtype=np.float64) * (every * STEP)
        found = truth(time, layers, self.vehicle, self.properties, self.layout)
        return Drive(vehicle=self.vehicle, properties=self.properties, time=time, truth=found, name=name or course.name)


class Motion:
    """One drive in progress."""

    def __init__(self, plant: Plant, course: Course) -> None:
        mujoco = plant._mujoco
        self.plant, self.model = plant, plant.model
        self.data = mujoco.MjData(plant.model)
        self._before, self._after = mujoco.mj_step1, mujoco.mj_step2
        self.driver = Driver(course, plant.vehicle)
        self.start_speed = float(course.speed[0])
        scan, n = plant.forces, len(plant.layout.steered)
        self.carry = np.zeros(scan.n_carry)
        self.sample = np.zeros(scan.n_sample)
        self.output = np.zeros(scan.n_output)
        self._run = scan.single
        self._pointers = [a.ctypes.data for a in (self.carry, self.sample, plant.constants, self.output)]
        self._sensed = self.sample[: plant.layout.sensed]
        self._steer = self.sample[plant.layout.sensed :]
        self._wrench = self.output[: 6 * plant.layout.rows].reshape(-1, 6)
        self._steer_step = np.zeros(n)
        self._spin = [self._address(f"{beam.name}.{side}") for beam in plant.beams for side in SIDES]
        driven = np.array([float(beam.driven) for beam in plant.beams for _ in SIDES])
        self._drive = driven / max(driven.sum(), 1.0)
        loads = np.array([beam.load for beam in plant.beams for _ in SIDES])
        self._brake = loads / loads.sum()
        self._mass = sum(unit.mass for unit in plant.vehicle.units)
        p, speed = plant.properties, self.start_speed
        resistance = p.rolling_resistance * self._mass * GRAVITY + tyres.AIR / 2 * p.drag_area * speed**2
        self._reached = resistance  # integral of the speed controller, N
        self.data.qvel[0] = self.start_speed
        self.data.qvel[self._spin] = self.start_speed / plant.properties.wheel_radius
        self._tilt = math.sin(plant.properties.bank), math.cos(plant.properties.bank)

    def _address(self, joint: str) -> int:
        mujoco = self.plant._mujoco
        number = mujoco.mj_name2id(self.model, mujoco.mjtObj.mjOBJ_JOINT, joint)
        return int(self.model.jnt_dofadr[number])

    def command(self, time: float, *, driving: bool) -> None:
        """Ask the driver, set steer rate and wheel torques until the next command, lean the road."""
        pose = self.pose()
        wanted = self.driver(time, pose) if driving else None
        steer, speed = (wanted.steer, wanted.speed) if wanted else (0.0, self.start_speed)
        self._steer_step[0] = (steer - self._steer[0]) / CONTROL
        error = speed - pose.speed
        force = self._mass * 0.8 * error + self._reached
        force = min(max(force, -0.5 * GRAVITY * self._mass), 0.15 * GRAVITY * self._mass)
        self._reached += self._mass * 0.3 * min(max(error, -0.5), 0.5) * CONTROL * STEP
        share = self._drive if force > 0 else self._brake
        self.data.qfrc_applied[self._spin] = force * self.plant.properties.wheel_radius * share
        if self._tilt[0]:
            down, side = -GRAVITY * self._tilt[1], -GRAVITY * self._tilt[0]
            c, s = math.cos(pose.heading), math.sin(pose.heading)
            self.model.opt.gravity[:] = -s * side, c * side, down

    def pose(self) -> Pose:
        """Of the first unit."""
        x, y = self.data.qpos[:2]
        w, i, j, k = self.data.qpos[3:7]
        heading = math.atan2(2 * (w * k + i * j), 1 - 2 * (j * j + k * k))
        c, s = math.cos(heading), math.sin(heading)
        u, v = self.data.qvel[:2]
        cog = self.plant.vehicle.units[0].cog
        return Pose(x + c * cog, y + s * cog, heading, c * u + s * v, float(self.data.qvel[5]))

    def sense(self) -> None:
        """What MuJoCo senses now, and the tyres' forces."""
        self._before(self.model, self.data)
        self._sensed[:] = self.data.sensordata
        self._run(1, 1, *self._pointers)

    def step(self) -> None:
        """One step on."""
        self.data.xfrc_applied[:] = self._wrench
        self._after(self.model, self.data)
        self._steer += self._steer_step
