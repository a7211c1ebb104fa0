"""Figures 4 to 9 of the article with the results of this package, as PNG and SVG.

A history shows the first pass through the log, which is the only one of the article's preset. Other arms start every
pass with the prior covariance; a narrow axis beside the history shows the estimate at the end of each pass. Diamonds
are final estimates. The states are shown in one lane change, with their errors below.
"""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fifthwheel.apps.cheng_cebon_2011.experiments import (
    DRIVE,
    FRONT,
    LANDING_LEG,
    OPTICAL_SIGMA,
    PAYLOAD_HEIGHT,
    RESULTS,
    TRAILER,
    YAW_INERTIA,
    Experiment,
)
from fifthwheel.apps.cheng_cebon_2011.outcomes import Outcome
from fifthwheel.base.atomic import atomic_write
from fifthwheel.base.types import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
DOTS_PER_INCH = 200
"""Of the PNG files."""
TRUTH: dict[str, Any] = {"color": "0.15", "linewidth": 1.0}
BROAD_TRUTH: dict[str, Any] = {"color": "0.55", "linewidth": 2.4}
RANGE: dict[str, Any] = {"color": "0.45", "linewidth": 0.9, "linestyle": "-."}
PUBLISHED: dict[str, Any] = {"color": "0.15", "linewidth": 1.0, "linestyle": ":"}
MEASURED: dict[str, Any] = {
    "color": "0.72",
    "linestyle": "none",
    "marker": ".",
    "markersize": 2.5,
    "markeredgewidth": 0,
}
ARMS: dict[str, dict[str, Any]] = {
    "article": {"color": "#D55E00", "linestyle": (0, (4, 1.6)), "linewidth": 1.4},
    "default": {"color": "#0072B2", "linestyle": "-", "linewidth": 1.5},
    "one stage": {"color": "#CC79A7", "linestyle": (0, (1, 1)), "linewidth": 1.5},
}
OTHER_ARM: dict[str, Any] = {"color": "#009E73", "linestyle": (0, (4, 1, 1, 1)), "linewidth": 2.4, "zorder": 1.9}
"""Colours of Okabe and Ito; line styles and grey values differ too, for print without colour."""
FIRST_FIGURE = {"simulation": (4, "simulated truck"), "test vehicle": (7, "truck similar to the test vehicle")}
"""Number of the first figure of an experiment, and how the title names its truck."""
LEVELS = ("true value", "range of effective stiffness", "published")
NAMES = {"article": "article's preset", "default": "two stages, default settings", "one stage": "one stage"}
STYLE: dict[Any, Any] = {
    "font.size": 8.5,
    "axes.titlesize": 8.5,
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "0.9",
    "legend.frameon": False,
    "svg.hashsalt": "fifthwheel",
}


@dataclass(frozen=True, kw_only=True)
class HistoryPanel:
    """One quantity of one experiment over time."""

    experiment: Experiment
    outcomes: Sequence[Outcome]
    quantity: str
    title: str
    factor: float = 1.0  # shown value divided by the SI value

    @property
    def truth(self) -> float:
        """True value, SI."""
        return self.experiment.run.vehicle.parameters()[self.quantity]

    @property
    def published(self) -> list[float]:
        """Published values, SI."""
        numbers = RESULTS if self.experiment.published else ()
        return [p.value for p in numbers if (p.case, p.quantity) == (self.experiment.case, self.quantity)]


def draw(experiments: Mapping[str, Experiment], outcomes: Sequence[Outcome], folder: Path) -> list[Path]:
    """Write figure_4 to figure_9 of the experiments that have outcomes with histories; returns the files in order."""
    import matplotlib as mpl

    kept = [outcome for outcome in outcomes if outcome.histories and outcome.states]
    by_experiment = {name: [o for o in kept if o.experiment == name] for name in experiments}
    files: list[Path] = []
    with mpl.rc_context(STYLE):
        for name, (first, truck) in FIRST_FIGURE.items():
            selected = by_experiment.get(name)
            if not selected:
                continue
            figures = (
                _stage_1(experiments[name], selected, f"Figure {first}. Cornering stiffness and yaw inertia, {truck}"),
                _heights(experiments, by_experiment, name, f"Figure {first + 1}. Payload height, {truck}"),
                _states(experiments[name], selected, f"Figure {first + 2}. Trailer in one lane change, {truck}"),
            )
            for number, figure in enumerate(figures, first):
                files += _save(figure, folder / f"figure_{number}")
    return files


