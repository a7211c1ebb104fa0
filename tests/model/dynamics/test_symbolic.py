"""Derivatives through intermediate variables, and those of the models that have them."""

import casadi as ca
import numpy as np
import pytest
from scipy.linalg import expm

from fifthwheel.model import dynamics
from fifthwheel.model.dynamics.symbolic import Stages, change_ahead, factorised
from fifthwheel.truck import get

X = ca.SX.sym("x", 3)
POINT = np.array([0.3, -0.7, 1.1])
RATES = np.array([0.5, 0.2, -0.4])


def value(expression: ca.SX) -> np.ndarray:
    """At the point."""
    return np.array(ca.Function("value", [X], [ca.densify(expression)])(POINT))


def built() -> tuple[Stages, ca.SX]:
    """Stages, and an expression of their variables."""
    stages = Stages()
    a = stages.variable(ca.vertcat(ca.sin(X[0]) * X[1], X[2] ** 2))
    b = stages.variable(a[0] * a[1] + X[0])
    M = ca.vertcat(ca.horzcat(2 + a[1], b * X[1]), ca.horzcat(b * X[1], 3 + X[0] ** 2))
    right = ca.vertcat(b, a[0]) + X[1:]
    w = stages.solved(M, right, ca.solve(M, right))
    return stages, ca.vertcat(w, b * X[0], w[0] * a[1])


def test_the_jacobian_is_that_of_the_expanded_expression() -> None:
    stages, expression = built()
    expanded = stages.expanded(expression)
    assert {symbol.name() for symbol in ca.symvar(expanded)} == {"x_0", "x_1", "x_2"}
    np.testing.assert_allclose(value(stages.jacobian(expression, X)), value(ca.jacobian(expanded, X)), rtol=1e-12)


def test_rates() -> None:
    """Also their Jacobian, which goes through the rates of the variables."""
    stages, expression = built()
    expected = ca.jtimes(stages.expanded(expression), X, ca.SX(RATES))
    rate_of = stages.rate(X, ca.SX(RATES))
    rates = [rate_of(expression[i]) for i in range(expression.shape[0])]
    np.testing.assert_allclose(value(stages.expanded(ca.vertcat(*rates))), value(expected), rtol=1e-12)
    actual = stages.jacobian(ca.vertcat(*rates), X)
    np.testing.assert_allclose(value(actual), value(ca.jacobian(expected, X)), rtol=1e-11)


def test_derivatives_of_a_held_variable_are_neglected() -> None:
    stages = Stages()
    b = stages.held(ca.sin(X[1]))
    expression = b * X[0]
    np.testing.assert_allclose(value(stages.expanded(expression)), [[np.sin(POINT[1]) * POINT[0]]])
    np.testing.assert_allclose(value(stages.jacobian(expression, X)), [[np.sin(POINT[1]), 0.0, 0.0]])
    rate = stages.expanded(stages.rate(X, ca.SX(RATES))(expression))
    np.testing.assert_allclose(value(rate), [[np.sin(POINT[1]) * RATES[0]]])


@pytest.mark.parametrize("name", ["cheng_cebon_2011", "auburn_6x4"])
def test_the_model_with_saturating_tyres(name: str) -> None:
    """Its Jacobians are the differences of rates and outputs, while it brakes, without loads by the pull."""
    truck, steer = get(name), "steer.tractor.front.offset"
    outputs = [f"{quantity}.{unit.name}" for quantity in ("yaw_rate", "lateral_acceleration") for unit in truck.units]
    outputs += [f"load_transfer.{path}" for path in truck.axle_loads()]
    model = dynamics.model(truck, outputs, roll=True, bank=True, tyres="saturating", braking=True, free=[steer])
    no_shift = {f"{truck.couplings[0].name}.height": 0.0}
    c = model.known_values(dynamics.all_parameters(truck, outputs, tyres="saturating") | no_shift)
    rng, n = np.random.default_rng(1), len(model.states)
    x, p = rng.normal(size=n) * 0.03, np.array([0.01])
    d = np.array([20.0, 0.05, *[0.01] * (len(model.inputs) - 3), -1.0] * 2)

    def differences(function: ca.Function, before: list, argument: np.ndarray, after: list) -> np.ndarray:
        """Central differences."""
        step, columns = 1e-5, []
        for e in np.eye(len(argument)) * step:
            higher, lower = (np.array(function(*before, argument + s * e, *after)).ravel() for s in (1, -1))
            columns.append((higher - lower) / (2 * step))
        return np.column_stack(columns)

    def assert_close(actual: ca.DM, expected: np.ndarray) -> None:
        np.testing.assert_allclose(np.array(actual), expected, rtol=1e-6, atol=1e-7 * np.abs(expected).max())

    assert_close(model.observation_jacobian(x, d, p, c), differences(model.observation, [], x, [d, p, c]))
    assert_close(model.observation_sensitivity(x, d, p, c), differences(model.observation, [x, d], p, [c]))
    dt = 1e-9  # F = I + A dt
    A = (np.array(model.state_jacobian(x, dt, d, p, c)) - np.eye(n)) / dt
    B = np.array(model.steer_offset_exponent(x, dt, d, p, c))[:, :1] / dt

    def rates(x: np.ndarray, p: np.ndarray) -> np.ndarray:
        return np.array(model.rates(x, x, 0.01, d, p, c)[0]).ravel()

    assert_close(A, differences(rates, [], x, [p]))
    assert_close(B, differences(rates, [x], p, []))


def test_factorised() -> None:
    M = np.array([[4.0, 1.0, 0.0], [-2.0, 3.0, 1.0], [0.5, 0.0, -2.0]])
    right = np.array([[1.0, 0.0], [2.0, -1.0], [0.0, 3.0]])
    np.testing.assert_allclose(value(factorised(ca.SX(M))(ca.SX(right))), np.linalg.solve(M, right), atol=1e-14)


@pytest.mark.parametrize("horizon", [0.3, 0.6, 0.9])
def test_change_ahead_of_a_truck(horizon: float) -> None:
    """Within 4 % of the steady values, though the slip angles of the tyres follow within 0.02 s; trailer 1.5 %."""
    truck = get("cheng_cebon_2011").replace({"semitrailer.payload.height": 2.4})
    outputs = [f"load_transfer_moment.{path}" for path in truck.axle_loads()]
    system = dynamics.linear_system(truck, 22.0, outputs, roll=True)
    A, rate, n = system.A, system.B[:, 0] * 0.03, len(system.A)
    together = expm(np.block([[A, rate[:, None]], [np.zeros((1, n + 1))]]) * horizon)
    actual = np.array([(value(change_ahead(ca.SX(A), ca.SX(row[None, :]), horizon)) @ rate).item() for row in system.C])
    error = np.abs(actual - system.C @ together[:n, n]) / np.abs(system.C @ np.linalg.solve(A, rate))
    assert error.max() < 0.04
    assert error[-1] < 0.015
