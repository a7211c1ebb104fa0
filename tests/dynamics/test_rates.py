"""The rates at both ends of a step against the step."""

import casadi as ca
import numpy as np
import pytest

from fifthwheel import dynamics, vehicle
from fifthwheel.dynamics import ChainModel

OUTPUTS = ("yaw_rate.tractor", "roll_rate.semitrailer")
FREE = ("tractor.front.cornering_stiffness", "semitrailer.payload.height", "steer.tractor.front.delay")


@pytest.fixture(scope="module")
def model() -> ChainModel:
    truck = vehicle.get("cheng_cebon_2011").with_logged_steering({"steer.tractor.front"}, "the test")
    return dynamics.model(truck, OUTPUTS, roll=True, bank=True, free=FREE)


def test_mean_rate_is_the_slope_of_the_state(model: ChainModel) -> None:
    rng = np.random.default_rng(0)
    x, h = 0.05 * rng.normal(size=len(model.states)), 1e-5
    values = dynamics.all_parameters(model.vehicle, OUTPUTS)
    p, c, d = model.free_values(values), model.known_values(values), np.array([20.0, 0.01, 20.0, 0.01])
    later = np.array(model.transition(x, h, d, p, c)).ravel()
    first, last = (np.array(rate).ravel() for rate in model.rates(x, later, h, d, p, c))
    np.testing.assert_allclose((first + last) / 2, (later - x) / h, rtol=1e-6, atol=1e-6)


def test_trapezoidal_rule_gives_the_parameter_derivatives_of_a_step(model: ChainModel) -> None:
    symbols = [ca.SX.sym(name, model.transition.numel_in(i)) for i, name in enumerate(("x", "dt", "d", "p", "c"))]
    later = ca.SX.sym("later", len(model.states))
    exact = ca.Function("exact", symbols, [ca.jacobian(model.transition(*symbols), symbols[3])])
    rates = model.rates(symbols[0], later, *symbols[1:])
    ends = ca.Function("ends", [later, *symbols], [ca.jacobian(rate, symbols[3]) for rate in rates])
    values = dynamics.all_parameters(model.vehicle, OUTPUTS)
    x, dt, d = np.full(len(model.states), 0.02), 0.004, np.array([20.0, 0.01, 20.0, 0.012])
    p, c = model.free_values(values), model.known_values(values)
    after, F = model.transition(x, dt, d, p, c), np.array(model.state_jacobian(x, dt, d, p, c))
    first, last = (np.array(rate) for rate in ends(after, x, dt, d, p, c))
    actual, expected = dt / 2 * (F @ first + last), np.array(exact(x, dt, d, p, c))
    largest = np.abs(expected).max(axis=0)
    np.testing.assert_allclose(actual / largest, expected / largest, atol=0.01)
