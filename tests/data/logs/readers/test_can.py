"""CAN traces: written by python-can and by hand, read as frames."""

import random

import can
import numpy as np
import pytest

from fifthwheel.base.errors import SignalError
from fifthwheel.data.logs.readers import open_log, trace_kind
from tests.data.logs.can.wires import FORMATS, message, read, write


def some(count: int = 200, *, fd: bool = False, start: float = 0.0) -> list[can.Message]:
    draw = random.Random(1)
    messages = []
    for k in range(count):
        extended = draw.random() < 0.7
        size = draw.choice([0, 1, 3, 8, 8, 8, *([12, 64] if fd else [])])
        messages.append(
            message(
                start + 0.01 * k,
                draw.randrange(1 << 29) if extended else draw.randrange(1 << 11),
                draw.randbytes(size),
                extended=extended,
                bus=draw.choice([0, 1]),
                is_fd=size > 8,
            )
        )
    return messages


@pytest.mark.parametrize("kind", FORMATS)
@pytest.mark.parametrize("fd", [False, True])
def test_every_format_gives_back_what_python_can_wrote(tmp_path, kind, fd):
    """Error and remote frames are left out and counted. python-can writes neither them nor FD frames to TRC."""
    fd = fd and kind != "trc"
    messages = some(fd=fd, start=1.7e9)
    others = [message(1.7e9 + 1.991, 0x18F0090B, b"\0" * 4, is_remote_frame=True)]
    others.append(can.Message(timestamp=1.7e9 + 1.992, is_error_frame=True, channel=0))
    path = write(tmp_path / f"a.{kind}", messages if kind == "trc" else [*messages, *others])
    assert trace_kind(path.read_bytes()[:4096]) == {"log": "candump"}.get(kind, kind)
    frames = read(path)
    assert frames.payloads == [bytes(one.data) for one in messages]
    assert frames.id.tolist() == [one.arbitration_id for one in messages]
    assert frames.extended.tolist() == [one.is_extended_id for one in messages]
    tolerance = 2e-6 if kind != "trc" else 1e-3
    assert np.allclose(frames.time - frames.time[0], [0.01 * k for k in range(200)], atol=tolerance)
    first = {"asc": 1, "blf": 1, "log": 0, "trc": 1}[kind]
    assert frames.bus.tolist() == [one.channel + first for one in messages]
    notes = [] if kind == "trc" else ["1 error frame left out", "1 remote frame left out"]
    assert sorted(frames.notes) == notes


