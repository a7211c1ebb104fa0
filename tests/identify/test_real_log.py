"""Stage 1 on logs of a real truck, where they are at hand; they are not part of the project."""

import os
from pathlib import Path

import numpy as np
import pytest

from fifthwheel import vehicle
from fifthwheel.identify import Identification, OneStage, TwoStage, Verdict, identify
from fifthwheel.logs import Record, SignalMap, read
from fifthwheel.observe import Observer, Status

DATA = Path(os.environ.get("FIFTHWHEEL_DATA", Path(__file__).resolve().parents[3] / "shared" / "data")) / "real_truck"
pytestmark = pytest.mark.skipif(not DATA.is_dir(), reason="the real logs are not here")

MAP = """
[time]
column = "t"
[signals]
speed = "vx"
"steer.tractor.front" = "steer_ang"
"yaw_rate.tractor" = "yaw_rate"
"articulation.semitrailer" = "hitch"
[signals."yaw_rate.semitrailer"]
sum = ["yaw_rate", "hitch_rate"]
[reference]
"lateral_velocity.tractor" = "vy"
"""
CHANNELS = ("yaw_rate.tractor", "yaw_rate.semitrailer", "articulation.semitrailer")


@pytest.fixture(scope="module")
def bend() -> Record:
    return read(DATA / "run01_s_bend.csv", SignalMap.parse(MAP), name="bend")


@pytest.fixture(scope="module")
def ramp() -> Record:
    return read(DATA / "run02_exit_ramp.csv", SignalMap.parse(MAP), name="ramp")


def explained(found: Identification, log: str) -> list[float]:
    """Per cent of the variance of the three channels."""
    return [100 * next(f.explained for f in found.fits if f.log == log and f.signal == name) for name in CHANNELS]


def test_one_stage_on_both_logs(bend: Record, ramp: Record) -> None:
    """Front stiffness, steer gain, delay, zeros: all estimated, and no less explained than in two stages."""
    found = identify([bend, ramp], vehicle.get("auburn_6x4"))
    assert np.all(np.array(explained(found, "bend")) >= [99.0, 99.7, 99.6])
    assert np.all(np.array(explained(found, "ramp")) >= [83.1, 94.1, 96.3])
    told = {e.name: e.verdict for e in found.parameters}
    assert told.pop("semitrailer.payload.height") is Verdict.NOT_IDENTIFIABLE
    assert set(told.values()) == {Verdict.CONVERGED}
    assert {e.name for e in found.sensors} >= {f"steer.tractor.front.{word}" for word in ("offset", "gain", "delay")}
    front = found["tractor.front.cornering_stiffness"]
    other = identify([bend, ramp], vehicle.get("auburn_6x4"), OneStage(form="prediction_error"))
    for e in found.parameters:  # both forms say the same within their sigma
        assert abs(other[e.name].value - e.value) < 1.5 * e.sigma, e.name
    assert 0.05 < front.sigma / front.value < 0.3


def test_both_logs_together_are_no_worse_than_a_plain_fit(bend: Record, ramp: Record) -> None:
    found = identify([bend, ramp], vehicle.get("auburn_6x4"), TwoStage())
    assert np.all(np.array(explained(found, "bend")) >= [99.0, 99.5, 99.5])
    assert np.all(np.array(explained(found, "ramp")) >= [82, 94, 74])
    assert all(f.rms < 0.0075 for f in found.fits if f.signal == "yaw_rate.tractor")
    zeros = {e.log: e.value for e in found.sensors if e.name == "steer.tractor.front.offset"}
    assert set(zeros) == {"bend", "ramp"}
    assert found.traces.keys() == {"stage 1"}


def test_the_bend_alone_explains_itself(bend: Record, ramp: Record) -> None:
    found = identify([bend], vehicle.get("auburn_6x4"), validate=[ramp])
    assert np.all(np.array(explained(found, "bend")) >= [99.0, 99.7, 99.7])
    assert not any(f.identified_on for f in found.fits if f.log == "ramp")


def test_the_ramp_alone_predicts_the_bend(bend: Record, ramp: Record) -> None:
    found = identify([ramp], vehicle.get("auburn_6x4"), validate=[bend])
    assert np.all(np.array(explained(found, "bend")) >= [98, 98, 98])


def test_lateral_velocity_against_the_ins(bend: Record) -> None:
    found = identify([bend], vehicle.get("auburn_6x4"))
    observer = Observer(found.vehicle, bend.signals, found.observer_settings("bend"))
    states = observer.batch(bend)
    assert (states.status == Status.OK).all()
    speed, yaw_rate = bend.signals["speed"], states.values["yaw_rate.tractor"]
    lateral = states.values["sideslip.tractor"] * speed
    # where the INS sits on the tractor is not known: its place and zero are fitted, two numbers for 250 samples
    measured = bend.reference["lateral_velocity.tractor"]
    place = np.column_stack([yaw_rate, np.ones_like(speed)])
    solution, *_ = np.linalg.lstsq(place, measured - lateral, rcond=None)
    rest = measured - lateral - place @ solution
    assert measured.std() > 0.19
    assert rest.std() < 0.03
