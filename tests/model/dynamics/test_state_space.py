"""The linear model against published formulas, and as a state space."""

import sys
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.linalg import expm

from fifthwheel.base.errors import FifthwheelError, SignalError, VehicleError
from fifthwheel.model import dynamics
from fifthwheel.model.dynamics import (
    critical_speed,
    frequency_response,
    linear_system,
    matrices,
    modes,
    rearward_amplification,
    steady_state,
    steady_steer,
    understeer_gradient,
)
from fifthwheel.truck import Axle, AxleGroup, Coupling, SprungMass, Unit, Vehicle, get

ARTICLE = get("cheng_cebon_2011")
G = 9.80665
FRONT, REAR, COG = 0.4, -5.2, -2.3  # m, of the truck, from an arbitrary origin
WHEELBASE = FRONT - REAR
HITCH = -6.1


def group(name: str, position: float, stiffness: float, *, steerable: bool = False) -> AxleGroup:
    rolling = {"roll_stiffness": 9e5, "tyre_roll_stiffness": 3e6, "roll_damping": 2e4}
    axle = Axle(name=name, position=position, steerable=steerable)
    return AxleGroup(name=name, axles=(axle,), cornering_stiffness=stiffness, **rolling)


def truck(*, front: float = 4e5, rear: float = 6e5) -> Vehicle:
    numbers = {"mass": 14000, "cog": COG, "yaw_inertia": 6e4, "roll_axis_height": 0.6}
    sprung = SprungMass(mass=12000, cog_height=1.5, roll_inertia=8000)
    groups = (group("front", FRONT, front, steerable=True), group("rear", REAR, rear))
    return Vehicle(name="truck", units=(Unit(name="truck", **numbers, sprung=sprung, axle_groups=groups),))


def truck_and_trailer() -> Vehicle:
    numbers = {"mass": 9000, "cog": -4.1, "yaw_inertia": 5e4, "roll_axis_height": 0.7}
    sprung = SprungMass(mass=8000, cog_height=1.4, roll_inertia=6000)
    trailer = Unit(name="trailer", **numbers, sprung=sprung, axle_groups=(group("axle", -6.8, 5e5),))
    eye = Coupling(name="eye", leading_position=HITCH, trailing_position=0.3, height=0.9, roll_stiffness=0)
    return Vehicle(name="rig", units=(*truck().units, trailer), couplings=(eye,))


def understeer(vehicle: Vehicle) -> float:
    """Understeer gradient K of the single-track model, rad s^2/m: the steer angle on a radius R is L/R + K u^2/R."""
    unit = vehicle.units[0]
    front, rear = (g.cornering_stiffness for g in unit.axle_groups)
    return unit.mass / WHEELBASE * ((COG - REAR) / front - (FRONT - COG) / rear)


@pytest.mark.parametrize(("speed", "roll"), [(3.0, True), (27.0, True), (14.0, False)])
def test_steady_turn_equals_the_single_track_model(speed: float, roll: bool) -> None:
    vehicle, steer = truck(), 0.02
    state = steady_state(vehicle, speed, [steer], roll=roll)
    yaw_rate = speed * steer / (WHEELBASE + understeer(vehicle) * speed**2)
    assert understeer(vehicle) > 0
    assert state["yaw_rate.truck"] == pytest.approx(yaw_rate, rel=1e-9)
    rear_force = vehicle.units[0].mass * speed * yaw_rate * (FRONT - COG) / WHEELBASE
    rear_slip = -rear_force / vehicle.units[0].axle_groups[1].cornering_stiffness
    assert state["lateral_velocity.truck"] == pytest.approx(speed * rear_slip - (REAR - COG) * yaw_rate, rel=1e-9)
    if roll:  # in a left turn the body rolls to the right, which is positive
        moment, stiffness = 12000 * (1.5 - 0.6), 2 / (1 / 9e5 + 1 / 3e6)
        assert state["roll.truck"] == pytest.approx(moment * speed * yaw_rate / (stiffness - moment * G), rel=1e-9)
        assert state["roll_rate.truck"] == pytest.approx(0, abs=1e-12)


