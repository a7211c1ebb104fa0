"""Parameters and states of combinations with a dolly: from all gyros, without those of the dolly, and on the plant."""

from dataclasses import replace

import numpy as np
import pytest

from fifthwheel.apps.cheng_cebon_2011 import TwoStage
from fifthwheel.apps.studies.scenarios import initial_guess
from fifthwheel.base.errors import SignalError
from fifthwheel.data.channels import SignalName
from fifthwheel.data.record import Record
from fifthwheel.estimate.design.assess import predict_sigmas
from fifthwheel.estimate.identify import OneStage, identify
from fifthwheel.estimate.identify.dataset import prepare_dataset
from fifthwheel.estimate.identify.verdict import Verdict
from fifthwheel.estimate.observe import Observer
from fifthwheel.model.simulate import simulate
from fifthwheel.truck import get

FULL_TRAILER = get("truck_full_trailer")
KNOWN = OneStage(tyres="linear", given={"others": "exact", "sensors": "exact"})
"""All parameters except the estimated ones are known exactly."""


def without_unit(record: Record, unit: str) -> Record:
    return replace(record, signals={n: v for n, v in record.signals.items() if SignalName.of(n).unit != unit})


@pytest.fixture(scope="module")
def record() -> Record:
    return simulate(FULL_TRAILER, count=1)


@pytest.mark.slow
def test_a_dolly_without_gyros_is_noted(record: Record) -> None:
    blind = without_unit(record, "dolly")
    dataset = prepare_dataset([blind], FULL_TRAILER, OneStage())
    assert dataset.yaw == ("yaw_rate.truck", "yaw_rate.trailer")
    assert any("yaw_rate.dolly and articulation.dolly: in none of the logs" in note for note in dataset.notes)
    with_angle = record.reference["articulation.dolly"]
    dataset = prepare_dataset([blind.with_signals({"articulation.dolly": with_angle})], FULL_TRAILER, OneStage())
    assert not any("in none of the logs" in note for note in dataset.notes)


@pytest.mark.slow
def test_the_motion_of_one_unit_is_enough(record: Record) -> None:
    for unit in ("truck", "trailer"):
        signals = {
            n: v for n, v in record.signals.items() if n.startswith(("speed", "steer")) or n == f"yaw_rate.{unit}"
        }
        dataset = prepare_dataset([replace(record, signals=signals)], FULL_TRAILER, OneStage())
        assert dataset.outputs == (f"yaw_rate.{unit}",)


@pytest.mark.slow
def test_two_stages_need_a_yaw_rate_of_every_unit(record: Record) -> None:
    with pytest.raises(SignalError, match=r"yaw_rate\.dolly: in none of the logs.*use one stage"):
        identify([without_unit(record, "dolly")], FULL_TRAILER, TwoStage())


@pytest.mark.slow
def test_check_says_what_the_gyros_of_a_dolly_are_for(record: Record) -> None:
    """All else known, in the plane, every parameter but the dolly's yaw inertia is nearly as accurate without them."""
    settings = replace(KNOWN, roll=False)
    full = predict_sigmas([record], FULL_TRAILER, settings)
    blind = predict_sigmas([without_unit(record, "dolly")], FULL_TRAILER, settings)
    loss = {p.name: blind[p.name].sigma / p.sigma for p in full.parameters}
    assert all(ratio >= 0.999 for ratio in loss.values())
    assert loss["dolly.cornering_stiffness"] > 1.3
    assert any("dolly" in note for note in blind.notes)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "is_blind"),
    [("b_double", False), ("truck_dolly_semitrailer", True)],  # without a dolly, and without signals of it
)
def test_one_lane_change_identifies_a_long_combination(name: str, is_blind: bool) -> None:
    """From initial values 20 % off, each estimate converges within 4 sigma of the true value."""
    vehicle = get(name)
    record = simulate(vehicle, count=1, seed=2)
    if is_blind:
        record = without_unit(record, "dolly")
    truth = vehicle.parameters()
    result = identify([record], initial_guess(vehicle, 2), KNOWN)
    for estimate in result.parameters:
        assert estimate.verdict is Verdict.CONVERGED, estimate.name
        assert estimate.sigma
        assert abs(estimate.value - truth[estimate.name]) < 4 * estimate.sigma, estimate.name


@pytest.mark.slow
def test_states_of_the_last_unit_on_the_nonlinear_truck() -> None:
    """In a lane change the error of its sideslip, roll and articulation is below 10 % of the largest value."""
    pytest.importorskip("mujoco")
    from fifthwheel.model.manoeuvres import lane_changes
    from fifthwheel.model.plant import Plant

    vehicle = get("a_double")
    run = Plant(vehicle).drive(lane_changes(count=1))
    record = run.record(seed=1)
    states = Observer(vehicle, record.signals).batch(record)
    for quantity in ("sideslip", "roll", "articulation"):
        signal = f"{quantity}.{vehicle.units[-1].name}"
        error = np.sqrt(np.mean((states.values[signal] - run.truth[signal]) ** 2))
        assert error < 0.1 * np.abs(run.truth[signal]).max(), signal
