"""MATLAB's .mat files by scipy.io (version 4 to 7) and h5py (7.3, and other HDF5 files).

A search finds which of the arrays are signals and what their time is, in the forms in which people and tools save logs.
"""

import io
import re
import struct
import warnings
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from scipy.io import loadmat
from scipy.io.matlab import MatlabFunction, MatlabObject, MatlabOpaque

from fifthwheel.base.errors import SignalError
from fifthwheel.base.types import Array
from fifthwheel.data.logs.readers import matlab_4_order
from fifthwheel.data.logs.source import Chunk, Column, LogSource, ReadProgress, damage, no_progress, unused_name

try:
    import h5py
except ModuleNotFoundError:  # only needed for version 7.3
    h5py = None

_MOST_COLUMNS = 16
_MOST_SHORT = 6
"""Samples by which a vector may be shorter than its time."""
_TIME = re.compile(r"t|time|times|tout|timestamps?|time_?vec(tor)?", re.IGNORECASE)
_SIDE_TIME = re.compile(r"(t|time|timestamps?)_.+|.+_(t|time|timestamps?)", re.IGNORECASE)
_DATA = re.compile(r"data|values?|signal|samples?|y", re.IGNORECASE)
_UNIT = re.compile(r"units?", re.IGNORECASE)
_LABEL = re.compile(r"name|label|blockname|signalname", re.IGNORECASE)
_AS_STRUCT = "save them as structs of vectors, such as s.time = x.Time; s.data = x.Data; save('log.mat', 's')"
_CHUNK_ROWS = 100_000
_KEPT_BYTES = 1 << 20
"""A variable of version 4 or 5 that is larger is read again when its samples are asked for."""
_SIZES_4 = {0: 8, 1: 4, 2: 4, 3: 2, 4: 2, 5: 1}
"""Bytes of a number of version 4, by its type."""
_DEEPEST = 16
_MOST_ITEMS = 20_000
_DATENUMS = (650_000, 900_000)
_DATENUM_1970 = 719529
_LONGEST_STEP = 1e-4
"""Days: a datenum with larger steps is more likely a time in seconds."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Numbers:
    """An array of real numbers, as columns along its longest side."""

    shape: tuple[int, ...]
    load: Callable[[], Any]
    """Gives an array of that shape, or what can be sliced like one."""

    @property
    def length(self) -> int:
        return max(self.shape, default=1)

    @property
    def columns(self) -> int:
        return int(np.prod(self.shape)) // self.length

    def rows(self, array: Any, column: int, first: int, last: int) -> Array:
        """Some rows of a column of the loaded array."""
        place: list[Any] = [column if side > 1 else 0 for side in self.shape]
        place[self.shape.index(self.length)] = slice(first, last)
        return np.asarray(array[tuple(place)], dtype=np.float64).ravel()

    def head(self) -> Array:
        """The first values."""
        return self.rows(self.load(), 0, 0, 1000)


@dataclass(frozen=True)
class Opaque:
    """An object that only MATLAB can read."""

    kind: str


Node = dict[str, Any] | list[Any] | str | float | Numbers | Opaque | None
"""dict: a struct; list: a struct array or a cell; None: nothing of use."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Clock:
    """A time vector."""

    name: str
    time: Numbers


@dataclass(frozen=True, kw_only=True, eq=False)
class Signal:
    """A column of an array, on a clock."""

    name: str
    clock: Clock
    values: Numbers
    column: int
    unit: str | None


def listed(names: Sequence[str]) -> str:
    """The first names, for messages."""
    return ", ".join(names[:10]) + (" ..." if len(names) > 10 else "")


