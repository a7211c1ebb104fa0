"""MATLAB's version 7.3, which is HDF5, and other HDF5 files."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from fifthwheel.logs.readers.mat_tree import DAMAGE, DEEPEST, MOST_ITEMS, Node, Opaque, numbers


def _text(value: object) -> str:
    return value.decode("latin-1") if isinstance(value, bytes) else str(value)


def load_hdf(path: Path, notes: list[str]) -> tuple[dict[str, Node], Callable[[], None]]:
    """Variables by name, and what lets go of the file. What is damaged is left out with a note."""
    found: dict[str, Node] = {}
    try:
        file = h5py.File(path, "r", locking=False)
    except DAMAGE as error:
        notes.append(f"broken: HDF5 cannot open it ({error})")
        return found, lambda: None
    broken: list[str] = []
    try:
        for name in file:
            if not name.startswith("#"):
                found[name] = _safely(file, file, name, 0, broken)
    except DAMAGE as error:
        broken.append(f"after {len(found)} variables ({error})")
    if broken:
        notes.append(f"broken: {len(broken)} variables cannot be read, the first {broken[0]}")
    return found, file.close


def _safely(file: Any, group: Any, name: str, depth: int, broken: list[str]) -> Node:
    try:
        return _node_hdf(file, group[name], depth, broken)
    except DAMAGE as error:
        broken.append(f"{name} ({error})")
        return None


def _node_hdf(file: Any, item: Any, depth: int, broken: list[str]) -> Node:
    if depth > DEEPEST or len(broken) > MOST_ITEMS:
        return None
    kind = _text(item.attrs.get("MATLAB_class", b""))
    if "MATLAB_object_decode" in item.attrs:
        return Opaque(kind or "object")
    if isinstance(item, h5py.Group):
        fields = {name: _safely(file, item, name, depth + 1, broken) for name in item}
        return _array_of_structs(item, fields)
    if not isinstance(item, h5py.Dataset) or "MATLAB_empty" in item.attrs or item.shape is None:
        return None
    if h5py.check_ref_dtype(item.dtype) is not None:
        refs = np.ravel(item[()])[:MOST_ITEMS]
        return [_node_hdf(file, file[ref], depth + 1, broken) if ref else None for ref in refs]
    if kind == "char" and item.dtype.kind == "u":
        return "".join(map(chr, np.ravel(item[()]).tolist())) if item.size < MOST_ITEMS else None
    if h5py.check_string_dtype(item.dtype) is not None:
        return _text(item[()]) if item.shape == () else None
    return numbers(item.shape, item.dtype, lambda place: item[place])


def _array_of_structs(group: Any, fields: dict[str, Node]) -> Node:
    """A struct array is stored as one list a field."""
    lengths = {len(value) for value in fields.values() if isinstance(value, list)}
    if len(lengths) == 1 and all(isinstance(value, list) for value in fields.values()):
        of_cells = all("MATLAB_class" in group[name].attrs for name in fields)
        if not of_cells:
            return [{name: value[k] for name, value in fields.items()} for k in range(lengths.pop())]  # type: ignore[index]
    return fields
