"""A comparison of identifications: its page, and its result on a terminal and in the workbench."""

import fifthwheel
from fifthwheel.base import pages
from fifthwheel.results.diagnose.comparison import Comparison
from fifthwheel.results.report.words import counted
from fifthwheel.truck.spoken_names import spoken

EXPLANATION = (
    "Difference: from the first run, with its own sigma. A single difference of equal trucks is beyond 2 sigma with a "
    "probability of 5 %; the headline takes the number of differences into account. Errors of vehicle file and model "
    "that both runs share cancel. CoG height and rollover threshold follow from the parameters; their sigma has these "
    "errors too, so that their differences are at least so many sigma."
)


def comparison_page(comparison: Comparison) -> pages.Document:
    """Table, notes and plots of a comparison."""
    figures = [
        pages.CaptionedPlot(spoken(name), plot, group=name, path=("", "comparison", name))
        for name, plot in comparison.plots().items()
    ]
    blocks: list[pages.Block] = [
        pages.Headline(headline(comparison)),
        pages.Heading("Estimates", key="estimates"),
        pages.Hint(EXPLANATION),
        _table(comparison, repeat=True),
        pages.Items(comparison.notes),
        pages.Heading("Plots", key="plots"),
        pages.Plots(figures),
    ]
    subtitle = f"{', '.join(comparison.runs)}; fifthwheel {fifthwheel.__version__}"
    return pages.Document("Comparison", blocks, subtitle)


def comparison_document(comparison: Comparison) -> pages.Document:
    """Headline, estimates and notes."""
    notes = pages.Items([*comparison.notes, EXPLANATION], "Notes")
    return pages.Document("Comparison", [pages.Headline(headline(comparison)), _table(comparison), notes])


def _table(comparison: Comparison, *, repeat: bool = False) -> pages.Table:
    """Estimates and differences; the name of a parameter is in its first row only, or in each."""
    first = comparison.runs[0]
    rows = [
        (pages.Hinted(spoken(name), name) if repeat or run == first else "", run, *texts)
        for name, run, *texts in comparison.rows()
    ]
    heads = ("Parameter|name", "Run|main", "Estimate>", "Difference>|wide", "In %>", "In sigma>")
    return pages.Table(heads, rows, label="Estimates of all results")


def headline(comparison: Comparison) -> str:
    """What differs most from the first run, or that no difference is beyond chance."""
    largest, clear = comparison.largest_difference(), comparison.beyond_chance()
    if largest is None:
        return f"No difference from {comparison.runs[0]} has a sigma."
    parameter, k = largest
    difference = f"{spoken(parameter.name)} of {comparison.runs[k]}"
    size = parameter.in_percent(k) or parameter.in_unit(k)
    if not clear:
        return f"No difference beyond chance. Largest: {difference}, {size} ({parameter.in_sigmas(k)})."
    others = counted(len(clear) - 1, "other difference")
    more = f" {others} {'is' if len(clear) == 2 else 'are'} beyond chance too." if clear[1:] else ""
    return f"Differs most from {comparison.runs[0]}: {difference}, {size} ({parameter.in_sigmas(k)}).{more}"
