"""The state-space system against the single-track model in closed form, balances of forces, and the simulation."""

import sys
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest

from fifthwheel.base.errors import FifthwheelError, SignalError, VehicleError
from fifthwheel.model import dynamics
from fifthwheel.model.dynamics import linear_system
from fifthwheel.model.dynamics.simulation import free_response
from fifthwheel.truck import get
from tests.model.dynamics.test_analysis import ARTICLE, COG, FRONT, REAR, WHEELBASE, G, truck

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


@pytest.mark.parametrize("relaxation", [0.0, 0.5])
@pytest.mark.parametrize("roll", [True, False])
def test_response_equals_the_simulation(relaxation: float, roll: bool) -> None:
    groups = ("tractor.front", "tractor.drive", "semitrailer")
    vehicle = ARTICLE.replace({f"{group}.relaxation_length": relaxation for group in groups})
    time = np.arange(0, 6, 0.01)
    steer = 0.02 * np.sin(2 * np.pi * 0.4 * time) * (time < 2.5)
    outputs = [
        "sideslip.semitrailer",
        "articulation.semitrailer",
        "lateral_acceleration.semitrailer",
        "yaw_rate.tractor",
    ]
    response = linear_system(vehicle, SPEED, outputs, roll=roll).response(time, {"steer.tractor.front": steer})
    model = dynamics.model(vehicle, outputs, roll=roll)
    inputs = {name: np.zeros_like(time) for name in model.inputs} | {"speed": np.full_like(time, SPEED)}
    inputs["steer.tractor.front"] = steer
    _, expected = free_response(model, dynamics.all_parameters(vehicle, outputs), time, inputs)
    for i, name in enumerate(outputs):
        assert response[name] == pytest.approx(expected[:, i], abs=1e-6 * np.abs(expected[:, i]).max())


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


def test_states_are_outputs() -> None:
    states = dynamics.state_names(ARTICLE, roll=True)
    system = linear_system(ARTICLE, SPEED, states)
    m = dynamics.matrices(ARTICLE, SPEED, roll=True)
    assert pytest.approx(m.A) == system.A
    assert pytest.approx(m.B) == system.B
    assert np.array_equal(system.C, np.eye(len(states)))
    assert not system.D.any()


def test_names_and_units() -> None:
    system = linear_system(ARTICLE, SPEED)
    assert system.inputs == ARTICLE.steer_signals()
    assert "cog_acceleration.semitrailer" in system.outputs
    assert not any(name.startswith("roll") for name in linear_system(ARTICLE, SPEED, roll=False).outputs)
    units = linear_system(ARTICLE, SPEED, ["load_transfer_moment.semitrailer", "slip_angle.tractor.drive"]).units
    assert units["load_transfer_moment.semitrailer"] == "N m"
    assert units["slip_angle.tractor.drive"] == units["steer.tractor.front"] == "rad"
    assert units["lateral_velocity.tractor"] == "m/s"


@pytest.mark.parametrize(
    ("output", "roll", "message"),
    [
        ("yaw_rat.tractor", True, "did you mean 'yaw_rate'"),
        ("yaw_rate.dolly", True, "no unit 'dolly'"),
        ("cog_acceleration.dolly", True, "cog_acceleration.dolly"),
        ("lateral_force.semitrailer.axle", True, "no axle group"),
        ("load_transfer_moment.semitrailer", False, "yaw-only"),
        ("roll.tractor", False, "yaw-only"),
    ],
)
def test_an_output_that_the_model_does_not_have(output: str, roll: bool, message: str) -> None:
    with pytest.raises(SignalError, match=message):
        linear_system(ARTICLE, SPEED, [output], roll=roll)


def test_other_errors() -> None:
    with pytest.raises(VehicleError, match="above 0"):
        linear_system(ARTICLE, 0.0)
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
