"""The comparison as a document, for a page and a terminal: published numbers, estimates, and where these are worse."""

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
LEGEND = (
    "Published: the number in the article, with the error that the article states against its own reference.",
    "Method: article is the two-stage method with the article's preset, default with its default settings; front fixed "
    "fixes the front cornering stiffness at the manufacturer's value. One stage estimates all unknowns together, with "
    "saturating tyres: its cornering stiffness is the slope at zero slip, the upper end of the range.",
    "Estimate: the mean over the seeds ± the standard deviation over the seeds. Each seed has its own sensor noise and "
    "its own initial values; all methods use the same seeds.",
    "True value: that of the nonlinear truck. Its tyres are not linear, so a cornering stiffness has a range, as in "
    "Figure 4 of the article: side force divided by slip angle in two steady turns. Their steer angles are 0.1° and 1° "
    "in section 3, 0.1° and the largest of the lane change in section 4.",
    "Error: the error of the mean, in per cent of the true value; for a cornering stiffness, its distance from the "
    "range. Worst seed: the estimate with the largest error, and this error.",
    "Worse than published: the error of the mean divided by the published error, without signs, and the number of "
    "seeds with a larger error than published. It is – where the article states no error. For a cornering stiffness, "
    "the article shows a range in a figure, for tyres that it does not describe; these numbers are no target for this "
    "truck.",
)
"""How to read the tables."""
HEADS = ("Quantity", "Published>", "Method", "Estimate>", "True value>", "Error>", "Worst seed>", "Converged>", "Worse")
"""A terminal leaves out true value, worst seed and number of seeds that converged."""


def document(
    rows: Sequence[Row],
    variants: Sequence[VariantErrors] = (),
    remarks: Sequence[str] = (),
    figures: Sequence[pages.CaptionedPlot] = (),
) -> pages.Document:
    """Results worse than published, a table for each experiment, figures, remarks, and the effect of the variants."""
    blocks: list[pages.Block] = [pages.Items(worse_than_published(rows), title="Worse than published")]
    for case in dict.fromkeys(row.experiment for row in rows):
        cells = [line for row in rows if row.experiment == case for line in _lines(row)]
        blocks += [pages.Heading(HEADINGS.get(case, case), key=case), pages.Table(HEADS, cells)]
    if figures:
        blocks.append(pages.Plots(figures))
    if variants:
        text = (
            "Error of the mean over the seeds, in per cent of the true value; for a cornering stiffness, of the value "
            "in the vehicle file. Each line changes one thing in the experiment of section 3: a setting that the "
            "article does not publish, or an error of its models."
        )
        parts = pages.Paragraph(text), _variant_table(variants)
        blocks.append(pages.Folded("Sensitivity of the article's preset", parts))
    if remarks:
        notes = [pages.Items(remarks), pages.Items(LEGEND, title="How to read the tables")]
        blocks.append(pages.Folded("Remarks", notes))
    subtitle = "C. Cheng, D. Cebon: Parameter and state estimation for articulated heavy vehicles (2011)"
    return pages.Document("The article reproduced", blocks, subtitle=subtitle)


def worse_than_published(rows: Sequence[Row]) -> list[str]:
    """A line for each arm of each experiment: quantities whose mean has a larger error than the published value."""
    lines = []
    for case in dict.fromkeys(row.experiment for row in rows):
        pairs = [(row, result) for row in rows if row.experiment == case for result in row.arms]
        for arm in dict.fromkeys(result.arm for _, result in pairs):
            factors = [(row, result.factor) for row, result in pairs if result.arm == arm and result.factor is not None]
            worse = [f"{_short(row)} ({times(factor)})" for row, factor in factors if factor > 1]
            summary = f"{len(worse)} of {len(factors)}: {', '.join(worse)}" if worse else f"none of {len(factors)}"
            lines.append(f"{HEADINGS.get(case, case)}, {arm}: {summary}")
    return lines


def times(factor: float) -> str:
    """A ratio in words: "2.3 times"."""
    return f"{fixed(factor, 1 if factor >= 1.05 else 2)} times"


def _short(row: Row) -> str:
    """The article's symbol, or the name of a state."""
    return row.text.symbol if row.reference else row.text.words.removeprefix("rms error, ")


def _lines(row: Row) -> list[tuple[pages.Cell, ...]]:
    """The cells of a row, a line for each arm; cells that all arms share are in the first line only."""
    p, name, truth = row.published, f"{_short(row)}, {shown(row.text.unit).name}", _truth(row)
    published = "–" if p is None else _number(p.value, row)
    if p is not None and p.error is not None:
        published += f" ({_signed(100 * p.error)})"
    lines: list[tuple[pages.Cell, ...]] = []
    for a in row.arms:
        estimate = with_sigma(a.mean, a.deviation, row.text.unit) if a.deviation else _number(a.mean, row)
        estimate = estimate.removesuffix(f" {shown(row.text.unit).name}")  # it stands beside the quantity
        if a.fixed:
            worst = converged = "fixed"
        else:
            worst = _number(a.worst, row) + ("" if a.worst_error is None else f" ({_error(a.worst_error, row)})")
            converged = "–" if a.converged is None else f"{a.converged} of {a.seeds}"
        cells = estimate, pages.Markup(truth), _error(a.error, row), pages.Markup(worst), pages.Markup(converged)
        lines.append((name, published, a.arm, *cells, _mark(a)))
        name = published = truth = ""
    return lines


def _mark(result: ArmResult) -> pages.Cell:
    """Whether an error is larger than the published one."""
    if result.factor is None:
        return "–"
    seeds = f"{result.worse_seeds} of {result.seeds}" if result.worse_seeds else ""
    if result.factor > 1:
        return pages.Mark(f"{times(result.factor)}, {seeds or 'none'}", "doubtful")
    return f"no, but {seeds}" if seeds else "no"


def _truth(row: Row) -> str:
    if row.reference is None:
        return "–"
    low, high = row.reference
    return _number(low, row) if low == high else f"{_number(low, row)} to {_number(high, row)}"


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


def _variant_table(variants: Sequence[VariantErrors]) -> pages.Table:
    quantities = {name: text for name, text in QUANTITIES.items() if any(name in v.values for v in variants)}
    heads = ("Change", "Seeds>", *(f"{text.symbol}>" for text in quantities.values()))
    lines = [
        (v.name, str(v.seeds), *(_signed(v.values[name]) if name in v.values else "–" for name in quantities))
        for v in variants
    ]
    return pages.Table(heads, lines)
