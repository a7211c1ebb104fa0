"""Two stages on the linear vehicle with the noise of the article: errors, sigmas and verdicts."""

import json
import math
from typing import Any

import numpy as np
import pytest

from fifthwheel.apps.cheng_cebon_2011 import TwoStage, article
from fifthwheel.base.errors import SignalError, VehicleError
from fifthwheel.data.record import Record
from fifthwheel.estimate import identify as methods
from fifthwheel.estimate.identify import Identification
from fifthwheel.estimate.identify.unknowns.parameters import stage_1_names, stage_2_names
from fifthwheel.estimate.identify.verdict import Verdict
from fifthwheel.model.simulate import simulate
from fifthwheel.truck import Vehicle
from tests.estimate.conftest import without

HEIGHT = "semitrailer.payload.height"


def identify(records: list[Record], truck: Vehicle, settings: TwoStage | None = None, **others: Any) -> Identification:
    return methods.identify(records, truck, settings or TwoStage(), **others)


def errors(result: Identification, truck: Vehicle) -> dict[str, float]:
    truth = truck.parameters() | truck.derived()
    return {e.name: e.value / truth[e.name] - 1 for e in (*result.parameters, *result.derived)}


def guesses(truck: Vehicle, factors: tuple[float, ...]) -> Vehicle:
    values = truck.parameters()
    return truck.replace({n: values[n] * f for n, f in zip(stage_1_names(truck), factors, strict=True)})


def within(result: Identification, truck: Vehicle, stiffness: float = 0.02, height: float = 0.03) -> None:
    for name, error in errors(result, truck).items():
        if name in stage_1_names(truck):
            assert abs(error) < stiffness, name
        elif name == HEIGHT:
            assert abs(error) < height, name


@pytest.mark.slow
def test_three_lane_changes_from_80_and_120_percent(truck: Vehicle, guess: Vehicle) -> None:
    """The errors match their sigma, and JSON and vehicle have the estimates."""
    result = identify([simulate(truck, count=3, seed=0, name="a run")], guess)
    within(result, truck)
    assert all(e.verdict is Verdict.CONVERGED for e in result.parameters)
    true = truck.parameters() | truck.derived()
    assert all(abs(e.value - true[e.name]) < 3 * e.sigma for e in (*result.parameters, *result.derived))
    assert result.histories["stage 1"].values.shape[1] == 4
    assert result[HEIGHT].initial == 0.1
    data = json.loads(result.to_json())
    assert (data["method"], data["logs"][0]["name"]) == ("two-stage", "a run")
    assert {p["name"] for p in data["parameters"]} == {*stage_1_names(truck), *stage_2_names(truck)}
    loaded = Vehicle.loads(result.vehicle.to_toml()).parameters()
    assert {p["name"]: loaded[p["name"]] for p in data["parameters"]} == pytest.approx(
        {p["name"]: p["value"] for p in data["parameters"]}, rel=1e-9
    )


@pytest.mark.slow
def test_without_roll_rates_stage_2_is_skipped_and_sigma_includes_the_bias(truck: Vehicle, guess: Vehicle) -> None:
    result = identify([without(simulate(truck, count=3, seed=4), "roll_rate")], guess)
    assert any("Stage 2 skipped" in note and "roll_rate.semitrailer" in note for note in result.notes)
    assert result[HEIGHT].verdict is Verdict.NOT_EXCITED
    assert list(result.histories) == ["stage 1"]
    for name in stage_1_names(truck):
        e = result[name]
        assert e.sigma is not None
        assert abs(e.value - truck.parameters()[name]) < 2.5 * e.sigma, name
    biased = max(abs(errors(result, truck)[name]) for name in stage_1_names(truck))
    assert biased > 0.01  # the bias of the yaw model on a truck that rolls


@pytest.mark.slow
def test_straight_driving_is_not_excited(truck: Vehicle, guess: Vehicle) -> None:
    result = identify([simulate(truck, manoeuvre="straight", duration=10.0, seed=1)], guess)
    for e in result.parameters:
        assert e.verdict is Verdict.NOT_EXCITED, e.name
        assert e.value == e.initial
        assert e.sigma is not None
        assert e.sigma > 0.25 * e.value
    assert result.vehicle.parameters()["tractor.front.cornering_stiffness"] == pytest.approx(0.8 * 4.75e5)


