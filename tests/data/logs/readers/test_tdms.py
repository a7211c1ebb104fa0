"""TDMS: written by npTDMS's own writer, read here in blocks."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fifthwheel.base.errors import SignalError

pytest.importorskip("nptdms")
from nptdms import ChannelObject, GroupObject, RootObject, TdmsWriter

from fifthwheel.data.logs.readers import open_log as open_any
from fifthwheel.data.logs.readers import tdms
from fifthwheel.data.logs.readers.tdms import open_log
from tests.data.logs.readers.reading import read

START = np.datetime64("2024-05-06T07:08:09.250000", "us")
SECONDS = 1714979289.25
COUNT = 1000


def waveform(group: str, name: str, values: Any, *, late: float = 0.0, step: float = 0.01, unit: str = "") -> Any:
    properties = {
        "wf_increment": step,
        "wf_start_offset": 0.0,
        "wf_start_time": START + np.timedelta64(round(late * 1e6), "us"),
        "unit_string": unit,
    }
    return ChannelObject(group, name, np.asarray(values), properties=properties)


def save(path: Path, *segments: list[Any]) -> Path:
    with TdmsWriter(path) as writer:
        for segment in segments:
            writer.write_segment([RootObject(), *segment])
    return path


def test_waveforms_of_two_rates_and_starts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tdms, "_ROWS", 70)
    values = np.arange(COUNT) * 0.5
    path = save(
        tmp_path / "a.tdms",
        [
            waveform("imu", "gyro", values, unit="deg/s"),
            waveform("imu", "count", np.arange(COUNT, dtype=np.int16)),
            waveform("imu", "slow", values[:10], step=1.0),
            waveform("gps", "gyro", values[:500], late=0.5, step=0.02, unit="rad/s"),
            ChannelObject("imu", "text", ["a", "b"]),
        ],
        [
            waveform("imu", "gyro", values + 500, unit="deg/s"),
            waveform("imu", "count", np.arange(COUNT, dtype=np.int16)),
        ],
    )
    with open_log(path) as log:
        assert {n: (c.unit, c.clock) for n, c in log.columns.items()} == {
            "gyro@imu": ("deg/s", "imu"),
            "count": (None, "imu"),
            "slow": (None, "imu'"),
            "gyro@gps": ("rad/s", "gps"),
        }
        found = read(log)
        np.testing.assert_array_equal(found["gyro@imu"][1], np.r_[values, values + 500])
        np.testing.assert_allclose(found["gyro@imu"][0], SECONDS + np.arange(2 * COUNT) * 0.01, rtol=0, atol=1e-6)
        np.testing.assert_array_equal(found["slow"][0], SECONDS + np.arange(10.0))
        np.testing.assert_allclose(found["gyro@gps"][0], SECONDS + 0.5 + 0.02 * np.arange(500), rtol=0, atol=1e-6)
        assert list(read(log, "count")) == ["count"]
        assert log.notes == []


@pytest.mark.parametrize("dated", [False, True])
def test_a_time_channel(tmp_path: Path, dated: bool) -> None:
    time = np.arange(COUNT) * 10.0
    stamps = START + np.round(time * 1000).astype("timedelta64[us]")
    name = "when" if dated else "Time"
    stated = ChannelObject("g", name, stamps if dated else time, properties={} if dated else {"unit_string": "ms"})
    path = save(
        tmp_path / "a.tdms", [GroupObject("g"), stated, ChannelObject("g", "v", time), ChannelObject("h", "w", time)]
    )
    with open_log(path) as log:
        assert list(log.columns) == ["v"]
        np.testing.assert_allclose(read(log)["v"][0], time / 1000 + (SECONDS if dated else 0), rtol=0, atol=1e-6)
        assert log.notes == ["channel 'w' of group 'h' left out: it has no time"]


def test_other_channels(tmp_path: Path) -> None:
    """A shorter one ends with missing samples; scaled integers; a start that is not set, for which LabVIEW writes
    the begin of its calendar."""
    scaled = waveform("g", "scaled", np.arange(10, dtype=np.int16))
    scaled.properties |= {
        "NI_Number_Of_Scales": np.int32(1),
        "NI_Scale[0]_Scale_Type": "Linear",
        "NI_Scale[0]_Linear_Slope": 0.25,
        "NI_Scale[0]_Linear_Y_Intercept": -3.0,
        "NI_Scale[0]_Linear_Input_Source": np.uint32(0xFFFFFFFF),
    }
    channels = [waveform("g", "a", np.ones(10)), waveform("g", "b", np.ones(7)), scaled]
    for channel in channels:
        channel.properties["wf_start_time"] = np.datetime64("1904-01-01T00:00:00", "us")
    with open_log(save(tmp_path / "a.tdms", channels)) as log:
        found = read(log)
        np.testing.assert_array_equal(found["a"][0], 0.01 * np.arange(10))
        np.testing.assert_array_equal(np.isnan(found["b"][1]), np.arange(10) >= 7)
        np.testing.assert_allclose(found["scaled"][1], 0.25 * np.arange(10) - 3)


def test_an_index_beside_the_file_is_not_used(tmp_path: Path) -> None:
    """Nor is garbage read."""
    path = save(tmp_path / "a.tdms", [waveform("g", "a", np.ones(10))])
    index = tmp_path / "a.tdms_index"
    index.write_bytes(b"TDSh an old one")
    with open_any(path) as log:
        assert list(log.columns) == ["a"]
    with pytest.raises(SignalError, match=r"a\.tdms_index: the index of a TDMS file; give the \.tdms file"):
        open_any(index)
    for content in (b"TDSm", b"TDSm" + b"\xff" * 40, b"TDSm\x0e\0\0\0\x69\x12\0\0" + b"\xfe" * 60):
        path.write_bytes(content)
        with pytest.raises(SignalError, match=r"^a\.tdms: "):
            open_any(path)
