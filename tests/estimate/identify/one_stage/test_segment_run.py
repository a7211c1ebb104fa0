"""Derivatives of the initial state against differences of the steady state."""

import numpy as np
import pytest

from fifthwheel.estimate.filters.initial_state import bank_effect, steady_initial_state
from fifthwheel.model import dynamics
from fifthwheel.model.dynamics.simulation import free_response
from fifthwheel.truck import Vehicle

OUTPUTS = ("yaw_rate.tractor", "yaw_rate.semitrailer")


@pytest.mark.parametrize("roll", [False, True])
def test_steady_state_on_a_banked_road(truck: Vehicle, roll: bool) -> None:
    """It is the end of a long response, and linear in the bank."""
    time, inputs = np.arange(4000) / 100, {"speed": 22.0, "steer.tractor.front": 0.01}
    steered = truck.with_logged_steering(inputs, "inputs")
    model = dynamics.model(steered, OUTPUTS, roll=roll, bank=True)
    values = dynamics.all_parameters(steered, OUTPUTS)
    constant = {name: np.full_like(time, value) for name, value in inputs.items()}
    level, banked = (
        np.append(steady_initial_state(steered, inputs, {}, roll=roll, bank=bank)[0], bank) for bank in (0.0, 0.05)
    )
    start = np.eye(len(level))[-1] * 0.05
    after_long, constantly = (free_response(model, values, time, constant, x0)[1] for x0 in (start, banked))
    np.testing.assert_allclose(after_long[-1], constantly[0], rtol=1e-4)
    np.testing.assert_allclose(constantly[-1], constantly[0], rtol=1e-6)
    slope = bank_effect(steady_initial_state(steered, inputs, {}, roll=roll)[1])
    np.testing.assert_allclose(banked - level, 0.05 * slope, atol=1e-12)
    assert slope[-1] == 1
    assert slope[list(model.states).index("lateral_velocity.tractor")] != 0
