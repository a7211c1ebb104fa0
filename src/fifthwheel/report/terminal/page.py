"""Headlines, tables and lists on a terminal, in Unicode or ASCII."""

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from fifthwheel.errors import printable_lines
from fifthwheel.formatting import plain_ascii
from fifthwheel.identify import Verdict

if TYPE_CHECKING:
    from rich.console import Console

COLOURS = {
    Verdict.CONVERGED: "green",
    Verdict.DOUBTFUL: "yellow",
    Verdict.NOT_CONVERGED: "yellow",
    Verdict.NOT_EXCITED: "red",
    Verdict.NOT_IDENTIFIABLE: "red",
    Verdict.AT_BOUND: "red",
    Verdict.FIXED: "cyan",
}
"""Verdict -> colour; its word is always shown too."""


class TerminalPage:
    """Prints to a console; in ASCII where that is no terminal with Unicode."""

    def __init__(self, console: "Console | None") -> None:
        if console is None:
            from rich.console import Console

            console = Console()
        self.console = console
        self.ascii = not (console.is_terminal and console.encoding.lower().startswith("utf"))

    def text(self, text: str) -> str:
        """A text for this console, with brackets that are no markup and without control characters."""
        from rich.markup import escape

        text = printable_lines(text)
        return escape(plain_ascii(text) if self.ascii else text)

    def headline(self, text: str, *, good: bool = True) -> None:
        self.console.print(self.text(text), style="bold" if good else "bold yellow", highlight=False)

    def line(self, text: str) -> None:
        self.console.print(self.text(text), highlight=False)

    def table(self, heads: Sequence[str], rows: Iterable[Sequence[str]], styles: Iterable[str] = ()) -> None:
        """Print a table without lines.

        Args:
            heads: of the columns; ">" at the end aligns a column to the right.
            styles: colour of the last cell of each row.
        """
        from rich.table import Table

        table = Table(box=None, pad_edge=False, padding=(0, 1, 0, 0), header_style="bold underline")
        for head in heads:
            right = head.endswith(">")
            title = self.text(head.removesuffix(">"))
            table.add_column(title, justify="right" if right else "left", overflow="fold", no_wrap=right)
        colours = list(styles)
        for i, row in enumerate(rows):
            cells = [self.text(cell) for cell in row]
            if colours:
                cells[-1] = f"[{colours[i]}]{cells[-1]}[/]"
            table.add_row(*cells)
        self.console.print()
        self.console.print(table)

    def lists(self, *lists: tuple[str, Sequence[str]]) -> None:
        """Print lists with titles; empty ones are left out."""
        from rich.table import Table

        for title, items in lists:
            if not items:
                continue
            self.console.print()
            self.console.print(title, style="bold", highlight=False)
            grid = Table.grid(padding=(0, 1, 0, 0))
            for item in items:
                grid.add_row("-", self.text(item))
            self.console.print(grid)
