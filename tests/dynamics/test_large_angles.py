"""The equations with rotations and saturating tyres: their limits, and Newton's equations of two rigid bodies."""

import casadi as ca
import numpy as np
import pytest

from fifthwheel import dynamics
from fifthwheel.dynamics import chain
from fifthwheel.dynamics.large_angles import large_angles
from fifthwheel.dynamics.saturation import (
    DEFAULTS,
    FRICTION,
    FRICTION_SENSITIVITY,
    NOMINAL_LOAD,
    SHAPE,
    STIFFNESS_SENSITIVITY,
    group_stiffness,
    saturation_parameters,
)
from fifthwheel.dynamics.unit_equations import group_roll
from fifthwheel.plant.magic_formula import MagicFormula
from fifthwheel.vehicle import Vehicle, get

TRUCK = get("cheng_cebon_2011")
SPEED = 20.0
LINEAR = {FRICTION: 1e9, STIFFNESS_SENSITIVITY: 0.0, FRICTION_SENSITIVITY: 0.0}


def rates(vehicle: Vehicle, x: np.ndarray, steer: float, *, roll: bool, changes: dict[str, float] | None = None):
    """x' (n,) at the standard speed."""
    values = vehicle.parameters() | saturation_parameters(vehicle) | (changes or {})
    state = ca.SX.sym("x", len(x))
    angles = {name: ca.SX(steer) for name in vehicle.steer_signals()}
    result = large_angles(values, vehicle, state, ca.SX(SPEED), angles, roll=roll)
    return np.array(ca.Function("rates", [state], [result.rates])(x)).ravel()


@pytest.mark.parametrize("roll", [False, True])
@pytest.mark.parametrize("name", ["cheng_cebon_2011", "auburn_6x4"])
def test_small_motion_is_that_of_the_linear_chain(name: str, roll: bool) -> None:
    """The difference falls with the square of the motion, or faster."""
    vehicle, rng = get(name), np.random.default_rng(1)
    m = dynamics.analysis.matrices(vehicle, SPEED, roll=roll)
    x = rng.normal(size=len(m.states)) * 0.05
    linear = m.A @ x + m.B.sum(axis=1) * 0.02
    errors = [
        np.abs(rates(vehicle, f * x, f * 0.02, roll=roll, changes=LINEAR) / f - linear).max() for f in (1e-2, 1e-3)
    ]
    assert errors[0] < 1e-3 * np.abs(linear).max()
    assert errors[1] < errors[0] / 50


def test_newton_with_the_forces_of_the_coupling() -> None:
    """Both bodies of the yaw model with the coupling and driving forces as unknowns, in the axes of the tractor."""
    truck, rng = get("auburn_6x4"), np.random.default_rng(2)
    p, names = truck.parameters(), chain.state_names(truck, roll=False)
    v, r1, r2, angle = x = np.array([0.8, 0.3, 0.25, -0.4]) * (1 + 0.1 * rng.normal(size=4))
    assert names == ("lateral_velocity.tractor", "yaw_rate.tractor", "yaw_rate.semitrailer", "articulation.semitrailer")
    steer, law = 0.07, p | saturation_parameters(truck)
    cos, sin = np.cos(angle), np.sin(angle)
    ahead = p["fifth_wheel.leading_position"] - p["tractor.cog"]
    behind = p["fifth_wheel.trailing_position"] - p["semitrailer.cog"]
    rotation = np.array([[cos, -sin], [sin, cos]])  # trailer axes to tractor axes
    hitch = np.array([SPEED, v + ahead * r1])
    own = rotation.T @ hitch - [0, behind * r2]

    def tyres(
        unit_index: int, velocity: np.ndarray, r: float, angles: dict[str, float], shift: float = 0
    ) -> np.ndarray:
        unit, total = truck.units[unit_index], np.zeros(3)
        for group in unit.axle_groups:
            path = unit.group_path(group)
            arms = [p[f"{unit.name}.{a.name}.position"] - p[f"{unit.name}.cog"] for a in group.axles]
            deltas = [angles.get(a.name, 0.0) for a in group.axles]
            slips = [d - np.arctan((velocity[1] + arm * r) / velocity[0]) for d, arm in zip(deltas, arms, strict=True)]
            height = p[f"{unit.name}.roll_axis_height"]
            change = {"tractor.front": -shift, "tractor.drive": shift}.get(path, 0.0)
            alpha = ca.SX(np.mean(slips))
            C = float(ca.evalf(group_stiffness(law, path, alpha, ca.SX(0), ca.SX(0), height, ca.SX(change))))
            for d, arm, slip in zip(deltas, arms, slips, strict=True):
                force = C / len(arms) * slip
                total += [-force * np.sin(d), force * np.cos(d), arm * force * np.cos(d)]
        return total

    front, less, more = (tyres(0, np.array([SPEED, v]), r1, {"front": steer}, shift) for shift in (0.0, -1.0, 1.0))
    rear = tyres(1, own, r2, {})
    m1, m2 = p["tractor.mass"], p["semitrailer.mass"]
    to_cog = rotation @ [-behind, 0]  # from the coupling to the trailer's CoG, axes of the tractor
    # unknown: v', r1', r2', the trailer's acceleration (2), the coupling force on the trailer (2), the driving force,
    # and the load that the coupling force moves from the front to the drive axle
    rows, right = np.zeros((9, 9)), np.zeros(9)
    rows[:3, 8] = -(more - less) / 2
    wheelbase = p["tractor.front.position"] - np.mean(
        [p[f"tractor.{a.name}.position"] for a in truck.units[0].axles[1:]]
    )
    rows[8, [5, 8]] = p["fifth_wheel.height"], -wheelbase
    rows[0, [5, 7]], right[0] = [1, -1], front[0] + m1 * v * r1  # m1 (u' - v r1) = front + drive - X, u' = 0
    rows[1, [0, 6]], right[1] = [m1, 1], front[1] - m1 * SPEED * r1
    rows[2, [1, 6]], right[2] = [p["tractor.yaw_inertia"], ahead], front[2]
    rows[3, [3, 5]], rows[4, [4, 6]] = [m2, -1], [m2, -1]
    right[3:5] = rotation @ rear[:2]
    moment = np.array([to_cog[1], -to_cog[0]])  # of the coupling force about the CoG: (hitch - cog) x force
    rows[5, 2], rows[5, 5:7], right[5] = p["semitrailer.yaw_inertia"], -moment, rear[2]
    # acceleration of the coupling from both bodies
    rows[6, 3], rows[6, 2], right[6] = 1, to_cog[1], -v * r1 - ahead * r1**2 - to_cog[0] * r2**2
    rows[7, 4], rows[7, 0], rows[7, 1], rows[7, 2] = 1, -1, -ahead, -to_cog[0]
    right[7] = SPEED * r1 - to_cog[1] * r2**2
    solution = np.linalg.solve(rows, right)
    expected = [solution[0], solution[1], solution[2], r2 - r1]
    np.testing.assert_allclose(rates(truck, x, steer, roll=False), expected, rtol=1e-6)
    assert abs(solution[8]) > 0.02 * truck.axle_loads()["tractor.front"]
    small = dynamics.analysis.matrices(truck, SPEED, roll=False)
    assert np.abs(small.A @ x + small.B.ravel() * steer - expected).max() > 0.2  # it is not small


