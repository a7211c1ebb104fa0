"""Files of a fleet: local, or in an object store.

Paths count as written: no pattern, no variable, no chain of protocols.

Logs and vehicle files in an object store are copied to a temporary file while a trip is processed; nothing else is
downloaded, and no other protocol is accepted.
"""

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path, PurePosixPath
from typing import Any

from fifthwheel.base.atomic import atomic_write
from fifthwheel.base.errors import FifthwheelError
from fifthwheel.base.input_files import require_regular
from fifthwheel.base.lazy import require

STORES = ("s3", "gs", "gcs", "abfs", "az")
"""Protocols of object stores."""
MAX_LOG_SIZE = 4_000_000_000
"""Bytes of a log in an object store."""


def checked(path: str) -> str:
    """A path as written, if it is local or in an object store.

    Raises:
        FifthwheelError: another protocol, or no path; the message is the reason alone.
    """
    protocol, separator, rest = path.partition("://")
    if not path or "\x00" in path or "::" in path:
        raise FifthwheelError(f"expected a path, got {path!r}")
    if separator and (protocol not in STORES or not rest):
        raise FifthwheelError(
            f"expected a local path or one of {', '.join(f'{name}://' for name in STORES)}, got {path!r}; "
            "copy the file there"
        )
    return path


def is_remote(path: str) -> bool:
    """Whether a path is in an object store."""
    return "://" in path


def joined(folder: str, name: str) -> str:
    """The path of a name in a folder; a name that is an absolute path or in an object store is the path itself."""
    if is_remote(name) or PurePosixPath(name).is_absolute() or Path(name).is_absolute():
        return name
    if is_remote(folder):
        return f"{folder.rstrip('/')}/{name}"
    return str(Path(folder) / name)


def parent(path: str) -> str:
    """The folder of a path."""
    return path.rpartition("/")[0] if is_remote(path) else str(Path(path).parent)


def stem(path: str) -> str:
    """The name of a file without its ending."""
    return PurePosixPath(path).stem if is_remote(path) else Path(path).stem


def filesystem(path: str) -> tuple[Any, str]:
    """The file system of fsspec that a path in an object store belongs to, and the path there.

    Raises:
        FifthwheelError: fsspec or the library of the object store is not installed.
    """
    fsspec = require("fsspec", "fleet")
    try:
        system = fsspec.filesystem(path.partition("://")[0])
    except ImportError as error:
        raise FifthwheelError(
            f"{path}: its library is not installed ({error}); pip install 'fifthwheel[fleet]' for s3, or that library"
        ) from None
    return system, system._strip_protocol(path)


@contextmanager
def local_file(path: str) -> Iterator[Path]:
    """A local file with the content of a path: the file itself, or a temporary copy with the same name.

    Raises:
        FifthwheelError: not a regular file, larger than `MAX_LOG_SIZE`, or it does not exist.
    """
    if not is_remote(path):
        require_regular(Path(path))
        yield Path(path)
        return
    system, inside = filesystem(path)
    with tempfile.TemporaryDirectory(prefix="fifthwheel-") as folder:
        copy = Path(folder) / (PurePosixPath(inside).name or "file")
        with _named(path):
            size = system.size(inside)
            if size is None or size > MAX_LOG_SIZE:
                raise FifthwheelError(f"{path}: larger than {MAX_LOG_SIZE / 1e9:g} GB; cut the log into trips")
            system.get_file(inside, str(copy))
        yield copy


def read_bytes(path: str, max_size: int) -> bytes:
    """The content of a file.

    Raises:
        FifthwheelError: not a regular file, larger than `max_size` bytes, or it does not exist.
    """
    with _named(path):
        if is_remote(path):
            system, inside = filesystem(path)
            data: bytes = system.cat_file(inside, end=max_size + 1)
        else:
            require_regular(Path(path))
            with Path(path).open("rb") as file:
                data = file.read(max_size + 1)
    if len(data) > max_size:
        raise FifthwheelError(f"{path}: larger than {max_size / 1e6:g} MB; check the path")
    return data


def write_bytes(path: str, data: bytes) -> None:
    """Write a file so that it appears complete or not at all: by renaming, or by one PUT of an object store."""
    with _named(path):
        if is_remote(path):
            system, inside = filesystem(path)
            system.pipe_file(inside, data)
        else:
            Path(path).parent.mkdir(parents=True, exist_ok=True)
            with atomic_write(path) as temporary:
                temporary.write_bytes(data)


def names(folder: str, ending: str) -> list[str]:
    """Names of the files in a folder with an ending, sorted; none if there is no folder."""
    with _named(folder):
        if not is_remote(folder):
            here = Path(folder)
            return sorted(p.name for p in here.iterdir() if p.name.endswith(ending)) if here.is_dir() else []
        system, inside = filesystem(folder)
        system.invalidate_cache()
        try:
            found = system.ls(inside, detail=False)
        except FileNotFoundError:
            return []
    return sorted(name for path in found if (name := path.rpartition("/")[2]).endswith(ending))


def remove(path: str) -> None:
    """Remove a file, if it exists."""
    with _named(path):
        if is_remote(path):
            system, inside = filesystem(path)
            if system.exists(inside):
                system.rm_file(inside)
        else:
            Path(path).unlink(missing_ok=True)


def modified(path: str) -> float:
    """Time of the last change of a file, s since 1970."""
    with _named(path):
        if not is_remote(path):
            return Path(path).stat().st_mtime
        system, inside = filesystem(path)
        return float(system.modified(inside).timestamp())


@contextmanager
def _named(path: str) -> Iterator[None]:
    """Errors of a file system as errors that name the path."""
    try:
        yield
    except FifthwheelError:
        raise
    except OSError as error:
        reason = "no such file" if isinstance(error, FileNotFoundError) else (error.strerror or error)
        raise FifthwheelError(f"{path}: cannot be read or written ({reason}); check the path and its rights") from error
    except Exception as error:
        kinds = {kind.__module__.partition(".")[0] for kind in type(error).__mro__}
        if kinds & {"botocore", "aiobotocore", "s3fs", "gcsfs", "adlfs", "azure"}:
            raise FifthwheelError(
                f"{path}: the object store refuses ({error}); check the path and its rights"
            ) from None
        raise
