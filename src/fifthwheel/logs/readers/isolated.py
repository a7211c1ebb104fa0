"""Reading in a child process: a file that crashes or blocks a library costs an error, not the program.

The child runs the reader of the format and sends columns and samples over a pipe: a JSON head and an Arrow IPC stream
each. On Linux every file is read in a fork of the child, so the libraries are imported once for many files.
"""

import atexit
import contextlib
import faulthandler
import gc
import importlib
import json
import os
import queue
import shutil
import signal
import struct
import subprocess
import sys
import tempfile
import threading
import time
import weakref
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from fifthwheel.errors import SignalError
from fifthwheel.logs.source import Chunk, Column, LogSource, ReadProgress, reason

SECONDS = "FIFTHWHEEL_READER_SECONDS"
"""Environment variable: time without progress after which reading stops, s."""
MEMORY = "FIFTHWHEEL_READER_MEMORY"
"""Environment variable: memory of the reading process, MB; enforced on Linux."""
_DEFAULTS = {SECONDS: 60.0, MEMORY: 4000.0}
_BYTES_PER_SECOND = 1e6
"""The time limit grows with the file: a library may read all of it before it answers."""
_CURE = "copy it again from the logger, or save it again in the tool that wrote it"
_FORK = sys.platform == "linux"
_IDLE_CHILDREN = 2
_PROGRESS_INTERVAL = 0.1
_SIGNALS = {int(number): number.name for number in signal.Signals}
_HEAD = struct.Struct("<IQ")
_START = "from fifthwheel.logs.readers.isolated import run_child; run_child()"
_ENVIRONMENT = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "NUMEXPR_NUM_THREADS"), "1") | {
    "HDF5_PLUGIN_PRELOAD": "::",  # HDF5 loads no code
    "JE_ARROW_MALLOC_CONF": "background_thread:false",  # a process with one thread is safe to fork
}


def open_isolated(
    path: Path, module: str, format_name: str, databases: Sequence[str | Path], progress: ReadProgress
) -> LogSource:
    """Open a log in a child process.

    Args:
        path: the file.
        module: name of the module of this package that reads the format.
        format_name: for messages.
        databases: as for open_log.
        progress: receives the fraction read.

    Raises:
        SignalError: the reader refuses the file, crashes, makes no progress within the time limit or needs more memory
            than the limit, or its library is not installed.
    """
    seconds, memory = _limit(SECONDS) + path.stat().st_size / _BYTES_PER_SECOND, _limit(MEMORY)
    child = _idle_child() or _started_child()
    child.name, child.format_name, child.seconds, child.ended = path.name, format_name, seconds, False
    child.folder = tempfile.mkdtemp(prefix="fifthwheel-")
    request = {"path": str(path.absolute()), "name": path.name, "module": module, "format": format_name}
    files = [str(Path(database).absolute()) for database in databases]
    limits = {"seconds": seconds, "memory": memory, "folder": child.folder}
    try:
        child.send(request | limits | {"databases": files})
        while "columns" not in (head := child.receive()[0]):
            progress(head["done"])
    except BaseException:
        child.end()
        raise
    child.busy = False
    return IsolatedLog(path.name, child, [Column(**column) for column in head["columns"]], head["notes"])


