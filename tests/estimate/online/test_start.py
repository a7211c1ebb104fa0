"""The derivative of the state at the start against differences of the steady state."""

import numpy as np

from fifthwheel.base.types import Array
from fifthwheel.estimate.filters.initial_state import steady_initial_state
from fifthwheel.estimate.identify.one_stage.segment_run import steady_state_slopes
from fifthwheel.estimate.identify.settings import OneStage
from fifthwheel.estimate.identify.setup import Setup
from fifthwheel.estimate.online import LearnerSettings
from fifthwheel.estimate.online.online_model import OnlineModel, model_of, online_setup
from fifthwheel.estimate.online.start import start_state
from fifthwheel.model import dynamics
from fifthwheel.truck import Vehicle

FIRST = {"speed": 21.0, "steer.tractor.front": 0.03}
SIGNALS = (*FIRST, "yaw_rate.tractor")
LINEAR = OneStage(tyres="linear")
FIVE = OneStage(given={"others": "exact", "sensors": "exact"}, tyres="linear")


def model(setup: Setup) -> OnlineModel:
    return model_of(setup, setup.outputs, discrepancies=setup.has_discrepancies)


def derivative(setup: Setup, z: Array) -> Array:
    """dx/dz (n_x, n_p) at the start."""
    return start_state(setup, model(setup), LearnerSettings(), setup.scaling, z, FIRST)[2]


def test_every_unknown_moves_the_start_as_it_moves_the_steady_state(guess: Vehicle) -> None:
    """The rounding of differences of a steady state of 0.1 is 1e-11."""
    setup = online_setup(guess, SIGNALS, LINEAR)
    values = dynamics.all_parameters(setup.vehicle, setup.outputs, extended=True)
    values |= {u.name: u.centre for u in setup.unknowns if not u.moves}
    state, m = steady_initial_state(setup.vehicle, FIRST, values, roll=True)
    chain, steady = model(setup).chain, np.append(state, 0.0)
    slopes = steady_state_slopes(chain, setup.vehicle, FIRST, values, setup.unknowns, steady, m)
    expected = slopes.T * setup.scaling.slope(setup.scaling.centre)
    V = derivative(setup, np.zeros(len(setup.estimated_unknowns)))
    assert np.count_nonzero(np.abs(V).max(axis=0)) > 5
    np.testing.assert_allclose(V[: len(expected)], expected, rtol=1e-6, atol=1e-10)
    assert not V[len(expected) :].any()
