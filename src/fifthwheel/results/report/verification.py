"""Whether the files of a result, and those that it was made from, are still the same."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Literal

from fifthwheel.base import pages
from fifthwheel.base.atomic import MANIFEST, file_digest, recorded_digests
from fifthwheel.base.errors import FifthwheelError
from fifthwheel.base.formatting import enumerated
from fifthwheel.base.spelling import setting
from fifthwheel.results.report.provenance import Provenance
from fifthwheel.results.report.words import counted

State = Literal["same", "differs", "missing", "replaced"]


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
