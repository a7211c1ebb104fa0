"""The report of states: their section in the report of an identification, their consistency, their document."""

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
from fifthwheel.base.plots import Axis, Band, Bars, Guide, Item, Line, Panel, Plot, Points
from fifthwheel.base.plots.items import BLUE, DARK, GREY, SKY, VERMILLION, rgba, visible_range
from fifthwheel.base.types import Array
from fifthwheel.data.channels import ARTICULATION, ROLL, Channel, SignalName, is_sensor_error, names_of, si_unit
from fifthwheel.data.channels.table import SIDESLIP
from fifthwheel.data.record import Record
from fifthwheel.estimate.identify import Fit
from fifthwheel.estimate.observe import States, Status
from fifthwheel.estimate.observe.states import SHADES
from fifthwheel.results.diagnose.residuals import (
    Autocorrelation,
    SegmentRms,
    autocorrelation,
    describe_innovation_rms,
    describe_whiteness,
    outlier_fraction,
    segment_rms,
)
from fifthwheel.results.diagnose.summaries import (
    StateSummary,
    innovation_size,
    normalised_innovation,
    record_of,
    rejected_samples,
    summarise_records,
    summarise_states,
)
from fifthwheel.results.report.conclusion import STATUSES, Conclusion, conclude_states, counted, sentence
from fifthwheel.results.report.provenance import Provenance, logs_and_origin
from fifthwheel.truck.drawing import UNITS
from fifthwheel.truck.spoken_names import named_unit, spoken

BINS = 31
HISTOGRAM_LIMIT = 4.0
"""A histogram spans so many standard deviations to either side; values beyond count in its outer bars."""
MAX_MARKS = 1000
"""The largest number of marks of rejected samples."""
TIME = Axis(label="time", unit="s")
MAIN_STATES = (SIDESLIP, ARTICULATION, ROLL)
"""Those that are drawn before the appendix."""


def consistency_section(states: Sequence[States], fits: Sequence[Fit]) -> Iterator[pages.Block]:
    """Innovations of the states, and for each channel whether its residual is white noise."""
    yield pages.Heading("Residuals and consistency", key="consistency")
    if states:
        yield pages.Hint(
            "The normalised innovation is the measurement minus the prediction of the state filter, divided by its "
            "predicted standard deviation. 95 % of the normalised innovations should lie between the dashed lines, "
            "without a pattern; their rms should be 1."
        )
    windows = ", rms of the normalised innovations in time windows (95 % should lie inside the band)" if states else ""
    yield pages.Hint(
        f"Below, one line per channel says whether its {'residual' if fits else 'normalised innovation'} is white "
        "noise. Click a line to see the plots: autocorrelation (white noise stays inside the band), histogram (normal "
        f"noise follows the dashed curve){windows}."
    )
    for log in dict.fromkeys([*(fit.log for fit in fits), *(s.name for s in states)]):
        log_states = next((s for s in states if s.name == log), None)
        log_fits = {fit.signal: fit for fit in fits if fit.log == log}
        predicted_only = any(not fit.identified_on for fit in log_fits.values())
        yield pages.Heading(log, badge="validation log" if predicted_only else "")
        if log_states is not None:
            yield pages.Plots([innovation_figure(log_states, name) for name in log_states.innovation])
        for signal in dict.fromkeys([*log_fits, *(log_states.innovation if log_states else ())]):
            yield _channel(log, signal, log_states, log_fits.get(signal))


