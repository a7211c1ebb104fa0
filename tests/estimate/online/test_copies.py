"""Copies of a learner: by the copy module, by pickle, and in a forked process."""

import copy
import os
import pickle
from collections.abc import Callable

import pytest

from fifthwheel.data.record import Record
from fifthwheel.estimate.online import Learner
from fifthwheel.truck import Vehicle
from tests.estimate.online.conftest import FIVE, samples


@pytest.fixture
def halfway(guess: Vehicle, lanes: Record) -> Learner:
    """A learner within a segment with excitation."""
    learner = Learner(guess, lanes.signals, FIVE)
    learner.learn(lanes.cut(0.0, 2.5))
    return learner


def answers(learner: Learner, record: Record) -> list[dict[str, float]]:
    return [learner.push(sample) for sample in samples(record)]


@pytest.mark.parametrize("duplicate", [copy.copy, copy.deepcopy, lambda x: pickle.loads(pickle.dumps(x))])
def test_a_copy_continues_like_the_original(
    halfway: Learner, lanes: Record, duplicate: Callable[[Learner], Learner]
) -> None:
    before = halfway.parameters
    other = duplicate(halfway)
    rest = lanes.cut(2.51, 6.0)
    expected = answers(other, rest)
    assert halfway.parameters == before  # independent of its copy
    assert answers(halfway, rest) == expected
    assert halfway.parameters == other.parameters
    assert halfway.doubts == other.doubts


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs os.fork")
def test_a_forked_process_continues(halfway: Learner, lanes: Record) -> None:
    rest = lanes.cut(2.51, 3.5)
    reader, writer = os.pipe()
    process = os.fork()
    if not process:
        with os.fdopen(writer, "wb") as pipe:
            pickle.dump(answers(halfway, rest), pipe)
        os._exit(0)
    os.close(writer)
    with os.fdopen(reader, "rb") as pipe:
        forked = pickle.load(pipe)
    os.waitpid(process, 0)
    assert forked == answers(halfway, rest)
