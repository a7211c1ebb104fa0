"""A plot as data: panels with axes that name quantity and unit."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from fifthwheel.base.errors import FifthwheelError
from fifthwheel.base.plots.items import Band, Guide, Item, Label, Span
from fifthwheel.base.plots.palette import CYCLE
from fifthwheel.base.types import Array


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


def trimmed(values: Array, fraction: float) -> Array:
    """Lowest and highest of the finite values without this fraction at either end; empty without finite values."""
    finite = values[np.isfinite(values)]
    return np.quantile(finite, [fraction, 1 - fraction]) if finite.size else finite
