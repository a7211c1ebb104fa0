"""ASAM MDF by asammdf, versions 2 to 4.3. Channel groups are clocks; CAN frames in them are decoded."""

import ast
import operator
import re
import sys
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from asammdf import MDF
from asammdf.blocks import v2_v3_blocks, v4_blocks
from numpy.typing import NDArray

from fifthwheel.base.errors import SignalError
from fifthwheel.base.types import Array
from fifthwheel.data.logs.can.database import load
from fifthwheel.data.logs.can.log import CanLog, Frames, open_can_log
from fifthwheel.data.logs.source import (
    Chunk,
    Column,
    LogSource,
    ReadProgress,
    damage,
    no_progress,
    parts_of,
    unused_name,
)

_FRAGMENT = 4 << 20
"""Bytes of records that are read at once."""
_TIME, _VIRTUAL, _VARIABLE_LENGTH = 1, (3, 6), 1
"""Codes of MDF 4 for the synchronisation and the kind of a channel."""
_VARIABLE_LENGTH_GROUP, _BUS_EVENT, _REMOTE_MASTER = 1, 2, 8
"""Flags of channel groups in MDF 4."""
_RANGE_TABLE = 6
"""Code of the conversion of value ranges to values in MDF 4."""
_NAME_TABLES = (11, 12)
"""Codes of conversions to text without reference blocks: bit fields of MDF 4, tables of MDF 3."""
_BUS_PART = re.compile(r"(CAN|LIN|FLX|MOST|ETH|KLINE)_[A-Z]\w*(\.|$)")
_LONGEST_LABEL = 64
_PAYLOAD_SIZES = np.array([0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64], np.int32)
"""Bytes of payload by DLC."""
_CURE = "copy it again from the logger, or open and save it in the logger's own tool"

