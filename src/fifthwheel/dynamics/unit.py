"""One unit of the chain: its inertia, and the forces on it, in its own axes (x forward, y left, z up; ISO 8855).

The article's (A1)-(A6) without the coupling force, which the chain eliminates. A unit's velocity is (v, r, p): lateral
velocity on the roll axis under the CoG of the whole unit, yaw rate, roll rate. The article's two misprints that matter
here are mended: (A3) and (A6) count m_s h^2 phi'' twice, and (A2) writes I_1szz for I_1sxz (see the errata page).
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

import casadi as ca

from fifthwheel.vehicle import Axle, AxleGroup, Unit, laden
from fifthwheel.vehicle.statics import STANDARD_GRAVITY as GRAVITY

Steer = Mapping[str, ca.SX]


class RollBody(NamedTuple):
    """The sprung body of a unit about its roll axis."""

    moment: ca.SX  # m_s h, kg m, h = height of the sprung CoG above the roll axis
    inertia: ca.SX  # I_sx'x', kg m^2, about the roll axis
    product: ca.SX  # I_sxz, kg m^2
    stiffness: ca.SX  # K*, N m/rad, suspensions and tyres in series
    damping: ca.SX  # C*, N m s/rad, the same


def roll_body(p: Mapping[str, ca.SX], unit: Unit) -> RollBody:
    """m_s h, I_sx'x', I_sxz, K*, C* of a unit; the laden ones by the article's (8) and (9).

    The body rolls on suspension and tyres in a row, and the damper sees only the suspension's part of the roll angle,
    K_t / (K + K_t). Work and force leave C* = C (K_t / (K + K_t))^2 for the whole angle, to first order in frequency;
    the article reduces the stiffness so, but not the damping.
    """
    load = laden(p, unit)
    stiffness, damping = ca.SX(0), ca.SX(0)
    for group in unit.axle_groups:
        path = unit.group_path(group)
        suspension, tyres = p[f"{path}.roll_stiffness"], p[f"{path}.tyre_roll_stiffness"]
        stiffness += suspension * tyres / (suspension + tyres)
        part = tyres / (suspension + tyres)
        damping += p[f"{path}.roll_damping"] * part * part
    return RollBody(
        moment=load.mass * (load.cog_height - p[f"{unit.name}.roll_axis_height"]),
        inertia=load.roll_inertia,
        product=p[f"{unit.name}.sprung.roll_yaw_product"],
        stiffness=stiffness,
        damping=damping,
    )


def mass_matrix(p: Mapping[str, ca.SX], unit: Unit, *, roll: bool) -> ca.SX:
    """M with M (a, r', p') = forces, a = v' + u r: (3, 3), or (2, 2) without roll."""
    m, I_zz = p[f"{unit.name}.mass"], p[f"{unit.name}.yaw_inertia"]
    if not roll:
        return ca.diag(ca.vertcat(m, I_zz))
    body = roll_body(p, unit)
    return ca.vertcat(
        ca.horzcat(m, 0, -body.moment),
        ca.horzcat(0, I_zz, -body.product),
        ca.horzcat(-body.moment, -body.product, body.inertia),
    )


class Slip(NamedTuple):
    """Slip angle of an axle: `turned` - `drift` / u."""

    turned: ca.SX  # steer angle and heading, rad
    drift: ca.SX  # m/s, to the left of the first unit's heading


def slip(p: Mapping[str, ca.SX], unit: Unit, axle: Axle, across: ca.SX, heading: ca.SX, r: ca.SX, steer: Steer) -> Slip:
    """Of one axle; arguments as in `tyre_forces`."""
    arm = p[f"{unit.name}.{axle.name}.position"] - p[f"{unit.name}.cog"]
    delta = steer[f"steer.{unit.name}.{axle.name}"] if axle.steerable else 0
    return Slip(delta + heading, across + arm * r)


def mean_slip(p: Mapping[str, ca.SX], unit: Unit, group: AxleGroup, *motion: Any) -> Slip:
    """Of a group's axles."""
    slips = [slip(p, unit, axle, *motion) for axle in group.axles]
    n = len(slips)
    return Slip(sum((s.turned for s in slips), ca.SX(0)) / n, sum((s.drift for s in slips), ca.SX(0)) / n)


def tyre_forces(
    p: Mapping[str, ca.SX],
    unit: Unit,
    across: ca.SX,
    heading: ca.SX,
    r: ca.SX,
    steer: Steer,
    slowness: ca.SX,
    lagging: Mapping[str, ca.SX],
) -> ca.SX:
    """Side force (N) and yaw moment about the CoG (N m) of all tyres, linear in the slip angle.

    Args:
        across, heading: v + u heading and the heading, both from the first unit's.
        r: yaw rate of the unit.
        steer: steer angle of each steered axle by its signal's name, rad, positive left.
        slowness: 1/u, s/m.
        lagging: slip angle that the forces of a group have reached, by its path; groups without it have no lag.
    """
    force, moment = ca.SX(0), ca.SX(0)
    for group in unit.axle_groups:
        path = unit.group_path(group)
        stiffness = p[f"{path}.cornering_stiffness"] / len(group.axles)
        mean = mean_slip(p, unit, group, across, heading, r, steer)
        late = lagging[path] - (mean.turned - mean.drift * slowness) if path in lagging else 0
        for axle in group.axles:
            arm = p[f"{unit.name}.{axle.name}.position"] - p[f"{unit.name}.cog"]
            own = slip(p, unit, axle, across, heading, r, steer)
            side = stiffness * (own.turned - own.drift * slowness + late)
            force += side
            moment += arm * side
    return ca.vertcat(force, moment)


def roll_moment(body: RollBody, roll: ca.SX, roll_rate: ca.SX) -> ca.SX:
    """Moment about the roll axis by gravity, suspensions and dampers, N m."""
    return (body.moment * GRAVITY - body.stiffness) * roll - body.damping * roll_rate
