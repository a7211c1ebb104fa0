"""Pictures of a run: the truck from above and from behind, as a strip of instants or as an animation.

    python examples/film.py strip.png        # or strip.svg, film.gif; needs fifthwheel[plant,figures]

They show off-tracking of the trailer and the roll of its body. Points of the road are complex, x + iy; points of a
picture are right + i up.
"""

import io
import math
import sys
import textwrap
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fifthwheel.base.atomic import atomic_write
from fifthwheel.base.errors import SignalError
from fifthwheel.base.lazy import require
from fifthwheel.base.types import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from fifthwheel.model.plant import PlantRun
    from fifthwheel.truck import Unit, Vehicle
Points = NDArray[np.complex128]

SUFFIXES = (".png", ".svg", ".gif")
UNIT_QUANTITIES = ("position_x", "position_y", "yaw", "roll", "lateral_acceleration")
"""Quantities of every unit that a picture needs."""
AXLE_QUANTITIES = ("vertical_force", "load_transfer")
"""Quantities of the last axle group that a picture needs."""

STRIP_INSTANTS, STRIP_DURATION = 6, 4.0  # s
FILM_DURATION, FILM_RATE = 6.0, 20  # s, frames per second
EXAGGERATION = 5.0
"""Factor on roll angle and tyre deflection in the view from behind; the view from above is to scale."""
PICTURE_HEIGHT = 5.4  # in, of the view from above

LANE_WIDTH, DASH_LENGTH, DASH_PERIOD = 3.5, 4.0, 12.0  # m
BODY_WIDTH, FRAME_WIDTH, FLOOR_HEIGHT, TOP_HEIGHT, CAB_HEIGHT = 2.5, 0.85, 1.1, 4.0, 3.6  # m
FRONT_OVERHANG, CAB_LENGTH, REAR_OVERHANG = 1.4, 2.25, 2.0  # m
BODY_AHEAD_OF_KINGPIN, CLEARANCE_BEHIND_CAB = 1.2, 1.9  # m

LIGHT, FRAME, MIDDLE, DARK, FIRST, LAST = "#e4e4e4", "#c4c4c4", "#9a9a9a", "#222222", "#0072B2", "#D55E00"


