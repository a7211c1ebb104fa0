"""A vehicle: its numbers, those that are assumed or measured, and what earlier logs say of it."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from fifthwheel.base import pages
from fifthwheel.base.formatting import approximate, enumerated, percent, shown, with_sigma
from fifthwheel.base.plots import Axis, Band, Guide, Item, Line, Panel, Plot, Points
from fifthwheel.base.plots.items import BLUE
from fifthwheel.base.spelling import setting
from fifthwheel.base.types import Array
from fifthwheel.data.checks.axle_loads import StaticLoad
from fifthwheel.estimate.identify.knowledge.history import (
    EstimateHistory,
    LogEntry,
    SharedEstimate,
    estimate_histories,
    history,
)
from fifthwheel.estimate.identify.knowledge.knowledge import Knowledge
from fifthwheel.estimate.identify.mass import CONTRADICTION, GrossMass
from fifthwheel.model.dynamics.summary import VehicleSummary
from fifthwheel.results.diagnose.predictions import AssumedNumber
from fifthwheel.results.report.conclusion import counted
from fifthwheel.truck import Vehicle, unit_of
from fifthwheel.truck.spoken_names import spoken

NOTHING_ASSUMED = "The vehicle file states every number; its comments say where each comes from."
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
COMBINED = (
    "These estimates combine the linearised information of each log; a report has the joint fit of its logs. The two "
    "differ by a fraction of sigma, by more only where logs are doubtful or something changed between them."
)
"""On the estimates of a history."""
LEAST_SPAN = 600e3
"""Of the axis of dates, ms, so that its ticks are whole minutes."""


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


def knowledge_document(estimates: Sequence[SharedEstimate], logs: int, *, everything: bool = False) -> pages.Document:
    """Estimates of parameters from all logs; with `everything` uncertain numbers and sensor errors too."""
    others = [estimate for estimate in estimates if not estimate.estimated]
    headline = f"{counted(logs, 'log')}, {counted(len(estimates) - len(others), 'estimated parameter')}."
    blocks: list[pages.Block] = [
        pages.Headline(headline),
        _estimates([estimate for estimate in estimates if estimate.estimated], "Estimated parameters"),
    ]
    if everything:
        blocks += [pages.Heading("Uncertain numbers and sensor errors"), _estimates(others, "Other shared unknowns")]
    else:
        blocks.append(pages.Hint(f"{counted(len(others), 'more shared unknown')}: {setting('everything')}"))
    return pages.Document("Knowledge", blocks)


def _estimates(estimates: Sequence[SharedEstimate], label: str) -> pages.Table:
    rows = [
        (pages.Hinted(spoken(e.name), e.name), with_sigma(e.value, e.sigma, e.unit), e.belongs_to, e.log)
        for e in estimates
    ]
    return pages.Table(("Parameter|name", "Value|main", "Belongs to", "Last log"), rows, label=label)


def history_document(entries: Sequence[LogEntry]) -> pages.Document:
    """The logs in the order of their dates: what each added, what changed before it, doubts."""
    blocks: list[pages.Block] = [
        _headline(entries),
        _logs(entries),
        pages.Heading("Sigma before and after each log"),
        _added(entries),
    ]
    return pages.Document("History", blocks)


def truck_history_document(knowledge: Knowledge) -> pages.Document:
    """Estimates, their histories as plots, and the logs, for a page."""
    histories, entries = estimate_histories(knowledge), history(knowledge)
    blocks: list[pages.Block] = [
        _headline(entries),
        _estimates([each.last for each in histories], "Estimated parameters"),
        pages.Hint(COMBINED),
        *_plots(histories),
        pages.Heading("Logs"),
        _logs(entries),
        pages.Folded("Sigma before and after each log", [_added(entries)]),
    ]
    return pages.Document("Truck's history", blocks)


def _plots(histories: Sequence[EstimateHistory]) -> Iterator[pages.Block]:
    yield pages.Heading("Histories")
    if all(len(np.unique(each.time)) < 2 for each in histories):
        yield pages.Hint("A history needs logs of two dates: identify another log with this result as its vehicle.")
        return
    yield pages.Hint("Estimates from all logs at the date of each log; band of two sigma. Vertical lines: changes.")
    yield pages.Plots([_plot(each) for each in histories])


def _plot(each: EstimateHistory) -> pages.CaptionedPlot:
    unit, dates = shown(each.last.unit), 1000 * each.time
    value, sigma = each.value * unit.factor, each.sigma * unit.factor
    items: list[Item] = []
    for part in np.split(np.arange(len(dates)), np.searchsorted(each.time, np.sort(each.changes))):
        if len(part):  # from one change to the next
            name = "" if items else "all logs, ± 2 sigma"
            x, y, spread = dates[part], value[part], sigma[part]
            items += [Band(x, y - 2 * spread, y + 2 * spread, colour=BLUE), Line(x, y, name=name, colour=BLUE)]
    items.append(Points(dates, value, y_sigma=sigma, name="at a log, ± sigma", colour=BLUE, size=6))
    items += [Guide(x=float(1000 * at), colour="#bbbbbb", width=1, dash="solid") for at in each.changes]
    title = f"{spoken(each.last.name)} ({each.last.belongs_to})"
    plot = Plot(title=title, panels=[Panel(items=items, x=date_axis(dates), y=Axis(unit=unit.name))])
    return pages.CaptionedPlot(spoken(each.last.name), plot, "knowledge", ("", "history", title))


def date_axis(dates: Array, least: float = LEAST_SPAN) -> Axis:
    """An axis for dates (n,), ms since 1970, with a least span, ms."""
    margin = max(0.05 * np.ptp(dates), (least - np.ptp(dates)) / 2)
    visible = (float(dates.min() - margin), float(dates.max() + margin))
    return Axis(label="date of the log", date=True, range=visible)


def _headline(entries: Sequence[LogEntry]) -> pages.Headline:
    unused = sum(bool(entry.unused) for entry in entries)
    left = f", {unused} of them not used" if unused else ""
    return pages.Headline(f"{counted(len(entries), 'log')}{left}.")


def _logs(entries: Sequence[LogEntry]) -> pages.Table:
    rows = [
        (e.log.name, f"{e.log.date:%Y-%m-%d %H:%M}", e.log.trailer or "–", e.log.load or "–", "; ".join(_remarks(e)))
        for e in entries
    ]
    return pages.Table(("Log|name", "Date|w", "Trailer", "Load", "Remark|full-text"), rows, label="Logs")


def _added(entries: Sequence[LogEntry]) -> pages.Table:
    rows = [
        (e.log.name, pages.Hinted(spoken(name), name), approximate(before, unit), approximate(after, unit))
        for e in entries
        for name, (before, after) in e.sigmas.items()
        for unit in [unit_of(name)]
    ]
    return pages.Table(("Log|name", "Parameter|name", "Before>", "After>"), rows, label="Sigma of each log")


def _remarks(entry: LogEntry) -> list[str]:
    doubts = [f"doubtful: {doubt}" for doubt in entry.log.doubts]
    return [*entry.changes, *([f"not used: {entry.unused}"] if entry.unused else []), *doubts]
