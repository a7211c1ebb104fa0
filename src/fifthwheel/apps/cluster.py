"""Many independent tasks: in this process, in processes of this computer, or on a Dask cluster by its address."""

import multiprocessing
import os
import pickle
import signal
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from itertools import islice
from typing import Any, TypeVar

from fifthwheel.base import native
from fifthwheel.base.errors import FifthwheelError
from fifthwheel.base.lazy import require
from fifthwheel.base.spelling import FrontEnd, front_end, spelled_for, start_front_end

S = TypeVar("S")
T = TypeVar("T")
R = TypeVar("R")

TIMEOUT = 20.0
"""For a scheduler to answer, s."""
AHEAD = 4
"""Tasks that wait for each process of a worker; the others wait here, so that memory is bounded."""
REFRESH = 64
"""Results after which the number of workers is looked at again: workers may join and leave."""
ATTEMPTS = 3
"""Of a task that ends its process."""
MAX_PROCESSES = 16
"""Of this computer, by default."""
_shared: list[Any] = []
"""What all tasks of a worker process share."""


@dataclass(frozen=True)
class Lost:
    """Instead of a result: a task that ended its worker again and again."""

    reason: str


def run_all(
    function: Callable[[S, T], R],
    shared: S,
    tasks: Sequence[T],
    *,
    jobs: int | None = None,
    scheduler: str | None = None,
) -> Iterator[tuple[T, R | Lost]]:
    """Each task with its result, in the order in which they end.

    The function is at the top level of a module, so that another process can import it, and takes `shared`, which is
    sent once to each process, and a task. `jobs` are processes, by default one per core up to `MAX_PROCESSES`; 1 is
    this process. `scheduler` is the address of a Dask scheduler that computes instead. A task that ends its process is
    tried again, and `Lost` after some attempts. When the iteration ends early, such as by Ctrl-C, so do the processes.

    Raises:
        FifthwheelError: `shared` or the function cannot be pickled, no process can be started, or the scheduler does
            not answer.
    """
    jobs = min(os.cpu_count() or 1, MAX_PROCESSES) if jobs is None else jobs
    if scheduler is None and min(jobs, len(tasks)) <= 1:
        for task in tasks:
            yield task, function(shared, task)
        return
    try:
        pickle.dumps((function, shared))
    except (pickle.PicklingError, AttributeError, TypeError) as error:
        raise FifthwheelError(
            f"jobs: cannot send an object to another process ({error}); define functions and classes at the top level"
            " of a module, or compute with jobs=1"
        ) from error
    if scheduler is None:
        yield from _run_in_processes(min(jobs, len(tasks)), function, shared, tasks)
        return
    with connected(scheduler) as client:
        yield from run_on(client, function, shared, tasks)


def results_of(function: Callable[[S, T], R], shared: S, tasks: Sequence[T], **where: Any) -> Iterator[tuple[T, R]]:
    """`run_all`; a FifthwheelError instead of a task that is `Lost`."""
    for task, result in run_all(function, shared, tasks, **where):
        if isinstance(result, Lost):
            raise FifthwheelError(f"{task}: {result.reason}")
        yield task, result


def _run_in_processes(
    jobs: int, function: Callable[[S, T], R], shared: S, tasks: Sequence[T]
) -> Iterator[tuple[T, R | Lost]]:
    waiting = deque(tasks)
    while waiting:
        running: dict[Any, T] = {}
        with suppress(BrokenProcessPool), _ended(process_pool(jobs, shared)) as pool:
            while waiting or running:
                while waiting and len(running) < AHEAD * jobs:
                    future = pool.submit(_run, function, waiting[0])
                    running[future] = waiting.popleft()
                for future in wait(running, return_when=FIRST_COMPLETED)[0]:
                    result = future.result()
                    yield running.pop(future), result
        if running and isinstance(_run_alone(_nothing, shared, None), Lost):
            raise FifthwheelError(
                "jobs: no process can be started; a script needs `if __name__ == '__main__':` around the call, and"
                " enough memory for each process; jobs=1 computes without other processes"
            )
        for future, task in running.items():  # of which one has ended its process
            ended = future.cancelled() or future.exception()
            yield task, _run_alone(function, shared, task) if ended else future.result()


def _run_alone(function: Callable[[S, T], R], shared: S, task: T) -> R | Lost:
    """The result of a task that may end its process."""
    for _ in range(ATTEMPTS):
        with suppress(BrokenProcessPool), _ended(process_pool(1, shared)) as pool:
            return pool.submit(_run, function, task).result()
    return Lost(f"its process ended {ATTEMPTS} times, for example for lack of memory")


def _nothing(_shared: object, _task: object) -> None:
    """A task that ends no process."""


@contextmanager
def _ended(pool: ProcessPoolExecutor) -> Iterator[ProcessPoolExecutor]:
    """A pool whose processes end with the block, at once where an exception leaves it."""
    try:
        yield pool
    except BaseException:
        for process in list((pool._processes or {}).values()):  # Python 3.14: terminate_workers
            process.terminate()
        raise
    finally:
        pool.shutdown(cancel_futures=True)


@contextmanager
def connected(scheduler: str) -> Iterator[Any]:
    """A client of a Dask cluster (`distributed.Client`).

    Args:
        scheduler: address such as "tcp://10.0.0.5:8786", whose workers have this version of fifthwheel. A scheduler
            can run any code on its clients' data and workers: connect only to your own.

    Raises:
        FifthwheelError: Dask is not installed, or no scheduler answers.
    """
    distributed = require("distributed", "fleet")
    try:
        client = distributed.Client(scheduler, timeout=TIMEOUT, set_as_default=False)
    except (OSError, ValueError, TimeoutError) as error:
        raise FifthwheelError(
            f"scheduler: {scheduler} does not answer ({error}); expected the address of a Dask scheduler, such as"
            " tcp://10.0.0.5:8786"
        ) from None
    with client:
        yield client


def run_on(client: Any, function: Callable[[S, T], R], shared: S, tasks: Iterable[T]) -> Iterator[tuple[T, R | Lost]]:
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


def process_pool(jobs: int, shared: object = None) -> ProcessPoolExecutor:
    """A pool of so many processes, which end with this process; `shared` is sent to each once."""
    context = multiprocessing.get_context("spawn")
    return ProcessPoolExecutor(
        jobs, mp_context=context, initializer=_start_worker, initargs=(shared, front_end(), jobs)
    )


def _start_worker(shared: Any, words: FrontEnd, jobs: int) -> None:
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # Ctrl-C ends the process without a traceback
    threading.Thread(target=_end_with_parent, daemon=True).start()
    _shared[:] = [shared]
    native.share_cores(jobs)
    start_front_end(words)


def _end_with_parent() -> None:
    """A parent that is killed cannot end its workers, which would wait for tasks forever."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _run(function: Callable[[Any, T], R], task: T) -> R:
    return function(_shared[0], task)
