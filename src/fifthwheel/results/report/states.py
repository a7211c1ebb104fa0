"""The report of states, their section in the report of an identification, and their document for a terminal."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

import fifthwheel
from fifthwheel.base import pages
from fifthwheel.base.formatting import approximate, percent
from fifthwheel.base.names import split_log
from fifthwheel.base.pages import html
from fifthwheel.base.pages.html import text
from fifthwheel.base.plots import Axis, Band, Item, Line, Panel, Plot
from fifthwheel.base.plots.items import DARK, rgba
from fifthwheel.data.channels import ARTICULATION, ROLL, Channel, SignalName, is_sensor_error, names_of, si_unit
from fifthwheel.data.channels.lateral import SIDESLIP
from fifthwheel.data.record import Record
from fifthwheel.estimate.observe import States, Status
from fifthwheel.estimate.observe.states import SHADES
from fifthwheel.results.diagnose.summaries import StateSummary, record_of, summarise_records, summarise_states
from fifthwheel.results.report import consistency
from fifthwheel.results.report.conclusion import Conclusion, conclude_states
from fifthwheel.results.report.provenance import Provenance, logs_and_origin
from fifthwheel.results.report.words import STATUSES, counted, sentence
from fifthwheel.truck.drawing import UNITS
from fifthwheel.truck.spoken_names import named_unit, spoken

MAIN_STATES = (SIDESLIP, ARTICULATION, ROLL)
"""Those that are drawn before the appendix."""


@dataclass(frozen=True, kw_only=True)
class StateConditions:
    """How states were estimated."""

    smoothed: bool = False
    uncertain: tuple[str, ...] = ()  # vehicle parameters and sensor errors whose uncertainty every sigma includes

    def in_words(self, *, identified: bool = False) -> str:
        """What the bands include; `identified` for states in the report of an identification."""
        errors = len({split_log(name)[0] for name in self.uncertain if is_sensor_error(name)})
        parameters = sum(not is_sensor_error(name) for name in self.uncertain)
        if self.uncertain:
            counts = f"{counted(parameters, 'vehicle parameter')} and {counted(errors, 'sensor error')}"
            band = f"The band includes the uncertainty of {counts} from the identification."
        else:
            band = "The band does not include the uncertainty of the parameters and sensor errors. " + (
                "Only the one-stage method estimates this uncertainty."
                if identified
                else "To include it, give identification.json (-i)."
            )
        return f"{band} Smoothed: each sample also uses later measurements." if self.smoothed else band


def write_states_report(
    path: str | Path,
    states: Sequence[States],
    records: Sequence[Record],
    *,
    title: str,
    name: str = "",
    conclusion: Conclusion | None = None,
    conditions: StateConditions | None = None,
    provenance: Provenance | None = None,
    figures: str | None = None,
) -> list[Path]:
    """Write the report of the states of a given vehicle as one HTML file; arguments, result and errors as of
    `write_report`."""
    conclusion = conclusion or conclude_states(states, records)
    results = [pages.Items(conclusion.results, "Result")]
    section = states_section(states, records, conditions, reliable=not conclusion.cautions)
    appendix = [
        *pages.folded(all_states(states, records)),
        *pages.folded(consistency.section(states, ()) if states else ()),
        *pages.folded(logs_and_origin(records, summarise_records(records), provenance)),
    ]
    subtitle = f"States of a given truck, fifthwheel {fifthwheel.__version__}"
    document = pages.Document(title, [conclusion.box(results), *section], subtitle, appendix, name)
    return html.write(Path(path), document, images=figures)


def states_document(
    states: Sequence[States], records: Sequence[Record], conclusion: Conclusion | None = None
) -> pages.Document:
    """How reliable the states of each record are, their uncertainty, cautions and next steps."""
    conclusion = conclusion or conclude_states(states, records)
    blocks: list[pages.Block] = [pages.Headline(conclusion.headline, conclusion.good)]
    for s in states:
        blocks += _tables(summarise_states(s, records))
    return pages.Document(conclusion.headline, [*blocks, *conclusion.advice()])


def _tables(summary: StateSummary) -> Iterator[pages.Block]:
    columns = {"2 sigma, median>": summary.band}
    if any(value is not None for value in summary.reference_rms.values()):
        columns["rms from reference>"] = summary.reference_rms
    rows = [
        (name, *["–" if v is None else approximate(v, si_unit(name)) for v in (c[name] for c in columns.values())])
        for name in summary.band
    ]
    yield pages.Table((pages.TableColumn(summary.name), *columns), rows)
    statuses = [f"{percent(fraction)} {STATUSES[status]}" for status, fraction in summary.status.items()]
    yield pages.Paragraph(f"Samples: {'; '.join(statuses)}")
    if summary.lift_warning:
        yield pages.Paragraph(sentence(summary.lift_warning))
    sizes = [
        (name, f"{size.rms:.2f}" if np.isfinite(size.rms) else "–", percent(size.rejected))
        for name, size in summary.innovations.items()
    ]
    yield pages.Table(("Measured", "Innovation rms, sigma>", "Rejected>"), sizes)


def states_section(
    states: Sequence[States],
    records: Sequence[Record],
    conditions: StateConditions | None,
    *,
    reliable: bool = True,
    identified: bool = False,
) -> Iterator[pages.Block]:
    """One figure for each log: sideslip, articulation and roll of all units, with their bands and references."""
    if not states:
        return
    yield pages.Heading("States", key="states")
    band = f" {conditions.in_words(identified=identified)}" if conditions else ""
    doubt = "" if reliable else " Do not rely on these states: the truck does not fit the measurements (see the top)."
    yield pages.Hint(
        f"The lines are the estimated states; the band is ± 2 sigma (95 %).{band} Measured values are not corrected "
        f"for offsets. Do not use the states in shaded intervals.{doubt}"
    )
    for s in states:
        yield pages.Plots([_main_states(s, record_of(s, records))])
        yield _statuses(summarise_states(s, records))


def _main_states(states: States, record: Record | None) -> pages.CaptionedPlot:
    panels = [_of_all_units(states, record, channel) for channel in MAIN_STATES if names_of(channel, states.values)]
    return pages.CaptionedPlot(
        states.name, Plot(panels=panels), f"log {states.name}", (states.name, "states", "main states")
    )


def _of_all_units(states: States, record: Record | None, channel: Channel) -> Panel:
    """A quantity of all units: each has its colour, with which the legend names it."""
    items, ranges = list[Item](states.status_spans()), list[float]()
    units = list(dict.fromkeys(SignalName.of(name).unit for name in states.values))
    for name in names_of(channel, states.values):
        panel, unit = states.panel(name, record), SignalName.of(name).unit
        colour = UNITS[units.index(unit) % len(UNITS)]
        for item in panel.items:
            if isinstance(item, Line) and item.name == "estimate":
                items.append(replace(item, name=named_unit(unit).capitalize(), colour=colour))
            elif isinstance(item, Line) and item.name == "reference":
                items.append(replace(item, colour=DARK, width=1.2))
            else:
                items.append(replace(item, colour=colour) if isinstance(item, Band) else item)
        ranges += panel.y.range or ()
    y = Axis(unit=panel.y.unit, range=(min(ranges), max(ranges)))
    return Panel(items=items, title=spoken(channel.quantity), x=panel.x, y=y)


def all_states(states: Sequence[States], records: Sequence[Record]) -> Iterator[pages.Block]:
    """Each state of each log with its band, its measurement and its reference."""
    if not states:
        return
    yield pages.Heading("All states", key="all-states")
    for s in states:
        record, summary = record_of(s, records), summarise_states(s, records)
        yield pages.Heading(s.name)
        yield pages.Plots([_state(s, record, summary, name) for name in s.values])


def _statuses(summary: StateSummary) -> pages.Markup:
    items = []
    for name, fraction in summary.status.items():
        shade = SHADES.get(Status[name])
        swatch = f'<span class="swatch" style="background:{rgba(*shade)}"></span>' if shade else ""
        items.append(f"{swatch}{percent(fraction)} {text(STATUSES[name])}")
    return pages.Markup(f'<p class="hint">Samples: {", ".join(items)}.</p>')


def _state(states: States, record: Record | None, summary: StateSummary, name: str) -> pages.CaptionedPlot:
    unit, width, rms = si_unit(name), summary.band[name], summary.reference_rms[name]
    note = "never estimated" if width is None else f"± {approximate(width, unit)} (2 sigma, median)"
    note += "" if rms is None else f"; rms difference from the reference {approximate(rms, unit)}"
    panel = states.panel(name, record, states.status_spans())
    return pages.CaptionedPlot(
        spoken(name), Plot(panels=[panel]), f"log {states.name}", (states.name, "states", name), note=note
    )
