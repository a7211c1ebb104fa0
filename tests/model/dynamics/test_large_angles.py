"""The equations with rotations and saturating tyres: their limits, and Newton's equations of two rigid bodies."""

import casadi as ca
import numpy as np
import pytest

from fifthwheel.base.units import STANDARD_GRAVITY
from fifthwheel.model import dynamics
from fifthwheel.model.dynamics import chain
from fifthwheel.model.dynamics.large_angles import large_angles
from fifthwheel.model.dynamics.model import topology
from fifthwheel.model.dynamics.tyres import AUXILIARY, LAWS, Contact, Law, saturating, saturation_parameters
from fifthwheel.model.manoeuvres import braked, straight
from fifthwheel.model.plant import Plant
from fifthwheel.truck import AxleGroup, Vehicle, get
from fifthwheel.truck.catalogue import text
from fifthwheel.truck.quantities import (
    DRAG_AREA,
    DRIVE_AXLE_BRAKING,
    FRICTION,
    FRICTION_SENSITIVITY,
    ROLLING_RESISTANCE,
    STIFFNESS_SENSITIVITY,
)
from tests.model.dynamics.lagrangian import axle_compliance, linear
from tests.model.dynamics.test_lagrangian import with_relaxation, with_trail

TRUCK = get("cheng_cebon_2011")
SPEED = 20.0
NO_RESISTANCE = {DRAG_AREA: 0.0, ROLLING_RESISTANCE: 0.0}
LINEAR = {FRICTION: 1e9, STIFFNESS_SENSITIVITY: 0.0, FRICTION_SENSITIVITY: 0.0} | NO_RESISTANCE
AIR = 0.6 * 6.0 * SPEED**2
"""Drag of the air, N, on 6 m^2 at half a density of 1.2 kg/m^3."""


def longitudinal(
    vehicle: Vehicle, speed_rate: float, retarder: float = 0.0, lateral: tuple[float, ...] = ()
) -> dict[str, float]:
    """Longitudinal force of each axle group at the standard speed, N, with a rolling resistance of 0.6 % of its load,
    and at a lateral acceleration of each unit, whose drag they make up for.

    The drive axle of the tractor drives; a retarder gives a fraction of the braking force on it up to a deceleration,
    the brakes of all groups the rest by their loads.
    """
    loads = vehicle.axle_loads()
    weight = sum(loads.values())
    wheels = weight / STANDARD_GRAVITY * speed_rate + AIR + 0.006 * weight
    wheels += sum(
        (loads[path] / STANDARD_GRAVITY * min(abs(a), 5.0)) ** 2 / vehicle.parameters()[f"{path}.cornering_stiffness"]
        for unit, a in zip(vehicle.units, lateral, strict=False)
        for path in map(unit.group_path, unit.axle_groups)
    )
    alone = retarder * max(min(wheels, 0.0), -AUXILIARY * weight / STANDARD_GRAVITY)
    rest = min(wheels, 0.0) - alone
    forces = {path: rest * load / weight - 0.006 * load for path, load in loads.items()}
    forces["tractor.drive"] += max(wheels, 0.0) + alone
    return forces


def rates(
    vehicle: Vehicle,
    x: np.ndarray,
    steer: float,
    *,
    roll: bool,
    changes: dict[str, float] | None = None,
    speed_rate: float = 0.0,
    law: Law = saturating,
):
    """x' (n,) at the standard speed."""
    values = vehicle.parameters() | saturation_parameters(vehicle) | (changes or {})
    state = ca.SX.sym("x", len(x))
    angles = {name: ca.SX(steer) for name in vehicle.steer_signals()}
    options = {"roll": roll, "speed_rate": ca.SX(speed_rate), "law": law}
    result = large_angles(values, vehicle, state, ca.SX(SPEED), angles, **options)
    return np.array(ca.Function("rates", [state], [result.stages.expanded(result.rates)])(x)).ravel()


@pytest.mark.slow
@pytest.mark.parametrize(("name", "roll"), [("auburn_6x4", False), ("articulated_bus", True)])
def test_small_motion_is_that_of_the_linear_chain(name: str, roll: bool) -> None:
    """The difference falls with the square of the motion, or faster."""
    vehicle, rng = with_trail(get(name), 0.04, 0.06), np.random.default_rng(1)
    m = dynamics.state_space.matrices(vehicle, SPEED, roll=roll)
    x = rng.normal(size=len(m.states)) * 0.05
    linear = m.A @ x + m.B.sum(axis=1) * 0.02
    errors = [
        np.abs(rates(vehicle, f * x, f * 0.02, roll=roll, changes=LINEAR) / f - linear).max() for f in (1e-2, 1e-3)
    ]
    assert errors[0] < 1e-3 * np.abs(linear).max()
    assert errors[1] < errors[0] / 50


