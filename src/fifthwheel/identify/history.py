"""The history of parameter estimates, and when an estimate has settled."""

from dataclasses import dataclass

import numpy as np

from fifthwheel._contents import ComparedByContents
from fifthwheel._types import Array

LAST_FRACTION = 0.1
"""An estimate that settles only within this last fraction of its history has not settled."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ParameterHistory(ComparedByContents):
    """Estimates after each of N samples, all passes one after another, of n parameters."""

    names: tuple[str, ...]
    time: Array  # (N,) s, continues over logs and passes
    values: Array  # (N, n)
    sigma: Array  # (N, n), of the filter
    starts: tuple[int, ...]  # first row of each pass

    @property
    def passes(self) -> int:
        """Number of passes."""
        return len(self.starts)

    def followed_by(self, later: "ParameterHistory") -> "ParameterHistory":
        """This history followed by a later one of the same parameters."""
        return ParameterHistory(
            names=self.names,
            time=np.concatenate([self.time, self.time[-1] + later.time]),
            values=np.concatenate([self.values, later.values]),
            sigma=np.concatenate([self.sigma, later.sigma]),
            starts=(*self.starts, *[len(self.time) + start for start in later.starts]),
        )

    def settled_row(self, name: str, tolerance: float, *, first: int = 0) -> int | None:
        """The row since which a parameter stays within a fraction of its value (`settled_since`), counted from row
        `first`; None if it does not."""
        values = self.values[first:, self.names.index(name)]
        row = settled_since(values, tolerance)
        return row if is_settled(row, len(values)) else None


def settled_since(values: Array, tolerance: float) -> int:
    """The first row from which all values (N,) stay within `tolerance` of their own average (section 2.2.3 of the
    article)."""
    backwards = values[::-1]
    count = np.arange(1, len(values) + 1)
    mean = np.cumsum(backwards) / count
    deviation = np.maximum(np.maximum.accumulate(backwards) - mean, mean - np.minimum.accumulate(backwards))
    return len(values) - 1 - int(np.flatnonzero(deviation <= tolerance * np.abs(mean)).max())


def is_settled(row: int, rows: int) -> bool:
    """Whether a history of so many rows that settles at `row` does so before its last tenth."""
    return row <= (1 - LAST_FRACTION) * rows
