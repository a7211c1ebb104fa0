"""Many independent runs of one function on all cores."""

import multiprocessing
import os
import pickle
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from typing import Any, TypeVar

from fifthwheel.cluster import Lost, connected, run_on
from fifthwheel.errors import FifthwheelError

S = TypeVar("S")
T = TypeVar("T")
R = TypeVar("R")

MAX_PROCESSES = 16
_shared: list[Any] = []
"""What all tasks of a worker process share."""


def run_all(
    function: Callable[[S, T], R],
    shared: S,
    tasks: Sequence[T],
    *,
    jobs: int | None = None,
    scheduler: str | None = None,
) -> Iterator[tuple[T, R]]:
    """Each task with its result, in the order in which they end.

    When the iteration ends early, such as by Ctrl-C, tasks that have not started are cancelled.

    Args:
        function: at the top level of a module, so that another process can import it; takes `shared` and a task.
        shared: sent once to each process.
        tasks: may be pickled.
        jobs: processes; by default one per core, up to `MAX_PROCESSES`. 1 computes in this process.
        scheduler: address of a Dask scheduler that computes instead of processes.

    Raises:
        FifthwheelError: `shared` or the function cannot be pickled, a process was ended from outside, or the scheduler
            does not answer.
    """
    if scheduler is not None:
        _require_picklable(function, shared)
        with connected(scheduler) as client:
            for task, result in run_on(client, function, shared, tasks):
                if isinstance(result, Lost):
                    raise FifthwheelError(f"{task}: {result.reason}; give the workers more memory")
                yield task, result
        return
    jobs = min(os.cpu_count() or 1, MAX_PROCESSES) if jobs is None else jobs
    if jobs <= 1 or len(tasks) <= 1:
        for task in tasks:
            yield task, function(shared, task)
        return
    _require_picklable(function, shared)
    pool = ProcessPoolExecutor(
        min(jobs, len(tasks)),
        mp_context=multiprocessing.get_context("spawn"),
        initializer=_start_worker,
        initargs=(shared,),
    )
    try:
        futures = {pool.submit(_run, function, task): task for task in tasks}
        for future in as_completed(futures):
            yield futures[future], future.result()
    except BrokenProcessPool as error:
        raise FifthwheelError(
            "a worker process ended before its task; a script needs `if __name__ == '__main__':` around the call, and"
            " enough memory for each process; jobs=1 computes without other processes"
        ) from error
    finally:
        pool.shutdown(cancel_futures=True)


def _require_picklable(*objects: object) -> None:
    try:
        pickle.dumps(objects)
    except (pickle.PicklingError, AttributeError, TypeError) as error:
        raise FifthwheelError(
            f"jobs: cannot send an object to another process ({error}); define functions and classes at the top level"
            " of a module, or compute with jobs=1"
        ) from error


def _start_worker(shared: Any) -> None:
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # Ctrl-C ends the process without a traceback
    threading.Thread(target=_end_with_parent, daemon=True).start()
    _shared[:] = [shared]


def _end_with_parent() -> None:
    """A parent that is killed cannot end its workers, which would wait for tasks forever."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _run(function: Callable[[Any, T], R], task: T) -> R:
    return function(_shared[0], task)
