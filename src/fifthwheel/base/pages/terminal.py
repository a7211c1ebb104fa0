"""A document on a terminal, in Unicode or ASCII, and a progress bar."""

import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, Literal

from fifthwheel.base import pages
from fifthwheel.base.errors import printable, printable_lines
from fifthwheel.base.formatting import plain_ascii

if TYPE_CHECKING:
    from rich.console import Console as Console

COLOURS = {
    "converged": "green",
    "doubtful": "yellow",
    "not_converged": "yellow",
    "not_excited": "red",
    "not_identifiable": "red",
    "at_bound": "red",
    "stated": "cyan",
    "fixed": "cyan",
}
"""Kind of a mark, which is a verdict, -> colour; its word is always shown too."""

WORD = 14
"""Longest part of a text that a column of a table keeps in one line."""


def show(document: pages.Document, console: "Console | None" = None) -> None:
    """Print the blocks of a document, except plots and HTML; in ASCII where that is no terminal with Unicode."""
    from rich.console import Console  # slow to import

    _Printer(console or Console()).show(document.blocks)


@contextmanager
def progress_bar(*, quiet: bool = False) -> "Iterator[Callable[[str, int, int], None]]":
    """A progress bar on the terminal or in a notebook, called with title, work done and total; else nothing.

    Example:
        >>> import fifthwheel as fw
        >>> truck = fw.vehicle("cheng_cebon_2011")
        >>> settings = fw.OneStage(given={"*": "exact", "tractor.front.cornering_stiffness": "free"}, tyres="linear")
        >>> with fw.progress_bar() as progress:
        ...     result = fw.identify([fw.simulate(truck, count=1)], truck, settings, progress=progress)
    """
    if quiet or not (sys.stderr.isatty() or "ipykernel" in sys.modules):
        yield lambda title, done, total: None
        return
    from rich.console import Console  # slow to import
    from rich.markup import escape
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as bar:
        tasks: dict[str, Any] = {}

        def show(title: str, done: int, total: int) -> None:
            if title not in tasks:
                tasks[title] = bar.add_task(escape(printable(title)), total=total)
            bar.update(tasks[title], completed=done, total=total)

        yield show


class _Printer:
    def __init__(self, console: "Console") -> None:
        self._console = console
        self._ascii = not (console.is_terminal and console.encoding.lower().startswith("utf"))

    def show(self, blocks: Iterable[pages.Block]) -> None:
        for block in blocks:
            match block:
                case pages.Headline():
                    self._line(block.text, "bold" if block.good else "bold yellow")
                    for column in block.columns:
                        self.show(column)
                case pages.Heading():
                    self._title(block.title)
                case pages.Paragraph() | pages.Verbatim():
                    self._line(block.text)
                case pages.Values():
                    for name, value in block.values.items():
                        self._line(f"{name}: {value}")
                case pages.Table():
                    self._table(block)
                case pages.Items():
                    self._items(block)
                case pages.Folded():
                    self._title(block.summary + (f": {block.detail}" if block.detail else ""))
                    self.show(block.blocks)
                case pages.Beside():
                    self.show(block.blocks)

    def _text(self, text: str) -> str:
        """A text for this console, with brackets that are no markup and without control characters."""
        from rich.markup import escape

        return escape(self._shown(text))

    def _shown(self, text: str) -> str:
        text = printable_lines(text)
        return plain_ascii(text) if self._ascii else text

    def _line(self, text: str, style: str = "") -> None:
        self._console.print(self._text(text), style=style, highlight=False)

    def _title(self, text: str) -> None:
        self._console.print()
        self._line(text, "bold")

    def _table(self, table: pages.Table) -> None:
        """A table without lines and without columns of HTML; where it is too wide, its cells wrap between words."""
        from rich.table import Table as Grid

        shown = [k for k, cell in enumerate(table.rows[0]) if not isinstance(cell, pages.Markup)] if table.rows else []
        columns = [table.columns[k] for k in shown] or table.columns
        grid = Grid(box=None, pad_edge=False, padding=(0, 1, 0, 0), header_style="bold underline")
        texts = [[self._shown(column.head)] for column in columns]
        for row in table.rows:
            for k, place in zip(shown, texts, strict=True):
                place.append(self._shown(_plain(row[k])))
        widths = _widths(texts, self._console.width - len(columns) + 1)
        for column, width in zip(columns, widths, strict=True):
            justify: Literal["left", "right"] = "right" if column.is_number else "left"
            grid.add_column(self._text(column.head), justify=justify, overflow="fold", width=width)
        for row in table.rows:
            grid.add_row(*[self._cell(row[k]) for k in shown])
        self._console.print()
        self._console.print(grid)

    def _cell(self, cell: pages.Cell) -> str:
        text = self._text(_plain(cell))
        colour = COLOURS.get(cell.kind) if isinstance(cell, pages.Mark) else None
        return f"[{colour}]{text}[/]" if colour else text

    def _items(self, items: pages.Items) -> None:
        from rich.table import Table as Grid

        if not items.lines:
            return
        if items.title:
            self._title(items.title)
        grid = Grid.grid(padding=(0, 1, 0, 0))
        for line in items.lines:
            grid.add_row("-", self._text(line))
        self._console.print(grid)


def _widths(texts: Sequence[Sequence[str]], total: int) -> list[int]:
    """Widths of columns, in characters: of the longest word up to `WORD`, then more for those that need it."""
    words = [max((len(word) for text in column for word in text.split()), default=1) for column in texts]
    widths = words if sum(words) <= total else [min(word, WORD) for word in words]
    cells = [max(map(len, cells), default=0) for _, *cells in texts]
    for needed in (cells, [max(map(len, column)) for column in texts]):
        while sum(widths) < total and (narrow := [k for k, width in enumerate(widths) if width < needed[k]]):
            widths[min(narrow, key=lambda k: widths[k])] += 1
    return widths


def _plain(cell: pages.Cell) -> str:
    """A cell as plain text; of words with a path the path, which is what options of a command take."""
    return cell.hint if isinstance(cell, pages.Hinted) else pages.plain(cell)