def film(run: "PlantRun", path: Path) -> Path:
    """Draw the moving truck from the true signals of a run; returns the path.

    A strip of six instants within 4 s (.png, .svg) or an animation of 6 s in real time (.gif), around the largest
    lateral acceleration of the last unit. A SignalError for another suffix, or a missing true signal.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in SUFFIXES:
        raise SignalError(f"{path}: expected the suffix {', '.join(SUFFIXES)}, got {suffix or 'none'}; rename the file")
    _check_signals(run)
    matplotlib, image = require("matplotlib", "figures"), require("PIL.Image", "figures")
    new_figure = require("matplotlib.figure", "figures").Figure
    animated = suffix == ".gif"
    first, last = _window(run, FILM_DURATION if animated else STRIP_DURATION)
    count = max(round((last - first) * FILM_RATE) + 1, 2) if animated else STRIP_INSTANTS
    scene = _Scene(run, np.linspace(first, last, count))
    with matplotlib.rc_context({"font.size": 8, "svg.hashsalt": "fifthwheel"}), atomic_write(path) as temporary:
        if animated:
            frames = []
            for k in range(count):
                figure = scene.draw(new_figure(), range(k, k + 1), side_by_side=True)
                figure.savefig(buffer := io.BytesIO(), format="png", dpi=100)
                frames.append(image.open(buffer).convert("RGB").quantize(64, image.Quantize.FASTOCTREE))
            frames[0].save(
                temporary, "GIF", save_all=True, append_images=frames[1:], duration=1000 // FILM_RATE, loop=0
            )
        else:
            figure = scene.draw(new_figure(), range(count))
            figure.savefig(temporary, format=suffix[1:], dpi=150, metadata={"Date": None})
    return Path(path)


def _check_signals(run: "PlantRun") -> None:
    units, group = run.vehicle.units, run.vehicle.units[-1].axle_groups[-1]
    needed = ["speed", *(f"{quantity}.{unit.name}" for unit in units for quantity in UNIT_QUANTITIES)]
    needed += [f"{quantity}.{units[-1].name}.{axle.name}" for axle in group.on_road for quantity in AXLE_QUANTITIES]
    if missing := [name for name in needed if name not in run.truth]:
        raise SignalError(f"{missing[0]}: missing in the true signals of {run.name}; use a run of Plant.drive")


def _window(run: "PlantRun", duration: float) -> tuple[float, float]:
    """First and last instant, s, around the largest lateral acceleration of the last unit."""
    time, end = run.time, float(run.time[-1])
    power = run.truth[f"lateral_acceleration.{run.vehicle.units[-1].name}"] ** 2 + 1e-9
    power = power * (np.abs(time - time[power.argmax()]) < duration / 2)
    start = max(min(float((power * time).sum() / power.sum()) - duration / 2, end - duration), 0.0)
    return start, min(start + duration, end)


class _Block(NamedTuple):
    """A rectangle of a unit as seen from above."""

    shade: str
    rear: float  # x on the unit, m
    front: float
    width: float


def _blocks(vehicle: "Vehicle", i: int) -> list[_Block]:
    """The frame of a unit, then its cab or body; sizes follow from its axles and couplings with usual overhangs."""
    couplings = zip(vehicle.units[:-1], vehicle.couplings, strict=True)
    has_drawbar = [coupling.leading_position < unit.axles[-1].position - 0.5 for unit, coupling in couplings]
    axles, is_last = [axle.position for axle in vehicle.units[i].axles], i == len(vehicle.couplings)
    frame_rear = body_rear = min(axles) - (REAR_OVERHANG if is_last else 0.9)
    if not is_last:
        hitch = vehicle.couplings[i].leading_position
        frame_rear, body_rear = min(frame_rear, hitch), hitch + (0.6 if has_drawbar[i] else CLEARANCE_BEHIND_CAB)
    if i == 0:
        frame_front = body_front = max(axles) + FRONT_OVERHANG - CAB_LENGTH
        blocks = [_Block(MIDDLE, frame_front, frame_front + CAB_LENGTH, BODY_WIDTH)]
    else:
        pin, on_drawbar = vehicle.couplings[i - 1].trailing_position, has_drawbar[i - 1]
        frame_front = pin - 1.8 if on_drawbar else pin + 0.5
        body_front = pin - 1.8 if on_drawbar else pin + BODY_AHEAD_OF_KINGPIN
        blocks = [_Block(FRAME, max(axles), pin, 0.2)] if on_drawbar else []
    if body_front - body_rear > 2.0 and (i or is_last or has_drawbar[0]):  # dollies and tractors have no body
        blocks.append(_Block(LIGHT, body_rear, body_front - 0.1, BODY_WIDTH))
    frame_front = max(frame_front, max(axles) + 0.7) if i else frame_front
    return [_Block(FRAME, min(frame_rear, body_rear), frame_front, FRAME_WIDTH), *blocks]


def _points(truth: dict[str, Array], unit: "Unit", x: float, y: float = 0.0) -> Points:
    """Positions of a point of a unit on the road, (N,)."""
    cog = truth[f"position_x.{unit.name}"] + 1j * truth[f"position_y.{unit.name}"]
    points: Points = cog + np.exp(1j * truth[f"yaw.{unit.name}"]) * (x - unit.cog + 1j * y)
    return points


def _rectangle(low: float, high: float, width: float) -> Points:
    """Corners of a rectangle along the real axis."""
    return np.array([low, high, high, low]) + 0.5j * width * np.array([-1, -1, 1, 1])


def _set_up_axes(axes: "Axes", right: float, low: float, high: float, bar: float) -> None:
    """Axes to scale without ticks, with a scale bar of so many metres."""
    axes.set(xlim=(-right, right), ylim=(low, high), xticks=[], yticks=[], aspect="equal")
    axes.spines[:].set(color="#c8c8c8", linewidth=0.6)
    bar_left, bar_height = 0.1 * right - right, low + 0.07 * right
    axes.plot([bar_left, bar_left + bar], [bar_height, bar_height], color=DARK, lw=2, solid_capstyle="butt", zorder=9)
    axes.text(bar_left + bar + 0.08 * right, bar_height, f"{bar:g} m", size=7, va="center", zorder=9)


class _Line(NamedTuple):
    """A line on the road."""

    points: Points
    colour: str
    style: str
    order: int  # lines of a higher order cover the others


class _Scene:
    """A run at some instants (N,), s: true signals, the road, and the position and size of the view from above."""

    def __init__(self, run: "PlantRun", time: Array) -> None:
        units = run.vehicle.units
        truth = {name: np.interp(time, run.time, values) for name, values in run.truth.items()}
        front, rear = max(axle.position for axle in units[0].axles), min(axle.position for axle in units[-1].axles)
        paths = _points(run.truth, units[0], front), _points(run.truth, units[-1], rear)
        ends = _points(truth, units[0], front + FRONT_OVERHANG), _points(truth, units[-1], rear - REAR_OVERHANG)
        middle, length = (ends[0] + ends[1]) / 2, float(np.abs(ends[0] - ends[1]).max()) + 4.0
        forward, origin = np.exp(1j * run.truth[f"yaw.{units[0].name}"][0]), paths[0][0]
        if all(np.all((np.exp(1j * truth[f"yaw.{unit.name}"]) / forward).real > 0.92) for unit in units):
            # headings stay within 23 deg: a straight road in the initial direction
            local = (np.array([*ends, middle]) - origin) / forward
            lateral_range = float(local.imag.min()), float(local.imag.max())
            middle = origin + forward * (local[2].real + 0.5j * sum(lateral_range))
            first_mark = DASH_PERIOD * (local.real.min() // DASH_PERIOD - 2)
            centre = origin + forward * np.arange(first_mark, local.real.max() + length, 0.5)
            heading = np.full(len(time), np.angle(forward))
            width = lateral_range[1] - lateral_range[0] + BODY_WIDTH + 1.0
        else:  # a bend: the path of the first axle is the middle of its lane
            centre, lateral_range, width, heading = paths[0], (0.0, 0.0), 0.5 * length, np.angle(ends[0] - ends[1])
        lowest = math.floor(lateral_range[0] / LANE_WIDTH + 0.3)
        highest = math.ceil(lateral_range[1] / LANE_WIDTH - 0.3)
        self.lines = [_Line(paths[0], FIRST, "-", 6), _Line(paths[1], LAST, "--", 6)]
        leftward = 1j * np.exp(1j * np.angle(np.gradient(centre)))
        for k in range(lowest, highest + 2):
            is_gap = (np.arange(len(centre)) * 0.5 % DASH_PERIOD > DASH_LENGTH) & (lowest < k <= highest)
            marking = np.where(is_gap, np.nan, centre + leftward * LANE_WIDTH * (k - 0.5))
            self.lines.append(_Line(marking, MIDDLE, "-", 1))
        self.run, self.time, self.truth = run, time, truth
        self.heading = heading  # (N,) direction on the road that points up in the view from above, rad
        self.middle = middle  # (N,) of that view
        self.size = max(width, 0.3 * length), max(length, 2 * width)  # of that view, m

    def draw(self, figure: "Figure", instants: range, *, side_by_side: bool = False) -> "Figure":
        """Draw instants side by side; the view from behind is below that from above, or beside it. All sizes in in."""
        width, names = PICTURE_HEIGHT * self.size[0] / self.size[1], [unit.name for unit in self.run.vehicle.units]
        offset, square, bottom = (width + 0.1, 4.5, 0.5) if side_by_side else (0.0, width, width + 0.55)
        column = offset + square + 0.08
        height = bottom + PICTURE_HEIGHT + (0.05 if side_by_side else 0.27 + 0.17 * len(names))
        total_width = column * len(instants)
        figure.set_size_inches(total_width, height)
        for n, k in enumerate(instants):
            left = n * column + 0.04
            place = (left / total_width, bottom / height, width / total_width, PICTURE_HEIGHT / height)
            self.draw_from_above(figure.add_axes(place), k)
            left += offset
            place = (left / total_width, 0.5 / height, square / total_width, square / height)
            self.draw_from_behind(figure.add_axes(place), k)
            lines = [f"{self.time[k]:.2f} s   {3.6 * self.truth['speed'][k]:.0f} km/h"]
            lines += [f"{self.truth[f'lateral_acceleration.{name}'][k]:+z.1f} m/s² {name}" for name in names]
            figure.text(left / total_width, 1 - 0.06 / height, "\n".join(lines), va="top", linespacing=1.3)
        caption = (
            f"{self.run.vehicle.name}, {self.run.name}. Lateral accelerations: left positive. From above, to scale;"
            " solid: path of the first axle; dashed: path of the last axle. From behind, roll angles and tyre"
            f" deflections times {EXAGGERATION:g}; darker tyre: higher load; dots: roll axis and CoG of the body;"
            " arrow: lateral acceleration; dashed outlines: units in front."
        )
        text = textwrap.fill(caption, int(19.5 * total_width))
        figure.text(0.04 / total_width, 0.43 / height, text, va="top", size=7)
        return figure

    def draw_from_above(self, axes: "Axes", k: int) -> None:
        """Draw the truck and the road from above, with the direction of travel upwards."""
        rotation, properties = 1j * np.exp(-1j * self.heading[k]), self.run.properties
        _set_up_axes(axes, self.size[0] / 2, -self.size[1] / 2, self.size[1] / 2, 2.0)

        def in_view(points: Points) -> tuple[Array, Array]:
            rotated = (points - self.middle[k]) * rotation
            return rotated.real, rotated.imag

        for line in self.lines:
            axes.plot(*in_view(line.points), color=line.colour, ls=line.style, lw=1.0, zorder=line.order)
        for i, unit in enumerate(self.run.vehicle.units):
            forward = np.exp(1j * self.truth[f"yaw.{unit.name}"][k])
            for axle in unit.on_road:
                steer = np.exp(1j * self.truth.get(f"steer.{unit.name}.{axle.name}", 0 * self.time)[k])
                wheel = forward * steer * _rectangle(-properties.wheel_radius, properties.wheel_radius, 0.4)
                for y in (-properties.half_track, properties.half_track):
                    axes.fill(*in_view(_points(self.truth, unit, axle.position, y)[k] + wheel), fc=DARK, zorder=4)
            for block in _blocks(self.run.vehicle, i):
                outline = _points(self.truth, unit, 0.0)[k] + forward * _rectangle(block.rear, block.front, block.width)
                order = 3 if block.shade == FRAME else 5
                axes.fill(*in_view(outline), fc=block.shade, ec=DARK, lw=0.8, alpha=0.75, zorder=order)

    def draw_from_behind(self, axes: "Axes", k: int) -> None:
        """Draw the last unit from behind, with dashed outlines of the units in front of it."""
        vehicle, unit, truth = self.run.vehicle, self.run.vehicle.units[-1], self.truth
        _set_up_axes(axes, 2.65, -0.75, 4.55, 1.0)
        axes.plot([-2.65, 0, 0, 0, 2.65], [0, 0, TOP_HEIGHT + 0.2, 0, 0], color=DARK, lw=0.8, zorder=1)
        roll = math.degrees(truth[f"roll.{unit.name}"][k])
        axes.text(2.5, 4.4, f"roll {roll:+z.1f}°", size=7, ha="right", va="top")
        position, forward = _points(truth, unit, unit.cog)[k], np.exp(1j * truth[f"yaw.{unit.name}"][k])
        for i, other in enumerate(vehicle.units):
            payload, roll_axis = other.payload, 1j * other.roll_axis_height
            shades = [block.shade for block in _blocks(vehicle, i)]
            floor = payload.floor_height if payload else FLOOR_HEIGHT
            if other is unit:
                boxes = [(0.7, floor, FRAME_WIDTH, FRAME), (floor, TOP_HEIGHT, BODY_WIDTH, LIGHT)]
                boxes += [(floor, floor + payload.height, payload.width, MIDDLE)] if payload else []
                style, order = "-", 3
            else:
                cab_top = CAB_HEIGHT if MIDDLE in shades else FLOOR_HEIGHT
                boxes = [(0.5, TOP_HEIGHT if LIGHT in shades else cab_top, BODY_WIDTH, "none")]
                style, order = "--", 5
            lean = np.exp(-1j * EXAGGERATION * truth[f"roll.{other.name}"][k])
            axis = roll_axis - ((_points(truth, other, other.cog)[k] - position) / forward).imag
            for low, high, width, shade in boxes:
                outline = axis + (1j * _rectangle(low, high, width) - roll_axis) * lean
                axes.fill(outline.real, outline.imag, fc=shade, ec=DARK, lw=0.7, ls=style, zorder=order)
        cog = roll_axis + 1j * (vehicle.derived()[f"{unit.name}.cog_height"] - unit.roll_axis_height) * lean
        axes.plot([0, cog.real], [roll_axis.imag, cog.imag], "o", color=DARK, ms=3, zorder=7)
        arrow = -0.6 * truth[f"lateral_acceleration.{unit.name}"][k]
        axes.quiver(cog.real, cog.imag, arrow, 0, color=LAST, scale_units="xy", scale=1, width=0.012, zorder=8)
        self._draw_tyres(axes, k)

    def _draw_tyres(self, axes: "Axes", k: int) -> None:
        """Draw the tyres of the last axle group from behind, deflected by their loads."""
        unit, truth, properties = self.run.vehicle.units[-1], self.truth, self.run.properties
        group, half_track, radius = unit.axle_groups[-1], properties.half_track, properties.wheel_radius
        loads = np.array([truth[f"vertical_force.{unit.name}.{axle.name}"][k] for axle in group.on_road])
        transfers = [truth[f"load_transfer.{unit.name}.{axle.name}"][k] for axle in group.on_road]
        transferred, total = float(loads @ transfers), float(loads.sum())
        deflection = EXAGGERATION * transferred * half_track**2 / group.tyre_roll_stiffness  # right side, m
        ends = [radius + deflection, radius - deflection]
        axes.plot([-half_track, half_track], ends, color=DARK, lw=2.5, zorder=2)
        for side in (-1, 1):
            tyre = side * half_track + 1j * _rectangle(0.0, 2 * radius - side * deflection, 0.4)
            fraction = (1 + side * transferred / total) / 2  # of the load, on this side
            shade = str(1 - 0.9 * min(max(fraction, 0), 1))
            axes.fill(tyre.real, tyre.imag, fc=shade, ec=DARK, lw=0.9, zorder=6)
            axes.text(side * half_track, -0.1, f"{fraction * total / 1e3:.0f} kN", ha="center", va="top", size=7)


def main() -> None:
    """Draw a lane change at 88 km/h, to the file that is given."""
    from fifthwheel.model.manoeuvres import lane_changes
    from fifthwheel.model.plant import Plant
    from fifthwheel.truck import get

    print(film(Plant(get("cheng_cebon_2011")).drive(lane_changes(count=1)), Path(sys.argv[1])))


if __name__ == "__main__":
    main()
