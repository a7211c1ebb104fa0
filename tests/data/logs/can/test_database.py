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
@settings(max_examples=300, deadline=None, derandomize=True)
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


@given(signal=signals(), length=st.integers(0, 8))
@settings(max_examples=100, deadline=None, derandomize=True)
def test_a_short_frame_lacks_just_the_signals_that_cantools_lacks(signal, length):
    bits = Bits(start=signal.start, length=signal.length, little=signal.byte_order == "little_endian")
    theirs = Message(1, "m", 8, [signal]).decode(bytes(length), allow_truncated=True)
    assert bits.present(np.array([length], np.int32)).tolist() == ["s" in theirs]
    single = CanSignal(name="s", bits=bits, scale=1.0, offset=0.0, unit=None)
    assert single.in_payload(bytes(length)) == ("s" in theirs)


def database(tmp_path, text=DBC, name="a.dbc"):
    path = tmp_path / name
    path.write_text(text)
    return path


def test_signals_of_a_dbc(tmp_path):
    motor = load([database(tmp_path)]).message(100, False)
    speed, kind, first, second = motor.signals
    assert (speed.name, speed.scale, speed.unit, speed.gates, speed.highest) == ("Speed", 0.25, "rpm", (), None)
    assert kind.unit is None
    assert first.gates == (("Kind", kind.bits, frozenset({0})),)
    assert second.gates[0][2] == {1}


def test_29_bits_match_by_id_then_by_group_from_any_source(tmp_path):
    databases = load([database(tmp_path)])
    wheels = databases.message(WHEELS, True)
    assert wheels.name == "Wheels"
    assert databases.message(WHEELS & 0x3FFFF00 | 0x0C00003E, True) is wheels
    assert databases.message(WHEELS, False) is None
    assert databases.message(100, True) is None
    assert group(0x18F0090B) == group(0x0CF0093E) == 61449
    assert group(0x0C0320C8) == group(0x0C0310D0) == 0x300  # PDU1: 20 and 10 are destinations


def test_the_users_database_is_asked_before_j1939(tmp_path):
    assert load([]).message(0x18F0090B, True).name == "VDC2"
    mine = DBC.replace("2566844926", str(0x98F009FE))
    one, other = database(tmp_path, mine), database(tmp_path, mine.replace("Wheels", "Other"), "b.dbc")
    assert load([one, other]).message(0x18F0090B, True).name == "Wheels"
    assert load([other, one]).message(0x18F0090B, True).name == "Other"


def test_values_that_mean_none_in_a_users_database(tmp_path):
    said = {one.name: one.highest for one in load([database(tmp_path)]).message(WHEELS, True).signals}
    assert said == {"front": 0xFAFF, "full": None, "half": None, "signed": None, "on": 1}
    j1939 = (
        DBC
        + 'BA_DEF_ BO_ "VFrameFormat" ENUM "StandardCAN","ExtendedCAN","reserved","J1939PG";\n'
        + 'BA_DEF_DEF_ "VFrameFormat" "J1939PG";\nBA_ "VFrameFormat" BO_ 2566844926 3;\n'
    )
    said = {one.name: one.highest for one in load([database(tmp_path, j1939)]).message(WHEELS, True).signals}
    assert said == {"front": 0xFAFF, "full": 0xFAFF, "half": None, "signed": None, "on": 1}


@pytest.mark.parametrize(
    ("name", "text"), [("a.dbc", "nonsense"), ("a.arxml", "<AUTOSAR"), ("a.dbc", ""), ("a.txt", "x"), ("a.kcd", "<a/>")]
)
def test_what_is_no_database_is_refused_by_name(tmp_path, name, text):
    with pytest.raises(SignalError, match=rf"^{name}: not a valid CAN database \(.+\); give a DBC or ARXML"):
        load([database(tmp_path, text, name)])


def test_a_missing_database_is_refused(tmp_path):
    with pytest.raises(SignalError, match="cannot be read"):
        load([tmp_path / "none.dbc"])


