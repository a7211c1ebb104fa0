"""The first page of the report of an identification: main numbers, truck, what was driven, and the estimates."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from fifthwheel.base import pages
from fifthwheel.base.formatting import enumerated, kmh, percent, seconds, shown_parts, with_sigma
from fifthwheel.base.pages.html import text
from fifthwheel.base.plots import Area, Axis, Item, Line, Panel, Plot, Points
from fifthwheel.base.plots.items import BLUE, DARK, GREY, ORANGE, SKY, VERMILLION, as_array, visible_range
from fifthwheel.data.record import Record
from fifthwheel.data.record.derived import lateral_acceleration
from fifthwheel.estimate.identify import Estimate, Identification, Verdict
from fifthwheel.estimate.identify.result.display import DERIVED
from fifthwheel.results.assess import Assessment
from fifthwheel.results.assess.measures import ROLLOVER
from fifthwheel.results.diagnose.summaries import RunSummary
from fifthwheel.results.diagnose.thresholds import WIDE_SIGMA
from fifthwheel.results.report.conclusion import WIDE_MARK, mark, spoken_verdict
from fifthwheel.truck import Vehicle
from fifthwheel.truck.drawing import origins
from fifthwheel.truck.quantities import FRICTION
from fifthwheel.truck.spoken_names import named_unit, spoken

TRUCK_WIDTH, TRUCK_MARGIN, MAX_SCALE = 480.0, 14.0, 40.0
"""Of the drawing and its edge, in units of the SVG; the largest number of units for a metre."""
LINE_HEIGHT, CHARACTER = 16.0, 7.3
"""Of a text, in units of the SVG."""
TYRES = ".cornering_stiffness"
SHOWN = {"yaw_inertia": "Yaw inertia", "cog_height": "CoG height", "height": "Payload height"}
"""Quantities beside a unit."""
ESTIMATES = (
    *("Parameter|name", "Value>|main", "± sigma>|main|± ", "Unit|w main", "Relative>", "Verdict|full"),
    "Prior, vehicle file, estimate|full",
)
PRIORS = ("Parameter|name", "Prior>", "Vehicle file>", "Settled after>")
WIDTH, HEIGHT, MARGIN = 260, 18, 6
"""Of the picture of an estimate, pixels."""
LEAST_RANGE = 0.3
"""Half of the smallest range of a picture, as a fraction of the estimate, so that an accurate estimate looks it."""
LOGS = (DARK, ORANGE, SKY, VERMILLION)
"""Colours of the runs of the first logs; others are not drawn."""
LEAST_SPEED_RANGE = 5.0
"""Half of the smallest range of speeds that is drawn, km/h."""


class _Words(NamedTuple):
    """Lines of text below each other, centred at x."""

    x: float
    lines: Sequence[tuple[str, str, str]]
    """Text, CSS class and hint."""


def truck_drawing(vehicle: Vehicle, estimates: Iterable[Estimate]) -> pages.Markup:
    """The truck to scale with the tyres' estimates below the axles, and those of the units above them."""
    panel, by_name = vehicle.plot().panels[0], {e.name: e for e in estimates}
    shapes = [item for item in panel.items if isinstance(item, Area | Line)]
    left, right = (float(limit([limit(as_array(s.x)) for s in shapes])) for limit in (np.min, np.max))
    top = max(float(np.max(as_array(s.y))) for s in shapes)
    scale = min((TRUCK_WIDTH - 2 * TRUCK_MARGIN) / (right - left), MAX_SCALE)
    edge = (TRUCK_WIDTH - scale * (right - left)) / 2

    def across(x: float) -> float:
        return edge + scale * (x - left)

    above, below = list[_Words](), list[_Words]()
    for unit, origin in zip(vehicle.units, origins(vehicle.couplings), strict=True):
        for group in unit.axle_groups:
            if e := by_name.get(unit.group_path(group) + TYRES):
                number, _, name = _number(e).rpartition(" ")
                tyres = spoken(e.name).partition(",")[0]
                below.append(_Words(across(origin + group.position), _lines(e, (tyres, number, name))))
        of_unit = [e for e in by_name.values() if e.path.unit == unit.name and e.path.quantity in SHOWN]
        if of_unit:
            lines = [(named_unit(unit.name).capitalize(), "head", unit.name)]
            for e in of_unit:
                lines += _lines(e, [f"{SHOWN[e.path.quantity]} {_number(e)}"])
            above.append(_Words(across(origin + unit.cog), lines))
    if road := by_name.get(FRICTION):
        below.append(_Words(TRUCK_WIDTH / 2, _lines(road, [f"Friction of the road {_number(road)}"])))
    over, under = list(_placed(above)), list(_placed(below))
    height = max((y + LINE_HEIGHT * len(w.lines) for w, y in over), default=0.0) + TRUCK_MARGIN
    ground = height + scale * top
    drawn = "".join(_shapes(panel, across, lambda y: ground - scale * y))
    drawn += "".join(_text(w, height - TRUCK_MARGIN - y - LINE_HEIGHT * (len(w.lines) - 1)) for w, y in over)
    drawn += "".join(_text(w, ground + y + 1.4 * LINE_HEIGHT) for w, y in under)
    total = ground + max((y + LINE_HEIGHT * len(w.lines) for w, y in under), default=0.0) + LINE_HEIGHT
    box = f'viewBox="0 0 {TRUCK_WIDTH:.0f} {total:.0f}" role="img" aria-label="{text(vehicle.name)}"'
    return pages.Markup(f'<svg class="truck" {box}>{drawn}</svg>')


