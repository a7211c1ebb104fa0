"""Figures 4 to 9 of the article with the results of this package.

A history shows the first pass through the log, which is the only one of the article's preset. Other arms start every
pass with the prior covariance; a panel beside the history shows the estimate at the end of each pass. The states are
shown in one lane change, with their errors below.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

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
from fifthwheel.base.pages import CaptionedPlot
from fifthwheel.base.plots import Axis, Guide, Item, Line, Panel, Plot, Points
from fifthwheel.base.plots.items import BLUE, DARK, GREEN, GREY, PURPLE, VERMILLION
from fifthwheel.base.types import Array

ARMS = {"article": VERMILLION, "default": BLUE, "one stage": PURPLE}
"""Colour of each arm; that of others is green."""
NAMES = {"article": "article's preset", "default": "two stages, default settings", "one stage": "one stage"}
FIRST_FIGURE = {"simulation": (4, "simulated truck"), "test vehicle": (7, "truck similar to the test vehicle")}
"""Number of the first figure of an experiment, and how the title names its truck."""
STAGE_1 = (
    (TRAILER, "cornering stiffness, trailer", "kN/rad"),
    (YAW_INERTIA, "trailer yaw inertia", "t m²"),
    (FRONT, "cornering stiffness, front axle", "kN/rad"),
    (DRIVE, "cornering stiffness, drive axle", "kN/rad"),
)


def captioned(experiments: Mapping[str, Experiment], outcomes: Sequence[Outcome]) -> list[CaptionedPlot]:
    """Figures 4 to 9 of the experiments that have outcomes with histories."""
    kept = [outcome for outcome in outcomes if outcome.histories and outcome.states]
    by_experiment = {name: [o for o in kept if o.experiment == name] for name in experiments}
    figures = []
    for name, (first, truck) in FIRST_FIGURE.items():
        if selected := by_experiment.get(name):
            experiment = experiments[name]
            parts = {
                "Cornering stiffness and yaw inertia": _stage_1(experiment, selected),
                "Payload height": _heights(experiments, by_experiment, name),
                "Trailer in one lane change": _states(experiment, selected),
            }
            for number, (title, panels) in enumerate(parts.items(), first):
                plot = Plot(title=f"{title}, {truck}", panels=panels, columns=2, shared_x=False)
                name_in_article = f"figure {number}"
                path = ("The article", "Figures", name_in_article)
                figures.append(CaptionedPlot(f"Figure {number}. {plot.title}", plot, group=name_in_article, path=path))
    return figures


def _stage_1(experiment: Experiment, outcomes: Sequence[Outcome]) -> list[Panel]:
    return [panel for row in STAGE_1 for panel in _history(experiment, outcomes, *row, factor=1e-3)]


def _heights(
    experiments: Mapping[str, Experiment], outcomes: Mapping[str, Sequence[Outcome]], name: str
) -> list[Panel]:
    """Payload height; below the simulated truck also the one with a point payload."""
    panels = _history(experiments[name], outcomes[name], PAYLOAD_HEIGHT, "payload height", "m")
    if name == "simulation" and (of_point := outcomes.get("point payload")):
        panels += _history(experiments["point payload"], of_point, PAYLOAD_HEIGHT, "height of a point payload", "m")
    return panels


def _history(
    experiment: Experiment, outcomes: Sequence[Outcome], quantity: str, title: str, unit: str, factor: float = 1.0
) -> list[Panel]:
    """The first pass, and the estimates at the end of every pass; shown values are `factor` times those in SI."""
    duration = float(experiment.run.time[-1])
    levels = _levels(experiment, quantity, factor)
    first, passes = list[Item](levels), list[Item](replace(level, text="") for level in levels)
    for outcome in outcomes:
        colour, name = ARMS.get(outcome.arm, GREEN), NAMES.get(outcome.arm, outcome.arm)
        value = outcome.values[quantity] * factor
        if quantity not in outcome.histories:  # a fixed parameter
            first.append(Guide(y=value, colour=colour))
            continue
        time, values = outcome.histories[quantity][0], outcome.histories[quantity][1] * factor
        in_first = time <= duration
        first.append(Line(time[in_first], values[in_first], name=name, colour=colour))
        count = max(round(float(time[-1]) / duration), 1)
        ends = np.searchsorted(time, duration * np.arange(1, count) + 1e-6) - 1
        passes.append(Line(np.arange(1, count + 1), [*values[ends], value], colour=colour))
        passes.append(
            Points(np.arange(1, count + 1), [*values[ends], value], name=name, colour=colour, marker="diamond")
        )
    return [
        Panel(items=first, title=title, x=Axis(label="time in the first pass", unit="s"), y=Axis(unit=unit)),
        Panel(items=passes, title="after each pass", x=Axis(label="pass"), y=Axis(unit=unit)),
    ]


def _levels(experiment: Experiment, quantity: str, factor: float) -> list[Guide]:
    """The true value, or the range of effective stiffness, and the published values."""
    items = []
    if quantity in experiment.stiffness:
        low, high = sorted(value * factor for value in experiment.stiffness[quantity])
        items += [
            Guide(y=low, colour=GREY, dash="dot"),
            Guide(y=high, text="effective stiffness", colour=GREY, dash="dot"),
        ]
    else:
        true = experiment.run.vehicle.parameters()[quantity] * factor
        items.append(Guide(y=true, text="true value", colour=DARK, dash="solid"))
    numbers = RESULTS if experiment.published else ()
    published = [p.value for p in numbers if (p.case, p.quantity) == (experiment.case, quantity)]
    return items + [Guide(y=value * factor, text="published", colour=DARK) for value in published]


def _states(experiment: Experiment, outcomes: Sequence[Outcome]) -> list[Panel]:
    """States of the trailer in one lane change; measured values only where the article has them, in section 4."""
    has_measurements = experiment.case == "test vehicle"
    unit = experiment.run.vehicle.units[-1].name
    sideslip = LANDING_LEG if has_measurements else f"sideslip.{unit}"
    names = {
        f"roll.{unit}": ("roll angle", "deg"),
        f"roll_rate.{unit}": ("roll rate", "deg/s"),
        sideslip: (f"sideslip{' at landing leg' if has_measurements else ''}", "deg"),
        f"yaw_rate.{unit}": ("yaw rate", "deg/s"),
    }
    time, truth = experiment.run.time, experiment.run.truth
    start, end = middle_manoeuvre(time, truth[f"yaw_rate.{unit}"])
    rows = (time >= start) & (time <= end)
    measured = _measured(experiment, outcomes[0].seed) if has_measurements else {}
    above, below = [], []
    for name, (title, shown) in names.items():
        true = np.degrees(truth[name][rows])
        states: list[Item] = [Line(time[rows], true, name="true value", colour=GREY, width=3.0)]
        if name in measured:
            states.insert(0, Points(time[rows], np.degrees(measured[name][rows]), name="measured", colour=GREY, size=2))
        errors: list[Item] = [Guide(y=0.0, colour=DARK, dash="solid")]
        for outcome in (o for o in outcomes if o.arm in NAMES):
            values = np.degrees(outcome.states[name][rows])
            states.append(Line(time[rows], values, name=NAMES[outcome.arm], colour=ARMS[outcome.arm]))
            errors.append(Line(time[rows], values - true, colour=ARMS[outcome.arm]))
        x = Axis(label="time", unit="s")
        above.append(Panel(items=states, title=title, x=x, y=Axis(unit=shown)))
        below.append(Panel(items=errors, x=x, y=Axis(label="error", unit=shown), height=0.4))
    return [*above[:2], *below[:2], *above[2:], *below[2:]]


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
