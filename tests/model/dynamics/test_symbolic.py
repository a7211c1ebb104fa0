"""Derivatives through intermediate variables, and those of the models that have them."""

from itertools import pairwise

import casadi as ca
import numpy as np
import pytest
from scipy.linalg import expm

from fifthwheel.model import dynamics
from fifthwheel.model.dynamics.symbolic import MotionAhead, Stages
from fifthwheel.truck import get

X = ca.SX.sym("x", 3)
POINT = np.array([0.3, -0.7, 1.1])
RATES = np.array([0.5, 0.2, -0.4])


def value(expression: ca.SX) -> np.ndarray:
    """At the point."""
    return np.array(ca.Function("value", [X], [ca.densify(expression)])(POINT))


def test_derivatives_of_a_held_variable_are_neglected() -> None:
    stages = Stages()
    b = stages.held(ca.sin(X[1]))
    expression = b * X[0]
    np.testing.assert_allclose(value(stages.expanded(expression)), [[np.sin(POINT[1]) * POINT[0]]])
    np.testing.assert_allclose(value(stages.jacobian(expression, X)), [[np.sin(POINT[1]), 0.0, 0.0]])
    rate = stages.expanded(stages.rate(X, ca.SX(RATES))(expression))
    np.testing.assert_allclose(value(rate), [[np.sin(POINT[1]) * RATES[0]]])


@pytest.mark.slow
def test_the_model_with_saturating_tyres() -> None:
    """Its Jacobians are the differences of rates and outputs, while it brakes, without loads by the pull."""
    truck, steer = get("cheng_cebon_2011"), "steer.tractor.front.offset"
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


@pytest.mark.parametrize("horizon", [0.3, 0.9])
def test_prediction_of_a_truck(horizon: float) -> None:
    """Within 4 % of the steady values, though the slip angles of the tyres follow within 0.02 s; trailer 1.5 %."""
    truck = get("cheng_cebon_2011").replace({"semitrailer.payload.height": 2.4})
    outputs = [f"load_transfer_moment.{path}" for path in truck.axle_loads()]
    system = dynamics.linear_system(truck, 22.0, outputs, roll=True)
    A, rate, n = system.A, system.B[:, 0] * 0.03, len(system.A)
    together = expm(np.block([[A, rate[:, None]], [np.zeros((1, n + 1))]]) * horizon)
    prediction = MotionAhead(ca.SX(A), horizon)
    actual = np.array([value(prediction.rows(ca.SX(row[None, :]))[0]).ravel() @ rate for row in system.C])
    change = value(prediction.change(prediction.stages(ca.SX(rate)))).ravel()
    np.testing.assert_allclose(system.C @ change, actual, rtol=1e-9)
    error = np.abs(actual - system.C @ together[:n, n]) / np.abs(system.C @ np.linalg.solve(A, rate))
    assert error.max() < 0.04
    assert error[-1] < 0.015


@pytest.mark.slow
def test_gradients_of_predicted_ratios_neglect_nothing() -> None:
    """With softening tyres, whose linearised motion depends on the state."""
    truck = get("cheng_cebon_2011")
    free = ("semitrailer.cornering_stiffness", "semitrailer.sprung.mass", "semitrailer.softening", "tractor.cog")
    outputs = [f"predicted_load_transfer.{path}" for path in truck.axle_loads()]
    model = dynamics.model(truck, outputs, roll=True, free=free, braking=True)
    values = dynamics.all_parameters(truck, outputs) | {f"{path}.softening": 2.0 for path in truck.group_paths()}
    n, n_d, *_ = model.sizes
    x, p, c = np.linspace(-0.04, 0.06, n), model.free_values(values), model.known_values(values)
    d = np.tile([20.0, *np.linspace(0.03, 0.01, n_d // 2 - 2), 0.2], 2)
    symbols = [ca.SX.sym(name, size) for name, size in zip("xp", (n, len(free)), strict=True)]
    by = ca.jacobian(model.observation(symbols[0], d, symbols[1], c), ca.vertcat(*symbols))
    expected = np.array(ca.Function("by", symbols, [by])(x, p))
    np.testing.assert_allclose(value(model.observation_gradients(x, d, p, c)), expected, rtol=1e-9, atol=1e-12)
    neglecting = value(model.observation_sensitivity(x, d, p, c))
    assert (np.abs(neglecting / expected[:, n:] - 1) > 0.01).any()


@pytest.mark.slow
def test_long_steps_of_the_truck_agree_with_short_ones() -> None:
    """From a state far from equilibrium, whose side forces begin at 0: as many short steps."""
    truck = get("cheng_cebon_2011")
    states = {}
    for long_steps, parts in ((True, 4), (False, 64)):
        model = dynamics.model(truck, (), roll=True, tyres="saturating", long_steps=long_steps)
        c = model.known_values(dynamics.all_parameters(truck, (), tyres="saturating"))
        x = np.zeros(len(model.states))
        x[[model.states.index(name) for name in ("lateral_velocity.tractor", "yaw_rate.tractor")]] = -0.1, 0.08
        steers = np.linspace(0.02, 0.022, parts + 1)
        others = np.zeros(len(model.inputs) - 2)
        for first, last in pairwise(steers):
            d = np.r_[22.0, first, others, 22.0, last, others]
            x = np.array(model.transition(x, 0.04 / parts, d, [], c)).ravel()
        states[long_steps] = dict(zip(model.states, x, strict=True))
    for name in ("yaw_rate.tractor", "yaw_rate.semitrailer", "roll_rate.tractor", "roll_rate.semitrailer"):
        assert states[True][name] == pytest.approx(states[False][name], abs=1e-5)
    assert abs(states[False]["roll_rate.tractor"]) > 0.04, "the truck moves in the step"
