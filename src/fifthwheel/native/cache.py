"""Compiled code on disk, so that only the first run of a step pays for its compilation.

An entry is run only when its key names exactly this step on this processor with this compiler, its digest matches its
content, and nobody but this user could have written it. Whatever fails a check is ignored and written anew.
"""

import hashlib
import os
import stat
import tempfile
from pathlib import Path

from platformdirs import user_cache_path

DIGEST = hashlib.sha256
_SIZE = DIGEST().digest_size


def folder() -> Path | None:
    """The cache's folder, made when missing; None where it is switched off or not this user's alone.

    FIFTHWHEEL_CACHE names another folder; set to an empty string it switches the cache off.
    """
    chosen = os.environ.get("FIFTHWHEEL_CACHE")
    if chosen == "":
        return None
    path = Path(chosen) if chosen else user_cache_path("fifthwheel", "fifthwheel") / "native"
    try:
        path.mkdir(mode=0o700, parents=True, exist_ok=True)
        return path if _private(path) else None
    except OSError:
        return None


def _private(path: Path) -> bool:
    if not hasattr(os, "getuid"):
        return True  # Windows: a profile folder is its user's alone
    status = path.lstat()
    return (
        not stat.S_ISLNK(status.st_mode)
        and status.st_uid == os.getuid()
        and not status.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
    )


def read(key: bytes) -> bytes | None:
    """The object code stored under `key` (32 bytes), or None."""
    place = folder()
    if place is None:
        return None
    path = place / f"{key.hex()}.o"
    try:
        if not _private(path):
            return None
        content = path.read_bytes()
    except OSError:
        return None
    stored_key, digest, code = content[:_SIZE], content[_SIZE : 2 * _SIZE], content[2 * _SIZE :]
    return code if stored_key == key and digest == DIGEST(key + code).digest() else None


def write(key: bytes, code: bytes) -> None:
    """Store `code` under `key`; a full or read-only disk is no error, the cache is only a convenience."""
    place = folder()
    if place is None:
        return
    temporary = None
    try:
        handle, temporary = tempfile.mkstemp(dir=place, suffix=".part")
        with os.fdopen(handle, "wb") as file:
            file.write(key + DIGEST(key + code).digest() + code)
        os.replace(temporary, place / f"{key.hex()}.o")
    except OSError:
        if temporary is not None:
            Path(temporary).unlink(missing_ok=True)
