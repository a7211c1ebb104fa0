"""ASAM MDF: written by asammdf, read here; and by hand what asammdf does not write."""

import struct
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fifthwheel.errors import SignalError
from fifthwheel.logs.readers import mdf_rows
from fifthwheel.logs.readers.mf4 import open_log

from .damage import pieces_of_damaged
from .reading import read

pytest.importorskip("asammdf")
from asammdf import MDF, Signal, Source

T = np.arange(400) / 100
RAW = (np.arange(400) % 160).astype("u1")
TABLE = {f"raw_{k}": k * 20.0 for k in range(8)} | {f"phys_{k}": float(k * k) for k in range(8)}
CONVERSIONS: dict[str, dict[str, Any]] = {
    "linear": {"a": 0.5, "b": 1.0},
    "rational": {"P1": 0.0, "P2": 2.0, "P3": 1.0, "P4": 0.0, "P5": 0.0, "P6": 4.0},
    "interpolated": TABLE | {"interpolation": True},
    "nearest": TABLE | {"interpolation": False},
    "formula": {"formula": "3*X+sin(X)"},
    "states": {"val_0": 0, "text_0": b"off", "val_1": 1, "text_1": b"on"},
}
EXPECTED = {
    "linear": RAW * 0.5 + 1,
    "rational": (2.0 * RAW + 1) / 4,
    "interpolated": np.interp(RAW, np.arange(8) * 20.0, np.arange(8.0) ** 2),
    "nearest": np.ceil(RAW / 20 - 0.5).clip(0, 7) ** 2,
    "formula": 3.0 * RAW + np.sin(RAW.astype(float)),
    "states": RAW.astype(float),
}


def save(path: Path, *groups: Any, version: Any = "4.10", compression: Any = 0, **more: Any) -> Path:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        mdf = MDF(version=version, **more)
        for signals, label in groups:
            mdf.append(signals, acq_name=label)
        saved = mdf.save(path, overwrite=True, compression=compression)
        mdf.close()
    return Path(saved)


@pytest.mark.parametrize("version", ["2.14", "3.30", "4.00", "4.10", "4.20"])
@pytest.mark.parametrize("compression", [0, 1, 2])
def test_what_asammdf_writes(tmp_path: Path, version: str, compression: int) -> None:
    kinds = ["i1", "i2", "i4", "i8", "u2", "u4", "u8", "f4", "f8", ">i2", ">f8", "?"]
    numbers = {kind: (np.arange(400) * 0.3 - 40 * ("u" not in kind)).astype(kind) for kind in kinds}
    signals = [
        Signal(RAW, T, name=name, conversion=dict(rule), unit=f"u {name}", comment=f"about {name}")
        for name, rule in CONVERSIONS.items()
    ]
    signals += [Signal(values, T, name=f"number {kind}") for kind, values in numbers.items()]
    signals.append(Signal(np.array([b"abc"] * 400), T, name="text", encoding="latin-1"))
    slow = [Signal(np.arange(4.0), T[::100], name="slow", unit="m/s")]
    path = save(tmp_path / "a.mf4", (signals, "fast"), (slow, "slow"), version=version, compression=compression)
    with open_log(path) as log:
        assert list(log.columns) == [*CONVERSIONS, *(f"number {kind}" for kind in kinds), "slow"]
        assert log.columns["slow"].unit == "m/s"
        assert log.columns["linear"].unit == "u linear"
        assert log.columns["linear"].about == "about linear"
        assert log.columns["linear"].clock != log.columns["slow"].clock
        found = read(log)
        for name, expected in EXPECTED.items():
            np.testing.assert_allclose(found[name][1], expected, rtol=1e-15)
            np.testing.assert_array_equal(found[name][0], T)
        for kind, values in numbers.items():
            np.testing.assert_array_equal(found[f"number {kind}"][1], values.astype(float))
        np.testing.assert_array_equal(found["slow"][0], T[::100])
        assert log.notes == []


