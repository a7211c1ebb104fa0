"""The frames of live buses through a node: the only place with a clock and threads between bus and states."""

import queue
import time
from collections.abc import Callable, Iterator, Sequence

from fifthwheel.live.node import SHOWN, Node, Output
from fifthwheel.live.sources.bus import LONGEST_QUEUE, Arrival, LiveBus
from fifthwheel.live.status import LiveFault

IDLE = 0.003
"""Longest time without a look at the clock, s."""
SAME = 1e-3
"""A frame whose timestamp is that of the node, to within this, s, was accepted as the newest one."""
LATE = 0.05
"""A frame that has waited longer means that the node does not keep up, s."""


def frame_queue() -> "queue.Queue[Arrival]":
    """A queue for the frames of all buses."""
    return queue.Queue(LONGEST_QUEUE)


def listen(
    node: Node, buses: Sequence[LiveBus], frames: "queue.Queue[Arrival]", stopped: Callable[[], bool]
) -> Iterator[Output]:
    """The outputs of a node while the buses are read.

    Args:
        node: the node.
        buses: started; their faults become those of the node.
        frames: the queue of the buses.
        stopped: whether to end.
    """
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
