"""Marks of missing samples: numbers such as 999 or 65535 that a logger writes where it has no value."""

import re
from collections import Counter
from collections.abc import Iterable

import numpy as np

from fifthwheel.base.types import Array

_LEAST = 3
"""Samples with exactly the same number, in one piece of a log; fewer are spikes."""
_NINES = re.compile("99+")
_FULL = {str(2**n - 1) for n in (*range(7, 17), 31, 32)} | {str(2**n) for n in (15, 16, 31)}
"""Digits of the largest numbers of n bits, at any scale: 65535, 655.35."""
_LARGE = 1e9
"""No signal of a truck has such a number in any unit."""


class MissingMarks:
    """Replaces the marks in a column that arrives in pieces by NaN.

    A mark is the largest or the smallest number, at least three times, as a mark is written, and further from all other
    samples than they are from one another.
    """

    def __init__(self, stated: Iterable[float] | None = None) -> None:
        """Take the marks that the signal map states; None to find them."""
        self._counts = Counter[float](dict.fromkeys(stated or (), 0))
        self._finds = stated is None

    def without(self, values: Array) -> Array:
        """The samples (n,), NaN in place of marks."""
        if self._finds:
            self._find(values)
        if not self._counts:
            return values
        is_mark = np.isin(values, list(self._counts))
        if not is_mark.any():
            return values
        for mark, count in zip(*np.unique(values[is_mark], return_counts=True), strict=True):
            self._counts[float(mark)] += int(count)
        return np.where(is_mark, np.nan, values)

    def notes(self, column: str) -> list[str]:
        """One sentence for each mark that was found."""
        if not self._finds:
            return []
        meaning = "a mark of missing samples? They are left out; missing = [] keeps them"
        return [f"{column}: {count} samples are exactly {mark:.10g}, {meaning}" for mark, count in self._counts.items()]

    @np.errstate(over="ignore", invalid="ignore")  # damaged values may overflow
    def _find(self, values: Array) -> None:
        rest = values
        while rest.size:
            ends = {float(np.fmin.reduce(rest)), float(np.fmax.reduce(rest))}
            mark = next((end for end in ends if end in self._counts or _is_mark(end, rest)), None)
            if mark is None:
                return
            self._counts.setdefault(mark, 0)
            rest = rest[rest != mark]


def _is_mark(value: float, values: Array) -> bool:
    """Whether the smallest or largest of values (n,), some of them NaN, is a mark."""
    digits = f"{abs(value):.10g}".replace(".", "").strip("0")
    if not (abs(value) >= _LARGE or _NINES.fullmatch(digits) or digits in _FULL):
        return False
    others = values[(values != value) & ~np.isnan(values)]
    least = others.size and np.abs(others - value).min() > np.ptp(others)
    return bool(least and np.count_nonzero(values == value) >= _LEAST)
