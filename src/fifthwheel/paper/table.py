"""The article's table as Markdown, CSV and on a terminal: published numbers, ours, and where ours are worse."""

import csv
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from fifthwheel.paper.rows import CASES, QUANTITIES, Found, Row, rows
from fifthwheel.report.numbers import digits, fixed, plain_ascii, shown, with_sigma

if TYPE_CHECKING:
    from rich.console import Console

__all__ = ["Found", "Row", "Variant", "as_csv", "markdown", "rows", "show"]

LEGEND = """\
- **Published** is what the article prints, with the error it states against its own reference.
- **Found** is the mean over the seeds ± the standard deviation of one seed. Every seed has its own noise and its own
  wrong starts; all arms see the same.
- **Truth** is our plant's. Its tyres are not linear, so a cornering stiffness has a range, as in the article's
  Figure 4: side force by slip angle in steady turns with 0.1° and 1° of steer.
- **Error** is that of the mean, in per cent of the truth; of a cornering stiffness how far it lies outside the range.
- **Worst seed** is the one that is farthest off, with its own error.
- **Converged** counts the seeds in which the method itself says so.
- **Worse than published** compares the two errors without their signs: by which factor that of the mean is larger, and
  how many seeds are farther off than the published run. A – stands where the article states no error; of cornering
  stiffness it shows a range in a figure, of tyres that it does not describe, so those numbers are no goal for ours."""
HEAD = ("Quantity", "Published", "Arm", "Found", "Truth", "Error", "Worst seed", "Converged", "Worse than published")


@dataclass(frozen=True, kw_only=True)
class Variant:
    """The same identification with one thing changed."""

    name: str
    values: Mapping[str, float]  # error of the mean, per cent, by quantity
    seeds: int


def markdown(rows: Sequence[Row], variants: Sequence[Variant] = (), remarks: Sequence[str] = ()) -> str:
    """The whole document: remarks, where we are worse, a table for each section, what moves the preset."""
    parts = [
        "# The article, reproduced",
        "C. Cheng, D. Cebon, *Parameter and state estimation for articulated heavy vehicles*, Vehicle System Dynamics"
        " 49 (2011) 399–418: every published result beside what this package finds on its own nonlinear truck.",
        *(["\n".join(f"- {remark}" for remark in remarks)] if remarks else []),
        "## Worse than published",
        worse(rows),
        "## How to read the tables",
        LEGEND,
    ]
    for case in dict.fromkeys(row.experiment for row in rows):
        parts.append(f"## {CASES.get(case, case)}")
        for section in dict.fromkeys(row.section for row in rows if row.experiment == case):
            own = [row for row in rows if (row.experiment, row.section) == (case, section)]
            parts.append(f"### {section} {topic(own)}")
            parts.append(_table(HEAD, [line for row in own for line in _lines(row)], left=(0, 2)))
    if variants:
        parts.append("## What moves the article's preset")
        parts.append(
            "Error of the mean over the seeds in per cent of the truck's own value, a cornering stiffness against the"
            " vehicle file's. Each line changes one thing: what the article leaves open, or a flaw."
        )
        parts.append(_variants(variants))
    return "\n\n".join(parts) + "\n"


def topic(rows: Sequence[Row]) -> str:
    """What a section's rows are about."""
    if all(row.reference is None for row in rows):
        return "States"
    if any(row.text.unit == "N/rad" for row in rows):
        return "Cornering stiffness and yaw inertia"
    return "Height and roll inertia"


def worse(rows: Sequence[Row]) -> str:
    """A line for each arm of each experiment: which of its errors are larger than the published ones."""
    lines = []
    for case in dict.fromkeys(row.experiment for row in rows):
        pairs = [(row, found) for row in rows if row.experiment == case for found in row.arms]
        for arm in dict.fromkeys(found.arm for _, found in pairs):
            told = [(row, found.factor) for row, found in pairs if found.arm == arm and found.factor is not None]
            bad = [f"{_short(row)} ({times(factor)})" for row, factor in told if factor > 1]
            verdict = f"**{len(bad)} of {len(told)}**: {', '.join(bad)}" if bad else f"none of {len(told)}"
            lines.append(f"- {CASES.get(case, case)}, {arm}: {verdict}")
    return "\n".join(
        ["Errors of the mean over the seeds that are larger than the error the article states:", "", *lines]
    )


def times(factor: float) -> str:
    """How much larger: "2.3 times"."""
    return f"{fixed(factor, 1 if factor >= 1.05 else 2)} times"


def as_csv(rows: Sequence[Row]) -> str:
    """A line for each quantity and arm, SI and per cent."""
    head = (
        *("experiment", "section", "quantity", "unit", "published", "published_reference", "published_error_percent"),
        *(
            "truth_low",
            "truth_high",
            "arm",
            "seeds",
            "mean",
            "deviation",
            "error_percent",
            "worst",
            "worst_error_percent",
        ),
        *("converged", "held", "error_by_published", "seeds_worse_than_published"),
    )
    file = io.StringIO()
    writer = csv.writer(file, lineterminator="\n")
    writer.writerow(head)
    for row in rows:
        p, (low, high) = row.published, row.reference or (None, None)
        error = None if p is None or p.error is None else 100 * p.error
        told = (None, None, None) if p is None else (p.value, p.reference, error)
        for f in row.arms:
            ours = (f.arm, f.seeds, f.mean, f.deviation, f.error, f.worst, f.worst_error, f.converged, int(f.held))
            line = (row.experiment, row.section, row.quantity, row.text.unit, *told, low, high, *ours)
            cells = (*line, f.factor, f.worse_seeds)
            writer.writerow(f"{cell:.6g}" if isinstance(cell, float) else cell for cell in cells)
    return file.getvalue()


