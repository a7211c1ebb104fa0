"""ASAM MDF, version 4 and before. Channel groups are clocks; CAN frames among them are decoded.

Read here and not by asammdf, which crashes the interpreter on some damaged files.
"""

import struct
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from fifthwheel.errors import SignalError
from fifthwheel.logs.log import Column, Log, Piece, Progress, quiet
from fifthwheel.logs.readers import mdf3_blocks, mdf4_blocks
from fifthwheel.logs.readers.asked import by_clock
from fifthwheel.logs.readers.mdf_data import BrokenError, File
from fifthwheel.logs.readers.mdf_model import Channel, Group, Rows
from fifthwheel.logs.readers.mdf_rows import read_rows
from fifthwheel.logs.readers.mdf_values import times, values
from fifthwheel.logs.stamps import Stamps, add_notes


def open_log(path: Path, databases: Sequence[str | Path] = (), progress: Progress = quiet) -> Log:
    """Open an MDF file; SignalError when nothing of it is intact."""
    path = Path(path)
    try:
        file = File(path)
    except OSError as error:
        raise SignalError(f"{path}: cannot be read ({error.strerror}); check the path") from error
    try:
        return _open(path.name, file, databases, progress)
    except BaseException:
        file.close()
        raise


def _open(name: str, file: File, databases: Sequence[str | Path], progress: Progress) -> Log:
    notes: list[str] = []
    try:
        version = file.take(8, 4)
        read_groups = (mdf3_blocks if version[:1] in (b"2", b"3") else mdf4_blocks).read_groups
        log = MdfLog(name, file, read_groups(file, notes), notes)
    except (BrokenError, struct.error) as error:
        raise SignalError(f"{name}: nothing can be read of this MDF file, {error}; {_CURE}") from error
    log.decode(databases, progress)
    if not log.columns:
        trouble = "; ".join(log.notes) or "it holds no channels of numbers"
        raise SignalError(f"{name}: nothing can be read of this MDF file: {trouble}; {_CURE}")
    if log.empty:
        raise SignalError(f"{name}: {len(log.columns)} channels but not one sample; {_CURE}")
    return log


_CURE = "copy it again from the logger, or open and save it in the logger's own tool"


