"""The body of a page while it is built, and the figures that it has places for."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from html import escape
from typing import NamedTuple

from fifthwheel.report.figures.primitives import ReportPlot


class CaptionedPlot(NamedTuple):
    """A figure with its caption and a note, both HTML."""

    caption: str
    note: str
    plot: ReportPlot


@dataclass
class PageBuilder:
    """Collects the content of a page in reading order, and its plots."""

    title: str
    subtitle: str
    content: list[str] = field(default_factory=list)
    links: list[str] = field(default_factory=list)
    plots: list[ReportPlot] = field(default_factory=list)

    def body(self) -> str:
        """The HTML of the page: title, links to the sections, content."""
        head = f'<h1>{escape(self.title)}</h1>\n<p class="subtitle">{escape(self.subtitle)}</p>'
        return "\n".join([head, f"<nav>{''.join(self.links)}</nav>", *self.content])

    def heading(self, key: str, text: str) -> None:
        """Begin a section."""
        self.links.append(f'<a href="#{key}">{escape(text)}</a>')
        self.html(f'<h2 id="{key}">{escape(text)}</h2>')

    def subheading(self, title: str, *, badge: str = "") -> None:
        """Begin a part of a section, such as a log."""
        mark = f' <span class="badge">{escape(badge)}</span>' if badge else ""
        self.html(f"<h3>{escape(title)}{mark}</h3>")

    def hint(self, text: str) -> None:
        """Add a paragraph that explains what follows."""
        self.html(f'<p class="hint">{escape(text)}</p>')

    def html(self, *elements: str) -> None:
        """Add HTML."""
        self.content += elements

    def figures(self, rows: Iterable[CaptionedPlot], *, css_class: str = "plots") -> None:
        """Add figures side by side."""
        self.html(f'<div class="{css_class}">')
        for caption, note, plot in rows:
            place = f'<div class="plot {plot.size}" id="plot{len(self.plots)}"></div>'
            small = f"<small>{note}</small>" if note else ""
            self.html(f"<figure><figcaption>{caption}{small}</figcaption>{place}</figure>")
            self.plots.append(plot)
        self.html("</div>")

    @contextmanager
    def folded(self, summary: str) -> Iterator[None]:
        """Add what follows folded away under a summary, which is HTML."""
        self.html(f"<details><summary>{summary}</summary>")
        yield
        self.html("</details>")
