"""fifthwheel live, app and selfcheck"""

import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from fifthwheel.apps.cli import common
from fifthwheel.apps.cli.app import Only, command, quantity_option
from fifthwheel.base.options import LiveOptions, ObserverOptions

if TYPE_CHECKING:
    from fifthwheel.apps.live.node import Output
    from fifthwheel.apps.live.session import Session


@command(
    "fifthwheel live --bus socketcan:can0 -s signals.toml -v truck.toml --page 8080",
    "fifthwheel live --bus socketcan:can0 -s signals.toml -v truck.toml --learn --state truck.json --trailer 'depot 1'",
    "fifthwheel live --bus socketcan:can0 -s signals.toml -v truck.toml --learn --coach --page 8080",
    "fifthwheel live --replay run.blf -s map.toml -v truck.toml --learn --coach --target semitrailer.yaw_inertia=5%",
    "fifthwheel live --bus virtual:truck -s signals.toml -v truck.toml -i fifthwheel-out --send 0x500 --dbc states.dbc",
    "fifthwheel live --replay log.blf --rate 0 -s signals.toml -v truck.toml --record states.parquet",
)
def live(
    vehicle: common.VehicleOption,
    signals: Annotated[
        Path, typer.Option("--signals", "-s", help="Signal map (signals.toml) with columns of CAN messages.")
    ],
    allow_outside: common.AllowOutsideOption = False,
    force: common.ForceFileOption = False,
    *,
    chosen: LiveOptions,
    observer: Annotated[ObserverOptions, Only(("min_speed", "friction", "half_track"))],
) -> None:
    """Estimate states, and with --learn parameters, while the truck drives: CAN frames in, 100 states per second out.

    The states go to a page, to a file and to the bus. Every output has a status: 0 ok, 1 coasting, 2 too slow, 3 input
    missing, 4 inconsistent, 8 degraded: a fault limits the quality of the states, 9 failed. Ctrl-C ends the run; the
    record is then complete and the estimates are saved. At the end a summary is printed.
    """
    from fifthwheel.base.lazy import require

    for package in ("can", "cantools"):  # the modules below import them
        require(package, "live")
    from fifthwheel.apps.live.setup import opened
    from fifthwheel.apps.live.summary import Summary
    from fifthwheel.base.pages.terminal import show

    stop = threading.Event()
    with _stopped_by_signals(stop), ExitStack() as stack:
        run = opened(
            vehicle,
            signals,
            chosen,
            observer,
            max_speed=quantity_option("--max-speed", chosen.max_speed, "m/s", "km/h"),
            allow_outside=allow_outside,
            force=force,
            stop=stop,
            say=lambda text: typer.echo(text, err=True),
        )
        session, states = stack.enter_context(run)
        line, summary = _StatusLine(session), Summary(session)
        session.views.append(summary)
        for output in states:
            session.handle(output)
            line.show(output)
        line.end()
        show(summary.document())


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
    """On a terminal one line that changes every second, otherwise a line for each new status but settling."""

    def __init__(self, session: "Session") -> None:
        self._session = session
        self._terminal = sys.stderr.isatty()
        self._next, self._last, self._change, self._advice = -1.0, "", "", ""

    def show(self, output: "Output") -> None:
        """Show an output, if it is time."""
        if output.time < self._next:
            return
        self._next = output.time + 1.0
        learning = self._session.learning
        if learning is not None and learning.change != self._change:
            self._change = learning.change
            self._print(self._change)
        coach = self._session.coach
        if coach is not None and coach.advice.text != self._advice:
            self._advice = coach.advice.text
            self._print(f"{output.time:.1f} s  {self._advice}")
        status = self._session.status_text(output)
        if self._terminal:
            print(
                f"\r\x1b[K{output.time:8.1f} s  {status}  {self._session.state_text(output)}", end="", file=sys.stderr
            )
        elif status != self._last and not (self._last and output.status.name == "SETTLING"):  # which lasts 0.1 s
            self._print(f"{output.time:.1f} s  {status}")
            self._last = status
        sys.stderr.flush()

    def _print(self, text: str) -> None:
        print(f"\r\x1b[K{text}" if self._terminal else text, file=sys.stderr)

    def end(self) -> None:
        """End the line."""
        if self._terminal:
            print(file=sys.stderr)


@command(
    "fifthwheel app",
    "fifthwheel app trial --port 8080 --no-browser",
    "fifthwheel app trial --host 0.0.0.0 --token 'a long password'",
)
def app(
    folder: Annotated[Path, typer.Argument(help="Folder of the workspace; made if it is missing.")] = Path("workspace"),
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port to listen at; 0 for a free one.")] = 8080,
    host: Annotated[str, typer.Option(help="Address to listen at; any other than this computer needs --token.")] = (
        "127.0.0.1"
    ),
    token: Annotated[
        str | None, typer.Option(help="Who opens the pages must know it.", envvar="FIFTHWHEEL_TOKEN")
    ] = None,
    max_file: Annotated[float, typer.Option(min=0.001, help="Largest dropped file, GB.")] = 8.0,
    browser: Annotated[bool, typer.Option("--browser/--no-browser", help="Open the first page.")] = True,
) -> None:
    """Open the workbench: pages in your browser from a log to the identified truck.

    Logs, signals.toml, vehicle.toml and results are files in the folder, the same as those of the other commands.
    Ctrl-C ends the server; nothing is lost.
    """
    from fifthwheel.apps.app.serve import serve

    serve(
        folder,
        host=host,
        port=port,
        token=token,
        max_file=round(max_file * 1e9),
        ready=lambda address: typer.echo(f"{address}\nCtrl-C ends the workbench."),
        browser=browser,
    )


@command("fifthwheel selfcheck", "fifthwheel selfcheck /var/lib/fifthwheel", "fifthwheel selfcheck --json")
def selfcheck(
    folder: Annotated[
        Path, typer.Argument(help="Folder that results are written to.", exists=True, file_okay=False)
    ] = Path(),
    as_json: common.JsonOption = False,
) -> None:
    """Check this installation: cache, machine code against stored states, disk and clock.

    `fifthwheel live` does the same when it starts. The exit code is 1 if a check fails.
    """
    from dataclasses import asdict

    from fifthwheel.apps.selfcheck import self_check

    checks = self_check(folder)
    if as_json:
        common.print_json(
            {"passed": all(check.passed for check in checks), "checks": [asdict(check) for check in checks]}
        )
    else:
        for check in checks:
            typer.echo(f"{'ok    ' if check.passed else 'FAILED'} {check.name}: {check.text}")
    if not all(check.passed for check in checks):
        raise typer.Exit(1)
