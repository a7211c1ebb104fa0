"""Copies of an observer continue on their own; one in another process is tested with a learner."""

import copy
import pickle

import pytest

from fifthwheel.estimate.observe import Observer
from tests.estimate.observe.conftest import samples

COPIES = {"copy": copy.copy, "deepcopy": copy.deepcopy, "pickle": lambda o: pickle.loads(pickle.dumps(o))}


@pytest.mark.parametrize(("name", "before"), [("copy", 0), ("copy", 300), ("deepcopy", 300), ("pickle", 300)])
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
