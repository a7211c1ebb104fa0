"""Many independent tasks: in this process, on all cores, or on a Dask cluster, a local one or any by its address."""

import multiprocessing
import os
import pickle
import signal
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import islice
from typing import Any, TypeVar

from fifthwheel.base.errors import FifthwheelError
from fifthwheel.base.lazy import require
from fifthwheel.base.spelling import FrontEnd, front_end, spelled_for, start_front_end

S = TypeVar("S")
T = TypeVar("T")
R = TypeVar("R")

WORKER_MEMORY = "1GB"
"""Limit of each local worker; it is restarted beyond it, and its task is tried again."""
TIMEOUT = 20.0
"""For a scheduler to answer, s."""
LOCAL = {"distributed.comm.timeouts.connect": "3s", "distributed.worker.profile.enabled": False}
"""Configuration of a local cluster: the time for a worker to answer; no profiler, which slows it down."""
AHEAD = 4
"""Tasks that the scheduler holds for each worker thread; the others wait here, so that its memory is bounded."""
REFRESH = 64
"""Results after which the number of workers is looked at again: workers may join and leave."""
MAX_PROCESSES = 16
"""Of `run_all`, by default."""
_shared: list[Any] = []
"""What all tasks of a worker process share."""


@dataclass(frozen=True)
class Lost:
    """Instead of a result: a task that ended its worker again and again."""

    reason: str


@contextmanager
def connected(scheduler: str | None = None, *, jobs: int | None = None) -> Iterator[Any]:
    """A client of a Dask cluster (`distributed.Client`).

    Args:
        scheduler: address such as "tcp://10.0.0.5:8786", whose workers have this version of fifthwheel. A scheduler
            can run any code on its clients' data and workers: connect only to your own. None starts a local cluster
            of processes, which listens on 127.0.0.1 only and ends with the block.
        jobs: processes of the local cluster; by default one per core.

    Raises:
        FifthwheelError: Dask is not installed, or no scheduler answers.
    """
    distributed = require("distributed", "fleet")
    dask = require("dask", "fleet")
    cluster, local = None, {} if scheduler else LOCAL
    with dask.config.set(local):
        try:
            if scheduler is None:
                cluster = distributed.LocalCluster(
                    n_workers=jobs,
                    threads_per_worker=1,
                    processes=True,
                    host="127.0.0.1",
                    dashboard_address="127.0.0.1:0",  # cannot be switched off; a free port, of this machine only
                    memory_limit=WORKER_MEMORY,
                    silence_logs="ERROR",
                    env={"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"},
                )
            try:
                client = distributed.Client(cluster or scheduler, timeout=TIMEOUT, set_as_default=False)
            except (OSError, ValueError, TimeoutError) as error:
                raise FifthwheelError(
                    f"scheduler: {scheduler} does not answer ({error}); expected the address of a Dask scheduler, such"
                    " as tcp://10.0.0.5:8786"
                ) from None
            with client:
                yield client
        finally:
            if cluster is not None:
                cluster.close()


def run_on(
    client: Any, function: Callable[[S, T], R], shared: S, tasks: Sequence[T] | Iterator[T]
) -> Iterator[tuple[T, R | Lost]]:
    """Each task with its result, in the order in which they end.

    The function is at the top level of a module that the workers can import, and takes `shared`, which is sent once to
    the scheduler and from there to each worker, and a task. Tasks are consumed as the cluster can take them. A task
    whose worker ended is tried again on another one; after the number of attempts of the cluster's configuration
    (distributed.scheduler.allowed-failures) the result is `Lost`. When the iteration ends early, tasks that have not
    started are cancelled.
    """
    distributed = require("distributed", "fleet")
    remaining = iter(tasks)
    common = client.submit(_itself, shared, pure=False)  # not scattered: a task survives the loss of all workers
    running: dict[Any, T] = {}
    done = 0

    def submit(count: int) -> list[Any]:
        futures = []
        for task in islice(remaining, max(count, 0)):
            future = client.submit(_spelled, front_end(), function, common, task, pure=False)
            running[future] = task
            futures.append(future)
        return futures

    limit = AHEAD * max(sum(client.nthreads().values()), 1)
    ended = distributed.as_completed(submit(limit), loop=client.loop, raise_errors=False)
    try:
        for future in ended:
            task, error = running.pop(future), future.exception()
            if error is None:
                yield task, future.result()
            elif isinstance(error, distributed.KilledWorker):
                yield task, Lost(f"its worker ended {error.allowed_failures + 1} times, for example for lack of memory")
            else:
                raise error
            future.release()
            done += 1
            if done % REFRESH == 0:
                limit = AHEAD * max(sum(client.nthreads().values()), 1)
            for new in submit(limit - len(running)):
                ended.add(new)
    finally:
        client.cancel(list(running))


def _spelled(words: FrontEnd, function: Callable[[S, T], R], shared: S, task: T) -> R:
    """The result on a worker, whose messages are for the front end that waits for it."""
    with spelled_for(words):
        return function(shared, task)


def _itself(value: T) -> T:
    return value


def run_here(function: Callable[[S, T], R], shared: S, tasks: Iterable[T]) -> Iterator[tuple[T, R]]:
    """Each task with its result, in this process and in their order."""
    for task in tasks:
        yield task, function(shared, task)


def run_all(
    function: Callable[[S, T], R],
    shared: S,
    tasks: Sequence[T],
    *,
    jobs: int | None = None,
    scheduler: str | None = None,
) -> Iterator[tuple[T, R]]:
    """Each task with its result, in the order in which they end.

    The function is at the top level of a module, so that another process can import it, and takes `shared`, which is
    sent once to each process, and a task. `jobs` are processes, by default one per core up to `MAX_PROCESSES`; 1 is
    this process. `scheduler` is the address of a Dask scheduler that computes instead. When the iteration ends early,
    such as by Ctrl-C, tasks that have not started are cancelled.

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
        yield from run_here(function, shared, tasks)
        return
    _require_picklable(function, shared)
    pool = process_pool(min(jobs, len(tasks)), shared)
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


def process_pool(jobs: int, shared: object = None) -> ProcessPoolExecutor:
    """A pool of so many processes, which end with this process; `shared` is sent to each once."""
    context = multiprocessing.get_context("spawn")
    return ProcessPoolExecutor(jobs, mp_context=context, initializer=_start_worker, initargs=(shared, front_end()))


def _require_picklable(*objects: object) -> None:
    try:
        pickle.dumps(objects)
    except (pickle.PicklingError, AttributeError, TypeError) as error:
        raise FifthwheelError(
            f"jobs: cannot send an object to another process ({error}); define functions and classes at the top level"
            " of a module, or compute with jobs=1"
        ) from error


def _start_worker(shared: Any, words: FrontEnd) -> None:
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # Ctrl-C ends the process without a traceback
    threading.Thread(target=_end_with_parent, daemon=True).start()
    _shared[:] = [shared]
    start_front_end(words)


def _end_with_parent() -> None:
    """A parent that is killed cannot end its workers, which would wait for tasks forever."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _run(function: Callable[[Any, T], R], task: T) -> R:
    return function(_shared[0], task)
