"""Parquet: a sample of a large file."""

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from fifthwheel.data.logs import source
from fifthwheel.data.logs.readers import parquet


@pytest.mark.parametrize("group", [50, 20_000])
def test_a_sample_of_a_large_file_is_spread_over_it(tmp_path, monkeypatch, group):
    path = tmp_path / "run.parquet"
    rows = np.arange(20_000)
    pq.write_table(pa.table({"t": rows / 100, "r": 0.5 * rows}), path, row_group_size=group)
    with parquet.open_log(path) as log:
        log.sample()
        assert not log.sampled, "it is small"
    monkeypatch.setattr(source, "_LARGE", 1e3)
    monkeypatch.setattr(source, "_PART", 10.0)
    monkeypatch.setattr(parquet, "_ROWS", 700)
    with parquet.open_log(path) as log:
        log.sample()
        assert log.sampled
        chunks = list(log.chunks(["t", "r"]))
        assert [note[:42] for note in log.notes] == ["a sample of 0 of 0 MB was read, in 8 parts"]
    found = {name: np.concatenate([chunk.values[name] for chunk in chunks]) for name in ("t", "r")}
    numbers = np.rint(100 * found["t"]).astype(int)
    np.testing.assert_array_equal(found["r"], 0.5 * numbers)
    assert (numbers[0], numbers[-1]) == (0, 19_999)
    assert (np.diff(numbers) > 1).sum() == 7
    assert numbers.size == 8 * 200
    assert [chunk.done for chunk in chunks] == sorted(chunk.done for chunk in chunks)
    assert chunks[-1].done == 1.0