def test_an_uncertain_number_that_no_stage_has_is_named(truck: Vehicle) -> None:
    with pytest.raises(VehicleError, match=r"tractor\.mass: needs one stage"):
        identify([simulate(truck, count=1)], truck, TwoStage(given={"tractor.mass": "+- 2 %"}))


@pytest.mark.slow
def test_at_bound(truck: Vehicle) -> None:
    """The truck rolls less than with any payload height."""
    stiff = ("semitrailer.roll_stiffness", "semitrailer.tyre_roll_stiffness", "fifth_wheel.roll_stiffness")
    other = truck.replace({name: 2.5 * truck.parameters()[name] for name in stiff})
    result = identify([simulate(other, count=1, seed=6)], truck)
    assert result[HEIGHT].verdict is Verdict.AT_BOUND
    assert result["semitrailer.cog_height"].verdict is Verdict.AT_BOUND


@pytest.mark.slow
def test_an_implausible_start(truck: Vehicle) -> None:
    """It may fail, but what has converged is right."""
    result = identify([simulate(truck, count=1, seed=6)], guesses(truck, (9.0, 1.0, 1.0, 1.0)))
    true = truck.parameters()
    for e in result.parameters:
        assert e.verdict is not Verdict.CONVERGED or abs(e.value - true[e.name]) < 3 * e.sigma
    assert all(e.sigma is not None and math.isfinite(e.sigma) and math.isfinite(e.value) for e in result.parameters)
    worst = min(fit.explained for fit in result.fits if fit.signal.startswith("yaw_rate"))
    assert any("Check the signal, the vehicle file and" in note for note in result.notes) == (worst < 0.5)


def test_not_converged_when_stopped_early(truck: Vehicle) -> None:
    far = guesses(truck, (0.5, 1.8, 0.5, 1.8))
    record = simulate(truck, count=1, seed=6)
    for refined, verdict in ((False, Verdict.NOT_CONVERGED), (True, Verdict.CONVERGED)):  # steps of Gauss and Newton
        result = identify([record], far, TwoStage(passes=1, rounds=1, restart=refined))
        assert {e.verdict for e in result.parameters} == {verdict}


@pytest.mark.slow
def test_delay_of_the_steer_angle(truck: Vehicle, guess: Vehicle) -> None:
    record = simulate(truck, count=2, seed=3)
    delayed = np.interp(record.time - 0.08, record.time, record.signals["steer.tractor.front"])
    result = identify([record.with_signals({"steer.tractor.front": delayed})], guess)
    delay = next(e for e in result.sensors if e.name == "steer.tractor.front.delay")
    assert delay.value == pytest.approx(0.08, abs=0.005)
    within(result, truck, 0.03, 0.05)


@pytest.mark.slow
def test_the_settings_of_the_article_keep_the_bias_of_its_stage_1(truck: Vehicle, guess: Vehicle) -> None:
    truck = truck.replace({f"{path}.relaxation_length": 0.0 for path in truck.group_paths()})  # as in the article
    record = simulate(truck, count=15, seed=3)
    result = identify([record], guess, article())
    data = json.loads(result.to_json())
    assert (data["preset"], data["sensors"]) == ("article", [])
    assert data["settings"] == json.loads(json.dumps(article().as_dict()))
    for name, error in errors(result, truck).items():
        if name in stage_1_names(truck):
            assert -0.06 < error < -0.005, name  # the yaw model on a truck that rolls
            assert result[name].settling_time is not None
            assert result[name].settling_time > 2 * 8, name  # more than two lane changes


@pytest.mark.parametrize("missing", ["speed", "steer", "yaw_rate"])
def test_a_log_without_a_needed_signal_is_refused(truck: Vehicle, missing: str) -> None:
    with pytest.raises(SignalError, match=missing):
        identify([without(simulate(truck, count=1), missing)], truck)


@pytest.mark.slow
def test_everything_fixed(truck: Vehicle) -> None:
    everything = dict.fromkeys((*stage_1_names(truck), *stage_2_names(truck)), "exact")
    record = simulate(truck, count=1)
    result = identify([record], truck, TwoStage(given=everything))
    assert {e.verdict for e in result.parameters} == {Verdict.FIXED}
    with pytest.raises(VehicleError, match="given: everything of stage 1 is exact"):
        identify([record], truck, article(given=everything))
