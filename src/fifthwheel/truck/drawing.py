"""A vehicle drawn to scale, from the side and from above."""

from collections.abc import Mapping, Sequence

import numpy as np

from fifthwheel.base.plots import Area, Axis, Item, Label, Line, Panel, Plot, Points
from fifthwheel.base.plots.items import BLUE, DARK, GREEN, GREY, ORANGE, PURPLE, SKY, VERMILLION
from fifthwheel.truck.unit import Coupling, Unit

WHEEL_RADIUS, WHEEL_WIDTH, TRACK = 0.5, 0.3, 2.0
LIFT = 0.2  # of a raised axle
"""Symbols of the wheels, m."""
OVERHANG = 0.8
"""Of the drawn body beyond the outermost axle or coupling, m."""
FRAME, FLOOR = 0.9, 1.2
"""Height of the drawn frame, and of a floor that the file does not give, m."""
UNITS = (GREEN, PURPLE, SKY, VERMILLION, BLUE)
"""Colours of the units; that of the payload and that of the axles are others."""
_CIRCLE = np.linspace(0, 2 * np.pi, 33)


def origins(couplings: Sequence[Coupling]) -> list[float]:
    """x of the origin of each unit, m; 0 for the first."""
    places = [0.0]
    for coupling in couplings:
        places.append(places[-1] + coupling.leading_position - coupling.trailing_position)
    return places


def drawing(name: str, units: Sequence[Unit], couplings: Sequence[Coupling], derived: Mapping[str, float]) -> Plot:
    """The drawing; x is forward, 0 at the origin of the first unit. `derived` is `Vehicle.derived`."""
    places = origins(couplings)
    side: list[Item] = []
    top: list[Item] = []
    for k, (unit, origin) in enumerate(zip(units, places, strict=True)):
        in_front, behind = couplings[k - 1] if k else None, [c.leading_position for c in couplings[k : k + 1]]
        colour, axles = UNITS[k % len(UNITS)], [axle.position for axle in unit.axles]
        ends = [*axles, *behind, *([in_front.trailing_position] if in_front else [])]
        if in_front and in_front.kind == "drawbar_eye":  # a dolly: a drawbar in front of its frame
            eye, ends = origin + in_front.trailing_position, axles
            frame = [origin + max(axles) + OVERHANG] * 2
            side.append(Line([eye, frame[0]], [in_front.height, FRAME], colour=colour, width=3))
            top += [Line([eye, x], [0, y], colour=colour, width=2) for x, y in zip(frame, (-0.5, 0.5), strict=True)]
        rear, front = origin + min(ends) - OVERHANG, origin + max(ends) + OVERHANG
        cog = ([origin + unit.cog], [derived[f"{unit.name}.cog_height"]])
        side += [*_side(unit, origin, rear, front, colour), Label((rear + front) / 2, -0.35, unit.name)]
        side.append(Points(*cog, name="CoG, height of the laden body", colour=BLUE, marker="cross", size=9))
        top += _top(unit, origin, rear, front, colour)
    if couplings:
        joint_x = [origin + c.leading_position for origin, c in zip(places, couplings, strict=False)]
        for items, heights in ((side, [c.height for c in couplings]), (top, [0.0] * len(couplings))):
            items.append(Points(joint_x, heights, name="coupling", colour=DARK, marker="square", size=8))
    ends_of_ground = [x for item in side if isinstance(item, Area) for x in (np.min(item.x), np.max(item.x))]
    side.append(Line([min(ends_of_ground), max(ends_of_ground)], [0, 0], colour=GREY, width=1))
    x = Axis(label="x", unit="m")
    panels = [
        Panel(items=side, x=x, y=Axis(label="height", unit="m"), equal=True, height=1.3),
        Panel(items=top, x=x, y=Axis(label="y", unit="m"), equal=True),
    ]
    return Plot(title=name, panels=panels)


def _side(unit: Unit, origin: float, rear: float, front: float, colour: str) -> list[Item]:
    floor = unit.payload.floor_height if unit.payload else max(FLOOR, 2 * unit.sprung.cog_height - FRAME)
    items: list[Item] = [_box(rear, front, FRAME, floor, colour, name=unit.name)]
    if unit.payload:
        top = floor + unit.payload.height
        items.append(_box(rear, front, floor, top, ORANGE, name="payload"))
    for axle in unit.axles:
        x = origin + axle.position
        height = WHEEL_RADIUS + (LIFT if axle.lifted else 0.0)
        wheel = (x + WHEEL_RADIUS * np.cos(_CIRCLE), height + WHEEL_RADIUS * np.sin(_CIRCLE))
        items.append(Area(*wheel, colour=VERMILLION if axle.steerable else DARK, opacity=0.35))
    return items


def _top(unit: Unit, origin: float, rear: float, front: float, colour: str) -> list[Item]:
    width = unit.payload.width if unit.payload else TRACK + WHEEL_WIDTH
    items: list[Item] = [_box(rear, front, -width / 2, width / 2, colour, name=unit.name)]
    for axle in unit.axles:
        x = origin + axle.position
        wheel_colour = VERMILLION if axle.steerable else DARK
        items.append(Line([x, x], [-TRACK / 2, TRACK / 2], colour=wheel_colour, width=1))
        for y in (-TRACK / 2, TRACK / 2):
            ends = (x - WHEEL_RADIUS, x + WHEEL_RADIUS, y - WHEEL_WIDTH / 2, y + WHEEL_WIDTH / 2)
            items.append(_box(*ends, wheel_colour, opacity=0.6))
    items.append(Points([origin + unit.cog], [0.0], name="CoG of the unit", colour=BLUE, size=8))
    return items


def _box(
    rear: float, front: float, low: float, high: float, colour: str, *, name: str = "", opacity: float = 0.2
) -> Area:
    return Area([rear, front, front, rear], [low, low, high, high], colour=colour, name=name, opacity=opacity)
