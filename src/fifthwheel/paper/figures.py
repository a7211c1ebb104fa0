"""The article's Figures 4 to 9 from our runs, as PNG and SVG.

Histories show the first pass through the log, which is all that the article's preset has. Arms that go on begin every
pass with the prior's covariance and swing anew; a narrow axis beside it shows where each pass ends. Diamonds are what
was found in the end. States show one lane change, with the errors below.
"""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fifthwheel.paper.experiments import LANDING_LEG, OPTICAL, Experiment
from fifthwheel.paper.published import DRIVE, FRONT, PAYLOAD_HEIGHT, RESULTS, TRAILER, YAW_INERTIA
from fifthwheel.paper.runs import Outcome
from fifthwheel.whole import whole

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]
DOTS = 200
"""Of the PNG, for each inch."""
TRUTH: dict[str, Any] = {"color": "0.15", "linewidth": 1.0}
BROAD: dict[str, Any] = {"color": "0.55", "linewidth": 2.4}
RANGE: dict[str, Any] = {"color": "0.45", "linewidth": 0.9, "linestyle": "-."}
PUBLISHED: dict[str, Any] = {"color": "0.15", "linewidth": 1.0, "linestyle": ":"}
MEASURED: dict[str, Any] = {
    "color": "0.72",
    "linestyle": "none",
    "marker": ".",
    "markersize": 2.5,
    "markeredgewidth": 0.0,
}
ARMS: dict[str, dict[str, Any]] = {
    "article": {"color": "#D55E00", "linestyle": (0, (4, 1.6)), "linewidth": 1.4},
    "default": {"color": "#0072B2", "linestyle": "-", "linewidth": 1.5},
    "": {"color": "#009E73", "linestyle": (0, (4, 1, 1, 1)), "linewidth": 2.4, "zorder": 1.9},
}
"""Okabe and Ito's colours; the line styles and the greys they print in differ too. The last is any other arm's."""
FIRST = {"simulation": (4, "simulated truck"), "test vehicle": (7, "truck close to the test vehicle")}
LEVELS = ("truth", "truth, effective at 0.1° and 1° of steer", "published")
NAMES = {"article": "article's preset", "default": "our default"}
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
class Panel:
    """One quantity of one experiment over time."""

    experiment: Experiment
    outcomes: Sequence[Outcome]
    quantity: str
    title: str
    factor: float = 1.0  # shown = SI times this

    @property
    def truth(self) -> float:
        return self.experiment.drive.vehicle.parameters()[self.quantity]

    @property
    def published(self) -> list[float]:
        return [p.value for p in RESULTS if (p.case, p.quantity) == (self.experiment.name, self.quantity)]


def draw(experiments: Mapping[str, Experiment], outcomes: Sequence[Outcome], folder: Path) -> list[Path]:
    """Write figure_4 to figure_9 as far as there are outcomes with traces of their experiments; the files, in order."""
    import matplotlib as mpl

    kept = [outcome for outcome in outcomes if outcome.traces and outcome.states]
    of = {name: [o for o in kept if o.experiment == name] for name in experiments}
    files: list[Path] = []
    with mpl.rc_context(STYLE):
        for name, (first, truck) in FIRST.items():
            if not of.get(name):
                continue
            figures = (
                _stage_1(experiments[name], of[name], f"Figure {first}. Cornering stiffness and yaw inertia, {truck}"),
                _heights(experiments, of, name, f"Figure {first + 1}. Payload height, {truck}"),
                _states(experiments[name], of[name], f"Figure {first + 2}. Trailer in one lane change, {truck}"),
            )
            for number, figure in enumerate(figures, first):
                files += _save(figure, folder / f"figure_{number}")
    return files


def _save(figure: "Figure", path: Path) -> Iterator[Path]:
    for form in ("png", "svg"):
        file = path.with_suffix(f".{form}")
        with whole(file) as part:
            figure.savefig(part, format=form, dpi=DOTS, metadata={"Date": None} if form == "svg" else None)
        yield file


