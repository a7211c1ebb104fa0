"""The origin of a result: its logs, and what reproduces it, command, files and versions; whether these are the same."""

import platform
import shlex
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field, replace
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path
from typing import Any, Literal, Self

from pydantic import TypeAdapter, ValidationError

import fifthwheel
from fifthwheel.base import pages
from fifthwheel.base.atomic import MANIFEST, file_digest, recorded_digests
from fifthwheel.base.errors import FifthwheelError
from fifthwheel.base.formatting import enumerated, fixed, kmh, percent, seconds
from fifthwheel.base.input_files import read_json
from fifthwheel.base.spelling import setting
from fifthwheel.data.record import Record
from fifthwheel.estimate.identify import Identification
from fifthwheel.results.diagnose.summaries import RunSummary
from fifthwheel.results.report.conclusion import counted

LOGS = (
    *("Log|name", "Use|w", "Span, s>", "Samples>", "Used>", "Speed>", "Lateral acc., m/s²>"),
    "Most rejected||Most rejected: ",
)
FILES = ("File|name", "Bytes>", "SHA-256|full hash")
PACKAGES = (
    *("numpy", "scipy", "casadi", "llvmlite", "pyarrow", "asammdf", "python-can", "cantools", "h5py", "mcap"),
    *("npTDMS", "pyulog", "python-calamine"),
)
"""The packages that the numbers depend on."""
State = Literal["same", "differs", "missing", "replaced"]


@dataclass(frozen=True, kw_only=True)
class FileUsed:
    """A file that was read."""

    path: str  # as given
    size: int  # bytes
    sha256: str

    def row(self) -> tuple[pages.Cell, ...]:
        """Of a table with the heads `FILES`."""
        return pages.Code(self.path), fixed(self.size, 0), pages.Code(self.sha256)


@dataclass(frozen=True, kw_only=True)
class Provenance:
    """The origin of a result."""

    note: str = ""  # of the user: who, where, what was driven
    command: str = ""  # as typed, quoted for a shell; empty for a result from Python
    time: str = ""  # UTC
    versions: Mapping[str, str] = field(default_factory=dict)
    files: tuple[FileUsed, ...] = ()
    texts: Mapping[str, str] = field(default_factory=dict)  # text of the vehicle file and of the signal map, by name

    def as_dict(self) -> dict[str, Any]:
        """Command, time, versions and files: what a JSON file of results keeps."""
        return {key: value for key, value in asdict(self).items() if key not in ("note", "texts")}

    @classmethod
    def read(cls, path: Path) -> Self | None:
        """The provenance in a JSON file of results; None if it has none, or a FifthwheelError if it is damaged."""
        contents = read_json(path)
        kept = contents.get("provenance") if isinstance(contents, Mapping) else None
        if kept is None:
            return None
        try:
            return TypeAdapter(cls).validate_python(kept)
        except ValidationError as error:
            reason = error.errors()[0]["msg"]
            raise FifthwheelError(f"{path}: provenance: damaged ({reason}); run its command again") from None

    def blocks(self) -> Iterator[pages.Block]:
        """How to reproduce the result."""
        yield pages.Heading("Reproduce this result")
        if self.command:
            yield pages.Verbatim(self.command)
        when = f"Run at {self.time}, with " if self.time else "With "
        yield pages.Paragraph(f"{when}{', '.join(f'{name} {version}' for name, version in self.versions.items())}.")
        if self.files:
            yield pages.Table(FILES, [file.row() for file in self.files])
        for name, text in self.texts.items():
            yield pages.Folded(name, [pages.Verbatim(text)])


def gather_provenance(
    files: Sequence[Path], texts: Mapping[str, str] | None = None, command: Sequence[str] = ()
) -> Provenance:
    """The provenance of a result.

    Args:
        files: all files and folders that were read; of a result, those from which it was made are added.
        texts: files that are short enough to be shown, by name.
        command: its arguments.
    """
    return Provenance(
        command=shlex.join(["fifthwheel", *command]) if command else "",
        time=datetime.now(UTC).strftime("%Y-%m-%d %H:%M:%S UTC"),
        versions=versions(),
        files=tuple(dict.fromkeys(file for path in files for file in _used_files(Path(path)))),
        texts=dict(texts or {}),
    )