def test_steer_angle_of_a_steady_turn_at_any_speed() -> None:
    assert steady_steer(truck(rear=1e5)) == pytest.approx((WHEELBASE, understeer(truck(rear=1e5))), rel=1e-9)
    length, gradient = steady_steer(ARTICLE)
    assert gradient == understeer_gradient(ARTICLE)
    for speed in (6.0, 33.0):
        yaw_rate = steady_state(ARTICLE, speed, [0.01, 0, 0, 0])["yaw_rate.tractor"]
        assert (length + gradient * speed**2) * yaw_rate / speed == pytest.approx(0.01, rel=1e-8)


@pytest.mark.parametrize("roll", [True, False])
def test_critical_speed_of_an_oversteering_truck(roll: bool) -> None:
    vehicle = truck(front=8e5, rear=4e5)
    expected = np.sqrt(-WHEELBASE / understeer(vehicle))
    assert 10 < expected < 60
    assert critical_speed(vehicle, roll=roll) == pytest.approx(expected, abs=2e-6)
    assert critical_speed(vehicle, roll=roll, highest=expected - 1) is None
    assert critical_speed(truck(), roll=roll) is None
    if not roll:
        assert sorted(mode.damping for mode in modes(vehicle, expected + 5, roll=False)) == pytest.approx([-1, 1])


def test_critical_speed_of_a_swaying_trailer() -> None:
    """A trailer with its CoG far to the rear becomes unstable by oscillation: the damping changes its sign."""
    rig = truck_and_trailer().replace({"trailer.cog": -6.7, "trailer.yaw_inertia": 1.2e5, "trailer.mass": 16000})
    critical = critical_speed(rig)
    assert critical is not None
    below, above = (modes(rig, critical + d) for d in (-1e-3, 1e-3))
    assert min(mode.damping for mode in below) > 0
    worst = min(above, key=lambda mode: mode.damping)
    assert -1e-3 < worst.damping < 0
    assert worst.eigenvalue.imag > 0.1


def test_articulation_at_very_low_speed() -> None:
    """At very low speed no axle slips: the articulation angle follows from the hitch overhang and L_2."""
    steer = 0.03
    overhang, trailer_wheelbase = HITCH - REAR, 0.3 + 6.8
    state = steady_state(truck_and_trailer(), 0.05, [steer], roll=True)
    assert state["articulation.trailer"] == pytest.approx((overhang - trailer_wheelbase) * steer / WHEELBASE, rel=1e-4)
    assert state["yaw_rate.trailer"] == pytest.approx(0.05 * steer / WHEELBASE, rel=1e-4)


@pytest.mark.parametrize("roll", [True, False])
def test_modes(roll: bool) -> None:
    """The free response of each mode decays with its frequency and damping."""
    A = matrices(ARTICLE, 24.4, roll=roll).A
    result = modes(ARTICLE, 24.4, roll=roll)
    assert sum(2 if mode.eigenvalue.imag else 1 for mode in result) == len(A)
    assert list(result) == sorted(result, key=lambda mode: mode.frequency)
    for mode in result:
        assert np.abs(mode.shape).max() == pytest.approx(1)
        w, d = 2 * np.pi * mode.frequency, mode.damping
        if mode.eigenvalue.imag:
            period = 2 * np.pi / (w * np.sqrt(1 - d**2))
            decay = np.exp(-2 * np.pi * d / np.sqrt(1 - d**2))
        else:
            period, decay = 1 / w, np.exp(-d)
        start = mode.shape.real
        assert expm(A * period) @ start == pytest.approx(decay * start, abs=1e-9)


