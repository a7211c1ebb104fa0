import numpy as np
import pytest

from fifthwheel.logs.stamps import Stamps


@pytest.mark.parametrize(
    ("time", "kept"),
    [
        ([0, 0.1, 0.1, 0.2, 0.15, 0.3], [0, 0.1, 0.2, 0.3]),
        ([0, 0.1, 900.0, 0.2, 0.3], [0, 0.1, 0.2, 0.3]),  # one stamp has gone wild
        ([0, np.nan, 0.1, -7.0, 0.2], [0, 0.1, 0.2]),
        ([10, 10.1, 0.1, 0.2], [10, 10.1, 0.1, 0.2]),  # another drive: whoever uses it complains
        ([], []),
        ([1.0], [1.0]),
        ([2.0, 1.0], [2.0]),
    ],
)
def test_what_follows_is_kept(time, kept):
    time = np.array(time, dtype=float)
    stamps = Stamps()
    assert time[stamps.keep("c", time)].tolist() == kept
    assert stamps.dropped == time.size - len(kept)
    assert len(stamps.notes) == (stamps.dropped > 0)


def test_pieces_of_several_clocks():
    stamps = Stamps()
    assert stamps.keep("a", np.array([0.0, 1.0])).all()
    assert stamps.keep("b", np.array([0.5])).all()
    assert stamps.keep("a", np.array([0.9, 1.0, 1.5])).tolist() == [False, False, True]
    assert stamps.keep("b", np.array([0.6])).all()
