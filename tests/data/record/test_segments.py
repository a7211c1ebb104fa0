"""Segments of a record above a speed."""

import numpy as np
import pytest

from fifthwheel.base.errors import SignalError
from fifthwheel.data.record import Record
from fifthwheel.data.record.record import segments_above
from fifthwheel.model.simulate import simulate
from fifthwheel.truck import get
from tests.estimate.observe.conftest import put, rows


@pytest.fixture(scope="module")
def record() -> Record:
    """16 s at 100 Hz."""
    return simulate(get("cheng_cebon_2011"), count=2, seed=7)


def test_segments_above_a_speed(record: Record) -> None:
    assert [len(segment) for segment in segments_above(record, 5.0)] == [len(record)]
    slow = put(put(record, "speed", 3, 4, 2.0), "speed", 15, 99, 2.0)
    spans = [segment.span for segment in segments_above(slow, 5.0)]
    np.testing.assert_allclose(spans, [(0, 2.99), (4, 14.99)])
    with_gap = rows(slow, (slow.time < 7) | (slow.time > 9.5))
    spans = [segment.span for segment in segments_above(with_gap, 5.0)]
    np.testing.assert_allclose(spans, [(0, 2.99), (4, 6.99), (9.51, 14.99)])
    for segment in segments_above(with_gap, 5.0):
        assert (segment.signals["speed"] >= 5).all()


def test_no_segment_is_fast_enough(record: Record) -> None:
    with pytest.raises(SignalError, match=r"^speed: "):
        segments_above(put(record, "speed", 0, 99, 2.0), 5.0)
    with pytest.raises(SignalError, match=r"^speed: "):
        segments_above(put(record, "speed", 0, 99, np.nan), 5.0)
