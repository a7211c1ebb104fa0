"""Forces of tyres, drag, rolling resistance and suspension lash in one step, compiled to machine code.

The motion of every axle, as MuJoCo senses it, gives the velocity of each contact patch; a rough road moves it up and
down, and has no other effect. The transient slip follows the steady slip over the relaxation length. The Magic Formula
gives the forces, which act on the body of the wheel as a force and a torque about its centre. Castor wheels turn at
once towards the direction of motion of the middle of their axle; the heading of the unit against that in front turns
the wheels of a command-steered axle.
"""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from fifthwheel.base.native import Scan
from fifthwheel.base.types import Array
from fifthwheel.model.plant.bodies import SIDES, BeamAxle, SprungBody
from fifthwheel.model.plant.properties import MagicFormula, Properties
from fifthwheel.truck.driveline import AIR_DENSITY

WHEEL_OUTPUTS = ("slip", "longitudinal_force", "lateral_force", "vertical_force", "speed")
"""Outputs of each wheel: tangent of the slip angle, N, N, N, m/s. The speed is that of a wheel speed sensor: the spin
times the nominal radius, of a wheel with the rolling radius of its tyre under the present load."""
BODY_SENSORS = 18
"""Sensed numbers of a body: its frame and the accelerometer."""
AXLE_SENSORS = 18
"""Sensed numbers of an axle: its frame, its roll angle, the spin of both wheels."""


@dataclass(frozen=True, kw_only=True)
class StepLayout:
    """Indices into the inputs and outputs of the compiled step; rows are numbers of MuJoCo bodies."""

    bodies: tuple[int, ...]
    """Row of the first body of each unit."""
    axles: tuple[int, ...]
    """Row of each axle."""
    carriers: tuple[int, ...]
    """Row of the body that carries each axle."""
    wheels: tuple[int, ...]
    """Rows of the wheels: left and right of each axle."""
    rows: int
    """Number of MuJoCo bodies."""
    steered: tuple[int, ...]
    """Indices of the axles that the steer angles belong to."""

    @property
    def sensed(self) -> int:
        """Number of sensed values."""
        return BODY_SENSORS * len(self.bodies) + AXLE_SENSORS * len(self.axles)

    @property
    def wheel_outputs(self) -> int:
        """Number of outputs of all wheels."""
        return len(WHEEL_OUTPUTS) * len(self.wheels)


def constants(bodies: tuple[SprungBody, ...], properties: Properties, time_step: float) -> Array:
    """Values of `_of_axle` of every axle, then of `_of_truck`."""
    axles = [value for body in bodies for axle in body.axles for value in _of_axle(axle, properties).values()]
    return np.array([*axles, *_of_truck(properties, time_step).values()])


def _of_axle(axle: BeamAxle, p: Properties) -> dict[str, float]:
    """Constants of an axle by name."""
    tyre_load, trail = axle.load / 2 / axle.tyres_per_side, axle.pneumatic_trail
    unscaled_stiffness = p.tyre.cornering_stiffness(tyre_load) * 2 * axle.tyres_per_side
    return {
        "roll_centre": axle.roll_centre_height,
        "tyre_stiffness": axle.tyre_stiffness,
        "tyres_per_side": axle.tyres_per_side,
        "stiffness": p.stiffness * axle.cornering_stiffness / unscaled_stiffness,
        "aligning": p.aligning if trail is None else trail / float(p.tyre.pneumatic_trail(0.0, tyre_load)),
        "roll_steer": p.roll_steer.get(axle.group, 0.0),
        "lash": p.lash.get(axle.group, 0.0),
        "self_steering": axle.self_steering,
        "command_steering": axle.command_steering,
        "roll_stiffness": axle.roll_stiffness,
        "rolling_radius": float(p.tyre.rolling_radius(tyre_load)),
        "free_radius": p.wheel_radius + axle.load / 2 / axle.tyre_stiffness,  # wheel_radius under the static load
    }