def test_both_forms_of_candump(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text(
        " (000.000000)  can0  18FCF200   [8]  E1 FF FF FF FF FF FF FF\n"
        " (000.005001)  vcan1  123   [3]  8A A0 28\r\n"
        " (000.006000)  can0  RX - -  124   [0]\n"
        " (000.007000)  can0  125   [2]  41 42   'AB'\n"
        " (000.008000)  can0  126   [0]  remote request\n"
        " (000.009000)  can0  20000004   [8]  00 04 00 00 00 00 00 00   ERRORFRAME\n"
    )
    frames = read(path)
    assert frames.payloads == [b"\xe1" + b"\xff" * 7, b"\x8a\xa0\x28", b"", b"AB"]
    assert frames.id.tolist() == [0x18FCF200, 0x123, 0x124, 0x125]
    assert frames.extended.tolist() == [True, False, False, False]
    assert frames.bus.tolist() == [0, 1, 0, 0]
    assert frames.time.tolist() == [0, 0.005001, 0.006, 0.007]
    assert frames.notes == ["1 remote frame left out"]
    short = ["can0 123#", "can0 123#R", "can0 123##1" + "AB" * 12, "can1 00000123#0102030405060708 R"]
    path.write_text("".join(f"({k}.0) {text}\n" for k, text in enumerate(short)))
    frames = read(path)
    assert frames.payloads == [b"", b"\xab" * 12, bytes(range(1, 9))]
    assert frames.extended.tolist() == [False, False, True]
    assert frames.bus.tolist() == [0, 0, 1]


TRC = {
    "1.0": ";##\n     1)      1841 0001 2 0A 0B\n     2)      1842 18F0090B 8 01 02 03 04 05 06 07 08\n"
    "     3)  1843 0002 0 RTR\n",
    "1.1": ";$FILEVERSION=1.1\n;$STARTTIME=37704.5\n"
    "     1)      1841.5  Rx         0001  2  0A 0B\n     2)  1842.0  Tx     18F0090B  8  01 02 03 04 05 06 07 08\n"
    "     3)      1843.0  Rx         0002  2  RTR\n     4)      1844.0  Warng  FFFFFFFF  4  00 00 00 08  BUSHEAVY\n",
    "1.3": ";$FILEVERSION=1.3\n     1)      1841.5 1  Rx         0001 -  2  0A 0B\n"
    "     2)  1842.0 1  Tx     18F0090B -  8  01 02 03 04 05 06 07 08\n     3)  1843.0 1  Rx  0002 - 2  RTR\n",
    "2.0": ";$FILEVERSION=2.0\n;$STARTTIME=44483.5\n;$COLUMNS=N,O,T,I,d,l,D\n"
    "  1  1841.5 DT  0001 Rx 2  0A 0B\n  2  1842.0 DT 18F0090B Rx 8  01 02 03 04 05 06 07 08\n"
    "  3  1842.5 RR  0002 Rx 2\n  4  1843.0 ER   Rx    04 01 09 01 00\n  5  1843.1 ST   Rx    00 00 00 08\n",
    "2.1": ";$FILEVERSION=2.1\n;$COLUMNS=N,O,T,B,I,d,R,L,D\n  1  1841.5 DT 1  0001 Rx - 2  0A 0B\n"
    "  2  1842.0 FD 1 18F0090B Rx - 8  01 02 03 04 05 06 07 08\n  3  1842.5 RR 1 0002 Rx - 2\n",
}


@pytest.mark.parametrize("version", TRC)
def test_every_version_of_a_pcan_trace(tmp_path, version):
    path = tmp_path / "a.trc"
    path.write_text(TRC[version])
    frames = read(path)
    assert frames.payloads == [b"\x0a\x0b", bytes(range(1, 9))]
    assert frames.id.tolist() == [1, 0x18F0090B]
    assert frames.extended.tolist() == [False, True]
    assert np.diff(frames.time)[0] == pytest.approx(1e-3 if version == "1.0" else 5e-4, abs=1e-6)
    errors = ["1 error frame left out"] if version == "2.0" else []
    assert sorted(frames.notes) == [*errors, "1 remote frame left out"]


def test_asc_in_decimal_with_relative_timestamps_and_without_header(tmp_path):
    path = tmp_path / "a.asc"
    path.write_text(
        "date Mon Sep 30 15:06:13.191 2019\nbase dec  timestamps relative\ninternal events logged\n"
        "Begin Triggerblock Mon Sep 30 15:06:13.191 2019\n   0.000000 Start of measurement\n"
        "   0.500000 1  418385163x      Rx   d 3 10 255 0  Length = 1 BitCount = 2 ID = 3x\n"
        "   0.250000 2  Statistic: D 0 R 0 XD 0 XR 0 E 0 O 0 B 0.00%\n"
        "   0.250000 1  291             Tx   d 1 16\n   0.1 1 291 Rx d 1 256\nEnd TriggerBlock\n"
    )
    frames = read(path)
    assert frames.payloads == [b"\x0a\xff\x00", b"\x10"]
    assert frames.id.tolist() == [418385163, 291]
    assert frames.time.tolist() == [0.5, 1.0]
    assert frames.notes == ["1 damaged line left out"]
    for first in ("", "// version 9.0.0\n"):
        path.write_text(
            first + "   0.500000 1  18F0090Bx       Rx   d 3 0A FF 00  Length = 1 BitCount = 2 ID = 3x\n"
            "   0.750000 2  123             Tx   d 1 16\n"
        )
        assert trace_kind(path.read_bytes()) == "asc"
        frames = read(path)
        assert frames.id.tolist() == [0x18F0090B, 0x123]
        assert frames.time.tolist() == [0.5, 0.75]
        assert [note.partition(":")[0] for note in frames.notes] == ["an ASC file without its header"]


@pytest.mark.parametrize("kind", ["asc", "log", "trc"])
def test_a_damaged_line_costs_only_itself(tmp_path, kind):
    messages = some(100)
    path = write(tmp_path / f"a.{kind}", messages)
    lines = path.read_bytes().splitlines(keepends=True)
    at = next(
        k for k in range(len(lines) - 50, 0, -1) if len(lines[k].split()) > 6 or b"##" in lines[k] or kind == "log"
    )
    lines[at] = lines[at].replace(lines[at].split()[2 if kind != "trc" else 4], b"xyz#q" if kind == "log" else b"q8")
    path.write_bytes(b"".join(lines))
    frames = read(path)
    sent = [(one.arbitration_id, bytes(one.data)) for one in messages]
    got = list(zip(frames.id.tolist(), frames.payloads, strict=True))
    assert len(got) == 99
    assert [one for one in sent if one in got] == got
    assert frames.notes == ["1 damaged line left out"]


def test_a_broken_blf_gives_the_frames_before_and_says_where(tmp_path):
    path = tmp_path / "a.blf"
    writer = can.BLFWriter(str(path))
    writer.max_container_size = 4096
    messages = some(500, start=1.7e9)
    for one in messages:
        writer.on_message_received(one)
    writer.stop()
    whole = bytearray(path.read_bytes())
    whole[len(whole) // 2] ^= 0xFF
    path.write_bytes(whole)
    frames = read(path)
    assert 100 < len(frames) < 400
    assert frames.payloads == [bytes(one.data) for one in messages[: len(frames)]]
    assert frames.notes[-1].startswith(f"broken after {len(frames)} frames, at {frames.time[-1]:.1f} s: ")


def test_an_object_without_size_is_not_read_for_ever(tmp_path, monkeypatch):
    monkeypatch.setattr("fifthwheel.data.logs.readers.can._MOST_AT_ONCE", 1000)
    path = tmp_path / "a.blf"
    with can.BLFWriter(str(path), compression_level=0) as writer:
        for one in some(10):
            writer.on_message_received(one)
    whole = bytearray(path.read_bytes())
    at = whole.index(b"LOBJ", whole.index(b"LOBJ") + 32 + 1)  # the second object within the container
    whole[at + 8 : at + 12] = bytes(4)
    path.write_bytes(whole)
    assert read(path).notes[-1].endswith("one object is repeated")


def test_a_trace_without_a_frame_is_refused(tmp_path):
    for head in (b"LOGG", b"base hex\n", b";$FILEVERSION=2.0\n", b";$FILEVERSION=1.2\n 1) 1.0 1 Rx 0001 1 AA\n"):
        (tmp_path / "a.trc").write_bytes(head)
        error = r"a\.trc: (not one CAN frame|cannot be read as CAN trace).*(record|copy) it again"
        with pytest.raises(SignalError, match=error):
            open_log(tmp_path / "a.trc")