class IsolatedLog(LogSource):
    """A log that a child process reads."""

    def __init__(self, name: str, child: "_Child", columns: Sequence[Column], notes: Sequence[str]) -> None:
        super().__init__(name)
        self._child = child
        self._columns = {column.name: column for column in columns}
        self._readings = 0
        self._finalizer = weakref.finalize(self, child.end)
        self.notes += notes

    @property
    def columns(self) -> Mapping[str, Column]:
        return self._columns

    def pieces(self, columns: Collection[str]) -> Iterator[Chunk]:
        """The samples of some columns; a second reading ends the first."""
        wanted = [name for names in self.by_clock(columns).values() for name in names]
        if self._child.ended or not self._finalizer.alive:
            raise SignalError(f"{self.name}: closed, or its reading has failed; open it again")
        self._readings += 1
        number = self._readings
        self._child.send({"pieces": wanted, "number": number})
        while number == self._readings:
            head, batch = self._child.receive()
            if head.get("number") != number:
                continue  # of a reading that was not finished
            if batch is None:
                self._child.busy = False
                self.notes[:], self.unusable = head["notes"], head["unusable"]
                return
            values = dict(zip(head["names"], map(np.array, batch.columns), strict=True))
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
    owner: int
    """Process that has started it; a fork of that one leaves it alone."""
    name: str = ""
    format_name: str = ""
    seconds: float = 0.0
    """Time limit for one reply."""
    folder: str = ""
    """For temporary files of the libraries."""
    expired: bool = False
    busy: bool = False
    """Whether replies are still to come."""
    ended: bool = False
    """Whether the reading of this file has failed."""

    def send(self, head: Mapping[str, Any]) -> None:
        """Send a request; a child that has died is reported by receive()."""
        self.busy = True
        with contextlib.suppress(BrokenPipeError):
            _send(self.requests, head)

    def receive(self) -> tuple[dict[str, Any], pa.RecordBatch | None]:
        """The next reply; SignalError where it is an error, and where the child has crashed or exceeds a limit."""
        timer = threading.Timer(self.seconds, self._expire)
        timer.daemon = True
        timer.start()
        try:
            head, batch = _receive(self.replies)
        except BaseException as error:
            self.ended = True
            self.kill()
            if not isinstance(error, EOFError | ValueError | pa.ArrowException):
                raise
            raise SignalError(f"{self.name}: reading as {self.format_name} {self._end()}") from None
        finally:
            timer.cancel()
        if "error" in head:
            self.busy, self.ended = False, True
            raise SignalError(head["error"])
        return head, batch

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
        if self.process.poll() is None:
            self._signal()
        self.process.wait()
        for pipe in (self.process.stdin, self.process.stdout):
            if pipe is not None:
                pipe.close()

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
            return (
                f"was stopped after {self.seconds:.0f} s without progress. The file is probably damaged: {_CURE}. If "
                "it is "
                f"intact, set {SECONDS} to more than {_limit(SECONDS):g}"
            )
        code = self.process.returncode
        cause = _SIGNALS.get(-code if code < 0 else code - 128, f"exit code {code}")
        return (
            f"crashed ({cause}). The file is probably damaged: {_CURE}. If it is intact, reading may need more "
            "memory: set "
            f"{MEMORY} to more than {_limit(MEMORY):g}"
        )


_idle: list[_Child] = []
_lock = threading.Lock()


def _idle_child() -> _Child | None:
    with _lock:
        while _idle:
            child = _idle.pop()
            if child.process.poll() is None:
                return child
    return None


def _started_child() -> _Child:
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
    return _Child(process, process.stdin.fileno(), process.stdout.fileno(), os.getpid())


@atexit.register
def _end_idle_children() -> None:
    while _idle:
        _idle.pop().kill()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_idle.clear)  # they belong to the parent


def _limit(name: str) -> float:
    text = os.environ.get(name, "")
    try:
        value = float(text or _DEFAULTS[name])
    except ValueError:
        value = 0.0
    if not 0 < value < np.inf:
        raise SignalError(f"{name} is {text!r}, a positive number expected, such as {_DEFAULTS[name]:g}")
    return value


def _send(pipe: int, head: Mapping[str, Any], batch: pa.RecordBatch | None = None) -> None:
    faulthandler.cancel_dump_traceback_later()  # the other side may take its time
    text, sink = json.dumps(head).encode(), pa.BufferOutputStream()
    if batch is not None:
        with pa.ipc.new_stream(sink, batch.schema) as writer:
            writer.write_batch(batch)
    body = sink.getvalue()
    for part in (_HEAD.pack(len(text), body.size) + text, body):
        rest = memoryview(part)
        while rest:
            rest = rest[os.write(pipe, rest) :]


def _receive(pipe: int) -> tuple[dict[str, Any], pa.RecordBatch | None]:
    """The next message; EOFError where the other process has ended."""
    text, body = _HEAD.unpack(_read(pipe, _HEAD.size))
    head = json.loads(_read(pipe, text))
    return head, pa.ipc.open_stream(_read(pipe, body)).read_next_batch() if body else None


def _read(pipe: int, size: int) -> bytearray:
    data = bytearray()
    while len(data) < size:
        part = os.read(pipe, min(size - len(data), 1 << 20))
        if not part:
            raise EOFError
        data += part
    return data


