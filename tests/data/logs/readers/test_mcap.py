"""MCAP: written by its own writers, read here."""

import importlib
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fifthwheel.base.errors import SignalError

pytest.importorskip("mcap")
from mcap.writer import CompressionType, Writer

from fifthwheel.data.logs.readers import mcap
from fifthwheel.data.logs.readers.mcap import open_log
from tests.data.logs.readers.reading import read

START = 1_700_000_000
STEP = 10_000_000
LOGGED = START + np.arange(300) / 100
MESSAGE = """std_msgs/Header header
float64 yaw
float32[3] cov
string s
bool ok
geometry_msgs/Vector3 v
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: geometry_msgs/Vector3
float64 x
float64 y
"""


def save(
    path: Path,
    topics: dict[str, Callable[[int], Any]],
    count: int = 300,
    encoding: str = "json",
    stamps: Callable[[int], int] = lambda k: k * STEP,
    **more: Any,
) -> Path:
    with path.open("wb") as file:
        writer = Writer(file, **({"chunk_size": 3000} | more))
        writer.start()
        schema = writer.register_schema("my/Schema", "jsonschema", b"{}")
        channels = {topic: writer.register_channel(topic, encoding, schema) for topic in topics}
        for k in range(count):
            for topic, message in topics.items():
                data = json.dumps(message(k)).encode()
                writer.add_message(channels[topic], START * 10**9 + stamps(k), data, publish_time=0)
        writer.finish()  # type: ignore[no-untyped-call]
    return path


@pytest.mark.parametrize(
    ("compression", "chunked"), [*((kind, True) for kind in CompressionType), (CompressionType.NONE, False)]
)
def test_json(tmp_path: Path, compression: CompressionType, chunked: bool) -> None:
    path = save(
        tmp_path / "a.mcap",
        {
            "/imu/data": lambda k: {"a": {"b": k / 2}, "l": [k, 2, 3], "s": "abc", "long": [0] * 17, "ok": k > 5},
            "/few": lambda k: {"x": k} if k < 250 else {"x": None, "late": 1},
        },
        compression=compression,
        use_chunking=chunked,
    )
    with open_log(path) as log:
        names = ["imu/data.a.b", *(f"imu/data.l[{k}]" for k in range(3)), "imu/data.ok", "few.x"]
        assert sorted(log.columns) == sorted(names)
        assert log.notes == ["lists of more than 16 numbers in '/imu/data' left out: long"]
        found = read(log)
        np.testing.assert_array_equal(found["imu/data.a.b"][1], np.arange(300) / 2)
        np.testing.assert_allclose(found["imu/data.a.b"][0], LOGGED, atol=3e-7)
        np.testing.assert_array_equal(found["imu/data.ok"][1], np.arange(300) > 5)
        np.testing.assert_array_equal(found["few.x"][1], np.r_[np.arange(250.0), np.full(50, np.nan)])
        assert list(read(log, "few.x")) == ["few.x"]
        with pytest.raises(SignalError, match="no column 'few'"):
            list(log.chunks(["few"]))


def ros2(path: Path, stamp: Callable[[int], float], count: int = 300) -> Path:
    writer_module = pytest.importorskip("mcap_ros2.writer")
    with path.open("wb") as file:
        writer = writer_module.Writer(file, chunk_size=3000)
        schema = writer.register_msgdef("my/Imu", MESSAGE)
        for k in range(count):
            seconds, rest = divmod(round(stamp(k) * 1000), 1000)
            header = {"stamp": {"sec": seconds, "nanosec": rest * 10**6}, "frame_id": "a"}
            message = {
                "header": header,
                "yaw": k * 0.1,
                "cov": [1.0, 2.0, k],
                "s": "q",
                "ok": True,
                "v": {"x": k, "y": 2},
            }
            writer.write_message("/imu", schema, message, START * 10**9 + k * STEP, publish_time=0)
        writer.finish()
    return path


