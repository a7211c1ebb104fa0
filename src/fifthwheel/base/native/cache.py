"""Cache of compiled code on disk, so that a step is compiled only once; also of other constant results.

An entry is used only if its key identifies all that determines it, such as the step, the processor and the compiler,
its digest matches its content, and no other user can have written it. An entry that fails a check is ignored and
written again.
"""

import functools
import hashlib
import os
import shlex
import stat
import warnings
from pathlib import Path

from platformdirs import user_cache_path

from fifthwheel.base.atomic import atomic_write
from fifthwheel.base.errors import printable

DIGEST = hashlib.sha256
_SIZE = DIGEST().digest_size


def folder() -> Path | None:
    """Folder of the cache, created if missing; None if the cache is off or other users can write to the folder.

    The latter gives a RuntimeWarning, once in a process.

    The environment variable FIFTHWHEEL_CACHE names another folder; an empty string switches the cache off.
    """
    chosen = os.environ.get("FIFTHWHEEL_CACHE")
    if chosen == "":
        return None
    path = Path(chosen) if chosen else user_cache_path("fifthwheel", "fifthwheel") / "native"
    try:
        path.mkdir(mode=0o700, parents=True, exist_ok=True)
        if _private(path):
            return path
        _warn_of_folder(path)
    except OSError:
        pass
    return None


@functools.cache
def _warn_of_folder(path: Path) -> None:
    """Warn, once in a process, of a folder in which others could place code."""
    if path.is_symlink():
        cause, cure = "it is a link", "name its target by FIFTHWHEEL_CACHE"
    elif path.lstat().st_uid != os.getuid():
        cause, cure = "it belongs to another user", "name a folder of your own by FIFTHWHEEL_CACHE"
    else:
        cause, cure = "other users can write to it", f"run chmod 700 {shlex.quote(str(path))}"
    text = f"{path}: not used as the cache of compiled code, because {cause}; every run compiles again; {cure}"
    warnings.warn(printable(text), RuntimeWarning, stacklevel=2)


def _private(path: Path) -> bool:
    """Whether the path belongs to this user, is no link, and no other user can write to it."""
    if not hasattr(os, "getuid"):
        return True  # Windows: only the user can write to a profile folder
    status = path.lstat()
    return (
        not stat.S_ISLNK(status.st_mode)
        and status.st_uid == os.getuid()
        and not status.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
    )


def read(key: bytes) -> bytes | None:
    """Content of the entry of a key (32 bytes), such as object code; None if there is no valid entry."""
    cache_folder = folder()
    if cache_folder is None:
        return None
    path = cache_folder / f"{key.hex()}.o"
    try:
        if not _private(path):
            return None
        content = path.read_bytes()
    except OSError:
        return None
    stored_key, digest, code = content[:_SIZE], content[_SIZE : 2 * _SIZE], content[2 * _SIZE :]
    return code if stored_key == key and digest == DIGEST(key + code).digest() else None


def write(key: bytes, code: bytes) -> None:
    """Store a content under a key. A disk that is full or read-only is not an error."""
    cache_folder = folder()
    if cache_folder is None:
        return
    try:
        with atomic_write(cache_folder / f"{key.hex()}.o") as temporary:
            temporary.chmod(0o600)
            temporary.write_bytes(key + DIGEST(key + code).digest() + code)
    except OSError:
        return
