"""The comparison as Markdown, as CSV and on a terminal: published numbers, estimates, and where these are worse."""

import csv
import io
from collections.abc import Sequence

from fifthwheel.apps.cheng_cebon_2011.comparison import QUANTITIES, ArmResult, Row, VariantErrors
from fifthwheel.base import pages
from fifthwheel.base.formatting import digits, fixed, shown, with_sigma

HEADINGS = {
    "simulation": "Simulated truck, uniform payload (section 3)",
    "point payload": "Simulated truck, point payload (section 3.3)",
    "test vehicle": "Truck similar to the test vehicle (section 4)",
    "test vehicle with errors": (
        "Truck similar to the test vehicle, with the errors that the article suspects (section 4)"
    ),
}
"""Heading of each experiment."""
REMARKS = (
    "The TruckSim vehicle of the article is not public. This study uses a multibody truck with the published values, "
    "the values that follow from them, and assumptions for all others. Its tyres are not linear and have relaxation "
    "lengths; its axles roll on their tyres.",
    "The method `article` uses the settings and the models of the article: no relaxation length, and no roll in stage "
    "1. The article gives neither P_p(0) nor the sampling rate; this study uses Q_p and 100 Hz. The table of variants "
    "shows their effect (not with `--quick`).",
    "Two assumptions about the vehicle have the largest effect on the payload height of the article's preset: the "
    "height of the roll centres and the roll stiffness of the suspensions. The published error of 0.6 % is so small "
    "because TruckSim and the estimator used the same values. On a real truck, the error is larger.",
    "The speed, the true tyre parameters and the optical noise of section 4 are assumptions of this study. The "
    "sideslip at the landing leg is relative to the road below the body, as an optical sensor on the body measures "
    "it.",
)
"""What a reader must know besides the numbers."""
LEGEND = """\
- **Published**: the number in the article, with the error that the article states against its own reference.
- **Method**: `article` is the two-stage method with the article's preset, `default` with its default settings;
  `front fixed` fixes the front cornering stiffness at the manufacturer's value. `one stage` estimates all unknowns
  together, with saturating tyres: its cornering stiffness is the slope at zero slip, the upper end of the range.
- **Estimate**: the mean over the seeds ± the standard deviation over the seeds. Each seed has its own sensor noise and
  its own initial values; all methods use the same seeds.
- **True value**: that of the nonlinear truck. Its tyres are not linear, so a cornering stiffness has a range, as in
  Figure 4 of the article: side force divided by slip angle in two steady turns. Their steer angles are 0.1° and 1° in
  section 3, 0.1° and the largest of the lane change in section 4.
- **Error**: the error of the mean, in per cent of the true value; for a cornering stiffness, its distance from the
  range.
- **Worst seed**: the estimate with the largest error, and this error.
- **Converged**: the number of seeds with the verdict `converged`.
- **Worse than published**: the error of the mean divided by the published error, without signs, and the number of seeds
  with a larger error than published. It is – where the article states no error. For a cornering stiffness, the article
  shows a range in a figure, for tyres that it does not describe; these numbers are no target for this truck."""
HEAD = (
    *("Quantity", "Published", "Method", "Estimate", "True value"),
    *("Error", "Worst seed", "Converged", "Worse than published"),
)
CSV_HEAD = (
    "experiment,section,quantity,unit,published,published_reference,published_error_percent,truth_low,truth_high,arm,"
    "seeds,mean,deviation,error_percent,worst,worst_error_percent,converged,fixed,error_by_published,"
    "seeds_worse_than_published\n"
)


def markdown(rows: Sequence[Row], variants: Sequence[VariantErrors] = (), remarks: Sequence[str] = ()) -> str:
    """The document: remarks, results worse than published, a table for each section, the effect of the variants."""
    blocks = [
        "# The article reproduced",
        "C. Cheng, D. Cebon, *Parameter and state estimation for articulated heavy vehicles*, Vehicle System Dynamics"
        " 49 (2011) 399–418: every published result beside the estimates of this package on its own nonlinear truck.",
        *(["\n".join(f"- {remark}" for remark in remarks)] if remarks else []),
        "## Worse than published",
        worse_than_published(rows),
        "## How to read the tables",
        LEGEND,
    ]
    for case in dict.fromkeys(row.experiment for row in rows):
        blocks.append(f"## {HEADINGS.get(case, case)}")
        for section in dict.fromkeys(row.section for row in rows if row.experiment == case):
            in_section = [row for row in rows if (row.experiment, row.section) == (case, section)]
            blocks.append(f"### {section} {topic(in_section)}")
            blocks.append(_table(HEAD, [line for row in in_section for line in _lines(row)], left=(0, 2)))
    if variants:
        blocks.append("## Sensitivity of the article's preset")
        blocks.append(
            "Error of the mean over the seeds, in per cent of the true value; for a cornering stiffness, of the value"
            " in the vehicle file. Each line changes one thing in the experiment of section 3: a setting that the"
            " article does not publish, or an error of its models."
        )
        blocks.append(_variant_table(variants))
    return "\n\n".join(blocks) + "\n"


def topic(rows: Sequence[Row]) -> str:
    """Title of a section."""
    if all(row.reference is None for row in rows):
        return "States"
    if any(row.text.unit == "N/rad" for row in rows):
        return "Cornering stiffness and yaw inertia"
    return "Height and roll inertia"


