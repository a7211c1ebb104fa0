"""Samples that pass through a pipe."""

import os
import threading

import numpy as np
import pytest

from fifthwheel.data.logs.readers.child import TooMuchError, receive, send

COLUMNS = (
    np.array([1.0, np.nan, -np.inf]),
    np.arange(6.0)[::2],
    np.zeros(0),
    np.array([1, 2], np.int16),
    np.array([True, False]),
)


@pytest.mark.parametrize("column", COLUMNS)
def test_samples_come_through_bit_for_bit(column: np.ndarray) -> None:
    reading, writing = os.pipe()
    sender = threading.Thread(target=send, args=(writing, {"name": "\udcff"}, [column, column]))
    sender.start()
    head, samples = receive(reading, 1e6)
    sender.join()
    assert head == {"name": "\udcff"}
    assert samples.dtype == np.float64
    for array in samples.reshape(2, -1):
        assert array.tobytes() == column.astype(float).tobytes()
        array[:] = 0.0  # can be written to
    send(writing, {}, [column])
    if column.size:
        with pytest.raises(TooMuchError):
            receive(reading, 8 * column.size - 1)
    os.close(reading)
    os.close(writing)
