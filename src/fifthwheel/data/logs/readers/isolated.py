"""Reading in a child process: a file that crashes or blocks a library costs an error, not the program.

The child (child.py) runs the reader of the format and sends columns and samples over a pipe.
"""

import atexit
import contextlib
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
import weakref
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from fifthwheel.base.errors import SignalError
from fifthwheel.base.types import Array
from fifthwheel.data.logs.readers.child import (
    CURE,
    MEMORY,
    SAMPLES,
    SECONDS,
    FileLimits,
    TooMuchError,
    limit,
    receive,
    send,
)
from fifthwheel.data.logs.source import Chunk, Column, LogSource, ReadProgress

_IDLE_CHILDREN = 2
_SIGNALS = {int(number): number.name for number in signal.Signals}
_START = "from fifthwheel.data.logs.readers.child import run_child; run_child()"
_ENVIRONMENT = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "NUMEXPR_NUM_THREADS"), "1") | {
    "HDF5_PLUGIN_PRELOAD": "::",  # HDF5 loads no code
    "ARROW_DEFAULT_MEMORY_POOL": "system",  # others reserve 1 GB, which counts as memory
    "JE_ARROW_MALLOC_CONF": "background_thread:false",  # a process with one thread is safe to fork
}


def start_reader() -> None:
    """Start a child process for the next file, unless one waits for it already.

    It imports its libraries while the caller does other things.
    """
    child = _waiting_child()
    with _lock:
        _idle.append(child)


def open_isolated(
    path: Path,
    module: str,
    format_name: str,
    databases: Sequence[str | Path],
    progress: ReadProgress,
    notes: Sequence[str] = (),
    *,
    sample: bool = False,
) -> LogSource:
    """Open a log in a child process by the module that reads its format; `notes` come before those of the reader.

    A SignalError if the reader refuses the file, crashes, makes no progress within the time limit or needs more memory
    than the limit, or if its library is not installed.
    """
    limits = FileLimits.of_file(path.stat().st_size)
    child = _waiting_child()
    child.name, child.format_name, child.ended = path.name, format_name, False
    child.limits, child.folder = limits, tempfile.mkdtemp(prefix="fifthwheel-")
    request = {
        "path": str(path.absolute()),
        "name": path.name,
        "module": module,
        "format": format_name,
        "notes": [*notes],
        "sample": sample,
        "limits": asdict(limits),
        "folder": child.folder,
        "databases": [str(Path(database).absolute()) for database in databases],
    }
    try:
        child.send(request)
        while "columns" not in (head := child.receive()[0]):
            progress(head["done"])
    except BaseException:
        child.end()
        raise
    child.busy = False
    return IsolatedLog(child, head)


class IsolatedLog(LogSource):
    """A log that a child process reads."""

    def __init__(self, child: "_Child", head: Mapping[str, Any]) -> None:
        super().__init__(child.name, {column["name"]: Column(**column) for column in head["columns"]})
        self.notes, self.sampled, self.start = head["notes"], head["sampled"], head["start"]
        self._child = child
        self._readings = 0
        self._finalizer = weakref.finalize(self, child.end)

    def chunks(self, columns: Collection[str]) -> Iterator[Chunk]:
        """The samples of some columns; a second reading ends the first."""
        wanted = [name for names in self.by_clock(columns).values() for name in names]
        if self._child.ended or not self._finalizer.alive:
            raise SignalError(f"{self.name}: closed, or its reading has failed; open it again")
        self._readings += 1
        number = self._readings
        self._child.send({"chunks": wanted, "number": number})
        while number == self._readings:
            head, samples = self._child.receive()
            if head.get("number") != number:
                continue  # of a reading that was not finished
            if "names" not in head:
                self._child.busy = False
                self.notes[:], self.unusable = head["notes"], head["unusable"]
                return
            names = head["names"]
            values = dict(zip(names, samples.reshape(len(names), -1) if names else (), strict=True))
            yield Chunk(values=values, time=values.pop(None, None), clock=head["clock"], done=head["done"])
        raise SignalError(f"{self.name}: closed or read again before this reading was finished")

    def close(self) -> None:
        self._readings += 1
        self._finalizer()


