"""Where a result comes from, told so that it can be had again: the command, the files, the versions."""

import hashlib
import platform
import shlex
import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path
from typing import Any

import fifthwheel

PACKAGES = ("numpy", "scipy", "casadi", "llvmlite", "pyarrow", "cantools", "h5py", "mcap")
"""On which the numbers depend."""
BLOCK = 1 << 20


@dataclass(frozen=True, kw_only=True)
class FileUsed:
    """A file as it was read."""

    path: str  # as it was given
    size: int  # bytes
    sha256: str


@dataclass(frozen=True, kw_only=True)
class Provenance:
    """What a result was made from."""

    command: str = ""
    """As it was typed, quoted for a shell; empty where there was none."""
    time: str = ""
    """UTC."""
    versions: Mapping[str, str] = field(default_factory=dict)
    files: tuple[FileUsed, ...] = ()
    texts: Mapping[str, str] = field(default_factory=dict)
    """The vehicle file and the signal map, by name, word for word."""

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return asdict(self)


def gather(files: Sequence[Path], texts: Mapping[str, str] | None = None, command: Sequence[str] = ()) -> Provenance:
    """What there is to tell of this run.

    Args:
        files: all that was read.
        texts: what is short enough to be shown whole.
        command: its arguments.
    """
    return Provenance(
        command=shlex.join(["fifthwheel", *command]) if command else "",
        time=datetime.now(UTC).strftime("%Y-%m-%d %H:%M:%S UTC"),
        versions=versions(),
        files=tuple(one for path in files for one in _used(Path(path))),
        texts=dict(texts or {}),
    )


def of_run(
    logs: Sequence[Path],
    vehicle: str,
    signals: Path | None = None,
    *others: Path | None,
    command: Sequence[str] = (),
) -> Provenance:
    """What there is to tell of a command.

    Args:
        vehicle: the truck's file, or its name in the catalogue.
        signals: the signal map; the databases that it names were read, too.
        others: what else was read.
    """
    from fifthwheel.logs import SignalMap
    from fifthwheel.vehicle import catalogue

    databases = SignalMap.load(signals).databases if signals else ()
    shipped = vehicle in catalogue.names()
    small = [path for path in (None if shipped else Path(vehicle), signals) if path is not None]
    texts = {f"{vehicle}, of the catalogue": catalogue.text(vehicle)} if shipped else {}
    texts |= {str(path): path.read_text(encoding="utf-8", errors="replace") for path in small}
    return gather([*logs, *small, *databases, *[path for path in others if path is not None]], texts, command)


def versions() -> dict[str, str]:
    """Of fifthwheel, Python, what the numbers depend on, and the machine."""
    found = {"fifthwheel": fifthwheel.__version__, "Python": platform.python_version()}
    for name in PACKAGES:
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            continue
    return found | {"platform": platform.platform(), "byte order": sys.byteorder}


def _used(path: Path) -> list[FileUsed]:
    """A file, or all files of a folder."""
    if path.is_dir():
        return [one for inner in sorted(path.rglob("*")) if inner.is_file() for one in _used(inner)]
    if not path.is_file():
        return []
    digest, size = hashlib.sha256(), 0
    with path.open("rb") as stream:
        while block := stream.read(BLOCK):
            digest.update(block)
            size += len(block)
    return [FileUsed(path=str(path), size=size, sha256=digest.hexdigest())]