Place = tuple[int, int]
"""A channel by its group and its index in it."""
MAX_FORMULA = 1000
"""Characters of a formula; a longer one is refused."""
_VARIABLES = ("X", "X1", "P1", "P2", "P3", "P4", "P5", "P6", "INF", "NaN")
_OPERATORS: dict[type[ast.AST], Callable[..., Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
    ast.UAdd: operator.pos,
    ast.USub: operator.neg,
}
_FUNCTIONS: dict[str, Callable[..., Any]] = {
    name: getattr(np, name)
    for name in (
        *("sin", "cos", "tan", "arcsin", "arccos", "arctan", "arctan2", "sinh", "cosh", "tanh"),
        *("arcsinh", "arccosh", "arctanh", "exp", "expm1", "log", "log10", "log1p", "sqrt", "abs"),
    )
} | {"asin": np.arcsin, "acos": np.arccos, "atan": np.arctan, "atan2": np.arctan2, "pow": np.power}


def open_log(path: Path, databases: Sequence[str | Path] = (), progress: ReadProgress = no_progress) -> LogSource:
    """Open an MDF file; SignalError where it has no samples of numbers."""
    return MdfLog(path, databases, progress)


class MdfLog(LogSource):
    """The channels of an MDF file, and the signals in its CAN frames."""

    def __init__(self, path: Path, databases: Sequence[str | Path], progress: ReadProgress) -> None:
        options: Any = {"process_bus_logging": False}  # frames are decoded here
        mdf = self._mdf = MDF(path, progress=lambda done, steps: progress(0.5 * done / max(steps, 1)), **options)
        mdf.configure(read_fragment_size=_FRAGMENT)
        notes: list[str] = []
        columns, self._places = _columns(mdf, notes)
        name, required = path.name, not columns
        can = _can_log(name, mdf, databases, lambda done: progress(0.5 + 0.5 * done), notes, required=required)
        if not columns and can is None:
            raise SignalError(f"{name}: no channels of numbers with a time{''.join(f'; {n}' for n in notes)}; {_CURE}")
        if can is None and not any(mdf.groups[group].channel_group.cycles_nr for group, _ in self._places.values()):
            raise SignalError(f"{name}: {len(columns)} channels but not one sample; {_CURE}")
        self._can, self._decoded = can, dict[str, str]()
        clocks = {column.clock for column in columns.values()}
        for decoded, column in can.columns.items() if can else ():
            unused = unused_name(decoded, columns)
            self._decoded[unused] = decoded
            columns[unused] = replace(column, name=unused, clock=unused_name(column.clock, clocks))
        super().__init__(name, columns)
        self.notes += notes
        self.size = 0 if can else path.stat().st_size  # one with CAN frames is read as a whole
        with damage():  # a damaged date is none
            self.start = mdf.header.start_time.timestamp()

    def chunks(self, columns: Collection[str]) -> Iterator[Chunk]:
        clocks = {c: names for c, names in self.by_clock(columns).items() if names[0] in self._places}
        groups = (
            replace(chunk, done=(number + chunk.done) / len(clocks))
            for number, (clock, names) in enumerate(clocks.items())
            for chunk in self._group(clock, names)
        )
        yield from self.increasing(groups)
        decoded = {self._decoded[name]: name for name in columns if name in self._decoded}
        for chunk in self._can.chunks(decoded) if self._can and decoded else ():
            values = {decoded[name]: column for name, column in chunk.values.items()}
            yield replace(chunk, values=values, clock=self.columns[next(iter(values))].clock)

    def _group(self, clock: str, names: Sequence[str]) -> Iterator[Chunk]:
        """The samples of one group; where it is damaged, those before and a note."""
        group = self._places[names[0]][0]
        total, count, last = self._mdf.groups[group].channel_group.cycles_nr, 0, 0.0
        parts: list[tuple[int, int | None]] = [*parts_of(total, self.size)] if self.sampled else [(0, None)]
        with damage() as troubles:
            for begin, end in parts:
                for first, time, fragment in _fragments(self._mdf, group, begin, end):
                    values = {n: _values(self._mdf, self._places[n], first, time.size, fragment) for n in names}
                    done = min(1.0, (first + time.size) / max(total, 1))
                    yield Chunk(values=values, time=time, clock=clock, done=done)
                    count, last = first + time.size, float(time[-1]) if time.size else last
        if troubles or count < total:
            at = f", at {last:.1f} s" if count else ""
            troubles.append(f"{total} samples are announced")
            self.note(f"broken after {count} samples of group {clock!r}{at}: {troubles[0]}")

    def close(self) -> None:
        self._mdf.close()


def _fragments(mdf: Any, group: int, begin: int = 0, end: int | None = None) -> Iterator[tuple[int, Array, Any]]:
    """Number of the first record, time (n,) s, and what `get` takes as data, of consecutive records of a group.

    The records are those from `begin` to before `end`; default: all. They come from the method on which MDF.iter_get is
    built; iter_get itself gives one channel only.
    """
    first, count = begin, None if end is None else end - begin
    for fragment in mdf._mdf._load_data(mdf.groups[group], record_offset=begin, record_count=count):
        time = np.asarray(mdf.get_master(group, data=fragment), np.float64)
        yield first, time, fragment
        first += time.size


def _raw(mdf: Any, place: Place, first: int, count: int, fragment: Any) -> tuple[NDArray[Any], Any]:
    """Samples of a channel before its conversion, and which are invalid; the number of the record if it is virtual."""
    group, index = place
    if getattr(mdf.groups[group].channels[index], "channel_type", 0) in _VIRTUAL:
        return np.arange(first, first + count), None
    raw, invalid = mdf.get(
        group=group, index=index, data=fragment, samples_only=True, raw=True, ignore_invalidation_bits=True
    )
    return raw, invalid


def _values(mdf: Any, place: Place, first: int, count: int, fragment: Any) -> Array:
    """Values (count,) of a channel, NaN where invalid and where a conversion gives a text in place of a number."""
    raw, invalid = _raw(mdf, place, first, count, fragment)
    conversion = mdf.groups[place[0]].channels[place[1]].conversion
    if conversion is not None and mdf.version >= "4" and conversion.conversion_type == _RANGE_TABLE:
        raw = _range_values(conversion, raw)
    elif conversion is not None and not _names_only(conversion):
        raw = conversion.convert(raw)
    if raw.dtype.kind not in "biuf" or raw.shape != (count,):
        return np.full(count, np.nan)
    values = raw.astype(np.float64)
    if invalid is not None:
        values[np.asarray(invalid, bool)] = np.nan
    return values


def _range_values(conversion: Any, raw: NDArray[Any]) -> Array:
    """Value ranges to values: the upper edge belongs to a range of integers only. asammdf 8.8 misplaces integers."""
    values = np.full(raw.shape, float(conversion.default))
    for k in reversed(range((conversion.val_param_nr - 1) // 3)):  # the first range that fits counts
        low, high = conversion[f"lower_{k}"], conversion[f"upper_{k}"]
        values[(raw >= low) & ((raw < high) if raw.dtype.kind == "f" else (raw <= high))] = conversion[f"phys_{k}"]
    return values


def _names_only(conversion: Any) -> bool:
    """Whether a conversion only gives the numbers names."""
    blocks = (getattr(conversion, "referenced_blocks", None) or {}).values()
    named = bool(blocks) and all(block is None or isinstance(block, bytes) for block in blocks)
    return named or conversion.conversion_type in _NAME_TABLES


def _columns(mdf: Any, notes: list[str]) -> tuple[dict[str, Column], dict[str, Place]]:
    """The channels that are numbers with a time; groups without time and arrays are noted."""
    found: list[tuple[str, str, Place]] = []
    clocks: set[str] = set()
    arrays = []
    labels = [_label(mdf, number) for number in range(len(mdf.groups))]
    for number, group in enumerate(mdf.groups):
        flags = group.channel_group.flags if mdf.version >= "4" else 0
        if flags & _VARIABLE_LENGTH_GROUP:
            continue
        clock = labels[number] if labels.count(labels[number]) == 1 else f"{labels[number]} {number}"
        clock = unused_name(clock, clocks)
        clocks.add(clock)
        channels = [
            (index, channel)
            for index, channel in enumerate(group.channels)
            if index != mdf.masters_db.get(number) and not (flags & _BUS_EVENT and _BUS_PART.match(channel.name))
        ]
        if channels and not _timed(mdf, number):
            notes.append(f"group {clock!r} of {len(channels)} channels left out: it has no time")
            continue
        for index, channel in channels:
            parts, kind = group.channel_dependencies[index], getattr(channel, "channel_type", 0)
            if parts:
                arrays += [] if isinstance(parts[0], tuple) else [channel.name]
            elif channel.dtype_fmt.kind in "biuf" and not channel.dtype_fmt.shape and kind != _VARIABLE_LENGTH:
                found.append((channel.name, clock, (number, index)))
    if arrays:
        notes.append(f"{len(arrays)} arrays left out: {', '.join(arrays[:10])}")
    total = Counter(name for name, _, _ in found)
    columns: dict[str, Column] = {}
    places = {}
    for name, clock, place in found:
        channel = mdf.groups[place[0]].channels[place[1]]
        unique = unused_name(name if total[name] == 1 else f"{name}@{clock}", columns)
        unit = (channel.conversion and channel.conversion.unit) or channel.unit or None
        columns[unique] = Column(name=unique, unit=unit, clock=clock)
        places[unique] = place
    return columns, places


def _label(mdf: Any, number: int) -> str:
    """What the file calls a group; its number where it has no name."""
    block = mdf.groups[number].channel_group
    if mdf.version >= "4":
        source = block.acq_source
        label = block.acq_name or (source and (source.name or source.path))
    else:
        label = block.comment
    return label if label and len(label) <= _LONGEST_LABEL and "\n" not in label else str(number)


def _timed(mdf: Any, group: int) -> bool:
    """Whether the master channel of a group is a time."""
    if mdf.version >= "4" and mdf.groups[group].channel_group.flags & _REMOTE_MASTER:
        group = mdf.groups[group].channel_group.cg_master_index
    master = mdf.masters_db.get(group)
    return master is not None and getattr(mdf.groups[group].channels[master], "sync_type", _TIME) == _TIME


def _can_log(
    name: str, mdf: Any, databases: Sequence[str | Path], progress: ReadProgress, notes: list[str], *, required: bool
) -> CanLog | None:
    """The signals in the CAN frames of the file; None where it has no frames, or none that is known or `required`."""
    parts: dict[int, dict[str, int]] = {}
    for number, group in enumerate(mdf.groups):
        frame = {c.name.rpartition(".")[2]: k for k, c in enumerate(group.channels) if "CAN_DataFrame." in c.name}
        if {"ID", "DataBytes"} <= frame.keys() and _timed(mdf, number) and group.channel_group.cycles_nr:
            parts[number] = frame
    if not parts:
        return None
    try:
        log = open_can_log(name, partial(_batches, mdf, parts), databases, progress)
    except SignalError as error:
        if required:
            raise
        load(databases)  # a database that cannot be used remains an error
        notes.append(str(error).removeprefix(f"{name}: "))
        return None
    notes += log.notes
    return log


def _batches(mdf: Any, parts: Mapping[int, Mapping[str, int]], notes: list[str]) -> Iterator[tuple[Frames, float]]:
    """The CAN frames of some groups, one group after the other; damage of one ends it, with a note."""
    for number, (group, frame) in enumerate(parts.items(), 1):
        with damage() as troubles:
            for first, time, fragment in _fragments(mdf, group):
                if time.size:
                    yield _frames(mdf, group, frame, first, time, fragment), number / len(parts)
        notes += [f"broken CAN frames of group {group}: {why}" for why in troubles]


def _frames(mdf: Any, group: int, frame: Mapping[str, int], first: int, time: Array, fragment: Any) -> Frames:
    """The CAN frames in some records, by the names of the standard for bus logging."""
    count = time.size

    def part(name: str, default: int) -> NDArray[np.int64]:
        if name not in frame:
            return np.full(count, default, np.int64)
        values = _values(mdf, (group, frame[name]), first, count, fragment)
        return np.where(np.isfinite(values), values, default).astype(np.int64)

    number, said = part("ID", 0), part("DataLength", -1)
    payload, _ = _raw(mdf, (group, frame["DataBytes"]), first, count, fragment)
    payload = np.ascontiguousarray(payload).view(np.uint8).reshape(len(payload), -1)[:count, :64]
    width = payload.shape[1]
    data = np.zeros((count, max(8, width)), np.uint8)
    data[: len(payload), :width] = payload
    coded = _PAYLOAD_SIZES[np.clip(part("DLC", 15), 0, 15)]
    length = np.minimum(width, np.where(said < 0, coded, said)).astype(np.int32)
    data[np.arange(data.shape[1]) >= length[:, None]] = 0
    good = np.isfinite(time) & (np.arange(count) < len(payload))  # a file that is cut short lacks payloads
    extended = (number >> 31 & 1 != 0) | (number & 0x1FFFFFFF > 0x7FF) | (part("IDE", 0) != 0)
    return Frames(
        time=time[good],
        id=(number & 0x1FFFFFFF).astype(np.uint32)[good],
        extended=extended[good],
        bus=(part("BusChannel", 0) & 0x7FFFFFFF).astype(np.int32)[good],
        data=data[good],
        length=length[good],
    )


def evaluate(formula: str, variables: Mapping[str, Any]) -> Array:
    """Value of a formula such as "3*X1+sin(X1)": numbers, + - * / **, brackets, elementary functions, and the variables
    X, X1, P1 to P6, INF and NaN.

    A ValueError for anything else in the formula, or more than `MAX_FORMULA` characters.
    """
    if len(formula) > MAX_FORMULA:
        raise ValueError(f"a formula of {len(formula)} characters; at most {MAX_FORMULA} are supported")
    try:
        tree = ast.parse(formula.strip(), mode="eval")
        with np.errstate(all="ignore"):  # a value outside of a function's domain is NaN
            return np.asarray(_formula_value(tree.body, variables), dtype=np.float64)
    except (SyntaxError, TypeError, ValueError, LookupError, RecursionError, MemoryError, OverflowError):
        raise ValueError(f"the formula {formula[:60]!r} is not supported") from None


def _formula_value(node: ast.AST, variables: Mapping[str, Any]) -> Any:
    match node:
        case ast.Constant(value=int() | float() as number) if not isinstance(number, bool):
            return np.float64(number)
        case ast.Name(id=name) if name in _VARIABLES:
            return np.asarray(variables[name], dtype=np.float64)
        case ast.BinOp(left=left, op=sign, right=right):
            return _OPERATORS[type(sign)](_formula_value(left, variables), _formula_value(right, variables))
        case ast.UnaryOp(op=sign, operand=operand):
            return _OPERATORS[type(sign)](_formula_value(operand, variables))
        case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]):
            return _FUNCTIONS[name](*(_formula_value(argument, variables) for argument in arguments))
    raise ValueError


def replace_evaluation() -> None:
    """Let asammdf evaluate formulas by `evaluate` only; an unsupported one is an error, not a raw value."""

    def evaluate_locally(formula: str) -> Array:
        return evaluate(formula, sys._getframe(1).f_locals)  # as numexpr does

    def refuse(*_: object, **__: object) -> None:
        raise ValueError("a formula is not supported")

    modules: tuple[Any, ...] = (v2_v3_blocks, v4_blocks)
    for blocks in modules:
        blocks.evaluate = evaluate_locally
        blocks.symbols = blocks.lambdify = refuse


replace_evaluation()
