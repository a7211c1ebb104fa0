"""One run in every format: the same record; damaged files give a record or a SignalError."""

import codecs
import contextlib
import random
import struct
import warnings

import numpy as np
import pytest

from fifthwheel.base.errors import SignalError
from fifthwheel.data.logs import SignalMap, read_log
from fifthwheel.data.logs.files import record_of
from fifthwheel.data.logs.map_text import as_toml
from fifthwheel.data.logs.propose import propose_map
from fifthwheel.data.logs.readers import open_log
from fifthwheel.data.logs.stored import StoredLog, store_log
from fifthwheel.data.logs.survey import survey_log
from fifthwheel.data.record import Record
from fifthwheel.estimate.identify import OneStage, identify
from fifthwheel.model.simulate import simulate
from fifthwheel.truck import get
from tests.data.logs.formats import FORMATS, stored

TRUCK = get("cheng_cebon_2011")


@pytest.fixture(scope="module")
def drive():
    record = simulate(TRUCK, count=1, seed=1)
    return Record(time=record.time, signals=record.signals, name="drive")


@pytest.mark.slow
@pytest.mark.parametrize("name", FORMATS)
def test_every_format_gives_the_same_record(tmp_path, drive, name):
    """From the file, by the proposed map, and from its stored samples."""
    path, signal_map = stored(drive, tmp_path, name)
    path = path.rename(tmp_path / "no_ending")  # the format is recognised by content
    (folder := tmp_path / "samples").mkdir()
    with open_log(path, signal_map.databases) as log:
        store_log(log, folder)
        record, survey = record_of(log, signal_map, name="drive"), survey_log(log)
        proposal = propose_map(log, survey, databases=signal_map.databases)
        proposed = record_of(log, SignalMap.parse(as_toml(proposal, survey)), name="drive")
    assert set(record.signals) == set(drive.signals)
    assert set(drive.signals) <= {*proposed.signals, *proposed.reference}
    assert len(record) == len(drive)
    shift = record.time[0] - drive.time[0]
    assert record.time - shift == pytest.approx(drive.time, abs=1.1e-4 if name == "drive.trc" else 2e-6)
    for signal, values in drive.signals.items():
        assert record.signals[signal] == pytest.approx(values, rel=1e-6, abs=1e-7)
    again = record_of(StoredLog(folder), signal_map, name="drive")
    assert again == record
    assert (again.notes, again.time_bases, again.date) == (record.notes, record.time_bases, record.date)
    for column, content in survey_log(StoredLog(folder)).contents.items():
        assert content.samples == survey.contents[column].samples
        assert content.low == pytest.approx(survey.contents[column].low, nan_ok=True)


@pytest.mark.slow
@pytest.mark.parametrize("name", FORMATS)
def test_a_damaged_file_gives_a_record_or_a_signal_error(tmp_path, drive, name):
    """Cut anywhere, which leaves what is before, or with flipped bits."""
    path, signal_map = stored(drive.cut(0, 2), tmp_path, name)
    whole, rng = path.read_bytes(), random.Random(name)
    good, records = read_log(path, signal_map), []
    for cut in (0.9, 0.0, 0.6, 0.0):
        data = bytearray(whole[: round(cut * len(whole)) or None])
        for _ in range(0 if cut else rng.choice([1, 3, 30])):
            data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
        path.write_bytes(data)
        with warnings.catch_warnings(), contextlib.suppress(SignalError):
            warnings.simplefilter("error")
            record = read_log(path, signal_map)
            records.append(cut)
            for signal, values in record.signals.items() if cut else ():
                there = values[np.isfinite(values)]
                assert there == pytest.approx(good.signals[signal][np.isfinite(good.signals[signal])][: there.size])
        with contextlib.suppress(SignalError), open_log(path, signal_map.databases) as log:
            survey_log(log)
    assert 0.9 in records or name in ("drive.parquet", "drive.mf4", "v5.mat", "v73.mat", "drive.xlsx")


