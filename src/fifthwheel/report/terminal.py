"""Results on a terminal: the same words and numbers as the report, in 80 columns."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from fifthwheel.report import facts
from fifthwheel.report.conclusion import Conclusion
from fifthwheel.report.numbers import about, percent, plain_ascii, relative, with_sigma
from fifthwheel.report.state_words import conclude_states, innovation_size
from fifthwheel.report.words import conclude, mark

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

    from fifthwheel.identify import Estimate, Identification
    from fifthwheel.logs import Record
    from fifthwheel.observe import States

COLOURS = {
    "converged": "green",
    "not_converged": "yellow",
    "not_excited": "red",
    "not_identifiable": "red",
    "at_bound": "red",
    "held": "cyan",
}
"""Verdict -> colour, always beside its word."""


def show_identification(
    identification: "Identification", console: "Console | None" = None, told: Conclusion | None = None
) -> None:
    """Print parameters with sigma and verdict, what follows from them, the fit and what to do next.

    Args:
        told: what `words.conclude` said with the logs and the states at hand; without them it says less.
    """
    page = Page(console)
    told = told or conclude(identification)
    page.headline(told)
    table = page.table("Parameter", "Value:>", "± %:>", "Verdict")
    for estimate in (*identification.parameters, *identification.derived):
        page.row(table, *_estimate(estimate), style=COLOURS[estimate.verdict])
    page.show(table)
    for log in dict.fromkeys(fit.log for fit in identification.fits):
        own = [fit for fit in identification.fits if fit.log == log]
        head = log if own[0].identified_on else f"{log} (predicted only)"
        table = page.table(head, "Explained:>", "Residual rms:>", "Noise:>")
        for fit in own:
            share, unit = facts.share(fit), facts.unit_of(fit.signal)
            noise = about(share.noise, unit) if share.noise == share.noise else "–"
            explained = percent(max(fit.explained, 0.0), of_whole=True)
            page.row(table, fit.signal, explained, about(fit.rms, unit), noise)
        page.show(table)
    page.lists(("Beware", told.cautions), ("Next", told.next_steps), ("Notes", told.notes))


def show_states(states: "Sequence[States]", records: "Sequence[Record]", console: "Console | None" = None) -> None:
    """Print how reliable the states of each record are, their uncertainty, and what to beware of."""
    page = Page(console)
    told = conclude_states(states, records)
    page.headline(told)
    for one in states:
        shares = facts.status_shares(one)
        status = "; ".join(f"{percent(part)} {word}" for word, part in shares.items())
        record = facts.record_of(one, records)
        table = page.table(one.name, "2 sigma, median:>", "rms from reference:>")
        for name in one.values:
            unit, rms = facts.unit_of(name), facts.reference_rms(one, record, name)
            band = facts.median_band(one, name)
            difference = "–" if rms is None else about(rms, unit)
            page.row(table, name, "–" if band is None else about(band, unit), difference)
        page.show(table)
        page.console.print(page.text(f"Samples: {status}"), highlight=False)
        table = page.table("Measured", "Innovation rms, sigma:>", "Not used:>")
        for name in one.innovation:
            size, out = innovation_size(one, name)
            page.row(table, name, f"{size:.2f}" if size == size else "–", percent(out))
        page.show(table)
    page.lists(("Beware", told.cautions), ("Next", told.next_steps), ("Notes", told.notes))


class Page:
    """A console, and what it can show."""

    def __init__(self, console: "Console | None") -> None:
        if console is None:
            from rich.console import Console

            console = Console()
        self.console = console
        self.ascii = not (console.is_terminal and console.encoding.lower().startswith("utf"))

    def text(self, text: str) -> str:
        """As this terminal can show it, brackets not taken for markup."""
        from rich.markup import escape

        return escape(plain_ascii(text) if self.ascii else text)

    def headline(self, told: Conclusion) -> None:
        self.console.print(self.text(told.headline), style="bold" if told.good else "bold yellow", highlight=False)

    def table(self, *heads: str) -> "Table":
        """A table without lines; a head that ends with ":>" is a column of numbers."""
        from rich.table import Table

        table = Table(box=None, pad_edge=False, padding=(0, 1, 0, 0), header_style="bold underline")
        for head in heads:
            number = head.endswith(":>")
            table.add_column(
                self.text(head.removesuffix(":>")),
                justify="right" if number else "left",
                overflow="fold",
                no_wrap=number,
            )
        return table

    def row(self, table: "Table", *cells: str, style: str | None = None) -> None:
        """Add a row; the style colours its last cell."""
        shown = [self.text(cell) for cell in cells]
        if style:
            shown[-1] = f"[{style}]{shown[-1]}[/]"
        table.add_row(*shown)

    def show(self, table: "Table") -> None:
        self.console.print()
        self.console.print(table)

    def lists(self, *parts: tuple[str, Sequence[str]]) -> None:
        """Headed lists, those that are empty left out."""
        from rich.table import Table

        for title, lines in parts:
            if not lines:
                continue
            self.console.print()
            self.console.print(title, style="bold", highlight=False)
            grid = Table.grid(padding=(0, 1, 0, 0))
            for line in lines:
                grid.add_row("-", self.text(line))
            self.console.print(grid)


def _estimate(estimate: "Estimate") -> tuple[str, ...]:
    value = with_sigma(estimate.value, estimate.sigma, estimate.unit)
    part = relative(estimate.value, estimate.sigma).removesuffix(" %").replace("> ", ">")
    return estimate.name, value, part, mark(estimate)[1]
