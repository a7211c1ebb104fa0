"""The folder of a workbench: its files, and their versions for undo. Two tabs do not overwrite each other."""

import hashlib
import json
import os
import shutil
import tempfile
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import tomli_w
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from fifthwheel.base.atomic import held, require_unused, write_text
from fifthwheel.base.errors import FifthwheelError, printable
from fifthwheel.base.input_files import parse_toml, read_json, read_toml
from fifthwheel.data.logs import SignalMap
from fifthwheel.truck import Vehicle

SIGNALS, VEHICLE, CHOICES = "signals.toml", "vehicle.toml", "workspace.toml"
DOCUMENTS = (SIGNALS, VEHICLE, CHOICES)
"""Files that a user changes in the pages; each change can be undone."""
DATABASES = (".dbc", ".arxml")
"""Endings of files that decode CAN frames."""
HIDDEN = ".workbench"
"""Folder of what the workbench needs besides the user's files."""
MAX_CHANGES = 100
"""Changes that can be undone."""
MAX_NAME = 180
"""Bytes of the name of a dropped file; file systems allow 255."""
ABANDONED = 3600.0
"""After this time without a write, s, what has arrived of a file is left by a killed process."""


class StaleError(FifthwheelError):
    """The files have changed since this tab has read them."""


class LogChoice(BaseModel):
    """What is used of a log."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    use: bool = True
    exclude: tuple[tuple[float, float], ...] = ()
    """Windows that are left out: first and last instant by the timestamps of the log, s."""
    time: str | None = None
    """The column with the time of the rows, where it does not have the name of a time."""


class Choices(BaseModel):
    """The contents of workspace.toml."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    logs: dict[str, LogChoice] = Field(default_factory=dict)
    """By name of the log."""
    identify: dict[str, Any] = Field(default_factory=dict)
    """Settings of the identification, by option of the command line."""
    truck: dict[str, str] = Field(default_factory=dict)
    """Answers that describe the truck, by key of the question."""
    explore: dict[str, Any] = Field(default_factory=dict)
    """What the page Explore shows: "log", "speed", and "values" by path of a parameter, SI."""

    def text(self) -> str:
        return tomli_w.dumps(self.model_dump(mode="json", exclude_defaults=True))

    def of(self, log: str) -> LogChoice:
        """The choice for a log."""
        return self.logs.get(log, LogChoice())

    def with_log(self, log: str, **changes: Any) -> "Choices":
        """The choices with those of one log changed."""
        return self.model_copy(update={"logs": {**self.logs, log: self.of(log).model_copy(update=changes)}})


