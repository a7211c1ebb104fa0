"""The frames of a recorded trace or of live buses through a node.

`listen` is the only place with a clock and threads between bus and states.
"""

import math
import queue
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from fifthwheel.apps.live.node import SHOWN, Node, Output
from fifthwheel.apps.live.sources.bus import Arrival, LiveBus
from fifthwheel.apps.live.status import LiveFault
from fifthwheel.data.logs.can.database import Frame
from fifthwheel.data.logs.readers.can import read_frames

IDLE = 0.003
"""Longest time without a look at the clock, s."""
SAME = 1e-3
"""A frame whose timestamp is that of the node, to within this, s, was accepted as the newest one."""
LATE = 0.05
"""A frame that has waited longer means that the node does not keep up, s."""


def read_trace(path: Path, notes: list[str]) -> Iterator[Frame]:
    """The frames of a BLF, ASC, PCAN or candump trace; `notes` gets what is left out."""
    for batch, _ in read_frames(path, notes):
        rows = zip(
            batch.time.tolist(),
            batch.id.tolist(),
            map(bytes, batch.data),
            batch.length.tolist(),
            batch.extended.tolist(),
            batch.bus.tolist(),
            strict=True,
        )
        for at, number, data, length, extended, bus in rows:
            yield Frame(at, number, data[:length], extended, bus)


def replay(
    node: Node, frames: Iterator[Frame], *, speed: float = 1.0, sleep: Callable[[float], object] = time.sleep
) -> Iterator[Output]:
    """The outputs of a node for recorded frames; `speed` in recorded seconds per second, 0 for as fast as possible."""
    started, first = time.monotonic(), math.nan
    for frame in frames:
        if speed:
            first = frame.time if math.isnan(first) else first
            wait = (frame.time - first) / speed - (time.monotonic() - started)
            if 0 < wait < math.inf:
                sleep(wait)
        yield from node.receive(frame)
    yield from node.finish()


def listen(
    node: Node, buses: Sequence[LiveBus], frames: "queue.Queue[Arrival]", stopped: Callable[[], bool]
) -> Iterator[Output]:
    """The outputs of a node while started buses fill the queue of frames; their faults become those of the node."""
    newest, at = time.time(), time.monotonic()  # a time of the bus, and when it was
    overloaded, dropped = -SHOWN, 0
    while not stopped():
        node.set_fault(LiveFault.BUS_OFF, any(bus.off for bus in buses))
        node.set_fault(LiveFault.OVERLOAD, time.monotonic() - overloaded < SHOWN)
        try:
            arrival = frames.get_nowait()
        except queue.Empty:
            yield from node.advance(newest + time.monotonic() - at)
            try:
                arrival = frames.get(timeout=IDLE)
            except queue.Empty:
                yield from node.advance(newest + time.monotonic() - at)
                continue
        total = sum(bus.dropped for bus in buses)
        if time.monotonic() - arrival.at > LATE or total > dropped:
            overloaded, dropped = time.monotonic(), total
        yield from node.receive(arrival.frame)
        if abs(arrival.frame.time - node.newest) < SAME:
            newest, at = arrival.frame.time, arrival.at
