"""The child process that reads logs for a program, within limits: it runs the reader of the format.

On Linux every file is read in a fork of the child, so the libraries are imported once for many files. Parent and child
exchange messages: a JSON head and columns of float64.
"""

import contextlib
import faulthandler
import gc
import importlib
import json
import math
import os
import queue
import shutil
import signal
import struct
import sys
import tempfile
import threading
import time
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from importlib.abc import MetaPathFinder
from pathlib import Path
from typing import Any, Self

import numpy as np

from fifthwheel.base.errors import SignalError
from fifthwheel.base.types import Array
from fifthwheel.data.logs.source import Column, LogSource, reason

SECONDS = "FIFTHWHEEL_READER_SECONDS"
"""Environment variable: time without progress after which reading stops, s."""
MEMORY = "FIFTHWHEEL_READER_MEMORY"
"""Environment variable: memory of the reading process, MB; enforced on Linux."""
SAMPLES = "FIFTHWHEEL_READER_SAMPLES"
"""Environment variable: samples of one reading, MB at 8 bytes each."""
DEFAULTS = {SECONDS: 60.0, MEMORY: 4000.0, SAMPLES: 1000.0}
MAX_COLUMNS = 100_000
"""Columns of a log; more are refused."""
MAX_NAME = 1000
"""Characters of a name or a description; a column with a longer name is left out, a description is cut."""
_BYTES_PER_SECOND = 1e6
"""The time limit grows with the file: a library may read all of it before it answers."""
_TOTAL = 10
"""Time limit for a whole reading as a multiple of that without progress."""
_TOTAL_BYTES_PER_SECOND = 5e4
"""The former grows with the file too."""
_EXPANSION = 50
"""Bytes by which the limit of samples grows for each byte of the file."""
_HEAD = struct.Struct("<IQ")
CURE = "copy it again from the logger, or save it again in the tool that wrote it"
"""What to do about a file that cannot be read."""
_FORK = sys.platform == "linux"
_PROGRESS_INTERVAL = 0.1


@dataclass(frozen=True, kw_only=True)
class FileLimits:
    """Limits for one file."""

    seconds: float
    """Without progress, s."""
    total_seconds: float
    """For one reading, without the time that the program itself takes, s."""
    memory: float
    """Of the reading process, MB."""
    samples: float
    """Of one reading, bytes."""
    written: float
    """Size of each temporary file, bytes."""

    @classmethod
    def of_file(cls, size: int) -> Self:
        """Limits for a file of this size in bytes; SignalError for an environment variable that is no number."""
        return cls(
            seconds=limit(SECONDS) + size / _BYTES_PER_SECOND,
            total_seconds=_TOTAL * limit(SECONDS) + size / _TOTAL_BYTES_PER_SECOND,
            memory=limit(MEMORY),
            samples=1e6 * limit(SAMPLES) + _EXPANSION * size,
            written=1e6 * limit(MEMORY) + size,
        )


def limit(name: str) -> float:
    """The value of an environment variable, or its default."""
    text = os.environ.get(name, "")
    try:
        value = float(text or DEFAULTS[name])
    except ValueError:
        value = 0.0
    if not 0 < value < math.inf:
        raise SignalError(f"{name} is {text!r}, a positive number expected, such as {DEFAULTS[name]:g}")
    return value


class TooMuchError(Exception):
    """More samples than permitted."""


def send(pipe: int, head: Mapping[str, Any], columns: Iterable[Array] = ()) -> None:
    """Write a message to a pipe; the columns (n,) have the same length."""
    text = json.dumps(head).encode()
    samples = [np.ascontiguousarray(column, np.float64).view(np.uint8).data for column in columns]
    start = memoryview(_HEAD.pack(len(text), sum(map(len, samples))) + text)
    for rest in (start, *samples):
        while rest:
            rest = rest[os.write(pipe, rest) :]


def receive(pipe: int, most: float = 0.0) -> tuple[dict[str, Any], Array]:
    """The next message, its columns one after the other, at most this many bytes of them.

    EOFError where the other process has ended.
    """
    text, body = _HEAD.unpack(_read_bytes(pipe, _HEAD.size))
    head = json.loads(_read_bytes(pipe, text))
    if body > most:
        raise TooMuchError
    return head, np.frombuffer(_read_bytes(pipe, body), np.float64)


def _read_bytes(pipe: int, size: int) -> bytearray:
    data = bytearray()
    while len(data) < size:
        part = os.read(pipe, min(size - len(data), 1 << 20))
        if not part:
            raise EOFError
        data += part
    return data


class _WithoutPandas(MetaPathFinder):
    """No pandas: pyarrow would import it in each fork at its first conversion, which takes longer than most logs."""

    def find_spec(self, fullname: str, path: Any = None, target: Any = None) -> None:
        if fullname == "pandas":
            raise ModuleNotFoundError("not used by this reader", name=fullname)


def run_child() -> None:
    """Serve the parent until it closes the pipe: the main function of the child process."""
    requests, replies, null = os.dup(0), os.dup(1), os.open(os.devnull, os.O_RDWR)
    os.dup2(null, 0)
    os.dup2(null, 1)  # what libraries print is no message
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    gc.set_threshold(100_000)  # a library that makes an object for each frame makes no cycles
    with contextlib.suppress(EOFError, BrokenPipeError):
        while True:
            request = receive(requests)[0]
            with contextlib.suppress(ImportError):  # reported by _serve
                importlib.import_module(request["module"])
            if not _FORK:
                _serve(request, requests, replies)
            elif not (fork := os.fork()):
                if "pandas" not in sys.modules:
                    sys.meta_path.insert(0, _WithoutPandas())
                _serve(request, requests, replies)
                os._exit(0)
            elif code := os.waitstatus_to_exitcode(os.waitpid(fork, 0)[1]):
                shutil.rmtree(request["folder"], ignore_errors=True)  # the parent may have died
                os._exit(code if code > 0 else 128 - code)