def run_child() -> None:
    """Serve the parent until it closes the pipe: the main function of the child process."""
    requests, replies, null = os.dup(0), os.dup(1), os.open(os.devnull, os.O_RDWR)
    os.dup2(null, 0)
    os.dup2(null, 1)  # what libraries print is no message
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    gc.set_threshold(100_000)  # a library that makes an object for each frame makes no cycles
    with contextlib.suppress(EOFError, BrokenPipeError):
        while True:
            request = _receive(requests)[0]
            with contextlib.suppress(ImportError):  # reported by _serve
                importlib.import_module(request["module"])
            if not _FORK:
                _serve(request, requests, replies)
            elif not (fork := os.fork()):
                _serve(request, requests, replies)
                os._exit(0)
            elif code := os.waitstatus_to_exitcode(os.waitpid(fork, 0)[1]):
                os._exit(code if code > 0 else 128 - code)


def _serve(request: Mapping[str, Any], requests: int, replies: int) -> None:
    """Read one file as the parent asks, until it closes the log."""
    name, kind, memory = request["name"], request["format"], request["memory"]
    incoming: queue.SimpleQueue[dict[str, Any]] = queue.SimpleQueue()
    threading.Thread(target=_listen, args=(requests, incoming, request["folder"]), daemon=True).start()
    tempfile.tempdir = request["folder"]
    if _FORK:
        _restrict(memory)
    try:
        _read_log(request, incoming, replies)
    except SignalError as error:
        text = str(error)
    except ImportError as error:
        text = f"{name}: in the format {kind}, and {error.name} is not installed; pip install 'fifthwheel[logs]'"
    except MemoryError:
        needs = f"{name}: reading it as {kind} needs more than {memory:g} MB"
        text = f"{needs}; if it is intact, set {MEMORY} to more, else {_CURE}"
    except Exception as error:
        text = f"{name}: cannot be read as {kind} ({type(error).__name__}: {reason(error)}); {_CURE}"
    else:
        return
    _send(replies, {"error": text})
    while "close" not in incoming.get():
        pass


def _read_log(request: Mapping[str, Any], incoming: "queue.SimpleQueue[Any]", replies: int) -> None:
    """Open the log and send the samples that the parent asks for, until it closes the log."""
    seconds, sent = request["seconds"], time.monotonic()

    def progress(done: float) -> None:
        nonlocal sent
        if done >= 1.0 or time.monotonic() > sent + _PROGRESS_INTERVAL:
            sent = time.monotonic()
            _send(replies, {"done": done})
            _arm(seconds)

    module = importlib.import_module(request["module"])
    _arm(seconds)
    log: LogSource = module.open_log(Path(request["path"]), request["databases"], progress)
    _send(replies, {"columns": [asdict(column) for column in log.columns.values()], "notes": log.notes})
    while "close" not in (asked := incoming.get()):
        head, pieces = {"number": asked["number"]}, log.pieces(asked["pieces"])
        _arm(seconds)
        for piece in pieces:
            if not incoming.empty():
                break
            arrays = dict(piece.values) | ({} if piece.time is None else {None: piece.time})
            batch = pa.RecordBatch.from_arrays(list(map(pa.array, arrays.values())), list(map(str, range(len(arrays)))))
            _send(replies, head | {"names": list(arrays), "clock": piece.clock, "done": piece.done}, batch)
            _arm(seconds)
        _send(replies, head | {"notes": log.notes, "unusable": log.unusable})
    if not _FORK:  # a fork ends now
        log.close()


def _arm(seconds: float) -> None:
    """End this process after twice the time limit, whatever blocks it: the parent that should do so may have died."""
    faulthandler.dump_traceback_later(2 * seconds, exit=True)


def _listen(requests: int, incoming: "queue.SimpleQueue[Any]", folder: str) -> None:
    """Pass on the requests for this file; end the process when the parent has died."""
    try:
        while True:
            incoming.put(request := _receive(requests)[0])
            if "close" in request:
                return
    except EOFError:
        shutil.rmtree(folder, ignore_errors=True)
        os._exit(0)


def _restrict(memory: float) -> None:
    """Limit the memory of this process, MB; write no core file."""
    import resource

    resource.setrlimit(resource.RLIMIT_DATA, (int(memory * 1e6),) * 2)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
