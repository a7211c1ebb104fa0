"""Files that appear complete or not at all, and folders of results that are replaced as a whole.

A run writes all results into the hidden folder `.fifthwheel/new` within the result folder. A journal, written
atomically, then decides that the new results count. After that each file is renamed into place, the manifest `run.json`
last. A process that is killed before the journal leaves the old results. One that is killed after it leaves the
journal, and whoever opens the folder next, a run or a reader, finishes the renaming.
"""

import hashlib
import json
import os
import platform
import secrets
import shutil
import sys
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any

from fifthwheel import __version__
from fifthwheel.base.errors import FifthwheelError
from fifthwheel.base.spelling import setting

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


_SUFFIX = ".part"
MANIFEST = "run.json"
"""Command, version, and the SHA-256 of every result by its path in the folder; present only if the results are
complete."""
_LOCK = ".fifthwheel.lock"
_WORK = ".fifthwheel"
_NEW = Path(_WORK, "new")
_JOURNAL = Path(_WORK, "commit.json")
_OTHER = "not a file"


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


_Journal = Mapping[str, Mapping[str, str | None]]
"""Under "replaces" the digest of what each new result may replace, under "removes" those of former results."""


@contextmanager
def result_folder(
    folder: Path, command: str, names: Iterable[str], *, inputs: Iterable[Path], force: bool
) -> Iterator[Path]:
    """A temporary folder to write results to; when the block ends without an error, they appear in `folder` as a whole.

    Results of an earlier run of the same command are replaced, and those that the new run does not write are removed.
    Other files stay. The folder is made if it is missing, and then removed if the block fails.

    Results whose `names`, paths in the folder, are known before the run are checked first. Without `force`, a
    FifthwheelError refuses to replace a file that an earlier run of the command did not write, that has changed since,
    or that is one of the `inputs`; also if another process writes to the folder. An OSError if a file cannot be
    written; `filename` is its name in `folder`.
    """
    inputs = [path for path in inputs if path.exists()]
    created = not folder.exists()
    with _named_in(folder), cleaned_up(lambda: _remove_empty(folder) if created else None):
        folder.mkdir(parents=True, exist_ok=True)
        with held(folder / _LOCK, subject=folder):
            _settle(folder)
            _check_replaced(folder, command, [*names, MANIFEST], inputs, force=force)
            with cleaned_up(lambda: _settle(folder)):
                (folder / _NEW).mkdir(parents=True)
                yield folder / _NEW
                _commit(folder, command, inputs, force=force)


@contextmanager
def replaced_result(path: Path) -> Iterator[Path]:
    """A temporary file that replaces one result of a folder, whose manifest then has its new digest.

    For a file that is no result of its folder it is this file itself. No result is replaced if the block fails.

    Raises:
        FifthwheelError: another process writes to the folder, or the result has changed since it was written.
        OSError: the file cannot be written.
    """
    folder = path.parent
    recover(folder)
    run = _manifest(folder)
    if run is None or path.name not in run["files"]:
        yield path
        return
    with _named_in(folder), held(folder / _LOCK, subject=folder):
        _settle(folder)
        run = _manifest(folder) or run
        if run["files"].get(path.name) != _digest(path):
            raise FifthwheelError(
                f"{path}: changed since fifthwheel {run['command']} wrote it, so it is not replaced; write to another "
                f"file with {setting('out')}"
            )
        with cleaned_up(lambda: _settle(folder)):
            (folder / _NEW).mkdir(parents=True)
            yield folder / _NEW / path.name
            files = {**run["files"], path.name: _digest(folder / _NEW / path.name)}
            write_json(folder / _NEW / MANIFEST, {**run, "files": files})
            _sync_folder(folder / _NEW)
            replaces = {path.name: run["files"].get(path.name)}
            write_json(folder / _JOURNAL, {"replaces": replaces, "removes": {}})
            _sync_folder(folder / _WORK)


def require_unused(folder: Path) -> None:
    """Refuse a folder that another process writes to, with a FifthwheelError."""
    with held(folder / _LOCK, subject=folder):
        pass