@pytest.mark.slow
@pytest.mark.parametrize("quantity", AxleGroup.si_units)
def test_every_parameter_of_an_axle_group_is_in_both_laws(quantity: str) -> None:
    """At small motion and high friction, a change of the parameter has the same effect, which is not 0."""
    vehicle, path = with_trail(TRUCK, 0.04, 0.06, 0.05), f"tractor.drive.{quantity}"
    value = vehicle.parameters().get(path, 0.0)  # a file may be without it
    vehicle, other = vehicle.replace({path: value}), vehicle.replace({path: 1.1 * value or 0.01})
    x = np.random.default_rng(6).normal(size=len(chain.state_names(vehicle, roll=True))) * 1e-6

    def effect(law: Law) -> np.ndarray:
        before, after = (rates(each, x, 0.0, roll=True, changes=LINEAR, law=law) for each in (vehicle, other))
        assert np.abs(after - before).max() > 1e-4 * np.abs(before).max()
        return after - before

    linear, saturating = map(effect, LAWS.values())
    np.testing.assert_allclose(saturating, linear, rtol=0, atol=1e-4 * np.abs(linear).max())
    by_chain = [dynamics.matrices(each, SPEED, roll=True).A @ x for each in (vehicle, other)]
    np.testing.assert_allclose(linear, by_chain[1] - by_chain[0], rtol=0, atol=1e-4 * np.abs(linear).max())


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "speed_rate", "retarder"), [("cheng_cebon_2011", 0.9, 0.0), ("cheng_cebon_2011", -0.9, 1.0)]
)
def test_small_motion_while_the_first_unit_drives_or_brakes_is_that_of_the_chain(
    name: str, speed_rate: float, retarder: float
) -> None:
    """The linear law with the derivative of the speed; the loads do not change."""
    truck, names = get(name), chain.state_names(get(name), roll=True)
    of_loads = {f"{path}.{load}": 0.0 for path in truck.axle_loads() for load in ("braking_load", "pull_load")}
    changes = LINEAR | of_loads | {DRIVE_AXLE_BRAKING: retarder}
    terms = chain.equations({k: ca.SX(v) for k, v in truck.parameters().items()}, truck, roll=True)
    change = chain.SpeedChange.of(ca.SX(speed_rate), retarder)
    x = np.random.default_rng(4).normal(size=len(names)) * 0.05
    constant, expected = (np.array(ca.evalf(terms.state_space(ca.SX(SPEED), c)[0])) @ x for c in (None, change))
    errors = [
        np.abs(rates(truck, f * x, 0.0, roll=True, changes=changes, speed_rate=speed_rate) / f - expected).max()
        for f in (1e-2, 1e-3)
    ]
    effect = np.abs(constant - expected).max()
    assert effect > 0.05
    assert errors[0] < 1e-3 * effect
    assert errors[1] < errors[0] / 50


