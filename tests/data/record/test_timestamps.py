import numpy as np
import pytest

from fifthwheel.data.record.timestamps import TimestampFilter


@pytest.mark.parametrize(
    ("time", "kept"),
    [
        ([0, 0.1, 0.1, 0.2, 0.15, 0.3], [0, 0.1, 0.2, 0.3]),
        ([0, 0.1, 900.0, 0.2, 0.3], [0, 0.1, 0.2, 0.3]),  # one corrupted timestamp
        ([0, np.nan, 0.1, -7.0, 0.2], [0, 0.1, 0.2]),
        ([10, 10.1, 0.1, 0.2], [10, 10.1, 0.1, 0.2]),  # another run: the reader of the log refuses it
        ([], []),
        ([1.0], [1.0]),
        ([2.0, 1.0], [2.0]),
    ],
)
def test_increasing_timestamps_are_kept(time, kept):
    time = np.array(time, dtype=float)
    timestamps = TimestampFilter()
    assert time[timestamps.keep("c", time)].tolist() == kept
    assert timestamps.dropped == time.size - len(kept)
    assert len(timestamps.notes) == (timestamps.dropped > 0)


def test_several_time_bases_are_independent():
    timestamps = TimestampFilter()
    assert timestamps.keep("a", np.array([0.0, 1.0])).all()
    assert timestamps.keep("b", np.array([0.5])).all()
    assert timestamps.keep("a", np.array([0.9, 1.0, 1.5])).tolist() == [False, False, True]
    assert timestamps.keep("b", np.array([0.6])).all()
