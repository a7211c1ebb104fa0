"""The rates at both ends of a step against the step."""

import casadi as ca
import numpy as np
import pytest

from fifthwheel import truck as vehicle
from fifthwheel.model import dynamics
from fifthwheel.model.dynamics import ChainModel
from fifthwheel.model.dynamics.tyres import Tyres

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


@pytest.mark.parametrize("tyres", ["linear", "saturating"])
def test_sensitivities_of_the_rates_are_their_derivatives(tyres: Tyres) -> None:
    """Without those of the inverse mass matrix; of an extended model, whose stiffness depends on the slip."""
    truck = vehicle.get("cheng_cebon_2011").with_logged_steering({"steer.tractor.front"}, "the test")
    free = (*FREE, "tractor.mass", "tractor.cog", "semitrailer.yaw_inertia")
    free += ("tractor.front.softening",) if tyres == "linear" else ()
    model = dynamics.model(truck, OUTPUTS, roll=True, bank=True, free=free, extended=True, tyres=tyres)
    values = dynamics.all_parameters(truck, OUTPUTS, extended=True, tyres=tyres) | {"tractor.front.softening": 2.0}
    n, k = len(model.states), 2 * len(model.inputs)
    d, rng = np.zeros(k), np.random.default_rng(2)
    d[[0, k // 2]], d[[1, k // 2 + 1]] = (20.0, 20.5), (0.01, 0.012)
    symbols = [ca.SX.sym("a", size) for size in (n, n, 1, k, len(free), len(model.known))]
    exact = ca.Function("exact", symbols, [ca.jacobian(rate, symbols[4]) for rate in model.rates(*symbols)])
    at = 0.02 * rng.normal(size=n), 0.02 * rng.normal(size=n), 0.01, d, model.free_values(values)
    for actual, expected in zip(
        model.rate_sensitivities(*at, model.known_values(values)), exact(*at, model.known_values(values)), strict=True
    ):
        size = np.abs(np.array(expected)).max(axis=0) + 1e-12
        np.testing.assert_allclose(np.array(actual) / size, np.array(expected) / size, atol=1e-10)
