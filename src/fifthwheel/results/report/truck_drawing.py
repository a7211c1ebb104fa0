"""The drawing of a truck from the side, with the estimates where they belong, as SVG."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from fifthwheel.base import pages
from fifthwheel.base.formatting import shown_parts
from fifthwheel.base.pages.html import text
from fifthwheel.base.plots import Area, Line, Panel, Points
from fifthwheel.base.plots.items import DARK, as_array
from fifthwheel.estimate.identify import Estimate, Verdict
from fifthwheel.results.report.words import spoken_verdict
from fifthwheel.truck import Vehicle
from fifthwheel.truck.drawing import origins
from fifthwheel.truck.quantities import FRICTION
from fifthwheel.truck.spoken_names import named_unit, spoken

WIDTH, MARGIN, MAX_SCALE = 480.0, 14.0, 40.0
"""Of the drawing and its edge, in units of the SVG; the largest number of units for a metre."""
LINE_HEIGHT, CHARACTER = 16.0, 7.3
"""Of a text, in units of the SVG."""
TYRES = ".cornering_stiffness"
SHOWN = {"yaw_inertia": "Yaw inertia", "cog_height": "CoG height", "height": "Payload height"}
"""Quantities beside a unit."""


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
    scale = min((WIDTH - 2 * MARGIN) / (right - left), MAX_SCALE)
    edge = (WIDTH - scale * (right - left)) / 2

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
        below.append(_Words(WIDTH / 2, _lines(road, [f"Friction of the road {_number(road)}"])))
    over, under = list(_placed(above)), list(_placed(below))
    height = max((y + LINE_HEIGHT * len(w.lines) for w, y in over), default=0.0) + MARGIN
    ground = height + scale * top
    drawn = "".join(_shapes(panel, across, lambda y: ground - scale * y))
    drawn += "".join(_text(w, height - MARGIN - y - LINE_HEIGHT * (len(w.lines) - 1)) for w, y in over)
    drawn += "".join(_text(w, ground + y + 1.4 * LINE_HEIGHT) for w, y in under)
    total = ground + max((y + LINE_HEIGHT * len(w.lines) for w, y in under), default=0.0) + LINE_HEIGHT
    box = f'viewBox="0 0 {WIDTH:.0f} {total:.0f}" role="img" aria-label="{text(vehicle.name)}"'
    return pages.Markup(f'<svg class="truck" {box}>{drawn}</svg>')


def _quantity(e: Estimate) -> str:
    return e.name.rpartition(".")[2]


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
        x, height = min(max(each.x, half), max(WIDTH - half, half)), LINE_HEIGHT * (len(each.lines) + 0.4)
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