class MdfLog(Log):
    """The groups of channels of an MDF file."""

    def __init__(self, name: str, file: File, groups: list[Group], notes: list[str]) -> None:
        super().__init__(name)
        self._file = file
        self._clocks: dict[str, Group] = {}
        self._channels: dict[str, Channel] = {}
        self._columns: dict[str, Column] = {}
        self._groups = groups
        self._can: Log | None = None
        self._frames_columns: dict[str, str] = {}
        """Name of a column to that of the decoder of frames."""
        self.notes += notes
        self._list(groups)

    @property
    def columns(self) -> Mapping[str, Column]:
        return self._columns

    @property
    def empty(self) -> bool:
        """Whether it has no sample at all."""
        return not any(group.data.size or not group.width for group in self._clocks.values())

    def pieces(self, columns: Collection[str]) -> Iterator[Piece]:
        wanted = {
            clock: {name: self._channels[name] for name in names}
            for clock, names in by_clock(self, columns).items()
            if clock in self._clocks
        }
        stamps = Stamps()
        parts = {id(data): data.size for data in (self._clocks[clock].data for clock in wanted)}
        total = sum(parts.values()) or 1
        before = 0
        left = list(wanted)
        while left:
            data, mix = self._clocks[left[0]].data, self._clocks[left[0]].mix
            alike = [clock for clock in left if clock == left[0] or (mix and self._clocks[clock].data is data)]
            left = [clock for clock in left if clock not in alike]
            names = {id(self._clocks[clock]): clock for clock in alike}
            ends = dict.fromkeys(alike, (0, 0.0))
            for rows in read_rows([self._clocks[clock] for clock in alike]):
                clock = names[id(rows.group)]
                piece = self._piece(clock, wanted[clock], rows, stamps, min(1.0, (before + rows.read) / total))
                if piece is None:
                    break
                if piece.time is not None and piece.time.size:
                    ends[clock] = (rows.first + len(rows.records), float(piece.time[-1]))
                    yield piece
            else:
                self._note_break(ends)
            before += data.size
        add_notes(self.notes, *stamps.notes)
        frames = {self._frames_columns[name]: name for name in columns if name in self._frames_columns}
        if self._can is not None and frames:
            for piece in self._can.pieces(frames):
                values = {frames[name]: column for name, column in piece.values.items()}
                clock = self._columns[next(iter(values))].clock
                yield replace(piece, values=values, clock=clock)

    def decode(self, databases: Sequence[str | Path], progress: Progress) -> None:
        """Find the signals in the CAN frames, if there are any; frames that nobody knows are worth a note only."""
        groups = [group for group in self._groups if {"ID", "DataBytes"} <= group.frames.keys() and group.timed]
        if not groups:
            return
        try:
            from fifthwheel.logs.can import CanLog
            from fifthwheel.logs.can.database import load
            from fifthwheel.logs.readers.mdf_frames import batches

            self._can = CanLog(self.name, batches(groups, self.notes), databases, progress)
        except ImportError as error:
            if not self._columns:
                raise
            self.notes.append(f"CAN frames left out, {error}; pip install '.[can]' in the checkout")
            return
        except SignalError as error:
            if not self._columns:
                raise
            load(databases)  # a database that cannot be used is an error still
            self.notes.append(str(error).removeprefix(f"{self.name}: "))
            return
        add_notes(self.notes, *self._can.notes)
        for name, column in self._can.columns.items():
            free, clock = name, column.clock
            while free in self._columns:
                free += "'"
            while clock in self._clocks:
                clock += "'"
            self._columns[free] = replace(column, name=free, clock=clock)
            self._frames_columns[free] = name

    def close(self) -> None:
        self._file.close()

    def _list(self, groups: list[Group]) -> None:
        seen: dict[str, int] = {}
        for group in groups:
            for channel in group.channels:
                seen[channel.name] = seen.get(channel.name, 0) + 1
        labels = [group.label for group in groups]
        unread: list[str] = []
        for group in groups:
            clock = group.label if labels.count(group.label) == 1 else f"{group.label} {group.number}"
            while clock in self._clocks:
                clock += "'"
            if not group.timed:
                if group.channels:
                    self.notes.append(f"group {clock!r} of {len(group.channels)} channels left out: it has no time")
                continue
            self._clocks[clock] = group
            for channel in group.channels:
                if channel.numeric and not channel.fits(group.size):
                    channel.trouble = "its bits lie outside of the record"
                if not channel.numeric:
                    unread += [f"{channel.name} ({channel.trouble})"] if channel.trouble else []
                    continue
                name = channel.name if seen[channel.name] == 1 else f"{channel.name}@{clock}"
                while name in self._columns:
                    name += "'"
                self._columns[name] = Column(name=name, unit=channel.unit, clock=clock, about=channel.about)
                self._channels[name] = channel
        if unread:
            self.notes.append(f"{len(unread)} channels left out: {', '.join(unread[:10])}")

    def _piece(
        self, clock: str, channels: Mapping[str, Channel], rows: Rows, stamps: Stamps, done: float
    ) -> Piece | None:
        try:
            time = times(rows)
            columns = {name: values(channel, rows)[: time.size] for name, channel in channels.items()}
        except BrokenError as error:
            add_notes(self.notes, f"group {clock!r} is broken after {rows.first} samples: {error}")
            return None
        kept = stamps.keep(clock, time)
        if not kept.all():
            time, columns = time[kept], {name: column[kept] for name, column in columns.items()}
        return Piece(values=columns, time=time, clock=clock, done=done)

    def _note_break(self, ends: Mapping[str, tuple[int, float]]) -> None:
        for clock, (count, last) in ends.items():
            group = self._clocks[clock]
            trouble = group.data.broken
            if group.count is not None and count < group.count and not trouble:
                trouble = f"{group.count} samples are announced"
            if trouble:
                at = f", at {last:.1f} s" if count else ""
                add_notes(self.notes, f"broken after {count} samples of group {clock!r}{at}: {trouble}")
