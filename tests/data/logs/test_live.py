"""Live samples give what the same samples give in a file."""

import numpy as np
import pytest

from fifthwheel.base.errors import SignalError
from fifthwheel.data.logs import LiveMap, SignalMap, read_log

MAP = """
time = {column = "stamp", unit = "ms"}
[signals]
speed = "v [km/h]"
"steer.tractor.front" = {column = "wheel", unit = "deg", sign = -1, gain = 0.05, offset = "0.1 deg", delay = "15 ms"}
"yaw_rate.tractor" = {column = "gyro", points = [[0, -10], [1, 0], [5, 20]], unit = "deg/s", delay = "200 ms"}
"yaw_rate.semitrailer" = {sum = ["gyro2 [deg/s]", "hitch [deg/s]"], delay = "-3 ms"}
[reference]
"lateral_velocity.tractor" = "vy"
"""
COLUMNS = ("stamp", "v [km/h]", "wheel", "gyro", "gyro2 [deg/s]", "hitch [deg/s]", "roll_rate.tractor [deg/s]", "vy")


def rows(count=200):
    random = np.random.default_rng(1)
    values = random.normal(size=(count, len(COLUMNS))).round(6)
    values[:, 0] = 10.0 * np.arange(count)
    values[:, 1] += 80
    values[random.random(values.shape) < 0.03] = np.nan
    values[:, 0] = 10.0 * np.arange(count)
    return values


@pytest.mark.parametrize("text", [MAP, MAP.replace(', delay = "15 ms"', "").replace(', delay = "200 ms"', "")])
def test_live_samples_are_those_of_a_file(tmp_path, text):
    values = rows()
    path = tmp_path / "run.csv"
    lines = [",".join("" if np.isnan(cell) else repr(float(cell)) for cell in row) for row in values]
    path.write_text("\n".join([",".join(COLUMNS), *lines]) + "\n")
    signal_map = SignalMap.parse(text + "\n")
    fast = signal_map.model_copy(update={"time": signal_map.time.model_copy(update={"rate": 1e4})})  # not decimated
    record = read_log(path, fast)
    live = LiveMap(signal_map, COLUMNS)
    samples = [s for row in values for s in live.push(dict(zip(COLUMNS, row.tolist(), strict=True)))]
    time = np.array([sample["time"] for sample in samples])
    assert (np.diff(time) > 0).all()
    np.testing.assert_allclose(time, record.time[: len(time)], atol=1e-9)
    assert record.time[len(time)] > 1.99 - live.latency  # the others wait for later samples
    for name, expected in record.signals.items():
        got = np.array([sample.get(name, np.nan) for sample in samples])
        np.testing.assert_allclose(got, expected[: len(time)], rtol=1e-12, atol=1e-15, err_msg=name)
    assert not {"lateral_velocity.tractor"} & {name for sample in samples for name in sample}


@pytest.mark.parametrize("first", [1.0, 359.0])
def test_an_angle_that_wraps_is_continuous_and_near_0(first):
    live = LiveMap(SignalMap(), ["time", "speed", "steer.tractor.front [deg]"])
    angle = first + np.array([0, 1, 0, -2, -4, -2, 2, 4, -1])
    angles = []
    for k, value in enumerate(angle % 360):
        (sample,) = live.push({"time": 0.01 * k, "speed": 20.0, "steer.tractor.front [deg]": value})
        angles.append(np.degrees(sample["steer.tractor.front"]))
    wrapped = int(np.argmax(np.abs(np.diff(angle % 360)) > 180)) + 1
    np.testing.assert_allclose(angles[wrapped:], (angle - 360 * (first > 180))[wrapped:], atol=1e-9)


def test_a_fault_changes_nothing():
    """Without delays every sample is returned at once."""
    live = LiveMap(SignalMap(), ["time", "speed [km/h]", "yaw_rate.tractor"])
    assert live.latency == 0
    for sample in ({"speed [km/h]": 1.0}, {"time": None}, {"time": float("nan")}, {"time": float("inf")}):
        with pytest.raises(SignalError, match="time: expected a time after -inf s"):
            live.push(sample)
    assert live.push({"time": 0.0, "speed [km/h]": 36.0}) == [{"time": 0.0, "speed": 10.0}]
    with pytest.raises(SignalError, match="time: expected a time after 0 s, got 0"):
        live.push({"time": 0.0})
    sample = {"time": 2.0, "speed [km/h]": None, "yaw_rate.tractor": 0.5}
    assert live.push(sample) == [{"time": 2.0, "yaw_rate.tractor": 0.5}]


@pytest.mark.parametrize(
    ("text", "columns", "message"),
    [
        ('[signals]\nspeed = "vx"', ["t", "v"], "no column 'vx'"),
        ('[signals]\nspeed = "v"', ["clock", "v"], "no column named 'time' or 't'"),
        ('[signals.speed]\ncolumn = "v"\ntime = "t2"', ["t", "v", "t2"], "speed: has timestamps of its own"),
    ],
)
def test_a_map_that_does_not_fit_is_refused(text, columns, message):
    with pytest.raises(SignalError, match=message):
        LiveMap(SignalMap.parse(text), columns)


def test_a_long_delay_keeps_its_inputs():
    """The steer angle of an instant is still there when the gyro of that instant comes a second later."""
    signal_map = SignalMap.parse('[signals."yaw_rate.tractor"]\ncolumn = "gyro"\ndelay = 5.0')
    live = LiveMap(signal_map, ["t", "speed", "gyro"])
    samples = [s for k in range(2000) for s in live.push({"t": k / 100, "speed": float(k), "gyro": float(k)})]
    inside = [sample for sample in samples if sample["time"] >= 0]
    assert len(inside) == 1500
    assert all(sample["speed"] == pytest.approx(100 * sample["time"]) for sample in inside)
    assert all(sample["yaw_rate.tractor"] == pytest.approx(100 * sample["time"] + 500) for sample in inside)