def test_rearward_amplification() -> None:
    """v' + u r of the trailer over that of the tractor; v of the trailer by the velocity of the coupling."""
    speed, frequency = 24.4, 0.4
    gain, frequency_of_gain = rearward_amplification(ARTICLE, speed, np.array([frequency]))
    assert frequency_of_gain == frequency
    names = matrices(ARTICLE, speed, roll=True).states
    response = frequency_response(ARTICLE, speed, np.array([frequency]), roll=True)[0, :, 0]
    x = dict(zip(names, response, strict=True))
    tractor, trailer = ARTICLE.units
    wheel, s = ARTICLE.couplings[0], 2j * np.pi * frequency
    v = x["lateral_velocity.tractor"]
    behind = v + (wheel.leading_position - tractor.cog) * x["yaw_rate.tractor"]
    behind -= speed * x["articulation.semitrailer"]
    behind -= (wheel.trailing_position - trailer.cog) * x["yaw_rate.semitrailer"]
    behind -= (wheel.height - tractor.roll_axis_height) * x["roll_rate.tractor"]
    behind += (wheel.height - trailer.roll_axis_height) * x["roll_rate.semitrailer"]
    expected = (s * behind + speed * x["yaw_rate.semitrailer"]) / (s * v + speed * x["yaw_rate.tractor"])
    assert gain == pytest.approx(abs(expected), rel=1e-4)
    largest, at = rearward_amplification(ARTICLE, speed)
    assert 0.2 < at < 0.6
    for other in (at - 0.02, at + 0.02):
        assert 1 < rearward_amplification(ARTICLE, speed, np.array([other]))[0] < largest


SPEED = 20.0
FREQUENCY = np.array([0.0, 0.1, 0.7, 2.0, 9.0])
SINGLE_TRACK = (
    "yaw_rate.truck",
    "cog_acceleration.truck",
    "sideslip.truck",
    "lateral_force.truck.rear",
    "slip_angle.truck.front",
)


def single_track(s: np.ndarray) -> np.ndarray:
    """Transfer functions of `SINGLE_TRACK` by the textbook's polynomials (f, 5)."""
    vehicle = truck().units[0]
    m, inertia, a, b, u = vehicle.mass, vehicle.yaw_inertia, FRONT - COG, COG - REAR, SPEED
    front, rear = (group.cornering_stiffness for group in vehicle.axle_groups)
    spring = front * rear * WHEELBASE
    damping = ((front + rear) / m + (a**2 * front + b**2 * rear) / inertia) / u
    stiffness = spring * WHEELBASE / (m * inertia * u**2) + (b * rear - a * front) / inertia
    poles = s**2 + damping * s + stiffness
    yaw_rate = (a * front / inertia * s + spring / (m * inertia * u)) / poles
    acceleration = (front / m * s**2 + spring * b / (m * inertia * u) * s + spring / (m * inertia)) / poles
    sideslip = (front / (m * u) * s + spring * b / (m * inertia * u**2) - a * front / inertia) / poles
    rear_force = rear * (b * yaw_rate / u - sideslip)
    return np.stack([yaw_rate, acceleration, sideslip, rear_force, 1 - sideslip - a * yaw_rate / u], axis=1)


def test_single_track_model_in_closed_form() -> None:
    system = linear_system(truck(), SPEED, SINGLE_TRACK, roll=False)
    response = system.frequency_response(FREQUENCY)[:, :, 0]
    assert response == pytest.approx(single_track(2j * np.pi * FREQUENCY), rel=1e-9)
    assert system.gain()[:, 0] == pytest.approx(single_track(np.zeros(1))[0], rel=1e-9)


def test_load_transfer_balances_the_roll_moment_of_a_steady_turn() -> None:
    """About the ground: the unit's inertia at the roll axis, and the sprung body's inertia and weight above it."""
    groups = ("front", "rear")
    outputs = [f"{q}.truck.{g}" for q in ("load_transfer_moment", "lateral_force") for g in groups]
    gain = linear_system(truck(), SPEED, ["cog_acceleration.truck", "roll.truck", *outputs]).gain()[:, 0]
    acceleration, roll, front, rear, front_force, rear_force = gain
    unit = truck().units[0]
    above = unit.sprung.mass * (unit.sprung.cog_height - unit.roll_axis_height)
    moment = unit.mass * acceleration * unit.roll_axis_height + above * (acceleration + G * roll)
    assert front + rear == pytest.approx(moment, rel=1e-9)
    assert front_force + rear_force == pytest.approx(unit.mass * acceleration, rel=1e-9)
    assert front > 0  # a left turn loads the right wheels


