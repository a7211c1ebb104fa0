"""fifthwheel live"""

import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from datetime import datetime
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from fifthwheel.cli import options
from fifthwheel.cli.app import command

if TYPE_CHECKING:
    from fifthwheel.live.node import Output
    from fifthwheel.live.session import Session


class Tyres(StrEnum):
    """Law of the side forces that is learned."""

    linear = "linear"
    saturating = "saturating"


@command(
    "fifthwheel live --bus socketcan:can0 -s signals.toml -v truck.toml --page 8080",
    "fifthwheel live --bus socketcan:can0 -s signals.toml -v truck.toml --learn --state truck.json --trailer 'depot 1'",
    "fifthwheel live --bus virtual:truck -s signals.toml -v truck.toml -i fifthwheel-out --send 0x500 --dbc states.dbc",
    "fifthwheel live --replay log.blf --rate 0 -s signals.toml -v truck.toml --record states.parquet",
)
def live(
    vehicle: options.VehicleOption,
    signals: Annotated[
        Path, typer.Option("--signals", "-s", help="Signal map (signals.toml) with columns of CAN messages.")
    ],
    bus: Annotated[
        list[str] | None,
        typer.Option(
            "--bus",
            help="INTERFACE:CHANNEL of python-can: socketcan:can0, virtual:truck, udp_multicast:239.0.0.1, ... May be "
            "repeated; frames are sent on the first one.",
        ),
    ] = None,
    bitrate: Annotated[
        int | None, typer.Option(help="bit/s, for interfaces that set it; SocketCAN sets it outside.")
    ] = None,
    replay: Annotated[
        Path | None, typer.Option("--replay", help="Instead of a bus: a BLF, ASC, PCAN or candump trace.")
    ] = None,
    rate: Annotated[
        str, typer.Option("--rate", help="Speed of the replay: 1 is real time, 0 or max as fast as possible.")
    ] = "1",
    identification: Annotated[
        Path | None,
        typer.Option("--identification", "-i", help="Folder of an identification: sensor errors and noise."),
    ] = None,
    learn: Annotated[bool, typer.Option("--learn", help="Estimate the parameters too.")] = False,
    state: Annotated[
        Path | None, typer.Option(help="File of the learned estimates; read at the start, written every 5 s.")
    ] = None,
    trailer: Annotated[
        str | None, typer.Option(help="Name of the coupled trailer; each trailer has estimates of its own.")
    ] = None,
    trailer_signal: Annotated[
        str | None,
        typer.Option(help="Message.Signal whose number names the coupled trailer, and follows each change."),
    ] = None,
    lock: Annotated[
        list[str] | None,
        typer.Option(
            help="A parameter that is not learned: it keeps its estimate, or its given value. May be repeated."
        ),
    ] = None,
    tyres: Annotated[
        Tyres,
        typer.Option(help="Of --learn: linear, or saturating at the friction of the road, which is estimated too."),
    ] = Tyres.linear,
    send: Annotated[
        str | None,
        typer.Option(help="Send states as CAN frames from this id on, such as 0x500 or, with 29 bits, 0x18FF0080."),
    ] = None,
    send_rate: Annotated[float, typer.Option(min=1, max=100, help="Rate of the frames with states, Hz.")] = 100.0,
    dbc: Annotated[Path, typer.Option(help="DBC of the frames, written with --send.")] = Path("fifthwheel-live.dbc"),
    record: Annotated[
        Path | None,
        typer.Option(
            help="Record the states to a .parquet or .mcap file. The name may contain the time: %Y-%m-%d-%H%M%S."
        ),
    ] = None,
    page: Annotated[
        str | None,
        typer.Option(help="Port of the page, for this computer only, such as 8080; or HOST:PORT."),
    ] = None,
    min_speed: Annotated[float, typer.Option(min=0.5, help="Below this speed, m/s, there are no states.")] = 5.0,
    friction: options.FrictionOption = None,
    half_track: options.HalfTrackOption = options.HALF_TRACK,
    allow_outside: options.AllowOutsideOption = False,
    force: options.ForceFileOption = False,
) -> None:
    """Estimate states, and with --learn parameters, while the truck drives: CAN frames in, 100 states per second out.

    The states go to a page, to a file and to the bus. Every output has a status: 0 ok, 1 coasting, 2 too slow, 3 input
    missing, 4 inconsistent, 8 degraded: a fault limits the quality of the states, 9 failed. Ctrl-C ends the run; the
    record is then complete and the estimates are saved.
    """
    from fifthwheel.errors import FifthwheelError
    from fifthwheel.live.setup import Inputs, Outputs, opened

    speed = _speed(rate)
    if (replay is None) == (not bus):
        raise FifthwheelError("live: expected --bus or --replay; give one of them")
    if not learn and (state or trailer or trailer_signal or lock or tyres != Tyres.linear):
        raise FifthwheelError("--state, --trailer, --trailer-signal, --lock and --tyres are for --learn; add it")
    if learn and identification:
        raise FifthwheelError("--identification: is for runs without --learn; give its vehicle.toml as --vehicle")
    if learn and (friction is not None or half_track != options.HALF_TRACK):
        raise FifthwheelError("--friction and --half-track are for runs without --learn; omit them")
    stop = threading.Event()
    inputs = Inputs(
        vehicle=vehicle,
        signals=signals,
        identification=identification,
        buses=tuple(bus or ()),
        bitrate=bitrate,
        trace=replay,
        speed=speed,
        learn=learn,
        state=state,
        trailer=trailer,
        trailer_signal=trailer_signal,
        locks=tuple(lock or ()),
        tyres=tyres.value,
        min_speed=min_speed,
        friction=friction,
        half_track=half_track,
        allow_outside=allow_outside,
    )
    outputs = Outputs(
        send=_identifier(send),
        send_rate=send_rate,
        dbc=dbc,
        record=Path(datetime.now().strftime(str(record))) if record else None,
        page=page,
        force=force,
    )
    with _stopped_by_signals(stop), ExitStack() as stack:
        session, states = stack.enter_context(opened(inputs, outputs, stop, lambda text: typer.echo(text, err=True)))
        line = _StatusLine(session)
        for output in states:
            session.handle(output)
            line.show(output)
        line.end()


