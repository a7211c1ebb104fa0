"""A replay gives the states of the off-line observer."""

import numpy as np
import pytest

from fifthwheel.apps.live.sources.feed import read_trace, replay
from fifthwheel.apps.live.status import NodeStatus
from fifthwheel.data.logs import SignalMap, read_log
from fifthwheel.data.record import Record
from fifthwheel.estimate.observe import Observer
from tests.apps.live.truck_bus import SIGNALS, TRUCK, driven, frames, observer_node, write_candump, write_files


@pytest.mark.slow
def test_a_replay_of_simultaneous_messages_equals_the_offline_observer_to_the_last_bit(tmp_path):
    signal_map, start = write_files(tmp_path), 1_700_000_000.25
    write_candump(tmp_path / "run.log", frames(driven(), start=start))
    record = read_log(tmp_path / "run.log", signal_map)
    states = Observer(TRUCK, record.signals).batch(record)
    outputs = list(replay(observer_node(signal_map), read_trace(tmp_path / "run.log", []), speed=0))
    assert [output.time for output in outputs] == record.time.tolist()
    assert [output.bus_time for output in outputs] == pytest.approx(record.time + start // 1, abs=1e-6)
    for name, values in states.values.items():
        assert [output.states[name] for output in outputs] == values.tolist()
        assert [output.states[f"{name}.sigma"] for output in outputs] == states.sigma[name].tolist()
    assert [output.status for output in outputs] == states.status.tolist()
    assert {output.status for output in outputs[10:]} == {NodeStatus.OK}


def test_the_samples_of_a_node_give_the_same_states_offline_to_the_last_bit(tmp_path):
    signal_map = write_files(tmp_path)
    outputs = list(replay(observer_node(signal_map), frames(driven(), spread=0.0007), speed=0))
    samples = [sample for output in outputs for sample in output.samples]
    columns = {name: np.array([sample.get(name, np.nan) for sample in samples]) for name in SIGNALS}
    record = Record(time=np.array([sample["time"] for sample in samples]), signals=columns)
    states = Observer(TRUCK, SIGNALS).batch(record)
    for name, values in states.values.items():
        np.testing.assert_array_equal([output.states[name] for output in outputs], values)
    assert np.diff(record.time)[3:] == pytest.approx(0.01, abs=1e-6)


@pytest.mark.slow
def test_delays_of_the_map_are_those_of_the_offline_tools(tmp_path):
    write_files(tmp_path)
    path = tmp_path / "signals.toml"
    path.write_text(path.read_text().replace("sign = -1 }", 'sign = -1, delay = "30 ms" }'))
    signal_map = SignalMap.load(path)
    write_candump(tmp_path / "run.log", frames(driven()))
    record = read_log(tmp_path / "run.log", signal_map)
    outputs = list(replay(observer_node(signal_map), read_trace(tmp_path / "run.log", []), speed=0))
    samples = {sample["time"]: sample for output in outputs for sample in output.samples}
    yaw_rate = record.signals["yaw_rate.semitrailer"]
    compared = 0
    for time, value in zip(record.time.tolist(), yaw_rate.tolist(), strict=True):
        sample = next((s for at, s in samples.items() if abs(at - time) < 1e-6), None)
        if sample is not None and np.isfinite(value):
            assert sample["yaw_rate.semitrailer"] == value
            compared += 1
    assert compared > 700
    assert outputs[-1].time == pytest.approx(record.time[-1] - 0.03, abs=0.011)
