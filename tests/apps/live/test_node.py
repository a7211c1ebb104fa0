"""Faults of a bus, each with a status within 100 ms, and never NaN with a valid status."""

import math
from itertools import pairwise

import numpy as np
import pytest

from fifthwheel.apps.live.status import LiveFault, NodeStatus
from fifthwheel.data.logs import SignalMap
from fifthwheel.data.logs.can.database import Frame
from tests.apps.live.truck_bus import driven, frames, observer_node, write_files

RECORD = driven()
AT = 3.0
"""When a fault begins, s."""
VALID = (NodeStatus.OK, NodeStatus.COASTING, NodeStatus.INCONSISTENT, NodeStatus.SETTLING, NodeStatus.DEGRADED)


@pytest.fixture
def node(tmp_path):
    return observer_node(write_files(tmp_path))


def outputs(node, stream):
    found = [output for frame in stream for output in node.receive(frame)]
    for output in found:
        finite = all(math.isfinite(value) for value in output.states.values())
        assert finite or output.status not in VALID
    assert all(b.time > a.time for a, b in pairwise(found))
    return found


def stream(**options):
    return frames(RECORD, spread=0.0007, **options)


def first(found, fault):
    return next(output.time for output in found if output.faults & fault and output.status is not NodeStatus.OK)


def silent(frame):
    return [] if AT < frame.time < AT + 0.8 else [frame]


def missing(frame):
    return [] if frame.time > AT and frame.id == 258 else [frame]


def short(frame):
    return [frame._replace(data=frame.data[:5])] if frame.time > AT and frame.id == 257 else [frame]


