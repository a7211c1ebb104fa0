"""Joint uncertainty of parameters and sensor errors, and the sigma points of the vehicle that belong to it.

The variance of a state is the sum of the filter's variance, for known parameters, and the variance of the filter's
result over the parameters. The latter follows from pairs of vehicles with parameters p plus and minus each column of a
square root of their covariance (S. J. Julier and J. K. Uhlmann, A new extension of the Kalman filter to nonlinear
systems, AeroSense 1997); for a filter, they give the directions of its sensitivities (`parameter_variance`). The
variance is exact where the result is linear in p; products of two errors are neglected. The record does not update the
parameters: if it contains information on them, the variance is too large.
"""

from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple, Self

import numpy as np

from fifthwheel.base.errors import SignalError
from fifthwheel.base.lazy import require
from fifthwheel.base.names import split_log
from fifthwheel.base.types import Array, ComparedByContents
from fifthwheel.truck.quantities import quantity_of

if TYPE_CHECKING:
    import pandas as pd

NEGLIGIBLE = 1e-6
"""Columns with a smaller fraction of the trace of the correlation matrix are omitted."""
MAX_LOG_CHANGE = 0.5
"""Largest change of the logarithm of a parameter at a sigma point. A longer column is shortened and its effect scaled:
a very different vehicle may be unstable, or need shorter steps than the record has."""


def positive_parameters(values: Mapping[str, float]) -> frozenset[str]:
    """Names of the parameters of a vehicle above 0 that cannot change their sign."""
    return frozenset(name for name, value in values.items() if value > 0 and not quantity_of(name).signed)


def displaced(names: Sequence[str], values: Array, deviations: Array, positive: Container[str]) -> Array:
    """Values (k,) plus deviations (..., k), SI; positive ones change by their logarithm, v exp(d / v)."""
    logarithmic = np.array([name in positive for name in names], dtype=bool)
    relative = np.divide(deviations, values, out=np.zeros_like(deviations), where=logarithmic)
    return np.where(logarithmic, values * np.exp(relative), values + deviations)


class SigmaPointPair(NamedTuple):
    """Parameters of two vehicles on either side of the given one."""

    plus: dict[str, float]  # values by name, SI
    minus: dict[str, float]  # values by name, SI
    step: float  # distance of both from the given vehicle, as a fraction of the column


