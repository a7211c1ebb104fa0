"""What is not known of a truck and its sensors, and the other trucks that it may therefore be.

A state's variance given the measurements is the filter's own, which takes every parameter as known, plus that of the
filter's answer over the parameters. The latter is had from pairs of trucks, p plus and minus each column of a square
root of the parameters' covariance (S. J. Julier and J. K. Uhlmann, A new extension of the Kalman filter to nonlinear
systems, AeroSense 1997). It is exact where the answer is linear in p; products of two errors are left out. The
parameters are not learned from the record: where it would have told more of them, the variance is too large.
"""

from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from fifthwheel.errors import SignalError

Array = NDArray[np.float64]

NEGLIGIBLE = 1e-6
"""Of the trace of the correlations: a column with less is left out."""
REACH = 0.5
"""No parameter is moved by more than a factor of exp of this; a longer column is gone along in part and its effect
scaled up. Far from its own numbers a truck may be unstable, or quicker than the steps that its record was cut into."""


def of_sensor(name: str) -> bool:
    """Whether a name among the uncertain is a sensor's error rather than a parameter of the truck."""
    return name.partition("@")[0].endswith((".offset", ".gain", ".delay"))


class Pair(NamedTuple):
    """Two trucks on either side of the known one."""

    ahead: dict[str, float]  # values by name
    behind: dict[str, float]
    part: float  # how much of the column they are away


@dataclass(frozen=True, kw_only=True, eq=False)
class Uncertainty:
    """Joint uncertainty of a truck's parameters and its sensors' errors.

    Raises:
        SignalError: a name comes twice, or the matrix is not the covariance of so many.
    """

    names: tuple[str, ...]
    """Vehicle paths, or sensors' errors such as "steer.tractor.front.offset", "yaw_rate.tractor.gain"; those that one
    log has for itself as "<name>@<log>", those that any other log has as "<name>@"."""
    covariance: Array
    """(k, k), SI of each."""

    def __post_init__(self) -> None:
        names, P = tuple(self.names), np.array(self.covariance, dtype=np.float64)
        k = len(names)
        P = P.reshape(0, 0) if not k and not P.size else P
        object.__setattr__(self, "names", names)
        object.__setattr__(self, "covariance", P)
        if len(set(names)) < k:
            raise SignalError(f"uncertainty: {', '.join(sorted({n for n in names if names.count(n) > 1}))} comes twice")
        if P.shape != (k, k):
            raise SignalError(f"uncertainty: expected a covariance of {k} by {k} for its names, got {P.shape}")
        if not np.isfinite(P).all():
            bad = [name for name, row in zip(names, P, strict=True) if not np.isfinite(row).all()]
            raise SignalError(f"uncertainty: the covariance of {', '.join(bad)} is not finite; leave them out")
        scale = np.sqrt(np.maximum(np.diag(P), 0.0))
        slack = 1e-6 * np.outer(scale, scale)
        if (
            (np.abs(P - P.T) > slack).any()
            or (np.diag(P) < 0).any()
            or (np.abs(P) > np.outer(scale, scale) + slack).any()
        ):
            raise SignalError("uncertainty: not a covariance; it is symmetric, and no correlation is beyond 1")
        if k and np.linalg.eigvalsh(self._correlation(scale)).min() < -1e-6 * k:
            raise SignalError("uncertainty: not a covariance; some combination of its names has a negative variance")

    def as_dict(self) -> dict[str, Any]:
        """Names and rows, fit for JSON."""
        return {"names": list(self.names), "covariance": self.covariance.tolist()}

    @classmethod
    def from_dict(cls, told: Mapping[str, Any]) -> Self:
        """From what `as_dict` gave.

        Raises:
            SignalError: it is something else.
        """
        try:
            return cls(names=tuple(map(str, told["names"])), covariance=np.array(told["covariance"], dtype=np.float64))
        except (KeyError, TypeError, ValueError) as error:
            if isinstance(error, SignalError):
                raise
            raise SignalError(f"uncertainty: expected names and a covariance in rows of numbers ({error!r})") from None

    def of_log(self, log: str) -> "Uncertainty":
        """Without what other logs have for themselves, and with this one's own by its plain name; of a log that has
        none here, what is told of any, as "<name>@"."""
        kept = [(i, *name.partition("@")) for i, name in enumerate(self.names)]
        mine = log if any(own and of == log for _, _, own, of in kept) else ""
        here = [(i, name) for i, name, own, of in kept if not own or of == mine]
        return self._part([i for i, _ in here], [name for _, name in here])

    def among(self, names: Container[str]) -> "Uncertainty":
        """Of these names only."""
        here = [i for i, name in enumerate(self.names) if name in names]
        return self._part(here, [self.names[i] for i in here])

    def columns(self) -> Array:
        """A square root S of the covariance, S S', (k, c): the principal axes of the correlations, those left out that
        do not matter."""
        scale = np.sqrt(np.diag(self.covariance))
        values, axes = np.linalg.eigh(self._correlation(scale))
        kept = values > NEGLIGIBLE * values.sum()
        return np.asarray(scale[:, None] * axes[:, kept] * np.sqrt(values[kept]))

    def pairs(self, values: Mapping[str, float], positive: Container[str]) -> list[Pair]:
        """Two trucks for each column.

        Args:
            values: what is known, by name.
            positive: names of what is above zero, which moves by its logarithm and so stays there.
        """
        found = []
        known = np.array([values[name] for name in self.names])
        stretched = np.array([name in positive for name in self.names], dtype=bool)
        for column in self.columns().T:
            log = np.divide(column, known, out=np.zeros_like(column), where=stretched)
            part = min(1.0, REACH / max(float(np.abs(log).max(initial=0.0)), 1e-300))
            moved = [np.where(stretched, known * np.exp(step * log), known + step * column) for step in (part, -part)]
            ahead, behind = (dict(zip(self.names, point.tolist(), strict=True)) for point in moved)
            found.append(Pair(ahead, behind, part))
        return found

    def _correlation(self, scale: Array) -> Array:
        """(k, k); zeros for what is known exactly."""
        inverse = np.divide(1.0, scale, out=np.zeros_like(scale), where=scale > 0)
        return np.asarray(self.covariance * np.outer(inverse, inverse))

    def _part(self, places: Sequence[int], names: Sequence[str]) -> "Uncertainty":
        return Uncertainty(names=tuple(names), covariance=self.covariance[np.ix_(places, places)])
