"""The live node: latency, share of the processor, full bus load, memory.

    python benchmarks/live.py                # needs the live extra
    python benchmarks/live.py --samples 1e6  # of the measurement of the memory

* latency: from the arrival of the last frame of a cycle at the node to its output, in a replay of the frames; and the
  time of the processor in it, which does not depend on other programs;
* bus: from the time at which a frame is sent to the output with it, over a virtual bus with its threads, in real time;
* processor: time of the processor for one second of frames at 100 Hz;
* full load: the same with the 8000 frames/s of 1 Mbit/s, of which the signal map has 300; all reach the node here,
  while SocketCAN discards the others in its filters;
* memory: of the process after so many samples.

Targets: latency p99 2 ms; 10 % of a core for the observer, 25 % for the learner.
"""

import argparse
import gc
import itertools
import os
import resource
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import can
import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from tests.apps.live.truck_bus import TRUCK, driven, frames, write_files

from fifthwheel.apps.live.checkpoint import make_learning
from fifthwheel.apps.live.node import Node
from fifthwheel.apps.live.setup import completed_map, make_node, make_observer
from fifthwheel.apps.live.sources.bus import LiveBus, frame_queue
from fifthwheel.apps.live.sources.feed import listen
from fifthwheel.data.logs.can.database import Frame

SECONDS = 40.0
FLOOD = 8000
"""Frames per second at 1 Mbit/s."""


def node(kind: str) -> Node:
    """A node with an observer or a learner."""
    with tempfile.TemporaryDirectory() as folder:
        signals = completed_map(write_files(Path(folder)))
        if kind == "observer":
            return make_node(signals, make_observer(TRUCK, signals, None, 5.0))
        return make_node(signals, make_learning(TRUCK, signals.signals))


def flooded(stream: Iterator[Frame]) -> Iterator[Frame]:
    """Frames of other messages between those of the truck."""
    last, others = 0.0, itertools.cycle(range(300, 2000))
    for frame in stream:
        for k in range(round((frame.time - last) * FLOOD)):
            yield Frame(last + k / FLOOD, next(others), bytes(8))
        last = frame.time
        yield frame


def percentiles(times: list[float]) -> str:
    p50, p99, largest = np.percentile(times, [50, 99, 100]) * 1e3
    return f"p50 {p50:.3f} ms, p99 {p99:.3f} ms, largest {largest:.1f} ms"


def latency(kind: str, *, flood: bool = False) -> None:
    """Latency and share of the processor in a replay."""
    measured, times, computing = node(kind), [], []
    stream = frames(driven(SECONDS), spread=0.0007)
    every = list(flooded(stream) if flood else stream)
    gc.collect()
    busy = time.process_time()
    for frame in every:
        start, used = time.perf_counter(), time.thread_time()
        outputs = measured.receive(frame)
        outputs += measured.advance(frame.time + 2e-5)  # as `listen` does when no frame waits
        if outputs:
            times.append(time.perf_counter() - start)
            computing.append(time.thread_time() - used)
    share = (time.process_time() - busy) / every[-1].time
    title = f"{kind}{', full load' * flood}"
    print(f"{title}, computing only: {percentiles(computing)}")
    print(
        f"{kind}{', full load' * flood}: {percentiles(times)}; {share:.1%} of a core, {len(every)} frames", flush=True
    )


def bus(kind: str, seconds: float = 20.0) -> None:
    """Latency over a virtual bus in real time, and the share of the processor without that of the sender."""
    measured, queue, sent, times = node(kind), frame_queue(), {}, []
    receiver, ended, spent = LiveBus("virtual:benchmark", 0, [], queue), threading.Event(), [0.0]

    def send() -> None:
        with can.Bus(interface="virtual", channel="benchmark", preserve_timestamps=True) as sender:
            start, epoch = time.monotonic(), time.time()
            for frame in frames(record, spread=0.0007):
                if frame.time > seconds:
                    break
                time.sleep(max(0.0, start + frame.time - time.monotonic()))
                stamp = epoch + frame.time
                sent[round(stamp, 5)] = time.monotonic()
                sender.send(
                    can.Message(timestamp=stamp, arbitration_id=frame.id, data=frame.data, is_extended_id=False)
                )
        spent[0] = time.thread_time()
        ended.set()

    record = driven(seconds)
    receiver.start()
    busy = time.process_time()
    threading.Thread(target=send).start()
    for output in listen(measured, [receiver], queue, ended.is_set):
        if (at := sent.get(round(output.bus_time, 5))) is not None:
            times.append(time.monotonic() - at)
    share = (time.process_time() - busy - spent[0]) / min(seconds, float(record.time[-1]))
    receiver.close()
    print(f"{kind}, virtual bus: {percentiles(times[100:])}; {share:.1%} of a core, {len(times)} outputs", flush=True)


def memory(kind: str, samples: int) -> None:
    """Memory after many samples."""
    measured, record = node(kind), driven(SECONDS)
    length, sizes, done, once = float(record.time[-1]) + 0.01, [], 0, list(frames(record))
    for k in range(samples // len(record.time)):
        for frame in once:
            done += len(measured.receive(frame._replace(time=frame.time + k * length)))
        sizes.append(int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize() / 1e6)
    print(f"{kind}: {sizes[0]:.0f} MB after {len(record.time)} samples, {sizes[-1]:.0f} MB after {done}", flush=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--samples", type=float, default=1e5)
    options = parser.parse_args()
    print(f"load of the computer: {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")
    for name in ("observer", "learner"):
        latency(name)
        latency(name, flood=True)
        bus(name)
    memory("observer", round(options.samples))