def _reply(replies: int, head: Mapping[str, Any], columns: Iterable[Array] = ()) -> None:
    faulthandler.cancel_dump_traceback_later()  # the parent may take its time
    send(replies, head, columns)


def _serve(request: Mapping[str, Any], requests: int, replies: int) -> None:
    """Read one file as the parent asks, until it closes the log."""
    name, kind, memory = request["name"], request["format"], request["limits"]["memory"]
    incoming: queue.SimpleQueue[dict[str, Any]] = queue.SimpleQueue()
    threading.Thread(target=_listen, args=(requests, incoming, request["folder"]), daemon=True).start()
    tempfile.tempdir = request["folder"]
    if _FORK:
        _restrict(memory, request["limits"]["written"])
    try:
        _read_log(request, incoming, replies)
    except SignalError as error:
        text = str(error)
    except ImportError as error:
        text = f"{name}: in the format {kind}, and {error.name} is not installed; pip install 'fifthwheel[logs]'"
    except MemoryError:
        needs = f"{name}: reading it as {kind} needs more than {memory:g} MB"
        text = f"{needs}; if it is intact, set {MEMORY} to more, else {CURE}"
    except Exception as error:
        text = f"{name}: cannot be read as {kind} ({type(error).__name__}: {reason(error)}); {CURE}"
    else:
        return
    _reply(replies, {"error": text})
    while "close" not in incoming.get():
        pass


def _read_log(request: Mapping[str, Any], incoming: "queue.SimpleQueue[Any]", replies: int) -> None:
    """Open the log and send the samples that the parent asks for, until it closes the log."""
    seconds, sent = request["limits"]["seconds"], time.monotonic()

    def progress(done: float) -> None:
        nonlocal sent
        if done >= 1.0 or time.monotonic() > sent + _PROGRESS_INTERVAL:
            sent = time.monotonic()
            _reply(replies, {"done": done})
            _arm(seconds)

    module = importlib.import_module(request["module"])
    _arm(seconds)
    log: LogSource = module.open_log(Path(request["path"]), request["databases"], progress)
    log.opening_notes += request["notes"]
    log.note(*request["notes"])
    if request["sample"]:
        log.sample()
    described, omitted = _described(log)
    head = {"columns": described, "notes": [*log.notes, *omitted], "sampled": log.sampled, "start": log.start}
    _reply(replies, head)
    while "close" not in (asked := incoming.get()):
        head, chunks = {"number": asked["number"]}, log.chunks(asked["chunks"])
        _arm(seconds)
        for chunk in chunks:
            if not incoming.empty():
                break
            columns = dict(chunk.values) | ({} if chunk.time is None else {None: chunk.time})
            head_of_chunk = head | {"names": list(columns), "clock": chunk.clock, "done": chunk.done}
            _reply(replies, head_of_chunk, columns.values())
            _arm(seconds)
        _reply(replies, head | {"notes": [*log.notes, *omitted], "unusable": log.unusable})
    if not _FORK:  # a fork ends now
        log.close()


def _described(log: LogSource) -> tuple[list[dict[str, Any]], list[str]]:
    """The columns of a log for the parent, and a note on those that are left out because of a long name."""
    if len(log.columns) > MAX_COLUMNS:
        raise SignalError(f"{log.name}: {len(log.columns)} columns, at most {MAX_COLUMNS} can be read; export fewer")
    columns = [asdict(column) for column in log.columns.values() if _has_usable_names(column)]
    omitted = len(log.columns) - len(columns)
    note = f"{omitted} columns left out: a name, unit or group of more than {MAX_NAME} characters, or not of characters"
    return columns, [note] * (omitted > 0)


def _has_usable_names(column: Column) -> bool:
    """Whether its name, unit and group are texts of a usual length; bytes that are no characters are surrogates."""
    names = (column.name, column.clock, column.unit or "")
    return max(map(len, names)) <= MAX_NAME and not any("\ud800" <= c <= "\udfff" for c in "".join(names))


def _arm(seconds: float) -> None:
    """End this process after twice the time limit, whatever blocks it: the parent that should do so may have died."""
    faulthandler.dump_traceback_later(2 * seconds, exit=True)


def _listen(requests: int, incoming: "queue.SimpleQueue[Any]", folder: str) -> None:
    """Pass on the requests for this file; end the process when the parent has died."""
    try:
        while True:
            incoming.put(request := receive(requests)[0])
            if "close" in request:
                return
    except EOFError:
        shutil.rmtree(folder, ignore_errors=True)
        os._exit(0)


def _restrict(memory: float, written: float) -> None:
    """Limit the memory of this process, MB, and the size of temporary files, bytes; write no core file."""
    import resource

    wanted = {resource.RLIMIT_FSIZE: written, resource.RLIMIT_DATA: memory * 1e6, resource.RLIMIT_CORE: 0}
    for kind, most in wanted.items():
        hard = resource.getrlimit(kind)[1]  # may be lower already, and cannot be raised
        value = int(most) if hard == resource.RLIM_INFINITY else min(int(most), hard)
        resource.setrlimit(kind, (value, value))
