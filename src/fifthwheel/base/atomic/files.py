"""One file that appears complete or not at all."""

import json
import os
import secrets
import sys
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

from fifthwheel.base.atomic.locks import cleaned_up, held, try_lock
from fifthwheel.base.errors import FifthwheelError
from fifthwheel.base.spelling import setting

_SUFFIX = ".part"


@contextmanager
def atomic_write(path: str | Path) -> Iterator[Path]:
    """A temporary file to write to; when the block ends without an error it replaces `path`, otherwise it is removed.

    Processes that write the same file do not collide: each has its own temporary file, and the last to finish wins.
    The temporary file is locked, so that the next writer of `path` can remove those of processes that were killed.

    Raises:
        OSError: the file cannot be written; `filename` is `path`.
    """
    path = Path(path)
    temporary = path
    try:
        _remove_leftovers(path)
        temporary, lock = _temporary_file(path)
        with cleaned_up(lambda: temporary.unlink(missing_ok=True)):
            try:
                yield temporary
                os.fsync(lock)
                if sys.platform != "win32":
                    temporary.replace(path)
            finally:
                os.close(lock)
            if sys.platform == "win32":  # does not rename an open file
                temporary.replace(path)
    except OSError as error:
        if error.errno is None or error.filename not in (None, str(temporary), str(path.parent)):
            raise
        raise OSError(error.errno, error.strerror, str(path)) from error


def write_text(path: str | Path, text: str) -> None:
    """Write a text in UTF-8 to a file that appears complete or not at all; errors as of `atomic_write`."""
    with atomic_write(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def write_json(path: str | Path, content: Mapping[str, Any]) -> None:
    """The same with an object as JSON."""
    write_text(path, json.dumps(content, indent=2) + "\n")


@contextmanager
def reserved(*paths: Path | None, force: bool) -> Iterator[None]:
    """Reserve the names of files that are written in the block, so that no other file is lost; None is no file.

    A FifthwheelError if a file exists (without `force`), or another process has reserved it. An OSError, whose
    `filename` is the file, if its folder cannot be written to.
    """
    with ExitStack() as stack:
        for path in filter(None, paths):
            try:
                stack.enter_context(held(path.with_name(f".{path.name}.lock"), subject=path))
            except OSError as error:
                raise OSError(error.errno, error.strerror, str(path)) from error
            if os.path.lexists(path) and not force:
                raise FifthwheelError(f"{path}: exists; write to another file, or replace it with {setting('force')}")
        yield


def _temporary_file(path: Path) -> tuple[Path, int]:
    """A new file beside `path`, and the descriptor that locks it."""
    while True:
        temporary = path.with_name(f".{path.name}.{secrets.token_hex(4)}{_SUFFIX}")
        if (lock := try_lock(temporary)) is not None:
            return temporary, lock


def _remove_leftovers(path: Path) -> None:
    """Remove the temporary files of processes that were killed while they wrote `path`."""
    for left in path.parent.iterdir():
        if left.name.startswith(f".{path.name}.") and left.suffix == _SUFFIX and (lock := try_lock(left)) is not None:
            left.unlink()
            os.close(lock)
