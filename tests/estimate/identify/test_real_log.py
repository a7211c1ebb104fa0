"""Logs of a real truck, if they are present; they are not part of the project."""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fifthwheel import truck as vehicle
from fifthwheel.apps.cheng_cebon_2011 import TwoStage
from fifthwheel.data.logs import SignalMap, read_log
from fifthwheel.data.record import Record
from fifthwheel.estimate.identify import Identification, OneStage, identify
from fifthwheel.estimate.identify.verdict import Verdict
from fifthwheel.estimate.observe import Observer, Status
from tests.estimate.observe.conftest import but_settling

DATA = Path(os.environ.get("FIFTHWHEEL_DATA", Path(__file__).resolve().parents[4] / "shared" / "data")) / "real_truck"
pytestmark = pytest.mark.skipif(not DATA.is_dir(), reason="the logs of the real truck are not present")

MAP = """
[time]
column = "t"
[signals]
speed = "vx"
"steer.tractor.front" = "steer_ang"
"yaw_rate.tractor" = "yaw_rate"
"articulation.semitrailer" = "hitch"
"yaw_rate.semitrailer" = { sum = ["yaw_rate", "hitch_rate"] }
[reference]
"lateral_velocity.tractor" = "vy"
"""
ACCELERATION = MAP.replace(
    "[reference]", '[signals."lateral_acceleration.tractor"]\ncolumn = "imu_accel_y"\n[reference]'
)
CHANNELS = ("yaw_rate.tractor", "yaw_rate.semitrailer", "articulation.semitrailer")


@pytest.fixture(scope="module")
def bend() -> Record:
    return read_log(DATA / "run01_s_bend.csv", SignalMap.parse(MAP), name="bend")


@pytest.fixture(scope="module")
def ramp() -> Record:
    return read_log(DATA / "run02_exit_ramp.csv", SignalMap.parse(MAP), name="ramp")


@pytest.fixture(scope="module")
def result_of_bend(bend: Record, ramp: Record) -> Identification:
    return identify([bend], vehicle.get("auburn_6x4"), validate=[ramp])


@pytest.fixture(scope="module")
def result_of_both(bend: Record, ramp: Record) -> Identification:
    return identify([bend, ramp], vehicle.get("auburn_6x4"))


def explained(result: Identification, log: str) -> list[float]:
    """Per cent of the variance explained, of the three channels."""
    return [100 * next(f.explained for f in result.fits if f.log == log and f.signal == name) for name in CHANNELS]


@pytest.mark.slow
def test_one_stage_on_both_logs(result_of_both: Identification) -> None:
    """Front stiffness, steering gain, delay and offsets are all estimated; two stages explain no more."""
    result = result_of_both
    assert np.all(np.array(explained(result, "bend")) >= [98.9, 99.5, 99.6])
    assert np.all(np.array(explained(result, "ramp")) >= [83.1, 94.1, 96.3])
    verdicts = {e.name: e.verdict for e in result.parameters}
    assert verdicts.pop("semitrailer.payload.height") is Verdict.NOT_IDENTIFIABLE
    informed = {Verdict.CONVERGED, Verdict.DOUBTFUL}
    for name in ("semitrailer.yaw_inertia", "tractor.drive.cornering_stiffness"):
        assert verdicts.pop(name) in {*informed, Verdict.NOT_EXCITED, Verdict.NOT_IDENTIFIABLE}
        assert 0.4 < result[name].sigma / result[name].prior <= 1.0  # the logs inform it about as much as the prior
    verdicts.pop("road.friction")  # up to 3 m/s^2
    assert set(verdicts.values()) <= informed
    assert {e.name for e in result.sensors} >= {f"steer.tractor.front.{kind}" for kind in ("offset", "gain", "delay")}
    front = result["tractor.front.cornering_stiffness"]
    assert 0.05 < front.sigma / front.value < 0.3


@pytest.mark.slow
def test_both_forms_agree_within_sigma(bend: Record) -> None:
    settings = (OneStage(tyres="linear", form=form) for form in ("output_error", "prediction_error"))
    result, other = (identify([bend], vehicle.get("auburn_6x4"), each) for each in settings)
    informed = {Verdict.CONVERGED, Verdict.DOUBTFUL}
    both = [e for e in result.parameters if e.verdict in informed and other[e.name].verdict in informed]
    assert len(both) >= 2  # those of front and trailer
    for e in both:
        assert abs(other[e.name].value - e.value) < 1.5 * np.hypot(e.sigma, other[e.name].sigma), e.name