def test_ros2_has_the_stamp_of_its_header(tmp_path: Path) -> None:
    with open_log(ros2(tmp_path / "a.mcap", lambda k: START - 0.005 + k / 100)) as log:
        assert list(log.columns) == ["imu.yaw", *(f"imu.cov[{k}]" for k in range(3)), "imu.ok", "imu.v.x", "imu.v.y"]
        found = read(log)
        np.testing.assert_array_equal(found["imu.yaw"][1], np.arange(300) * 0.1)
        np.testing.assert_array_equal(found["imu.cov[2]"][1], np.arange(300))
        np.testing.assert_allclose(found["imu.yaw"][0], LOGGED - 0.005, atol=3e-7)
        assert log.notes == []


@pytest.mark.parametrize("stamp", [lambda k: 0, lambda k: START, lambda k: 5 + k / 100])
def test_stamps_of_no_use_or_another_clock_give_way(tmp_path: Path, stamp: Callable[[int], float]) -> None:
    with open_log(ros2(tmp_path / "a.mcap", stamp)) as log:
        np.testing.assert_allclose(read(log, "imu.yaw")["imu.yaw"][0], LOGGED, atol=3e-7)


def test_protobuf(tmp_path: Path) -> None:
    writer_module = pytest.importorskip("mcap_protobuf.writer")

    Timestamp = importlib.import_module("google.protobuf.timestamp_pb2").Timestamp
    ListValue = importlib.import_module("google.protobuf.struct_pb2").ListValue
    path = tmp_path / "a.mcap"
    with path.open("wb") as file, writer_module.Writer(file) as writer:
        for k in range(20):
            at = START * 10**9 + k * STEP
            writer.write_message("/clock", Timestamp(seconds=k, nanos=k * 2), at, at)
            writer.write_message("/list", ListValue(), at, at)
    with open_log(path) as log:
        np.testing.assert_array_equal(read(log)["clock.nanos"][1], np.arange(20) * 2)
        assert list(log.columns) == ["clock.seconds", "clock.nanos"]


def test_what_cannot_be_decoded(tmp_path: Path) -> None:
    path = save(tmp_path / "a.mcap", {"/x": lambda k: {}}, encoding="flatbuffer")
    with pytest.raises(SignalError, match="topic '/x' left out: message encoding 'flatbuffer' is not supported"):
        open_log(path)
    path = save(tmp_path / "b.mcap", {"/x": lambda k: {}}, encoding="ros1")
    with pytest.raises(SignalError, match=r"messages of ROS 1 are not decoded.*convert it to ROS 2"):
        open_log(path)


def test_chunks_are_bounded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Messages that are a little late are put in order."""
    path = save(tmp_path / "a.mcap", {"/x": lambda k: {"k": k}}, stamps=lambda k: (k ^ 1) * STEP)
    with open_log(path) as log:
        np.testing.assert_array_equal(read(log)["x.k"][1], np.arange(300) ^ 1)
        assert log.notes == []
    monkeypatch.setattr(mcap, "_CHUNK_ROWS", 120)
    with open_log(save(tmp_path / "a.mcap", {"/x": lambda k: {"k": k}}, stamps=lambda k: min(k, 298) * STEP)) as log:
        assert [chunk.values["x.k"].size for chunk in log.chunks(["x.k"])] == [120, 120, 59]
        assert log.notes == ["1 sample of 'x' left out: timestamps must increase"]


def test_cut_short(tmp_path: Path) -> None:
    path = save(tmp_path / "a.mcap", {"/x": lambda k: {"k": k}}, compression=CompressionType.NONE)
    path.write_bytes(path.read_bytes()[:9000])
    told: list[float] = []
    with open_log(path, progress=told.append) as log:
        count = read(log)["x.k"][1].size
        assert 100 < count < 300
        assert log.notes[0].startswith(
            f"broken after {count} messages, at 17000000{count / 100 - 0.01:04.1f} s: after byte "
        )
        assert told
    path.write_bytes(path.read_bytes()[:200])
    with pytest.raises(SignalError, match=r"a\.mcap: nothing can be read of this MCAP file.*mcap recover"):
        open_log(path)
