"""Copies of an observer continue on their own, also in another process."""

import copy
import multiprocessing
import pickle

import numpy as np
import pytest

from fifthwheel.estimate.observe import Observer
from tests.estimate.observe.conftest import samples

COPIES = {"copy": copy.copy, "deepcopy": copy.deepcopy, "pickle": lambda o: pickle.loads(pickle.dumps(o))}


@pytest.mark.parametrize("name", COPIES)
@pytest.mark.parametrize("before", [0, 300])
def test_a_copy_continues_on_its_own(truck, lane_changes, name, before):
    """A copy that shared memory with its original changed the states of both."""
    o, reference = Observer(truck, lane_changes.signals), Observer(truck, lane_changes.signals)
    rows = list(samples(lane_changes))
    for sample in rows[:before]:
        o.push(sample)
        reference.push(sample)
    other = COPIES[name](o)
    for sample in rows[before : before + 50]:
        o.push(sample | {"speed": 20.0})
    again = COPIES[name](other)
    for one in (other, again):
        assert one.save() == reference.save()
    for sample in rows[before : before + 50]:
        expected = reference.push(sample)
        assert other.push(sample) == again.push(sample) == expected


def states_of(observer, record):
    return observer.batch(record).values["sideslip.semitrailer"]


@pytest.mark.slow
def test_an_observer_in_a_new_process(truck, lane_changes):
    """A forked one is tested with a learner."""
    o, record = Observer(truck, lane_changes.signals), lane_changes.cut(0, 3)
    expected = states_of(o, record)
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        actual = pool.apply_async(states_of, (o, record)).get(60)
    np.testing.assert_array_equal(actual, expected)
