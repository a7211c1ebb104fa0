"""Motion of the units and axles of a chain, and inertia, tyre forces and roll moment of one unit.

Motion, for both laws: with small angles (`SMALL`), or with rotations (`LARGE`). Each unit i has the velocity (u_i, v_i)
on the roll axis under its CoG, in its own axes (x forward, y left, z up; ISO 8855), the yaw rate r_i and the roll rate
p_i. Roll angles are small. Behind a coupling with the articulation angle g,

    u_i = u_h cos g + v_h sin g,        v_i = -u_h sin g + v_h cos g - (x_c - x_cog) r_i + (h_c - h_r) p_i,

where (u_h, v_h) is the velocity of the coupling in the axes of the unit in front: u, and v + (x_c - x_cog) r -
(h_c - h_r) p. For small angles, this is equation (A7) of Cheng and Cebon (2011) before it is differentiated.

Inertia and forces on a unit are equations (A1)-(A6) without the coupling force, which the chain eliminates. Its
velocity is (v, r, p): lateral velocity on the roll axis under the CoG, yaw rate, roll rate. Two misprints of the
article are corrected: (A3) and (A6) count m_s h^2 phi'' twice, and (A2) has I_1szz in place of I_1sxz (see
docs/article.md).

In all functions p has the parameters by path, numbers or symbols; a vehicle, a unit or an axle group gives names and
structure, and its numbers are not used.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import casadi as ca

from fifthwheel.base.units import STANDARD_GRAVITY as GRAVITY
from fifthwheel.model.dynamics.symbolic import Expressions
from fifthwheel.model.dynamics.tyres import Contact, axle_forces, linear
from fifthwheel.truck import AxleGroup, Unit, Vehicle, laden

BANK = "bank.road"
"""Name of the state that is the bank of the road, rad, positive with the left edge higher."""
AXLE_COG_HEIGHT = 0.5
"""Of an axle with its wheels above the ground, m: the loaded radius of a tyre 315/80 R 22.5."""


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


class RollBody(NamedTuple):
    """The sprung body of a unit about its roll axis."""

    moment: ca.SX  # m_s h, kg m, h = height of the sprung CoG above the roll axis
    inertia: ca.SX  # I_sx'x', kg m^2, about the roll axis
    product: ca.SX  # I_sxz, kg m^2
    stiffness: ca.SX  # K*, N m/rad, suspensions and tyres in series
    damping: ca.SX  # C*, N m s/rad, dampers and tyres in series


def group_roll(p: Expressions, path: str) -> tuple[ca.SX, ca.SX]:
    """K*, N m/rad, and C*, N m s/rad, of suspension and tyres of an axle group in series; see `roll_body`."""
    suspension, tyres = p[f"{path}.roll_stiffness"], p[f"{path}.tyre_roll_stiffness"]
    fraction = tyres / (suspension + tyres)
    return suspension * tyres / (suspension + tyres), p[f"{path}.roll_damping"] * fraction * fraction


def relaxation_length(p: Expressions, unit: Unit, path: str) -> ca.SX:
    """Distance over which the side force of an axle group builds up, m: l + C h^2 / (K + K_t), h = h_r (1 + K / K_t).

    l is the relaxation length of the tyres, their cornering stiffness over their lateral stiffness. A side force also
    moves the road contact sideways under the body, because the axles roll on their tyres about the road and the body
    about the roll centre of the suspension, at the height h. This compliance is in series with that of the tyres.
    """
    suspension, tyres = p[f"{path}.roll_stiffness"], p[f"{path}.tyre_roll_stiffness"]
    height = p[f"{unit.name}.roll_axis_height"] * (1 + suspension / tyres)
    compliance = height * height / (suspension + tyres)
    return p[f"{path}.relaxation_length"] + p[f"{path}.cornering_stiffness"] * compliance


def suspension_moment(p: Expressions, path: str, roll: ca.SX, roll_rate: ca.SX) -> ca.SX:
    """K* phi + C* phi', the moment of suspension and tyres of an axle group, N m, at a roll of the unit, rad, rad/s."""
    stiffness, damping = group_roll(p, path)
    return stiffness * roll + damping * roll_rate


