"""Self-steering, command-steered and raised axles in the linear model and in the one with rotations."""

import casadi as ca
import numpy as np
import pytest

from fifthwheel.model import dynamics
from fifthwheel.model.dynamics import frequency_response, matrices
from fifthwheel.model.dynamics.large_angles import large_angles
from fifthwheel.model.dynamics.tyres import LAWS, saturation_parameters
from fifthwheel.results.assess.low_speed_turn import equivalent_axle, measure, turn
from fifthwheel.results.assess.truck import Truck
from fifthwheel.truck import Axle, Vehicle, get
from tests.model.dynamics.test_large_angles import LINEAR
from tests.model.dynamics.test_unit_equations import FREQUENCY, group, truck
from tests.results.assess.trucks import single_axles

SPEED = 20.0
SELF_STEERING = {"self_steering": 0.8}
COMMAND = {"command_steering": 0.3}
LIFTED = {"lifted": True}
STIFFNESS = "semitrailer.cornering_stiffness"


def with_axle(keys: dict[str, object], i: int = -1, name: str = "cheng_cebon_2011") -> Vehicle:
    """A truck of the catalogue with fixed trailer axles, one of them with other keys."""
    fields = get(name).model_dump()
    axles = fields["units"][-1]["axle_groups"][0]["axles"]
    for axle in axles:
        axle["steerable"] = False
    axles[i].update(keys)
    return Vehicle(**fields)


def single(**keys: object) -> Vehicle:
    """The truck with single axles and other keys of that of the trailer, 8 m behind the kingpin."""
    fields = single_axles().model_dump()
    fields["units"][1]["axle_groups"][0]["axles"][0].update(keys)
    return Vehicle(**fields)


def test_understeer_gradient_with_a_castor_axle():
    """m (b / C_f - a / ((1 - s) C_r)) / L of a truck with its CoG a = 4 m behind the front and b = 2 m ahead."""
    axle = Axle(name="rear", position=-6.0, self_steering=0.25)
    vehicle = truck(group("front", Axle(name="front", position=0.0, steerable=True)), group("rear", axle))
    expected = 14000 * (2.0 / 4e5 - 4.0 / (0.75 * 4e5)) / 6.0
    assert dynamics.understeer_gradient(vehicle) == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("trail", [None, 0.05])
def test_a_single_castor_axle_is_one_with_softer_tyres(trail: float | None):
    soft = single().replace({"semitrailer.cornering_stiffness": 0.2 * get("cheng_cebon_2011").parameters()[STIFFNESS]})
    castor = single(**SELF_STEERING)
    fields = [v.model_dump() for v in (soft, castor)]
    for each in fields:
        each["units"][1]["axle_groups"][0]["pneumatic_trail"] = trail
    A, B = (matrices(Vehicle(**each), SPEED, roll=True).A for each in fields)
    assert pytest.approx(A, rel=1e-12, abs=1e-12) == B


def test_castor_axle_in_a_group_has_its_fraction_of_the_side_force():
    """Newton's law: C / 2 (alpha_1 + (1 - s) alpha_2), the mean with the lag and the difference without it."""
    axles = Axle(name="a", position=-5.0), Axle(name="b", position=-7.0, **SELF_STEERING)
    front = group("front", Axle(name="front", position=0.0, steerable=True))
    vehicle = truck(front, group("rear", *axles, sigma=0.6))
    v, r, lagged = frequency_response(vehicle, SPEED, FREQUENCY, roll=False)[:, :, 0].T
    s = 2j * np.pi * FREQUENCY
    of_front = 4e5 * (1 - (v + 4.0 * r) / SPEED)
    slips = -(v - 1.0 * r) / SPEED, -0.2 * (v - 3.0 * r) / SPEED
    mean = sum(slips) / 2
    length = dynamics.unit_equations.relaxation_length(vehicle.parameters(), vehicle.units[0], "truck.rear")
    assert lagged == pytest.approx(mean / (1 + s * length / SPEED), rel=1e-9)
    assert 14000 * (s * v + SPEED * r) - of_front == pytest.approx(4e5 * lagged, rel=1e-8)
    couple = 2e5 * (-1.0 * (slips[0] - mean) - 3.0 * (slips[1] - mean))
    assert 6e4 * s * r - 4.0 * of_front == pytest.approx(couple - 2.0 * 4e5 * lagged, rel=1e-8)