def force(slip: float, roll: float = 0.0, **changes: float) -> float:
    """Side force of the trailer's axle group, N, with the nominal load on each tyre."""
    number = TRUCK.axle_loads()["semitrailer"] / NOMINAL_LOAD
    p = TRUCK.parameters() | saturation_parameters(TRUCK) | {"semitrailer.tyres": number} | changes
    height = p["semitrailer.roll_axis_height"]
    return slip * float(ca.evalf(group_stiffness(p, "semitrailer", ca.SX(slip), ca.SX(roll), ca.SX(0), height)))


def test_the_force_tends_to_friction_times_load() -> None:
    load = TRUCK.axle_loads()["semitrailer"]
    no_transfer = {"body.half_track": 1e9}
    assert force(100.0, **no_transfer) == pytest.approx(DEFAULTS[SHAPE] * DEFAULTS[FRICTION] * load, rel=1e-3)
    assert force(-0.1) == -force(0.1)
    slope = TRUCK.parameters()["semitrailer.cornering_stiffness"]
    assert force(1e-5, **no_transfer) == pytest.approx(1e-5 * slope, rel=1e-6)
    assert force(0.1, **{FRICTION: 0.3}) < force(0.1) < force(0.1, roll=0.0, **no_transfer)


def test_a_lifted_wheel_carries_nothing() -> None:
    """With all load on one side, more roll does not change the force, and the group has the load of that side."""
    lifted = force(0.1, roll=0.5)
    assert force(0.1, roll=1.0) == lifted
    load = TRUCK.axle_loads()["semitrailer"]
    mu = DEFAULTS[SHAPE] * DEFAULTS[FRICTION] * (1 - DEFAULTS[FRICTION_SENSITIVITY])
    C = TRUCK.parameters()["semitrailer.cornering_stiffness"] * (1 - DEFAULTS[STIFFNESS_SENSITIVITY])
    assert lifted == pytest.approx(0.1 * C / np.sqrt(1 + (0.1 * C / (load * mu)) ** 2), rel=1e-12)


@pytest.mark.parametrize("tyres", [6, 12])
def test_the_force_is_that_of_the_magic_formula(tyres: int) -> None:
    """Of the tyre of the nonlinear truck, at up to 12 deg and 0.1 to 1.9 times its static load; 0.5 % of the peak."""
    tyre, load = MagicFormula(), TRUCK.axle_loads()["semitrailer"]
    static = load / tyres
    own = {"semitrailer.cornering_stiffness": tyres * float(tyre.cornering_stiffness(static))}
    own |= {FRICTION: 0.74, SHAPE: 1.15, "semitrailer.tyres": tyres}
    stiffness = float(group_roll(TRUCK.parameters(), "semitrailer").stiffness)
    slips, errors = np.radians(np.linspace(0.2, 12, 20)), []
    for transfer in np.linspace(0, 0.9, 4):
        for slip in slips:
            p = TRUCK.parameters() | saturation_parameters(TRUCK) | own
            roll = ca.SX(transfer * load / stiffness)
            law = slip * float(ca.evalf(group_stiffness(p, "semitrailer", ca.SX(slip), roll, ca.SX(0), ca.SX(0))))
            sides = [float(tyre.side_force(np.tan(slip), n * static)) for n in (1 + transfer, 1 - transfer)]
            errors.append((law - tyres / 2 * abs(sum(sides))) / (0.74 * load))
    assert np.sqrt(np.mean(np.square(errors))) < 0.007
