"""Writing files beside the node, so that a slow disk does not delay it."""

import queue
import threading
from collections.abc import Callable

WAITING = 8
"""Jobs that may wait; more, and the disk does not keep up."""


class BackgroundWriter:
    """Runs jobs one after the other in a thread; an error is kept, and the node goes on."""

    def __init__(self) -> None:
        self.errors: dict[str, str] = {}
        """Why the last job of a kind failed; empty while all is well."""
        self._jobs: queue.Queue[tuple[str, Callable[[], object]] | None] = queue.Queue(WAITING)
        self._thread = threading.Thread(target=self._run, name="fifthwheel writer", daemon=True)
        self._thread.start()

    def submit(self, kind: str, job: Callable[[], object], *, wait: bool = False) -> bool:
        """Run a job soon; False if too many are pending, unless it may `wait` for them."""
        try:
            self._jobs.put((kind, job), block=wait)
        except queue.Full:
            self.errors[kind] = "the disk does not keep up; use a faster one"
            return False
        return True

    def close(self) -> None:
        """Wait until all jobs are done."""
        self._jobs.put(None)
        self._thread.join()

    def _run(self) -> None:
        while (item := self._jobs.get()) is not None:
            kind, job = item
            try:
                job()
                self.errors.pop(kind, None)
            except Exception as error:  # whatever it is, the node must go on; the status says it
                self.errors[kind] = str(error)
