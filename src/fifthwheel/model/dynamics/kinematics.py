"""Motion of the units and axles of a chain, for both laws: with small angles (`SMALL`), or with rotations (`LARGE`).

Each unit i has the velocity (u_i, v_i) on the roll axis under its CoG, in its own axes, the yaw rate r_i and the roll
rate p_i. Roll angles are small. Behind a coupling with the articulation angle g,

    u_i = u_h cos g + v_h sin g,        v_i = -u_h sin g + v_h cos g - (x_c - x_cog) r_i + (h_c - h_r) p_i,

where (u_h, v_h) is the velocity of the coupling in the axes of the unit in front: u, and v + (x_c - x_cog) r -
(h_c - h_r) p. For small angles, this is equation (A7) of Cheng and Cebon (2011) before it is differentiated.

In all functions p has the parameters by path, numbers or symbols; a vehicle gives units, axles and couplings, and its
numbers are not used.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import casadi as ca

from fifthwheel.model.dynamics.symbolic import Expressions
from fifthwheel.truck import AxleGroup, Unit, Vehicle

BANK = "bank.road"
"""Name of the state that is the bank of the road, rad, positive with the left edge higher."""


class Angles(NamedTuple):
    """How angles act on velocities."""

    rotated: Callable[[ca.SX, ca.SX, ca.SX], tuple[ca.SX, ca.SX]]
    """A velocity (u, v) in axes that are turned by an angle."""
    direction: Callable[[ca.SX, ca.SX], ca.SX]
    """The angle of a velocity (u, v) from the x axis."""


def _rotated(u: ca.SX, v: ca.SX, angle: ca.SX) -> tuple[ca.SX, ca.SX]:
    cos, sin = ca.cos(angle), ca.sin(angle)
    return u * cos + v * sin, v * cos - u * sin


LARGE = Angles(rotated=_rotated, direction=lambda u, v: ca.atan(v / u))
SMALL = Angles(rotated=lambda u, v, angle: (u, v - u * angle), direction=lambda u, v: v / u)
"""The linearisation of `LARGE`."""


@dataclass(frozen=True, kw_only=True)
class Motion:
    """Motion of every unit as expressions of the state; tuples have one entry for each unit."""

    u: tuple[ca.SX, ...]  # m/s, forward speed
    v: tuple[ca.SX, ...]  # m/s, lateral velocity on the roll axis under the CoG
    r: tuple[ca.SX, ...]  # rad/s, yaw rate
    heading: tuple[ca.SX, ...]  # rad, psi_i - psi_1
    articulation: tuple[ca.SX, ...]  # rad, psi_i - psi_(i-1), zero of the first unit
    roll: tuple[ca.SX, ...]  # rad, zeros without roll
    roll_rate: tuple[ca.SX, ...]  # rad/s, zeros without roll
    velocity: tuple[ca.SX, ...]  # (v, r[, p]) of each unit
    at_coupling: tuple[ca.SX, ...]  # m/s, lateral velocity of the coupling behind each unit but the last, in its axes
    lagged_slip: Expressions  # rad, by the path of each group with a relaxation length
    bank: ca.SX  # rad, of the road; zero if it is not a state
    angles: Angles

    @classmethod
    def of(
        cls, p: Expressions, vehicle: Vehicle, states: Expressions, speed: ca.SX, angles: Angles = SMALL
    ) -> "Motion":
        """The motion, coupling by coupling from the front, where the states have these values, by name."""

        def of_units(quantity: str) -> tuple[ca.SX, ...]:
            return tuple(states.get(f"{quantity}.{name}", ca.SX(0)) for name in names)

        names, groups = [unit.name for unit in vehicle.units], vehicle.group_paths()
        r, articulation, roll, roll_rate = map(of_units, ("yaw_rate", "articulation", "roll", "roll_rate"))
        u, v, heading = [speed], [states[f"lateral_velocity.{names[0]}"]], [ca.SX(0)]
        at_coupling = []
        for i in range(len(vehicle.couplings)):
            arms = coupling_arms(p, vehicle, i)
            at_coupling.append(v[i] + arms.ahead * r[i] - arms.above_front * roll_rate[i])
            forward, lateral = angles.rotated(u[i], at_coupling[i], articulation[i + 1])
            u.append(forward)
            v.append(lateral - arms.behind * r[i + 1] + arms.above_rear * roll_rate[i + 1])
            heading.append(heading[i] + articulation[i + 1])
        velocities = v, r, *([roll_rate] if f"roll_rate.{names[0]}" in states else [])
        return cls(
            u=tuple(u),
            v=tuple(v),
            r=r,
            heading=tuple(heading),
            articulation=articulation,
            roll=roll,
            roll_rate=roll_rate,
            velocity=tuple(map(ca.vertcat, *velocities)),
            at_coupling=tuple(at_coupling),
            lagged_slip={path: states[name] for path in groups if (name := f"slip_angle.{path}") in states},
            bank=states.get(BANK, ca.SX(0)),
            angles=angles,
        )


class CouplingArms(NamedTuple):
    """Place of a coupling from the points under the CoG on the roll axes of both units, m."""

    ahead: ca.SX  # of the unit in front, along x
    behind: ca.SX  # of the unit behind, along x
    above_front: ca.SX  # the roll axis of the unit in front
    above_rear: ca.SX  # the roll axis of the unit behind


def coupling_arms(p: Expressions, vehicle: Vehicle, i: int) -> CouplingArms:
    """The arms of the coupling between units i and i + 1."""
    coupling, front, rear = vehicle.couplings[i].name, vehicle.units[i].name, vehicle.units[i + 1].name
    return CouplingArms(
        ahead=p[f"{coupling}.leading_position"] - p[f"{front}.cog"],
        behind=p[f"{coupling}.trailing_position"] - p[f"{rear}.cog"],
        above_front=p[f"{coupling}.height"] - p[f"{front}.roll_axis_height"],
        above_rear=p[f"{coupling}.height"] - p[f"{rear}.roll_axis_height"],
    )


def angle_rates(vehicle: Vehicle, motion: Motion) -> dict[str, ca.SX]:
    """Derivatives of articulation angles and roll angles by the names of the states."""
    names = [unit.name for unit in vehicle.units]
    articulations = {f"articulation.{name}": motion.r[i] - motion.r[i - 1] for i, name in enumerate(names) if i}
    return articulations | {f"roll.{name}": rate for name, rate in zip(names, motion.roll_rate, strict=True)}


def beside_roll_axes(p: Expressions, vehicle: Vehicle, motion: Motion) -> list[ca.SX]:
    """The part (2,) of the velocity (u_i, v_i) of each unit, m/s, that is due to couplings beside the roll axes.

    `Motion` does not have it: it is of second order.
    """
    parts = [ca.SX(2, 1)]
    for i in range(len(vehicle.couplings)):
        arms = coupling_arms(p, vehicle, i)
        # the rolled unit in front adds (h_c - h_r) phi r to u of the coupling, the one behind subtracts it
        u, v = ca.vertsplit(parts[i] + ca.vertcat(arms.above_front * motion.roll[i] * motion.r[i], 0))
        forward, lateral = motion.angles.rotated(u, v, motion.articulation[i + 1])
        parts.append(ca.vertcat(forward - arms.above_rear * motion.roll[i + 1] * motion.r[i + 1], lateral))
    return parts


class AxleMotion(NamedTuple):
    """Place, wheels and motion of an axle."""

    arm: ca.SX  # m, of the axle ahead of the CoG of its unit
    steer: ca.SX  # rad, angle of its wheels from the heading of its unit; the small one of castor wheels is left out
    slip: ca.SX  # rad, angle of its wheels from the direction in which it moves


class GroupMotion(NamedTuple):
    """Axles on the road of a group, and its slip angle."""

    axles: list[AxleMotion]
    mean: ca.SX  # rad, mean slip angle of the axles
    slip: ca.SX  # rad, the lagged slip angle if the group has a relaxation length, else the mean


def group_motion(
    p: Expressions, unit: Unit, group: AxleGroup, motion: Motion, i: int, steer: Expressions
) -> GroupMotion:
    """The axles of a group of unit i, with the angles of steered wheels, rad, by the names of their signals.

    Other wheels turn by a fraction of the articulation angle in front of their unit; castor wheels turn by a fraction
    of the slip angle of their axle.
    """
    axles = []
    for axle in group.on_road:
        path = f"{unit.name}.{axle.name}"
        arm = p[f"{path}.position"] - p[f"{unit.name}.cog"]
        angle, castor = steer.get(f"steer.{path}"), ca.SX(0)
        if angle is None:
            angle = p.get(f"{path}.command_steering", ca.SX(0)) * motion.articulation[i]
            castor = p.get(f"{path}.self_steering", castor)
        direction = motion.angles.direction(motion.u[i], motion.v[i] + arm * motion.r[i])
        axles.append(AxleMotion(arm, angle, (1 - castor) * (angle - direction)))
    mean = sum((axle.slip for axle in axles), ca.SX(0)) / len(axles)
    return GroupMotion(axles, mean, motion.lagged_slip.get(unit.group_path(group), mean))


def slip_angles(p: Expressions, vehicle: Vehicle, motion: Motion, steer: Expressions) -> dict[str, ca.SX]:
    """Slip angle of each axle group by its path, rad, as in `GroupMotion`."""
    return {
        unit.group_path(group): group_motion(p, unit, group, motion, i, steer).slip
        for i, unit in enumerate(vehicle.units)
        for group in unit.axle_groups
    }
