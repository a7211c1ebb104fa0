"""A live run from what a user requests: files, buses, outputs; a node from vehicle, signal map and estimator."""

import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from itertools import takewhile
from pathlib import Path
from typing import Any

from fifthwheel._atomic import reserved
from fifthwheel.dynamics.saturation import TyreLaw
from fifthwheel.errors import FifthwheelError, SignalError
from fifthwheel.identify import Identification
from fifthwheel.live.checkpoint import Checkpoint, make_learning
from fifthwheel.live.learning import Learning
from fifthwheel.live.node import LiveEstimator, Node, Output
from fifthwheel.live.outputs.frames_out import FrameEncoder
from fifthwheel.live.outputs.recorder import BackgroundWriter, Recorder
from fifthwheel.live.session import Session
from fifthwheel.live.sources.bus import LiveBus, frame_queue
from fifthwheel.live.sources.feed import listen, read_trace, replay
from fifthwheel.logs import LiveMap, SignalMap
from fifthwheel.logs.can.database import load
from fifthwheel.logs.can.decoder import FrameDecoder, signal_columns
from fifthwheel.logs.signal_map import TimeColumn
from fifthwheel.observe import Observer, ObserverSettings
from fifthwheel.vehicle import Vehicle
from fifthwheel.workflow import exported_observer, read_vehicle


@dataclass(frozen=True, kw_only=True)
class Inputs:
    """Where frames and knowledge of the truck come from."""

    vehicle: str  # name in the catalogue, or file
    signals: Path
    buses: tuple[str, ...] = ()
    bitrate: int | None = None  # bit/s; None where it is set outside
    trace: Path | None = None  # instead of a bus
    speed: float = 1.0  # of the replay; 0 for as fast as possible
    identification: Path | None = None
    learn: bool = False
    state: Path | None = None  # file of the learned estimates
    trailer: str | None = None
    trailer_signal: str | None = None  # Message.Signal with the number of the trailer
    locks: tuple[str, ...] = ()  # parameters that are not learned
    tyres: TyreLaw = "linear"  # law of the side forces that is learned
    min_speed: float = 5.0  # m/s
    friction: float | None = None
    half_track: float = ObserverSettings.half_track  # m; see `ObserverSettings`
    allow_outside: bool = False  # see `SignalMap.load`


@dataclass(frozen=True, kw_only=True)
class Outputs:
    """Where states and parameters go to."""

    send: int | None = None  # first id of the frames
    send_rate: float = 100.0  # Hz
    dbc: Path = Path("fifthwheel-live.dbc")
    record: Path | None = None
    page: str | None = None  # port, or HOST:PORT
    force: bool = False  # replace a record that exists


@contextmanager
def opened(
    inputs: Inputs, outputs: Outputs, stop: threading.Event, say: Callable[[str], object]
) -> Iterator[tuple[Session, Iterator[Output]]]:
    """A session and the outputs for it, until `stop` is set or the trace ends; then everything is closed.

    `say` receives sentences for the user. A FifthwheelError if an input cannot be used, or an output cannot be written.
    """
    vehicle = read_vehicle(inputs.vehicle)
    signal_map = SignalMap.load(inputs.signals, allow_outside=inputs.allow_outside)
    if inputs.trace is not None and not inputs.trace.is_file():
        raise FifthwheelError(f"{inputs.trace}: no such file; check the path")
    with reserved(outputs.record, force=outputs.force), reserved(inputs.state, force=True), ExitStack() as stack:
        session = _session(inputs, outputs, vehicle, signal_map, say)
        stack.callback(_report, session, say)
        stack.callback(session.close)
        if outputs.page is not None:
            from fifthwheel.live.page.server import Page

            page = Page(outputs.page, vehicle, session)
            session.views = [page]
            say(f"Page: {page.address}")
        if inputs.trace is not None:
            notes: list[str] = []
            stack.callback(lambda: [say(note) for note in notes])
            frames = takewhile(lambda _: not stop.is_set(), read_trace(inputs.trace, notes))
            yield session, replay(session.node, frames, speed=inputs.speed, sleep=stop.wait)
            return
        arrivals, options = frame_queue(), {"bitrate": inputs.bitrate} if inputs.bitrate else {}
        filters = session.node.decoder.filters()
        buses = [LiveBus(name, k, filters, arrivals, options) for k, name in enumerate(inputs.buses)]
        for k, bus in enumerate(buses):
            if bus.number in (other.number for other in buses[:k]):
                bus.number = max(other.number for other in buses) + 1
            stack.callback(bus.close)
            bus.start()
        session.bus = buses[0]
        yield session, listen(session.node, buses, arrivals, stop.is_set)