def provenance_of_run(
    logs: Sequence[Path], vehicle: str, signals: Path | None = None, *others: Path | None, command: Sequence[str] = ()
) -> Provenance:
    """The provenance of a command.

    Args:
        vehicle: the vehicle file, or the name of a vehicle of the catalogue.
        signals: the signal map; the databases that it names are included.
        others: other files that were read.
    """
    from fifthwheel.data.logs import SignalMap
    from fifthwheel.truck import catalogue

    databases = SignalMap.load(signals, allow_outside=True).databases if signals else ()  # they have been read
    in_catalogue = vehicle in catalogue.names()
    shown = [path for path in (None if in_catalogue else Path(vehicle), signals) if path is not None]
    texts = {f"{vehicle} (catalogue)": catalogue.text(vehicle)} if in_catalogue else {}
    texts |= {str(path): path.read_text(encoding="utf-8", errors="replace") for path in shown}
    files = [*logs, *shown, *databases, *[path for path in others if path is not None]]
    return gather_provenance(files, texts, command)


def versions() -> dict[str, str]:
    """Versions of fifthwheel, Python and the packages that the numbers depend on, and the platform."""
    installed = {"fifthwheel": fifthwheel.__version__, "Python": platform.python_version()}
    for name in PACKAGES:
        with suppress(metadata.PackageNotFoundError):
            installed[name] = metadata.version(name)
    return installed | {"platform": platform.platform(), "byte order": sys.byteorder}


def _used_files(path: Path) -> list[FileUsed]:
    """A file, or all files of a folder, and what a result was made from; nothing for a path that does not exist."""
    if path.is_dir():
        return [file for inner in sorted(path.rglob("*")) if inner.is_file() for file in _used_files(inner)]
    if not path.is_file():
        return []
    earlier = None
    if path.suffix == ".json":
        with suppress(FifthwheelError):  # whoever reads the result has refused a damaged one
            earlier = Provenance.read(path)
    own = FileUsed(path=str(path), size=path.stat().st_size, sha256=file_digest(path))
    return [own, *(earlier.files if earlier else ())]


def logs_and_origin(
    records: Sequence[Record],
    runs: Sequence[RunSummary],
    provenance: Provenance | None,
    identification: Identification | None = None,
) -> Iterator[pages.Block]:
    """How each log was driven, what an identification used of it, and how to reproduce the result."""
    yield pages.Heading("Logs and how to reproduce the result", key="logs")
    yield pages.Hint("Lateral acceleration: largest magnitude of speed × yaw rate, averaged over 0.5 s.")
    yield _table(records, runs, identification)
    if provenance is not None:
        yield from provenance.blocks()


def _table(records: Sequence[Record], runs: Sequence[RunSummary], identification: Identification | None) -> pages.Table:
    summaries = {log.name: log for log in identification.logs} if identification else {}
    spans = {record.name: (record.span, len(record)) for record in records}
    spans |= {name: (log.span, log.samples) for name, log in summaries.items()}
    by_name = {run.name: run for run in runs}
    rows = []
    for name in dict.fromkeys([*summaries, *spans]):
        (first, last), samples = spans[name]
        log, run = summaries.get(name), by_name[name]
        channel, rejected = max(log.rejected.items() if log else (), key=lambda item: item[1], default=("", 0.0))
        worst = f"{percent(rejected)} of {channel}" if rejected else "none"
        cells = (
            name,
            "identification" if log else "validation" if identification else "states",
            f"{first:.1f} to {last:.1f}",
            fixed(samples, 0) + (f", means of {log.averaged}" if log and log.averaged > 1 else ""),
            seconds(log.used) if log else "–",
            kmh(log.speed if log else run.speed),
            "–" if run.acceleration != run.acceleration else f"{run.acceleration:.2f}",
            worst if log else "–",
        )
        rows.append(cells if identification else cells[:-1])
    return pages.Table(LOGS if identification else LOGS[:-1], rows)


@dataclass(frozen=True, kw_only=True)
class VerifiedFile:
    """A file of a result, or one that it was made from."""

    path: str
    """As recorded."""
    sha256: str
    """As recorded."""
    state: State
    """ "replaced": an input in whose place a newer file of this result or of its inputs is now."""


