"""Databases: every signal as cantools decodes it, in frames of a log and in single frames."""

from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import cantools
import numpy as np
import pytest
from cantools.database.can import Message, Signal
from cantools.database.conversion import BaseConversion
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fifthwheel.base.errors import SignalError
from fifthwheel.data.logs.can.database import Bits, CanSignal, Frame, FrameDecoder, Quality, group, load

DBC = """VERSION ""
BU_: A
BO_ 100 Motor: 8 A
 SG_ Speed : 0|16@1+ (0.25,0) [0|0] "rpm" A
 SG_ Kind M : 16|4@1+ (1,0) [0|0] "" A
 SG_ First m0 : 24|8@1- (1,0) [0|0] "K" A
 SG_ Second m1 : 24|16@1+ (1,-5) [0|0] "V" A
BO_ 2566844926 Wheels: 8 A
 SG_ front : 0|16@1+ (0.00390625,0) [0|250.996] "km/h" A
 SG_ full : 16|16@1+ (1,0) [0|65535] "kg" A
 SG_ half : 36|8@1+ (1,0) [0|0] "" A
 SG_ signed : 48|8@1- (1,0) [0|0] "" A
 SG_ on : 56|2@1+ (1,0) [0|0] "" A
CM_ BO_ 100 "What the
 motor says";
"""
WHEELS = 2566844926 & 0x1FFFFFFF


