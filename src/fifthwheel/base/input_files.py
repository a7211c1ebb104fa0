"""Input files that others may have written: regular files of limited size, TOML and JSON of limited depth.

`FileKind` is for JSON files of our own with a format, a version and a checksum, written completely or not at all.
"""

import hashlib
import json
import re
import stat
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fifthwheel.base.atomic import write_text
from fifthwheel.base.errors import FifthwheelError, SignalError
from fifthwheel.base.spelling import setting

MAX_TOML_SIZE = 256_000
"""Bytes of a vehicle file, a signal map or a file of sensors."""
MAX_TOML_LINE = 4000
"""Characters of a line of TOML."""
MAX_JSON_SIZE = 50_000_000
"""Bytes of a stored identification or learner."""
MAX_DEPTH = 32
"""Levels of tables and arrays, and parts of a dotted key, which is parsed in a time of the square of its parts."""
_QUOTED = re.compile(r'"(?:[^"\\]|\\.)*"|\'[^\']*\'|#.*')
"""Strings and comments of a line."""
_BETWEEN_KEYS = re.compile(r"[=,{}\[\]]")


def require_regular(path: Path) -> None:
    """Refuse a device, a FIFO or a folder; a link to a regular file is one.

    Raises:
        FifthwheelError: not a regular file, or it does not exist.
    """
    try:
        regular = stat.S_ISREG(path.stat().st_mode)
    except (OSError, ValueError) as error:  # a null byte in a path is a ValueError
        raise FifthwheelError(
            f"{path}: cannot be read ({getattr(error, 'strerror', None) or error}); check the path"
        ) from error
    if not regular:
        raise FifthwheelError(f"{path}: cannot be read, it is not a regular file; give the path of a file")


def require_inside(path: Path, folder: Path) -> None:
    """Refuse a file that another file names and that is not in its folder or below, also behind a link.

    Raises:
        FifthwheelError: the path leads out of the folder.
    """
    try:
        inside = path.resolve().is_relative_to(folder.resolve())
    except (OSError, ValueError, RuntimeError):  # a null byte, or a circle of links
        inside = False
    if not inside:
        allowed = setting("allow_outside")
        cure = f", or allow it if you trust that file ({allowed})" if allowed else ""
        raise FifthwheelError(f"{path}: outside of the folder of the file that names it; copy it there{cure}")


def read_toml(path: Path) -> str:
    """The text of a TOML file; errors as in `require_regular`, and for more than `MAX_TOML_SIZE` bytes."""
    return _read_text(path, MAX_TOML_SIZE)


def read_json(path: Path) -> Any:
    """The content of a JSON file; errors as in `require_regular`, for no JSON, or more than `MAX_JSON_SIZE` bytes."""
    text = _read_text(path, MAX_JSON_SIZE)
    try:
        return _checked(json.loads(text))
    except (ValueError, RecursionError) as error:
        raise FifthwheelError(f"{path}: not a JSON file, or damaged ({_reason(error)})") from None


def parse_toml(text: str) -> dict[str, Any]:
    """The table in a TOML text.

    Raises:
        FifthwheelError: not TOML, nested too deeply, or with a number that is no 64-bit integer; the message is the
            reason alone.
    """
    for number, line in enumerate(text.split("\n"), 1):
        if len(line) > MAX_TOML_LINE:
            raise FifthwheelError(f"line {number} has {len(line)} characters, at most {MAX_TOML_LINE} expected")
        if any(part.count(".") >= MAX_DEPTH for part in _BETWEEN_KEYS.split(_QUOTED.sub("", line))):
            raise FifthwheelError(f"line {number} has a key nested deeper than {MAX_DEPTH} levels")
    try:
        table: dict[str, Any] = _checked(tomllib.loads(text))
    except (ValueError, RecursionError) as error:
        raise FifthwheelError(_reason(error)) from None
    return table


def flat_tables(tables: Mapping[str, Any]) -> dict[str, Any]:
    """Tables by dotted name: TOML reads the header [yaw_rate.tractor] without quotes as a table in a table."""
    flat: dict[str, Any] = {}
    for name, table in tables.items():
        if isinstance(table, Mapping) and table and all(isinstance(inner, Mapping) for inner in table.values()):
            flat |= {f"{name}.{inner}": entry for inner, entry in flat_tables(table).items()}
        else:
            flat[name] = table
    return flat


def _read_text(path: Path, max_size: int) -> str:
    require_regular(path)
    try:
        with path.open("rb") as file:
            data = file.read(max_size + 1)
        if len(data) > max_size:
            raise FifthwheelError(f"{path}: cannot be read, it is larger than {max_size / 1e6:g} MB; check the path")
        return data.decode("utf-8").replace("\r\n", "\n").replace("\r", "\n")
    except (OSError, UnicodeDecodeError) as error:
        raise FifthwheelError(f"{path}: cannot be read ({error}); text in UTF-8 expected, check the path") from error


def _checked(document: Any) -> Any:
    """A document whose depth and integers are within limits."""
    level = [document]
    for _ in range(MAX_DEPTH):
        if any(isinstance(value, int) and not -(2**63) <= value < 2**63 for value in level):
            raise FifthwheelError("an integer has more than 64 bits")
        inner = [
            value.values() if isinstance(value, dict) else value for value in level if isinstance(value, dict | list)
        ]
        level = [value for values in inner for value in values]
    if level:
        raise FifthwheelError(f"nested deeper than {MAX_DEPTH} levels")
    return document


def _reason(error: Exception) -> str:
    """Why a parser refuses a text."""
    if isinstance(error, RecursionError):
        return f"nested deeper than {MAX_DEPTH} levels"
    if "integer string conversion" in str(error):
        return "an integer has more than 64 bits"
    return str(error)


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
