"""Files of states."""

import numpy as np
from pyarrow import parquet

from fifthwheel.estimate.observe import Observer, Status, write_states
from tests.estimate.observe.conftest import STEER, YAWS, put


def test_parquet_file(truck, lane_changes, tmp_path):
    record = put(lane_changes, "speed", 5, 6, 1.0)
    actual = Observer(truck, record.signals).batch(record)
    write_states([actual], tmp_path / "states.parquet")
    table = parquet.read_table(tmp_path / "states.parquet")
    names = [*actual.values, *[f"{name}.sigma" for name in actual.values]]
    assert set(table.column_names) == {"time", "status", "nis", "log", *names}
    np.testing.assert_array_equal(table["time"].to_numpy(), record.time)
    np.testing.assert_array_equal(table["status"].to_numpy(), actual.status)
    np.testing.assert_array_equal(table["nis"].to_numpy(), actual.nis)
    assert set(table["log"].to_pylist()) == {"simulated"}
    for name in actual.values:
        np.testing.assert_array_equal(table[name].to_numpy(), actual.values[name])
        np.testing.assert_array_equal(table[f"{name}.sigma"].to_numpy(), actual.sigma[name])
    assert np.isnan(table["sideslip.tractor"].to_numpy()[actual.status == Status.TOO_SLOW]).all()
    assert [path.name for path in tmp_path.iterdir()] == ["states.parquet"]


def test_logs_with_different_states_share_a_file(truck, lane_changes, tmp_path):
    with_roll = Observer(truck, lane_changes.signals).batch(lane_changes)
    without = Observer(truck, {"speed", STEER, *YAWS}).batch(lane_changes.cut(0, 3))
    object.__setattr__(without, "name", "second")
    write_states([without, with_roll], tmp_path / "states.parquet")
    table = parquet.read_table(tmp_path / "states.parquet")
    assert table.num_rows == len(with_roll.time) + len(without.time)
    logs = np.array(table["log"].to_pylist())
    assert set(logs) == {"second", "simulated"}
    roll = table["roll.semitrailer"].to_numpy()
    assert np.isnan(roll[logs == "second"]).all()
    np.testing.assert_array_equal(roll[logs == "simulated"], with_roll.values["roll.semitrailer"])