def _speed(rate: str) -> float:
    from fifthwheel.errors import FifthwheelError

    try:
        speed = 0.0 if rate == "max" else float(rate)
    except ValueError:
        speed = -1.0
    if not 0 <= speed < 1e6:
        raise FifthwheelError(f"--rate {rate}: expected recorded seconds in one second, such as 1 or 10, 0 or max")
    return speed


def _identifier(text: str | None) -> int | None:
    from fifthwheel.errors import FifthwheelError

    try:
        return None if text is None else int(text, 0)
    except ValueError:
        raise FifthwheelError(f"--send {text}: expected the id of a CAN frame, such as 0x500") from None


@contextmanager
def _stopped_by_signals(stop: threading.Event) -> Iterator[None]:
    """The first Ctrl-C or SIGTERM ends the run cleanly, the second one at once."""

    previous: dict[int, Any] = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}

    def end(number: int, _: object) -> None:
        stop.set()
        signal.signal(number, previous[number])

    for number in previous:
        signal.signal(number, end)
    try:
        yield
    finally:
        for number, handler in previous.items():
            signal.signal(number, handler)


class _StatusLine:
    """On a terminal one line that changes every second, otherwise a line for each new status."""

    def __init__(self, session: "Session") -> None:
        self._session = session
        self._terminal = sys.stderr.isatty()
        self._next, self._last, self._change = -1.0, "", ""

    def show(self, output: "Output") -> None:
        """Show an output, if it is time."""
        if output.time < self._next:
            return
        self._next = output.time + 1.0
        learning = self._session.learning
        if learning is not None and learning.change != self._change:
            self._change = learning.change
            self._print(self._change)
        status = self._session.status_text(output)
        if self._terminal:
            print(
                f"\r\x1b[K{output.time:8.1f} s  {status}  {self._session.state_text(output)}", end="", file=sys.stderr
            )
        elif status != self._last:
            self._print(f"{output.time:.1f} s  {status}")
        sys.stderr.flush()
        self._last = status

    def _print(self, text: str) -> None:
        print(f"\r\x1b[K{text}" if self._terminal else text, file=sys.stderr)

    def end(self) -> None:
        """End the line."""
        if self._terminal:
            print(file=sys.stderr)