@dataclass(eq=False)
class _Child:
    """A child process and the file that it reads."""

    process: subprocess.Popen[bytes]
    requests: int
    """File descriptor to write to."""
    replies: int
    """File descriptor to read from."""
    owner: int = field(default_factory=os.getpid)
    """Process that has started it; a fork of that one leaves it alone."""
    name: str = ""
    format_name: str = ""
    limits: FileLimits = field(init=False)
    """Those of the file."""
    waited: float = 0.0
    """Time in which this process has waited for replies to the request, s."""
    received: int = 0
    """Bytes of samples in them."""
    folder: str = ""
    """For temporary files of the libraries."""
    expired: bool = False
    busy: bool = False
    """Whether replies are still to come."""
    ended: bool = False
    """Whether the reading of this file has failed."""

    def send(self, head: Mapping[str, Any]) -> None:
        """Send a request; a child that has died is reported by receive()."""
        self.busy, self.waited, self.received = True, 0.0, 0
        with contextlib.suppress(BrokenPipeError):
            send(self.requests, head)

    def receive(self) -> tuple[dict[str, Any], Array]:
        """The next reply and its samples; SignalError for an error, and where the child crashes or exceeds a limit."""
        timer = threading.Timer(min(self.limits.seconds, self.limits.total_seconds - self.waited), self._expire)
        timer.daemon = True
        start = time.monotonic()
        timer.start()
        try:
            head, samples = receive(self.replies, self.limits.samples - self.received)
        except BaseException as error:
            self.ended = True
            self.kill()
            if isinstance(error, TooMuchError):
                needs = f"{self.name}: its samples need more than {self.limits.samples / 1e6:.0f} MB"
                cure = f"map fewer columns, or set {SAMPLES} to more than {limit(SAMPLES):g} if the file is intact"
                raise SignalError(f"{needs}; {cure}") from None
            if not isinstance(error, EOFError | ValueError):
                raise
            raise SignalError(f"{self.name}: reading as {self.format_name} {self._end()}") from None
        finally:
            timer.cancel()
            self.waited += time.monotonic() - start
        self.received += samples.nbytes
        if "error" in head:
            self.busy, self.ended = False, True
            raise SignalError(head["error"])
        return head, samples

    def end(self) -> None:
        """Let go of the file, and keep the process for another one if it has finished."""
        if os.getpid() != self.owner:
            return
        shutil.rmtree(self.folder, ignore_errors=True)
        if self.busy or self.process.poll() is not None:
            self.kill()
            return
        self.send({"close": True})
        with _lock:
            _idle.append(self)
            surplus = _idle.pop(0) if len(_idle) > _IDLE_CHILDREN else None
        if surplus is not None:
            surplus.kill()

    def kill(self) -> None:
        """End the process with all that it has started."""
        with self.process:  # closes the pipes, and waits
            if self.process.poll() is None:
                self._signal()

    def _expire(self) -> None:
        self.expired = True
        self._signal()

    def _signal(self) -> None:
        with contextlib.suppress(ProcessLookupError):
            if os.name == "posix":
                os.killpg(self.process.pid, signal.SIGKILL)
            else:
                self.process.kill()

    def _end(self) -> str:
        """How the process has ended, and what to do."""
        if self.expired:
            late = f"{self.limits.seconds:.0f} s without progress"
            if self.waited + self.limits.seconds > self.limits.total_seconds:
                late = f"{self.limits.total_seconds:.0f} s"
            return (
                f"was stopped after {late}. The file is probably damaged: {CURE}. If it is intact, set {SECONDS} to "
                f"more than {limit(SECONDS):g}"
            )
        code = self.process.returncode
        cause = _SIGNALS.get(-code if code < 0 else code - 128, f"exit code {code}")
        return (
            f"crashed ({cause}). The file is probably damaged: {CURE}. If it is intact, reading may need more "
            f"memory: set {MEMORY} to more than {limit(MEMORY):g}"
        )


_idle: list[_Child] = []
_lock = threading.Lock()


def _waiting_child() -> _Child:
    """A child that waits for a file, else a new one."""
    with _lock:
        while _idle:
            child = _idle.pop()
            if child.process.poll() is None:
                return child
    process = subprocess.Popen(
        [sys.executable, "-P", "-W", "ignore", "-c", _START],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        bufsize=0,
        env=os.environ | _ENVIRONMENT | {"PYTHONPATH": os.pathsep.join(map(os.path.abspath, sys.path))},
        start_new_session=True,  # Ctrl-C reaches the parent only, which ends the child
    )
    assert process.stdin is not None
    assert process.stdout is not None
    return _Child(process, process.stdin.fileno(), process.stdout.fileno())


@atexit.register
def _end_idle_children() -> None:
    while _idle:
        _idle.pop().kill()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_idle.clear)  # they belong to the parent