def test_step_equals_the_response() -> None:
    states = dynamics.state_names(ARTICLE, roll=True)
    system, time = linear_system(ARTICLE, SPEED, states), np.arange(0, 1, 0.05)
    steer = np.random.default_rng(0).normal(size=(len(time), len(system.inputs)))
    F, G, H = system.step(0.05)
    response = system.response(time, dict(zip(system.inputs, steer.T, strict=True)))
    x = np.zeros(len(states))
    for before, after in pairwise(steer):
        x = F @ x + G @ before + H @ after
    assert x == pytest.approx([response[name][-1] for name in states], rel=1e-8)


def test_states_are_outputs_with_names_and_units() -> None:
    states = dynamics.state_names(ARTICLE, roll=True)
    system = linear_system(ARTICLE, SPEED, states)
    m = dynamics.matrices(ARTICLE, SPEED, roll=True)
    assert pytest.approx(m.A) == system.A
    assert pytest.approx(m.B) == system.B
    assert np.array_equal(system.C, np.eye(len(states)))
    assert not system.D.any()
    assert system.inputs == ARTICLE.steer_signals()
    assert not any(name.startswith("roll") for name in linear_system(ARTICLE, SPEED, roll=False).outputs)
    units = linear_system(ARTICLE, SPEED, ["load_transfer_moment.semitrailer", "slip_angle.tractor.drive"]).units
    assert units["load_transfer_moment.semitrailer"] == "N m"
    assert units["slip_angle.tractor.drive"] == units["steer.tractor.front"] == "rad"


@pytest.mark.parametrize(
    ("output", "roll", "message"),
    [
        ("yaw_rat.tractor", True, "did you mean 'yaw_rate'"),
        ("yaw_rate.dolly", True, "no unit 'dolly'"),
        ("articulation.tractor", True, "first unit"),
        ("coupling_force.tractor", True, "first unit"),
        ("cog_acceleration.dolly", True, "cog_acceleration.dolly"),
        ("lateral_force.semitrailer.axle", True, "no axle group"),
        ("load_transfer_moment.semitrailer", False, "yaw-only"),
        ("roll.tractor", False, "yaw-only"),
    ],
)
def test_an_output_that_the_model_does_not_have(output: str, roll: bool, message: str) -> None:
    with pytest.raises(SignalError, match=message):
        linear_system(ARTICLE, SPEED, [output], roll=roll)
    with pytest.raises(KeyError, match="colour"):
        dynamics.model(ARTICLE, (), roll=True, free=("tractor.colour",))


def test_other_errors() -> None:
    for compute in (lambda: linear_system(ARTICLE, 0.0), lambda: matrices(ARTICLE, 0.0, roll=True)):
        with pytest.raises(VehicleError, match="above 0"):
            compute()
    with pytest.raises(SignalError, match="did you mean"):
        linear_system(ARTICLE, SPEED).response(np.arange(3.0), {"steer.tractor.fron": np.zeros(3)})


def test_python_control_gets_names_without_dots(monkeypatch: pytest.MonkeyPatch) -> None:
    """python-control raises for a signal name with a dot; this holds without it installed."""
    seen: dict[str, object] = {}
    stub = SimpleNamespace(ss=lambda *matrices, **names: seen.update(names, matrices=matrices))
    monkeypatch.setitem(sys.modules, "control", stub)
    system = linear_system(get("cheng_cebon_2011"), SPEED)
    system.to_control()
    assert seen["inputs"][0] == "steer_tractor_front"
    assert not [name for key in ("inputs", "states", "outputs") for name in seen[key] if "." in name]
    monkeypatch.setitem(sys.modules, "control", None)
    with pytest.raises(FifthwheelError, match="pip install"):
        system.to_control()


def test_python_control_computes_the_same_response() -> None:
    control = pytest.importorskip("control")
    system = linear_system(ARTICLE, SPEED)
    response = control.frequency_response(system.to_control(), 2 * np.pi * FREQUENCY[1:])
    expected = np.moveaxis(system.frequency_response(FREQUENCY[1:]), 0, -1)
    assert response.frdata == pytest.approx(expected, rel=1e-6)
