"""Computation in child processes, so that the pages answer meanwhile and a cancelled job ends at once.

A job belongs to the server and has a key, so that each tab, also after a reload, shows the same job.
"""

import multiprocessing
import threading
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from typing import Any, Literal, TypeVar

from fifthwheel.errors import FifthwheelError

Result = TypeVar("Result")

_PROCESSES = multiprocessing.get_context("spawn")  # a fork of a process with threads may block
_REPORT_EVERY = 0.1
"""s between two reports of progress."""


@dataclass(eq=False)
class Job:
    """A computation in a process of its own."""

    key: str
    state: Literal["running", "done", "failed", "cancelled"] = "running"
    title: str = "starting"
    """What it does now."""
    fraction: float | None = None
    """Of the work with this title that is done, 0 to 1."""
    result: Any = None
    error: str = ""
    started: float = field(default_factory=time.monotonic)
    process: Any = None

    @property
    def running(self) -> bool:
        """Whether it has neither ended nor been cancelled."""
        return self.state == "running"

    def cancel(self) -> None:
        """End the process at once; files that it writes appear complete or not at all."""
        if self.running:
            self.state = "cancelled"
            self.process.kill()


_jobs: dict[str, Job] = {}


def get(key: str) -> Job | None:
    """The last job with this key."""
    return _jobs.get(key)


def start(key: str, function: Callable[..., Any], *args: Any, **options: Any) -> Job:
    """Start `function(*args, progress=..., **options)` in a process; a job with this key that runs already is returned.

    Args:
        key: names the job, such as "identify".
        function: of a module, not of a function; receives `progress(title, done, total)`.
        args, options: sent to the process; its result is sent back.
    """
    job = _jobs.get(key)
    if job is not None and job.running:
        return job
    receiver, sender = _PROCESSES.Pipe(duplex=False)
    job = Job(key)
    job.process = _PROCESSES.Process(target=_work, args=(sender, function, args, options), name=key, daemon=True)
    _jobs[key] = job
    job.process.start()
    sender.close()
    threading.Thread(target=_follow, args=(job, receiver), name=f"job {key}", daemon=True).start()
    return job


def cancel_all() -> None:
    """Cancel all jobs, and end the process of `compute`."""
    global _pool
    for job in _jobs.values():
        job.cancel()
    if _pool is not None:
        _pool.shutdown(wait=False, cancel_futures=True)
        _pool = None


_pool: ProcessPoolExecutor | None = None


async def compute(function: Callable[..., Result], *args: Any) -> Result:
    """The result of a function of a module, computed in a process that waits for such calls, one after the other."""
    import asyncio

    global _pool
    for attempt in (1, 2):
        if _pool is None:
            _pool = ProcessPoolExecutor(1, mp_context=_PROCESSES)
        try:
            return await asyncio.get_running_loop().run_in_executor(_pool, function, *args)
        except BrokenProcessPool:  # the process was killed, such as by a lack of memory
            _pool = None
            if attempt == 2:
                raise FifthwheelError("the computation was ended by the system; close other programs") from None
    raise AssertionError


def _work(sender: Connection, function: Callable[..., Any], args: tuple[Any, ...], options: dict[str, Any]) -> None:
    """In the child process: compute, and send progress, then the result or the error."""
    last, shown = 0.0, ""

    def progress(title: str, done: int, total: int) -> None:
        nonlocal last, shown
        now = time.monotonic()
        if title != shown or now - last > _REPORT_EVERY:
            last, shown = now, title
            sender.send(("progress", (title, done, total)))

    try:
        sender.send(("done", function(*args, progress=progress, **options)))
    except FifthwheelError as error:
        sender.send(("failed", str(error)))
    except OSError as error:
        sender.send(("failed", f"{error.filename or 'file'}: {error.strerror or error}; check free space and rights"))
    except Exception as error:
        sender.send(("failed", f"internal error, please report it: {type(error).__name__}: {error}"))
        raise


def _follow(job: Job, receiver: Connection) -> None:
    """In a thread: receive what a job sends until it ends."""
    try:
        while True:
            kind, content = receiver.recv()
            if kind == "progress":
                title, done, total = content
                job.title, job.fraction = title, done / total if total else None
                continue
            if job.running:
                job.result, job.error = (content, "") if kind == "done" else (None, content)
                job.state = kind
            break
    except (EOFError, OSError):
        if job.running:
            job.error = "ended by the system; it may need more memory than there is"
            job.state = "failed"
    finally:
        receiver.close()
        job.process.join()