@given(data=st.data())
@settings(max_examples=60, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_a_damaged_database_raises_only_signal_errors(tmp_path, data):
    text = bytearray(DBC.encode())
    for place in data.draw(st.lists(st.integers(0, 8 * len(text) - 1), min_size=1, max_size=8)):
        text[place // 8] ^= 1 << place % 8
    path = tmp_path / "a.dbc"
    path.write_bytes(text)
    with suppress(SignalError):
        assert load([path]).message(0x18F0090B, True) is not None


def test_kcd_and_sym_files_are_read_too(tmp_path):
    for kind in ("kcd", "sym"):
        path = tmp_path / f"a.{kind}"
        cantools.database.dump_file(cantools.database.load_string(DBC, "dbc"), str(path))
        assert load([path]).message(100, False).name == "Motor"


def test_the_j1939_that_comes_along():
    j1939 = load([])
    groups = {
        "ERC1": 61440, "ETC1": 61442, "EEC1": 61444, "EEC3": 65247,
        "EBC1": 61441, "VDC2": 61449, "SSI": 61459, "SSI2": 61481, "ARI": 61482, "ACCS": 61485, "VDC1": 65103,
        "TCO1": 65132, "HRW": 65134, "CVW": 65136, "EBC2": 65215, "EBS22": 65220, "VDS": 65256, "VW": 65258,
        "CCVS": 65265, "EBS21": 768, "ASC4": 65112,
    }  # fmt: skip
    for name, number in groups.items():
        message = j1939.message(number << 8 | 0x0B, True)
        assert message.name == name
        assert all(one.highest is not None for one in message.signals)


def test_bellow_pressures():
    """200.0 and 201.0 kPa at the front, 455.5 kPa and no value at the rear."""
    message = load([]).message(0x18FE582F, True)
    data = np.frombuffer(b"".join(n.to_bytes(2, "little") for n in (2000, 2010, 4555, 0xFFFF)), np.uint8).reshape(1, 8)
    values = [int(one.bits.raw(data)[0]) for one in message.signals]
    assert [round(one.scale * raw, 1) for one, raw in zip(message.signals, values, strict=True)][:3] == [
        200.0,
        201.0,
        455.5,
    ]
    assert values[3] > message.signals[3].highest
    assert [one.unit for one in message.signals] == ["kPa"] * 4


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


def test_an_arxml_is_read_as_cantools_reads_it():
    path = Path(__file__).parent / "motor.arxml"
    speed, torque = load([path]).message(100, False).signals
    data = bytes([0x50, 0x34, 0x12, 0x1A, 0xBC, 0, 0, 0])
    theirs = cantools.database.load_file(path).get_message_by_name("Motor").decode(data)
    array, length = np.frombuffer(data, np.uint8).reshape(1, 8), np.array([8], np.int32)
    assert speed.values(array, length)[0] == theirs["Speed"] == 0x2345 * 0.25 - 10
    assert torque.values(array, length)[0] == theirs["Torque"] == 0x1AB
    assert speed.unit == "rpm"


@pytest.mark.parametrize("ending", ["dbc", "sym", "kcd", "arxml", ""])
def test_an_error_does_not_show_the_content_of_a_database(tmp_path: Path, ending: str) -> None:
    path = tmp_path / f"shadow.{ending}"
    path.write_text("root:$6$secret:19000:0:99999:7:::\n")
    with pytest.raises(SignalError, match="not a valid CAN database") as caught:
        load([path])
    assert "secret" not in str(caught.value)


def test_gates_of_a_multiplexed_signal():
    gate = ("mux", Bits(start=0, length=8), frozenset({3}))
    signal = CanSignal(name="s", bits=Bits(start=8, length=8), scale=1.0, offset=0.0, unit=None, gates=(gate,))
    assert signal.in_payload(b"\x03\x05")
    assert signal.value(b"\x03\x05") == 5.0
    assert not signal.in_payload(b"\x02\x05")


SPEED = "CCVS.wheel_based_vehicle_speed"


def test_a_frame_gives_the_columns_of_the_map():
    decoder = FrameDecoder(load([]), [SPEED, "VDC2.yaw_rate@0B [rad/s]"])
    assert decoder.columns == (f"{SPEED} [km/h]", "VDC2.yaw_rate@0B [rad/s]")
    (reading,) = decoder.decode(Frame(0.0, 0x18FEF100, b"\xff\x00\x50" + b"\xff" * 5, True))
    assert reading == (f"{SPEED} [km/h]", 80.0, Quality.VALID)
    assert (
        decoder.decode(Frame(0.0, 0x18FEF100, b"\xff\xff\xff" + b"\xff" * 5, True))[0].quality is Quality.NOT_AVAILABLE
    )
    assert decoder.decode(Frame(0.0, 0x18FEF100, b"\xff\x00", True))[0].quality is Quality.WRONG_LENGTH
    assert decoder.decode(Frame(0.0, 0x18F0092F, bytes(8), True)) == []  # another source
    assert len(decoder.decode(Frame(0.0, 0x18F0090B, bytes(8), True))) == 1
    assert decoder.decode(Frame(0.0, 0x123, bytes(8))) == []


def test_the_priority_of_a_message_may_change():
    decoder = FrameDecoder(load([]), [SPEED])
    for number in (0x18FEF100, 0x0CFEF100):
        assert decoder.decode(Frame(0.0, number, bytes(8), True))
    assert not decoder.other_sources


def test_filters_accept_the_mapped_messages_only():
    decoder = FrameDecoder(load([]), [SPEED])
    accepted = [
        number
        for number in (0x18FEF100, 0x0CFEF1FE, 0x18F0090B, 0x18FEF200)
        if any(number & f["can_mask"] == f["can_id"] for f in decoder.filters())
    ]
    assert accepted == [0x18FEF100, 0x0CFEF1FE]


@pytest.mark.parametrize(
    ("column", "message"),
    [
        ("CCVS1.speed", "no database has a message"),
        ("CCVS.speed", "has no signal 'speed'"),
        ("VDC2.yaw_rate@XY", "expected a source address"),
    ],
)
def test_a_column_that_does_not_exist_is_refused(column, message):
    with pytest.raises(SignalError, match=message):
        FrameDecoder(load([]), [column])