def show(rows: Sequence[Row], console: "Console | None" = None) -> None:
    """Print what was found beside what is published, in 80 columns."""
    from rich.console import Console
    from rich.table import Table

    console = console or Console()
    plain = not (console.is_terminal and console.encoding.lower().startswith("utf"))

    def text(cell: str) -> str:
        return plain_ascii(cell).replace("α", "a") if plain else cell

    for case in dict.fromkeys(row.experiment for row in rows):
        table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0), header_style="bold underline")
        for head in ("Quantity", "Published", "Arm", "Found", "Error", "Worse"):
            number = head in ("Published", "Found", "Error", "Worse")
            table.add_column(head, justify="right" if number else "left", no_wrap=number, overflow="fold")
        for row in (row for row in rows if row.experiment == case):
            name = f"{_short(row)}, {shown(row.text.unit).name}"
            published = "–" if row.published is None else _number(row.published.value, row)
            for found in row.arms:
                bad = found.factor is not None and found.factor > 1
                mark = "–" if found.factor is None else (f"x {digits(found.factor, 2)}" if bad else "no")
                cells = (name, published, found.arm, _number(found.mean, row), _error(found.error, row), mark)
                table.add_row(*map(text, cells), style="yellow" if bad else None)
                name = published = ""
        console.print()
        console.print(text(CASES.get(case, case)), style="bold", highlight=False)
        console.print(table)


def _short(row: Row) -> str:
    """The article's symbol without the mark that cornering stiffness is negative there, or the words."""
    return row.text.symbol if row.reference else row.text.words.removeprefix("rms error, ")


def _lines(row: Row) -> list[tuple[str, ...]]:
    """The cells of a row, a line for each arm; what all arms share only once."""
    symbol = f" `{row.text.symbol}`" if row.text.symbol else ""
    shared, p = (f"{row.text.words}{symbol}", "–", _truth(row)), row.published
    if p is not None:
        error = "" if p.error is None else f" ({_signed(100 * p.error)})"
        shared = shared[0], f"{_value(p.value, row)}{error}", shared[2]
    lines: list[tuple[str, ...]] = []
    for f in row.arms:
        spread = with_sigma(f.mean, f.deviation, row.text.unit) if f.deviation else _value(f.mean, row)
        worst = _value(f.worst, row) + ("" if f.worst_error is None else f" ({_error(f.worst_error, row)})")
        converged = "held" if f.held else ("–" if f.converged is None else f"{f.converged} of {f.seeds}")
        if f.held:
            worst = "held"
        lines.append((*shared[:2], f.arm, spread, shared[2], _error(f.error, row), worst, converged, _mark(f)))
        shared = ("", "", "")
    return lines


def _mark(found: Found) -> str:
    if found.factor is None:
        return "–"
    many = f"{found.worse_seeds} of {found.seeds} seeds" if found.worse_seeds else ""
    if found.factor > 1:
        return f"**{times(found.factor)}**, {many or 'no seed'}"
    return f"no, but {many}" if many else "no"


def _truth(row: Row) -> str:
    if row.reference is None:
        return "–"
    low, high = row.reference
    return _value(low, row) if low == high else f"{_number(low, row)} to {_value(high, row)}"


def _value(value: float, row: Row) -> str:
    return f"{_number(value, row)} {shown(row.text.unit).name}"


def _number(value: float, row: Row) -> str:
    return digits(value * shown(row.text.unit).factor, 4 if row.reference else 2)


def _error(percent: float | None, row: Row) -> str:
    if percent is None or row.reference is None:
        return "–"
    return "within" if percent == 0 and row.reference[0] != row.reference[1] else _signed(percent)


def _signed(percent: float) -> str:
    """An error with its sign: "+2.5 %"."""
    text = fixed(percent, 2 if abs(percent) < 1 else 1)
    return f"{'' if percent < 0 else '+'}{text} %"


def _variants(variants: Sequence[Variant]) -> str:
    known = {name: text for name, text in QUANTITIES.items() if any(name in v.values for v in variants)}
    head = ("What is changed", "Seeds", *(f"`{text.symbol}`" for text in known.values()))
    lines = [
        (v.name, str(v.seeds), *(_signed(v.values[name]) if name in v.values else "–" for name in known))
        for v in variants
    ]
    return _table(head, lines, left=(0,))


def _table(head: Sequence[str], lines: Sequence[Sequence[str]], *, left: tuple[int, ...]) -> str:
    """A Markdown table; columns are to the right but for those named."""
    rule = ["---" if i in left else "---:" for i in range(len(head))]
    return "\n".join(
        "| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in (head, rule, *lines)
    )
