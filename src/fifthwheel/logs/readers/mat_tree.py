"""What a .mat file holds, of whatever version: structs, lists, texts and arrays that are read when needed."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

DAMAGE = (Exception, MemoryError)
"""What h5py raises for damaged bytes: anything, and for a damaged size a MemoryError."""
DEEPEST = 16
MOST_ITEMS = 20_000


@dataclass(frozen=True, kw_only=True, eq=False)
class Numbers:
    """An array of real numbers, as columns along its longest side."""

    length: int
    columns: int
    read: Callable[[int, int, int], Array]
    """Column, first and last row (exclusive) to values."""


@dataclass(frozen=True)
class Opaque:
    """An object of MATLAB that only MATLAB can read."""

    kind: str


Node = dict[str, Any] | list[Any] | str | Numbers | Opaque | None
"""dict: a struct; list: a struct array or a cell; None: what holds nothing of use."""


def numbers(shape: tuple[int, ...], dtype: np.dtype[Any], get: Callable[[Any], Any]) -> Numbers | None:
    """An array by its sides, its type, and what gives a part of it; None where it is not of real numbers."""
    sides = [k for k, side in enumerate(shape) if side > 1]
    if dtype.kind not in "biuf" or 0 in shape or len(sides) > 2 or not shape:
        return None
    long = max(sides, key=lambda k: shape[k]) if sides else 0
    across = next((k for k in sides if k != long), None)

    def read(column: int, first: int, last: int) -> Array:
        place: list[Any] = [0] * len(shape)
        place[long] = slice(first, last)
        if across is not None:
            place[across] = column
        return np.asarray(get(tuple(place)), dtype=np.float64).ravel()

    return Numbers(length=shape[long], columns=1 if across is None else shape[across], read=read)
