"""Comparisons of identifications, evaluations by a test method and validations: their pages and documents."""

from pathlib import Path

import fifthwheel
from fifthwheel.base import pages
from fifthwheel.base.pages import html
from fifthwheel.results.diagnose.comparison import Comparison
from fifthwheel.results.evaluate import Evaluation, Validation
from fifthwheel.results.report.conclusion import counted
from fifthwheel.results.report.provenance import Provenance
from fifthwheel.truck.spoken_names import spoken

ESTIMATES = "Estimates of all results"
"""Name of the table."""
OF_A_COMPARISON = (
    "Difference: from the first run, with its own sigma. A single difference of equal trucks is beyond 2 sigma with a "
    "probability of 5 %; the headline takes the number of differences into account. Errors of vehicle file and model "
    "that both runs share cancel. CoG height and rollover threshold follow from the parameters; their sigma has these "
    "errors too, so that their differences are at least so many sigma."
)
OF_AN_EVALUATION = (
    "Sigma is that of the log: sensor noise, and the scatter of segments or repetitions. Scale errors of sensors are "
    "not in it. A log does not show track, wind, load and tyres, which ISO 15037-2 requires to be reported too."
)
OF_A_VALIDATION = (
    "Outside: the difference is larger than the tolerance by more than two sigma. Inside: it is smaller by two sigma; "
    "for the points of curves, three sigma, and 95 % of them. "
    "Undecided: sigma is too large, the histories have other steer angles, or the results cover less than half of a "
    "curve. The default tolerances are ours, and of no standard: state those of your standard or contract. "
    "Sigma is that of noise and repetitions; scale errors of sensors are not in it."
)


def comparison_page(comparison: Comparison) -> pages.Document:
    """Table, notes and plots of a comparison."""
    figures = [
        pages.CaptionedPlot(spoken(name), plot, group=name, path=("", "comparison", name))
        for name, plot in comparison.plots().items()
    ]
    blocks: list[pages.Block] = [
        pages.Headline(comparison_headline(comparison)),
        pages.Heading("Estimates", key="estimates"),
        pages.Hint(OF_A_COMPARISON),
        _table(comparison),
        pages.Items(comparison.notes),
        pages.Heading("Plots", key="plots"),
        pages.Plots(figures),
    ]
    subtitle = f"{', '.join(comparison.runs)}; fifthwheel {fifthwheel.__version__}"
    return pages.Document("Comparison", blocks, subtitle)


def comparison_document(comparison: Comparison) -> pages.Document:
    """Headline, estimates and notes."""
    rows: list[tuple[pages.Cell, ...]] = []
    for name, run, estimate, _, percent, sigmas in comparison.rows():
        if run == comparison.runs[0]:
            rows.append((pages.Hinted(spoken(name), name), "", "", ""))
        rows.append((f"- {run}", estimate, percent, sigmas))
    table = pages.Table(("Parameter and run", "Estimate>", "Difference>", "In sigma>"), rows, label=ESTIMATES)
    notes = pages.Items([*comparison.notes, OF_A_COMPARISON], "Notes")
    return pages.Document("Comparison", [pages.Headline(comparison_headline(comparison)), table, notes])


def _table(comparison: Comparison) -> pages.Table:
    """Estimates and differences, with the name of the parameter in each row."""
    rows: list[tuple[pages.Cell, ...]] = [
        (pages.Hinted(spoken(name), name), *texts) for name, *texts in comparison.rows()
    ]
    heads = ("Parameter|name", "Run|main", "Estimate>", "Difference>|wide", "In %>", "In sigma>")
    return pages.Table(heads, rows, label=ESTIMATES)