@st.composite
def signals(draw):
    floating = draw(st.booleans())
    length = draw(st.sampled_from([16, 32, 64]) if floating else st.integers(1, 64))
    little = draw(st.booleans())
    first = draw(st.integers(0, 64 - length))  # of the bits in the order of their weight
    start = first if little else 8 * (first // 8) + 7 - first % 8
    return Signal(
        "s",
        start,
        length,
        "little_endian" if little else "big_endian",
        is_signed=draw(st.booleans()),
        conversion=BaseConversion.factory(
            scale=draw(st.sampled_from([1, 0.5, 0.00390625, 10, 1 / 3])),
            offset=draw(st.sampled_from([0, -3.92, 100])),
            is_float=floating,
        ),
    )


@pytest.mark.slow
@given(signal=signals(), data=st.lists(st.binary(min_size=8, max_size=8), min_size=1, max_size=5))
@settings(max_examples=150, deadline=None, derandomize=True)
def test_every_signal_is_as_cantools_decodes_it(signal, data):
    message = Message(1, "m", 8, [signal])
    bits = Bits(
        start=signal.start,
        length=signal.length,
        little=signal.byte_order == "little_endian",
        signed=signal.is_signed,
        floating=signal.is_float,
    )
    mine = CanSignal(name="s", bits=bits, scale=float(signal.scale), offset=float(signal.offset), unit=None)
    frames, length = np.frombuffer(b"".join(data), np.uint8).reshape(-1, 8), np.full(len(data), 8, np.int32)
    ours = mine.values(frames, length)
    theirs = np.array([float(message.decode(one)["s"]) for one in data])
    theirs[np.isinf(theirs)] = np.nan  # no value to us
    assert np.allclose(ours, theirs, rtol=1e-14, atol=1e-12, equal_nan=True)
    for highest in (None, 1, 250, 0xFAFF):
        limited = replace(mine, highest=highest)
        assert all(map(limited.in_payload, data))
        np.testing.assert_array_equal([limited.value(one) for one in data], limited.values(frames, length))
    for size in range(9):  # a short frame lacks just the signals that cantools lacks
        there = "s" in message.decode(bytes(size), allow_truncated=True)
        assert bits.present(np.array([size], np.int32)).tolist() == [mine.in_payload(bytes(size))] == [there]


def database(tmp_path, text=DBC, name="a.dbc"):
    path = tmp_path / name
    path.write_text(text)
    return path


def test_29_bits_match_by_id_then_by_group_from_any_source(tmp_path):
    """The user's databases are asked in their order, before J1939."""
    databases = load([database(tmp_path)])
    wheels = databases.message(WHEELS, True)
    assert wheels.name == "Wheels"
    assert databases.message(WHEELS & 0x3FFFF00 | 0x0C00003E, True) is wheels
    assert databases.message(WHEELS, False) is None
    assert databases.message(100, True) is None
    assert group(0x18F0090B) == group(0x0CF0093E) == 61449
    assert group(0x0C0320C8) == group(0x0C0310D0) == 0x300  # PDU1: 20 and 10 are destinations
    assert load([]).message(0x18F0090B, True).name == "VDC2"
    mine = DBC.replace("2566844926", str(0x98F009FE))
    one, other = database(tmp_path, mine), database(tmp_path, mine.replace("Wheels", "Other"), "b.dbc")
    assert load([one, other]).message(0x18F0090B, True).name == "Wheels"
    assert load([other, one]).message(0x18F0090B, True).name == "Other"


def test_values_that_mean_none_in_a_users_database(tmp_path):
    usual = {"front": 0xFAFF, "full": None, "half": None, "signed": None, "on": 1}
    attributes = (
        'BA_DEF_ BO_ "VFrameFormat" ENUM "StandardCAN","ExtendedCAN","reserved","J1939PG";\n'
        'BA_DEF_DEF_ "VFrameFormat" "J1939PG";\nBA_ "VFrameFormat" BO_ 2566844926 3;\n'
    )
    for more, expected in (("", usual), (attributes, usual | {"full": 0xFAFF})):
        wheels = load([database(tmp_path, DBC + more)]).message(WHEELS, True)
        assert {one.name: one.highest for one in wheels.signals} == expected
    assert all(one.highest is not None for one in load([]).message(0x18F0090B, True).signals)


def test_what_is_no_database_is_refused_by_name(tmp_path):
    """The error does not show its content."""
    files = [("a.dbc", "nonsense"), ("a.arxml", "<AUTOSAR"), ("a.dbc", ""), ("a.kcd", "<a/>")]
    files += [(f"shadow.{ending}", "root:$6$secret:19000:0:7:::\n") for ending in ("dbc", "sym", "kcd", "arxml", "")]
    for name, text in files:
        with pytest.raises(SignalError, match=rf"^{name}: not a valid CAN database \(.+\); give a DBC or ARXML") as e:
            load([database(tmp_path, text, name)])
        assert "secret" not in str(e.value)
    with pytest.raises(SignalError, match="cannot be read"):
        load([tmp_path / "none.dbc"])


@given(data=st.data())
@settings(max_examples=30, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_a_damaged_database_raises_only_signal_errors(tmp_path, data):
    text = bytearray(DBC.encode())
    for place in data.draw(st.lists(st.integers(0, 8 * len(text) - 1), min_size=1, max_size=8)):
        text[place // 8] ^= 1 << place % 8
    path = tmp_path / "a.dbc"
    path.write_bytes(text)
    with suppress(SignalError):
        assert load([path]).message(0x18F0090B, True) is not None


def test_multiplexing_on_two_levels_is_as_in_cantools(tmp_path):
    text = """VERSION ""
BU_: A
BO_ 5 M: 8 A
 SG_ outer M : 0|4@1+ (1,0) [0|0] "" A
 SG_ inner m1M : 4|4@1+ (1,0) [0|0] "" A
 SG_ a m2 : 8|8@1+ (1,0) [0|0] "" A
 SG_ b m3 : 16|8@1+ (1,0) [0|0] "" A
SG_MUL_VAL_ 5 inner outer 1-2;
SG_MUL_VAL_ 5 a inner 2-3, 5-5;
SG_MUL_VAL_ 5 b outer 4-4;
"""
    message = load([database(tmp_path, text)]).message(5, False)
    theirs = cantools.database.load_string(text, "dbc").messages[0]
    by_name = {one.name: one for one in message.signals}
    for first in range(256):
        data = np.frombuffer(bytes([first, 7, 9, 0, 0, 0, 0, 0]), np.uint8).reshape(1, 8)
        try:
            there = set(theirs.decode(data.tobytes()))
        except cantools.database.DecodeError:  # a value that opens nothing
            continue
        ours = {
            name
            for name, one in by_name.items()
            if all(int(bits.raw(data)[0]) in values for _, bits, values in one.gates)
        }
        assert ours == there
        assert {name for name, one in by_name.items() if one.in_payload(data.tobytes())} == there


def test_other_formats_are_read_as_cantools_reads_them(tmp_path):
    path = Path(__file__).parent / "motor.arxml"
    speed, torque = load([path]).message(100, False).signals
    data = bytes([0x50, 0x34, 0x12, 0x1A, 0xBC, 0, 0, 0])
    theirs = cantools.database.load_file(path).get_message_by_name("Motor").decode(data)
    assert speed.value(data) == theirs["Speed"] == 0x2345 * 0.25 - 10
    assert torque.value(data) == theirs["Torque"] == 0x1AB
    assert speed.unit == "rpm"
    for kind in ("kcd", "sym"):
        path = tmp_path / f"a.{kind}"
        cantools.database.dump_file(cantools.database.load_string(DBC, "dbc"), str(path))
        assert load([path]).message(100, False).name == "Motor"


SPEED = "CCVS.wheel_based_vehicle_speed"


def test_a_frame_gives_the_columns_of_the_map():
    """From any source and with any priority; the filters accept the mapped messages only."""
    decoder = FrameDecoder(load([]), [SPEED, "VDC2.yaw_rate@0B [rad/s]"])
    assert decoder.columns == (f"{SPEED} [km/h]", "VDC2.yaw_rate@0B [rad/s]")

    def decoded(number, data):
        return decoder.decode(Frame(0.0, number, data, number > 0x7FF))

    assert decoded(0x18FEF100, b"\xff\x00\x50" + b"\xff" * 5) == [(f"{SPEED} [km/h]", 80.0, Quality.VALID)]
    assert decoded(0x18FEF100, b"\xff" * 8)[0].quality is Quality.NOT_AVAILABLE
    assert decoded(0x18FEF100, b"\xff\x00")[0].quality is Quality.WRONG_LENGTH
    assert decoded(0x0CFEF100, bytes(8))
    assert not decoder.other_sources
    assert decoded(0x18F0092F, bytes(8)) == []  # another source
    assert len(decoded(0x18F0090B, bytes(8))) == 1
    assert decoded(0x123, bytes(8)) == []
    filters = FrameDecoder(load([]), [SPEED]).filters()
    numbers = (0x18FEF100, 0x0CFEF1FE, 0x18F0090B, 0x18FEF200)
    accepted = [n for n in numbers if any(n & f["can_mask"] == f["can_id"] for f in filters)]
    assert accepted == [0x18FEF100, 0x0CFEF1FE]
    for column, text in {
        "CCVS1.speed": "no database has a message",
        "CCVS.speed": "has no signal 'speed'",
        "VDC2.yaw_rate@XY": "expected a source address",
    }.items():
        with pytest.raises(SignalError, match=text):
            FrameDecoder(load([]), [column])
