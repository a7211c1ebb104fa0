"""Doubts of a learner, and that no estimate is confidently wrong."""

import copy

import numpy as np
import pytest

from fifthwheel.data.record import Record
from fifthwheel.estimate.identify.doubts import DoubtKind
from fifthwheel.estimate.identify.verdict import Verdict
from fifthwheel.estimate.online import Learner
from fifthwheel.estimate.online.live_filter import InnovationStatistics
from fifthwheel.truck import Vehicle
from tests.estimate.online.conftest import CONSIDERING, FIVE, learn


@pytest.mark.slow
def test_a_wrong_assumption_is_doubted(guess: Vehicle, lanes: Record) -> None:
    """The roll axis of the trailer is 0.4 m lower in the vehicle file, 5 times its uncertainty."""
    path = "semitrailer.roll_axis_height"
    learner = learn(guess.replace({path: guess.parameters()[path] - 0.4}), lanes, CONSIDERING)
    (doubt,) = (d for d in learner.doubts if d.kind is DoubtKind.ASSUMPTION)
    assert doubt.causes[0].name == path
    assert doubt.causes[0].changes[path] > 0.1
    assert any(learner[name].verdict == Verdict.DOUBTFUL for name in doubt.parameters)


def test_inconsistent_innovations_make_all_parameters_doubtful(guess: Vehicle, lanes: Record) -> None:
    noise = 0.02 * np.random.default_rng(1).normal(size=len(lanes))
    name = "yaw_rate.tractor"
    learner = learn(guess, lanes.with_signals({name: lanes.signals[name] + noise}), FIVE)
    (doubt,) = (d for d in learner.doubts if d.kind is DoubtKind.NOISE)
    assert {e.verdict for e in learner.parameters} <= {Verdict.DOUBTFUL, Verdict.AT_BOUND}
    assert set(doubt.parameters) == {e.name for e in learner.parameters}


def test_autocorrelation_is_that_of_a_first_order_process() -> None:
    """The variance inflation factor of slow averages is (1 + pole) / (1 - pole)."""
    statistics, value, total = InnovationStatistics(["yaw_rate.tractor"], 50.0, np.inf), 0.0, []
    pole = 0.8
    for noise in np.random.default_rng(2).normal(size=200_000):
        value = pole * value + np.sqrt(1 - pole**2) * noise
        statistics.update(0.01, [value], [1.0])
        total.append(statistics.autocorrelation[0])
    assert np.mean(total[100_000:]) == pytest.approx(9.0, rel=0.15)


def test_autocorrelated_innovations_contain_less_information(learned: Learner) -> None:
    """Twice the variance, at most that of the prior."""
    live = copy.deepcopy(learned)._live
    live.innovations.autocorrelation[:] = [1.0] * 4
    before = live.estimate()
    live.innovations.autocorrelation[1] = 2.0
    after = live.estimate()
    ratio = np.sqrt(np.diag(after.Pz) / np.diag(before.Pz))
    assert (ratio[:4] > 1.4).all()
    assert (ratio <= np.sqrt(2.0) * (1 + 1e-9)).all()
    assert np.linalg.eigvalsh(after.Pz).min() > 0
    assert np.diag(live.filter.estimate().with_variance_inflation(1e9).Pz) == pytest.approx(1.0)


@pytest.mark.slow
def test_correct_assumptions_give_no_doubt(guess: Vehicle, lanes: Record) -> None:
    assert learn(guess, lanes, CONSIDERING).doubts == ()
