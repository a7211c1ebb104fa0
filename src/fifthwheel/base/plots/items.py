"""A plot as data: what panels show, in which colours, and on which axes.

Items are lines, bands, points, bars, areas, labels, guides and spans. Values are in the units of the axes. NaN
interrupts a line. A colour is "#rrggbb"; None takes the next of the palette. A line or band of more than
`downsample.MAX_POINTS` points has only those that are drawn.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, field
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import ArrayLike

from fifthwheel.base.errors import FifthwheelError
from fifthwheel.base.plots import downsample
from fifthwheel.base.types import Array

BLUE, VERMILLION, GREEN, ORANGE, PURPLE, SKY = "#0072B2", "#D55E00", "#009E73", "#E69F00", "#CC79A7", "#56A0D3"
GREY, DARK = "#8c8c8c", "#333333"
GRID = "#e8e8e8"

CYCLE = (BLUE, VERMILLION, GREEN, ORANGE, PURPLE, SKY, DARK)
"""Colours of the items of a panel that have none of their own, in this order."""


def rgb(colour: str) -> tuple[int, int, int]:
    """Red, green and blue, 0 to 255, of a colour such as "#0072B2"."""
    return int(colour[1:3], 16), int(colour[3:5], 16), int(colour[5:7], 16)


def rgba(colour: str, opacity: float) -> str:
    """A colour with its opacity as CSS writes it.

    >>> rgba("#0072B2", 0.18)
    'rgba(0,114,178,0.18)'
    """
    red, green, blue = rgb(colour)
    return f"rgba({red},{green},{blue},{opacity:g})"


Dash = Literal["solid", "dash", "dot"]
Marker = Literal["circle", "cross", "diamond", "square"]


@dataclass(frozen=True, eq=False, kw_only=True)
class _Item:
    """What all items with arrays of the same length have."""

    name: str = ""
    """In the legend; "" for none."""
    colour: str | None = None
    _arrays: ClassVar[tuple[str, ...]]

    def __post_init__(self) -> None:
        length = None
        for name in self._arrays:
            if getattr(self, name) is None:
                continue
            values = np.atleast_1d(np.asarray(getattr(self, name), dtype=np.float64))
            length = values.size if length is None else length
            if values.shape != (length,):
                raise FifthwheelError(
                    f"{type(self).__name__}.{name}: expected {length} values, one for each of {self._arrays[0]}, "
                    f"got shape {values.shape}; give arrays of the same length"
                )
            object.__setattr__(self, name, values)

    def _keep(self, *arrays: Array) -> None:
        """Keep only what is drawn of a long line, with NaN at its gaps: a report has a hundred lines of a long log."""
        for name, values in zip((*self._arrays, "gaps"), (*arrays, False), strict=True):
            object.__setattr__(self, name, values)


@dataclass(frozen=True, eq=False)
class Line(_Item):
    """A line through points (n,)."""

    x: ArrayLike
    y: ArrayLike
    _: KW_ONLY
    width: float = 1.8
    """Pixels."""
    dash: Dash = "solid"
    gaps: bool = False
    """Interrupt the line where x, the time, has a gap of more than five typical steps."""
    _arrays = ("x", "y")

    def __post_init__(self) -> None:
        super().__post_init__()
        x, y = as_array(self.x), as_array(self.y)
        if x.size > downsample.MAX_POINTS:
            self._keep(*downsample.course(x, y, gaps=self.gaps))


@dataclass(frozen=True, eq=False)
class Band(_Item):
    """The area between two lines over x (n,), such as an estimate ± 2 sigma; it has the colour of the next line."""

    x: ArrayLike
    lower: ArrayLike
    upper: ArrayLike
    _: KW_ONLY
    opacity: float = 0.18
    gaps: bool = False
    """As of a `Line`."""
    _arrays = ("x", "lower", "upper")

    def __post_init__(self) -> None:
        super().__post_init__()
        x, lower, upper = as_array(self.x), as_array(self.lower), as_array(self.upper)
        if x.size > downsample.MAX_POINTS:
            self._keep(*downsample.band(x, lower, upper, gaps=self.gaps))


@dataclass(frozen=True, eq=False)
class Points(_Item):
    """Points (n,), with error bars where a sigma is given."""

    x: ArrayLike
    y: ArrayLike
    _: KW_ONLY
    x_sigma: ArrayLike | None = None
    y_sigma: ArrayLike | None = None
    marker: Marker = "circle"
    size: float = 7
    """Pixels."""
    texts: tuple[str, ...] = ()
    """Of each point, shown when the cursor is on it."""
    _arrays = ("x", "y", "x_sigma", "y_sigma")


@dataclass(frozen=True, eq=False)
class Bars(_Item):
    """Bars of equal width around x (n,), from 0 to the heights (n,)."""

    x: ArrayLike
    heights: ArrayLike
    _arrays = ("x", "heights")


@dataclass(frozen=True, eq=False)
class Area(_Item):
    """A closed polygon of corners (n,)."""

    x: ArrayLike
    y: ArrayLike
    _: KW_ONLY
    opacity: float = 0.3
    outline: float = 1.2
    """Width of its edge, pixels."""
    _arrays = ("x", "y")


@dataclass(frozen=True)
class Label:
    """A text centred at a point."""

    x: float
    y: float
    text: str
    _: KW_ONLY
    colour: str = DARK


@dataclass(frozen=True, kw_only=True)
class Guide:
    """A straight line across the panel, vertical at x or horizontal at y, with a text."""

    x: float | None = None
    y: float | None = None
    text: str = ""
    colour: str = GREY
    width: float = 1.2
    dash: Dash = "dash"

    def __post_init__(self) -> None:
        if (self.x is None) == (self.y is None):
            raise FifthwheelError(f"Guide: either x or y expected, got x = {self.x} and y = {self.y}; give one of them")


@dataclass(frozen=True)
class Span:
    """A shaded interval of x."""

    start: float
    stop: float
    _: KW_ONLY
    colour: str = GREY
    opacity: float = 0.15


Item = Line | Band | Points | Bars | Area | Label | Guide | Span
"""What a panel shows."""


def as_array(values: ArrayLike) -> Array:
    """Values of an item (n,), which its constructor has checked."""
    return np.asarray(values, dtype=np.float64)


@dataclass(frozen=True, kw_only=True)
class Axis:
    """One axis of a panel."""

    label: str = ""
    unit: str = ""
    log: bool = False
    range: tuple[float, float] | None = None
    """Visible values; None shows all."""
    from_zero: bool = False
    """The range starts at 0."""
    ticks: Mapping[float, str] = field(default_factory=dict)
    """Texts by position instead of numbers."""
    date: bool = False
    """Of x: values are ms since 1970, shown as dates of UTC."""

    @property
    def title(self) -> str:
        """Label and unit: "time, s"."""
        return ", ".join(filter(None, (self.label, self.unit)))


@dataclass(frozen=True, kw_only=True)
class Panel:
    """One pair of axes with what it shows, in the order of drawing."""

    items: Sequence[Item]
    title: str = ""
    x: Axis = Axis()
    y: Axis = Axis()
    height: float = 1.0
    """Relative to the other panels of its column."""
    equal: bool = False
    """One unit is as long on x as on y, for drawings to scale."""

    def coloured(self) -> Iterator[tuple[Item, str]]:
        """Each item with its colour; items without one take the colours of the palette in turn."""
        used = 0
        for item in self.items:
            yield item, item.colour or CYCLE[used % len(CYCLE)]
            used += item.colour is None and not isinstance(item, Band | Guide | Label | Span)


@dataclass(frozen=True, kw_only=True)
class PanelGrid:
    """Panels row by row."""

    panels: Sequence[Panel]
    title: str = ""
    columns: int = 1
    shared_x: bool = True
    """All panels have the x axis of the lowest, so that zooming in on one zooms in on all."""

    def __post_init__(self) -> None:
        if not self.panels:
            raise FifthwheelError("panels: at least one Panel expected, got none")

    @property
    def rows(self) -> int:
        return -(-len(self.panels) // self.columns)

    def row_heights(self) -> list[float]:
        """Relative height of each row: that of its highest panel."""
        starts = range(0, len(self.panels), self.columns)
        return [max(panel.height for panel in self.panels[k : k + self.columns]) for k in starts]

    @property
    def one_x_axis(self) -> bool:
        """Whether only the lowest panel shows the numbers of the x axis."""
        return self.shared_x and self.columns == 1


def visible_range(*values: ArrayLike) -> tuple[float, float]:
    """Range of an axis that shows all finite values with a margin."""
    joined = np.concatenate([np.atleast_1d(v) for v in values])
    finite = joined[np.isfinite(joined)]
    if not finite.size:
        return -1.0, 1.0
    low, high = float(finite.min()), float(finite.max())
    margin = 0.06 * (high - low) or 1.0
    return low - margin, high + margin


def range_without_spikes(values: Array) -> tuple[float, float] | None:
    """The range of an axis that leaves out what lasts one or two samples; None if that changes little.

    A value that is repeated counts once, because slow channels repeat theirs.
    """
    values = values[np.isfinite(values)]
    values = values[np.diff(values, prepend=np.nan) != 0]
    if values.size < 5:
        return None
    a, b, c = values[:-4], values[2:-2], values[4:]
    median = np.maximum(np.minimum(a, b), np.minimum(np.maximum(a, b), c))
    return visible_range(median) if np.ptp(values) > 2 * np.ptp(median) > 0 else None


def trimmed(values: Array, fraction: float) -> Array:
    """Lowest and highest of the finite values without this fraction at either end; empty without finite values."""
    finite = values[np.isfinite(values)]
    return np.quantile(finite, [fraction, 1 - fraction]) if finite.size else finite
