"""Which arrays of a .mat file are signals, and what their time is: the forms in which people and tools save logs."""

import re
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from fifthwheel.base.types import Array

_MOST_COLUMNS = 16
_MOST_SHORT = 6
"""Samples by which a vector may be shorter than its time."""
_TIME = re.compile(r"t|time|times|tout|timestamps?|time_?vec(tor)?", re.IGNORECASE)
_SIDE_TIME = re.compile(r"(t|time|timestamps?)_.+|.+_(t|time|timestamps?)", re.IGNORECASE)
_DATA = re.compile(r"data|values?|signal|samples?|y", re.IGNORECASE)
_UNIT = re.compile(r"units?", re.IGNORECASE)
_LABEL = re.compile(r"name|label|blockname|signalname", re.IGNORECASE)
_AS_STRUCT = "save them as structs of vectors, such as s.time = x.Time; s.data = x.Data; save('log.mat', 's')"


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