HEADS = [
    b"", b"PAR1", b"MDF     4.10    x", b"UnFinMF 4.10", b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM",
    b"MATLAB 7.3 MAT-file".ljust(512) + b"\x89HDF\r\n\x1a\n", b"\x89HDF\r\n\x1a\n", b"\x89MCAP0\r\n", b"LOGG\x90\0\0\0",
    b"date Sat Nov 21\nbase hex  timestamps absolute\n", b";$FILEVERSION=2.0\n;$COLUMNS=N,O,T,I,d,l,D\n",
    b"(1.0) can0 18F0090B#00", b"t;v\n0;1\n", b"t,speed\n0,1\n", codecs.BOM_UTF16_LE, b"PK\x03\x04", b"\x1f\x8b\x08",
    b"PK\x03\x04" + bytes(26) + b"xl/workbook.xml", b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1",
    b"TDSm\x0e\0\0\0\x69\x12\0\0", b"ULog\x01\x12\x35\x01" + bytes(8),
]  # fmt: skip


@pytest.mark.parametrize(
    ("head", "what"),
    [
        *((packed, "unpack it|.*unpack it") for packed in (b"PK\x03\x04", b"\x1f\x8b\x08\x00", b"7z\xbc\xaf\x27\x1c")),
        (b"version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\n", ".*Git LFS pointer.*`git lfs pull`"),
        (b"SQLite format 3\0", ".*SQLite database.*ROS 2.*mcap convert"),
        (b"#ROSBAG V2.0\n", ".*ROS 1; convert it to MCAP"),
        (b"BZh91AY&SY", "compressed by bzip2; .*rlog of openpilot"),
        (b"\xfd7zXZ\0\0\x04", "compressed by xz"),
        (b"(\xb5/\xfd\x24", "compressed by zstd; .*rlog of openpilot"),
        (b"ERDFILEV2.00\n 3, 100, -1, 1, 4, 0.01, -1,\n", "results of CarSim or TruckSim; write .* as CSV or MATLAB"),
        (b'{\r\n  "VsChannelGroup" : {\r\n', "results of CarSim or TruckSim"),
        (struct.pack("<I4xII", 0x40, 13384, 23056), r"a log of MoTeC \(.ld\); export CSV or MATLAB"),
        (b"DIAEXTENDED  {@:ENGLISH\r\n", "saved by DIAdem; save it as TDMS or CSV"),
        (b'<?xml version="1.0" encoding="UTF-8"?>\n<usi:tdm version="1.0">', "saved by DIAdem"),
        (struct.pack("<IIIHH", 0, 700, 0, 2, 1) + bytes(24), "an rlog of openpilot; write its messages as CSV"),
        (struct.pack("<IHH", 0xA1B2C3D4, 2, 4), "a pcap capture .*candump"),
        (struct.pack(">IHH", 0xA1B23C4D, 2, 4), "a pcap capture"),
        (struct.pack("<III", 0x0A0D0D0A, 28, 0x1A2B3C4D), "a pcap capture"),
    ],
)
def test_what_is_not_read_is_named_with_what_to_do(tmp_path, head, what):
    (tmp_path / "a.log").write_bytes(head + bytes(100))
    with pytest.raises(SignalError, match=rf"^a\.log: {what}"):
        open_log(tmp_path / "a.log")


@pytest.mark.slow
@pytest.mark.parametrize("data", [b"", b"\xff\x00\x81" * 90, b"0.5;1,2 # x\n\n-;e+9\n" * 9])
def test_any_bytes_give_a_record_or_a_signal_error(tmp_path, data):
    """`benchmarks/fuzz.py` draws more."""
    for head in HEADS:
        (tmp_path / "x").write_bytes(head + data)
        with contextlib.suppress(SignalError):
            assert isinstance(read_log(tmp_path / "x"), Record)


@pytest.mark.slow
def test_a_damaged_log_gives_no_wrong_parameters(tmp_path, drive):
    """Bits flipped, checked or not: parameters within 5 sigma, another verdict than converged, or a SignalError."""
    path, signal_map = stored(drive, tmp_path, "drive.csv")
    whole, rng, identified = path.read_bytes(), random.Random("drive.csv"), 0
    truth = TRUCK.parameters()
    for k, flips in enumerate((1, 40)):
        data = bytearray(whole)
        for _ in range(flips):
            data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
        path.write_bytes(data)
        with contextlib.suppress(SignalError):
            result = identify([read_log(path, signal_map)], TRUCK, OneStage(check=k % 2 == 0, tyres="linear"))
            identified += 1
            assert all(np.isfinite([e.value, e.sigma]).all() for e in result.parameters)
            converged = [e for e in result.parameters if e.verdict == "converged"]
            assert all(abs(e.value - truth[e.name]) < 5 * e.sigma for e in converged)
    assert identified