@pytest.mark.slow
def test_two_stages_on_both_logs(bend: Record, ramp: Record) -> None:
    result = identify([bend, ramp], vehicle.get("auburn_6x4"), TwoStage())
    assert np.all(np.array(explained(result, "bend")) >= [99.0, 99.5, 99.5])
    assert np.all(np.array(explained(result, "ramp")) >= [82, 93.7, 96])
    assert all(f.rms < 0.0075 for f in result.fits if f.signal == "yaw_rate.tractor")
    offsets = {e.log: e.value for e in result.sensors if e.name == "steer.tractor.front.offset"}
    assert set(offsets) == {"bend", "ramp"}
    assert result.histories.keys() == {"stage 1"}


@pytest.mark.slow
def test_bend_alone(result_of_bend: Identification) -> None:
    assert np.all(np.array(explained(result_of_bend, "bend")) >= [98.7, 99.6, 99.7])
    assert not any(f.identified_on for f in result_of_bend.fits if f.log == "ramp")


@pytest.mark.slow
def test_ramp_alone_predicts_the_bend(bend: Record, ramp: Record) -> None:
    result = identify([ramp], vehicle.get("auburn_6x4"), validate=[bend])
    assert np.all(np.array(explained(result, "bend")) >= [98, 98, 98])


@pytest.mark.slow
def test_lateral_velocity_against_the_ins(bend: Record, result_of_bend: Identification) -> None:
    observer = Observer(result_of_bend.vehicle, bend.signals, result_of_bend.observer_settings("bend"))
    states = observer.batch(bend)
    assert (but_settling(states.status) == Status.OK).all()
    steer = bend.signals["steer.tractor.front"]
    inverted = observer.batch(bend.with_signals({"steer.tractor.front": -steer}))
    assert (inverted.status == Status.INCONSISTENT)[np.abs(steer) > 0.01].mean() > 0.97
    speed, yaw_rate = bend.signals["speed"], states.values["yaw_rate.tractor"]
    lateral = states.values["sideslip.tractor"] * speed
    # the position and offset of the INS are unknown and fitted: two numbers for 250 samples
    measured = bend.reference["lateral_velocity.tractor"]
    design = np.column_stack([yaw_rate, np.ones_like(speed)])
    solution, *_ = np.linalg.lstsq(design, measured - lateral, rcond=None)
    residual = measured - lateral - design @ solution
    assert measured.std() > 0.19
    assert residual.std() < 0.03


@pytest.mark.slow
def test_a_vibrating_accelerometer(result_of_bend: Identification) -> None:
    """An unfiltered IMU at 10 Hz: 1.2 m/s^2 of vibration. It moves an estimate by no more than its information allows:
    with sigma s before and r after it, two estimates of the same value differ by about sqrt(s^2 - r^2)."""
    with_it = read_log(DATA / "run01_s_bend.csv", SignalMap.parse(ACCELERATION), name="bend")
    without, result = result_of_bend, identify([with_it], vehicle.get("auburn_6x4"))
    used = Verdict.CONVERGED  # the stiffness of the front tyres is at the limit between two of the other verdicts
    assert [e.verdict is used for e in result.parameters] == [e.verdict is used for e in without.parameters]
    for e in result.parameters:
        added = max(without[e.name].sigma ** 2 - e.sigma**2, 0.0) ** 0.5
        small = 0.2 if e.verdict is not Verdict.NOT_IDENTIFIABLE else 1
        assert abs(e.value - without[e.name].value) < small * e.sigma + 2 * added, e.name
        relative = e.sigma / e.value, without[e.name].sigma / without[e.name].value
        assert relative[0] < 1.06 * relative[1] or e.verdict is Verdict.NOT_IDENTIFIABLE


@pytest.mark.slow
def test_the_signals_of_the_tractor_alone(bend: Record, ramp: Record, result_of_both: Identification) -> None:
    """The articulation angle that they give is close to the measured one, whose own offset is about 0.2 deg; the tyres
    agree with those of all signals within their sigma."""
    seen = [replace(r, signals={n: v for n, v in r.signals.items() if "semitrailer" not in n}) for r in (bend, ramp)]
    every, result = result_of_both, identify(seen, vehicle.get("auburn_6x4"))
    for name in ("tractor.front", "tractor.drive", "semitrailer"):
        one, other = result[f"{name}.cornering_stiffness"], every[f"{name}.cornering_stiffness"]
        assert abs(one.value - other.value) < 2 * np.hypot(one.sigma, other.sigma), name
        assert one.sigma > other.sigma, name
    for record, full in zip(seen, (bend, ramp), strict=True):
        states = result.observer(log=record.name).batch(record, result.uncertainty(record.name))
        error = states.values["articulation.semitrailer"] - full.signals["articulation.semitrailer"]
        assert np.degrees(np.sqrt(np.nanmean(error**2))) < 1.0, record.name
