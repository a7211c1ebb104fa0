"""A live run from what a user requests: files, buses, outputs; a node from vehicle, signal map and estimator."""

import hashlib
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from datetime import datetime
from itertools import takewhile
from pathlib import Path
from typing import Any

from fifthwheel.apps.cluster import process_pool
from fifthwheel.apps.live.checkpoint import Checkpoint, make_learning
from fifthwheel.apps.live.coach import Coach
from fifthwheel.apps.live.learning import Learning
from fifthwheel.apps.live.node import LiveEstimator, Node, Output
from fifthwheel.apps.live.outputs.frames_out import FrameEncoder
from fifthwheel.apps.live.outputs.journal import Journal
from fifthwheel.apps.live.outputs.recorder import MESSAGES, BackgroundWriter, Recorder
from fifthwheel.apps.live.session import Session
from fifthwheel.apps.live.sources.bus import LiveBus, frame_queue
from fifthwheel.apps.live.sources.feed import listen, read_trace, replay
from fifthwheel.apps.selfcheck import MACHINE_CODE, self_check
from fifthwheel.apps.workflow.inputs import read_vehicle, vehicle_and_identification
from fifthwheel.apps.workflow.runs import exported_observer
from fifthwheel.apps.workflow.start import targets_of
from fifthwheel.base.atomic import reserved
from fifthwheel.base.errors import FifthwheelError, SignalError
from fifthwheel.base.options import LiveOptions, ObserverOptions
from fifthwheel.data.logs import LiveMap, SignalMap
from fifthwheel.data.logs.can.database import FrameDecoder, load, signal_columns
from fifthwheel.data.logs.signal_map import TimeColumn
from fifthwheel.estimate.identify import Identification
from fifthwheel.estimate.identify.knowledge.knowledge import Knowledge
from fifthwheel.estimate.observe import Observer
from fifthwheel.truck import Vehicle


@contextmanager
def opened(
    vehicle: str,
    signals: Path,
    chosen: LiveOptions,
    observer: ObserverOptions,
    *,
    max_speed: float = 88 / 3.6,
    allow_outside: bool = False,
    force: bool = False,
    stop: threading.Event,
    say: Callable[[str], object],
) -> Iterator[tuple[Session, Iterator[Output]]]:
    """A session and the outputs for it, until `stop` is set or the trace ends; then everything is closed.

    `max_speed` is that of the manoeuvres of a coach, m/s.
    `say` receives sentences for the user. A FifthwheelError if options contradict each other, an input cannot be
    used, or an output cannot be written.
    """
    _require_consistent(chosen, observer)
    speed = _speed(chosen.rate)
    if not chosen.learn:
        vehicle, identification = vehicle_and_identification(vehicle, chosen.identification)
        chosen = replace(chosen, identification=identification)
    truck, signal_map = read_vehicle(vehicle), SignalMap.load(signals, allow_outside=allow_outside)
    if chosen.replay is not None and not chosen.replay.is_file():
        raise FifthwheelError(f"{chosen.replay}: no such file; check the path")
    if not chosen.learn and signal_map.sensors:
        say(f"What is stated of the sensors of {', '.join(signal_map.sensors)} is used with --learn only.")
    _require_working(chosen, say)
    now = datetime.now()
    recorded, messages = (Path(now.strftime(str(p))) if p else None for p in (chosen.record, chosen.mcap))
    with reserved(recorded, messages, force=force), reserved(chosen.state, force=True), ExitStack() as stack:
        session = _session(chosen, observer, truck, signal_map, recorded, messages, say)
        if chosen.coach and session.learning is not None:
            pool = None if chosen.replay else stack.enter_context(process_pool(1))
            targets = targets_of(chosen.target)
            session.coach = Coach(session.learning, targets, max_speed=max_speed, pool=pool)
        stack.callback(_report, session, say)
        stack.callback(session.close)
        if recorded:
            about = {
                "vehicle": truck.name,
                "vehicle_sha256": hashlib.sha256(truck.to_toml().encode()).hexdigest(),
                "signals": {name: list(source.columns) for name, source in signal_map.signals.items()},
                "learns": chosen.learn,
                "source": [str(chosen.replay)] if chosen.replay else list(chosen.bus),
            }
            session.views.append(Journal(recorded.with_name(f"{recorded.name}.events.jsonl"), session, about))
        if chosen.replay is not None:
            notes: list[str] = []
            stack.callback(lambda: [say(note) for note in notes])
            frames = takewhile(lambda _: not stop.is_set(), read_trace(chosen.replay, notes))
            outputs = replay(session.node, frames, speed=speed, sleep=stop.wait)
        else:
            arrivals, options = frame_queue(), {"bitrate": chosen.bitrate} if chosen.bitrate else {}
            filters = session.node.decoder.filters()
            buses = [LiveBus(name, k, filters, arrivals, options) for k, name in enumerate(chosen.bus)]
            for k, bus in enumerate(buses):
                if bus.number in (other.number for other in buses[:k]):
                    bus.number = max(other.number for other in buses) + 1
                stack.callback(bus.close)
                bus.start()
            session.bus = buses[0]
            outputs = listen(session.node, buses, arrivals, stop.is_set)
        if chosen.page is not None:
            from fifthwheel.apps.live.page.server import Page

            page = Page(chosen.page, truck, session)
            session.views.append(page)
            say(f"Page: {page.address}")
        yield session, outputs


