"""The child process that reads logs for a program: it runs the reader of the format, within limits.

On Linux every file is read in a fork of the child, so the libraries are imported once for many files.
"""

import contextlib
import faulthandler
import gc
import importlib
import os
import queue
import shutil
import signal
import sys
import tempfile
import threading
import time
from collections.abc import Iterable, Mapping
from dataclasses import asdict
from importlib.abc import MetaPathFinder
from pathlib import Path
from typing import Any

from fifthwheel.base.errors import SignalError
from fifthwheel.base.types import Array
from fifthwheel.data.logs.readers.limits import MAX_COLUMNS, MAX_NAME, MEMORY
from fifthwheel.data.logs.readers.messages import receive, send
from fifthwheel.data.logs.source import Column, LogSource, reason

CURE = "copy it again from the logger, or save it again in the tool that wrote it"
"""What to do about a file that cannot be read."""
_FORK = sys.platform == "linux"
_PROGRESS_INTERVAL = 0.1


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