def _session(
    inputs: Inputs, outputs: Outputs, vehicle: Vehicle, signal_map: SignalMap, say: Callable[[str], object]
) -> Session:
    """The session without its page and its bus."""
    node, learning, states = _node(inputs, vehicle, signal_map)
    encoder = None
    if outputs.send is not None:
        encoder = FrameEncoder(outputs.send, states, [e.name for e in learning.parameters] if learning else [])
        if taken := node.decoder.own(encoder.ids, extended=encoder.extended):
            raise FifthwheelError(f"--send: {taken:#x} is the id of a mapped message; give another id")
        encoder.write_dbc(outputs.dbc)
        say(f"Written: {outputs.dbc}")
    writer = BackgroundWriter()
    return Session(
        node=node,
        writer=writer,
        learning=learning,
        checkpoint=Checkpoint(learning, inputs.state, writer) if learning and inputs.state else None,
        recorder=Recorder(outputs.record, writer) if outputs.record else None,
        encoder=encoder,
        send_period=1 / outputs.send_rate,
        trailer_column=next(iter(node.extra_columns), ""),
    )


def _node(inputs: Inputs, vehicle: Vehicle, signal_map: SignalMap) -> tuple[Node, Learning | None, tuple[str, ...]]:
    """The node, its learner, and the names of its states."""
    complete = completed_map(signal_map)
    extra = (inputs.trailer_signal,) if inputs.trailer_signal else ()
    if inputs.learn:
        learning = make_learning(
            vehicle, complete.signals, path=inputs.state, trailer=inputs.trailer, locks=inputs.locks, tyres=inputs.tyres
        )
        return make_node(complete, learning, extra=extra), learning, learning.learner.reported
    identification = Identification.load(inputs.identification) if inputs.identification else None
    surroundings = {"friction": inputs.friction, "half_track": inputs.half_track}
    observer = make_observer(vehicle, complete, identification, inputs.min_speed, **surroundings)
    return make_node(complete, observer, extra=extra), None, observer.reported


def _report(session: Session, say: Callable[[str], object]) -> None:
    """Which files were written, or why not, and columns with several senders."""
    for column, others in session.node.decoder.other_sources.items():
        say(f"{column}: also sent by {', '.join(others)}, which is ignored; name the source in signals.toml")
    for error in session.writer.errors.values():
        say(error)
    if session.recorder is not None and session.recorder.path.exists():
        say(f"Written: {session.recorder.path}")


def make_node(signal_map: SignalMap, estimator: LiveEstimator, *, extra: tuple[str, ...] = ()) -> Node:
    """The node of a vehicle, with a map as `completed_map` gives it.

    The values of the `extra` columns of the databases are kept in `Node.extra`. A SignalError if a column is in no
    database, or has timestamps of its own.
    """
    columns = list(dict.fromkeys(text for channel in signal_map.signals.values() for text in channel.columns))
    decoder = FrameDecoder(load(signal_map.databases), [*columns, *extra])
    mapped = LiveMap(signal_map, ["time", *decoder.columns])
    return Node(estimator, decoder, mapped, extra=decoder.columns[len(columns) :])


def completed_map(signal_map: SignalMap) -> SignalMap:
    """The map with the signals of the databases that have names of signals; its time is that of the frames.

    A SignalError if no column is mapped, or a database cannot be read.
    """
    complete = signal_map.completed(signal_columns(load(signal_map.databases)))
    if not complete.signals:
        raise SignalError(
            "signals.toml: no column is mapped to a signal; map columns such as VDC2.yaw_rate, which `fifthwheel "
            "signals` proposes from a recorded trace"
        )
    return complete.model_copy(update={"time": TimeColumn(rate=complete.rate)})


def make_observer(
    vehicle: Vehicle, signal_map: SignalMap, identification: Identification | None, min_speed: float, **settings: Any
) -> Observer:
    """The observer of a vehicle with the signals of a completed map; settings and errors of `exported_observer`."""
    every = Observer(vehicle, signal_map.signals)
    used = [name for name in signal_map.signals if name in (*every.inputs, *every.outputs)]
    observer = exported_observer(vehicle, used, identification, min_speed=min_speed, **settings)
    straight = dict.fromkeys(used, 0.0) | {"speed": 2 * min_speed}
    for time in (0.0, 0.01):  # compiles it now, and not while driving
        observer.push({"time": time, **straight})
    observer.reset()
    return observer