@pytest.mark.parametrize("columns", [False, True])
def test_invalid_samples_are_missing(tmp_path: Path, columns: bool) -> None:
    bad = np.arange(400) % 3 == 0
    signals = [
        Signal(np.arange(400.0), T, name="a", invalidation_bits=bad),
        Signal(np.arange(400.0), T, name="b", invalidation_bits=~bad),
    ]
    version = "4.20" if columns else "4.10"
    path = save(tmp_path / "a.mf4", (signals, "g"), version=version, column_storage=columns)
    with open_log(path) as log:
        found = read(log)
    np.testing.assert_array_equal(found["a"][1], np.where(bad, np.nan, np.arange(400.0)))
    np.testing.assert_array_equal(found["b"][1], np.where(bad, np.arange(400.0), np.nan))
    np.testing.assert_array_equal(found["a"][0], T)


def test_a_name_in_several_groups(tmp_path: Path) -> None:
    groups = [([Signal(T + k, T, name="yaw_rate"), Signal(T, T, name=f"only_{k}")], "imu" if k else "") for k in (0, 1)]
    with open_log(save(tmp_path / "a.mf4", *groups)) as log:
        assert list(log.columns) == ["yaw_rate@0", "only_0", "yaw_rate@imu", "only_1"]
        np.testing.assert_array_equal(read(log, "yaw_rate@imu")["yaw_rate@imu"][1], T + 1)
        with pytest.raises(SignalError, match="several sources"):
            log.find("yaw_rate")
        with pytest.raises(SignalError, match="no column 'speed'"):
            list(log.pieces(["speed"]))


