"""Steer angles from measured ones, and the reverse; own equations against filtered angles and closed forms."""

import casadi as ca
import numpy as np
import pytest

from fifthwheel.data import channels
from fifthwheel.model import dynamics
from fifthwheel.model.dynamics.simulation import free_response
from fifthwheel.model.dynamics.state_space import linear_system
from fifthwheel.truck import get

STEER, STATE, LAG = "steer.tractor.front", "actuator.tractor", 0.15
ERRORS = {f"{STEER}.gain": 1.1, f"{STEER}.offset": 0.003, f"{STEER}.delay": 0.05, f"{STEER}.play": 0.004}
MEASURED = np.linspace(-0.2, 0.3, 7)


def test_angle_of_a_sensor_and_its_inverse() -> None:
    """Gain times what is measured beyond the offset, by numbers and by symbols, which have every error but two."""
    found = dynamics.steer_angle(STEER, MEASURED, ERRORS)
    np.testing.assert_allclose(found.angle, 1.1 * (MEASURED - 0.003), atol=1e-16)
    np.testing.assert_allclose(found.slope, np.full(7, 1.1))
    np.testing.assert_allclose(dynamics.measured_angle(STEER, found.angle, ERRORS), MEASURED, atol=1e-15)
    assert dynamics.steer_angle(STEER, 0.1, {}) == (0.1, 1.0)
    measured = ca.SX.sym("measured")
    symbolic = ca.Function("angle", [measured], [dynamics.true_angles([STEER], measured, ERRORS)])
    np.testing.assert_array_equal(np.array(symbolic(MEASURED[None])).ravel(), found.angle)
    errors = {error.kind: ca.SX.sym(error.kind) for error in channels.STEER.errors}
    used = {str(symbol) for symbol in ca.symvar(channels.STEER.true_value(measured, errors))}
    assert used == {"measured", *errors} - {"delay", "play"}


OUTPUTS = ("yaw_rate.tractor", "yaw_rate.semitrailer", "roll.semitrailer", "lateral_acceleration.tractor")
TRUCK = get("cheng_cebon_2011").with_logged_steering([STEER], "the test")
REAR = tuple(f"steer.semitrailer.{axle}" for axle in ("front", "middle", "rear"))


def lag(steer, states, motion, p):
    return {STEER: states[STATE]}, {STATE: (steer[STEER] - states[STATE]) / p["lag"]}


def roll_steer(steer, states, motion, p):
    return dict.fromkeys(REAR, p["coefficient"] * motion["roll.semitrailer"]), {}


def by_articulation(steer, states, motion, p):
    return dict.fromkeys(REAR, p["fraction"] * motion["articulation.semitrailer"]), {}


def stiff_stop(steer, states, motion, p):
    """A lag with a stop, which is not linear, and a gain that falls with the speed."""
    z = states[STATE]
    return {STEER: p["stop"] * ca.tanh(z / p["stop"])}, {STATE: 20 / motion["speed"] * (steer[STEER] - z) / p["lag"]}


LAGGED = TRUCK.with_steering(lag, states={STATE: "0.01 rad"}, parameters={"lag": f"{LAG} s"})
STOPPED = TRUCK.with_steering(
    stiff_stop, states={STATE: "0.01 rad"}, parameters={"lag": f"{LAG} s", "stop": "0.02 rad"}
)


def response(truck, tyres, steer, time, outputs=OUTPUTS):
    model = dynamics.model(truck, outputs, roll=True, tyres=tyres)
    values = dynamics.all_parameters(truck, outputs, tyres=tyres)
    return free_response(model, values, time, {"speed": np.full_like(time, 22.0), STEER: steer})[1]


def test_the_frequency_response_has_the_lag_as_a_factor() -> None:
    frequency = np.array([0.05, 0.3, 1.0, 3.0])
    own, plain = (linear_system(truck, 22.0, OUTPUTS) for truck in (LAGGED, TRUCK))
    factor = 1 / (1 + 2j * np.pi * frequency * LAG)
    expected = plain.frequency_response(frequency) * factor[:, None, None]
    assert own.frequency_response(frequency) == pytest.approx(expected, rel=1e-9)
    assert sorted(own.eigenvalues.real)[0] == pytest.approx(sorted([*plain.eigenvalues.real, -1 / LAG])[0])
    assert STATE in own.states


@pytest.mark.slow
def test_steering_by_the_articulation_is_command_steering() -> None:
    """The built-in law of command-steered axles is an independent implementation."""
    fields = TRUCK.model_dump()
    axles = [dict(axle, command_steering=0.3) for axle in fields["units"][1]["axle_groups"][0]["axles"]]
    group = dict(fields["units"][1]["axle_groups"][0], axles=axles)
    trailer = dict(fields["units"][1], axle_groups=(group,))
    built_in = type(TRUCK)(**fields | {"units": (fields["units"][0], trailer)})
    own = TRUCK.with_steering(by_articulation, parameters={"fraction": "0.3"})
    time = np.arange(0, 6, 0.01)
    steer = 0.02 * np.sin(2 * np.pi * 0.3 * time)
    a, b = (response(truck, "saturating", steer, time) for truck in (own, built_in))
    assert a == pytest.approx(b, rel=1e-9, abs=1e-12)
    for roll in (True, False):
        a, b = (dynamics.matrices(truck, 22.0, roll=roll) for truck in (own, built_in))
        np.testing.assert_allclose(a.A, b.A, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(a.F, b.F, rtol=1e-9, atol=1e-6)


def test_roll_steer_adds_a_column_to_the_matrices() -> None:
    """x' = A x + k B_w roll, with the B of three steered axles."""
    k, steered = 0.1, get("cheng_cebon_2011").with_logged_steering([STEER, *REAR], "the test")
    own = dynamics.matrices(TRUCK.with_steering(roll_steer, parameters={"coefficient": f"{k}"}), 22.0, roll=True)
    plain, all_steered = (dynamics.matrices(truck, 22.0, roll=True) for truck in (TRUCK, steered))
    expected = plain.A.copy()
    expected[:, plain.states.index("roll.semitrailer")] += k * all_steered.B[:, 1:].sum(axis=1)
    np.testing.assert_allclose(own.A, expected, rtol=1e-9, atol=1e-9)
    yaw = [dynamics.matrices(truck, 22.0, roll=False).A for truck in (own_truck(), TRUCK)]
    assert yaw[0] == pytest.approx(yaw[1])  # roll is 0 there


def own_truck():
    return TRUCK.with_steering(roll_steer, parameters={"coefficient": "0.1"})


def test_other_equations_have_another_model() -> None:
    trucks = (TRUCK, LAGGED, STOPPED, own_truck())
    assert len({dynamics.model(truck, OUTPUTS, roll=True).identity for truck in trucks}) == len(trucks)
    assert dynamics.model(LAGGED, OUTPUTS, roll=True) is dynamics.model(
        LAGGED.replace({"steering.lag": 0.3}), OUTPUTS, roll=True
    )
