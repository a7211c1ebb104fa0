"""Computation in child processes, so that the pages answer meanwhile and a cancelled job ends at once.

A job belongs to the server and has a key, so that each tab, also after a reload, shows the same job.
"""

import asyncio
import multiprocessing
import os
import threading
import time
import traceback
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from typing import Any, Literal, TypeVar

from fifthwheel.apps.cluster import process_pool
from fifthwheel.base.errors import FifthwheelError
from fifthwheel.base.spelling import FrontEnd, front_end, start_front_end

Result = TypeVar("Result")

_PROCESSES = multiprocessing.get_context("spawn")  # a fork of a process with threads may block
_REPORT_EVERY = 0.1
"""s between two reports of progress."""
ITERATIONS = ("fit", "stage")
"""First words of the titles that count steps of an iteration, which may converge before the last one."""
COUNTED = 100
"""Above this, work is shown as a percentage."""


@dataclass(eq=False)
class Job:
    """A computation in a process of its own."""

    state: Literal["none", "running", "done", "failed", "cancelled"] = "running"
    title: str = "starting"
    """What it does now."""
    done: int = 0
    total: int = 0
    """Work with this title, and how much of it is done; 0 where it is not known."""
    result: Any = None
    error: str = ""
    product: str = ""
    """Name of what it makes."""
    started: float = field(default_factory=time.monotonic)
    title_since: float = field(default_factory=time.monotonic)
    process: Any = None
    on_cancel: Callable[[], object] = lambda: None
    """Removes what the process leaves when it is cancelled."""

    @property
    def unfinished(self) -> bool:
        """Whether it has ended without a result."""
        return self.state in ("failed", "cancelled")

    @property
    def running(self) -> bool:
        """Whether it has neither ended nor been cancelled."""
        return self.state == "running"

    @property
    def fraction(self) -> float | None:
        """Of the work with this title that is done, 0 to 1; None where it is not known."""
        return self.done / self.total if self.total else None

    def report(self, title: str, done: int, total: int) -> None:
        """Take what the process reports."""
        if title != self.title:
            self.title_since = time.monotonic()
        self.title, self.done, self.total = title, done, total

    def words(self) -> str:
        """What it does, how much of it is done, and the time that is left or has passed."""
        now = time.monotonic()
        passed, here = now - self.started, now - self.title_since
        if self.title.startswith(ITERATIONS) and self.total:
            return f"{self.title}, step {min(self.done + 1, self.total)} of at most {self.total}, {passed:.0f} s so far"
        if not self.total:
            return f"{self.title}, {passed:.0f} s so far"
        part = f"{100 * self.done / self.total:.0f} %" if self.total > COUNTED else f"{self.done} of {self.total}"
        left = here * (self.total - self.done) / self.done if self.done and here > 1.0 else None
        return f"{self.title}, {part}, {passed:.0f} s so far" + (f", {left:.0f} s left" if left else "")

    def cancel(self) -> None:
        """End the process at once; files that it writes appear complete or not at all."""
        if self.running:
            self.state = "cancelled"
            self.process.kill()
            self.process.join()
            self.on_cancel()


_jobs: dict[str, Job] = {}
_NONE = Job(state="none")


def get(key: str) -> Job:
    """The job of a key; where none was started, one of the state "none"."""
    return _jobs.get(key, _NONE)


def start(
    key: str,
    function: Callable[..., Any],
    *args: Any,
    product: str = "",
    on_cancel: Callable[[], object] = lambda: None,
    **options: Any,
) -> Job:
    """Start `function(*args, progress=..., **options)` in a process; a job with this key that runs already is returned.

    When the job is cancelled, `on_cancel` is called in the server. The function belongs to a module and receives
    `progress(title, done, total)`; arguments and result are sent.
    """
    if (job := get(key)).running:
        return job
    receiver, sender = _PROCESSES.Pipe(duplex=False)
    job = Job(product=product, on_cancel=on_cancel)
    job.process = _PROCESSES.Process(
        target=_work, args=(sender, front_end(), function, args, options), name=key, daemon=True
    )
    _jobs[key] = job
    job.process.start()
    sender.close()
    threading.Thread(target=_follow, args=(job, receiver), name=f"job {key}", daemon=True).start()
    return job


_pool: ProcessPoolExecutor | None = None
"""The process of `compute`, which is kept so that the imports are not repeated."""
_worker = 0
"""Number of this process."""
_free = threading.Lock()


def cancel_all() -> None:
    """Cancel all jobs, and end the process of `compute`; other children of this process go on."""
    global _pool
    for job in _jobs.values():
        job.cancel()
    for process in multiprocessing.active_children():
        if process.pid == _worker:
            process.kill()
    _pool = None


async def compute(function: Callable[..., Result], *args: Any) -> Result:
    """The result of a function of a module, computed in a process that waits for such calls, one after the other.

    Raises:
        FifthwheelError: as the function, or the process was ended.
    """
    return await asyncio.to_thread(_ask, function, args)


def _ask(function: Callable[..., Result], args: tuple[Any, ...]) -> Result:
    global _pool, _worker
    with _free:
        try:
            if _pool is None:
                _pool = process_pool(1)
                _worker = _pool.submit(os.getpid).result()
            kind, content = _pool.submit(_outcome, function, args, {}).result()
        except BrokenProcessPool:
            _pool = None  # the next computation starts another process
            raise FifthwheelError("the computation was ended by the system; close other programs") from None
    if kind == "failed":
        raise FifthwheelError(content)
    result: Result = content
    return result


def _outcome(function: Callable[..., Any], args: tuple[Any, ...], options: dict[str, Any]) -> tuple[str, Any]:
    """Either "done" and the result, or "failed" and a message."""
    try:
        return "done", function(*args, **options)
    except FifthwheelError as error:
        return "failed", str(error)
    except OSError as error:
        return "failed", f"{error.filename or 'file'}: {error.strerror or error}; check free space and rights"
    except Exception as error:
        traceback.print_exc()
        return "failed", f"internal error, please report it: {type(error).__name__}: {error}"


def _work(
    sender: Connection,
    words: FrontEnd,
    function: Callable[..., Any],
    args: tuple[Any, ...],
    options: dict[str, Any],
) -> None:
    """In the child process: compute, and send progress, then the result or the error."""
    start_front_end(words)
    last, shown = 0.0, ""

    def progress(title: str, done: int, total: int) -> None:
        nonlocal last, shown
        now = time.monotonic()
        if title != shown or now - last > _REPORT_EVERY:
            last, shown = now, title
            sender.send(("progress", (title, done, total)))

    sender.send(_outcome(function, args, options | {"progress": progress}))


def _follow(job: Job, receiver: Connection) -> None:
    """In a thread: receive what a job sends until it ends."""
    try:
        while True:
            kind, content = receiver.recv()
            if kind == "progress":
                job.report(*content)
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
