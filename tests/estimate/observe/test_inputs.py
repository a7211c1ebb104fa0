"""Implausible speeds, steer angles and measurements count as missing."""

import numpy as np
import pytest

from fifthwheel.estimate.observe import Observer, Status
from tests.estimate.observe.conftest import ROLLS, STEER, YAWS, assert_same, batched, but_settling, pushed, put


@pytest.mark.parametrize(
    ("name", "value", "duration"),
    [
        (STEER, 0.5, 0.01),
        (STEER, 10.0, 0.01),
        (STEER, 10.0, 0.2),
        (STEER, 1e300, 0.01),
        (STEER, -1e300, 0.2),
        ("speed", 1e300, 0.2),
        ("speed", 44.0, 0.1),
        ("speed", 0.0, 0.01),
        (YAWS[0], 1e300, 1.0),
        (ROLLS[1], -1e300, 1.0),
    ],
)
def test_an_implausible_value_counts_as_missing(truck, lane_changes, name, value, duration):
    """One sample of 10 rad of steer angle made the states wrong for seconds, one of 1e300 for ever."""
    record = lane_changes.cut(7.5, 10.0)
    wrong, missing = (put(record, name, 8.0, 8.0 + duration - 1e-9, v) for v in (value, np.nan))
    o = Observer(truck, lane_changes.signals)
    actual = batched(o, wrong)
    assert_same(actual, batched(o, missing))
    assert_same(pushed(o, wrong), actual)
    assert (but_settling(actual["status"]) == Status.OK).all()