@pytest.mark.parametrize("speed_rate", [0.5, -0.05, -3.0])
def test_small_motion_with_resistance_is_that_of_lagrange(speed_rate: float) -> None:
    """A truck that drives, coasts nearly or brakes against its drag and rolling resistance; linear tyres.

    The loads that drag and pull at the coupling move, from a balance of moments of both units, change the cornering
    stiffness.
    """
    truck, rng = TRUCK, np.random.default_rng(5)
    loads, forces = truck.axle_loads(), longitudinal(truck, speed_rate)
    changes = LINEAR | {DRAG_AREA: 6.0, ROLLING_RESISTANCE: 0.006} | {f"{path}.braking_load": 0.0 for path in loads}
    behind = loads["semitrailer"] / STANDARD_GRAVITY * speed_rate - forces["semitrailer"]  # beside the braking loads
    braking = forces["semitrailer"] + 0.006 * loads["semitrailer"]
    relieved = min(behind, 0.0) + max(behind + braking, 0.0)
    p = truck.parameters()
    wheelbase = p["tractor.front.position"] - np.mean([axle.position for axle in truck.units[0].axles[1:]])
    tilting = p["fifth_wheel.height"] * relieved  # of the tractor to the rear
    lacking = loads["semitrailer"] / STANDARD_GRAVITY * speed_rate - braking  # on the road, tilts the trailer
    trailer = truck.units[1]
    on_fifth_wheel = p["fifth_wheel.height"] * lacking / (0.0 - np.mean([axle.position for axle in trailer.axles]))
    ahead = p["fifth_wheel.leading_position"] - np.mean([axle.position for axle in truck.units[0].axles[1:]])
    to_drive = (1.5 * AIR + tilting) / wheelbase + on_fifth_wheel * (1 - ahead / wheelbase)
    moved = {"tractor.drive": to_drive, "tractor.front": on_fifth_wheel - to_drive, "semitrailer": -on_fifth_wheel}
    assert max(map(abs, moved.values())) > 0.002 * loads["tractor.front"]
    stiffness = dict[str, float]()
    for path, load in moved.items():
        change = p[f"{path}.cornering_stiffness"] * load / loads[path]
        unit = truck.units[path == "semitrailer"]
        group = next(g for g in unit.axle_groups if unit.group_path(g) == path)
        of_axles = axle_compliance(group, unit.roll_axis_height)  # the relaxation length does not change
        stiffness[f"{path}.cornering_stiffness"] = p[f"{path}.cornering_stiffness"] + change
        stiffness[f"{path}.relaxation_length"] = p[f"{path}.relaxation_length"] - change * of_axles
    net = forces | {"tractor.drive": forces["tractor.drive"] - AIR}  # along the tractor, as the drag is
    mass = sum(unit.mass for unit in truck.units)
    assert sum(net.values()) == pytest.approx(mass * speed_rate, rel=1e-9, abs=1e-6)
    names = chain.state_names(truck, roll=True)
    x, angle = rng.normal(size=len(names)) * 0.05, 0.02
    reference = linear(truck.replace(stiffness), SPEED, speed_rate=speed_rate, brakes=net).ordered(names)
    expected = reference.A @ x + reference.B.sum(axis=1) * angle
    errors = [
        np.abs(rates(truck, f * x, f * angle, roll=True, changes=changes, speed_rate=speed_rate) / f - expected).max()
        for f in (1e-2, 1e-3)
    ]
    free = linear(truck, SPEED).ordered(names)
    effect = np.abs(free.A @ x + free.B.sum(axis=1) * angle - expected).max()
    assert errors[0] < 0.02 * effect
    assert errors[1] < errors[0] / 50