def test_pieces_are_pieces(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = save(tmp_path / "a.mf4", ([Signal(T, T, name="a"), Signal(-T, T, name="b")], "g"))
    monkeypatch.setattr(mdf_rows, "PIECE_ROWS", 150)
    with open_log(path) as log:
        pieces = list(log.pieces(["a"]))
        assert [piece.values["a"].size for piece in pieces] == [150, 150, 100]
        assert [list(piece.values) for piece in pieces] == [["a"]] * 3
        assert [round(piece.done, 3) for piece in pieces] == [0.375, 0.75, 1.0]
        np.testing.assert_array_equal(read(log, "a")["a"][1], read(log, "a")["a"][0])


def test_time_that_does_not_rise(tmp_path: Path) -> None:
    stamps = np.array([0.0, 0.1, 0.1, 0.2, 0.15, 0.3, 0.4])
    path = save(tmp_path / "a.mf4", ([Signal(np.arange(7.0), stamps, name="a")], "g"))
    with open_log(path) as log:
        np.testing.assert_array_equal(read(log)["a"][1], [0, 1, 3, 5, 6])
        read(log)
        assert log.notes == ["2 samples of 'g' left out: their time does not rise"]
    other = np.array([0.0, 5.0, 5.1, 0.1, 0.2, 0.3])
    with open_log(save(tmp_path / "b.mf4", ([Signal(np.arange(6.0), other, name="a")], "g"))) as log:
        np.testing.assert_array_equal(read(log)["a"][0], other)  # another drive: whoever uses it complains


def can_frames(count: int = 200) -> Any:
    """VDC2 of J1939 from source 0B on bus 1, with a yaw rate that rises, as asammdf wants a bus log."""
    payload = np.full((count, 8), 0xFF, np.uint8)
    raw = (np.arange(count) * 8 + 32000).astype("<u2")
    payload[:, 3:5] = raw.view(np.uint8).reshape(-1, 2)
    fields = [
        np.full(count, 1, "u1"),
        np.full(count, 0x18F0090B, "<u4"),
        np.ones(count, "u1"),
        np.full(count, 8, "u1"),
        np.full(count, 8, "u1"),
        payload,
    ]
    names = [f"CAN_DataFrame.{n}" for n in ("BusChannel", "ID", "IDE", "DLC", "DataLength", "DataBytes")]
    types = [(n, f.dtype, f.shape[1:]) for n, f in zip(names, fields, strict=True)]
    samples = np.rec.fromarrays(fields, dtype=types)
    source = Source(source_type=Source.SOURCE_BUS, bus_type=Source.BUS_TYPE_CAN, name="CAN", path="CAN", comment="")
    return Signal(samples, np.arange(count) / 100, name="CAN_DataFrame", source=source), raw * 2.0**-13 - 3.92


def test_bus_logging(tmp_path: Path) -> None:
    pytest.importorskip("cantools")
    frames, yaw_rate = can_frames()
    path = save(tmp_path / "a.mf4", ([frames], "CAN"), ([Signal(T, T, name="yaw_rate", unit="deg/s")], "imu"))
    told: list[float] = []
    with open_log(path, progress=told.append) as log:
        assert told[-1] == 1.0
        assert not [name for name in log.columns if "DataFrame" in name]
        assert log.columns["VDC2.yaw_rate@0B"].unit == "rad/s"
        found = read(log, "VDC2.yaw_rate@0B", "yaw_rate")
        np.testing.assert_allclose(found["VDC2.yaw_rate@0B"][1], yaw_rate, atol=1e-12)
        np.testing.assert_array_equal(found["VDC2.yaw_rate@0B"][0], np.arange(200) / 100)
        np.testing.assert_array_equal(found["yaw_rate"][1], T)


def test_frames_that_no_database_knows_are_worth_a_note(tmp_path: Path) -> None:
    pytest.importorskip("cantools")
    frames, _ = can_frames()
    frames.samples["CAN_DataFrame.ID"] = 0x18FF010B
    alone = save(tmp_path / "a.mf4", ([frames], "CAN"))
    with pytest.raises(SignalError, match="no database knows any of their ids"):
        open_log(alone)
    both = save(tmp_path / "b.mf4", ([frames], "CAN"), ([Signal(T, T, name="yaw_rate")], "imu"))
    with open_log(both) as log:
        assert list(log.columns) == ["yaw_rate"]
        assert "no database knows any of their ids" in log.notes[0]
    with pytest.raises(SignalError, match=r"none\.dbc"):
        open_log(both, databases=[tmp_path / "none.dbc"])


class Writer:
    """MDF 4 by hand, block after block."""

    def __init__(self, unfinalized: int = 0) -> None:
        head = b"UnFinMF " if unfinalized else b"MDF     "
        self.bytes = bytearray(head + b"4.10    test    " + struct.pack("<4xH30xHH", 410, unfinalized, 0))
        assert len(self.bytes) == 64
        self.add("HD", [0] * 6, bytes(32))

    def add(self, kind: str, links: list[int], body: bytes = b"") -> int:
        self.bytes += bytes(-len(self.bytes) % 8)
        at = len(self.bytes)
        size = 24 + 8 * len(links) + len(body)
        self.bytes += b"##" + kind.encode() + struct.pack(f"<4xQQ{len(links)}Q", size, len(links), *links) + body
        return at

    def link(self, at: int, number: int, to: int) -> None:
        struct.pack_into("<Q", self.bytes, at + 24 + 8 * number, to)

    def text(self, text: str) -> int:
        return self.add("TX", [], text.encode() + b"\0")

    def channel(
        self, name: str, bit: int, bits: int, kind: int, *, sort: int = 0, rule: int = 0, data: int = 0, after: int = 0
    ) -> int:
        body = struct.pack("<BBBBIIII", sort, int(sort in (2, 3)), kind, bit % 8, bit // 8, bits, 0, 0) + bytes(52)
        return self.add("CN", [after, 0, self.text(name), 0, rule, data, 0, 0], body)

    def group(self, channel: int, record: int, count: int, size: int, *, flags: int = 0, after: int = 0) -> int:
        return self.add("CG", [after, channel, 0, 0, 0, 0], struct.pack("<QQHH4xII", record, count, flags, 0, size, 0))

    def save(self, path: Path, group: int, data: int, identifier_size: int = 0) -> Path:
        self.link(64, 0, self.add("DG", [0, group, data, 0], struct.pack("<B7x", identifier_size)))
        path.write_bytes(self.bytes)
        return path


def two_groups(writer: Writer, counted: bool = True) -> tuple[int, list[bytes]]:
    """Two groups in one stream of records: a at 100 Hz, b at 50 Hz with a number of 12 bits."""
    records = []
    for k in range(200):
        records.append(b"\x01" + struct.pack("<dh", k / 100, -k))
        if k % 2:
            records.append(b"\x02" + struct.pack("<dH", k / 100, (k * 9 % 4096 << 3) | 0x8007))
    b = writer.channel("t", 0, 64, 4, sort=2, after=writer.channel("b", 8 * 8 + 3, 12, 0))
    a = writer.channel("t", 0, 64, 4, sort=2, after=writer.channel("a", 64, 16, 2))
    second = writer.group(b, 2, 100 * counted, 10)
    return writer.group(a, 1, 200 * counted, 10, after=second), records


@pytest.mark.parametrize("unfinalized", [0, 5])
def test_records_of_several_groups_mixed(tmp_path: Path, unfinalized: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mdf_rows, "_MIXED_BYTES", 777)
    writer = Writer(unfinalized)
    group, records = two_groups(writer, counted=not unfinalized)
    writer.link(64, 0, writer.add("DG", [0, group, 0, 0], struct.pack("<B7x", 1)))
    dg = struct.unpack_from("<Q", writer.bytes, 64 + 24)[0]
    writer.link(dg, 2, writer.add("DT", [], b"".join(records)))
    if unfinalized:  # the length of the last block was never filled in, and the last record is not whole
        at = struct.unpack_from("<Q", writer.bytes, dg + 24 + 16)[0]
        struct.pack_into("<Q", writer.bytes, at + 8, 24)
        writer.bytes += b"\x01\x00\x00"
    path = tmp_path / "a.mf4"
    path.write_bytes(writer.bytes)
    with open_log(path) as log:
        found = read(log)
        np.testing.assert_array_equal(found["a"][1], -np.arange(200.0))
        np.testing.assert_array_equal(found["a"][0], np.arange(200) / 100)
        np.testing.assert_array_equal(found["b"][1], np.arange(1, 200, 2) * 9 % 4096)
        np.testing.assert_array_equal(read(log, "b")["b"][0], np.arange(1, 200, 2) / 100)
        assert log.notes == []


def test_payloads_of_any_length(tmp_path: Path) -> None:
    pytest.importorskip("cantools")
    frames, yaw_rate = can_frames(50)
    payloads = [bytes(p) for p in frames.samples["CAN_DataFrame.DataBytes"]]
    for mixed in (False, True):
        writer = Writer()
        apart = b"".join(struct.pack("<I", 8) + p for p in payloads)
        vlsd = writer.group(0, 2, 50, 400, flags=1) if mixed else writer.add("SD", [], apart)
        channel = writer.channel("CAN_DataFrame.DataBytes", 13 * 8, 64, 10, sort=1, data=vlsd)
        channel = writer.channel("CAN_DataFrame.DataLength", 12 * 8, 8, 0, after=channel)
        channel = writer.channel("CAN_DataFrame.ID", 8 * 8, 32, 0, after=channel)
        channel = writer.channel("t", 0, 64, 4, sort=2, after=channel)
        group = writer.group(channel, 1, 50, 21, flags=6, after=vlsd if mixed else 0)
        records = [struct.pack("<dIBQ", k / 100, 0x98F0090B, 8, 12 * k) for k in range(50)]
        data = b"".join(
            b"\x01" + r + b"\x02" + struct.pack("<I", 8) + p if mixed else r
            for r, p in zip(records, payloads, strict=True)
        )
        path = writer.save(tmp_path / "a.mf4", group, writer.add("DT", [], data), int(mixed))
        with open_log(path) as log:
            np.testing.assert_allclose(read(log, "VDC2.yaw_rate@0B")["VDC2.yaw_rate@0B"][1], yaw_rate, atol=1e-12)


def test_virtual_master_and_a_scale_with_exceptions(tmp_path: Path) -> None:
    writer = Writer()
    step = writer.add("CC", [0, 0, 0, 0], struct.pack("<BBHHHdddd", 1, 0, 0, 0, 2, 0, 0, 5.0, 0.01))
    scale = writer.add("CC", [0, 0, 0, 0], struct.pack("<BBHHHdddd", 1, 0, 0, 0, 2, 0, 0, -10.0, 0.5))
    links = [0, 0, 0, 0, scale, writer.text("not available")]
    rule = writer.add("CC", links, struct.pack("<BBHHHdddddd", 8, 0, 0, 2, 4, 0, 0, 0, 250, 251, 255))
    channel = writer.channel("t", 0, 0, 0, sort=3, rule=step, after=writer.channel("x", 0, 8, 0, rule=rule))
    path = writer.save(tmp_path / "a.mf4", writer.group(channel, 0, 3, 1), writer.add("DT", [], bytes([0, 100, 255])))
    with open_log(path) as log:
        np.testing.assert_array_equal(read(log)["x"], [[5.0, 5.01, 5.02], [-10.0, 40.0, np.nan]])


def test_a_group_without_time_is_left_out(tmp_path: Path) -> None:
    writer = Writer()
    path = writer.save(tmp_path / "a.mf4", writer.group(writer.channel("x", 0, 8, 0), 0, 3, 1), 0)
    with pytest.raises(SignalError, match="group '0' of 1 channels left out: it has no time; copy it again"):
        open_log(path)


def test_no_sample_at_all(tmp_path: Path) -> None:
    writer = Writer()
    group, _ = two_groups(writer)
    with pytest.raises(SignalError, match="2 channels but not one sample; copy it again"):
        open_log(writer.save(tmp_path / "a.mf4", group, 0))


def test_cut_short(tmp_path: Path) -> None:
    writer = Writer()
    group, _ = two_groups(writer)
    dg = writer.add("DG", [0, group, 0, 0], struct.pack("<B7x", 0))
    writer.link(64, 0, dg)
    cg = struct.unpack_from("<Q", writer.bytes, dg + 32)[0]
    writer.link(cg, 0, 0)
    records = b"".join(struct.pack("<dh", k / 100, -k) for k in range(200))
    writer.link(dg, 2, writer.add("DT", [], records))
    path = tmp_path / "a.mf4"
    path.write_bytes(writer.bytes[: -10 * 80 - 3])
    with open_log(path) as log:
        np.testing.assert_array_equal(read(log)["a"][1], -np.arange(119.0))
        assert log.notes[0].startswith("broken after 119 samples of group '0', at 1.2 s: ")
        assert read(log).keys() == {"a"}
        assert len(log.notes) == 1


@pytest.fixture(scope="module")
def wholes(tmp_path_factory: pytest.TempPathFactory) -> list[bytes]:
    folder = tmp_path_factory.mktemp("whole")
    frames, _ = can_frames(30)
    signals = [Signal(RAW, T, name=n, conversion=dict(r)) for n, r in CONVERSIONS.items()]
    invalid = Signal(T, T, name="v", invalidation_bits=T > 1)
    found = []
    for version, compression, more in [("4.10", 0, {}), ("4.10", 2, {}), ("4.20", 1, {"column_storage": True})]:
        groups = [(signals, "fast"), ([invalid], "v"), ([frames], "CAN")]
        path = folder / "a.mf4"
        found.append(save(path, *groups, version=version, compression=compression, **more).read_bytes())
    found.append(save(folder / "b.mdf", (signals, ""), version="3.30").read_bytes())
    for unfinalized in (0, 5):
        writer = Writer(unfinalized)
        group, records = two_groups(writer)
        writer.save(folder / "c.mf4", group, writer.add("DT", [], b"".join(records)), 1)
        found.append(bytes(writer.bytes))
    return found


def test_damage_never_surprises(tmp_path: Path, wholes: list[bytes], capfd: pytest.CaptureFixture[str]) -> None:
    assert pieces_of_damaged(open_log, wholes, tmp_path) > 150
    assert capfd.readouterr() == ("", "")
