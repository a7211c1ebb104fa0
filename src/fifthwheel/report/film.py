"""A drive to look at: the truck from above and from behind, as a strip of instants or as an animation.

It shows whether the trailer cuts in when slow and swings out when fast, and whether its body leans out of the bend.
Points of the road are complex, x + iy, those of a picture right + i up.
"""

import io
import math
import textwrap
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fifthwheel.errors import FifthwheelError, SignalError
from fifthwheel.whole import whole

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from fifthwheel.plant import Drive
    from fifthwheel.vehicle import Unit, Vehicle

Array = NDArray[np.float64]
Points = NDArray[np.complex128]

SUFFIXES, LOADS = (".png", ".svg", ".gif"), ("vertical_force", "load_transfer")
QUANTITIES = ("position_x", "position_y", "yaw", "roll", "lateral_acceleration")
INSTANTS, SPAN, FILM, RATE, FRAMES = 6, 4.0, 6.0, 20, 160  # of the strip; s of strip and film; frames a second, at most
TALL, LANE, DASH, EVERY = 5.4, 3.5, 4.0, 12.0  # in: height of the page; m: lane, its dashes, a dash with its gap
WIDTH, FLOOR, TOP = 2.5, 1.1, 4.0  # m: of a body
AHEAD, CAB, NOSE, TAIL, SWEEP = 1.4, 2.25, 1.2, 2.0, 1.9  # m: overhangs, length of a cab, free behind a fifth wheel
LIGHT, FRAME, MIDDLE, DARK, FIRST, LAST = "#e4e4e4", "#c4c4c4", "#9a9a9a", "#222222", "#0072B2", "#D55E00"


