"""Fixtures and helpers of the learner's tests."""

from dataclasses import replace

import numpy as np
import pytest

from fifthwheel.base.types import Array
from fifthwheel.data.record import Record
from fifthwheel.estimate.identify.settings import OneStage
from fifthwheel.estimate.identify.verdict import Verdict
from fifthwheel.estimate.online import Learner, LearnerSettings
from fifthwheel.model.simulate import simulate
from fifthwheel.truck import Vehicle

FIVE = OneStage(given={"others": "exact", "sensors": "exact"}, tyres="linear")
"""Five parameters; all other numbers are known, and the tyres are linear as in the logs."""
CONSIDERING = replace(FIVE, given={**FIVE.given, "roll_axis_height": "+- 10 %"})
"""The same, with two considered numbers."""
WITH_SENSORS = OneStage(given={"others": "exact"}, tyres="linear", noise={"yaw_rate.tractor": 0.004**2})
"""The vehicle file is exact, the sensors are not."""
OF_TRACTOR = ("speed", "steer.tractor.front", "yaw_rate.tractor")
"""The least signals."""
HEIGHT = "semitrailer.payload.height"


@pytest.fixture(scope="session")
def lanes(truck: Vehicle) -> Record:
    """Two lane changes."""
    return simulate(truck, count=2, seed=5)


@pytest.fixture(scope="session")
def learned(guess: Vehicle, lanes: Record) -> Learner:
    """A learner after two lane changes; tests must not change it."""
    return learn(guess, lanes)


@pytest.fixture(scope="session")
def considering(guess: Vehicle, lanes: Record) -> Learner:
    """The same with considered numbers."""
    return learn(guess, lanes, CONSIDERING)


def learn(guess: Vehicle, record: Record, settings: OneStage = FIVE, **arguments: LearnerSettings) -> Learner:
    """A learner after a record."""
    learner = Learner(guess, record.signals, settings, **arguments)
    learner.learn(record)
    return learner


def samples(record: Record) -> list[dict[str, float]]:
    """Every sample of a record as `push` takes it."""
    names = ["time", *record.signals]
    rows = np.column_stack([record.time, *record.signals.values()]).tolist()
    return [dict(zip(names, row, strict=True)) for row in rows]


def estimates(learner: Learner) -> tuple[Array, Array]:
    """z of the estimated unknowns, and the covariance of all unknowns, the estimated ones first."""
    estimate = learner._live.filter.estimate()
    return estimate.z, estimate.covariance()


def assert_identified(learner: Learner, truth: Vehicle, sigmas: float = 4.0) -> None:
    """Every parameter has converged, with an error of at most so many sigmas."""
    for estimate in learner.parameters:
        assert estimate.verdict == Verdict.CONVERGED
        assert abs(estimate.value - truth.parameters()[estimate.name]) < sigmas * estimate.sigma
