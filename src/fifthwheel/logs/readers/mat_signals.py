"""Which arrays of a .mat file are signals, and what their time is: the forms in which people and tools save logs."""

import re
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from fifthwheel.logs.readers.mat_tree import Node, Numbers, Opaque

_TIME = re.compile(r"t|time|times|tout|timestamps?|time_?vec(tor)?", re.IGNORECASE)
_SIDE_TIME = re.compile(r"(t|time|timestamps?)_.+|.+_(t|time|timestamps?)", re.IGNORECASE)
_DATA = re.compile(r"data|values?|signal|samples?|y", re.IGNORECASE)
_UNIT = re.compile(r"units?", re.IGNORECASE)
_LABEL = re.compile(r"name|label|blockname|signalname", re.IGNORECASE)
_MOST_COLUMNS = 16
_HEAD = 1000


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
    column: int = 0
    unit: str | None = None


class Search:
    """Goes through the variables and collects signals; what it cannot use is kept for the notes."""

    def __init__(self, variables: Mapping[str, Node]) -> None:
        self.signals: list[Signal] = []
        self.timeless: list[tuple[str, int]] = []
        """Name and length of vectors without a time of their length."""
        self.wide: list[str] = []
        """Matrices of many columns."""
        self.opaque: list[tuple[str, str]] = []
        """Name and class of objects."""
        self._struct("", dict(variables), [])

    def _node(self, name: str, node: Node, clocks: list[Clock], unit: str | None = None) -> None:
        if isinstance(node, Opaque):
            self.opaque.append((name, node.kind))
        elif isinstance(node, Numbers):
            self._numbers(name, node, clocks, unit)
        elif isinstance(node, dict):
            self._struct(name, node, clocks)
        elif isinstance(node, list):
            labels = [_text(item, _LABEL) if isinstance(item, dict) else None for item in node]
            for k, (item, label) in enumerate(zip(node, labels, strict=True), 1):
                own = label if labels.count(label) == 1 else None
                self._node(f"{name}.{own}" if own else f"{name}({k})", item, clocks)

    def _numbers(self, name: str, values: Numbers, clocks: list[Clock], unit: str | None) -> None:
        if values.length < 2:
            return
        clock = next((clock for clock in clocks if clock.time.length == values.length), None)
        if clock is None:
            self.timeless.append((name, values.length))
        elif values.columns > _MOST_COLUMNS:
            self.wide.append(name)
        else:
            for k in range(values.columns):
                label = f"{name}({k + 1})" if values.columns > 1 else name
                self.signals.append(Signal(name=label, clock=clock, values=values, column=k, unit=unit))

    def _struct(self, name: str, fields: dict[str, Node], clocks: list[Clock]) -> None:
        if self._dspace(name, fields):
            return
        times = _times(fields)
        own = [Clock(name=name or field, time=time) for field, time in times.items()]
        if len(own) > 1:
            own = [Clock(name=f"{name}.{field}".strip("."), time=time) for field, time in times.items()]
        unit = _text(fields, _UNIT)
        units = next((v for k, v in fields.items() if _UNIT.fullmatch(k) and isinstance(v, dict)), {})
        rest = {k: v for k, v in fields.items() if k not in times and v is not units}
        if own and self._simulink(name, rest, own[0]):
            return
        data = [k for k, v in rest.items() if isinstance(v, Numbers) and v.length == own[0].time.length] if own else []
        if name and len(data) == 1 and _DATA.fullmatch(data[0]):
            self._node(name, rest.pop(data[0]), own, unit)
            rest = {k: v for k, v in rest.items() if not isinstance(v, Numbers)}
        for field, value in rest.items():
            given = units.get(field)
            label = f"{name}.{field}" if name else field
            self._node(label, value, own + clocks, given if isinstance(given, str) else None)

    def _simulink(self, name: str, fields: dict[str, Node], clock: Clock) -> bool:
        """A structure with time: signals(k).values, .label."""
        signals = fields.get("signals")
        signals = [signals] if isinstance(signals, dict) else signals
        if not isinstance(signals, list) or not all(isinstance(s, dict) and "values" in s for s in signals):
            return False
        for k, signal in enumerate(signals, 1):
            label = _text(signal, _LABEL) or (f"signals({k})" if len(signals) > 1 else "")
            self._node(f"{name}.{label}".strip("."), signal["values"], [clock], _text(signal, _UNIT))
        return True

    def _dspace(self, name: str, fields: dict[str, Node]) -> bool:
        """A recording of ControlDesk: X(i).Data is a time, Y(k) has Name, Data, Unit and XIndex."""
        xs, ys = ([v] if isinstance(v, dict) else v for v in (fields.get("X"), fields.get("Y")))
        if not isinstance(xs, list) or not isinstance(ys, list) or not xs or not ys:
            return False
        if not all(isinstance(item, dict) and "Data" in item for item in [*xs, *ys]):
            return False
        clocks: list[Clock | None] = []
        for k, x in enumerate(xs, 1):
            label = f"{name}.X" if len(xs) == 1 else f"{name}.X({k})"
            time = x["Data"]
            clocks.append(Clock(name=label, time=time) if isinstance(time, Numbers) and time.columns == 1 else None)
        for k, y in enumerate(ys, 1):
            index = y.get("XIndex")
            chosen = int(index.read(0, 0, 1)[0]) - 1 if isinstance(index, Numbers) and _small(index) else 0
            order = [clocks[chosen]] if 0 <= chosen < len(clocks) else []
            usable = [clock for clock in [*order, *clocks] if clock is not None]
            self._node(_text(y, _LABEL) or f"Y({k})", y["Data"], usable, _text(y, _UNIT))
        return True


def _small(index: Numbers) -> bool:
    return index.length == 1 and 0 <= index.read(0, 0, 1)[0] < 1e6


def _times(fields: Mapping[str, Node]) -> dict[str, Numbers]:
    """The time vectors of a struct: those called so, and for other lengths what is called time_imu and rises."""
    vectors = {k: v for k, v in fields.items() if isinstance(v, Numbers) and v.columns == 1 and v.length > 1}
    times = {name: value for name, value in vectors.items() if _TIME.fullmatch(name)}
    lengths = {value.length for value in times.values()}
    for name, value in vectors.items():
        if _SIDE_TIME.fullmatch(name) and value.length not in lengths and _rises(value):
            times[name] = value
    return times


def _rises(values: Numbers) -> bool:
    return bool((np.diff(values.read(0, 0, min(values.length, _HEAD))) > 0).all())


def _text(fields: Mapping[str, Node], names: re.Pattern[str]) -> str | None:
    """The text in a field of such a name."""
    return next((v.strip() for k, v in fields.items() if names.fullmatch(k) and isinstance(v, str) and v.strip()), None)
