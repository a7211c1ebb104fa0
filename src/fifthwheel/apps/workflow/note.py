"""What a user notes on an identification; identification.json keeps it."""

import datetime
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

from fifthwheel.base.errors import FifthwheelError
from fifthwheel.base.input_files import read_json
from fifthwheel.base.options import IdentifyOptions


@dataclass(frozen=True, kw_only=True)
class Note:
    """A description of a test, who wrote it, and the day, as texts."""

    text: str = ""
    author: str = ""
    date: str = ""
    """ISO 8601: 2026-11-26."""

    @classmethod
    def of(cls, chosen: IdentifyOptions) -> Self | None:
        """The note of an identification of today; None without a description and an author."""
        if not (chosen.note or chosen.author):
            return None
        today = datetime.datetime.now().astimezone().date()
        return cls(text=chosen.note or "", author=chosen.author or "", date=today.isoformat())

    @classmethod
    def read(cls, identification: Path) -> Self | None:
        """The note in an identification.json; None if there is none, or the file cannot be read."""
        try:
            contents = read_json(identification)
        except FifthwheelError:
            return None
        kept: Any = contents.get("note") if isinstance(contents, Mapping) else None
        if not isinstance(kept, Mapping):
            return None
        return cls(**{key: str(kept.get(key, "")) for key in ("text", "author", "date")})

    def __str__(self) -> str:
        origin = ", ".join(filter(None, (self.author, self.date)))
        return f"{self.text} ({origin})" if self.text else origin
