"""A vehicle: loads, handling, oscillations, the numbers that are assumed, and those that a measurement has set."""

from collections.abc import Mapping, Sequence

from fifthwheel.base import pages
from fifthwheel.base.formatting import enumerated, percent, with_sigma
from fifthwheel.data.checks.axle_loads import StaticLoad
from fifthwheel.estimate.identify.mass import CONTRADICTION, GrossMass
from fifthwheel.model.dynamics.summary import VehicleSummary
from fifthwheel.results.diagnose.assumptions import AssumedNumber
from fifthwheel.truck import Vehicle, unit_of
from fifthwheel.truck.spoken_names import spoken

NOTHING_ASSUMED = "No number is assumed."


def vehicle_document(vehicle: Vehicle, summary: VehicleSummary, assumed: Sequence[AssumedNumber]) -> pages.Document:
    """The summary of a vehicle, and its assumed numbers."""
    headline = f"{vehicle.name}: {' + '.join(unit.name for unit in vehicle.units)}, {summary.at_speed}"
    rest = assumed_blocks(assumed) if assumed else [pages.Paragraph(f"\n{NOTHING_ASSUMED}")]
    return pages.Document(vehicle.name, [pages.Headline(headline), summary.table(), *rest])


def assumed_blocks(numbers: Sequence[AssumedNumber]) -> list[pages.Block]:
    """The numbers that a vehicle file leaves to classes, with their effects and sources."""
    rows = [
        (
            pages.Hinted(spoken(n.path), n.path),
            with_sigma(n.value, n.sigma, unit_of(n.path)),
            _effect(n.yaw),
            _effect(n.roll),
        )
        for n in numbers
    ]
    sources: dict[str, list[str]] = {}
    for number in numbers:
        sources.setdefault(number.source, []).append(number.path)
    notes = (
        "Yaw, Roll: how much one sigma of the number changes the yaw rates and the roll rates in a lane change (rms).",
        "Measure the numbers with the largest effects, and write them into the vehicle file. Cornering stiffness, the "
        "trailers' yaw inertia and payload heights are estimated from logs.",
    )
    return [
        pages.Table(("Assumed", "Value>", "Yaw>", "Roll>"), rows, label="Assumed numbers"),
        pages.Folded("Sources", [pages.Items([f"{enumerated(paths)}: {source}" for source, paths in sources.items()])]),
        pages.Items(notes, "Notes"),
    ]


def _effect(fraction: float | None) -> str:
    return "–" if fraction is None else percent(fraction)


def weighed_document(
    loads: Mapping[str, StaticLoad], before: Vehicle, after: Vehicle, unused: Sequence[str] = ()
) -> pages.Document:
    """Measured axle loads, with masses and CoG positions before, of the vehicle file, and after, from these loads."""
    old_loads, new_loads = before.axle_loads(), after.axle_loads()
    rows = []
    for path in old_loads:
        load = loads.get(path)
        measured = ("–", "–") if load is None else (f"{load.value / 1e3:.2f}", f"{load.scatter / 1e3:.2f}")
        rows.append((path, *measured, f"{old_loads[path] / 1e3:.2f}", f"{new_loads[path] / 1e3:.2f}"))
    units = [
        (new.name, f"{new.mass:.0f}", f"{old.mass:.0f}", f"{new.cog:.3f}", f"{old.cog:.3f}")
        for old, new in zip(before.units, after.units, strict=True)
    ]
    heads = ("Axle group", "Measured, kN>", "Scatter>", "File, kN>", "New, kN>")
    of_units = ("Unit", "New mass, kg>", "File>", "New CoG, m>", "File>")
    hints = [pages.Hint(f"Not used: {enumerated(unused)}. `fifthwheel mass` uses them.")] if unused else []
    return pages.Document(after.name, [pages.Table(heads, rows), pages.Table(of_units, units), *hints])


def mass_document(
    result: GrossMass, before: tuple[float, float], changed: Mapping[str, Mapping[str, float | None]]
) -> pages.Document:
    """The gross mass by each measurement and by the vehicle file, its parts of sigma, and the numbers of the file that
    follow the load."""
    deviation, difference = result.deviation(*before), result.mass - before[0]
    agrees, measured = deviation <= CONTRADICTION, enumerated([SOURCES[key] for key in result.sources])
    side = f"{abs(difference) / 1e3:.1f} t too {'light' if difference > 0 else 'heavy'}"
    verdict = f"agrees with the {measured.removeprefix('ordinary ')}" if agrees else f"is {side}"
    found, file = (with_sigma(m / 1e3, s / 1e3, "t") for m, s in ((result.mass, result.sigma), before))
    remarks = {"driving": f"{result.used:.0f} s with known force"}
    rows = [(SOURCES[key], with_sigma(*mass, "kg"), remarks.get(key, "")) for key, mass in result.sources.items()]
    rows += [("all", with_sigma(result.mass, result.sigma, "kg"), result.verdict.value)] if len(rows) > 1 else []
    rows += [("vehicle file", with_sigma(*before, "kg"), f"differs by {deviation:.1f} joint sigma")]
    parts = [(PARTS_OF_MASS[key], with_sigma(sigma, None, "kg")) for key, sigma in result.parts.items()]
    return pages.Document(
        "Gross mass",
        [
            pages.Headline(f"The vehicle file {verdict}: the gross mass is {found}, in the file {file}.", agrees),
            pages.Table(("Gross mass by", "Mass>", ""), rows),
            changed_table(changed, "Numbers that follow the load"),
            pages.Table(("Sigma comes from", "Part>"), parts, label="Parts of sigma"),
        ],
    )


SOURCES = {"driving": "ordinary driving", "weights": "axle loads and weights"}
"""Name of each measurement of a gross mass."""
PARTS_OF_MASS = {
    "driving": "the log: grade, wind, noise",
    "torque_scale": "scale of the torque or force",
    "efficiency": "efficiency of the driveline",
    "speed_scale": "scale of the speed",
    "weights": "scales on board",
    "vehicle_file": "positions and unladen masses in the file",
}


def changed_table(changed: Mapping[str, Mapping[str, float | None]], label: str = "") -> pages.Table:
    """The numbers that a measurement has set, by path: of the new vehicle file, of the former one, and their change."""
    rows = []
    for path, number in changed.items():
        unit, new, old = unit_of(path), number["value"], number["before"]
        if new is not None and old is not None and new != old:
            is_position = path.endswith(("cog", "position"))
            change = f"{new - old:+.3f} m" if is_position or not old else f"{100 * (new / old - 1):+.1f} %"
            rows.append((path, with_sigma(new, number["sigma"], unit), with_sigma(old, None, unit), change))
    return pages.Table(("Parameter", "New>", "File>", "Change>"), rows, label=label)


def roll_test_document(vehicle: Vehicle, changed: Mapping[str, Mapping[str, float | None]]) -> pages.Document:
    """The numbers that a roll test has set: before it, by the vehicle file, and after it."""
    return pages.Document(vehicle.name, [changed_table(changed)])