def recorded_digests(folder: Path) -> dict[str, str]:
    """The digest of every result of a folder by its path there; empty if the folder has no manifest."""
    recover(folder)
    run = _manifest(folder)
    return dict(run["files"]) if run else {}


def file_digest(path: Path) -> str:
    """SHA-256 of a file in hexadecimal."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def recover(folder: Path) -> None:
    """Finish putting the results of a killed run in place.

    A FifthwheelError if another process writes to the folder, or a file of it has changed since.
    """
    if (folder / _JOURNAL).exists():
        with _named_in(folder), held(folder / _LOCK, subject=folder):
            _settle(folder)


@contextmanager
def one_run(*paths: Path) -> Iterator[None]:
    """Read files in the block that must belong together: those of one result folder are of one run.

    Raises:
        FifthwheelError: a file has changed since the run that wrote it, or another run replaces it now.
    """
    folders = {path.parent for path in paths}
    for folder in folders:
        recover(folder)
    before = {folder: _manifest(folder) for folder in folders}
    yield
    for path in paths:
        folder, run = path.parent, before[path.parent]
        if run != _manifest(folder):
            raise FifthwheelError(f"{folder}: another run has replaced its results just now; run this command again")
        if run and run["files"].get(path.name, _digest(path)) != _digest(path):
            raise FifthwheelError(
                f"{path}: has changed since fifthwheel {run['command']} wrote it, so it does not belong to the other "
                f"results; copy it to another folder, or run fifthwheel {run['command']} again"
            )


def _commit(folder: Path, command: str, inputs: Collection[Path], *, force: bool) -> None:
    """Decide that the new results count: write their manifest and the journal."""
    files = _files(folder / _NEW)
    _check_replaced(folder, command, [*files, MANIFEST], inputs, force=force)
    earlier = _manifest(folder)
    unused = {name: digest for name, digest in (earlier["files"] if earlier else {}).items() if name not in files}
    journal = {
        "replaces": {name: _digest(folder / name) for name in files},
        "removes": {name: digest for name, digest in unused.items() if not _is_one_of(folder / name, inputs)},
    }
    write_json(folder / _NEW / MANIFEST, {"command": command, "version": __version__, "files": files})
    for path in (folder / _NEW).rglob("*"):
        if path.is_dir():
            _sync_folder(path)
    _sync_folder(folder / _NEW)
    write_json(folder / _JOURNAL, journal)
    _sync_folder(folder / _WORK)


def _settle(folder: Path) -> None:
    """Put results that count in place, and remove those that do not; may be repeated at any time."""
    if (folder / _JOURNAL).exists():
        _switch(folder, _read_journal(folder))
        (folder / _JOURNAL).unlink()
    if (folder / _WORK).exists():
        shutil.rmtree(folder / _WORK)


def _switch(folder: Path, journal: _Journal) -> None:
    """Rename the new results into place, the manifest last; those that are there already are skipped."""
    pending = _files(folder / _NEW)
    for name in pending.keys() - {MANIFEST}:
        _check_place(folder, name)
        if _digest(folder / name) not in (None, journal["replaces"][name]):
            raise FifthwheelError(
                f"{folder / name}: has changed since a run was killed that was about to replace it; move this file to "
                "another folder, then run the command again"
            )
    if MANIFEST in pending:
        (folder / MANIFEST).unlink(missing_ok=True)
        for name, digest in journal["removes"].items():
            if _digest(folder / name) == digest:
                (folder / name).unlink()
                for parent in _parents(name):
                    _remove_empty(folder / parent)
        for name in sorted(pending, key=lambda name: name == MANIFEST):
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / _NEW / name).replace(folder / name)
    _sync_folder(folder)


def _check_replaced(folder: Path, command: str, names: Iterable[str], inputs: Collection[Path], *, force: bool) -> None:
    """Refuse to replace what an earlier run of the command has not written, and what cannot be replaced at all."""
    earlier = _manifest(folder)
    if earlier and earlier["command"] != command and not force:
        raise FifthwheelError(
            f"{folder}: contains the results of fifthwheel {earlier['command']}; choose another folder with "
            f"{setting('out')}, or replace them with {setting('force')}"
        )
    known = {**earlier["files"], MANIFEST: _digest(folder / MANIFEST)} if earlier else {}
    for name in names:
        path = folder / name
        _check_place(folder, name)
        if force or (digest := _digest(path)) is None:
            continue
        if digest != known.get(name):
            raise FifthwheelError(
                f"{path}: not written by an earlier fifthwheel {command}, or changed since; choose another folder with "
                f"{setting('out')}, or replace it with {setting('force')}"
            )
        if _is_one_of(path, inputs):
            raise FifthwheelError(
                f"{path}: is an input of this command; choose another folder with {setting('out')}, or replace it with "
                f"{setting('force')}"
            )


def _check_place(folder: Path, name: str) -> None:
    """Refuse a name that a file cannot be renamed to, or that a link leads out of the folder."""
    for parent in (folder / parent for parent in _parents(name)):
        if os.path.lexists(parent) and (parent.is_symlink() or not parent.is_dir()):
            raise FifthwheelError(
                f"{parent}: expected a folder; move it away, or choose another one with {setting('out')}"
            )
    if (folder / name).is_dir():
        raise FifthwheelError(
            f"{folder / name}: is a folder; move it away, or choose another one with {setting('out')}"
        )


def _manifest(folder: Path) -> dict[str, Any] | None:
    """The manifest of a folder; None if it has none, or a file of that name from elsewhere."""
    content = _read_json(folder / MANIFEST)
    return content if "command" in content and _are_digests(content.get("files")) else None


def _read_journal(folder: Path) -> _Journal:
    """The journal of a run that was killed; the folder may come from elsewhere, so that nothing in it is trusted."""
    content = _read_json(folder / _JOURNAL)
    linked = any((folder / path).is_symlink() for path in (_WORK, _NEW, _JOURNAL))
    complete = all(_are_digests(content.get(key)) for key in ("replaces", "removes"))
    if linked or not complete or _files(folder / _NEW).keys() - {MANIFEST, *content["replaces"]}:
        raise FifthwheelError(f"{folder / _WORK}: damaged; remove this folder, then run the command again")
    return content


def _read_json(path: Path) -> dict[str, Any]:
    """The object in a JSON file; empty if there is none."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return content if isinstance(content, dict) else {}