@pytest.mark.slow
@pytest.mark.parametrize(("speed_rate", "retarder"), [(0.0, 0.0), (-3.0, 0.0), (0.5, 0.0), (-1.0, 0.7)])
def test_newton_with_the_forces_of_the_coupling(speed_rate: float, retarder: float) -> None:
    """Both bodies of the yaw model with the coupling and driving forces as unknowns, in the axes of the tractor."""
    truck, rng = with_trail(with_relaxation(get("auburn_6x4"), 0.0), 0.04, 0.06), np.random.default_rng(2)
    p, names = truck.parameters(), chain.state_names(truck, roll=False)
    v, r1, r2, angle = x = np.array([0.8, 0.3, 0.25, -0.4]) * (1 + 0.1 * rng.normal(size=4))
    assert names == ("lateral_velocity.tractor", "yaw_rate.tractor", "yaw_rate.semitrailer", "articulation.semitrailer")
    loads = truck.axle_loads()
    steer, law = 0.07, p | saturation_parameters(truck)
    cos, sin = np.cos(angle), np.sin(angle)
    ahead = p["fifth_wheel.leading_position"] - p["tractor.cog"]
    behind = p["fifth_wheel.trailing_position"] - p["semitrailer.cog"]
    rotation = np.array([[cos, -sin], [sin, cos]])  # trailer axes to tractor axes
    hitch = np.array([SPEED, v + ahead * r1])
    own = rotation.T @ hitch - [0, behind * r2]
    forward = longitudinal(truck, speed_rate, retarder, (SPEED * r1, own[0] * r2))

    front_axle, rear_axles = (
        p["tractor.front.position"],
        [p[f"tractor.{a.name}.position"] for a in truck.units[0].axles[1:]],
    )
    wheelbase, height = front_axle - np.mean(rear_axles), p["fifth_wheel.height"]
    last = np.mean([axle.position for axle in truck.units[1].axles])
    braking = forward["semitrailer"] + 0.006 * loads["semitrailer"]
    tilting = height * (loads["semitrailer"] / STANDARD_GRAVITY * speed_rate - braking)  # of the trailer to the front
    on_fifth_wheel = tilting / (p["fifth_wheel.trailing_position"] - last)
    to_front = on_fifth_wheel * (p["fifth_wheel.leading_position"] - np.mean(rear_axles)) / wheelbase
    per_pull = {"tractor.front": -height / wheelbase, "tractor.drive": height / wheelbase, "semitrailer": 0.0}
    of_air = 1.5 * AIR / wheelbase
    known = {"tractor.front": to_front - of_air, "tractor.drive": on_fifth_wheel - to_front + of_air}
    known["semitrailer"] = -on_fifth_wheel

    def tyres(unit_index: int, velocity: np.ndarray, r: float, angles: dict[str, float], pull: float = 0) -> np.ndarray:
        unit, total = truck.units[unit_index], np.zeros(3)
        for group in unit.axle_groups:
            path = unit.group_path(group)
            arms = [p[f"{unit.name}.{a.name}.position"] - p[f"{unit.name}.cog"] for a in group.axles]
            deltas = [angles.get(a.name, 0.0) for a in group.axles]
            slips = [d - np.arctan((velocity[1] + arm * r) / velocity[0]) for d, arm in zip(deltas, arms, strict=True)]
            height = p[f"{unit.name}.roll_axis_height"]
            change = per_pull[path] * pull + known[path] - law[f"{path}.braking_load"] * speed_rate
            along = forward[path] / len(arms)
            for d, arm, slip in zip(deltas, arms, slips, strict=True):
                contact = Contact(ca.SX(slip), ca.SX(0), height, ca.SX(change), ca.SX(forward[path]))
                secants = np.array(ca.evalf(saturating(law, path, contact))).ravel()
                force, *moment = secants / len(arms) * slip
                side = force * np.cos(d) + along * np.sin(d)
                total += [along * np.cos(d) - force * np.sin(d), side, arm * side - sum(moment)]
        return total

    front, less, more = (tyres(0, np.array([SPEED, v]), r1, {"front": steer}, pull) for pull in (0.0, -1.0, 1.0))
    rear, rear_less, rear_more = (tyres(1, own, r2, {}, pull) for pull in (0.0, -1.0, 1.0))
    m1, m2 = p["tractor.mass"], p["semitrailer.mass"]
    to_cog = rotation @ [-behind, 0]  # from the coupling to the trailer's CoG, axes of the tractor
    # unknown: v', r1', r2', the trailer's acceleration (2), the coupling force on the trailer (2), the driving force
    # beside the longitudinal forces of the tyres, and the pull at the coupling beside that of a truck whose groups all
    # brake by their loads
    rows, right = np.zeros((9, 9)), np.zeros(9)
    rows[:3, 8], of_rear = -(more - less) / 2, (rear_more - rear_less) / 2
    rows[3:5, 8], rows[5, 8] = -rotation @ of_rear[:2], -of_rear[2]
    rows[8, [5, 8]], right[8] = [1, -1], (m2 - loads["semitrailer"] / STANDARD_GRAVITY) * speed_rate
    # m1 (u' - v r1) = front + drive - X - drag
    rows[0, [5, 7]], right[0] = [1, -1], front[0] - AIR - m1 * (speed_rate - v * r1)
    rows[1, [0, 6]], right[1] = [m1, 1], front[1] - m1 * SPEED * r1
    rows[2, [1, 6]], right[2] = [p["tractor.yaw_inertia"], ahead], front[2]
    rows[3, [3, 5]], rows[4, [4, 6]] = [m2, -1], [m2, -1]
    right[3:5] = rotation @ rear[:2]
    moment = np.array([to_cog[1], -to_cog[0]])  # of the coupling force about the CoG: (hitch - cog) x force
    rows[5, 2], rows[5, 5:7], right[5] = p["semitrailer.yaw_inertia"], -moment, rear[2]
    # acceleration of the coupling from both bodies
    rows[6, 3], rows[6, 2], right[6] = 1, to_cog[1], speed_rate - v * r1 - ahead * r1**2 - to_cog[0] * r2**2
    rows[7, 4], rows[7, 0], rows[7, 1], rows[7, 2] = 1, -1, -ahead, -to_cog[0]
    right[7] = SPEED * r1 - to_cog[1] * r2**2
    solution = np.linalg.solve(rows, right)
    expected = [solution[0], solution[1], solution[2], r2 - r1]
    np.testing.assert_allclose(
        rates(truck, x, steer, roll=False, changes={DRIVE_AXLE_BRAKING: retarder}, speed_rate=speed_rate),
        expected,
        rtol=1e-6,
    )
    if not speed_rate:
        assert abs(per_pull["tractor.front"] * solution[8]) > 0.01 * loads["tractor.front"]
        model = dynamics.model(truck, ["coupling_force.semitrailer"], roll=False, tyres="saturating")
        values = model.known_values(dynamics.all_parameters(truck, model.outputs, tyres="saturating"))
        force = float(model.observation(x, [SPEED, steer, SPEED, steer], [], values))
        assert force == pytest.approx((rotation.T @ solution[5:7])[1], rel=1e-6)
    small = dynamics.state_space.matrices(truck, SPEED, roll=False)
    assert np.abs(small.A @ x + small.B.ravel() * steer - expected).max() > 0.15  # it is not small


