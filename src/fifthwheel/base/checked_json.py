"""JSON files with a format, a version and a checksum, which are written completely or not at all."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fifthwheel.base.atomic import write_text
from fifthwheel.base.errors import FifthwheelError, SignalError
from fifthwheel.base.input_files import read_json


@dataclass(frozen=True, kw_only=True)
class FileKind:
    """A kind of files, such as "fifthwheel learner 3"."""

    kind: str
    version: int
    title: str
    """What a file is, such as "a learner"."""
    writer: str
    """What writes one, such as "Learner.save"."""
    renew: str
    """What to do with a file of another version."""

    def write(self, path: str | Path, content: Mapping[str, Any]) -> None:
        """Write the content to a file."""
        document = {"format": f"{self.kind} {self.version}", "digest": _digest(content), "content": content}
        text = json.dumps(document, allow_nan=False)
        write_text(path, text + "\n")

    def wrote(self, path: str | Path) -> bool:
        """Whether a file says that it is of this kind."""
        try:
            document = read_json(Path(path))
        except FifthwheelError:
            return False
        return isinstance(document, dict) and str(document.get("format")).rpartition(" ")[0] == self.kind

    def read(self, path: str | Path) -> dict[str, Any]:
        """The content that `write` wrote.

        Raises:
            SignalError: the file cannot be read, is damaged, of another format or of another version of it.
        """
        try:
            document = read_json(Path(path))
        except FifthwheelError as error:
            raise SignalError(f"{error}; give a file that {self.writer} wrote") from None
        found = document.get("format") if isinstance(document, dict) else None
        kind, _, version = str(found).rpartition(" ")
        if kind != self.kind:
            raise SignalError(f"{path}: not a file of {self.title}; give a file that {self.writer} wrote")
        if version != str(self.version):
            raise SignalError(
                f"{path}: has format {version} of another version of fifthwheel, expected format {self.version}; "
                f"{self.renew}, or load it with the version that wrote it"
            )
        content = document.get("content")
        if not _is_intact(content, document.get("digest")):
            raise SignalError(f"{path}: damaged, its content does not match its checksum; restore an older copy")
        return dict(content)


def _is_intact(content: Any, digest: Any) -> bool:
    """Whether content has this digest; it does not with a number that is not finite, which `write` refuses."""
    try:
        return isinstance(content, dict) and digest == _digest(content)
    except ValueError:
        return False


def _digest(content: Mapping[str, Any]) -> str:
    return hashlib.sha256(json.dumps(content, sort_keys=True, allow_nan=False).encode()).hexdigest()
