"""Frames of every format, whole and damaged."""

import random
import zlib
from pathlib import Path

import can
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fifthwheel.errors import SignalError
from fifthwheel.logs.can.frames import read_frames

from .wires import FORMATS, message, payloads, read, read_or_refuse, write

FUZZ = settings(
    max_examples=60, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


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
    if fd and kind == "trc":
        pytest.skip("python-can writes no FD frames to TRC")
    messages = some(fd=fd, start=1.7e9)
    frames = read(write(tmp_path / f"a.{kind}", messages))
    assert payloads(frames) == [bytes(one.data) for one in messages]
    assert frames.id.tolist() == [one.arbitration_id for one in messages]
    assert frames.extended.tolist() == [one.is_extended_id for one in messages]
    assert np.allclose(
        frames.time - frames.time[0], [0.01 * k for k in range(200)], atol=2e-6 if kind != "trc" else 1e-3
    )
    first = {"asc": 1, "blf": 1, "log": 0, "trc": 1}[kind]
    assert frames.bus.tolist() == [one.channel + first for one in messages]
    assert frames.notes == ()


@pytest.mark.parametrize("kind", FORMATS)
def test_content_tells_the_format_and_not_the_name(tmp_path, kind):
    path = write(tmp_path / f"a.{kind}", some(20))
    other = path.rename(tmp_path / "a.csv")
    assert len(read(other)) == 20


@pytest.mark.parametrize("kind", ["asc", "blf", "log"])  # python-can writes neither to TRC
def test_error_and_remote_frames_are_left_out_and_counted(tmp_path, kind):
    messages = some(5)
    messages.insert(2, message(0.011, 0x18F0090B, b"\0" * 4, is_remote_frame=True))
    messages.insert(3, can.Message(timestamp=0.012, is_error_frame=True, channel=0))
    frames = read(write(tmp_path / f"a.{kind}", messages))
    assert len(frames) == 5
    assert frames.notes == ("1 error frame left out", "1 remote frame left out")


def test_long_form_of_candump_is_read(tmp_path):
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
    assert payloads(frames) == [b"\xe1" + b"\xff" * 7, b"\x8a\xa0\x28", b"", b"AB"]
    assert frames.id.tolist() == [0x18FCF200, 0x123, 0x124, 0x125]
    assert frames.extended.tolist() == [True, False, False, False]
    assert frames.bus.tolist() == [0, 1, 0, 0]
    assert frames.notes == ("1 error frame left out", "1 remote frame left out")


def test_short_form_of_candump_with_flags_and_fd(tmp_path):
    path = tmp_path / "a.log"
    path.write_text(
        "(1.0) can0 123#\n(1.1) can0 123#R\n(1.2) can0 123##1"
        + "AB" * 12
        + "\n(1.3) can1 00000123#0102030405060708_9 R\n"
    )
    frames = read(path)
    assert payloads(frames) == [b"", b"\xab" * 12, bytes(range(1, 9))]
    assert frames.extended.tolist() == [False, False, True]


TRC = {
    "1.0": ";##\n     1)      1841 0001 2 0A 0B\n     2)      1842 18F0090B 8 01 02 03 04 05 06 07 08\n"
    "     3)  1843 0002 0 RTR\n",
    "1.1": ";$FILEVERSION=1.1\n;$STARTTIME=37704.5\n"
    "     1)      1841.5  Rx         0001  2  0A 0B\n     2)  1842.0  Tx     18F0090B  8  01 02 03 04 05 06 07 08\n"
    "     3)      1843.0  Rx         0002  2  RTR\n     4)      1844.0  Warng  FFFFFFFF  4  00 00 00 08  BUSHEAVY\n",
    "1.2": ";$FILEVERSION=1.2\n     1)      1841.5 1  Rx         0001  2  0A 0B\n"
    "     2)  1842.0 1  Tx     18F0090B  8  01 02 03 04 05 06 07 08\n     3)  1843.0 1  Rx  0002  2  RTR\n",
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
    assert payloads(frames) == [b"\x0a\x0b", bytes(range(1, 9))]
    assert frames.id.tolist() == [1, 0x18F0090B]
    assert frames.extended.tolist() == [False, True]
    assert np.diff(frames.time)[0] == pytest.approx(1e-3 if version == "1.0" else 5e-4, abs=1e-6)
    assert "1 remote frame left out" in frames.notes
    assert not any("damaged" in note for note in frames.notes)
    assert ("1 error frame left out" in frames.notes) == (version == "2.0")


def test_asc_in_decimal_and_with_relative_stamps(tmp_path):
    path = tmp_path / "a.asc"
    path.write_text(
        "date Mon Sep 30 15:06:13.191 2019\nbase dec  timestamps relative\ninternal events logged\n"
        "Begin Triggerblock Mon Sep 30 15:06:13.191 2019\n   0.000000 Start of measurement\n"
        "   0.500000 1  418385163x      Rx   d 3 10 255 0  Length = 1 BitCount = 2 ID = 3x\n"
        "   0.250000 2  Statistic: D 0 R 0 XD 0 XR 0 E 0 O 0 B 0.00%\n"
        "   0.250000 1  291             Tx   d 1 16\n   0.1 1 291 Rx d 1 256\nEnd TriggerBlock\n"
    )
    frames = read(path)
    assert payloads(frames) == [b"\x0a\xff\x00", b"\x10"]
    assert frames.id.tolist() == [418385163, 291]
    assert frames.time.tolist() == [0.5, 1.0]
    assert frames.notes == ("1 damaged line left out, line 9",)


@pytest.mark.parametrize("kind", ["asc", "log", "trc"])
def test_damaged_lines_are_skipped_counted_and_placed(tmp_path, kind):
    path = write(tmp_path / f"a.{kind}", some(100))
    lines = path.read_bytes().splitlines(keepends=True)
    at = len(lines) - 50
    lines[at] = lines[at][: len(lines[at]) // 2] + b"\x00\xff#!\n"
    lines[at + 5] = b"\xfe\xfe\xfe\n"
    path.write_bytes(b"".join(lines))
    frames = read(path)
    assert len(frames) == 98
    assert frames.notes == (f"2 damaged lines left out, the first at line {at + 1}",)


@pytest.mark.parametrize("kind", FORMATS)
@given(data=st.data())
@FUZZ
def test_a_file_that_is_cut_gives_the_frames_before_the_cut(tmp_path, kind, data):
    messages = some(120)
    path = tmp_path / f"a.{kind}"
    if not path.exists():
        write(path, messages)
    whole = path.read_bytes()
    cut = tmp_path / "cut"
    cut.write_bytes(whole[: data.draw(st.integers(0, len(whole)))])
    frames = read_or_refuse(cut)
    if frames is None:
        return
    sent = [(one.arbitration_id, bytes(one.data)) for one in messages]
    assert list(zip(frames.id.tolist(), payloads(frames), strict=True)) == sent[: len(frames)]


@pytest.mark.parametrize("kind", FORMATS)
@given(data=st.data())
@FUZZ
def test_flipped_bits_never_raise_anything_else(tmp_path, kind, data):
    path = tmp_path / f"a.{kind}"
    if not path.exists():
        write(path, some(120))
    broken = bytearray(path.read_bytes())
    for place in data.draw(st.lists(st.integers(0, 8 * len(broken) - 1), min_size=1, max_size=20)):
        broken[place // 8] ^= 1 << place % 8
    (tmp_path / "broken").write_bytes(broken)
    frames = read_or_refuse(tmp_path / "broken")
    if frames is None:
        return
    assert np.isfinite(frames.time).all()
    assert (frames.length <= frames.data.shape[1]).all()


@pytest.mark.parametrize(
    "head", [b"LOGG", b"date ", b"base hex\n", b";$FILEVERSION=2.0\n", b"(1.0) can0 123#00\n", b""]
)
@given(tail=st.binary(max_size=300))
@FUZZ
def test_any_bytes_give_frames_or_a_signal_error(tmp_path, head, tail):
    path = tmp_path / "x"
    path.write_bytes(head + tail)
    frames = read_or_refuse(path)
    assert frames is None or np.isfinite(frames.time).all()


@given(data=st.data())
@FUZZ
def test_damage_inside_the_containers_of_a_blf(tmp_path, data):
    path = tmp_path / "a.blf"
    if not path.exists():
        with can.BLFWriter(str(path), compression_level=0) as writer:
            for one in some(120, fd=True):
                writer.on_message_received(one)
    broken = bytearray(path.read_bytes())
    for place in data.draw(st.lists(st.integers(176 * 8, 8 * len(broken) - 1), min_size=1, max_size=20)):
        broken[place // 8] ^= 1 << place % 8
    (tmp_path / "broken").write_bytes(broken)
    assert np.isfinite(read(tmp_path / "broken").time).all()


def test_a_broken_blf_says_where_it_broke(tmp_path):
    path = tmp_path / "a.blf"
    writer = can.BLFWriter(str(path))
    writer.max_container_size = 4096
    for one in some(500, start=1.7e9):
        writer.on_message_received(one)
    writer.stop()
    whole = bytearray(path.read_bytes())
    whole[len(whole) // 2] ^= 0xFF
    path.write_bytes(whole)
    frames = read(path)
    assert 100 < len(frames) < 400
    assert frames.notes[-1].startswith(f"broken after {len(frames)} frames, at {frames.time[-1] - 1.7e9:.1f} s: ")


def test_containers_may_be_stored_and_objects_may_cross_them(tmp_path):
    path = tmp_path / "a.blf"
    writer = can.BLFWriter(str(path), compression_level=0)
    writer.max_container_size = 1000
    messages = some(300, fd=True)
    for one in messages:
        writer.on_message_received(one)
    writer.stop()
    assert payloads(read(path)) == [bytes(one.data) for one in messages]


def test_a_blf_that_claims_to_unpack_to_gigabytes_does_not(tmp_path):
    path = write(tmp_path / "a.blf", some(10))
    packed = zlib.compress(bytes(200_000_000), 9)
    size = 32 + len(packed)
    container = b"LOBJ" + (16).to_bytes(2, "little") + (1).to_bytes(2, "little") + size.to_bytes(4, "little")
    container += (10).to_bytes(4, "little") + (2).to_bytes(2, "little") + bytes(14) + packed
    path.write_bytes(path.read_bytes()[:144] + container)
    assert len(read(path)) == 0


def test_batches_are_bounded_and_progress_grows(tmp_path):
    path = tmp_path / "a.log"
    path.write_text("".join(f"({k / 1000:.6f}) can0 18F0090B#4F7D60877D4F7C7D\n" for k in range(200_000)))
    sizes, shares = zip(*((len(frames), done) for frames, done in read_frames(path)), strict=True)
    assert sum(sizes) == 200_000
    assert max(sizes) < 70_000
    assert list(shares) == sorted(shares)
    assert shares[-1] == 1.0


def test_no_can_log_is_refused(tmp_path):
    path = tmp_path / "a.blf"
    path.write_bytes(b"time,speed\n1,2\n")
    with pytest.raises(SignalError, match=r"a\.blf: no CAN log"):
        read(path)
    with pytest.raises(SignalError, match="cannot be read"):
        read(Path(tmp_path / "none"))
