"""MATLAB's .mat files, version 5 to 7.3: vectors beside a time vector, structs, and what Simulink and dSPACE save."""

from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from fifthwheel.errors import SignalError
from fifthwheel.logs.log import Array, Column, Log, Piece, Progress, quiet
from fifthwheel.logs.readers.asked import by_clock
from fifthwheel.logs.readers.mat_five import load_five
from fifthwheel.logs.readers.mat_signals import Clock, Search, Signal
from fifthwheel.logs.readers.mat_tree import DAMAGE
from fifthwheel.logs.stamps import Stamps, add_notes

_FIVE = b"MATLAB 5.0 MAT"
_PIECE_ROWS = 100_000
_EPOCH = 719529
"""Days of a datenum at the beginning of 1970."""
_DATENUMS = (650_000, 900_000)
_LONGEST_STEP = 1e-4
"""Days: a datenum that steps slower is more likely a time in seconds."""
_AS_STRUCT = "save them as structs of vectors, such as s.time = x.Time; s.data = x.Data; save('log.mat', 's')"


def open_log(path: Path, databases: Sequence[str | Path] = (), progress: Progress = quiet) -> Log:
    """Open a .mat file; SignalError when it holds no signal with a time."""
    path = Path(path)
    try:
        file = path.open("rb")
    except OSError as error:
        raise SignalError(f"{path}: cannot be read ({error.strerror}); check the path") from error
    notes: list[str] = []
    close: Callable[[], None] = file.close
    try:
        if file.read(len(_FIVE)) == _FIVE:
            file.seek(0)
            variables = load_five(file, path.stat().st_size, notes)
            file.close()
        else:
            file.close()
            from fifthwheel.logs.readers.mat_hdf import load_hdf

            variables, close = load_hdf(path, notes)
        search = Search(variables)
    except ImportError:
        raise
    except DAMAGE as error:
        close()
        raise SignalError(f"{path.name}: cannot be read ({error}); save it again") from error
    if not search.signals:
        close()
        raise SignalError(f"{path.name}: {_nothing(search, notes)}")
    return MatLog(path.name, search, notes, close)


class MatLog(Log):
    """The signals of a .mat file."""

    def __init__(self, name: str, search: Search, notes: list[str], close: Callable[[], None]) -> None:
        super().__init__(name)
        self._close = close
        counts = Counter(signal.name for signal in search.signals)
        self._signals: dict[str, Signal] = {}
        for signal in search.signals:
            label = signal.name if counts[signal.name] == 1 else f"{signal.name}@{signal.clock.name}"
            while label in self._signals:
                label += "'"
            self._signals[label] = signal
        self._columns = {
            label: Column(name=label, unit=signal.unit, clock=signal.clock.name)
            for label, signal in self._signals.items()
        }
        self.notes += notes
        if search.timeless:
            names = [label for label, _ in search.timeless]
            self.notes.append(f"{len(names)} vectors left out, no time of their length: {_some(names)}")
        if search.wide:
            self.notes.append(f"{len(search.wide)} matrices of many columns left out: {_some(search.wide)}")
        if search.opaque:
            kinds = [f"{label} ({kind})" for label, kind in search.opaque]
            self.notes.append(f"{len(kinds)} objects left out, only MATLAB reads them: {_some(kinds)}; {_AS_STRUCT}")

    @property
    def columns(self) -> Mapping[str, Column]:
        return self._columns

    def pieces(self, columns: Collection[str]) -> Iterator[Piece]:
        wanted = {
            clock: {label: self._signals[label] for label in labels}
            for clock, labels in by_clock(self, columns).items()
        }
        stamps = Stamps()
        total, before = sum(next(iter(s.values())).clock.time.length for s in wanted.values()), 0
        for clock, signals in wanted.items():
            own = next(iter(signals.values())).clock
            for first in range(0, own.time.length, _PIECE_ROWS):
                last = min(first + _PIECE_ROWS, own.time.length)
                try:
                    time = _seconds(own, first, last)
                    values = {label: s.values.read(s.column, first, last) for label, s in signals.items()}
                except DAMAGE as error:
                    add_notes(self.notes, f"broken after {first} samples of {clock!r}: {error}")
                    break
                kept = stamps.keep(clock, time)
                if not kept.all():
                    time, values = time[kept], {label: column[kept] for label, column in values.items()}
                if time.size:
                    yield Piece(values=values, time=time, clock=clock, done=(before + last) / total)
            before += own.time.length
        add_notes(self.notes, *stamps.notes)

    def close(self) -> None:
        self._close()


def _seconds(clock: Clock, first: int, last: int) -> Array:
    """Stamps, s; days since the year 0, as MATLAB's datenum gives them, become seconds since 1970."""
    time = clock.time.read(0, first, last)
    head = clock.time.read(0, 0, min(1000, clock.time.length))
    steps = np.diff(head)
    low, high = _DATENUMS
    if ((head > low) & (head < high)).all() and steps.size and 0 < np.median(steps) < _LONGEST_STEP:
        return (time - _EPOCH) * 86400
    return time


def _nothing(search: Search, notes: list[str]) -> str:
    if search.opaque:
        kinds = [f"{label} ({kind})" for label, kind in search.opaque]
        return f"no signals, but {len(kinds)} objects that only MATLAB reads: {_some(kinds)}; {_AS_STRUCT}"
    if search.timeless:
        length, count = Counter(length for _, length in search.timeless).most_common(1)[0]
        names = [label for label, size in search.timeless if size == length]
        return (
            f"no time: {count} vectors of {length} values ({_some(names)}), none of them called time or t; "
            f"save a vector 'time' of {length} values in s beside them"
        )
    if notes:
        return f"nothing can be read of this MATLAB file, {notes[0]}; save it again"
    return "no vectors of numbers; save the signals as vectors beside one called 'time', in s"


def _some(names: list[str]) -> str:
    return ", ".join(names[:10]) + (" ..." if len(names) > 10 else "")