FAULTS = {
    "silent": (silent, LiveFault.SILENT),
    "a message is missing": (missing, LiveFault.SIGNAL_MISSING),
    "short frames": (short, LiveFault.WRONG_LENGTH),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_is_reported_within_100_ms(node, name):
    change, fault = FAULTS[name]
    found = []
    for frame in stream():
        sent = change(frame)
        for each in sent:
            found += node.receive(each)
        if not sent:
            found += node.advance(frame.time)
    assert AT < first(found, fault) < AT + 0.1
    settling = [output for output in found if output.status is NodeStatus.SETTLING and output.time < AT]
    assert all(output.time < 0.1 for output in settling)
    assert all(output.status is NodeStatus.OK for output in found[len(settling) :] if output.time < AT)


@pytest.mark.parametrize(
    ("value", "fault", "within"), [(1e3, LiveFault.IMPLAUSIBLE, 1.1), (0.0, LiveFault.FROZEN, 3.1)]
)
def test_values_that_no_sensor_gives_are_reported(node, value, fault, within):
    """A wrong byte order, and a gyro that hangs."""
    push = node._map.push

    def changed(sample):
        return [{**s, "yaw_rate.semitrailer": value} if s["time"] >= AT else s for s in push(sample)]

    node._map.push = changed
    found = outputs(node, stream())
    seen = [output for output in found if output.faults & fault]
    assert AT + within - 0.2 < seen[0].time < AT + within
    assert {"yaw_rate.semitrailer"} == {name for output in seen for name, f in output.problems.items() if f is fault}
    assert all(output.status is not NodeStatus.OK for output in seen)


def test_a_signal_that_is_not_available_is_reported(tmp_path):
    (tmp_path / "signals.toml").write_text(
        '[signals]\nspeed = "CCVS.wheel_based_vehicle_speed"\n"yaw_rate.tractor" = "VDC2.yaw_rate"\n'
        '"steer.tractor.front" = { column = "VDC2.steering_wheel_angle", gain = 0.05 }\n'
    )
    node = observer_node(SignalMap.load(tmp_path / "signals.toml"))
    good = bytes([0x7F, 0x7D, 0xFF, 0x70, 0x7D, 0xFF, 0xFF, 0xFF])
    speed = bytes([0xFF, 0x00, 0x50, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF])
    found = []
    for k in range(300):
        data = good if k < 200 else good[:3] + b"\xff\xff" + good[5:]
        found += node.receive(Frame(0.01 * k, 0x18F0090B, data, True))
        if k % 10 == 0:
            found += node.receive(Frame(0.01 * k, 0x18FEF100, speed, True))
    assert found[150].status is NodeStatus.OK
    assert 2.0 <= first(found, LiveFault.NOT_AVAILABLE) < 2.1
    assert any("VDC2.yaw_rate" in column for column in found[-1].problems)


def test_single_wrong_timestamps_change_nothing(node):
    """Those that are not finite, too."""
    odd = {700: math.nan, 800: math.inf, 900: -math.inf, 1000: 1e4}
    found = outputs(node, (frame._replace(time=odd.get(k, frame.time)) for k, frame in enumerate(stream())))
    assert any(output.faults & LiveFault.TIME_JUMP for output in found)
    assert found[-1].status is NodeStatus.OK
    assert found[-1].time < 8.0


@pytest.mark.parametrize("jump", [-1e6, 30.0])
def test_the_states_return_after_a_jump_of_the_clock(node, jump):
    found = outputs(node, (f._replace(time=f.time + jump * (f.time > AT)) for f in stream()))
    assert found[-1].status is NodeStatus.OK
    assert found[-1].bus_time == pytest.approx(RECORD.time[-1] + jump, abs=0.05)
    assert any(output.faults & LiveFault.TIME_JUMP for output in found)
    if jump < 0:
        after = next(output for output in found if output.bus_time < AT + jump / 2)
        assert after.faults & LiveFault.TIME_JUMP
        assert after.status is not NodeStatus.OK


def test_frames_of_others_have_no_effect_and_random_payloads_never_give_nan_with_a_valid_status(tmp_path):
    clean = outputs(observer_node(write_files(tmp_path)), stream())
    assert not any(output.faults & (LiveFault.IMPLAUSIBLE | LiveFault.FROZEN) for output in clean)
    random = np.random.default_rng(2)
    flood = (f for g in stream() for f in (Frame(g.time, int(random.integers(300, 2048)), random.bytes(8)), g))
    found = outputs(observer_node(write_files(tmp_path)), flood)
    assert [output.states for output in found][-300:] == [output.states for output in clean][-300:]
    noise = (f._replace(data=random.bytes(random.integers(0, 9))) if random.random() < 0.5 else f for f in stream())
    assert outputs(observer_node(write_files(tmp_path)), noise)


def test_a_state_that_is_not_finite_is_a_failure(node):
    class Broken:
        def push(self, sample):
            return {"time": sample["time"], "status": 0, "roll.tractor": math.nan}

        def reset(self):
            self.restarted = True

    node.estimator = Broken()
    found = outputs(node, stream())
    assert {output.status for output in found} == {NodeStatus.FAILED}
    assert node.estimator.restarted


def test_a_second_sender_is_ignored_and_named(tmp_path):
    (tmp_path / "signals.toml").write_text(
        '[signals]\nspeed = "CCVS.wheel_based_vehicle_speed"\n"yaw_rate.tractor" = "VDC2.yaw_rate@0B"\n'
        '"steer.tractor.front" = { column = "VDC2.steering_wheel_angle", gain = 0.05 }\n'
    )
    node = observer_node(SignalMap.load(tmp_path / "signals.toml"))
    for source in (0x0B, 0x2F):
        node.receive(Frame(0.01 * source, 0x18F00900 | source, bytes(8), True))
    assert node.decoder.other_sources == {"VDC2.steering_wheel_angle [rad]": ["@2F:0"]}


@pytest.mark.slow
def test_a_second_bus_with_another_clock_is_aligned(node):
    """The clock of the second bus also runs 100 ppm fast."""
    found = outputs(node, (f._replace(bus=1, time=f.time * (1 + 1e-4) + 1e9) if f.id == 258 else f for f in stream()))
    assert {output.status for output in found[20:]} == {NodeStatus.OK}
    samples = [sample for output in found for sample in output.samples if "yaw_rate.semitrailer" in sample]
    times = np.array([sample["time"] for sample in samples])
    values = np.array([sample["yaw_rate.semitrailer"] for sample in samples])
    expected = np.interp(times, RECORD.time, RECORD.signals["yaw_rate.semitrailer"])
    assert np.sqrt(np.mean((values - expected) ** 2)) < 0.004  # a few ms of the manoeuvre


def test_frames_that_arrive_late_in_their_order_are_no_jump_of_the_clock(node):
    found = []
    for frame in stream():
        if not 3.0 < frame.time < 3.3:
            found += node.receive(frame)
            continue
        found += node.advance(frame.time + 0.2)  # the clock of the computer goes on, the frames come later
        found += node.receive(frame)
    assert not any(output.faults & LiveFault.TIME_JUMP for output in found)
    assert any(output.faults & LiveFault.OVERLOAD for output in found)
    assert found[-1].status is NodeStatus.OK


class Lifting:
    """An estimator that predicts a load transfer ratio."""

    def __init__(self, ratio):
        self.ratio = ratio

    def push(self, sample):
        ratios = {"load_transfer.semitrailer": 0.0, "predicted_load_transfer.semitrailer": self.ratio}
        sigma = {"predicted_load_transfer.semitrailer.sigma": 0.01}
        return {"time": sample["time"], "status": 0, "nis": 1.0, **ratios, **sigma}

    def reset(self):
        raise AssertionError


def test_a_wheel_that_is_about_to_lift(tmp_path):
    """Is a fault of the truck, not of the states."""
    for ratio in (0.85, -0.95):
        node = observer_node(write_files(tmp_path))
        node.estimator = Lifting(ratio)
        found = [output for frame in stream() for output in node.receive(frame)][50:]
        assert {output.status for output in found} == {NodeStatus.OK}
        assert {bool(output.faults & LiveFault.WHEEL_LIFT) for output in found} == {abs(ratio) > 0.9}
