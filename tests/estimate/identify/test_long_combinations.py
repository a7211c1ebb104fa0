"""Parameters and states of combinations with a dolly: from all gyros, without those of the dolly, and on the plant."""

from dataclasses import replace

import pytest

from fifthwheel.apps.cheng_cebon_2011 import TwoStage
from fifthwheel.apps.studies.scenarios import initial_guess
from fifthwheel.base.errors import SignalError
from fifthwheel.data.channels import SignalName
from fifthwheel.data.record import Record
from fifthwheel.estimate.identify import OneStage, identify
from fifthwheel.estimate.identify.dataset import prepare_dataset
from fifthwheel.estimate.identify.verdict import Verdict
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
def test_signals_of_some_units_are_enough(record: Record) -> None:
    """What misses is noted; one unit is enough for one stage, and two stages need a yaw rate of every unit."""
    blind = without_unit(record, "dolly")
    dataset = prepare_dataset([blind], FULL_TRAILER, OneStage())
    assert dataset.yaw == ("yaw_rate.truck", "yaw_rate.trailer")
    assert any("yaw_rate.dolly and articulation.dolly: in none of the logs" in note for note in dataset.notes)
    with_angle = blind.with_signals({"articulation.dolly": record.reference["articulation.dolly"]})
    assert not any("in none" in note for note in prepare_dataset([with_angle], FULL_TRAILER, OneStage()).notes)
    for unit in ("truck", "trailer"):
        kept = ("speed", "steer", f"yaw_rate.{unit}")
        alone = replace(record, signals={n: v for n, v in record.signals.items() if n.startswith(kept)})
        assert prepare_dataset([alone], FULL_TRAILER, OneStage()).outputs == (f"yaw_rate.{unit}",)
    with pytest.raises(SignalError, match=r"yaw_rate\.dolly: in none of the logs.*use one stage"):
        identify([blind], FULL_TRAILER, TwoStage())


@pytest.mark.slow
def test_one_lane_change_identifies_a_long_combination() -> None:
    """Without signals of its dolly, from initial values 20 % off, each estimate is within 4 sigma of the true value."""
    vehicle = get("truck_dolly_semitrailer")
    record = without_unit(simulate(vehicle, count=1, seed=2), "dolly")
    truth = vehicle.parameters()
    result = identify([record], initial_guess(vehicle, 2), KNOWN)
    for estimate in result.parameters:
        assert estimate.verdict is Verdict.CONVERGED, estimate.name
        assert estimate.sigma
        assert abs(estimate.value - truth[estimate.name]) < 4 * estimate.sigma, estimate.name
