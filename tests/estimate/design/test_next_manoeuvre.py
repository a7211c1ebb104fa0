"""The next manoeuvre of a learner: the prediction against what the learner then gives."""

import copy
from dataclasses import replace

import pytest

from fifthwheel.base.errors import VehicleError
from fifthwheel.data.record.derived import article_gyro_variance
from fifthwheel.estimate.design.next_manoeuvre import (
    DRIVEN,
    _measured,
    manoeuvre_information,
    plan_manoeuvres,
)
from fifthwheel.estimate.design.search import sizes_within_limits
from fifthwheel.estimate.online import Learner
from fifthwheel.truck import get
from tests.estimate.online.conftest import FIVE

TRUCK = get("cheng_cebon_2011")
GYROS = article_gyro_variance(["tractor", "semitrailer"])
SIGNALS = ("speed", "steer.tractor.front", *GYROS)
FRONT, TRAILER = "tractor.front.cornering_stiffness", "semitrailer.cornering_stiffness"
FEW = replace(DRIVEN, speeds=(50 / 3.6, 88 / 3.6), frequencies=(0.4,), accelerations=(1.0,))


@pytest.fixture(scope="module")
def learner():
    return Learner(TRUCK, SIGNALS)


@pytest.fixture(scope="module")
def candidates(learner):
    return manoeuvre_information(learner, FEW)


def driven(learner, steps):
    """A copy of a learner after manoeuvres of the truck of the vehicle file, 10 s apart and without noise."""
    truth, learner, start = learner, copy.copy(learner), 0.0
    for k, step in enumerate(steps):
        steer, _, _ = sizes_within_limits(TRUCK, step.manoeuvre, FEW)
        record = _measured(truth, step.manoeuvre, (-1) ** k * step.size * steer, FEW.rate)
        record = replace(record, time=record.time + start)
        learner.learn(record)
        start = record.time[-1] + 10.0
    return learner


def sigma(learner, name):
    estimate = learner[name]
    return estimate.sigma / abs(estimate.value)


@pytest.mark.slow
def test_the_learner_reaches_the_predicted_sigma(learner, candidates):
    targets = {FRONT: 0.05, TRAILER: 0.05, "semitrailer.yaw_inertia": 0.05}
    plan = plan_manoeuvres(learner, candidates, targets)
    assert len(plan.steps) >= 2
    assert plan.duration == pytest.approx(sum(step.manoeuvre.period for step in plan.steps))
    after = driven(learner, plan.steps)
    for name in targets:
        assert plan.sigma[name] < 0.5 * sigma(learner, name)
        assert sigma(after, name) == pytest.approx(plan.sigma[name], rel=0.02)
    assert len(plan_manoeuvres(after, candidates, targets).steps) <= 1
    wide = 1.1 * sigma(learner, FRONT)  # a reached target asks for no manoeuvre
    assert plan_manoeuvres(learner, candidates, {FRONT: wide}).steps == ()
    both, alone = (plan_manoeuvres(learner, candidates, t) for t in ({FRONT: wide, TRAILER: 0.1}, {TRAILER: 0.1}))
    assert both.steps == alone.steps != ()


@pytest.mark.slow
def test_a_target_that_driving_does_not_reach_is_limited_by_what_varies(learner, candidates):
    plan = plan_manoeuvres(learner, candidates, {TRAILER: 0.025})
    assert plan.sigma[TRAILER] > 0.025
    assert plan.limits == {TRAILER: "semitrailer.cornering_stiffness.variation"}
    signals = ("speed", "steer.tractor.front", "yaw_rate.tractor", "yaw_rate.semitrailer")
    exact, height = Learner(TRUCK, signals, FIVE), "semitrailer.payload.height"
    plan = plan_manoeuvres(exact, manoeuvre_information(exact, FEW), {TRAILER: 0.025, height: 0.15})
    assert plan.sigma[TRAILER] <= 0.025
    assert plan.uninformed == (height,)  # without a roll rate
    assert plan.limits == {TRAILER: height}


def test_an_unstable_truck_has_no_manoeuvre(learner):
    stiffness = "tractor.drive.cornering_stiffness"
    unstable = TRUCK.replace({stiffness: 0.3 * TRUCK.parameters()[stiffness]})
    with pytest.raises(VehicleError, match=r"unstable at 88 km/h.*check the file"):
        manoeuvre_information(Learner(unstable, SIGNALS), replace(FEW, speeds=(88 / 3.6,)))
