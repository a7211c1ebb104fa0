"""The node on virtual buses and on UDP multicast."""

import socket
import threading
import time
from itertools import pairwise

import can
import cantools
import pytest

from fifthwheel.apps.live.setup import opened
from fifthwheel.apps.live.sources.bus import LiveBus, frame_queue
from fifthwheel.apps.live.sources.feed import listen
from fifthwheel.apps.live.status import LiveFault, NodeStatus
from fifthwheel.base.errors import FifthwheelError
from fifthwheel.base.options import LiveOptions, ObserverOptions
from tests.apps.live.truck_bus import driven, frames, observer_node, write_files

RECORD = driven()


def play(bus, record, seconds, *, on=lambda frame: True):
    """Send the frames of a record in real time."""
    start = time.monotonic()
    for frame in frames(record, spread=0.0005):
        if frame.time > seconds:
            return
        time.sleep(max(0.0, start + frame.time - time.monotonic()))
        if on(frame):
            bus.send(can.Message(arbitration_id=frame.id, data=frame.data, is_extended_id=False))


def multicast_works():
    try:
        with can.Bus(interface="udp_multicast", channel="239.74.163.2", port=43201) as bus:
            bus.send(can.Message(arbitration_id=1))
    except (OSError, can.CanError):
        return False
    return True


def run(name, folder, action, seconds=1.5, **options):
    """Outputs while an action runs with a sending bus."""
    node, queue = observer_node(write_files(folder)), frame_queue()
    bus = LiveBus(name, 0, node.decoder.filters(), queue, options)
    interface, _, channel = name.partition(":")
    ended = threading.Event()
    outputs = []
    with can.Bus(interface=interface, channel=channel, **options) as sender:
        bus.start()
        thread = threading.Thread(target=lambda: (action(sender, bus), ended.set()))
        thread.start()
        for output in listen(node, [bus], queue, ended.is_set):
            outputs.append((time.monotonic(), output))
        thread.join()
        bus.close()
    return outputs


@pytest.mark.slow
@pytest.mark.skipif(not multicast_works(), reason="needs UDP multicast")
def test_states_arrive_from_udp_multicast(tmp_path):
    outputs = run("udp_multicast:239.74.163.2", tmp_path, lambda sender, bus: play(sender, RECORD, 1.0), port=43201)
    assert sum(output.status in (NodeStatus.OK, NodeStatus.DEGRADED) for _, output in outputs) > 50


@pytest.mark.slow
def test_states_arrive_at_100_hz_and_a_silent_bus_is_reported_within_100_ms(tmp_path):
    stopped = []

    def action(sender, bus):
        play(sender, RECORD, 1.2)
        stopped.append(time.monotonic())
        time.sleep(0.4)

    outputs = run("virtual:silent", tmp_path, action)
    heard = [output for at, output in outputs if at <= stopped[0]]
    assert 80 < len(heard) < 160
    late = LiveFault.OVERLOAD  # on a busy computer
    assert sum(output.status is NodeStatus.OK or output.faults == late for output in heard[-75:]) > 60
    assert all(b.time > a.time for a, b in pairwise(output for _, output in outputs))
    first = next(at for at, output in outputs if at > stopped[0] and output.faults & LiveFault.SILENT)
    assert first - stopped[0] < 0.1
    assert all(output.status is not NodeStatus.OK for at, output in outputs if at > first)


@pytest.mark.slow
def test_a_bus_that_goes_off_is_reported_and_opened_again(tmp_path):
    events = {}

    def action(sender, bus):
        play(sender, RECORD, 0.5)
        real, events["off"] = bus._bus, time.monotonic()

        def broken(timeout):
            raise can.CanOperationError("bus off")

        real.recv = broken
        bus._thread.join(0.3)
        events["reported"] = bool(bus.off)
        play(sender, RECORD, 1.2)
        events["again"] = bus.off == ""

    outputs = run("virtual:off", tmp_path, action)
    assert events["reported"]
    assert events["again"]
    first = next(at for at, output in outputs if output.faults & LiveFault.BUS_OFF)
    assert first - events["off"] < 0.25  # the virtual bus ends a call of recv first
    assert outputs[-1][1].status is NodeStatus.OK


def test_a_wrong_bus_and_one_that_cannot_be_opened_are_refused():
    for name in ("can0", "nonsense:can0", "virtual:"):
        with pytest.raises(FifthwheelError, match="INTERFACE:CHANNEL"):
            LiveBus(name, 0, [], frame_queue())
    with pytest.raises(FifthwheelError, match="cannot be opened"):
        LiveBus(f"socketcan:none{socket.gethostname()[:2]}", 0, [], frame_queue()).start()


@pytest.mark.slow
def test_the_states_are_sent_on_the_bus(tmp_path):
    write_files(tmp_path)
    chosen = LiveOptions(bus=("virtual:send",), send="0x500", dbc=tmp_path / "states.dbc")
    stop = threading.Event()
    run = opened(
        "cheng_cebon_2011", tmp_path / "signals.toml", chosen, ObserverOptions(), stop=stop, say=lambda text: None
    )
    with can.Bus(interface="virtual", channel="send") as other:
        with run as (session, outputs):
            thread = threading.Thread(target=lambda: (play(other, RECORD, 0.5), stop.set()))
            thread.start()
            last = None
            for output in outputs:
                session.handle(output)
                if output.time == session._sent:  # on a busy machine samples may be less than 10 ms apart
                    last = output
            thread.join()
        database = cantools.database.load_file(tmp_path / "states.dbc")
        found = {}
        while (message := other.recv(0)) is not None:
            found |= database.decode_message(message.arbitration_id, message.data, decode_choices=False)
    assert found["status"] == last.status
    assert found["sideslip_semitrailer"] == pytest.approx(last.states["sideslip.semitrailer"], abs=1e-4)
    assert not session.node.faults & LiveFault.NOT_SENT
