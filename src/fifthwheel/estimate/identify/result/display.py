"""An identification as tables and plots."""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from fifthwheel.base import pages
from fifthwheel.base.errors import SignalError, suggestion
from fifthwheel.base.formatting import percent, shown, with_sigma
from fifthwheel.base.plots import Axis, Band, Guide, Item, Line, Panel, Plot, Points
from fifthwheel.base.plots.items import BLUE, DARK, GREY, VERMILLION, Dash, range_without_spikes, trimmed, visible_range
from fifthwheel.base.types import Array
from fifthwheel.data.channels import si_unit
from fifthwheel.estimate.identify.doubts import describe_doubt
from fifthwheel.estimate.identify.result.parts import Estimate, Fit, IdentificationData, ParameterHistory

TIME = Axis(label="time", unit="s")
HISTORY_BAND = "± 1 sigma"

DERIVED = ", derived"
"""Behind the verdict of an estimate that follows from the parameters."""


def document(identification: IdentificationData, title: str) -> pages.Document:
    """Tables of estimates and fits, the doubts, and the notes."""
    estimates = estimates_table((*identification.parameters, *identification.stated_numbers), identification.derived)
    doubtful = [
        f"; doubtful: {', '.join(doubt.parameters)}" if doubt.parameters else "" for doubt in identification.doubts
    ]
    doubts = [f"{describe_doubt(doubt)}{names}" for doubt, names in zip(identification.doubts, doubtful, strict=True)]
    fits = fits_table(identification.fits)
    return pages.Document(title, [estimates, fits, pages.Items(doubts, "Doubts"), pages.Items(identification.notes)])


def plot(identification: IdentificationData, title: str, kind: str, log: str | None) -> Plot:
    """A plot of a kind, of the fits of one log; a SignalError if the kind or the log does not exist."""
    if kind == "parameters":
        return parameter_plot(identification.parameters, title)
    if kind in ("fits", "residuals"):
        panel = fit_panel if kind == "fits" else residual_panel
        return Plot(title=title, panels=list(map(panel, chosen_fits(identification.fits, log))))
    if kind == "histories":
        if not identification.histories:
            raise SignalError("histories: none in the file of this identification; identify again")
        return history_plot(identification.histories, identification.parameters, title)
    raise SignalError(f"{kind}: no such plot; available: parameters, fits, residuals, histories")


def estimates_table(parameters: Iterable[Estimate], derived: Sequence[Estimate] = ()) -> pages.Table:
    """Name, value with sigma and unit, sigma in per cent, and verdict of each estimate."""
    rows = [
        (
            e.name,
            with_sigma(e.value, e.sigma, e.unit),
            e.percent.removesuffix(" %").replace("> ", ">"),
            pages.Mark(e.verdict.replace("_", " ") + (DERIVED if e in derived else ""), e.verdict),
        )
        for e in (*parameters, *derived)
    ]
    return pages.Table(("Parameter", "Value>", "± %>", "Verdict"), rows)


def fits_table(fits: Iterable[Fit]) -> pages.Table:
    """Log, signal, and the fraction of its variance that the model explains."""
    rows = [
        (
            fit.log if fit.identified_on else f"{fit.log} (validation)",
            fit.signal,
            percent(max(fit.explained, 0.0), round_down=True),
        )
        for fit in fits
    ]
    return pages.Table(("Log", "Signal", "Explained"), rows)


def parameter_plot(estimates: Sequence[Estimate], title: str) -> Plot:
    """Every estimate with its sigma, and the initial value, as fractions of the estimate."""
    drawn = [e for e in estimates if e.value]
    rows = np.arange(len(drawn), 0, -1.0)
    value = np.array([e.value for e in drawn])
    sigma = np.array([e.sigma or 0.0 for e in drawn])
    initial = np.array([e.initial for e in drawn])
    texts = tuple(f"{e.name}: {with_sigma(e.value, e.sigma, e.unit)}, {e.verdict.replace('_', ' ')}" for e in drawn)
    items: list[Item] = [
        Points(initial / value, rows, name="initial value", colour=GREY, marker="diamond"),
        Points(value / value, rows, x_sigma=sigma / abs(value), name="estimate ± 1 sigma", colour=BLUE, texts=texts),
    ]
    ticks = dict(zip(rows.tolist(), [e.name for e in drawn], strict=True))
    names = Axis(ticks=ticks, range=(0.4, len(rows) + 0.6))
    height = max(1.0, len(rows) / 8)
    return Plot(
        title=title, panels=[Panel(items=items, x=Axis(label="fraction of the estimate"), y=names, height=height)]
    )