def _number(e: Estimate) -> str:
    """Value and unit, with sigma if it is identified."""
    number, sigma, unit = shown_parts(e.value, e.sigma, e.unit)
    return " ".join(filter(None, (number, f"± {sigma}" if sigma and e.verdict is Verdict.CONVERGED else "", unit)))


def _lines(e: Estimate, lines: Sequence[str]) -> list[tuple[str, str, str]]:
    """The lines of an estimate; one that is not identified says so, and is grey."""
    if e.verdict is Verdict.CONVERGED:
        return [(line, "", e.name) for line in lines]
    return [(line, "off", e.name) for line in (*lines, f"({spoken_verdict(e.verdict)})")]


def _placed(words: Sequence[_Words]) -> Iterator[tuple[_Words, float]]:
    """Each text with its distance from the truck: the next one farther away where they would overlap."""
    placed: list[tuple[float, float, float, float]] = []
    for each in words:
        half = CHARACTER * max(len(line) for line, *_ in each.lines) / 2
        x, height = min(max(each.x, half), max(TRUCK_WIDTH - half, half)), LINE_HEIGHT * (len(each.lines) + 0.4)
        beside = [(near, far) for start, stop, near, far in placed if start < x + half and stop > x - half]
        places = sorted([0.0, *(far for _, far in beside)])
        y = next(y for y in places if not any(y < far and y + height > near for near, far in beside))
        placed.append((x - half, x + half, y, y + height))
        yield each._replace(x=x), y


def _text(words: _Words, y: float) -> str:
    return "".join(
        f'<text class="{style}" x="{words.x:.0f}" y="{y + k * LINE_HEIGHT:.0f}">'
        f"<title>{text(hint)}</title>{text(line)}</text>"
        for k, (line, style, hint) in enumerate(words.lines)
    )


def _shapes(panel: Panel, across: Callable[[float], float], up: Callable[[float], float]) -> Iterator[str]:
    for item in panel.items:
        if not isinstance(item, Area | Line | Points):
            continue
        colour = item.colour or DARK
        corners = [f"{across(x):.1f},{up(y):.1f}" for x, y in zip(as_array(item.x), as_array(item.y), strict=True)]
        if isinstance(item, Points):
            shape = "m-4,-4l8,8m0,-8l-8,8" if item.marker == "cross" else "m-3,-3h6v6h-6z"
            path, style = "".join(f"M{corner}{shape}" for corner in corners), 'fill="none" stroke-width="2"'
        elif isinstance(item, Area):
            path, style = f"M{'L'.join(corners)}Z", f'fill="{colour}" fill-opacity="{item.opacity}"'
        else:
            path, style = f"M{'L'.join(corners)}", f'fill="none" stroke-width="{item.width}"'
        yield f'<path d="{path}" stroke="{colour}" {style}/>'