def innovation_figure(states: States, name: str) -> pages.CaptionedPlot:
    """Normalised innovations of a channel, with lines at ± 2 and a cross for each rejected sample."""
    size, values = innovation_size(states, name), normalised_innovation(states, name)
    rejected = rejected_samples(states, name)
    accepted = np.where(rejected, np.nan, values)
    limit = max(4.0, 1.05 * float(np.nanmax(np.abs(accepted), initial=0.0)))
    items: list[Item] = [*states.status_spans()]
    items.append(Line(states.time, accepted, name="innovation", colour=SKY, width=0.8, gaps=True))
    marked = np.flatnonzero(rejected)
    if marked.size:
        marked = marked[:: -(-marked.size // MAX_MARKS)]
        texts = tuple(f"{value:.1f} sigma" for value in values[marked])
        heights = np.clip(values[marked], -limit, limit)
        crosses = Points(states.time[marked], heights, name="rejected", colour=VERMILLION, marker="cross", texts=texts)
        items.append(crosses)
    items += [Guide(y=y, colour="#111111", width=1.5) for y in (2.0, -2.0)]
    panel = Panel(items=items, x=TIME, y=Axis(unit="sigma", range=(-1.05 * limit, 1.05 * limit)))
    note = f"rms {size.rms:.2f}, {percent(size.rejected)} rejected" if np.isfinite(size.rms) else "never used"
    path = (states.name, "innovations", name)
    return pages.CaptionedPlot(pages.Code(name), Plot(panels=[panel]), f"log {states.name}", path, note=note)


def _channel(log: str, signal: str, states: States | None, fit: Fit | None) -> pages.Folded:
    """What the residual or the innovation of a channel means, with its small figures folded away."""
    accepted = None
    if states is not None and signal in states.innovation:
        accepted = np.where(rejected_samples(states, signal), np.nan, normalised_innovation(states, signal))
    if fit is not None:
        kind, time, values = "residual", fit.time, fit.measured - fit.predicted
    else:
        assert states is not None
        assert accepted is not None
        kind, time, values = "innovation", states.time, accepted
    values = np.where(np.isfinite(values), values, np.nan)
    values = values / max(float(np.nanmax(np.abs(values), initial=0.0)), 1e-300)  # squares stay finite
    correlation = autocorrelation(time, values)
    outliers, in_sigma = outlier_fraction(values), fit is not None and fit.identified_on
    text = describe_whiteness(correlation, outliers, free_run=fit is not None, in_sigma=in_sigma)

    def figure(name: str, title: str, panel: Panel, group: str = "", note: str = "") -> pages.CaptionedPlot:
        path = (log, "consistency", f"{signal}.{name}")
        group = group or " ".join(("alone", *path))
        return pages.CaptionedPlot(title, Plot(panels=[panel]), group, path, note=note, small=True)

    figures = []
    if correlation is not None:
        figures.append(figure("autocorrelation", f"Autocorrelation of the {kind}", _autocorrelation(correlation)))
        figures.append(figure("histogram", f"Histogram of the {kind}", _histogram(values)))
    if states is not None and accepted is not None:
        size = innovation_size(states, signal)
        text += f" {describe_innovation_rms(size.rms, int(np.isfinite(accepted).sum()))}"
        segments = segment_rms(states.time, accepted)
        if segments is not None:
            note = f"{percent(segments.fraction_within_limits)} of the time windows inside the band"
            figures.append(figure("size", "Rms of the innovation", _rms_by_segment(segments), f"log {log}", note))
    return pages.Folded(pages.Code(signal), [pages.Plots(figures)] if figures else [], text)


def _autocorrelation(correlation: Autocorrelation) -> Panel:
    ends, limit = [0.0, float(correlation.lag[-1])], np.full(2, correlation.limit)
    known = np.isfinite(correlation.value)
    items: list[Item] = [
        Band(ends, -limit, limit, name="95 % of white noise", colour=BLUE),
        Line(correlation.lag[known], correlation.value[known], name="autocorrelation", colour=BLUE),
    ]
    y = Axis(range=visible_range(correlation.value, limit, -limit, 1.0))
    return Panel(items=items, x=Axis(label="lag", unit="s"), y=y)


def _histogram(values: Array) -> Panel:
    """Values in units of their own standard deviation, with the normal distribution."""
    finite = values[np.isfinite(values)]
    scaled = np.clip((finite - finite.mean()) / finite.std(), -HISTOGRAM_LIMIT, HISTOGRAM_LIMIT)
    height, edges = np.histogram(scaled, bins=BINS, range=(-HISTOGRAM_LIMIT, HISTOGRAM_LIMIT), density=True)
    x = np.linspace(-HISTOGRAM_LIMIT, HISTOGRAM_LIMIT, 81)
    normal = np.exp(-(x**2) / 2) / np.sqrt(2 * np.pi)
    items: list[Item] = [
        Bars((edges[1:] + edges[:-1]) / 2, height, name="samples", colour=SKY),
        Line(x, normal, name="normal distribution", colour=DARK, width=1.5, dash="dash"),
    ]
    return Panel(items=items, x=Axis(label="standard deviations"))


def _rms_by_segment(segments: SegmentRms) -> Panel:
    items: list[Item] = [
        Band(segments.time, segments.low, segments.high, name="95 % expected", colour=BLUE, gaps=True),
        Line(segments.time[[0, -1]], [1.0, 1.0], name="expected", colour=GREY, width=1.5, dash="dot"),
        Line(segments.time, segments.rms, name="innovation rms", colour=VERMILLION),
    ]
    return Panel(items=items, x=TIME, y=Axis(unit="sigma", from_zero=True))


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
        *pages.folded(consistency_section(states, ()) if states else ()),
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
