"""A learner with wheel speeds of a trailer axle, where the trailer has no gyro."""

import pytest

from fifthwheel.data.channels.table import WHEEL_SPEED_DIFFERENCE
from fifthwheel.data.record import Record
from fifthwheel.estimate.identify.settings import OneStage
from fifthwheel.estimate.online import Learner
from fifthwheel.model.simulate import simulate
from fifthwheel.truck import Vehicle
from tests.estimate.online.conftest import OF_TRACTOR, samples

pytestmark = pytest.mark.slow

NAME, YAW, STEER = "wheel_speed_difference.semitrailer.middle", "yaw_rate.tractor", "steer.tractor.front"
WHEELS = ("wheel_speed.semitrailer.middle.left", "wheel_speed.semitrailer.middle.right")
NOISE = {YAW: 0.004**2, NAME: 0.001**2}
OFFSET = 0.006
SETTINGS = OneStage(given={"others": "exact"}, tyres="linear", noise=NOISE)
TRAILER = "semitrailer.cornering_stiffness"


@pytest.fixture(scope="module")
def log(truck: Vehicle) -> Record:
    """A lane change with wheel speeds; the rolling radii differ."""
    record = simulate(truck, count=1, seed=4, sensors=NOISE)
    signals = {name: record.signals[name] for name in ("speed", STEER, YAW)}
    halves = signals["speed"] * (record.signals[NAME] + OFFSET) / 2
    return Record(
        time=record.time,
        signals=signals | {WHEELS[0]: signals["speed"] - halves, WHEELS[1]: signals["speed"] + halves},
    )


@pytest.fixture(scope="module")
def learner(guess: Vehicle, log: Record) -> Learner:
    learner = Learner(guess, log.signals, SETTINGS)
    learner.learn(log)
    return learner


def test_it_finds_the_difference_of_the_radii_and_informs_of_the_trailer(
    learner: Learner, guess: Vehicle, truck: Vehicle, log: Record
) -> None:
    assert learner.live.setup.outputs == (YAW, NAME)
    offset = learner[f"{NAME}.offset"]
    assert abs(offset.value - OFFSET) < 3 * offset.sigma
    assert offset.sigma < 0.3 * WHEEL_SPEED_DIFFERENCE.error("offset").prior
    alone = Learner(guess, OF_TRACTOR, SETTINGS)
    alone.learn(log)
    assert learner[TRAILER].sigma < 0.9 * alone[TRAILER].sigma
    assert abs(learner[TRAILER].value - truck.parameters()[TRAILER]) < 3 * learner[TRAILER].sigma


def test_push_forms_the_difference_as_learn_does(guess: Vehicle, log: Record, tmp_path) -> None:
    """A side that is missing gives no measurement."""
    start = log.cut(stop=float(log.time[0]) + 1.0)
    pushed, learned, one_side = (Learner(guess, log.signals, SETTINGS) for _ in range(3))
    for sample in samples(start):
        pushed.push(sample)
        one_side.push(sample | {WHEELS[1]: None})
    learned.learn(start)
    assert pushed.content()["estimates"] == learned.content()["estimates"]
    pushed.save(tmp_path / "learner.json")
    assert Learner.load(tmp_path / "learner.json").live.setup.outputs == (YAW, NAME)
    assert NAME not in one_side.live.innovations.measured


def test_signals_that_are_no_difference(guess: Vehicle, learner: Learner, log: Record) -> None:
    """One side, both sides of driven wheels, and a record without wheel speeds."""
    driven = [f"wheel_speed.tractor.drive.{side}" for side in ("left", "right")]
    assert Learner(guess, ["speed", STEER, YAW, WHEELS[0], *driven], SETTINGS).live.setup.outputs == (YAW,)
    later = Record(time=log.time + 100.0, signals={n: v for n, v in log.signals.items() if n not in WHEELS})
    with pytest.raises(ValueError, match=f"{NAME}: not in record"):
        learner.learn(later)
