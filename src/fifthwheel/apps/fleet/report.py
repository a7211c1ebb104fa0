"""The page of a fleet: what needs attention, the fleet's tables, the history of every truck."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

import fifthwheel
from fifthwheel.apps.fleet.attention import Attention, Row, find_attention
from fifthwheel.apps.fleet.dataset import TripDataset
from fifthwheel.apps.fleet.tables import SCHEMAS
from fifthwheel.base import pages
from fifthwheel.base.formatting import enumerated, percent, shown, with_sigma
from fifthwheel.base.options import FleetSettings
from fifthwheel.base.pages import html
from fifthwheel.base.plots import Axis, Band, Guide, Item, Line, Panel, Plot, Points
from fifthwheel.base.plots.items import BLUE, GREY, VERMILLION
from fifthwheel.estimate.identify.knowledge.information import OUTLIER
from fifthwheel.results.diagnose.thresholds import DOMINANT_FRACTION, NOTABLE_SIGMA
from fifthwheel.results.report.conclusion import counted
from fifthwheel.results.report.vehicle import date_axis
from fifthwheel.truck.spoken_names import named, spoken

MAX_HISTORIES = 40
"""Trucks whose histories are drawn: those that need attention first."""
ENOUGH_TRIPS = 3
"""With fewer trips that determine a parameter, more excitation comes first."""
LEAST_SPAN = 4 * 86_400e3
"""Of the axis of dates, ms, so that its ticks are whole days."""
MAX_ROWS = 2000
"""Sequence[Row] of a table of the page; the Parquet tables have all."""

LATEST = ("Parameter", "Value>|main", "Since first>", "Trips>", "Last|w|Last: ", "Limited by|full-text")


def report(dataset: str | Path, out: str | Path) -> list[Attention]:
    """Write the page of a fleet as one HTML file, which needs no network; returns what needs attention.

    Args:
        dataset: folder or prefix that `run` wrote.
        out: path of the file.

    Raises:
        FifthwheelError: the data set is missing or damaged.
        OSError: the file cannot be written.
    """
    stated, rows = TripDataset(str(dataset)).read(("trips", *SCHEMAS))
    settings = FleetSettings(**stated["fleet"])
    attention = find_attention(rows, settings, stated["not combined"])
    blocks = (
        _headline(rows["trips"], attention, settings),
        *_attention(attention),
        *_tables(rows),
        *_histories(rows["history"], rows["changes"], attention),
        *_failed(rows["trips"]),
    )
    html.write(Path(out), pages.Document("Fleet", blocks, f"{dataset}, fifthwheel {fifthwheel.__version__}"))
    return attention


def _headline(trips: Sequence[Row], attention: Sequence[Attention], settings: FleetSettings) -> pages.Headline:
    good = sum(not trip["error"] for trip in trips)
    trucks, concerned = {trip["truck"] for trip in trips}, {finding.truck for finding in attention}
    found = f"{counted(len(attention), 'finding')} in {counted(len(concerned), 'truck')}"
    result = found if attention else "nothing needs attention"
    text = f"{counted(len(trucks), 'truck')}, {counted(good, 'trip')}: {result}."
    false = f"The probability of a false change in the whole fleet is at most {percent(settings.false_alarms)}."
    return pages.Headline(text, not attention, [[pages.Paragraph(false)]])


def _attention(attention: Sequence[Attention]) -> Iterator[pages.Block]:
    if attention:
        yield pages.Heading("Needs attention", key="attention")
        rows = [
            (pages.Code(a.truck), a.kind, f"{a.date:%Y-%m-%d}" if a.date else "–", a.text) for a in attention[:MAX_ROWS]
        ]
        yield pages.Table(("Truck|name", "What|main", "Date|w", "Finding|full-text"), rows)


def _tables(rows: Mapping[str, Sequence[Row]]) -> Iterator[pages.Block]:
    trucks, trailers = rows["trucks"], rows["trailers"]
    yield pages.Heading("Trucks", key="trucks")
    yield pages.Hint(
        "Estimate of each tractor parameter at the last trip, from all trips with all trailers, ± sigma. "
        "Since first: change of the estimate since the first trip, or since the last change. Limited by: what would "
        "make sigma smaller, where it is 5 % or more."
    )
    yield pages.Table(("Truck|name", *LATEST), [(pages.Code(r["truck"]), *_latest(r)) for r in trucks[:MAX_ROWS]])
    yield pages.Heading("Trailers", key="trailers")
    yield pages.Hint("The same for each trailer; yaw inertia and payload height for each load.")
    cells = [(pages.Code(r["truck"]), r["trailer"] or "–", r["load"] or "–", *_latest(r)) for r in trailers[:MAX_ROWS]]
    yield pages.Table(("Truck|name", "Trailer|main", "Load||Load: ", *LATEST), cells)
    if max(len(trucks), len(trailers)) > MAX_ROWS:
        yield pages.Hint(f"The first {MAX_ROWS} rows; trucks.parquet and trailers.parquet have all.")


def _latest(row: Row) -> tuple[pages.Cell, ...]:
    change = percent(row["value"] / row["first_value"] - 1) if row["first_value"] and row["trips"] > 1 else "–"
    value = with_sigma(row["value"], row["sigma"], row["unit"])
    parameter = pages.Hinted(spoken(row["parameter"]), row["parameter"])
    return parameter, value, change, str(row["trips"]), f"{row['date']:%Y-%m-%d}", limit(row)


def limit(row: Row) -> str:
    """What would narrow the band of a parameter; empty if its sigma is small."""
    if row["sigma"] < NOTABLE_SIGMA * abs(row["value"]):
        return ""
    if row["excited_trips"] < min(row["trips"], ENOUGH_TRIPS):
        trips = f"{row['excited_trips']} of {counted(row['trips'], 'trip')}"
        return f"Excitation: {trips} determine{'s' * (row['excited_trips'] == 1)} it."
    sources = [named(name) for name in row["limited_by"]]
    if row["limited_fraction"] > DOMINANT_FRACTION:
        cure = "measure it" if len(sources) == 1 else "measure them"
        share = percent(row["limited_fraction"])
        return f"{share} of the variance comes from {enumerated(sources)}, common to the trips: {cure}."
    return "More trips narrow it."


def _histories(history: Sequence[Row], changes: Sequence[Row], attention: Sequence[Attention]) -> Iterator[pages.Block]:
    trucks: dict[str, list[Row]] = {}
    for row in history:
        trucks.setdefault(row["truck"], []).append(row)
    first = dict.fromkeys(a.truck for a in attention if a.truck in trucks)
    order = [*first, *[truck for truck in trucks if truck not in first]]
    yield pages.Heading("Histories", key="histories")
    yield pages.Hint(
        "Estimates over days from all trips (line, band of two sigma) and of each trip alone (points with one sigma). "
        "Most of the band is common to all days: errors of the vehicle file. Vertical lines: changes."
    )
    for truck in order[:MAX_HISTORIES]:
        yield pages.Heading(truck, badge="needs attention" if truck in first else "")
        own = [1000 * c["date"].timestamp() for c in changes if c["truck"] == truck and c["kind"] != OUTLIER]
        series: dict[tuple[str, str, str], list[Row]] = {}
        for row in sorted(trucks[truck], key=lambda row: row["date"]):
            series.setdefault((row["parameter"], row["trailer"] or "", row["load"] or ""), []).append(row)
        yield pages.Plots([_history(truck, key, rows, own) for key, rows in series.items()])
    if len(order) > MAX_HISTORIES:
        yield pages.Hint(f"{MAX_HISTORIES} of {len(order)} trucks are drawn; history.parquet has all.")


def _history(
    truck: str, key: tuple[str, str, str], rows: Sequence[Row], changes: Sequence[float]
) -> pages.CaptionedPlot:
    parameter, trailer, load = key
    unit = shown(rows[0]["unit"])
    dates = np.array([1000 * row["date"].timestamp() for row in rows])
    value, sigma = (np.array([row[name] for row in rows]) * unit.factor for name in ("value", "sigma"))
    items: list[Item] = [
        Band(dates, value - 2 * sigma, value + 2 * sigma, name="± 2 sigma", colour=BLUE),
        Line(dates, value, name="all trips", colour=BLUE),
    ]
    for name, colour, outlier in (("trip alone", GREY, False), ("outlier", VERMILLION, True)):
        own = [k for k, row in enumerate(rows) if row["outlier"] is outlier and row["trip_value"] is not None]
        if own:
            alone, spread = (
                [(rows[k][column] or 0.0) * unit.factor for k in own] for column in ("trip_value", "trip_sigma")
            )
            items.append(Points(dates[own], alone, y_sigma=spread, name=name, colour=colour, size=6))
    items += [Guide(x=at, colour="#bbbbbb", width=1, dash="solid") for at in changes]
    plot = Plot(panels=[Panel(items=items, x=date_axis(dates, LEAST_SPAN), y=Axis(unit=unit.name))])
    note = ", ".join(text for text in (trailer and f"trailer {trailer}", load and f"load {load}") if text)
    path = (truck, "history", "-".join(filter(None, key)))
    return pages.CaptionedPlot(spoken(parameter), plot, f"truck {truck}", path, note=note)


def _failed(trips: Sequence[Row]) -> Iterator[pages.Block]:
    if failed := [trip for trip in trips if trip["error"]]:
        yield pages.Heading("Trips that were not processed", key="failed")
        yield pages.Table(
            ("Log|name", "Truck", "Error|full-text"),
            [(pages.Code(t["log"]), t["truck"], t["error"]) for t in failed[:MAX_ROWS]],
        )
