"""What ends with its process: advisory locks on files, however it ends, and temporary files, also after a signal."""

import os
import platform
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from fifthwheel.base.errors import FifthwheelError

_pending: list[Callable[[], None]] = []

if sys.platform == "win32":
    import msvcrt

    def _lock(file: int) -> None:
        os.lseek(file, 1 << 30, os.SEEK_SET)  # behind the content, which others can then read
        try:
            msvcrt.locking(file, msvcrt.LK_NBLCK, 1)
        except PermissionError as error:
            raise BlockingIOError from error
        os.lseek(file, 0, os.SEEK_SET)

else:
    import fcntl

    def _lock(file: int) -> None:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)


@contextmanager
def cleaned_up(action: Callable[[], None]) -> Iterator[None]:
    """Call `action` when the block ends, or when `clean_up` is called within it; it must be harmless to repeat."""
    _pending.append(action)
    try:
        yield
    finally:
        try:
            action()
        finally:
            _pending.remove(action)


def clean_up() -> None:
    """Remove the temporary files of all blocks, innermost first; for a process that exits within them."""
    for action in reversed(_pending):
        with suppress(Exception):
            action()


def try_lock(path: Path) -> int | None:
    """Create or open a file and lock it; its descriptor, which holds the lock until it is closed, or None if another
    process holds it. An OSError if the file cannot be created, or the file system has no locks.
    """
    while True:
        file = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
        try:
            _lock(file)
            if os.path.samestat(os.fstat(file), path.stat()):
                return file
        except BlockingIOError:
            os.close(file)
            return None
        except FileNotFoundError:
            pass  # removed by its former owner between opening and locking
        except OSError:
            os.close(file)
            raise
        os.close(file)


@contextmanager
def held(path: Path, *, subject: Path) -> Iterator[None]:
    """Hold the lock file `path`, which is removed at the end; a FifthwheelError if another process holds it.

    The message names the `subject` that the lock protects.
    """
    while (file := try_lock(path)) is None:
        try:
            holder = path.read_text(encoding="utf-8")
        except FileNotFoundError:
            continue  # its owner has ended since
        except OSError:
            holder = ""
        raise FifthwheelError(
            f"{subject}: in use by {holder or 'another process'}; wait until it ends, or write somewhere else"
        )
    try:
        with cleaned_up(lambda: _remove(path)):
            os.ftruncate(file, 0)
            os.write(file, f"process {os.getpid()} on {platform.node()}".encode())
            yield
    finally:
        os.close(file)


def _remove(path: Path) -> None:
    with suppress(PermissionError):  # Windows keeps an open file
        path.unlink(missing_ok=True)