def film(
    drive: "Drive", path: Path, *, start: float | None = None, stop: float | None = None, exaggerate: float = 5.0
) -> Path:
    """Draw the truck as it moves, from the truth of its drive.

    Args:
        path: a strip of six instants (.png, .svg) or an animation in real time (.gif; beyond 8 s it runs faster).
        start, stop: of the window, s; without them 4 s, of an animation 6 s, around what is liveliest in the last unit.
        exaggerate: factor on roll and on the squash of tyres from behind; from above all is true to scale.

    Raises:
        SignalError: another suffix; a window outside the drive; truth that is missing.
        FifthwheelError: matplotlib is not installed.
    """
    kind = Path(path).suffix.lower()
    if kind not in SUFFIXES:
        raise SignalError(f"{path}: expected a name that ends in {', '.join(SUFFIXES)}, got {kind or 'no suffix'}")
    if not 0 < exaggerate <= 30:
        raise SignalError(f"exaggerate: expected above 0 and up to 30, got {exaggerate:g}; 1 draws angles as they are")
    units, group = drive.vehicle.units, drive.vehicle.units[-1].axle_groups[-1]
    needed = ["speed", *(f"{quantity}.{u.name}" for u in units for quantity in QUANTITIES)]
    needed += [f"{q}.{units[-1].name}.{axle.name}" for axle in group.axles for q in LOADS]
    if missing := [name for name in needed if name not in drive.truth]:
        raise SignalError(f"{missing[0]}: missing in the truth of {drive.name}; take a drive of Plant.drive")
    try:
        import matplotlib
        from matplotlib.figure import Figure
        from PIL import Image
    except ImportError:
        raise FifthwheelError("a film needs matplotlib: pip install '.[paper]' in the checkout") from None
    first, last = _window(drive, start, stop, FILM if kind == ".gif" else SPAN)
    count = min(max(round((last - first) * RATE) + 1, 2), FRAMES) if kind == ".gif" else INSTANTS
    scene = _Scene(drive, np.linspace(first, last, count), exaggerate)
    with matplotlib.rc_context({"font.size": 8, "svg.hashsalt": "fifthwheel"}), whole(path) as part:
        if kind == ".gif":
            pictures = []
            for k in range(count):
                scene.page(Figure(), range(k, k + 1), aside=True).savefig(drawn := io.BytesIO(), format="png", dpi=100)
                pictures.append(Image.open(drawn).convert("RGB").quantize(64, Image.Quantize.FASTOCTREE))
            pictures[0].save(part, "GIF", save_all=True, append_images=pictures[1:], duration=1000 // RATE, loop=0)
        else:
            scene.page(Figure(), range(count)).savefig(part, format=kind[1:], dpi=150, metadata={"Date": None})
    return Path(path)


def _window(drive: "Drive", start: float | None, stop: float | None, span: float) -> tuple[float, float]:
    """First and last instant, s; by default around the middle of what is lively beside the largest acceleration."""
    time, end = drive.time, float(drive.time[-1])
    if start is None and stop is None:
        power = drive.truth[f"lateral_acceleration.{drive.vehicle.units[-1].name}"] ** 2 + 1e-9
        power = power * (np.abs(time - time[power.argmax()]) < span / 2)
        start = max(min(float((power * time).sum() / power.sum()) - span / 2, end - span), 0.0)
    start = max((stop or 0.0) - span, 0.0) if start is None else start
    stop = min(start + span, end) if stop is None else stop
    if not 0 <= start < stop <= end:
        raise SignalError(f"start, stop: expected 0 <= start < stop <= {end:g} s, got {start:g} and {stop:g}")
    return start, stop


def _parts(vehicle: "Vehicle", i: int) -> list[tuple[str, float, float, float]]:
    """Shade, rear and front (x on the unit) and width, m, of a unit's parts: from its axles, with usual overhangs."""
    pairs = zip(vehicle.units[:-1], vehicle.couplings, strict=True)  # a drawbar's eye is behind all axles
    barred = [coupling.leading_position < unit.axles[-1].position - 0.5 for unit, coupling in pairs]
    axles, last = [axle.position for axle in vehicle.units[i].axles], i == len(vehicle.couplings)
    rear = body = min(axles) - (TAIL if last else 0.9)
    if not last:
        hitch = vehicle.couplings[i].leading_position
        rear, body = min(rear, hitch), hitch + (0.6 if barred[i] else SWEEP)
    if i == 0:
        front = nose = max(axles) + AHEAD - CAB
        found = [(MIDDLE, front, front + CAB, WIDTH)]
    else:
        eye, pulled = vehicle.couplings[i - 1].trailing_position, barred[i - 1]
        front, nose = (eye - 1.8, eye - 1.8) if pulled else (eye + 0.5, eye + NOSE)
        found = [(FRAME, max(axles), eye, 0.2)] if pulled else []
    if nose - body > 2.0 and (i or last or barred[0]):  # a dolly has none, nor a tractor
        found.append((LIGHT, body, nose - 0.1, WIDTH))
    return [(FRAME, min(rear, body), max(front, max(axles) + 0.7) if i else front, 0.85), *found]


def _point(truth: dict[str, Array], unit: "Unit", x: float, y: float = 0.0) -> Points:
    """Where a point of a unit is on the road, (N,)."""
    place = truth[f"position_x.{unit.name}"] + 1j * truth[f"position_y.{unit.name}"]
    found: Points = place + np.exp(1j * truth[f"yaw.{unit.name}"]) * (x - unit.cog + 1j * y)
    return found


def _box(low: float, high: float, width: float) -> Points:
    """Corners of a rectangle along the real axis."""
    return np.array([low, high, high, low]) + 0.5j * width * np.array([-1, -1, 1, 1])


def _stage(axes: "Axes", right: float, low: float, high: float, bar: float) -> None:
    """A frame without ticks, true to scale, with a scale bar of so many metres."""
    axes.set(xlim=(-right, right), ylim=(low, high), xticks=[], yticks=[], aspect="equal")
    axes.spines[:].set(color="#c8c8c8", linewidth=0.6)
    left, foot = 0.1 * right - right, low + 0.07 * right
    axes.plot([left, left + bar], [foot, foot], color=DARK, lw=2, solid_capstyle="butt", zorder=9)
    axes.text(left + bar + 0.08 * right, foot, f"{bar:g} m", size=7, va="center", zorder=9)


class _Scene:
    """The truth at the instants to draw, the road, and how to see them."""

    def __init__(self, drive: "Drive", time: Array, exaggerate: float) -> None:
        """What is drawn; for the view from above its heading, middle and size, and lines beside the lanes."""
        units = drive.vehicle.units
        truth = {name: np.interp(time, drive.time, values) for name, values in drive.truth.items()}
        front, rear = max(axle.position for axle in units[0].axles), min(axle.position for axle in units[-1].axles)
        paths = _point(drive.truth, units[0], front), _point(drive.truth, units[-1], rear)
        ends = _point(truth, units[0], front + AHEAD), _point(truth, units[-1], rear - TAIL)
        middle, length = (ends[0] + ends[1]) / 2, float(np.abs(ends[0] - ends[1]).max()) + 4.0
        ahead, origin = np.exp(1j * drive.truth[f"yaw.{units[0].name}"][0]), paths[0][0]
        if all(np.all((np.exp(1j * truth[f"yaw.{unit.name}"]) / ahead).real > 0.92) for unit in units):  # within 23 deg
            local = (np.array([*ends, middle]) - origin) / ahead  # a straight road, as the drive begins
            side = float(local.imag.min()), float(local.imag.max())
            middle = origin + ahead * (local[2].real + 0.5j * sum(side))
            begin = EVERY * (local.real.min() // EVERY - 2)
            centre = origin + ahead * np.arange(begin, local.real.max() + length, 0.5)
            heading, width = np.full(len(time), np.angle(ahead)), side[1] - side[0] + WIDTH + 1.0
        else:  # a bend: as if the first axle had kept to the middle of its lane
            centre, side, width, heading = paths[0], (0.0, 0.0), 0.5 * length, np.angle(ends[0] - ends[1])
        low, high = math.floor(side[0] / LANE + 0.3), math.ceil(side[1] / LANE - 0.3)
        lines = [(paths[0], FIRST, "-", 6), (paths[1], LAST, "--", 6)]
        left = 1j * np.exp(1j * np.angle(np.gradient(centre)))
        for k in range(low, high + 2):
            gap = (np.arange(len(centre)) * 0.5 % EVERY > DASH) & (low < k <= high)
            lines.append((np.where(gap, np.nan, centre + left * LANE * (k - 0.5)), MIDDLE, "-", 1))
        self.drive, self.time, self.truth, self.exaggerate = drive, time, truth, exaggerate
        self.heading, self.middle, self.lines = heading, middle, lines
        self.size = max(width, 0.3 * length), max(length, 2 * width)

    def page(self, figure: "Figure", instants: range, *, aside: bool = False) -> "Figure":
        """Instants side by side, the view from behind below that from above, or on its right."""
        wide, names = TALL * self.size[0] / self.size[1], [unit.name for unit in self.drive.vehicle.units]
        right, square, low = (wide + 0.1, 4.5, 0.5) if aside else (0.0, wide, wide + 0.55)
        column, high = right + square + 0.08, low + TALL + (0.05 if aside else 0.27 + 0.17 * len(names))
        across = column * len(instants)
        figure.set_size_inches(across, high)
        for n, k in enumerate(instants):
            left = n * column + 0.04
            self.above(figure.add_axes((left / across, low / high, wide / across, TALL / high)), k)
            left += right
            self.behind(figure.add_axes((left / across, 0.5 / high, square / across, square / high)), k)
            words = [f"{self.time[k]:.2f} s   {3.6 * self.truth['speed'][k]:.0f} km/h"]
            words += [f"{self.truth[f'lateral_acceleration.{name}'][k]:+z.1f} m/s² {name}" for name in names]
            figure.text(left / across, 1 - 0.06 / high, "\n".join(words), va="top", linespacing=1.3)
        text = (
            f"{self.drive.vehicle.name}, {self.drive.name}. Lateral accelerations left positive. From above, true to"
            " scale; solid: path of the first axle, dashed: of the last. From behind, roll angles and squash of tyres"
            f" times {self.exaggerate:g}; a darker tyre bears more; dots: roll axis and CoG of the body; arrow: lateral"
            " acceleration; dashed outlines: units in front."
        )
        figure.text(0.04 / across, 0.43 / high, textwrap.fill(text, int(19.5 * across)), va="top", size=7)
        return figure

    def above(self, axes: "Axes", k: int) -> None:
        """From above, the way ahead up the page."""
        turn, properties = 1j * np.exp(-1j * self.heading[k]), self.drive.properties
        _stage(axes, self.size[0] / 2, -self.size[1] / 2, self.size[1] / 2, 2.0)

        def put(places: Points) -> tuple[Array, Array]:
            seen = (places - self.middle[k]) * turn
            return seen.real, seen.imag

        for points, colour, style, over in self.lines:
            axes.plot(*put(points), color=colour, ls=style, lw=1.0, zorder=over)
        for i, unit in enumerate(self.drive.vehicle.units):
            ahead = np.exp(1j * self.truth[f"yaw.{unit.name}"][k])
            for axle in unit.axles:
                steer = np.exp(1j * self.truth.get(f"steer.{unit.name}.{axle.name}", 0 * self.time)[k])
                wheel = ahead * steer * _box(-properties.wheel_radius, properties.wheel_radius, 0.4)
                for y in (-properties.half_track, properties.half_track):
                    axes.fill(*put(_point(self.truth, unit, axle.position, y)[k] + wheel), fc=DARK, zorder=4)
            for shade, rear, front, width in _parts(self.drive.vehicle, i):
                shape = _point(self.truth, unit, 0.0)[k] + ahead * _box(rear, front, width)
                axes.fill(*put(shape), fc=shade, ec=DARK, lw=0.8, alpha=0.75, zorder=3 if shade == FRAME else 5)

    def behind(self, axes: "Axes", k: int) -> None:
        """From behind the last unit, what is in front of it faintly."""
        vehicle, unit, t = self.drive.vehicle, self.drive.vehicle.units[-1], self.truth
        _stage(axes, 2.65, -0.75, 4.55, 1.0)
        axes.plot([-2.65, 0, 0, 0, 2.65], [0, 0, TOP + 0.2, 0, 0], color=DARK, lw=0.8, zorder=1)
        axes.text(2.5, 4.4, f"roll {math.degrees(t[f'roll.{unit.name}'][k]):+z.1f}°", size=7, ha="right", va="top")
        here, ahead = _point(t, unit, unit.cog)[k], np.exp(1j * t[f"yaw.{unit.name}"][k])
        for i, other in enumerate(vehicle.units):
            load, axis, shades = other.payload, 1j * other.roll_axis_height, [part[0] for part in _parts(vehicle, i)]
            floor, top = load.floor_height if load else FLOOR, 3.6 if MIDDLE in shades else FLOOR
            boxes, look = [(0.5, TOP if LIGHT in shades else top, WIDTH, "none")], ("--", 5)
            if other is unit:
                boxes, look = [(0.7, floor, 0.85, FRAME), (floor, TOP, WIDTH, LIGHT)], ("-", 3)
                boxes += [(floor, floor + load.height, load.width, MIDDLE)] if load else []
            lean = np.exp(-1j * self.exaggerate * t[f"roll.{other.name}"][k])
            aside = axis - ((_point(t, other, other.cog)[k] - here) / ahead).imag
            for low, high, width, shade in boxes:
                put = aside + (1j * _box(low, high, width) - axis) * lean
                axes.fill(put.real, put.imag, fc=shade, ec=DARK, lw=0.7, ls=look[0], zorder=look[1])
        cog = axis + 1j * (vehicle.derived()[f"{unit.name}.cog_height"] - unit.roll_axis_height) * lean
        axes.plot([0, cog.real], [axis.imag, cog.imag], "o", color=DARK, ms=3, zorder=7)
        pull = -0.6 * t[f"lateral_acceleration.{unit.name}"][k]
        axes.quiver(cog.real, cog.imag, pull, 0, color=LAST, scale_units="xy", scale=1, width=0.012, zorder=8)
        group, track = unit.axle_groups[-1], self.drive.properties.half_track  # its tyres, squashed by their load
        loads = np.array([t[f"vertical_force.{unit.name}.{axle.name}"][k] for axle in group.axles])
        shift = float(loads @ [t[f"load_transfer.{unit.name}.{axle.name}"][k] for axle in group.axles])
        total, radius = float(loads.sum()), self.drive.properties.wheel_radius
        squash = self.exaggerate * shift * track**2 / group.tyre_roll_stiffness  # m, of those on the right
        axes.plot([-track, track], [radius + squash, radius - squash], color=DARK, lw=2.5, zorder=2)
        for side in (-1, 1):
            tyre, part = side * track + 1j * _box(0.0, 2 * radius - side * squash, 0.4), (1 + side * shift / total) / 2
            axes.fill(tyre.real, tyre.imag, fc=str(1 - 0.9 * min(max(part, 0), 1)), ec=DARK, lw=0.9, zorder=6)
            axes.text(side * track, -0.1, f"{part * total / 1e3:.0f} kN", ha="center", va="top", size=7)