@dataclass
class Search:
    """Signals in the variables of a file, and what cannot be used."""

    signals: list[Signal] = field(default_factory=list)
    timeless: list[tuple[str, int]] = field(default_factory=list)
    """Name and length of vectors without a time of their length."""
    short: list[str] = field(default_factory=list)
    """Vectors that are a little shorter than their time."""
    wide: list[str] = field(default_factory=list)
    """Matrices of many columns."""
    opaque: list[str] = field(default_factory=list)
    """Name and class of objects."""

    def notes(self) -> list[str]:
        """A sentence for each kind of what was left out or completed."""
        found = {
            "vectors left out, no time of their length": [name for name, _ in self.timeless],
            f"vectors are up to {_MOST_SHORT} samples shorter than their time vector, the last samples set to NaN": (
                self.short
            ),
            "matrices of many columns left out": self.wide,
            f"objects left out, only MATLAB reads them; {_AS_STRUCT}": self.opaque,
        }
        return [f"{len(names)} {what}: {listed(names)}" for what, names in found.items() if names]

    def reason(self, notes: Sequence[str]) -> str:
        """Why there are no signals, and what to do."""
        if self.opaque:
            count = len(self.opaque)
            return f"no signals, but {count} objects that only MATLAB reads: {listed(self.opaque)}; {_AS_STRUCT}"
        if self.timeless:
            length, count = Counter(length for _, length in self.timeless).most_common(1)[0]
            names = [label for label, size in self.timeless if size == length]
            return (
                f"no time vector: {count} vectors of {length} values ({listed(names)}), none of them called time or t; "
                f"save a vector named 'time' (seconds, {length} values) in the same file"
            )
        if notes:
            return f"nothing can be read of this MATLAB file, {notes[0]}; save it again"
        return "no vectors of numbers; save the signals as vectors beside one called 'time', in s"

    def struct(self, name: str, fields: Mapping[str, Node], clocks: list[Clock]) -> None:
        """Find the signals in a struct, or in all variables; `clocks` are those of the structs around it."""
        if self._dspace(name, fields):
            return
        times = _times(fields)
        own = [Clock(name=name or time, time=values) for time, values in times.items()]
        if len(own) > 1:
            own = [Clock(name=f"{name}.{time}".strip("."), time=values) for time, values in times.items()]
        unit = _text(fields, _UNIT)
        units = next((v for k, v in fields.items() if _UNIT.fullmatch(k) and isinstance(v, dict)), {})
        rest = {k: v for k, v in fields.items() if k not in times and v is not units}
        if own and self._simulink(name, rest, own[0]):
            return
        data = [k for k, v in rest.items() if isinstance(v, Numbers) and v.length == own[0].time.length] if own else []
        if name and len(data) == 1 and _DATA.fullmatch(data[0]):
            self._node(name, rest.pop(data[0]), own, unit)
            rest = {k: v for k, v in rest.items() if not isinstance(v, Numbers)}
        for key, value in rest.items():
            given = units.get(key)
            label = f"{name}.{key}" if name else key
            self._node(label, value, own + clocks, given if isinstance(given, str) else None)

    def _node(self, name: str, node: Node, clocks: list[Clock], unit: str | None = None) -> None:
        if isinstance(node, Opaque):
            self.opaque.append(f"{name} ({node.kind})")
        elif isinstance(node, Numbers) and node.length > 1:
            self._numbers(name, node, clocks, unit)
        elif isinstance(node, dict):
            self.struct(name, node, clocks)
        elif isinstance(node, list):
            labels = [_text(item, _LABEL) if isinstance(item, dict) else None for item in node]
            for k, (item, label) in enumerate(zip(node, labels, strict=True), 1):
                own = label if labels.count(label) == 1 else None
                self._node(f"{name}.{own}" if own else f"{name}({k})", item, clocks)

    def _numbers(self, name: str, values: Numbers, clocks: list[Clock], unit: str | None) -> None:
        size = values.length
        near = [c for c in clocks if 0 <= c.time.length - size <= min(_MOST_SHORT, size // 4)]
        if not near:
            self.timeless.append((name, size))
        elif values.columns > _MOST_COLUMNS:
            self.wide.append(name)
        else:
            clock = min(near, key=lambda c: c.time.length)  # the first of those with the length that fits best
            self.short += [name] * (clock.time.length > size)
            for k in range(values.columns):
                label = f"{name}({k + 1})" if values.columns > 1 else name
                self.signals.append(Signal(name=label, clock=clock, values=values, column=k, unit=unit))

    def _simulink(self, name: str, fields: Mapping[str, Node], clock: Clock) -> bool:
        """A structure with time: signals(k).values, .label."""
        signals = _structs(fields.get("signals"), "values")
        for k, signal in enumerate(signals, 1):
            label = _text(signal, _LABEL) or (f"signals({k})" if len(signals) > 1 else "")
            self._node(f"{name}.{label}".strip("."), signal["values"], [clock], _text(signal, _UNIT))
        return bool(signals)

    def _dspace(self, name: str, fields: Mapping[str, Node]) -> bool:
        """A recording of ControlDesk: X(i).Data is a time, Y(k) has Name, Data, Unit and XIndex."""
        xs, ys = _structs(fields.get("X"), "Data"), _structs(fields.get("Y"), "Data")
        clocks = {}
        for k, x in enumerate(xs, 1):
            if isinstance(x["Data"], Numbers) and x["Data"].columns == 1:
                clocks[k] = Clock(name=f"{name}.X" if len(xs) == 1 else f"{name}.X({k})", time=x["Data"])
        for k, y in enumerate(ys if xs else [], 1):
            index = y.get("XIndex")
            chosen = clocks.get(int(index)) if isinstance(index, float) and 0 < index < 1e6 else None
            usable = [chosen] if chosen else list(clocks.values())
            self._node(_text(y, _LABEL) or f"Y({k})", y["Data"], usable, _text(y, _UNIT))
        return bool(xs and ys)


def _structs(node: Node, key: str) -> list[dict[str, Any]]:
    """A struct or an array of structs that all have a field of this name, as a list; else an empty list."""
    nodes = node if isinstance(node, list) else [node]
    structs = [item for item in nodes if isinstance(item, dict) and key in item]
    return structs if len(structs) == len(nodes) else []


def _times(fields: Mapping[str, Node]) -> dict[str, Numbers]:
    """The time vectors of a struct: those named so, and for other lengths those named like time_imu that increase."""
    vectors = {k: v for k, v in fields.items() if isinstance(v, Numbers) and v.columns == 1 and v.length > 1}
    times = {name: values for name, values in vectors.items() if _TIME.fullmatch(name)}
    lengths = {values.length for values in times.values()}
    for name, values in vectors.items():
        if _SIDE_TIME.fullmatch(name) and values.length not in lengths and (np.diff(values.head()) > 0).all():
            times[name] = values
    return times


def _text(fields: Mapping[str, Node], names: re.Pattern[str]) -> str | None:
    """The text in a field with such a name."""
    return next((v.strip() for k, v in fields.items() if names.fullmatch(k) and isinstance(v, str) and v.strip()), None)


def open_log(path: Path, databases: Sequence[str | Path] = (), progress: ReadProgress = no_progress) -> LogSource:
    """Open a .mat file; SignalError where it holds no signal with a time."""
    notes: list[str] = []
    with path.open("rb") as file:
        head = file.read(128)
    close: Callable[[], object] = int
    if head.startswith(b"MATLAB 5.0 MAT"):
        variables = _variables(path, _places_5, 128, notes)
    elif matlab_4_order(head):
        variables = _variables(path, _places_4, 0, notes)
    else:
        variables, close = _variables_hdf(path, notes)
    search = Search()
    search.struct("", variables, [])
    if not search.signals:
        close()
        raise SignalError(f"{path.name}: {search.reason(notes)}")
    log = MatLog(path.name, search.signals, close)
    log.notes += [*notes, *search.notes()]
    return log


class MatLog(LogSource):
    """The signals of a .mat file."""

    def __init__(self, name: str, signals: Sequence[Signal], close: Callable[[], object]) -> None:
        counts = Counter(signal.name for signal in signals)
        self._signals: dict[str, Signal] = {}
        for signal in signals:
            label = signal.name if counts[signal.name] == 1 else f"{signal.name}@{signal.clock.name}"
            self._signals[unused_name(label, self._signals)] = signal
        columns = {n: Column(name=n, unit=s.unit, clock=s.clock.name) for n, s in self._signals.items()}
        super().__init__(name, columns)
        self._close = close

    def chunks(self, columns: Collection[str]) -> Iterator[Chunk]:
        return self.increasing(self._rows(self.by_clock(columns)))

    def _rows(self, clocks: Mapping[str, Sequence[str]]) -> Iterator[Chunk]:
        for number, (clock, names) in enumerate(clocks.items()):
            signals = [self._signals[name] for name in names]
            time, first = signals[0].clock.time, 0
            with damage() as troubles:
                seconds, arrays = _seconds(time), [signal.values.load() for signal in signals]
                while first < time.length:
                    last = min(first + _CHUNK_ROWS, time.length)
                    stamps, values = seconds(first, last), {}
                    for name, signal, array in zip(names, signals, arrays, strict=True):
                        rows = signal.values.rows(array, signal.column, first, last)
                        values[name] = np.pad(rows, (0, stamps.size - rows.size), constant_values=np.nan)
                    first, done = last, (number + last / time.length) / len(clocks)
                    yield Chunk(values=values, time=stamps, clock=clock, done=done)
            self.note(*(f"broken after {first} samples of {clock!r}: {why}" for why in troubles))

    def close(self) -> None:
        self._close()


def _seconds(time: Numbers) -> Callable[[int, int], Array]:
    """What gives the times of some rows, s; a datenum of MATLAB, days since the year 0, becomes seconds since 1970."""
    array, head = time.load(), time.head()
    steps, (low, high) = np.diff(head), _DATENUMS
    if ((head > low) & (head < high)).all() and steps.size and 0 < np.median(steps) < _LONGEST_STEP:
        return lambda first, last: (time.rows(array, 0, first, last) - _DATENUM_1970) * 86400
    return partial(time.rows, array, 0)


def _numbers(shape: tuple[int, ...], dtype: np.dtype[Any], load: Callable[[], Any]) -> Numbers | None:
    """An array of real numbers with at most two sides; None for any other."""
    if dtype.kind not in "biuf" or 0 in shape or sum(side > 1 for side in shape) > 2:
        return None
    return Numbers(shape=shape, load=load)


def _places_4(file: BinaryIO, size: int) -> Iterator[tuple[int, int]]:
    """First byte and length of each variable of version 4."""
    order, at = matlab_4_order(file.read(128)) or "<", 0
    while at + 20 <= size:
        file.seek(at)
        kind, rows, columns, imaginary, name = struct.unpack(f"{order}5i", file.read(20))
        length = 20 + name + rows * columns * _SIZES_4.get(kind // 10 % 10, 8) * (1 + imaginary)
        if length <= 20:
            return
        yield at, length
        at += length


def _places_5(file: BinaryIO, size: int) -> Iterator[tuple[int, int]]:
    """First byte and length of each variable of version 5."""
    order, at = "<" if file.read(128)[126:] == b"IM" else ">", 128
    while at + 8 <= size:
        file.seek(at + 4)
        (length,) = struct.unpack(f"{order}I", file.read(4))
        yield at, 8 + length
        at += 8 + length


def _variables(
    path: Path, places: Callable[[BinaryIO, int], Iterator[tuple[int, int]]], header: int, notes: list[str]
) -> dict[str, Node]:
    """Variables of version 4 or 5 behind `header` bytes, by name; damaged ones are left out with a note."""
    variables: dict[str, Node] = {}
    broken: list[str] = []
    size, end = path.stat().st_size, header
    with path.open("rb") as file:
        for at, length in places(file, size):
            if at + length > size:
                break
            with damage() as troubles:
                name, value = _variable(path, header, at, length)
                variables[name] = _node(value, partial(_variable, path, header, at, length))
            broken += [f"at byte {at} ({why})" for why in troubles]
            end = at + length
    if end < size:
        notes.append(f"broken after {len(variables) + len(broken)} variables, at byte {end}: the file is cut short")
    if broken:
        notes.append(f"broken: {len(broken)} variables cannot be read, the first {broken[0]}")
    return variables


def _variable(path: Path, header: int, at: int, length: int) -> tuple[str, Any]:
    """Name and value of the variable at a byte of a file."""
    with path.open("rb") as file:
        data = file.read(header)
        file.seek(at)
        data += file.read(length)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        loaded = loadmat(io.BytesIO(data), simplify_cells=True)
    name, value = next((name, value) for name, value in reversed(loaded.items()))
    if isinstance(value, MatlabOpaque) and "s0" in value.dtype.names:  # SciPy before 1.18
        name = value["s0"][0].decode()
    return name, value


def _node(value: Any, reload: Callable[[], tuple[str, Any]] | None = None) -> Node:
    """What scipy.io gives as a node; `reload` reads the variable, its name and value, again."""
    if isinstance(value, MatlabOpaque):
        kind = value["_Class"][0] if "_Class" in value.dtype.names else value["s2"][0].decode()
        return Opaque(kind)
    if isinstance(value, MatlabObject | MatlabFunction):
        return Opaque(getattr(value, "classname", "function"))
    if isinstance(value, dict):
        return {name: _node(item) for name, item in value.items()}
    if isinstance(value, list) or (isinstance(value, np.ndarray) and value.dtype.kind == "O"):
        return [_node(item) for item in np.ravel(value).tolist()[:_MOST_ITEMS]]
    if isinstance(value, np.ndarray):
        if reload is not None and value.nbytes > _KEPT_BYTES:  # its samples are not kept
            return _numbers(value.shape, value.dtype, lambda: reload()[1])
        return _numbers(value.shape, value.dtype, lambda: value)
    if isinstance(value, bool | int | float | np.number):
        return float(value) if np.isreal(value) else None
    return str(value) if isinstance(value, str) else None


def _variables_hdf(path: Path, notes: list[str]) -> tuple[dict[str, Node], Callable[[], None]]:
    """Variables of version 7.3 by name, and what closes the file; those that are damaged are left out with a note."""
    if h5py is None:
        raise ModuleNotFoundError(name="h5py")
    file = h5py.File(path, "r", locking=False)
    tree = _Tree(file)
    variables = tree.fields(file, ())
    if tree.broken:
        notes.append(f"broken: {len(tree.broken)} variables cannot be read, the first {tree.broken[0]}")
    if tree.outside:
        notes.append(f"{len(tree.outside)} variables left out, their data is in other files: {listed(tree.outside)}")
    return variables, file.close


@dataclass
class _Tree:
    """The objects of an HDF5 file as nodes. Nothing outside of the file is read, and no object within itself."""

    file: Any
    items: int = 0
    broken: list[str] = field(default_factory=list)
    """Names of what cannot be read, with the reason."""
    outside: list[str] = field(default_factory=list)
    """Names of external links, and of data sets with external or virtual storage."""

    def fields(self, group: Any, within: tuple[int, ...]) -> dict[str, Node]:
        """The objects of a group by name; `within` are the addresses of the objects around it."""
        nodes: dict[str, Node] = {}
        for name in group:
            with damage() as troubles:
                link = group.get(name, getlink=True)
                if isinstance(link, h5py.ExternalLink):
                    self.outside.append(name)
                elif isinstance(link, h5py.HardLink) and not name.startswith("#"):  # a soft link may lead through one
                    nodes[name] = self.node(name, group[name], within)
            self.broken += [f"{name} ({why})" for why in troubles]
        return nodes

    def node(self, name: str, item: Any, within: tuple[int, ...]) -> Node:
        """An object as a node."""
        self.items += 1
        address = h5py.h5o.get_info(item.id).addr
        if address in within or len(within) > _DEEPEST or self.items > _MOST_ITEMS:
            return None
        within = (*within, address)
        kind = item.attrs.get("MATLAB_class", b"")
        kind = kind.decode("latin-1") if isinstance(kind, bytes) else str(kind)
        if "MATLAB_object_decode" in item.attrs:
            return Opaque(kind or "object")
        if isinstance(item, h5py.Group):
            return _struct_array(item, self.fields(item, within))
        if not isinstance(item, h5py.Dataset) or "MATLAB_empty" in item.attrs or item.shape is None:
            return None
        if item.external or item.is_virtual:
            self.outside.append(name)
            return None
        if h5py.check_ref_dtype(item.dtype) is not None:
            refs = np.ravel(item[()])[:_MOST_ITEMS]
            return [self.node(name, self.file[ref], within) if ref else None for ref in refs]
        if kind == "char" and item.dtype.kind == "u":
            return "".join(map(chr, np.ravel(item[()]).tolist())) if item.size < _MOST_ITEMS else None
        if h5py.check_string_dtype(item.dtype) is not None:
            text = item[()] if item.shape == () else None
            return text.decode("latin-1") if isinstance(text, bytes) else text
        if item.size == 1 and item.dtype.kind in "biuf":
            return float(np.ravel(item[()])[0])
        return _numbers(item.shape, item.dtype, lambda: item)


def _struct_array(group: Any, fields: dict[str, Node]) -> Node:
    """A struct array is stored as one list for each field."""
    lists = [value for value in fields.values() if isinstance(value, list)]
    of_cells = all("MATLAB_class" in group[name].attrs for name in fields)
    if of_cells or len(lists) < len(fields) or len({len(value) for value in lists}) > 1:
        return fields
    return [dict(zip(fields, values, strict=True)) for values in zip(*lists, strict=True)]
