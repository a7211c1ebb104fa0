"""`Plot`: a plot as data, with its display in a notebook and its files."""

from dataclasses import dataclass
from importlib.util import find_spec
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fifthwheel.base.atomic import atomic_write
from fifthwheel.base.errors import FifthwheelError
from fifthwheel.base.plots import matplotlib_figure, plotly_figure
from fifthwheel.base.plots.items import PanelGrid

if TYPE_CHECKING:
    import matplotlib.figure
    import plotly.graph_objects

IMAGES = (".png", ".svg", ".pdf")
DPI = 150
NO_DATE = {".svg": {"Date": None}, ".pdf": {"CreationDate": None}}
"""Metadata by format, so that the same plot gives the same file at any time."""


@dataclass(frozen=True, kw_only=True, repr=False)
class Plot(PanelGrid):
    """A plot as data: panels row by row, drawn by plotly or by matplotlib.

    In a notebook it shows itself: as an image with matplotlib, else interactively with plotly; neither needs a network.

    Example:
        >>> import numpy as np
        >>> from fifthwheel.base.plots import Axis, Band, Guide, Line, Panel, Plot
        >>> f = np.logspace(-1, 1, 100)
        >>> gain, phase = 1 / np.hypot(1, f), -np.degrees(np.arctan(f))
        >>> frequency = Axis(label="frequency", unit="Hz", log=True)
        >>> plot = Plot(
        ...     title="Yaw rate by steer angle",
        ...     panels=[
        ...         Panel(
        ...             items=[Band(f, 0.9 * gain, 1.1 * gain, name="± 2 sigma"), Line(f, gain, name="model")],
        ...             x=frequency,
        ...             y=Axis(label="gain", unit="1/s", log=True),
        ...             height=1.5,
        ...         ),
        ...         Panel(
        ...             items=[Line(f, phase), Guide(x=1.0, text="1 Hz")],
        ...             x=frequency,
        ...             y=Axis(label="phase", unit="deg"),
        ...         ),
        ...     ],
        ... )
        >>> plot
        Plot('Yaw rate by steer angle', 2 panels)
        >>> plot.to_plotly().layout.xaxis.title.text
        'frequency, Hz'
    """

    def to_plotly(self) -> "plotly.graph_objects.Figure":
        """The plot as an interactive figure of plotly."""
        import plotly.graph_objects as go

        return go.Figure(plotly_figure.figure(self))

    def to_matplotlib(self, size: tuple[float, float] | None = None) -> "matplotlib.figure.Figure":
        """The plot as a figure of matplotlib, which can be changed further.

        Args:
            size: width and height, inches.

        Raises:
            FifthwheelError: matplotlib is not installed.
        """
        return matplotlib_figure.figure(self, size)

    def to_html(self, *, full: bool = True) -> str:
        """The plot with plotly.js, 5 MB: a page that opens without a network, or its part for another page."""
        return str(self.to_plotly().to_html(full_html=full, include_plotlyjs=True, div_id="plot" if full else None))

    def save(self, path: str | Path, *, size: tuple[float, float] | None = None) -> None:
        """Write the plot to a file: .png, .svg or .pdf by matplotlib, or .html, which opens without a network.

        Args:
            size: of an image, inches.

        Raises:
            FifthwheelError: the ending of the name is another one, or matplotlib is not installed.
        """
        path = Path(path)
        if path.suffix not in (*IMAGES, ".html"):
            raise FifthwheelError(f"{path.name}: expected a name that ends in {', '.join(IMAGES)} or .html")
        with atomic_write(path) as temporary:
            if path.suffix == ".html":
                temporary.write_text(self.to_html(), encoding="utf-8")
            else:
                self._save_image(temporary, path.suffix, size)

    def _save_image(self, file: Any, suffix: str, size: tuple[float, float] | None = None) -> None:
        canvas = self.to_matplotlib(size)
        import matplotlib as mpl

        with mpl.rc_context(matplotlib_figure.STYLE):
            canvas.savefig(file, format=suffix[1:], dpi=DPI, metadata=NO_DATE.get(suffix))

    def _repr_mimebundle_(self, include: Any = None, exclude: Any = None) -> dict[str, str]:
        """What a notebook shows."""
        if find_spec("matplotlib") is None:
            return {"text/plain": repr(self), "text/html": self.to_html(full=False)}
        file = StringIO()
        self._save_image(file, ".svg")
        return {"text/plain": repr(self), "image/svg+xml": file.getvalue()}

    def __repr__(self) -> str:
        count = len(self.panels)
        return f"Plot({self.title!r}, {count} panel{'s' * (count != 1)})"
