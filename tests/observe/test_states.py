"""The states in a file."""

import numpy as np
import pytest
from pyarrow import parquet

from fifthwheel.observe import Observer, Status, save

from .conftest import STEER, YAWS, put


def test_states_in_a_parquet_file(truck, drive, tmp_path):
    record = put(drive, "speed", 5, 6, 1.0)
    found = Observer(truck, record.signals).batch(record)
    save([found], tmp_path / "states.parquet")
    table = parquet.read_table(tmp_path / "states.parquet")
    names = [*found.values, *[f"{name}.sigma" for name in found.values]]
    assert set(table.column_names) == {"time", "status", "log", *names}
    np.testing.assert_array_equal(table["time"].to_numpy(), record.time)
    np.testing.assert_array_equal(table["status"].to_numpy(), found.status)
    assert set(table["log"].to_pylist()) == {"simulated"}
    for name in found.values:
        np.testing.assert_array_equal(table[name].to_numpy(), found.values[name])
        np.testing.assert_array_equal(table[f"{name}.sigma"].to_numpy(), found.sigma[name])
    assert np.isnan(table["sideslip.tractor"].to_numpy()[found.status == Status.TOO_SLOW]).all()
    assert [path.name for path in tmp_path.iterdir()] == ["states.parquet"]


def test_logs_with_other_states_share_a_file(truck, drive, tmp_path):
    with_roll = Observer(truck, drive.signals).batch(drive)
    without = Observer(truck, {"speed", STEER, *YAWS}).batch(drive.cut(0, 3))
    object.__setattr__(without, "name", "second")
    save([without, with_roll], tmp_path / "states.parquet")
    table = parquet.read_table(tmp_path / "states.parquet")
    assert table.num_rows == len(with_roll.time) + len(without.time)
    logs = np.array(table["log"].to_pylist())
    assert set(logs) == {"second", "simulated"}
    roll = table["roll.semitrailer"].to_numpy()
    assert np.isnan(roll[logs == "second"]).all()
    np.testing.assert_array_equal(roll[logs == "simulated"], with_roll.values["roll.semitrailer"])


def test_nothing_is_left_behind_when_writing_fails(truck, drive, tmp_path):
    found = Observer(truck, drive.signals).batch(drive)
    with pytest.raises(OSError, match="missing"):
        save([found], tmp_path / "missing" / "states.parquet")
    assert list(tmp_path.iterdir()) == []
