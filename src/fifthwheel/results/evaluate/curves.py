"""Characteristic curves of a simulation's results and of a log, and the tolerance band around those of the log.

Histories count from the first steering and from their mean in the second before. Characteristics over the lateral
acceleration are compared without the value at 0 of a straight line through them, since a sensor has an offset. The
relative part of a tolerance is that of the largest value of the log's curve; for a gain, of each value.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from fifthwheel.base.formatting import shown
from fifthwheel.base.names import split_kind
from fifthwheel.base.plots import Axis, Band, Item, Line, Panel, Plot
from fifthwheel.base.types import Array
from fifthwheel.data.channels import CHANNELS, STEER, is_of
from fifthwheel.results.evaluate.evaluation import AXES, TITLES, Evaluation
from fifthwheel.results.evaluate.motion import gain_unit
from fifthwheel.results.evaluate.repetitions import ACTIVE, ENTRY
from fifthwheel.results.evaluate.tolerances import DEFAULTS, Tolerance, tolerance_of
from fifthwheel.truck.spoken_names import spoken

Judgement = Literal["inside", "outside", "undecided"]
ENOUGH = 0.95
"""Fraction of the points that are inside in a curve that is."""
MARGIN = 3.0
"""Of the points of a curve, in sigma: by two, 5 % of them would be outside by noise alone."""
COVERED = 0.5
"""Least fraction of the log's points at which the results have a value, for a judgement."""


def judged(is_inside: bool, is_outside: bool) -> Judgement:
    """The judgement from what is certain."""
    return "inside" if is_inside else "outside" if is_outside else "undecided"


@dataclass(frozen=True, kw_only=True)
class ComparedCurve:
    """A curve of the results beside that of the log, at the n points that both have, SI."""

    name: str
    axis: str
    """Name of x: "time", "frequency" or "lateral_acceleration"."""
    unit: str
    x: Array = field(repr=False)
    log: Array = field(repr=False)
    results: Array = field(repr=False)
    sigma: Array = field(repr=False)
    """Of the difference by noise, (n,); NaN where it is not known."""
    limit: Array = field(repr=False)
    """Half of the width of the band, (n,)."""
    counted: NDArray[np.bool_] = field(repr=False)
    """Points on which the judgement depends, (n,): all, or of a history those above a tenth of the largest value."""
    covered: float
    """Fraction of the log's points at which the results have a value."""
    tolerance: Tolerance
    same_input: bool = True
    """Whether the steer angle is the same; without it a history is undecided."""

    @property
    def title(self) -> str:
        """The name in words."""
        kind, signal = split_kind(self.name)
        return TITLES.get(self.name) or (
            f"{spoken(signal)}, {kind}" if kind in ("gain", "phase") else spoken(self.name)
        )

    @property
    def inside(self) -> float:
        """Fraction of the points inside of the band."""
        return self._fraction(self._difference <= self.limit)

    @property
    def exceedance(self) -> float:
        """Largest distance of the results outside of the band; 0 if there is none."""
        return float(np.max(self._difference - self.limit, initial=0.0))

    @property
    def verdict(self) -> Judgement:
        """Whether enough points of the results are inside of the band, with `MARGIN`."""
        if self.covered < COVERED or not self.same_input:
            return "undecided"
        inside = self._fraction(self._difference + MARGIN * self.sigma <= self.limit)
        outside = self._fraction(self._difference - MARGIN * self.sigma > self.limit)
        return judged(inside >= ENOUGH, outside > 1 - ENOUGH)

    @property
    def _difference(self) -> Array:
        return np.asarray(np.abs(self.results - self.log))

    def _fraction(self, points: NDArray[np.bool_]) -> float:
        return float(np.mean(points[self.counted])) if self.counted.any() else 0.0

    def plot(self) -> Plot:
        """The curve of the log with its band, and that of the results."""
        unit = shown(self.unit)
        log, results, limit = (unit.factor * values for values in (self.log, self.results, self.limit))
        items: list[Item] = [
            Band(self.x, log - limit, log + limit, name="tolerance"),
            Line(self.x, log, name="log"),
            Line(self.x, results, name="results"),
        ]
        return Plot(panels=[Panel(items=items, x=AXES[self.axis], y=Axis(unit=unit.name))])


def compared_curves(results: Evaluation, log: Evaluation, stated: Mapping[str, str]) -> Iterator[ComparedCurve]:
    """The curves that both evaluations have, the steer angle first."""
    axis, same_input = next(iter(log.arrays)), True
    for name in [name for name in curve_names(log) if name in results.arrays]:
        curve = _compared(results, log, name, axis, stated)
        is_input = axis == "time" and is_of(name, STEER)
        yield curve if is_input else replace(curve, same_input=same_input)
        same_input &= not (is_input and curve.verdict == "outside")


def curve_names(evaluation: Evaluation) -> list[str]:
    """The columns that are compared."""
    return [name for name in list(evaluation.arrays)[1:] if split_kind(name)[0] in DEFAULTS]


def _compared(results: Evaluation, log: Evaluation, name: str, axis: str, stated: Mapping[str, str]) -> ComparedCurve:
    kind, signal = split_kind(name)
    unit = _unit(kind, signal)
    x, own, own_sigma = _columns(log, axis, name)
    other_x, *columns = _columns(results, axis, name)
    other, other_sigma = (np.interp(x, other_x, values, left=np.nan, right=np.nan) for values in columns)
    both = np.isfinite(own) & np.isfinite(other)
    covered = both.sum() / max(np.isfinite(own).sum(), 1)
    x, own, other, sigma = (values[both] for values in (x, own, other, np.hypot(own_sigma, other_sigma)))
    counted = np.ones(x.size, dtype=bool)
    if axis != "frequency" and x.size:
        own, other = own - _offset(axis, x, own), other - _offset(axis, x, other)
    elif kind == "phase" and x.size:
        other = other + 2 * np.pi * np.round(np.median(own - other) / (2 * np.pi))
    size = np.abs(own) if kind == "gain" else np.full(x.size, np.abs(own).max(initial=0.0))
    if axis == "time":
        counted = np.maximum(np.abs(own), np.abs(other)) > ACTIVE * size
    tolerance = tolerance_of(name, unit, stated)
    return ComparedCurve(
        name=name,
        axis=axis,
        unit=unit,
        x=x,
        log=own,
        results=other,
        sigma=sigma,
        limit=tolerance.relative * size + tolerance.absolute,
        counted=counted,
        covered=float(covered),
        tolerance=tolerance,
    )


def _columns(evaluation: Evaluation, axis: str, name: str) -> tuple[Array, Array, Array]:
    """x, values and sigma of a curve, (n,); the time from the first steering."""
    x, values = evaluation.arrays[axis] - (evaluation.start or 0.0), evaluation.arrays[name]
    return x, values, np.broadcast_to(evaluation.noise.get(name, np.nan), values.shape)


def _offset(axis: str, x: Array, values: Array) -> float:
    """What a curve has before the first steering, or without lateral acceleration."""
    if axis == "time":
        before = (x >= -ENTRY) & (x < 0)
        return float(values[before].mean()) if before.any() else 0.0
    return float(np.polyfit(x, values, 1)[1]) if x.size > 2 else 0.0


def _unit(kind: str, signal: str) -> str:
    if kind == "gain":
        return gain_unit(signal)
    return CHANNELS[kind].unit if kind in CHANNELS else "rad"