def comparison_headline(comparison: Comparison) -> str:
    """What differs most from the first run, or that no difference is beyond chance."""
    largest, clear = comparison.largest_difference(), comparison.beyond_chance()
    if largest is None:
        return f"No difference from {comparison.runs[0]} has a sigma."
    parameter, k = largest
    difference = f"{spoken(parameter.name)} of {comparison.runs[k]}"
    size = parameter.in_percent(k) or parameter.in_unit(k)
    if not clear and comparison.share_logs:
        return f"The runs share logs: no test of the truck. Largest difference: {difference}, {size}."
    if not clear:
        return f"No difference beyond chance. Largest: {difference}, {size} ({parameter.in_sigmas(k)})."
    others = counted(len(clear) - 1, "other difference")
    more = f" {others} {'is' if len(clear) == 2 else 'are'} beyond chance too." if clear[1:] else ""
    return f"Differs most from {comparison.runs[0]}: {difference}, {size} ({parameter.in_sigmas(k)}).{more}"


def write_evaluation_report(
    path: Path, evaluation: Evaluation | Validation, *, provenance: Provenance | None = None, figures: str | None = None
) -> list[Path]:
    """Write the page of an evaluation or a validation as one HTML file; arguments, result and errors as of
    `write_report`."""
    if isinstance(evaluation, Validation):
        document, of_log = validation_document(evaluation), evaluation.log
    else:
        document, of_log = evaluation_document(evaluation), evaluation
    plots = [
        pages.CaptionedPlot(caption, plot, group=of_log.test, path=(of_log.log, of_log.test, caption))
        for caption, plot in evaluation.plots().items()
    ]
    blocks = [
        *document.blocks,
        pages.Heading("Diagrams", key="diagrams"),
        pages.Plots(plots),
        *(provenance.blocks() if provenance is not None else ()),
    ]
    subtitle = f"{of_log.standard}, fifthwheel {fifthwheel.__version__}"
    return html.write(path, pages.Document(document.title, blocks, subtitle), images=figures)


def evaluation_document(evaluation: Evaluation) -> pages.Document:
    """Headline, measures, conditions and notes."""
    blocks: list[pages.Block] = [
        pages.Headline(evaluation_headline(evaluation), all(c.met is not False for c in evaluation.conditions)),
        pages.Heading("Measures", key="measures"),
        evaluation.table(),
        pages.Heading("Conditions of ISO 15037-2", key="conditions"),
        evaluation.condition_table(),
        pages.Items([*evaluation.notes, OF_AN_EVALUATION], "Notes"),
    ]
    return pages.Document(f"{evaluation.title}, {evaluation.log}", blocks)


def evaluation_headline(evaluation: Evaluation) -> str:
    """The first measure of the test, and the conditions that the log does not meet."""
    missed = [c.name for c in evaluation.conditions if c.met is False]
    first, others = evaluation.measures[0], len(evaluation) - 1
    text = f"{evaluation.log} by {evaluation.standard}: {first.title} {first.text()}"
    text += f", and {counted(others, 'other measure')}." if others else "."
    return f"{text} Not met: {', '.join(missed)}." if missed else f"{text} It meets the conditions that a log shows."


def validation_document(validation: Validation) -> pages.Document:
    """Headline, measures, curves and notes."""
    log, verdict = validation.log, validation.verdict
    verdicts = {m.title: m.verdict for m in validation.measures} | {c.title: c.verdict for c in validation.curves}
    names = [title for title, of_title in verdicts.items() if of_title == verdict]
    text = f"{verdict}, {len(names)} of {len(verdicts)} measures and curves"
    text += "" if verdict == "inside" else f", such as the {names[0][0].lower()}{names[0][1:]}"
    blocks: list[pages.Block] = [
        pages.Headline(f"{log.title}, {validation.results.log} against {log.log}: {text}.", verdict == "inside"),
        pages.Heading("Measures", key="measures"),
        validation.table(),
        pages.Heading("Curves", key="curves"),
        validation.curve_table(),
        pages.Heading("Conditions of ISO 15037-2, log", key="conditions"),
        log.condition_table(),
        pages.Items([*validation.notes, OF_A_VALIDATION], "Notes"),
    ]
    return pages.Document(f"Validation, {validation.results.log} against {log.log}", blocks)
