"""All forces from outside, for one step: tyres, drag, rolling resistance and lash, compiled to machine code.

What MuJoCo senses of every axle gives the speed of each contact with the road; transient slip follows it over the
relaxation length; the Magic Formula gives the forces, which go to the wheel's body as a force and a torque about its
centre.
"""

from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from fifthwheel.native import Scan
from fifthwheel.plant.body import Body
from fifthwheel.plant.properties import Properties
from fifthwheel.plant.tree import SIDES
from fifthwheel.plant.tyre import MagicFormula

Array = NDArray[np.float64]

AIR = 1.2
"""Density, kg/m^3."""
WHEEL = ("slip", "longitudinal_force", "lateral_force", "vertical_force")
"""What is told of each wheel: tangent of the slip angle, N, N, N."""
PER_BODY, PER_BEAM = 18, 18  # numbers sensed of a body (frame, accelerometer) and of an axle (frame, roll, two spins)
CONSTANTS = (
    "roll_centre",
    "tyre_spring",
    "tyres",
    "stiffness",
    "roll_steer",
    "lash",
    "roll_spring",
    "free_radius",
)
"""Of every axle, in the order of the constants."""
COMMON = (
    "step",
    "half_track",
    "radius",
    "tyre_damping",
    "rolling_resistance",
    "drag_area",
    "relaxation",
    "aligning",
    "friction",
    "compliance",
    "lag",
)
"""Of the whole truck, behind the axles'."""


@dataclass(frozen=True, kw_only=True)
class Layout:
    """Where things are in what the compiled step reads and writes; rows are numbers of MuJoCo's bodies."""

    bodies: tuple[int, ...]  # row of each unit's first body
    axles: tuple[int, ...]  # row of each axle
    carriers: tuple[int, ...]  # row of the body that carries it
    wheels: tuple[int, ...]  # rows of the wheels, left and right in turn
    rows: int
    steered: tuple[int, ...]  # which axles the steer angles belong to

    @property
    def sensed(self) -> int:
        """Numbers that MuJoCo senses."""
        return PER_BODY * len(self.bodies) + PER_BEAM * len(self.axles)


def constants(bodies: tuple[Body, ...], properties: Properties, step: float) -> Array:
    """The numbers behind `CONSTANTS` and `COMMON`."""
    numbers: list[float] = []
    for beam in (beam for body in bodies for beam in body.beams):
        own = properties.tyre.cornering_stiffness(beam.load / 2 / beam.tyres) * 2 * beam.tyres
        numbers += [beam.roll_centre, beam.tyre_spring, beam.tyres]
        numbers += [properties.stiffness * beam.cornering_stiffness / own, properties.roll_steer.get(beam.group, 0.0)]
        numbers += [properties.lash.get(beam.group, 0.0), beam.roll_spring]
        numbers += [properties.wheel_radius + beam.load / 2 / beam.tyre_spring]  # loaded, it is wheel_radius
    p = properties
    numbers += [step, p.half_track, p.wheel_radius, p.tyre_damping, p.rolling_resistance, p.drag_area]
    numbers += [p.relaxation, p.aligning, p.friction, p.steering_compliance, p.steering_lag]
    return np.array(numbers)