def _are_digests(content: object) -> bool:
    """Whether this gives digests by the names of files within a folder."""
    paths = [Path(name) for name in content] if isinstance(content, dict) else [Path("..")]
    return not any(path.is_absolute() or ".." in path.parts for path in paths)


def _parents(name: str) -> list[Path]:
    """The folders of a file within the result folder, innermost first."""
    return [*Path(name).parents][:-1]


def _files(folder: Path) -> dict[str, str]:
    """The digest of every file in a folder, by its path there."""
    paths = [path for path in sorted(folder.rglob("*")) if path.is_file()]
    return {path.relative_to(folder).as_posix(): str(_digest(path)) for path in paths}


def _digest(path: Path) -> str | None:
    """SHA-256 of a file; None if nothing has this name."""
    if not path.is_file():
        return _OTHER if os.path.lexists(path) else None
    return file_digest(path)


def _is_one_of(path: Path, inputs: Iterable[Path]) -> bool:
    return any(path.exists() and path.samefile(file) for file in inputs)


def _remove_empty(folder: Path) -> None:
    with suppress(OSError):  # not empty, or never made
        folder.rmdir()


def _sync_folder(folder: Path) -> None:
    """Make the names in a folder durable; Windows has no such call."""
    if os.name == "posix":
        file = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(file)
        finally:
            os.close(file)


@contextmanager
def _named_in(folder: Path) -> Iterator[None]:
    """Name the file of an error as it would have been called in the folder, and not in the temporary one."""
    try:
        yield
    except OSError as error:
        if error.errno is None:
            raise
        path = Path(error.filename or folder)
        if path.is_relative_to(folder / _NEW):
            path = folder / path.relative_to(folder / _NEW)
        elif path.is_relative_to(folder / _WORK) or path.name == _LOCK:
            path = folder
        raise OSError(error.errno, error.strerror, str(path)) from error