@pytest.mark.parametrize("k", [0.3, -0.2])
def test_articulation_in_a_slow_bend_with_command_steering(k: float):
    """At the coupling, e = 0.6 m ahead of the drive axle, the trailer moves by e r - u g to the left; at its axle, L =
    8 m further back, by (e - L) r - u g. It rolls in the direction of its wheels, k g: g = (e - L) / ((1 + k) R)."""
    response = frequency_response(single(command_steering=k), 0.05, np.array([1e-7]), roll=False)
    states = matrices(single(command_steering=k), 0.05, roll=False).states
    x = dict(zip(states, response[0, :, 0], strict=True))
    curvature = x["yaw_rate.tractor"] / 0.05
    assert x["articulation.semitrailer"] / curvature == pytest.approx((0.6 - 8.0) / (1 + k), rel=1e-3)


def test_wheels_of_command_steering_roll_without_slip_in_the_low_speed_turn():
    truck = Truck(vehicle=single(**COMMAND))
    run = turn(truck)
    assert np.abs(run.slips).max() < 1e-12
    articulation = run.headings[:, 1] - run.headings[:, 0]
    axle = run.origins[:, 1] - 8.0 * np.exp(1j * run.headings[:, 1])
    direction = run.headings[:, 1] + 0.3 * articulation
    moved = np.diff(axle) * np.exp(-0.5j * (direction[1:] + direction[:-1]))
    assert np.abs(moved.imag / moved.real).max() < 1e-3
    assert measure(truck)["swept_path"] < measure(Truck(vehicle=single()))["swept_path"] - 0.3


def test_low_speed_turn_of_castor_and_raised_axles():
    castor, lifted = (with_axle(keys).units[1] for keys in (SELF_STEERING, LIFTED))
    assert equivalent_axle(castor, 0.0)[0] == pytest.approx((6.7**2 + 8.0**2 + 0.2 * 9.3**2) / (14.7 + 0.2 * 9.3))
    assert equivalent_axle(lifted, 0.0)[0] == pytest.approx((6.7**2 + 8.0**2) / 14.7)
    demands = [measure(Truck(vehicle=with_axle(keys)))["friction_demand"] for keys in ({}, SELF_STEERING)]
    assert demands[1] < 0.7 * demands[0]


def test_a_raised_axle_is_one_that_is_not_in_the_file():
    fields = with_axle({}).model_dump()
    group = fields["units"][1]["axle_groups"][0]
    group["axles"] = group["axles"][:2]
    without, lifted = (matrices(v, SPEED, roll=True).A for v in (Vehicle(**fields), with_axle(LIFTED)))
    assert np.array_equal(without, lifted)


@pytest.mark.slow
@pytest.mark.parametrize("keys", [SELF_STEERING, COMMAND, LIFTED])
def test_large_angles_tend_to_the_linear_model(keys: dict[str, object]):
    vehicle = with_axle(keys)
    m = matrices(vehicle, SPEED, roll=True)
    rng = np.random.default_rng(3)
    x = 1e-5 * rng.normal(size=len(m.states))
    p = {k: ca.SX(v) for k, v in (vehicle.parameters() | saturation_parameters(vehicle) | LINEAR).items()}
    steer = {n: ca.SX(0) for n in vehicle.steer_signals()}
    for law in LAWS.values():
        state = ca.SX.sym("x", len(x))
        motion = large_angles(p, vehicle, state, ca.SX(SPEED), steer, roll=True, law=law)
        rates = ca.Function("rates", [state], [motion.stages.expanded(motion.rates)])(x).full()[:, 0]
        assert rates == pytest.approx(m.A @ x, rel=1e-5, abs=1e-9)


def test_a_fraction_of_0_changes_nothing():
    for keys in ({"self_steering": 0.0}, {"command_steering": 0.0}):
        plain, zero = (matrices(v, SPEED, roll=True).A for v in (with_axle({}), with_axle(keys)))
        assert pytest.approx(plain, rel=1e-12, abs=1e-12) == zero
