"""Single frames: the same values as in a log, and the columns of a signal map."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fifthwheel.base.errors import SignalError
from fifthwheel.data.logs.can.database import Bits, CanSignal, Frame, FrameDecoder, Quality, load


@st.composite
def bits(draw):
    floating = draw(st.booleans())
    length = draw(st.sampled_from([16, 32, 64])) if floating else draw(st.integers(1, 64))
    little = draw(st.booleans())
    start = draw(st.integers(0, 63))
    return Bits(start=start, length=length, little=little, signed=draw(st.booleans()), floating=floating)


@given(bits(), st.binary(min_size=17, max_size=17), st.sampled_from([None, 1, 250, 0xFAFF]))
def test_one_frame_has_the_value_that_many_frames_have(place, payload, highest):
    signal = CanSignal(name="s", bits=place, scale=0.3, offset=-7.0, unit=None, highest=highest)
    data, length = np.frombuffer(payload, np.uint8)[None], np.array([len(payload)], np.int32)
    assert signal.in_payload(payload) == signal.present(data, length)[0] == True  # noqa: E712
    np.testing.assert_array_equal(signal.value(payload), signal.values(data, length)[0])


@given(bits(), st.binary(max_size=20))
def test_a_payload_that_is_too_short_has_no_value(place, payload):
    signal = CanSignal(name="s", bits=place, scale=1.0, offset=0.0, unit=None)
    assert signal.in_payload(payload) == (len(payload) >= place.span[1])


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
