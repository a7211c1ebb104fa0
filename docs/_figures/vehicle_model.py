"""Draws docs/_static/vehicle_model.svg: axes, signs and dimensions of a tractor-semitrailer."""

from svg import arc, box, circle, label, path, picture

SCALE = 46.0
"""Pixels for 1 m."""
FRONT = 790.0
"""x of the front axle in the picture; the truck drives to the right."""
TOP, GROUND = 130.0, 420.0
"""y of the centre line in the top view, and of the road in the side view."""


def at(metres: float) -> float:
    """x in the picture of a place behind the front axle."""
    return FRONT + SCALE * metres


DRIVE, FIFTH_WHEEL, TRAILER_AXLE = at(-3.7), at(-3.1), at(-3.1 - 8.0)
TRACTOR_COG, TRAILER_COG = at(-1.03), at(-3.1 - 5.49)


def dimension(x1: float, x2: float, y: float, text: str) -> list[str]:
    ends = [path([(x, y - 6), (x, y + 6)], "thin") for x in (x1, x2)]
    return [*ends, path([(x1 + 1, y), (x2 - 1, y)], "dimension"), label((x1 + x2) / 2, y - 5, text, "small middle")]


def from_above() -> list[str]:
    shapes = [label(20, 28, "From above")]
    shapes += [box(at(-3.1 - 10.5), TOP - 40, SCALE * 11.5, 80), box(at(-4.3), TOP - 24, SCALE * 5.6, 48)]
    for x, turn in ((FRONT, -14), (DRIVE, 0), (TRAILER_AXLE, 0), (at(-9.8), 0), (at(-12.4), 0)):
        for side in (-1, 1):
            y = TOP + side * 46
            shapes.append(box(x - 18, y - 5, 36, 10, "dark", f"rotate({turn} {x:g} {y:g})"))
    shapes += [
        path([(FRONT, TOP - 46), (FRONT + 75, TOP - 46)], "thin"),
        path([(FRONT, TOP - 46), (FRONT + 70, TOP - 64)], "thin"),
    ]
    shapes += [label(FRONT + 78, TOP - 50, "δ steer")]
    for x, name in ((TRACTOR_COG, "tractor"), (TRAILER_COG, "semitrailer")):
        shapes += [
            circle(x, TOP, 4, "dark"),
            path([(x, TOP), (x + 70, TOP)], "axis"),
            path([(x, TOP), (x, TOP - 75)], "axis"),
        ]
        shapes += [label(x + 60, TOP + 18, "x, u", "axis-text"), label(x + 6, TOP - 64, "y, v", "axis-text")]
        shapes += [arc(x + 26, TOP - 4, 26, x + 4, TOP - 26, sweep=0), label(x + 24, TOP - 20, "r", "axis-text")]
        shapes.append(label(x - 30, TOP + 34, name, "small middle"))
    shapes += [circle(FIFTH_WHEEL, TOP, 7), label(FIFTH_WHEEL - 48, TOP + 60, "fifth wheel", "small middle")]
    shapes += [path([(FIFTH_WHEEL, TOP + 8), (FIFTH_WHEEL, TOP + 54)], "thin")]
    y = TOP + 110
    shapes += dimension(TRACTOR_COG, FRONT, y, "−cog") + dimension(DRIVE, FRONT, y - 28, "−position of drive")
    shapes += dimension(TRAILER_COG, FIFTH_WHEEL, y, "−cog") + dimension(
        TRAILER_AXLE, FIFTH_WHEEL, y + 28, "−position of the axle group"
    )
    return shapes


def from_the_side() -> list[str]:
    y0 = GROUND
    shapes = [label(20, 312, "From the side"), path([(30, y0), (930, y0)], "line")]
    shapes += [box(at(-3.1 - 10.5), y0 - 55, SCALE * 11.5, 12), box(at(-3.1 - 10.3), y0 - 110, SCALE * 11, 55, "load")]
    shapes += [box(at(-4.3), y0 - 42, SCALE * 5.6, 12), box(at(-1.0), y0 - 125, SCALE * 2.3, 83)]
    for x in (FRONT, DRIVE, TRAILER_AXLE, at(-9.8), at(-12.4)):
        shapes += [circle(x, y0 - 23, 23, "dark"), circle(x, y0 - 23, 9, "box")]
    roll_axis, cog = y0 - 37, y0 - 74
    shapes += [path([(60, roll_axis), (900, roll_axis)], "thin"), label(68, roll_axis - 4, "roll axis", "small")]
    shapes += [circle(TRAILER_COG, cog, 4, "dark"), label(TRAILER_COG - 80, cog - 4, "CoG of body", "small")]
    shapes += [
        path([(TRAILER_COG, cog), (TRAILER_COG, cog - 60)], "axis"),
        label(TRAILER_COG + 6, cog - 50, "z", "axis-text"),
    ]
    x = TRAILER_COG + 40
    shapes += [path([(x, y0 - 1), (x, cog + 1)], "dimension"), label(x + 6, y0 - 16, "cog_height", "small")]
    shapes.append(path([(TRAILER_COG, cog), (x + 8, cog)], "thin"))
    shapes += [path([(40, y0 - 1), (40, roll_axis + 1)], "dimension"), label(20, y0 + 18, "roll_axis_height", "small")]
    x = at(-3.1 - 1.0)
    shapes += [path([(x, y0 - 54), (x, y0 - 109)], "dimension"), label(x - 98, y0 - 90, "payload.height", "small")]
    shapes += [
        path([(x + 14, y0 - 1), (x + 14, y0 - 54)], "dimension"),
        label(x - 40, y0 + 18, "payload.floor_height", "small"),
    ]
    return shapes


def from_behind() -> list[str]:
    x, y0 = 480.0, 640.0
    turn = f"rotate(8 {x:g} {y0 - 40:g})"
    shapes = [label(20, 485, "From behind, in a left turn"), path([(330, y0), (630, y0)], "line")]
    shapes += [
        box(x - 62, y0 - 40, 24, 40, "dark"),
        box(x + 38, y0 - 40, 24, 40, "dark"),
        path([(x - 50, y0 - 20), (x + 50, y0 - 20)]),
    ]
    shapes += [box(x - 58, y0 - 145, 116, 100, "load", turn), path([(x, y0 - 40), (x, y0 - 160)], "thin")]
    shapes += [
        path([(x, y0 - 40), (x + 17, y0 - 160)], "thin"),
        circle(x, y0 - 40, 4, "dark"),
        label(x + 64, y0 - 36, "roll axis", "small"),
    ]
    shapes += [arc(x, y0 - 150, 110, x + 15, y0 - 149, sweep=1), label(x + 20, y0 - 154, "roll φ > 0", "axis-text")]
    shapes += [
        path([(x - 75, y0 - 90), (x - 150, y0 - 90)], "axis"),
        label(x - 205, y0 - 96, "y, acceleration", "axis-text"),
    ]
    return shapes


def draw() -> str:
    title = "Axes, signs and dimensions of a tractor-semitrailer, seen from above, from the side and from behind"
    return picture(960, 660, title, [*from_above(), *from_the_side(), *from_behind()])
