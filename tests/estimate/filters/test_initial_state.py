"""The state at the first sample: equilibrium of the model, and its covariance by SciPy's Lyapunov solver."""

import numpy as np
import pytest
from scipy.linalg import solve_continuous_lyapunov

from fifthwheel.estimate.filters.initial_state import (
    initial_factor,
    initial_sigma,
    initial_state,
    random_steer_covariance,
    steady_initial_state,
)
from fifthwheel.model import dynamics
from fifthwheel.truck import get
from fifthwheel.truck.quantities import ROAD_BANK, quantity_of

TRUCK = get("cheng_cebon_2011")
STEERS = TRUCK.steer_signals()
ANGLES = np.linspace(0.012, 0.003, len(STEERS))
FIRST = {"speed": 22.0, **dict(zip(STEERS, ANGLES, strict=True))}


@pytest.mark.parametrize("roll", [False, True])
def test_the_steady_state_does_not_change(roll):
    """By the equations of motion with the true steer angles, which are gain times (measured - offset)."""
    errors = {f"{STEERS[0]}.gain": 1.1, f"{STEERS[0]}.offset": 0.002, f"{STEERS[-1]}.offset": -0.001}
    wheels = ANGLES.copy()
    wheels[-1] += 0.001
    wheels[0] = 1.1 * (wheels[0] - 0.002)
    changed = {"tractor.front.cornering_stiffness": 4e5}
    x, m = steady_initial_state(TRUCK, FIRST, errors | changed, roll=roll)
    np.testing.assert_allclose(m.A, dynamics.matrices(TRUCK.replace(changed), 22.0, roll=roll, bank=True).A)
    expected = dynamics.matrices(TRUCK.replace(changed), 22.0, roll=roll)
    rate = expected.A @ x + expected.B @ wheels
    np.testing.assert_allclose(rate, 0.0, atol=1e-12)
    assert np.abs(x).max() > 0.01


def test_an_unstable_vehicle_starts_at_zero():
    stiffness = TRUCK.parameters()["tractor.drive.cornering_stiffness"]
    unstable = TRUCK.replace({"tractor.drive.cornering_stiffness": 0.15 * stiffness})
    x, m = steady_initial_state(unstable, FIRST, {}, roll=False)
    assert np.linalg.eigvals(m.A).real.max() > 0
    assert not x.any()
    assert not random_steer_covariance(m).any()


@pytest.mark.parametrize("roll", [False, True])
@pytest.mark.parametrize("speed", [6.0, 25.0])
def test_the_covariance_under_random_steering(roll, speed):
    """White noise through a first-order low-pass of 0.4 Hz with variance 1, then the vehicle."""
    m = dynamics.matrices(TRUCK, speed, roll=roll)
    with_bank = dynamics.matrices(TRUCK, speed, roll=roll, bank=True)
    n, rate = len(m.A), 2 * np.pi * 0.4
    A = np.block([[m.A, m.B[:, :1]], [np.zeros((1, n)), np.full((1, 1), -rate)]])
    Q = np.zeros((n + 1, n + 1))
    Q[n, n] = 2 * rate
    P = solve_continuous_lyapunov(A, -Q)
    assert P[n, n] == pytest.approx(1.0)
    scale = np.sqrt(np.diag(P)[:n])
    actual = random_steer_covariance(with_bank) / np.outer(scale, scale)
    np.testing.assert_allclose(actual, P[:n, :n] / np.outer(scale, scale), atol=1e-9)


@pytest.mark.parametrize("bank", [None, 0.02])
def test_the_covariance_is_that_of_steering_of_each_state_and_of_the_bank(bank):
    x, P = initial_state(TRUCK, FIRST, {}, roll=True, steer_sigma=0.01, bank=bank)
    steady, m = steady_initial_state(TRUCK, FIRST, {}, roll=True)
    n = len(steady)
    np.testing.assert_array_equal(x[:n], steady)
    floor = np.diag([initial_sigma(name) ** 2 for name in m.states[:n]])
    expected = floor + 1e-4 * random_steer_covariance(m)
    assert len(x) == len(P) == n + (bank is not None)
    if bank is not None:
        assert x[n] == 0.0
        on_bank, _ = steady_initial_state(TRUCK, FIRST, {}, roll=True, bank=bank)
        effect = np.append(on_bank - steady, bank)  # one sigma of bank moves all states to another equilibrium
        assert np.abs(effect[:n]).max() > 0.01 * bank
        expected = np.pad(expected, (0, 1)) + np.outer(effect, effect)
        factor = initial_factor(P)  # one column of it moves the bank
        np.testing.assert_allclose(factor @ factor.T, P, rtol=1e-12, atol=1e-18)
        np.testing.assert_array_equal(factor[-1] != 0, np.arange(len(P)) == n)
        assert initial_sigma("bank.road") == quantity_of(ROAD_BANK).sigma == 0.03
    np.testing.assert_allclose(P, expected, rtol=1e-9, atol=1e-12)