def history_plot(histories: Mapping[str, ParameterHistory], estimates: Sequence[Estimate], title: str) -> Plot:
    """Every estimate over the data, as of `history_panel`."""
    by_name = {e.name: e for e in estimates}
    panels = [
        history_panel(history, by_name[name])
        for history in histories.values()
        for name in history.names
        if name in by_name
    ]
    return Plot(title=title, panels=panels, shared_x=len(histories) == 1)


def fit_panel(fit: Fit, *predictions: Line, title: str = "") -> Panel:
    """A channel as measured and as predicted by the free-running model; by other models with lines of their own."""
    unit = shown(si_unit(fit.signal))
    measured = Line(fit.time, fit.measured * unit.factor, name="measured", colour=GREY, width=1.2, gaps=True)
    predictions = predictions or (prediction(fit, "predicted", colour=BLUE),)
    title, visible = title or _fit_title(fit), range_without_spikes(fit.measured * unit.factor)
    if visible is not None:
        title, visible = f"{title} (spikes outside the axis)", visible_range(visible, *(each.y for each in predictions))
    return Panel(items=[measured, *predictions], title=title, x=TIME, y=Axis(unit=unit.name, range=visible))


def prediction(fit: Fit, name: str, colour: str, dash: Dash = "solid") -> Line:
    """A channel as predicted."""
    factor = shown(si_unit(fit.signal)).factor
    return Line(fit.time, fit.predicted * factor, name=name, colour=colour, dash=dash, gaps=True)


def residual_panel(fit: Fit) -> Panel:
    """A channel as measured less as predicted."""
    unit = shown(si_unit(fit.signal))
    residual = (fit.measured - fit.predicted) * unit.factor
    items: list[Item] = [Guide(y=0.0), Line(fit.time, residual, colour=DARK, width=0.8, gaps=True)]
    return Panel(items=items, title=_fit_title(fit), x=TIME, y=Axis(label="residual", unit=unit.name))


def history_panel(history: ParameterHistory, estimate: Estimate) -> Panel:
    """The history of one estimate with a band of one sigma, the initial and the final value.

    The band ends with the sigma of the result. Vertical lines separate the passes.
    """
    unit, column, time = shown(estimate.unit), history.names.index(estimate.name), history.time
    values = history.values[:, column] * unit.factor
    sigma = reported_sigma(history.sigma[:, column], estimate.sigma) * unit.factor
    ends = np.array([time[0], time[-1]])
    initial, final = estimate.initial * unit.factor, estimate.value * unit.factor
    items: list[Item] = [
        Band(time, values - sigma, values + sigma, name=HISTORY_BAND, colour=BLUE, gaps=True),
        Line(ends, [initial, initial], name="initial", colour=GREY, width=1.5, dash="dot"),
        Line(ends, [final, final], name="final", colour=VERMILLION, width=1.5, dash="dash"),
        Line(time, values, name="estimate", colour=BLUE, gaps=True),
    ]
    passes = [float(time[start]) for start in history.starts[1:] if start < len(time)]
    items += [Guide(x=at, colour="#bbbbbb", width=1, dash="solid") for at in passes]
    visible = visible_range([initial, final, values[-1] - sigma[-1], values[-1] + sigma[-1]], trimmed(values, 0.002))
    y = Axis(unit=unit.name, range=visible)
    return Panel(items=items, title=estimate.name, x=Axis(label="driving time", unit="s"), y=y)


def reported_sigma(sigma: Array, final: float | None) -> Array:
    """A history of sigmas (N,) that ends with the sigma `final` of the result, in the same unit.

    What the result adds to the variance, such as model error, grows with the information of the logs: none where sigma
    is largest, all of it where sigma is that of the end.
    """
    first, last = sigma.max() ** 2, sigma[-1] ** 2
    if final is None or not first > last:
        return sigma if final is None else np.full_like(sigma, final)
    return np.asarray(np.sqrt(np.interp(sigma**2, [last, first], [final**2, max(first, final**2)])))


def chosen_fits(fits: Sequence[Fit], log: str | None) -> Sequence[Fit]:
    """The fits of one log, of the first by default; a SignalError for an unknown log, or without time series."""
    chosen = [fit for fit in fits if fit.log == (log or fits[0].log)]
    if not chosen:
        raise SignalError(f"{log}: not a log of this identification; {suggestion(str(log), {f.log for f in fits})}")
    if not any(len(fit.time) for fit in chosen):
        raise SignalError(
            "fits: the file of this identification has no time series; identify again and save the result"
        )
    return chosen


def _fit_title(fit: Fit) -> str:
    return f"{fit.signal}, {fit.log}" + ("" if fit.identified_on else " (validation)")