class Workspace:
    """The files of a workbench, as one tab sees them; the folder is made if it is missing."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder.resolve()
        for name in ("logs", "databases", "runs", HIDDEN):
            (self.folder / name).mkdir(parents=True, exist_ok=True)
        self._complete()
        self.seen = self._stamp()
        """Stamp of the state that this tab shows."""

    # Files that are dropped

    def logs(self) -> list[Path]:
        return _files(self.folder / "logs")

    def databases(self) -> list[Path]:
        return _files(self.folder / "databases")

    def log(self, name: str) -> Path:
        """The log of this name; FifthwheelError where the workspace has none."""
        return _named(name, self.logs(), "log")

    def place_for(self, name: str) -> Path:
        """A path for a dropped file that does not exist yet; databases have a folder of their own.

        Of the name, as the browser gives it, only the last part is used.
        """
        plain = printable(name.replace("\\", "/").rpartition("/")[2]).strip().lstrip(".")
        plain = plain.encode()[-MAX_NAME:].decode(errors="ignore")
        if not plain:
            raise FifthwheelError("the file has no name; rename it, then drop it again")
        path = self.folder / ("databases" if Path(plain).suffix.lower() in DATABASES else "logs") / plain
        count = 1
        while path.exists():
            count += 1
            path = path.with_name(f"{Path(plain).stem} ({count}){Path(plain).suffix}")
        return path

    def part(self) -> Path:
        """A new file for what has arrived of a dropped one; `discard_parts` removes those of a killed process."""
        descriptor, path = tempfile.mkstemp(suffix=".part", dir=self.uploads)
        os.close(descriptor)
        return Path(path)

    def keep(self, part: Path, name: str) -> Path:
        """Move a dropped file that has arrived to its place; of several with one name each has a place of its own."""
        while True:
            path = self.place_for(name)
            try:
                path.open("xb").close()
            except FileExistsError:
                continue  # another one was faster
            part.replace(path)
            return path

    @property
    def uploads(self) -> Path:
        """Folder of files that arrive."""
        folder = self.folder / HIDDEN / "uploads"
        folder.mkdir(parents=True, exist_ok=True)
        return folder

    def discard_parts(self) -> None:
        """Remove what a killed process left of files that arrived: nothing has been written to it for an hour."""
        for part in self.uploads.iterdir():
            with suppress(OSError):
                if time.time() - part.stat().st_mtime > ABANDONED:
                    part.unlink()

    def require_space(self, size: int) -> None:
        """Refuse a file of this size, bytes, if the disk has less than three times of it; samples are stored too."""
        free = shutil.disk_usage(self.folder).free
        if free < 3 * size:
            raise FifthwheelError(
                f"{self.folder}: {free / 1e9:.1f} GB free, {3 * size / 1e9:.1f} GB needed; delete other files"
            )

    def remove_log(self, name: str) -> None:
        """Remove a log and what is stored of it."""
        self.log(name).unlink()
        for stored in (self.folder / HIDDEN).glob("logs/*"):
            if stored.name.rpartition("-")[0] == name:
                shutil.rmtree(stored, ignore_errors=True)

    # Results

    def runs(self) -> list[Path]:
        """Result folders, the newest first."""
        folders = [path for path in (self.folder / "runs").iterdir() if path.is_dir() and not path.name.startswith(".")]
        return sorted(folders, key=lambda path: path.stat().st_mtime, reverse=True)

    def run(self, name: str) -> Path:
        """The result folder of this name; FifthwheelError where the workspace has none."""
        return _named(name, self.runs(), "run")

    def remove_run(self, name: str) -> None:
        """Remove a result folder; FifthwheelError where the workspace has none, or an identification writes to it."""
        folder = self.run(name)
        require_unused(folder)
        shutil.rmtree(folder)

    def rename_run(self, name: str, new: str) -> None:
        """Give a result folder another name; FifthwheelError as `remove_run`, and where the name is taken."""
        folder = self.run(name)
        require_unused(folder)
        if folder.with_name(new).exists():
            raise FifthwheelError(f"{printable(new)}: there is a run of this name already; choose another one")
        folder.rename(folder.with_name(new))

    # Documents

    def read(self, name: str) -> str | None:
        """The text of a document, or None."""
        assert name in DOCUMENTS
        path = self.folder / name
        return read_toml(path) if path.exists() else None

    def choices(self) -> Choices:
        """The choices; FifthwheelError for a workspace.toml that is not accepted."""
        text = self.read(CHOICES)
        try:
            return Choices.model_validate(parse_toml(text)) if text else Choices()
        except ValidationError as error:
            first = error.errors()[0]
            where = ".".join(map(str, first["loc"]))
            raise FifthwheelError(f"{CHOICES}: {where}: {first['msg']}; correct or delete it") from None

    def signal_map(self) -> SignalMap:
        """The signal map, empty where there is no file; SignalError where it is not accepted."""
        return SignalMap.load(self.folder / SIGNALS) if (self.folder / SIGNALS).exists() else SignalMap()

    def vehicle(self) -> Vehicle | None:
        """The vehicle, or None; VehicleError where the file is not accepted."""
        return Vehicle.load(self.folder / VEHICLE) if (self.folder / VEHICLE).exists() else None

    def write_choices(self, choices: Choices, label: str) -> None:
        """Write the choices as `write` does."""
        self.write({CHOICES: choices.text()}, label)

    def write(self, documents: Mapping[str, str | None], label: str) -> None:
        """Write documents, the text by name or None to remove it, so that the change can be undone.

        The label says what the change does, such as "exclude 3 to 5 s". A StaleError if another tab or program has
        changed the documents since this tab has read them.
        """
        with self._changing() as state:
            files = {name: [self.read(name), text] for name, text in documents.items()}
            changes = state["changes"][: state["position"]][1 - MAX_CHANGES :]
            state |= {"changes": [*changes, {"label": label, "files": files}], "position": len(changes) + 1}
            self._apply(state, documents)

    def undo(self) -> str | None:
        """Undo the last change; its label, or None where there is none. Errors as in `write`."""
        return self._step(-1)

    def redo(self) -> str | None:
        """Repeat the change that was undone last; its label, or None. Errors as in `write`."""
        return self._step(1)

    def undoable(self) -> tuple[str | None, str | None]:
        """Labels of the changes that `undo` and `redo` would concern."""
        state = self._state()
        changes, position = state["changes"], state["position"]
        return (
            changes[position - 1]["label"] if position > 0 else None,
            changes[position]["label"] if position < len(changes) else None,
        )

    @property
    def stale(self) -> bool:
        """Whether the documents are not those any more that this tab shows."""
        return self._stamp() != self.seen

    def _step(self, direction: int) -> str | None:
        with self._changing() as state:
            position = state["position"] + min(direction, 0)
            if not 0 <= position < len(state["changes"]):
                return None
            change = state["changes"][position]
            before, after = (0, 1) if direction > 0 else (1, 0)
            for name, texts in change["files"].items():
                if self.read(name) != texts[before]:
                    raise FifthwheelError(
                        f"{name}: changed by another program since {change['label']!r}; undo it there"
                    )
            state["position"] += direction
            self._apply(state, {name: texts[after] for name, texts in change["files"].items()})
            return str(change["label"])

    def _apply(self, state: dict[str, Any], documents: Mapping[str, str | None]) -> None:
        """Write the state, with which the next process completes a change that is killed, then the documents."""
        state |= {"version": state["version"] + 1, "pending": dict(documents)}
        write_text(self._state_file, json.dumps(state))
        self._finish(state)
        self.seen = self._stamp()

    def _finish(self, state: dict[str, Any]) -> None:
        for name, text in state["pending"].items():
            if text is None:
                (self.folder / name).unlink(missing_ok=True)
            else:
                write_text(self.folder / name, text)
        state["pending"] = {}
        write_text(self._state_file, json.dumps(state))

    def _complete(self) -> None:
        """Complete a change of a process that was killed within it; one that is running does so itself."""
        if self._state()["pending"]:
            with suppress(FifthwheelError), held(self.folder / HIDDEN / "lock", subject=self.folder):
                if (state := self._state())["pending"]:
                    self._finish(state)

    @contextmanager
    def _changing(self) -> Iterator[dict[str, Any]]:
        """The state, under the lock of the workspace; StaleError where the tab is stale."""
        with held(self.folder / HIDDEN / "lock", subject=self.folder):
            if self.stale:
                raise StaleError("changed in another tab or program; repeat your change in the new state")
            yield self._state()

    @property
    def _state_file(self) -> Path:
        return self.folder / HIDDEN / "state.json"

    def _state(self) -> dict[str, Any]:
        empty: dict[str, Any] = {"version": 0, "position": 0, "changes": [], "pending": {}}
        try:
            state = read_json(self._state_file) if self._state_file.exists() else empty
            pending = {name: state["pending"][name] for name in DOCUMENTS if name in state["pending"]}  # no other file
            if not all(isinstance(text, str | None) for text in pending.values()):
                return empty
            return {key: state[key] for key in empty} | {"pending": pending}
        except (FifthwheelError, KeyError, TypeError):
            return empty  # the documents are intact, only undo is lost

    def _stamp(self) -> str:
        digest = hashlib.sha256()
        for path in (self._state_file, *(self.folder / name for name in DOCUMENTS)):
            content = path.read_bytes() if path.exists() else b""
            digest.update(b"%d " % len(content) + content)
        return digest.hexdigest()


def _files(folder: Path) -> list[Path]:
    """Files by name, without hidden ones; links that lead nowhere are left out."""
    return sorted(path for path in folder.iterdir() if path.is_file() and not path.name.startswith("."))


def _named(name: str, paths: list[Path], kind: str) -> Path:
    """The path of this name among the given ones, so that no name leads elsewhere."""
    for path in paths:
        if path.name == name:
            return path
    raise FifthwheelError(f"{printable(name)}: no such {kind} in the workspace; reload the page")
