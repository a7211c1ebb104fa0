"""A recorded trace of frames through a node."""

import math
import time
from collections.abc import Callable, Iterator
from pathlib import Path

from fifthwheel.live.node import Node, Output
from fifthwheel.logs.can.decoder import Frame
from fifthwheel.logs.readers.can import read_frames


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
    node: Node,
    frames: Iterator[Frame],
    *,
    speed: float = 1.0,
    sleep: Callable[[float], object] = time.sleep,
    now: Callable[[], float] = time.monotonic,
) -> Iterator[Output]:
    """The outputs of a node for recorded frames.

    Args:
        node: the node.
        frames: in the order of the trace.
        speed: recorded seconds in one second; 0 for as fast as possible.
        sleep, now: the clock.
    """
    started, first = now(), math.nan
    for frame in frames:
        if speed:
            first = frame.time if math.isnan(first) else first
            wait = (frame.time - first) / speed - (now() - started)
            if 0 < wait < math.inf:
                sleep(wait)
        yield from node.receive(frame)
    yield from node.finish()
