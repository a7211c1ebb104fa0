"""Frames that the node sends, decoded by cantools with the DBC that it writes."""

import math

import cantools
import pytest

from fifthwheel.apps.live.node import Output
from fifthwheel.apps.live.outputs.frames_out import FrameEncoder
from fifthwheel.apps.live.status import LiveFault, NodeStatus
from fifthwheel.base.errors import FifthwheelError
from fifthwheel.estimate.identify.verdict import Verdict
from fifthwheel.estimate.online import LearnedValue

STATES = ("sideslip.tractor", "sideslip.semitrailer", "yaw_rate.semitrailer")
PARAMETERS = (
    "semitrailer.cornering_stiffness",
    "semitrailer.payload.height",
    "tractor.drive.a_very_long_name.cornering",
)
VALUES = {
    "sideslip.tractor": 0.01234,
    "sideslip.semitrailer": -0.0567,
    "yaw_rate.semitrailer": 9.0,  # beyond the range
    "nis": 1.23,
}


def output(status=NodeStatus.OK, faults=LiveFault.NONE, values=VALUES):
    sigma = {f"{name}.sigma": 0.002 for name in STATES}
    states = {**sigma, **values} if values else dict.fromkeys((*STATES, *sigma, "nis"), math.nan)
    return Output(time=1.0, bus_time=1.0, status=status, faults=faults, problems={}, states=states, samples=())


def decoded(encoder, frames):
    database = cantools.database.load_string(encoder.dbc(), "dbc")
    found = {}
    for frame in frames:
        message = database.get_message_by_frame_id(frame.id)
        assert message.is_extended_frame == frame.extended
        found |= message.decode(frame.data, decode_choices=False)
    return found


@pytest.mark.parametrize("first", [0x500, 0x18FF0080])
def test_frames_decode_to_the_states(first):
    encoder = FrameEncoder(first, STATES, PARAMETERS)
    found = decoded(encoder, encoder.encode(output(NodeStatus.DEGRADED, LiveFault.SIGNAL_MISSING), known=2))
    assert found["sideslip_tractor"] == pytest.approx(0.0123, abs=5e-5)
    assert found["sideslip_semitrailer"] == pytest.approx(-0.0567, abs=5e-5)
    assert found["sideslip_semitrailer_sigma"] == pytest.approx(0.002)
    assert found["yaw_rate_semitrailer"] == pytest.approx(3.2767)
    assert found["status"] == NodeStatus.DEGRADED
    assert found["faults"] == LiveFault.SIGNAL_MISSING
    assert found["nis"] == pytest.approx(1.23)
    assert found["known_parameters"] == 2


def test_missing_states_are_not_available():
    encoder = FrameEncoder(0x500, STATES)
    frames = encoder.encode(output(NodeStatus.INPUT_MISSING, values=None))
    database = cantools.database.load_string(encoder.dbc(), "dbc")
    message = database.get_message_by_frame_id(frames[1].id)
    assert message.decode(frames[1].data)["sideslip_tractor"] == "not available"
    assert message.decode(frames[1].data)["sideslip_tractor_sigma"] == "not available"


def test_parameters_come_in_turn():
    encoder = FrameEncoder(0x500, STATES, PARAMETERS)
    for name in PARAMETERS:
        estimate = LearnedValue(name=name, value=1.25e6, sigma=0.1e6, verdict=Verdict.DOUBTFUL)
        found = decoded(encoder, [encoder.encode_parameter(estimate, 0.0)])
        (value,) = [found[key] for key in found if key not in ("parameter", "verdict", "relative_sigma")]
        assert value == 1.25e6
        assert found["relative_sigma"] == pytest.approx(0.08)
        assert found["verdict"] == list(Verdict).index(Verdict.DOUBTFUL)
        assert found["parameter"] == PARAMETERS.index(name)


def test_ids():
    """Those of 29 bits keep their source address; those that do not fit are refused."""
    assert {number & 0xFF for number in FrameEncoder(0x18FF0080, STATES, PARAMETERS).ids} == {0x80}
    for first in (-1, 0x7FF, 0x18FFFF80, 0x1FFFFFFF):
        with pytest.raises(FifthwheelError, match="do not fit"):
            FrameEncoder(first, STATES, PARAMETERS)
