"""MATLAB's .mat files by scipy.io (version 4 to 7) and h5py (7.3, and other HDF5 files)."""

import io
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
from fifthwheel.data.logs.readers.mat_signals import Node, Numbers, Opaque, Search, Signal, listed
from fifthwheel.data.logs.source import Chunk, Column, LogSource, ReadProgress, damage, no_progress, unused_name

try:
    import h5py
except ModuleNotFoundError:  # only needed for version 7.3
    h5py = None

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
                variables[name] = _node(value, partial(_value, path, header, at, length))
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


def _value(path: Path, header: int, at: int, length: int) -> Any:
    return _variable(path, header, at, length)[1]


def _node(value: Any, load: Callable[[], Any] | None = None) -> Node:
    """What scipy.io gives as a node; `load` reads it again."""
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
        again = load is not None and value.nbytes > _KEPT_BYTES
        return _numbers(value.shape, value.dtype, load if load is not None and again else lambda: value)
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
