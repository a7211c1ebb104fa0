"""A tyre force law that saturates at the friction of the road, for an axle group with its left and right tyres.

The side force of a group with the cornering stiffness C and the static load N at a slip angle alpha is the sum over
both sides, whose loads are n = 1 + lambda and 1 - lambda times the static ones, plus the change of the group's load:

    F = (C alpha / 2) sum n k / sqrt(1 + (C alpha k / (N mu))^2),
    k = 1 - s q^2 (n - 1),        mu = mu_0 (1 - s_mu (q n - 1))

with the load sensitivities s of the stiffness and s_mu of the friction mu_0 at the nominal load of a tyre, and the
static load q of a tyre of the group as a fraction of it: twin tyres carry half the load each. In PAC2002 the friction
is linear in the load, and the sensitivity of the stiffness K = K_max sin(2 atan(F_z / F_K)) is 1 - (F_z / K) dK/dF_z =
2 F_z^2 / (F_K^2 + F_z^2), about in proportion to q^2 (H. B. Pacejka, Tyre and Vehicle Dynamics, 2006, chapter 4). At
small slip angles F / (C alpha) tends to 1 - s q^2 lambda^2: without load transfer the law is then linear. Of the laws
with two parameters, this one is closest to measured truck tyres: over loads of 0.2 to 1.9 times the static one and slip
angles up to 12 deg, its rms distance is 0.3 to 0.6 % of the peak force of three tyres in PAC2002 (tanh 0.3 to 1.4 %,
Fiala's brush 1.1 to 2.0 %). mu_0 is the friction at large slip, 10 to 15 % above the peak that a Magic Formula states.

The load transfer ratio lambda of a group is T / (N half_track) with T = K* phi + C* phi' + h_r F, the moment of its
suspension and tyres, and of the side force at the height h_r of the roll axis.
"""

from collections.abc import Mapping
from typing import Literal

import casadi as ca

from fifthwheel.dynamics.unit_equations import group_roll
from fifthwheel.vehicle import Vehicle

TyreLaw = Literal["linear", "saturating"]
FRICTION = "road.friction"
HALF_TRACK = "body.half_track"
STIFFNESS_SENSITIVITY = "tyre.stiffness_load_sensitivity"
FRICTION_SENSITIVITY = "tyre.friction_load_sensitivity"
NO_CHANGE = ca.SX(0)
NOMINAL_LOAD = 35e3
"""Of a tyre, N: of 315/80 R 22.5."""
DEFAULTS: Mapping[str, float] = {FRICTION: 0.8, HALF_TRACK: 1.0, STIFFNESS_SENSITIVITY: 0.2, FRICTION_SENSITIVITY: 0.09}
"""Friction of a dry road; half the distance of the tyres of both sides, m; sensitivities of three truck tyres: 0.1 to
0.3 and 0.05 to 0.1."""


def static_load(path: str) -> str:
    """Name of the parameter that is the static load of an axle group, N."""
    return f"{path}.static_load"


def tyres(path: str) -> str:
    """Name of the parameter that is the number of tyres of an axle group."""
    return f"{path}.tyres"


def saturation_parameters(vehicle: Vehicle) -> dict[str, float]:
    """Parameters of the law by name, with their defaults, SI.

    Raises:
        VehicleError: the static axle loads are not determined.
    """
    loads = {static_load(path): load for path, load in vehicle.axle_loads().items()}
    return {**DEFAULTS, **loads, **{tyres(path): float(number) for path, number in vehicle.tyres().items()}}


def group_stiffness(
    p: Mapping[str, ca.SX],
    path: str,
    slip: ca.SX,
    roll: ca.SX,
    roll_rate: ca.SX,
    roll_axis_height: ca.SX,
    load_change: ca.SX = NO_CHANGE,
) -> ca.SX:
    """Secant F / alpha of the law, N/rad.

    Args:
        p: parameters by name.
        path: of the axle group.
        slip: slip angle, rad.
        roll, roll_rate: of the unit, rad and rad/s.
        roll_axis_height: of the unit, m.
        load_change: load of the group less its static load, N.
    """
    C, N, mu = p[f"{path}.cornering_stiffness"], p[static_load(path)], p[FRICTION]
    q = N / p[tyres(path)] / NOMINAL_LOAD
    stiffness_sensitivity, friction_sensitivity = p[STIFFNESS_SENSITIVITY] * q**2, p[FRICTION_SENSITIVITY]
    body = group_roll(p, path)
    suspension = body.stiffness * roll + body.damping * roll_rate
    even = 1 / ca.sqrt(1 + (C * slip / (N * mu)) ** 2)  # secant without load transfer
    moment = suspension + roll_axis_height * even * C * slip
    forward = load_change / N
    transfer = ca.fmax(ca.fmin(moment / (N * p[HALF_TRACK]), 1 + forward), -1 - forward)
    secant = ca.SX(0)
    for side in (1, -1):
        change = side * transfer + forward
        k = 1 - stiffness_sensitivity * change
        ratio = C * k / (N * mu * (1 - friction_sensitivity * (q * (1 + change) - 1)))
        secant += C / 2 * (1 + change) * k / ca.sqrt(1 + (ratio * slip) ** 2)
    return secant