@contextmanager
def _page(title: str, height: float) -> Iterator["Figure"]:
    """A figure with a title above and, when filled, one legend below."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.2, height), layout="constrained")
    figure.suptitle(title, x=0.01, ha="left")
    yield figure
    shown: dict[str, Any] = {}
    for axes in figure.axes:
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            shown.setdefault(label, handle)
    first = (name for name in (*LEVELS, "measured", *NAMES.values()) if name in shown)
    names = list(dict.fromkeys([*first, *shown]))
    columns = 4 if len(names) == 4 else 3
    figure.legend([shown[n] for n in names], names, loc="outside lower center", ncols=columns, markerscale=2.5)


def _stage_1(experiment: Experiment, outcomes: Sequence[Outcome], title: str) -> "Figure":
    told = (
        (TRAILER, "(a) tyres of the trailer, kN/rad", 1e-3),
        (YAW_INERTIA, "(b) trailer yaw inertia, t m²", 1e-3),
        (FRONT, "(c) tyres of the front axle, kN/rad", 1e-3),
        (DRIVE, "(d) tyres of the drive axle, kN/rad", 1e-3),
    )
    with _page(title, 5.6) as figure:
        grid = figure.add_gridspec(2, 4, width_ratios=(3, 1.2) * 2)
        for i, (quantity, text, factor) in enumerate(told):
            panel = Panel(experiment=experiment, outcomes=outcomes, quantity=quantity, title=text, factor=factor)
            _history(figure, [grid[i // 2, 2 * (i % 2)], grid[i // 2, 2 * (i % 2) + 1]], panel)
    return figure


def _heights(
    experiments: Mapping[str, Experiment], outcomes: Mapping[str, Sequence[Outcome]], name: str, title: str
) -> "Figure":
    """Beside the simulated truck the one with a point payload."""
    names = [name, *(["point payload"] if name == "simulation" and outcomes.get("point payload") else [])]
    texts = ["payload height, m"] if len(names) == 1 else ["(a) uniform payload, m", "(b) point payload, m"]
    with _page(title, 3.2) as figure:
        grid = figure.add_gridspec(1, 2 * len(names), width_ratios=(3, 1.2) * len(names))
        for i, (one, text) in enumerate(zip(names, texts, strict=True)):
            own = outcomes[one]
            panel = Panel(experiment=experiments[one], outcomes=own, quantity=PAYLOAD_HEIGHT, title=text)
            first = _history(figure, [grid[0, 2 * i], grid[0, 2 * i + 1]], panel)
            lines = [f"truth {panel.truth:.3f} m", *(f"published {value:.3f} m" for value in panel.published)]
            lines += [f"{NAMES.get(o.arm, o.arm)} {o.values[PAYLOAD_HEIGHT]:.3f} m" for o in own]
            first.text(0.97, 0.06, "\n".join(lines), transform=first.transAxes, ha="right", linespacing=1.4)
    return figure


def _history(figure: "Figure", places: Sequence[Any], panel: Panel) -> "Axes":
    """The first pass, and the ends of all passes beside it; where no arm goes on nothing is beside it."""
    once = float(panel.experiment.drive.time[-1])
    traces = {o.arm: o.traces[panel.quantity] for o in panel.outcomes if panel.quantity in o.traces}
    first, later = figure.add_subplot(places[0]), figure.add_subplot(places[1])
    later.sharey(first)
    first.set(title=panel.title, xlabel="time in the first pass, s", xlim=(0, once))
    later.tick_params(axis="y", labelleft=False, length=0)
    later.spines["left"].set_visible(False)
    most = 1
    for axes in (first, later):
        _levels(axes, panel)
    for outcome in panel.outcomes:
        style, label = ARMS.get(outcome.arm, ARMS[""]), NAMES.get(outcome.arm, outcome.arm)
        value = outcome.values[panel.quantity] * panel.factor
        if outcome.arm not in traces:  # held
            first.axhline(value, **style)
            continue
        time, values = traces[outcome.arm][0], traces[outcome.arm][1] * panel.factor
        first.plot(time[time <= once], values[time <= once], **style, label=label)
        passes = max(round(float(time[-1]) / once), 1)
        ends = np.searchsorted(time, once * np.arange(1, passes) + 1e-6) - 1
        later.plot(np.arange(1, passes + 1), [*values[ends], value], **style, marker=".", markersize=4)
        end = {"color": style["color"], "zorder": 3 + style.get("zorder", 2)}
        later.plot([passes], [value], **end, marker="D", markersize=4.5, clip_on=False)
        most = max(most, passes)
    later.set(xlabel="after pass", xlim=(0.5, most + 0.5), xticks=range(1, most + 1, 1 + (most - 1) // 5))
    return first


def _levels(axes: "Axes", panel: Panel) -> None:
    """What is true, and what is published."""
    if panel.quantity in panel.experiment.stiffness:
        low, high = sorted(value * panel.factor for value in panel.experiment.stiffness[panel.quantity])
        axes.axhspan(low, high, color="0.92", zorder=0.5)
        axes.axhline(low, **RANGE, label=LEVELS[1])
        axes.axhline(high, **RANGE)
    else:
        axes.axhline(panel.truth * panel.factor, **TRUTH, label="truth")
    for value in panel.published:
        axes.axhline(value * panel.factor, **PUBLISHED, label="published")


def _states(experiment: Experiment, outcomes: Sequence[Outcome], title: str) -> "Figure":
    real = experiment.name == "test vehicle"
    unit = experiment.drive.vehicle.units[-1].name
    sideslip = LANDING_LEG if real else f"sideslip.{unit}"
    told = (
        (f"roll.{unit}", "(a) roll angle, deg"),
        (f"roll_rate.{unit}", "(b) roll rate, deg/s"),
        (sideslip, "(c) sideslip at landing leg, deg" if real else "(c) sideslip, deg"),
        (f"yaw_rate.{unit}", "(d) yaw rate, deg/s"),
    )
    time, truth = experiment.drive.time, experiment.drive.truth
    start, end = one_manoeuvre(time, truth[f"yaw_rate.{unit}"])
    rows = (time >= start) & (time <= end)
    measured = _measured(experiment, outcomes[0].seed) if real else {}
    with _page(title, 6.4) as figure:
        axes = figure.subplots(4, 2, sharex=True, height_ratios=(3, 1, 3, 1))
        for i, (name, text) in enumerate(told):
            above, below = axes[2 * (i // 2) : 2 * (i // 2) + 2, i % 2]
            above.set(title=text, xlim=(start, end))
            below.set(ylabel="error", xlabel="time, s" if i > 1 else "")
            if name in measured:
                above.plot(time[rows], np.degrees(measured[name][rows]), **MEASURED, label="measured")
            above.plot(time[rows], np.degrees(truth[name][rows]), **BROAD, label="truth")
            below.axhline(0.0, **TRUTH)
            for outcome in (o for o in outcomes if o.arm in NAMES):
                style, values = ARMS[outcome.arm], np.degrees(outcome.states[name][rows])
                above.plot(time[rows], values, **style | {"linewidth": 1.1}, label=NAMES[outcome.arm])
                below.plot(time[rows], values - np.degrees(truth[name][rows]), **style | {"linewidth": 1.0})
        figure.align_ylabels()
    return figure


def one_manoeuvre(time: Array, signal: Array, *, before: float = 1.0, after: float = 2.0) -> tuple[float, float]:
    """From when to when the middle one of the manoeuvres in a signal lasts, s; all of it if nothing stands out."""
    moving = time[np.abs(signal) > 0.2 * np.max(np.abs(signal))] if np.any(signal) else time
    parts = np.split(moving, np.flatnonzero(np.diff(moving) > 2.0) + 1)
    middle = parts[len(parts) // 2]
    return max(float(middle[0]) - before, float(time[0])), min(float(middle[-1]) + after, float(time[-1]))


def _measured(experiment: Experiment, seed: int) -> dict[str, Array]:
    """What the gyros read, and what an optical sensor would have."""
    drive = experiment.drive
    noise = np.random.default_rng([seed, 9]).normal(0.0, OPTICAL, len(drive.time))
    signals = drive.record(experiment.sensors, seed=seed).signals
    return {**signals, LANDING_LEG: drive.truth[LANDING_LEG] + noise}