def _save(figure: "Figure", path: Path) -> Iterator[Path]:
    for suffix, metadata in (("png", None), ("svg", {"Date": None})):
        file = path.with_suffix(f".{suffix}")
        with atomic_write(file) as temporary:
            figure.savefig(temporary, format=suffix, dpi=DOTS_PER_INCH, metadata=metadata)
        yield file


@contextmanager
def _page(title: str, height: float) -> Iterator["Figure"]:
    """A figure with a title above it and one legend of all its axes below it."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.2, height), layout="constrained")
    figure.suptitle(title, x=0.01, ha="left")
    yield figure
    handles: dict[str, Any] = {}
    for axes in figure.axes:
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            handles.setdefault(label, handle)
    first = (label for label in (*LEVELS, "measured", *NAMES.values()) if label in handles)
    labels = list(dict.fromkeys([*first, *handles]))
    columns = 4 if len(labels) == 4 else 3
    figure.legend([handles[k] for k in labels], labels, loc="outside lower center", ncols=columns, markerscale=2.5)


def _stage_1(experiment: Experiment, outcomes: Sequence[Outcome], title: str) -> "Figure":
    panels = (
        (TRAILER, "(a) cornering stiffness, trailer, kN/rad"),
        (YAW_INERTIA, "(b) trailer yaw inertia, t m²"),
        (FRONT, "(c) cornering stiffness, front axle, kN/rad"),
        (DRIVE, "(d) cornering stiffness, drive axle, kN/rad"),
    )
    with _page(title, 5.6) as figure:
        grid = figure.add_gridspec(2, 4, width_ratios=(3, 1.2) * 2)
        for i, (quantity, text) in enumerate(panels):
            panel = HistoryPanel(experiment=experiment, outcomes=outcomes, quantity=quantity, title=text, factor=1e-3)
            _history(figure, [grid[i // 2, 2 * (i % 2)], grid[i // 2, 2 * (i % 2) + 1]], panel)
    return figure


def _heights(
    experiments: Mapping[str, Experiment], outcomes: Mapping[str, Sequence[Outcome]], name: str, title: str
) -> "Figure":
    """Payload height; beside the simulated truck also the one with a point payload."""
    names = [name, *(["point payload"] if name == "simulation" and outcomes.get("point payload") else [])]
    texts = ["payload height, m"] if len(names) == 1 else ["(a) uniform payload, m", "(b) point payload, m"]
    with _page(title, 3.2) as figure:
        grid = figure.add_gridspec(1, 2 * len(names), width_ratios=(3, 1.2) * len(names))
        for i, (experiment, text) in enumerate(zip(names, texts, strict=True)):
            selected = outcomes[experiment]
            panel = HistoryPanel(
                experiment=experiments[experiment], outcomes=selected, quantity=PAYLOAD_HEIGHT, title=text
            )
            first = _history(figure, [grid[0, 2 * i], grid[0, 2 * i + 1]], panel)
            lines = [f"true value {panel.truth:.3f} m", *(f"published {value:.3f} m" for value in panel.published)]
            lines += [f"{NAMES.get(o.arm, o.arm)} {o.values[PAYLOAD_HEIGHT]:.3f} m" for o in selected]
            first.text(0.97, 0.06, "\n".join(lines), transform=first.transAxes, ha="right", linespacing=1.4)
    return figure


def _history(figure: "Figure", places: Sequence[Any], panel: HistoryPanel) -> "Axes":
    """The first pass, and beside it the estimates at the end of every pass; returns the axes of the first pass."""
    duration = float(panel.experiment.run.time[-1])
    first, passes = figure.add_subplot(places[0]), figure.add_subplot(places[1])
    passes.sharey(first)
    first.set(title=panel.title, xlabel="time in the first pass, s", xlim=(0, duration))
    passes.tick_params(axis="y", labelleft=False, length=0)
    passes.spines["left"].set_visible(False)
    max_count = 1
    for axes in (first, passes):
        _levels(axes, panel)
    for outcome in panel.outcomes:
        style, label = ARMS.get(outcome.arm, OTHER_ARM), NAMES.get(outcome.arm, outcome.arm)
        value = outcome.values[panel.quantity] * panel.factor
        if panel.quantity not in outcome.histories:  # a fixed parameter
            first.axhline(value, **style)
            continue
        time, values = outcome.histories[panel.quantity]
        values = values * panel.factor
        in_first = time <= duration
        first.plot(time[in_first], values[in_first], **style, label=label)
        count = max(round(float(time[-1]) / duration), 1)
        ends = np.searchsorted(time, duration * np.arange(1, count) + 1e-6) - 1
        passes.plot(np.arange(1, count + 1), [*values[ends], value], **style, marker=".", markersize=4)
        final = {"color": style["color"], "zorder": 3 + style.get("zorder", 2)}
        passes.plot([count], [value], **final, marker="D", markersize=4.5, clip_on=False)
        max_count = max(max_count, count)
    ticks = range(1, max_count + 1, 1 + (max_count - 1) // 5)
    passes.set(xlabel="after pass", xlim=(0.5, max_count + 0.5), xticks=ticks)
    return first


def _levels(axes: "Axes", panel: HistoryPanel) -> None:
    """Lines at the true and at the published values."""
    if panel.quantity in panel.experiment.stiffness:
        low, high = sorted(value * panel.factor for value in panel.experiment.stiffness[panel.quantity])
        axes.axhspan(low, high, color="0.92", zorder=0.5)
        axes.axhline(low, **RANGE, label=LEVELS[1])
        axes.axhline(high, **RANGE)
    else:
        axes.axhline(panel.truth * panel.factor, **TRUTH, label=LEVELS[0])
    for value in panel.published:
        axes.axhline(value * panel.factor, **PUBLISHED, label=LEVELS[2])


def _states(experiment: Experiment, outcomes: Sequence[Outcome], title: str) -> "Figure":
    """States of the trailer in one lane change; measured values only where the article has them, in section 4."""
    has_measurements = experiment.case == "test vehicle"
    unit = experiment.run.vehicle.units[-1].name
    sideslip = LANDING_LEG if has_measurements else f"sideslip.{unit}"
    panels = (
        (f"roll.{unit}", "(a) roll angle, deg"),
        (f"roll_rate.{unit}", "(b) roll rate, deg/s"),
        (sideslip, f"(c) sideslip{' at landing leg' if has_measurements else ''}, deg"),
        (f"yaw_rate.{unit}", "(d) yaw rate, deg/s"),
    )
    time, truth = experiment.run.time, experiment.run.truth
    start, end = middle_manoeuvre(time, truth[f"yaw_rate.{unit}"])
    rows = (time >= start) & (time <= end)
    measured = _measured(experiment, outcomes[0].seed) if has_measurements else {}
    with _page(title, 6.4) as figure:
        axes = figure.subplots(4, 2, sharex=True, height_ratios=(3, 1, 3, 1))
        for i, (name, text) in enumerate(panels):
            above, below = axes[2 * (i // 2) : 2 * (i // 2) + 2, i % 2]
            above.set(title=text, xlim=(start, end))
            below.set(ylabel="error", xlabel="time, s" if i > 1 else "")
            if name in measured:
                above.plot(time[rows], np.degrees(measured[name][rows]), **MEASURED, label="measured")
            above.plot(time[rows], np.degrees(truth[name][rows]), **BROAD_TRUTH, label=LEVELS[0])
            below.axhline(0.0, **TRUTH)
            for outcome in (o for o in outcomes if o.arm in NAMES):
                style, values = ARMS[outcome.arm], np.degrees(outcome.states[name][rows])
                above.plot(time[rows], values, **style | {"linewidth": 1.1}, label=NAMES[outcome.arm])
                below.plot(time[rows], values - np.degrees(truth[name][rows]), **style | {"linewidth": 1.0})
        figure.align_ylabels()
    return figure


def middle_manoeuvre(time: Array, signal: Array) -> tuple[float, float]:
    """1 s before and 2 s after the middle one of several manoeuvres, s; the whole signal (N,) if it is 0.

    A manoeuvre is a segment with more than 20 % of the largest magnitude of the signal, without a gap above 2 s.
    """
    active = time[np.abs(signal) > 0.2 * np.max(np.abs(signal))] if np.any(signal) else time
    manoeuvres = np.split(active, np.flatnonzero(np.diff(active) > 2.0) + 1)
    middle = manoeuvres[len(manoeuvres) // 2]
    return max(float(middle[0]) - 1.0, float(time[0])), min(float(middle[-1]) + 2.0, float(time[-1]))


def _measured(experiment: Experiment, seed: int) -> dict[str, Array]:
    """Measured signals of the gyros, and of an optical sideslip sensor."""
    run = experiment.run
    noise = np.random.default_rng([seed, 9]).normal(0.0, OPTICAL_SIGMA, len(run.time))
    signals = run.record(experiment.sensors, seed=seed).signals
    return {**signals, LANDING_LEG: run.truth[LANDING_LEG] + noise}