def load_changes(vehicle: Vehicle, speed: float, changes: dict[str, float], rate: float = 0.0) -> dict[str, float]:
    """Load of each axle group less the static one, N, at a speed and its derivative on a straight road."""
    values = vehicle.parameters() | saturation_parameters(vehicle) | changes
    state = ca.SX.sym("x", len(chain.state_names(vehicle, roll=False)))
    angles = dict.fromkeys(vehicle.steer_signals(), ca.SX(0))
    result = large_angles(values, vehicle, state, ca.SX(speed), angles, roll=False, speed_rate=ca.SX(rate))
    loads = ca.vertcat(*[result.load_change[path] for path in vehicle.axle_loads()])
    function = ca.Function("loads", [state], [result.stages.expanded(loads)])
    return dict(zip(vehicle.axle_loads(), np.array(function(np.zeros(state.shape[0]))).ravel(), strict=True))


@pytest.mark.parametrize("rear", [True, False])
def test_the_loads_of_a_bus_are_those_of_statics_by_the_axle_that_drives(rear: bool) -> None:
    """On a straight road; each has a model of its own, although the parameters have the same names."""
    bus = Vehicle.loads(text("articulated_bus").replace("driven = true", f"driven = {str(rear).lower()}"))
    (driven,), rate = bus.driven_groups(), 0.6
    assert driven == ("rear" if rear else "front.middle")
    force = {driven: rate * sum(unit.mass for unit in bus.units)}
    expected, static = bus.axle_loads(rate / STANDARD_GRAVITY, force), bus.axle_loads()
    for path, change in load_changes(bus, SPEED, NO_RESISTANCE, rate).items():
        assert change == pytest.approx(expected[path] - static[path], abs=0.5), path
    assert (topology(bus) == topology(get("articulated_bus"))) is rear


@pytest.mark.slow
def test_the_loads_while_braking_are_those_of_the_nonlinear_truck() -> None:
    """Within 0.25 % of the static load at constant speed and 2.5 % while braking; without resistance, the load of the
    front axle is 1.8 % too high, and it changes by 28 % while braking."""
    truth, static = Plant(TRUCK).drive(braked(straight(duration=5.0), 3.0)).truth, TRUCK.axle_loads()
    last, first = slice(-50, None), slice(40, 90)
    rate = np.gradient(truth["speed"], 0.01)[last].mean()
    parameters, expected = saturation_parameters(TRUCK), load_changes(TRUCK, truth["speed"][first].mean(), {})
    for path in static:
        unit, _, group = path.partition(".")
        axles = next(g.axles for g in TRUCK.unit(unit).axle_groups if g.name == group or not group)
        loads = sum(truth[f"vertical_force.{unit}.{axle.name}"] for axle in axles)
        assert loads[first].mean() - static[path] == pytest.approx(expected[path], abs=0.0025 * static[path]), path
        change = loads[last].mean() - loads[:90].mean()
        assert change == pytest.approx(-parameters[f"{path}.braking_load"] * rate, abs=0.025 * loads[0]), path
    assert -expected["tractor.front"] > 0.01 * static["tractor.front"]
