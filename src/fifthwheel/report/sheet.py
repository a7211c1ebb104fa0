"""A page while it is written: its body in HTML, and the figures that it has places for."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from html import escape

from fifthwheel.report.lines import Plot

Row = tuple[str, str, Plot]
"""Caption and note, both HTML, and the figure."""


class Sheet:
    """Takes what is to be read, in the order in which it is read."""

    def __init__(self) -> None:
        self.body: list[str] = []
        self.plots: list[Plot] = []

    def heading(self, key: str, text: str) -> None:
        """A section, to which the navigation leads."""
        self.body.append(f'<h2 id="{key}">{escape(text)}</h2>')

    def part(self, title: str, *, badge: str = "") -> None:
        """A part of a section: a log, a table."""
        mark = f' <span class="badge">{escape(badge)}</span>' if badge else ""
        self.body.append(f"<h3>{escape(title)}{mark}</h3>")

    def hint(self, text: str) -> None:
        """How to read what follows."""
        self.say("hint", text)

    def say(self, kind: str, text: str) -> None:
        """A paragraph."""
        self.body.append(f'<p class="{kind}">{escape(text)}</p>')

    def html(self, *parts: str) -> None:
        """What is HTML already."""
        self.body += parts

    def figures(self, rows: Iterable[Row], *, kind: str = "plots") -> None:
        """Figures with their captions side by side."""
        self.body.append(f'<div class="{kind}">')
        for caption, note, plot in rows:
            place = f'<div class="plot {plot.size}" id="plot{len(self.plots)}"></div>'
            small = f"<small>{note}</small>" if note else ""
            self.body.append(f"<figure><figcaption>{caption}{small}</figcaption>{place}</figure>")
            self.plots.append(plot)
        self.body.append("</div>")

    @contextmanager
    def folded(self, summary: str) -> Iterator[None]:
        """What only some want to see; its summary is HTML."""
        self.body.append(f"<details><summary>{summary}</summary>")
        yield
        self.body.append("</details>")
