"""Logs that a first user has, with the right outcome of each: little information, bad samples, brakes, other trucks."""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fifthwheel.apps.studies.scenarios import article_sensors, initial_guess
from fifthwheel.data.logs import SignalMap, read_log
from fifthwheel.data.record import Record
from fifthwheel.estimate.identify import Identification, OneStage, Verdict, identify
from fifthwheel.estimate.online import Learner
from fifthwheel.model.manoeuvres import OpenLoop, lane_changes
from fifthwheel.model.plant import Plant, Properties
from fifthwheel.model.simulate import simulate
from fifthwheel.results.report.conclusion import conclude_identification
from fifthwheel.truck import Vehicle, get

TRUCK = get("cheng_cebon_2011")
CASES = Path(os.environ.get("FIFTHWHEEL_CASES", Path(__file__).resolve().parents[4] / "shared" / "cases"))
FIRST_HOUR = CASES / "first_hour"
TRUE = {
    "tractor.front.cornering_stiffness": 415e3,
    "tractor.drive.cornering_stiffness": 700e3,
    "semitrailer.cornering_stiffness": 1120e3,
    "semitrailer.yaw_inertia": 435e3,
}
"""Of the truck of the first hours."""
with_cases = pytest.mark.skipif(not FIRST_HOUR.is_dir(), reason="the logs of the first hours are not present")


def largest_deviation(result: Identification, truth: dict[str, float] | None = None) -> float:
    """Largest error of an estimate over its sigma."""
    truth = truth or TRUCK.parameters()
    return max(abs(e.value - truth[e.name]) / e.sigma for e in result.parameters if e.name in truth and e.sigma)


def verdicts(result: Identification) -> set[Verdict]:
    """Of all parameters but the friction of the road."""
    return {e.verdict for e in result.parameters if e.name != "road.friction"}


@pytest.mark.slow
def test_a_constant_turn_identifies_nothing() -> None:
    """It shows the understeer, which both tractor axles have in common, and nothing of the trailer."""
    turn = simulate(TRUCK, manoeuvre="step", speed=15.0, duration=35, seed=1)
    steady = turn.cut(start=turn.time[-1] - 20)
    result = identify([steady], initial_guess(TRUCK, 1), OneStage(tyres="linear"))
    of_trailer = [e for e in result.parameters if e.name.startswith("semitrailer")]
    assert len(of_trailer) == 3
    assert {e.verdict for e in of_trailer} == {Verdict.NOT_EXCITED}
    assert result["tractor.front.cornering_stiffness"].verdict is not Verdict.CONVERGED
    assert largest_deviation(result) < 2


@pytest.mark.slow
def test_one_bad_sample_changes_nothing() -> None:
    log = simulate(TRUCK, count=1, seed=0)
    values = log.signals["yaw_rate.tractor"].copy()
    values[100] = 0.8
    spoilt = replace(log, signals={**log.signals, "yaw_rate.tractor": values}, name="glitch")
    result, clean = (identify([record], TRUCK, OneStage(tyres="linear")) for record in (spoilt, log))
    assert not result.doubts
    assert [e.verdict for e in result.parameters] == [e.verdict for e in clean.parameters]
    for e, other in zip(result.parameters, clean.parameters, strict=True):
        assert abs(e.value - other.value) < 0.2 * e.sigma, e.name
    assert any("1 spike left out" in f.message for f in result.findings)


def slowed(deceleration: float) -> Record:
    """Four lane changes of the nonlinear truck while its drive axle brakes, again and again."""
    course = lane_changes(count=4)
    assert not isinstance(course, OpenLoop)
    speed, falls = course.speed.copy(), False
    for i in range(1, speed.size):
        falls = speed[i - 1] > speed[0] - 4 if falls else course.arc[i] > 60 and speed[i - 1] >= speed[0]
        rate = -deceleration if falls else 0.3
        speed[i] = min(np.sqrt(speed[i - 1] ** 2 + 2 * rate * (course.arc[i] - course.arc[i - 1])), speed[0])
    run_ = Plant(TRUCK, Properties(brakes={"tractor.drive": 1.0})).drive(replace(course, speed=speed))
    return run_.record(article_sensors(TRUCK), seed=1)


@pytest.mark.slow
def test_a_retarder_is_no_wrong_vehicle_file() -> None:
    record = slowed(0.9)
    result = identify([record], initial_guess(TRUCK, 1))
    assert verdicts(result) == {Verdict.CONVERGED}
    assert not result.doubts
    assert largest_deviation(result) < 2.5
    assert not [c for c in conclude_identification(result, [record]).cautions if "static load" in c or "rolling" in c]


@pytest.mark.slow
def test_the_mass_of_the_trailer_stands_beside_the_verdict() -> None:
    """Lateral motion scales with the masses: a lighter trailer gives softer tyres, as announced."""
    record = simulate(TRUCK, count=1, seed=1)
    mass, name = "semitrailer.payload.mass", "semitrailer.cornering_stiffness"
    true = identify([record], TRUCK, OneStage(tyres="linear"))
    line = conclude_identification(true, [record]).unchecked
    assert line.startswith("The logs cannot check the masses. If the trailer is 10 % heavier than in the vehicle file")
    assert "the cornering stiffness of the trailer tyres +10 %" in line
    lighter = TRUCK.replace({mass: 0.7 * TRUCK.parameters()[mass]})
    fraction = lighter.units[1].mass / TRUCK.units[1].mass
    wrong = identify([record], lighter, OneStage(tyres="linear"))
    assert wrong[name].value / true[name].value == pytest.approx(fraction, abs=0.04)
    weighed = record.with_signals({"drive_force": np.full(len(record), 5e3), "braking.tractor": np.zeros(len(record))})
    assert conclude_identification(true, [weighed]).unchecked == ""


@pytest.mark.slow
@with_cases
@pytest.mark.parametrize(
    ("vehicle", "signals"),
    [
        ("wb_vehicle.toml", "sig_wb.toml"),  # delays of 0.275 and 0.287 s
        ("lkw.toml", "sig_pm.toml"),  # five bad samples
    ],
)
def test_first_runs_converge(vehicle: str, signals: str) -> None:
    """By the identification alone: states and report take the time again and are not looked at."""
    record = read_log(FIRST_HOUR / "L01.csv", SignalMap.load(FIRST_HOUR / signals))
    result = identify([record], Vehicle.load(FIRST_HOUR / vehicle))
    assert verdicts(result) == {Verdict.CONVERGED}
    assert not result.doubts
    assert largest_deviation(result, TRUE) < 2
    gyro = next(fit for fit in result.fits if fit.signal == "yaw_rate.tractor")
    assert np.degrees(gyro.rms) < 0.2
    assert not [c for c in conclude_identification(result).cautions if "times the value" in c]


@pytest.mark.slow
@with_cases
def test_the_learner_of_a_trace_is_right(run, tmp_path: Path) -> None:
    for name in ("sigcan.toml", "truck.dbc", "fahrt43.blf", "lkw.toml"):
        (tmp_path / name).write_bytes((FIRST_HOUR / name).read_bytes())
    replay = ("live", "--replay", "fahrt43.blf", "--rate", "0", "-s", "sigcan.toml", "-v", "lkw.toml")
    assert run(*replay, "--learn", "--state", "learned.json").code == 0
    learned = [e for e in Learner.load(tmp_path / "learned.json").parameters if e.name in TRUE]
    assert len(learned) == len(TRUE)
    assert max(abs(e.value - TRUE[e.name]) / e.sigma for e in learned) < 2