def worse_than_published(rows: Sequence[Row]) -> str:
    """A line for each arm of each experiment: quantities with a larger error than published."""
    lines = []
    for case in dict.fromkeys(row.experiment for row in rows):
        pairs = [(row, result) for row in rows if row.experiment == case for result in row.arms]
        for arm in dict.fromkeys(result.arm for _, result in pairs):
            factors = [(row, result.factor) for row, result in pairs if result.arm == arm and result.factor is not None]
            worse = [f"{_short(row)} ({times(factor)})" for row, factor in factors if factor > 1]
            summary = f"**{len(worse)} of {len(factors)}**: {', '.join(worse)}" if worse else f"none of {len(factors)}"
            lines.append(f"- {HEADINGS.get(case, case)}, {arm}: {summary}")
    return "\n".join(
        ["Quantities for which the mean over all seeds has a larger error than the published value:", "", *lines]
    )


def times(factor: float) -> str:
    """A ratio in words: "2.3 times"."""
    return f"{fixed(factor, 1 if factor >= 1.05 else 2)} times"


def as_csv(rows: Sequence[Row]) -> str:
    """A line for each quantity and arm, in SI and per cent."""
    file = io.StringIO(CSV_HEAD)
    file.seek(0, io.SEEK_END)
    writer = csv.writer(file, lineterminator="\n")
    for row in rows:
        p, (low, high) = row.published, row.reference or (None, None)
        error = None if p is None or p.error is None else 100 * p.error
        published = (None, None, None) if p is None else (p.value, p.reference, error)
        for a in row.arms:
            cells = (
                *(row.experiment, row.section, row.quantity, row.text.unit, *published, low, high),
                *(a.arm, a.seeds, a.mean, a.deviation, a.error, a.worst, a.worst_error, a.converged, int(a.fixed)),
                *(a.factor, a.worse_seeds),
            )
            writer.writerow(f"{cell:.6g}" if isinstance(cell, float) else cell for cell in cells)
    return file.getvalue()


def document(rows: Sequence[Row]) -> pages.Document:
    """The estimates beside the published numbers, for a terminal of 80 columns."""
    blocks: list[pages.Block] = []
    for case in dict.fromkeys(row.experiment for row in rows):
        cells: list[tuple[pages.Cell, ...]] = []
        for row in (row for row in rows if row.experiment == case):
            name = f"{_short(row)}, {shown(row.text.unit).name}"
            published = "–" if row.published is None else _number(row.published.value, row)
            for result in row.arms:
                worse = result.factor is not None and result.factor > 1
                mark = "–" if result.factor is None else (f"x {digits(result.factor, 2)}" if worse else "no")
                verdict = pages.Mark(mark, "doubtful") if worse else mark
                estimate, error = _number(result.mean, row), _error(result.error, row)
                cells.append((name, published, result.arm, estimate, error, verdict))
                name = published = ""
        heads = ("Quantity", "Published>", "Arm", "Estimate>", "Error>", "Worse>")
        blocks += [pages.Heading(HEADINGS.get(case, case), key=case), pages.Table(heads, cells)]
    return pages.Document("The article reproduced", blocks)


def _short(row: Row) -> str:
    """The article's symbol, or the name of a state."""
    return row.text.symbol if row.reference else row.text.words.removeprefix("rms error, ")


def _lines(row: Row) -> list[tuple[str, ...]]:
    """The cells of a row, a line for each arm; cells that all arms share are in the first line only."""
    symbol, p = f" `{row.text.symbol}`" if row.text.symbol else "", row.published
    words, truth = f"{row.text.words}{symbol}", _truth(row)
    published = "–" if p is None else _value(p.value, row)
    if p is not None and p.error is not None:
        published += f" ({_signed(100 * p.error)})"
    lines: list[tuple[str, ...]] = []
    for a in row.arms:
        estimate = with_sigma(a.mean, a.deviation, row.text.unit) if a.deviation else _value(a.mean, row)
        if a.fixed:
            worst = converged = "fixed"
        else:
            worst = _value(a.worst, row) + ("" if a.worst_error is None else f" ({_error(a.worst_error, row)})")
            converged = "–" if a.converged is None else f"{a.converged} of {a.seeds}"
        lines.append((words, published, a.arm, estimate, truth, _error(a.error, row), worst, converged, _mark(a)))
        words = published = truth = ""
    return lines


def _mark(result: ArmResult) -> str:
    if result.factor is None:
        return "–"
    seeds = f"{result.worse_seeds} of {result.seeds} seeds" if result.worse_seeds else ""
    if result.factor > 1:
        return f"**{times(result.factor)}**, {seeds or 'no seed'}"
    return f"no, but {seeds}" if seeds else "no"


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


def _variant_table(variants: Sequence[VariantErrors]) -> str:
    quantities = {name: text for name, text in QUANTITIES.items() if any(name in v.values for v in variants)}
    head = ("Change", "Seeds", *(f"`{text.symbol}`" for text in quantities.values()))
    lines = [
        (v.name, str(v.seeds), *(_signed(v.values[name]) if name in v.values else "–" for name in quantities))
        for v in variants
    ]
    return _table(head, lines, left=(0,))


def _table(head: Sequence[str], lines: Sequence[Sequence[str]], *, left: tuple[int, ...]) -> str:
    """A Markdown table; the columns `left` are aligned left, all others right."""
    rule = ["---" if i in left else "---:" for i in range(len(head))]
    return "\n".join(
        "| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in (head, rule, *lines)
    )
