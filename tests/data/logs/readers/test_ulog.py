"""ULog: messages written here as the specification of PX4 describes them."""

import struct
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pytest

from fifthwheel.base.errors import SignalError

pytest.importorskip("pyulog")

from fifthwheel.data.logs.readers import open_log as open_any
from fifthwheel.data.logs.readers import ulog
from fifthwheel.data.logs.readers.ulog import open_log
from tests.data.logs.readers.reading import read

COUNT = 500


def message(kind: str, body: bytes) -> bytes:
    return struct.pack("<HB", len(body), ord(kind)) + body


def header() -> bytes:
    formats = [
        "gyro:uint64_t timestamp;float[3] xyz;uint8_t n;char[4] id;uint8_t[3] _padding0;",
        "wheel:uint64_t timestamp;double speed;",
    ]
    start = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0) + message("B", bytes(40))
    return start + b"".join(message("F", text.encode()) for text in formats)


def subscriptions() -> bytes:
    named = [(0, 0, "gyro"), (1, 1, "gyro"), (0, 2, "wheel")]
    return b"".join(message("A", struct.pack("<BH", number, key) + name.encode()) for number, key, name in named)


def samples() -> Iterable[bytes]:
    for k in range(COUNT):
        time = 10**6 + k * 4000
        for key in (0, 1):
            yield message("D", struct.pack("<HQ3fB4s", key, time, 0.5 * k, -k, key, k % 256, b"abcd"))
        if k % 5 == 0:
            yield message("D", struct.pack("<HQd", 2, time, k / 7))


def save(path: Path, *more: bytes) -> Path:
    path.write_bytes(header() + subscriptions() + b"".join(samples()) + b"".join(more))
    return path


def test_topics_are_clocks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ulog, "_ROWS", 130)
    with open_log(save(tmp_path / "a.ulg")) as log:
        fields = ("xyz[0]", "xyz[1]", "xyz[2]", "n")
        names = [*(f"gyro_{k}.{field}" for k in (0, 1) for field in fields), "wheel.speed"]
        assert list(log.columns) == names
        found = read(log)
        np.testing.assert_array_equal(found["gyro_1.xyz[1]"][1], -np.arange(COUNT))
        np.testing.assert_array_equal(found["gyro_1.xyz[2]"][1], np.ones(COUNT))
        np.testing.assert_allclose(found["gyro_0.n"][0], 1 + 0.004 * np.arange(COUNT))
        np.testing.assert_array_equal(found["wheel.speed"][1], np.arange(0, COUNT, 5) / 7)
        assert list(read(log, "wheel.speed")) == ["wheel.speed"]
        assert log.notes == []


def test_damage_and_lost_samples_are_noted(tmp_path: Path) -> None:
    lost = [message("O", struct.pack("<H", duration)) for duration in (300, 500)]
    with open_log(save(tmp_path / "a.ulg", *lost)) as log:
        assert log.notes == ["the logger lost samples 2 times, 0.8 s in all"]
    path = save(tmp_path / "a.ulg", message("D", struct.pack("<HQ", 9, 0)))
    with open_log(path) as log:
        assert log.notes == ["damaged: messages are missing or wrong; copy it again from the logger"]
        assert read(log)["gyro_0.n"][1].size == COUNT
    path.write_bytes(header() + subscriptions())
    with pytest.raises(SignalError, match=r"a\.ulg: a ULog file without samples"):
        open_any(path)
