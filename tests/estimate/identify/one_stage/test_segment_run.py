"""Derivatives of the initial state against differences of the steady state."""

import numpy as np
import pytest

from fifthwheel.apps.cheng_cebon_2011 import TwoStage
from fifthwheel.apps.cheng_cebon_2011.problem import DualProblem, parameter_unknowns, sensor_unknowns
from fifthwheel.estimate.filters.initial_state import bank_effect, steady_initial_state
from fifthwheel.estimate.identify import OneStage
from fifthwheel.estimate.identify.one_stage.segment_run import steady_state_slopes
from fifthwheel.estimate.identify.unknowns import parameters
from fifthwheel.model import dynamics
from fifthwheel.model.dynamics.simulation import free_response
from fifthwheel.model.simulate import simulate
from fifthwheel.truck import Vehicle

OUTPUTS = ("yaw_rate.tractor", "yaw_rate.semitrailer")


@pytest.mark.parametrize("roll", [False, True])
def test_derivative_by_z(truck: Vehicle, roll: bool) -> None:
    record = simulate(truck, count=1).cut(1.5)
    steered = truck.with_logged_steering(record.signals, "record")
    settings = TwoStage()
    unknowns = parameter_unknowns(steered, parameters.stage_1_names(steered), settings)
    unknowns += sensor_unknowns(steered, OUTPUTS, settings)
    problem = DualProblem(vehicle=steered, outputs=OUTPUTS, roll=roll, unknowns=tuple(unknowns), settings=settings)
    names, scale, rows = problem.names, problem.scaling, problem.rows(record, {})
    z = np.random.default_rng(0).normal(size=len(names)) * 0.1
    x0, P0, derivative = problem.initial_state(z, rows)

    def steady(z: np.ndarray) -> np.ndarray:
        values = dict(zip(names, scale.to_p(z).tolist(), strict=True))
        return steady_initial_state(steered, rows.first, values, roll=roll)[0]

    np.testing.assert_allclose(x0, steady(z))
    central = [(steady(z + 1e-4 * e) - steady(z - 1e-4 * e)) / 2e-4 for e in np.eye(len(z))]
    np.testing.assert_allclose(derivative, np.column_stack(central), atol=1e-4 * np.abs(derivative).max())
    assert np.abs(derivative).max() > 1e-3
    assert np.linalg.eigvalsh(P0).min() > 0


def test_derivative_by_values(truck: Vehicle) -> None:
    """Only parameters of the vehicle and steering offsets and gains move the steady state; the bank stays as it is."""
    record = simulate(truck, count=1).cut(1.5)
    steered = truck.with_logged_steering(record.signals, "record")
    unknowns = parameters.one_stage_unknowns(steered, OUTPUTS, OneStage(given={"payload.height": "+- 0.75 m"}))
    model = dynamics.model(steered, OUTPUTS, roll=True, bank=True)
    inputs = {name: float(record.signals[name][0]) for name in model.inputs} | {"steer.tractor.front": 0.02}
    given = dynamics.all_parameters(steered, OUTPUTS, extended=True)
    values = given | {u.name: u.centre for u in unknowns if not u.moves}
    state, m = steady_initial_state(steered, inputs, values, roll=True, bank=0.03)
    slopes = steady_state_slopes(model, steered, inputs, values, unknowns, np.append(state, 0.03), m)
    for unknown, slope in zip(unknowns, slopes, strict=True):
        step = 1e-3 * unknown.prior_sigma
        rates = unknown.slopes.items()
        changed = [{name: values[name] + s * rate for name, rate in rates} for s in (step, -step)]
        higher, lower = (
            steady_initial_state(steered, inputs, values | change, roll=True, bank=0.03)[0] for change in changed
        )
        np.testing.assert_allclose(2 * step * slope[:-1], higher - lower, rtol=1e-5, atol=1e-12, err_msg=unknown.name)
    moving = {u.name for u, slope in zip(unknowns, slopes, strict=True) if slope.any()}
    assert {
        "mass_scale",
        "tractor.front.cornering_stiffness",
        "steer.tractor.front.offset",
        "steer.tractor.front.gain",
    } <= moving
    assert not moving & {"steer.tractor.front.delay", "yaw_rate.tractor.offset", "yaw_rate.tractor.gain"}
    assert not slopes[:, -1].any()


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