def _require_consistent(chosen: LiveOptions, observer: ObserverOptions) -> None:
    if (chosen.replay is None) == (not chosen.bus):
        raise FifthwheelError("live: expected --bus or --replay; give one of them")
    of_learning = (chosen.state, chosen.trailer, chosen.knowledge, chosen.trailer_signal, chosen.lock)
    if not chosen.learn and (any(of_learning) or chosen.tyres != "linear"):
        names = "--state, --trailer, --knowledge, --trailer-signal, --lock and --tyres"
        raise FifthwheelError(f"{names} are for --learn; add it")
    if chosen.coach and not chosen.learn:
        raise FifthwheelError("--coach: is for --learn; add it")
    if chosen.target and not chosen.coach:
        raise FifthwheelError("--target: is for --coach; add it")
    if chosen.learn and chosen.identification:
        raise FifthwheelError("--identification: is for runs without --learn; give its vehicle.toml as --vehicle")
    if chosen.learn and observer != ObserverOptions(min_speed=observer.min_speed):
        raise FifthwheelError("--friction and --half-track are for runs without --learn; omit them")


def _require_working(chosen: LiveOptions, say: Callable[[str], object]) -> None:
    """Say which self-checks fail; a FifthwheelError if the states would be wrong."""
    for check in self_check(chosen.record.parent if chosen.record and chosen.record.parent.is_dir() else Path()):
        if not check.passed and check.name == MACHINE_CODE:
            raise FifthwheelError(f"selfcheck, {check.name}: {check.text}")
        if not check.passed:
            say(f"selfcheck, {check.name}: {check.text}")


def _speed(rate: str) -> float:
    try:
        speed = 0.0 if rate == "max" else float(rate)
    except ValueError:
        speed = -1.0
    if not 0 <= speed < 1e6:
        raise FifthwheelError(f"--rate {rate}: expected recorded seconds in one second, such as 1 or 10, 0 or max")
    return speed


def _identifier(text: str | None) -> int | None:
    try:
        return None if text is None else int(text, 0)
    except ValueError:
        raise FifthwheelError(f"--send {text}: expected the id of a CAN frame, such as 0x500") from None


def _session(
    chosen: LiveOptions,
    observer: ObserverOptions,
    vehicle: Vehicle,
    signal_map: SignalMap,
    recorded: Path | None,
    messages: Path | None,
    say: Callable[[str], object],
) -> Session:
    node, learning, states = _node(chosen, observer, vehicle, signal_map)
    encoder = None
    if (first := _identifier(chosen.send)) is not None:
        encoder = FrameEncoder(first, states, [e.name for e in learning.parameters] if learning else [])
        if taken := node.decoder.own(encoder.ids, extended=encoder.extended):
            raise FifthwheelError(f"--send: {taken:#x} is the id of a mapped message; give another id")
        encoder.write_dbc(chosen.dbc)
        say(f"Written: {chosen.dbc}")
    writer = BackgroundWriter()
    return Session(
        node=node,
        writer=writer,
        learning=learning,
        checkpoint=Checkpoint(learning, chosen.state, writer) if learning and chosen.state else None,
        recorder=Recorder(recorded, writer) if recorded else None,
        messages=Recorder(messages, writer, MESSAGES) if messages else None,
        encoder=encoder,
        send_period=1 / chosen.send_rate,
        trailer_column=next(iter(node.extra_columns), ""),
    )


def _node(
    chosen: LiveOptions, observer: ObserverOptions, vehicle: Vehicle, signal_map: SignalMap
) -> tuple[Node, Learning | None, tuple[str, ...]]:
    """The node, its learner, and the names of its states."""
    complete = completed_map(signal_map)
    extra = (chosen.trailer_signal,) if chosen.trailer_signal else ()
    if chosen.learn:
        learning = make_learning(
            vehicle,
            complete.signals,
            path=chosen.state,
            trailer=chosen.trailer,
            knowledge=Knowledge.load(chosen.knowledge) if chosen.knowledge else None,
            locks=chosen.lock,
            tyres=chosen.tyres,
            sensors=complete.sensors,
        )
        return make_node(complete, learning, extra=extra), learning, learning.learner.reported
    identification = Identification.load(chosen.identification) if chosen.identification else None
    surroundings = {"friction": observer.friction, "half_track": observer.half_track}
    estimator = make_observer(vehicle, complete, identification, observer.min_speed, **surroundings)
    return make_node(complete, estimator, extra=extra), None, estimator.reported


def _report(session: Session, say: Callable[[str], object]) -> None:
    """Which files were written, and columns with several senders; a FifthwheelError if one is not complete."""
    for column, others in session.node.decoder.other_sources.items():
        say(f"{column}: also sent by {', '.join(others)}, which is ignored; name the source in signals.toml")
    for recorder in filter(None, (session.recorder, session.messages)):
        if recorder.path.exists():
            say(f"Written: {recorder.path}")
    if session.writer.errors:
        raise FifthwheelError("\n".join(session.writer.errors.values()))


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
    used = [name for name in signal_map.signals if name in every.signals]
    options = ObserverOptions(min_speed=min_speed, **settings)
    observer = exported_observer(vehicle, used, identification, options)
    straight = dict.fromkeys(used, 0.0) | {"speed": 2 * min_speed}
    for time in (0.0, 0.01):  # compiles it now, and not while driving
        observer.push({"time": time, **straight})
    observer.reset()
    return observer