def forces(layout: Layout, bodies: tuple[Body, ...], properties: Properties) -> Scan:
    """The compiled step.

    carry = [transient slip and longitudinal slip of every wheel, steer angle and aligning moment of every steered
    axle]; sample = [sensed, steer angles]; constant = constants(); output = [force and torque on every body, then WHEEL
    for every wheel].
    """
    beams = [beam for body in bodies for beam in body.beams]
    law: MagicFormula = properties.tyre
    n_wheels, n_steered = 2 * len(beams), len(layout.steered)
    carry = ca.SX.sym("carry", 2 * n_wheels + 2 * n_steered)
    sample = ca.SX.sym("sample", layout.sensed + n_steered)
    constant = ca.SX.sym("constant", len(CONSTANTS) * len(beams) + len(COMMON))
    common = {name: constant[len(CONSTANTS) * len(beams) + i] for i, name in enumerate(COMMON)}
    wrench = [ca.SX(6, 1) for _ in range(layout.rows)]
    later, told = [ca.SX(0)] * carry.numel(), [ca.SX(0)] * (len(WHEEL) * n_wheels)

    velocity = sample[9:12]
    drag = -AIR / 2 * common["drag_area"] * ca.norm_2(velocity + 1e-9) * velocity
    wrench[layout.bodies[0]][:3] += drag

    for i in range(len(beams)):
        own = {name: constant[len(CONSTANTS) * i + k] for k, name in enumerate(CONSTANTS)}
        start = PER_BODY * len(layout.bodies) + PER_BEAM * i
        sensed = sample[start : start + PER_BEAM]
        place, ahead, across, speed, turning = (sensed[3 * k : 3 * k + 3] for k in range(5))
        rolled, spins = sensed[15], sensed[16:18]
        upward = ca.cross(ahead, across)
        steer = own["roll_steer"] * rolled
        if i in layout.steered:
            k = layout.steered.index(i)
            here = 2 * n_wheels + 2 * k
            command = sample[layout.sensed + k] + (common["compliance"] * carry[here + 1] if k == 0 else 0)
            reached = 1 - ca.exp(-common["step"] / ca.fmax(common["lag"], 1e-9))
            later[here] = carry[here] + reached * (command - carry[here])
            steer += later[here]
        flat = ca.vertcat(ahead[0], ahead[1]) / ca.sqrt(ahead[0] ** 2 + ahead[1] ** 2)
        forward = ca.vertcat(
            flat[0] * ca.cos(steer) - flat[1] * ca.sin(steer), flat[1] * ca.cos(steer) + flat[0] * ca.sin(steer)
        )
        leftward = ca.vertcat(-forward[1], forward[0])
        play = own["roll_spring"] * ca.fmax(-own["lash"], ca.fmin(own["lash"], rolled)) * ahead
        wrench[layout.axles[i]][3:] += play
        wrench[layout.carriers[i]][3:] -= play
        aligning = ca.SX(0)
        for j, sign in enumerate(SIDES.values()):
            wheel = 2 * i + j
            centre = place + sign * common["half_track"] * across + (common["radius"] - own["roll_centre"]) * upward
            arm = ca.vertcat(0, 0, -centre[2])  # from the wheel's centre down to the road
            at_centre = speed + ca.cross(turning, centre - place)
            contact = speed + ca.cross(turning, centre + arm - place)
            load = (
                own["tyre_spring"] * (own["free_radius"] - centre[2])
                - own["tyres"] * common["tyre_damping"] * at_centre[2]
            )
            load = ca.fmax(load, 1.0)
            each = load / own["tyres"]
            v_x = ca.fmax(ca.dot(contact[:2], forward), 0.5)
            v_y = ca.dot(contact[:2], leftward)
            spin = spins[j] + ca.dot(turning, across)
            slip = settle(
                carry[2 * wheel],
                -v_y / v_x,
                v_x * common["step"] / (common["relaxation"] * law.relaxation_length(each)),
            )
            kappa = settle(
                carry[2 * wheel + 1],
                (spin * common["radius"] - v_x) / v_x,
                v_x * common["step"] / (common["relaxation"] * law.longitudinal_relaxation_length(each)),
            )
            later[2 * wheel], later[2 * wheel + 1] = slip, kappa
            along = own["tyres"] * law.longitudinal_force(kappa, each, lateral=slip, grip=common["friction"])
            side = own["tyres"] * law.side_force(
                slip, each, longitudinal=kappa, stiffness=own["stiffness"], grip=common["friction"]
            )
            twist = -common["aligning"] * law.pneumatic_trail(slip, each) * side
            aligning += twist
            force = ca.vertcat(along * forward + side * leftward, load)
            rolling = -common["rolling_resistance"] * load * common["radius"] * across
            wrench[layout.wheels[wheel]] += ca.vertcat(force, ca.cross(arm, force) + rolling + ca.vertcat(0, 0, twist))
            told[4 * wheel : 4 * wheel + 4] = [slip, along, side, load]
        if i in layout.steered:
            later[2 * n_wheels + 2 * layout.steered.index(i) + 1] = aligning
    output = ca.vertcat(*wrench, *told)
    step = ca.Function(
        "tyres",
        [carry, sample, constant],
        [ca.densify(ca.vertcat(*later)), ca.densify(output)],
        {"cse": True},
    )
    return Scan(step)


def settle(slip: ca.SX, steady: ca.SX, passed: ca.SX) -> ca.SX:
    """Transient slip after a step in which so many relaxation lengths have passed under the wheel."""
    return steady + (slip - steady) * ca.exp(-passed)