def load_transfer_moment(
    p: Expressions, path: str, roll: ca.SX, roll_rate: ca.SX, side_force: ca.SX, height: ca.SX
) -> ca.SX:
    """Half the track times the load of the right wheels of an axle group less that of the left ones, N m.

    T = K* phi + C* phi' + h F: the moment of suspension and tyres, and that of the side force F, N, of the group with
    the height h of the masses that it accelerates, m.
    """
    return suspension_moment(p, path, roll, roll_rate) + height * side_force


def side_force_height(p: Expressions, unit: Unit, group: AxleGroup, load: ca.SX) -> ca.SX:
    """Height h = h_r (1 - q) + h_u q of the masses that the side force of an axle group accelerates, m.

    The axles, a fraction q of the load of the group, are at their own height h_u; the sprung body acts at the roll
    axis.

    All axles of a unit have the same mass; the load is the static one, N.
    """
    axles: ca.SX = (p[f"{unit.name}.mass"] - laden(p, unit).mass) * len(group.on_road) / len(unit.axles)
    fraction: ca.SX = axles * GRAVITY / load
    return p[f"{unit.name}.roll_axis_height"] * (1 - fraction) + AXLE_COG_HEIGHT * fraction


def roll_body(p: Expressions, unit: Unit) -> RollBody:
    """m_s h, I_sx'x', I_sxz, K* and C* of a unit, laden by equations (8) and (9) of the article.

    Suspension and tyres are in series. The damper therefore sees the fraction K_t / (K + K_t) of the roll angle, and
    its moment acts on the body with the same fraction: C* = C (K_t / (K + K_t))^2, to first order in frequency. The
    article reduces the stiffness accordingly, but not the damping (see docs/article.md).
    """
    body = laden(p, unit)
    stiffnesses, dampings = zip(*[group_roll(p, unit.group_path(group)) for group in unit.axle_groups], strict=True)
    return RollBody(
        moment=body.mass * (body.cog_height - p[f"{unit.name}.roll_axis_height"]),
        inertia=body.roll_inertia,
        product=p[f"{unit.name}.sprung.roll_yaw_product"],
        stiffness=sum(stiffnesses, ca.SX(0)),
        damping=sum(dampings, ca.SX(0)),
    )


def mass_matrix(p: Expressions, unit: Unit, *, roll: bool) -> ca.SX:
    """M in M (a, r', p') = forces, with a = v' + u r: (3, 3), or (2, 2) without roll; equations (A1) to (A6)."""
    m, I_zz = p[f"{unit.name}.mass"], p[f"{unit.name}.yaw_inertia"]
    if not roll:
        return ca.diag(ca.vertcat(m, I_zz))
    body = roll_body(p, unit)
    return ca.vertcat(
        ca.horzcat(m, 0, -body.moment),
        ca.horzcat(0, I_zz, -body.product),
        ca.horzcat(-body.moment, -body.product, body.inertia),
    )


def tyre_forces(p: Expressions, path: str, group: GroupMotion) -> ca.SX:
    """Side force (N) and yaw moment about the CoG (N m) of the tyres of a group: (2, 1), linear in the slip angles.

    An axle has the side force C_alpha / n times its slip angle (equation (7), positive C_alpha). In a group with a
    relaxation length, the lagged slip angle replaces the mean slip angle of the group; the difference of an axle's slip
    angle from the mean acts without lag.
    """
    secants, total = linear(p, path, Contact(group.slip)) / len(group.axles), ca.SX(2, 1)
    for axle in group.axles:
        side_force, aligning = axle_forces(secants, axle.slip + (group.slip - group.mean))
        total += ca.vertcat(side_force, axle.arm * side_force + aligning)
    return total


def roll_moment(body: RollBody, roll: ca.SX, roll_rate: ca.SX) -> ca.SX:
    """Moment of gravity, suspensions and dampers about the roll axis, N m; (A3) and (A6)."""
    return (body.moment * GRAVITY - body.stiffness) * roll - body.damping * roll_rate
