"""Plots of an identification: parameters, fits, residuals, histories of the estimates."""

from collections.abc import Mapping, Sequence

import numpy as np

from fifthwheel.errors import SignalError, suggestion
from fifthwheel.formatting import shown, with_sigma
from fifthwheel.identify.history import ParameterHistory
from fifthwheel.identify.result.parts import Estimate, Fit
from fifthwheel.plots import Axis, Band, Guide, Item, Line, Panel, Plot, Points
from fifthwheel.plots.palette import BLUE, DARK, GREY, VERMILLION
from fifthwheel.record.signal_names import si_unit

TIME = Axis(label="time", unit="s")


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


def fit_plot(fits: Sequence[Fit], title: str) -> Plot:
    """Each channel as measured and as predicted by the model without correction by measurements."""
    panels = []
    for fit in fits:
        unit = shown(si_unit(fit.signal))
        items: list[Item] = [
            Line(fit.time, fit.measured * unit.factor, name="measured", colour=GREY, width=1.2, gaps=True),
            Line(fit.time, fit.predicted * unit.factor, name="predicted", colour=BLUE, gaps=True),
        ]
        panels.append(Panel(items=items, title=_fit_title(fit), x=TIME, y=Axis(unit=unit.name)))
    return Plot(title=title, panels=panels)


def residual_plot(fits: Sequence[Fit], title: str) -> Plot:
    """Each channel as measured less as predicted."""
    panels = []
    for fit in fits:
        unit = shown(si_unit(fit.signal))
        residual = (fit.measured - fit.predicted) * unit.factor
        items: list[Item] = [Guide(y=0.0), Line(fit.time, residual, colour=DARK, width=0.8, gaps=True)]
        panels.append(Panel(items=items, title=_fit_title(fit), x=TIME, y=Axis(unit=unit.name)))
    return Plot(title=title, panels=panels)


def history_plot(histories: Mapping[str, ParameterHistory], estimates: Sequence[Estimate], title: str) -> Plot:
    """Every estimate over the data, with a band of one sigma of the filter, initial and final value."""
    by_name, panels = {e.name: e for e in estimates}, []
    for history in histories.values():
        for k, name in enumerate(history.names):
            if name not in by_name:
                continue
            estimate = by_name[name]
            unit = shown(estimate.unit)
            values, sigma = history.values[:, k] * unit.factor, history.sigma[:, k] * unit.factor
            items: list[Item] = [
                Band(history.time, values - sigma, values + sigma, name="± 1 sigma at that time", colour=BLUE),
                Line(history.time, values, name="estimate", colour=BLUE),
                Guide(y=estimate.initial * unit.factor, text="initial", dash="dot"),
                Guide(y=estimate.value * unit.factor, text="final", colour=VERMILLION),
            ]
            label = Axis(label="driving time", unit="s")
            panels.append(Panel(items=items, title=name, x=label, y=Axis(unit=unit.name)))
    return Plot(title=title, panels=panels, shared_x=len(histories) == 1)


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
