"""Arrays as a type, and the equality and parts of data that have them."""

from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
"""Floating-point array; each docstring gives its shape."""
Indices = NDArray[np.int64]


class ComparedByContents:
    """Base of dataclasses (`eq=False`) that are equal if their fields are, also arrays, by value."""

    __hash__ = None  # type: ignore[assignment]

    def __eq__(self, other: object) -> bool:
        if type(other) is not type(self):
            return NotImplemented
        return _equal_fields(self, other)


def _equal_fields(a: Any, b: Any) -> bool:
    return all(_equal(getattr(a, f.name), getattr(b, f.name)) for f in fields(a) if f.compare)


def _equal(a: Any, b: Any) -> bool:
    if isinstance(a, np.ndarray) or isinstance(b, np.ndarray):
        numeric = np.asarray(a).dtype.kind in "fc"
        return type(a) is type(b) and a.dtype == b.dtype and np.array_equal(a, b, equal_nan=numeric)
    if isinstance(a, Mapping) and isinstance(b, Mapping):
        return a.keys() == b.keys() and all(_equal(value, b[key]) for key, value in a.items())
    if isinstance(a, list | tuple) and isinstance(b, list | tuple):
        return len(a) == len(b) and all(map(_equal, a, b))
    if is_dataclass(a) and type(a) is type(b):
        return _equal_fields(a, b)
    return bool(a == b) or (a != a and b != b)  # NaN


def selected(data: Any, places: Sequence[int] | Indices) -> Any:
    """A dataclass about some of n names: these rows of its tuples and vectors (n,), and columns of matrices (n, n)."""
    rows = np.asarray(places, dtype=np.int64)

    def part(value: Any) -> Any:
        if isinstance(value, np.ndarray):
            return value[np.ix_(*[rows] * value.ndim)]
        return tuple(value[i] for i in rows) if isinstance(value, tuple) else value

    return replace(data, **{field.name: part(getattr(data, field.name)) for field in fields(data)})