def main_numbers(identification: Identification, performance: Assessment | None) -> pages.Markup:
    """CoG heights and rollover threshold, which most readers look for."""
    heights = [e for e in identification.derived if e.path.quantity == "cog_height"]
    numbers = [(spoken(e.name), with_sigma(e.value, e.sigma, e.unit) + _mark(e)) for e in heights]
    uncertain = [e for e in heights if e.verdict is not Verdict.STATED]
    mark = next(filter(None, map(_mark, uncertain)), "")  # it follows from the heights
    numbers += [(m.title.capitalize(), m.text() + mark) for m in performance or () if m.name == ROLLOVER]
    terms = "".join(f"<div><dt>{text(name)}</dt><dd>{text(number)}</dd></div>" for name, number in numbers)
    return pages.Markup(f'<dl class="numbers">{terms}</dl>' if terms else "")


def _mark(estimate: Estimate) -> str:
    """The verdict behind a number that is not certain."""
    return "" if estimate.verdict is Verdict.CONVERGED else f" ({spoken_verdict(estimate.verdict)})"


def truck_and_runs(
    identification: Identification, records: Sequence[Record], runs: Sequence[RunSummary]
) -> Iterator[pages.Block]:
    """The truck with its numbers, and how it was driven in each log."""
    drawing = truck_drawing(identification.vehicle, (*identification.parameters, *identification.derived))
    yield pages.Beside((drawing, *([pages.Plots([_driven(identification, records, runs)])] if records else [])))


def _driven(
    identification: Identification, records: Sequence[Record], runs: Sequence[RunSummary]
) -> pages.CaptionedPlot:
    """Speed and lateral acceleration of the first logs; of several, over the time since the start of each."""
    unit, one = identification.vehicle.units[0].name, len(records) == 1
    offsets = {e.log: e.value for e in identification.sensors if e.name == f"yaw_rate.{unit}.offset"}
    speeds, laterals, ends = list[Item](), list[Item](), list[float]()
    for record, colour in zip(records, LOGS, strict=False):
        time = record.time if one else record.time - record.time[0]
        speed = 3.6 * record.signals["speed"]
        lateral = lateral_acceleration(record, unit, offset=offsets.get(record.name, 0.0))
        name = "" if one else record.name
        speeds.append(Line(time, speed, name=name, colour=colour, width=1.4, gaps=True))
        laterals.append(Line(time, lateral, name=name, colour=colour, width=1.4, gaps=True))
        ends += [float(np.nanmin(speed, initial=np.inf)), float(np.nanmax(speed, initial=-np.inf))]
    middle = (min(ends) + max(ends)) / 2
    shown = (min(*ends, middle - LEAST_SPEED_RANGE), max(*ends, middle + LEAST_SPEED_RANGE))
    axis = Axis(label="time", unit="s") if one else Axis(label="time since the start of the log", unit="s")
    panels = [
        Panel(items=speeds, x=axis, y=Axis(label="speed", unit="km/h", range=visible_range(shown))),
        Panel(items=laterals, x=axis, y=Axis(label="lateral acc.", unit="m/s²")),
    ]
    largest = max((run.acceleration for run in runs if run.acceleration == run.acceleration), default=None)
    note = enumerated([kmh(run.speed) for run in runs])
    note += "" if largest is None else f"; up to {largest:.2f} m/s² lateral acceleration"
    left_out = len(records) - len(LOGS)
    note += f"; without {left_out} further logs" if left_out > 0 else ""
    group = f"log {records[0].name}" if one else "runs"
    caption = f"Driven: {records[0].name}" if one else "Driven"
    return pages.CaptionedPlot(caption, Plot(panels=panels), group, (records[0].name, "run", "driven"), note=note)