def _of_truck(p: Properties, time_step: float) -> dict[str, float]:
    """Constants of the whole truck by name."""
    return {
        "time_step": time_step,
        "half_track": p.half_track,
        "radius": p.wheel_radius,
        "tyre_damping": p.tyre_damping,
        "rolling_resistance": p.rolling_resistance,
        "drag_area": p.drag_area,
        "relaxation": p.relaxation,
        "friction": p.friction,
        "compliance": p.steering_compliance,
        "lag": p.steering_lag,
    }


def forces(layout: StepLayout, bodies: tuple[SprungBody, ...], properties: Properties) -> Scan:
    """The compiled step.

    carry = [transient slip and longitudinal slip of every wheel, steer angle and aligning moment of every steered
    axle]; sample = [sensed values, steer angles, height of the road under every wheel, its rate]; constant =
    constants(); output = [force and torque on every body, then `WHEEL_OUTPUTS` of every wheel].
    """
    axles = [axle for body in bodies for axle in body.axles]
    units = [i for i, body in enumerate(bodies) for _ in body.axles]
    tyre: MagicFormula = properties.tyre
    n_wheels, n_steered = 2 * len(axles), len(layout.steered)
    carry = ca.SX.sym("carry", 2 * n_wheels + 2 * n_steered)
    sample = ca.SX.sym("sample", layout.sensed + n_steered + 2 * n_wheels)
    road_height, road_rate = ca.vertsplit(sample[layout.sensed + n_steered :], n_wheels)
    of_axle, of_truck = _of_axle(axles[0], properties), _of_truck(properties, 0.0)
    constant = ca.SX.sym("constant", len(of_axle) * len(axles) + len(of_truck))
    common = {name: constant[len(of_axle) * len(axles) + i] for i, name in enumerate(of_truck)}
    wrench = [ca.SX(6, 1) for _ in range(layout.rows)]
    next_carry, wheel_outputs = [ca.SX(0)] * carry.numel(), [ca.SX(0)] * (len(WHEEL_OUTPUTS) * n_wheels)

    velocity = sample[9:12]
    drag = -AIR_DENSITY / 2 * common["drag_area"] * ca.norm_2(velocity + 1e-9) * velocity
    wrench[layout.bodies[0]][:3] += drag

    for i in range(len(axles)):
        axle = {name: constant[len(of_axle) * i + k] for k, name in enumerate(of_axle)}
        start = BODY_SENSORS * len(layout.bodies) + AXLE_SENSORS * i
        sensed = sample[start : start + AXLE_SENSORS]
        position, x_axis, y_axis, velocity, angular_velocity = (sensed[3 * k : 3 * k + 3] for k in range(5))
        roll, spins = sensed[15], sensed[16:18]
        z_axis = ca.cross(x_axis, y_axis)
        steer = axle["roll_steer"] * roll
        if i in layout.steered:
            k = layout.steered.index(i)
            row = 2 * n_wheels + 2 * k
            command = sample[layout.sensed + k] + (common["compliance"] * carry[row + 1] if k == 0 else 0)
            fraction = 1 - ca.exp(-common["time_step"] / ca.fmax(common["lag"], 1e-9))
            next_carry[row] = carry[row] + fraction * (command - carry[row])
            steer += next_carry[row]
        if axles[i].self_steering:
            ground = velocity + ca.cross(angular_velocity, -position[2] * ca.vertcat(0, 0, 1))
            steer += axle["self_steering"] * _angle(x_axis, ground)
        if axles[i].command_steering:
            in_front, own = (sample[BODY_SENSORS * k + 3 : BODY_SENSORS * k + 6] for k in (units[i] - 1, units[i]))
            steer += axle["command_steering"] * _angle(in_front, own)
        heading = ca.vertcat(x_axis[0], x_axis[1]) / ca.sqrt(x_axis[0] ** 2 + x_axis[1] ** 2)
        forward = ca.vertcat(
            heading[0] * ca.cos(steer) - heading[1] * ca.sin(steer),
            heading[1] * ca.cos(steer) + heading[0] * ca.sin(steer),
        )
        leftward = ca.vertcat(-forward[1], forward[0])
        # within the lash, this torque cancels the roll spring of the suspension
        lash_torque = axle["roll_stiffness"] * ca.fmax(-axle["lash"], ca.fmin(axle["lash"], roll)) * x_axis
        wrench[layout.axles[i]][3:] += lash_torque
        wrench[layout.carriers[i]][3:] -= lash_torque
        aligning_moment = ca.SX(0)
        for j, sign in enumerate(SIDES.values()):
            wheel = 2 * i + j
            centre = position + sign * common["half_track"] * y_axis + (common["radius"] - axle["roll_centre"]) * z_axis
            height = centre[2] - road_height[wheel]
            arm = ca.vertcat(0, 0, -height)  # from the wheel centre down to the road
            centre_velocity = velocity + ca.cross(angular_velocity, centre - position)
            contact_velocity = velocity + ca.cross(angular_velocity, centre + arm - position)
            load = axle["tyre_stiffness"] * (axle["free_radius"] - height) - axle["tyres_per_side"] * common[
                "tyre_damping"
            ] * (centre_velocity[2] - road_rate[wheel])
            load = ca.fmax(load, 1.0)
            tyre_load = load / axle["tyres_per_side"]
            v_x = ca.fmax(ca.dot(contact_velocity[:2], forward), 0.5)
            v_y = ca.dot(contact_velocity[:2], leftward)
            spin = spins[j] + ca.dot(angular_velocity, y_axis)
            slip = transient_slip(
                carry[2 * wheel],
                -v_y / v_x,
                v_x * common["time_step"] / (common["relaxation"] * tyre.relaxation_length(tyre_load)),
            )
            kappa = transient_slip(
                carry[2 * wheel + 1],
                (spin * common["radius"] - v_x) / v_x,
                v_x * common["time_step"] / (common["relaxation"] * tyre.longitudinal_relaxation_length(tyre_load)),
            )
            next_carry[2 * wheel], next_carry[2 * wheel + 1] = slip, kappa
            longitudinal_force = axle["tyres_per_side"] * tyre.longitudinal_force(
                kappa, tyre_load, lateral=slip, friction=common["friction"]
            )
            side_force = axle["tyres_per_side"] * tyre.side_force(
                slip, tyre_load, longitudinal=kappa, stiffness=axle["stiffness"], friction=common["friction"]
            )
            moment = -axle["aligning"] * tyre.pneumatic_trail(slip, tyre_load) * side_force
            aligning_moment += moment
            force = ca.vertcat(longitudinal_force * forward + side_force * leftward, load)
            rolling = -common["rolling_resistance"] * load * common["radius"] * y_axis
            torque = ca.cross(arm, force) + rolling + ca.vertcat(0, 0, moment)
            wrench[layout.wheels[wheel]] += ca.vertcat(force, torque)
            speed = spins[j] * common["radius"] * axle["rolling_radius"] / tyre.rolling_radius(tyre_load)
            n = len(WHEEL_OUTPUTS)
            wheel_outputs[n * wheel : n * wheel + n] = [slip, longitudinal_force, side_force, load, speed]
        if i in layout.steered:
            next_carry[2 * n_wheels + 2 * layout.steered.index(i) + 1] = aligning_moment
    output = ca.vertcat(*wrench, *wheel_outputs)
    step = ca.Function(
        "tyres",
        [carry, sample, constant],
        [ca.densify(ca.vertcat(*next_carry)), ca.densify(output)],
        {"cse": True},
    )
    return Scan(step)


def _angle(a: ca.SX, b: ca.SX) -> ca.SX:
    """Angle from the vector a to the vector b on the ground, rad, positive to the left; below a right angle."""
    return ca.atan((a[0] * b[1] - a[1] * b[0]) / ca.fmax(a[0] * b[0] + a[1] * b[1], 1e-3))


def transient_slip(slip: ca.SX, steady: ca.SX, relaxation_lengths: ca.SX) -> ca.SX:
    """Transient slip after a step in which the wheel travels so many relaxation lengths."""
    return steady + (slip - steady) * ca.exp(-relaxation_lengths)