@dataclass(frozen=True, kw_only=True, eq=False)
class Uncertainty(ComparedByContents):
    """Joint uncertainty of parameters of a vehicle and errors of its sensors.

    Raises:
        SignalError: a name occurs twice, or the matrix is not a covariance of the size of the names.

    Example:
        >>> import fifthwheel as fw
        >>> known = fw.Uncertainty(names=("tractor.front.cornering_stiffness",), covariance=[[2.0e4**2]])
        >>> known.among(["tractor.mass"]).names
        ()
    """

    names: tuple[str, ...]
    """Paths of parameters, and sensor errors such as "steer.tractor.front.offset" or "yaw_rate.tractor.gain". A sensor
    error of one log is "<name>@<log>", and "<name>@" is that of all other logs. "bank.road" is the bank of the road."""
    covariance: Array
    """(k, k), SI."""

    def __post_init__(self) -> None:
        names, P = tuple(self.names), np.array(self.covariance, dtype=np.float64)
        k = len(names)
        P = P.reshape(0, 0) if not k and not P.size else P
        object.__setattr__(self, "names", names)
        object.__setattr__(self, "covariance", P)
        if len(set(names)) < k:
            raise SignalError(
                f"uncertainty: {', '.join(sorted({n for n in names if names.count(n) > 1}))} occurs twice; remove one"
            )
        if P.shape != (k, k):
            raise SignalError(
                f"uncertainty: expected a covariance of {k} by {k}, got {P.shape}; give a row and column for each name"
            )
        if not np.isfinite(P).all():
            bad = [name for name, row in zip(names, P, strict=True) if not np.isfinite(row).all()]
            raise SignalError(f"uncertainty: the covariance of {', '.join(bad)} is not finite; remove these names")
        scale = np.sqrt(np.maximum(np.diag(P), 0.0))
        rounding = 1e-6 * np.outer(scale, scale)
        if (
            (np.abs(P - P.T) > rounding).any()
            or (np.diag(P) < 0).any()
            or (np.abs(P) > np.outer(scale, scale) + rounding).any()
        ):
            raise SignalError(
                "uncertainty: not a covariance; expected a symmetric matrix without a negative variance and without a"
                " correlation beyond 1; correct it"
            )
        if k and np.linalg.eigvalsh(self._correlation(scale)).min() < -1e-6 * k:
            raise SignalError(
                "uncertainty: not a covariance; expected no negative eigenvalue of the matrix; correct its correlations"
            )

    def as_dict(self) -> dict[str, Any]:
        """Names and rows for JSON."""
        return {"names": list(self.names), "covariance": self.covariance.tolist()}

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Self:
        """Inverse of `as_dict`.

        Raises:
            SignalError: the data have another form.
        """
        try:
            return cls(names=tuple(map(str, data["names"])), covariance=np.array(data["covariance"], dtype=np.float64))
        except (KeyError, TypeError, ValueError) as error:
            if isinstance(error, SignalError):
                raise
            raise SignalError(
                f"uncertainty: expected names and a covariance in rows of numbers, got {error!r}; write it by as_dict"
            ) from None

    def to_pandas(self) -> "pd.DataFrame":
        """The covariance in SI, by name.

        Raises:
            FifthwheelError: pandas is not installed.
        """
        names = list(self.names)
        frame: pd.DataFrame = require("pandas", "pandas").DataFrame(self.covariance, index=names, columns=names)
        return frame

    def of_log(self, log: str) -> "Uncertainty":
        """The uncertainty for one log: names of other logs are removed, and its own names lose "@<log>".

        A log without names of its own takes those of "<name>@".
        """
        parsed = [(i, *split_log(name)) for i, name in enumerate(self.names)]
        source = log if any(of_log == log for _, _, of_log in parsed) else ""
        selected = [(i, name) for i, name, of_log in parsed if of_log is None or of_log == source]
        return self._subset([i for i, _ in selected], [name for _, name in selected])

    def among(self, names: Container[str]) -> "Uncertainty":
        """The uncertainty of these names only."""
        selected = [i for i, name in enumerate(self.names) if name in names]
        return self._subset(selected, [self.names[i] for i in selected])

    def with_independent(self, name: str, sigma: float) -> "Uncertainty":
        """The uncertainty with a further name, which is independent of the others."""
        covariance = np.pad(self.covariance, (0, 1))
        covariance[-1, -1] = sigma**2
        return Uncertainty(names=(*self.names, name), covariance=covariance)

    def columns(self) -> Array:
        """A square root S (k, c) of the covariance, S S': its Cholesky factor in the order of the names.

        A name whose variance follows from the names before it has no column, so c may be less than k. The factor
        depends continuously on the covariance, as the principal axes of equal variances do not.
        """
        scale = np.sqrt(np.diag(self.covariance))
        rest, columns = self._correlation(scale), []
        least = NEGLIGIBLE * float(np.trace(rest))
        for i in range(len(scale)):
            if rest[i, i] > least:
                columns.append(rest[:, i] / np.sqrt(rest[i, i]))
                rest = rest - np.outer(columns[-1], columns[-1])
        return np.asarray(scale[:, None] * np.array(columns).reshape(len(columns), len(scale)).T)

    def pairs(self, values: Mapping[str, float], positive: Container[str]) -> list[SigmaPointPair]:
        """Two sigma points for each column of the square root.

        Args:
            values: given values by name, SI.
            positive: names of positive values; they change by their logarithm, so they remain positive.
        """
        pairs = []
        given = np.array([values[name] for name in self.names])
        logarithmic = np.array([name in positive for name in self.names], dtype=bool)
        for column in self.columns().T:
            log = np.divide(column, given, out=np.zeros_like(column), where=logarithmic)
            step = min(1.0, MAX_LOG_CHANGE / max(float(np.abs(log).max(initial=0.0)), 1e-300))
            points = [np.where(logarithmic, given * np.exp(s * log), given + s * column) for s in (step, -step)]
            plus, minus = (dict(zip(self.names, point.tolist(), strict=True)) for point in points)
            pairs.append(SigmaPointPair(plus, minus, step))
        return pairs

    def _correlation(self, scale: Array) -> Array:
        """Correlation matrix (k, k); zeros for names without variance. `scale` are the standard deviations (k,)."""
        inverse = np.divide(1.0, scale, out=np.zeros_like(scale), where=scale > 0)
        return np.asarray(self.covariance * np.outer(inverse, inverse))

    def _subset(self, indices: Sequence[int], names: Sequence[str]) -> "Uncertainty":
        """The uncertainty of the names at these indices, under other names."""
        return Uncertainty(names=tuple(names), covariance=self.covariance[np.ix_(indices, indices)])
