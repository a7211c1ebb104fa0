"""Whether the innovations of states and the residuals of an identification are white noise."""

from collections.abc import Iterator, Sequence

import numpy as np

from fifthwheel.base import pages
from fifthwheel.base.formatting import percent
from fifthwheel.base.plots import Axis, Band, Bars, Guide, Item, Line, Panel, Plot, Points
from fifthwheel.base.plots.items import BLUE, DARK, GREY, SKY, VERMILLION, visible_range
from fifthwheel.base.types import Array
from fifthwheel.estimate.identify import Fit
from fifthwheel.estimate.observe import States
from fifthwheel.results.diagnose import whiteness
from fifthwheel.results.diagnose.summaries import innovation_size, normalised_innovation, rejected_samples
from fifthwheel.results.diagnose.whiteness import Autocorrelation, SegmentRms

BINS = 31
HISTOGRAM_LIMIT = 4.0
"""A histogram spans so many standard deviations to either side; values beyond count in its outer bars."""
MAX_MARKS = 1000
"""The largest number of marks of rejected samples."""
TIME = Axis(label="time", unit="s")


def section(states: Sequence[States], fits: Sequence[Fit]) -> Iterator[pages.Block]:
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
    correlation = whiteness.autocorrelation(time, values)
    outliers, in_sigma = whiteness.outlier_fraction(values), fit is not None and fit.identified_on
    text = whiteness.describe_whiteness(correlation, outliers, free_run=fit is not None, in_sigma=in_sigma)

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
        text += f" {whiteness.describe_innovation_rms(size.rms, int(np.isfinite(accepted).sum()))}"
        segments = whiteness.segment_rms(states.time, accepted)
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