@dataclass(frozen=True, kw_only=True)
class Verification:
    """The files that belong to a result, each compared with its recorded digest."""

    result: str
    files: tuple[VerifiedFile, ...]
    has_inputs: bool
    """Whether the files that it was made from are recorded."""

    @property
    def is_intact(self) -> bool:
        """Whether no file differs or is missing."""
        return not self.failed

    @property
    def failed(self) -> list[VerifiedFile]:
        """The files that differ or are missing."""
        return [file for file in self.files if file.state in ("differs", "missing")]

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {"result": self.result, "intact": self.is_intact, "files": [asdict(file) for file in self.files]}

    def document(self) -> pages.Document:
        """The state of each file, below the ones that failed."""
        failed = [f"{f.path} {'differs' if f.state == 'differs' else 'is missing'}" for f in self.failed]
        words = enumerated(failed) if failed else f"{counted(len(self.files), 'file')} as recorded"
        table = pages.Table(("File|name", "State"), [(pages.Code(file.path), file.state) for file in self.files])
        folder = setting("folders", "FOLDER")
        hint = f"A path is relative to the current folder. Give the folder of a missing file: {folder}."
        hints = [pages.Hint(hint)] if any(file.state == "missing" for file in self.files) else []
        if not self.has_inputs and self.is_intact:
            hints.append(pages.Hint("The result does not record the files that it was made from."))
        return pages.Document(self.result, [pages.Headline(f"{self.result}: {words}.", self.is_intact), table, *hints])


def verify(result: Path, folders: Sequence[Path] = ()) -> Verification:
    """Compare the files of a result, and those that it was made from, with the recorded digests.

    Args:
        result: a result folder, whose run.json has the digests of its files; or one JSON file of a result, which has
            those of the files that it was made from.
        folders: where such a file is too, by its recorded path or by its name.

    Raises:
        FifthwheelError: the folder or file has no digests, or cannot be read.
    """
    folder = result if result.is_dir() else result.parent
    own = recorded_digests(folder)
    if not result.is_dir():
        own = {name: digest for name, digest in own.items() if name == result.name}
    elif not own:
        lacks = f"{MANIFEST} in it is damaged" if (folder / MANIFEST).exists() else f"no {MANIFEST} in it"
        raise FifthwheelError(f"{result}: {lacks}; give a result folder, or a JSON file of a result")
    documents = [folder / name for name in own if name.endswith(".json")] if result.is_dir() else [result]
    origins = [
        _origin(path, own.get(path.relative_to(folder).as_posix()))
        for path in documents
        if path.is_file() or path == result
    ]
    inputs = dict.fromkeys((file.path, file.sha256) for origin in origins if origin for file in origin.files)
    if not (own or inputs):
        raise FifthwheelError(f"{result}: has no digests; give a result folder, or a JSON file of a result")
    newer = {(folder / name).resolve() for name in own}
    files = [_compared(str(folder / name), digest, [folder / name]) for name, digest in own.items()]
    for path, digest in inputs:
        places = [Path(path), *(place for other in folders for place in (other / path, other / Path(path).name))]
        file = _compared(path, digest, places)
        if file.state == "differs" and Path(path).resolve() in newer:
            file = replace(file, state="replaced")
        newer.add(Path(path).resolve())
        files.append(file)
    return Verification(result=str(result), files=tuple(files), has_inputs=bool(inputs))


def _origin(path: Path, digest: str | None) -> Provenance | None:
    """The provenance in a JSON file; None of a damaged one that differs from its recorded digest, which says enough."""
    try:
        return Provenance.read(path)
    except FifthwheelError:
        if digest is None or not path.is_file() or file_digest(path) == digest:
            raise
        return None


def _compared(path: str, digest: str, places: Sequence[Path]) -> VerifiedFile:
    """A recorded file, at the first of its places that has it unchanged."""
    found = [file_digest(place) for place in places if place.is_file()]
    state: State = "same" if digest in found else "differs" if found else "missing"
    return VerifiedFile(path=path, sha256=digest, state=state)
