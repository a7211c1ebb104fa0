"""Inertia of one unit, and tyre forces and roll moment on it, in its own axes (x forward, y left, z up; ISO 8855).

Equations (A1)-(A6) of Cheng and Cebon (2011) without the coupling force, which the chain eliminates. The velocity of a
unit is (v, r, p): lateral velocity on the roll axis under the CoG of the unit, yaw rate, roll rate. Two misprints of
the article are corrected: (A3) and (A6) count m_s h^2 phi'' twice, and (A2) has I_1szz in place of I_1sxz (see
docs/article.md).

In all functions p has the parameters by path, numbers or symbols. Units and axle groups give names and structure; their
numbers are not used.
"""

from typing import NamedTuple

import casadi as ca

from fifthwheel.base.units import STANDARD_GRAVITY as GRAVITY
from fifthwheel.model.dynamics.kinematics import GroupMotion
from fifthwheel.model.dynamics.symbolic import Expressions
from fifthwheel.model.dynamics.tyres import Contact, axle_forces, linear
from fifthwheel.truck import AxleGroup, Unit, laden


class RollBody(NamedTuple):
    """The sprung body of a unit about its roll axis."""

    moment: ca.SX  # m_s h, kg m, h = height of the sprung CoG above the roll axis
    inertia: ca.SX  # I_sx'x', kg m^2, about the roll axis
    product: ca.SX  # I_sxz, kg m^2
    stiffness: ca.SX  # K*, N m/rad, suspensions and tyres in series
    damping: ca.SX  # C*, N m s/rad, dampers and tyres in series


AXLE_COG_HEIGHT = 0.5
"""Of an axle with its wheels above the ground, m: the loaded radius of a tyre 315/80 R 22.5."""


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