def estimates(identification: Identification) -> Iterator[pages.Block]:
    """The table of all estimates, and its notes folded below."""
    yield pages.Heading("Parameters", key="parameters")
    files, rows = identification.initial_vehicle.parameters() | identification.initial_vehicle.derived(), []
    everything = (*identification.parameters, *identification.stated_numbers, *identification.derived)
    for e in everything:
        value, sigma, unit = shown_parts(e.value, e.sigma, e.unit)
        rows.append(
            (
                pages.Hinted(spoken(e.name), e.name),
                value,
                sigma or "–",
                unit,
                e.percent,
                pages.Mark(
                    spoken_verdict(e.verdict) + (DERIVED if e in identification.derived else ""),
                    e.verdict,
                    mark(e),
                    "" if e.verdict is Verdict.CONVERGED else "off",
                ),
                _picture(e, files.get(e.name)),
            )
        )
    yield pages.Table(ESTIMATES, rows, label="Estimates")
    yield pages.Markup(
        f'<p class="hint key">{_symbol(_whisker(8, 2, 14, GREY))} prior ± sigma, '
        f"{_symbol(_diamond(8))} vehicle file, {_symbol(_dot(8) + _whisker(8, 1, 15, BLUE))} estimate ± sigma. "
        "Each row has its own scale.</p>"
    )
    last = "" if identification.method == "one-stage" else " in the last pass"
    explanation = (
        "Sigma is one standard deviation of the result, from the logs and the prior; the prior is what was assumed "
        "before the logs were used. A grey row is not determined by the logs: its value comes mostly from the prior or "
        f"the vehicle file. {WIDE_MARK} marks a sigma above {percent(WIDE_SIGMA)} of the value.",
        "CoG height and roll inertia of a unit are derived from the payload: the height of the CoG of the laden sprung "
        "mass above the ground, and the roll inertia of this mass about the roll axis.",
        f"“Settled after”: the driving time{last} after which the estimate stays within "
        f"{percent(identification.settings.tolerance)} of its later average. “–”: it did not settle.",
    )
    priors = [
        (
            pages.Code(e.name),
            with_sigma(e.initial, e.prior, e.unit),
            with_sigma(files[e.name], None, e.unit) if e.name in files else "–",
            seconds(e.settling_time),
        )
        for e in everything
    ]
    yield pages.Folded("Notes, priors and settling times", [pages.Items(explanation), pages.Table(PRIORS, priors)])


def _picture(e: Estimate, file: float | None) -> pages.Markup:
    spans = [(e.initial, e.prior or 0.0), (e.value, e.sigma or 0.0), *([(file, 0.0)] if file is not None else [])]
    spans.append((e.value, LEAST_RANGE * abs(e.value)))
    low, high = min(v - s for v, s in spans), max(v + s for v, s in spans)

    def x(value: float) -> float:
        return MARGIN + (WIDTH - 2 * MARGIN) * ((value - low) / (high - low) if high > low else 0.5)

    y, parts = HEIGHT / 2, ""
    if e.prior:
        parts += _whisker(y + 4, x(e.initial - e.prior), x(e.initial + e.prior), GREY)
    if file is not None:
        parts += _diamond(x(file), y + 4)
    colour = BLUE if e.verdict is Verdict.CONVERGED else GREY
    if e.sigma:
        parts += _whisker(y - 3, x(e.value - e.sigma), x(e.value + e.sigma), colour)
    parts += _dot(x(e.value), y - 3, colour)
    words = f"prior {with_sigma(e.initial, e.prior, e.unit)}"
    words += f", vehicle file {with_sigma(file, None, e.unit)}" if file is not None else ""
    words += f", estimate {with_sigma(e.value, e.sigma, e.unit)}"
    return pages.Markup(
        f'<svg class="whisker" viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="{text(words)}">'
        f"<title>{text(words)}</title>{parts}</svg>"
    )


def _symbol(parts: str) -> str:
    return f'<svg width="16" height="16" viewBox="0 0 16 16" aria-hidden="true">{parts}</svg>'


def _whisker(y: float, start: float, stop: float, colour: str) -> str:
    path = f"M{start:.1f},{y}H{stop:.1f}M{start:.1f},{y - 3}v6M{stop:.1f},{y - 3}v6"
    return f'<path d="{path}" stroke="{colour}" stroke-width="1.6" fill="none"/>'


def _diamond(x: float, y: float = 8) -> str:
    return f'<path d="M{x:.1f},{y - 4.5}l4.5,4.5l-4.5,4.5l-4.5,-4.5z" stroke="{DARK}" fill="none"/>'


def _dot(x: float, y: float = 8, colour: str = BLUE) -> str:
    return f'<path d="M{x - 4:.1f},{y}a4,4 0 1 0 8,0a4,4 0 1 0 -8,0z" fill="{colour}"/>'
