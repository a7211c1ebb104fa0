"""Doubts of a learner, and that no estimate is confidently wrong."""

import copy

import numpy as np
import pytest

from fifthwheel.data.record import Record
from fifthwheel.estimate.identify.doubts import DoubtKind
from fifthwheel.estimate.identify.verdict import Verdict
from fifthwheel.estimate.online import Learner
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
