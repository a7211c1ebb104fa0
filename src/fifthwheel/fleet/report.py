"""The page of a fleet: what needs attention, the fleet's tables, the history of every truck."""

from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

import fifthwheel
from fifthwheel.fleet.attention import Attention, Table, find_attention
from fifthwheel.fleet.changes import OUTLIER
from fifthwheel.fleet.dataset import Dataset
from fifthwheel.fleet.settings import FleetSettings
from fifthwheel.formatting import percent, shown, with_sigma
from fifthwheel.plots.palette import BLUE, GREY, VERMILLION
from fifthwheel.report.figures import primitives
from fifthwheel.report.figures.primitives import ReportPlot
from fifthwheel.report.html import tables
from fifthwheel.report.html.page import write_page
from fifthwheel.report.html.page_builder import CaptionedPlot, PageBuilder

MAX_HISTORIES = 40
"""Trucks whose histories are drawn: those that need attention first."""
MAX_ROWS = 2000
"""Rows of a table of the page; the Parquet tables have all."""

ATTENTION = (
    tables.Column("Truck", "name"),
    tables.Column("What", "main"),
    tables.Column("Date", "w"),
    tables.Column("Finding", "full-text"),
)
TRUCKS = (
    tables.Column("Truck", "name"),
    tables.Column("Parameter"),
    tables.Column("Value", "n main"),
    tables.Column("Since first", "n", "since first: "),
    tables.Column("Trips", "n", "trips: "),
    tables.Column("Last", "w", "last: "),
)
TRAILERS = (TRUCKS[0], tables.Column("Trailer", "main"), tables.Column("Load", "", "load: "), *TRUCKS[1:])


def report(dataset: str | Path, out: str | Path) -> list[Attention]:
    """Write the page of a fleet as one HTML file, which needs no network; returns what needs attention.

    Args:
        dataset: folder or prefix that `run` wrote.
        out: path of the file.

    Raises:
        FifthwheelError: the data set is missing or damaged.
        OSError: the file cannot be written.
    """
    source = Dataset(str(dataset))
    settings = FleetSettings(**source.settings()["fleet"])
    rows: dict[str, Table] = {name: source.table(name).to_pylist() for name in ("trucks", "trailers", "changes")}
    rows["trips"] = source.index().to_pylist()
    history = source.table("history").to_pylist()
    attention = find_attention(rows, settings)
    page = PageBuilder("Fleet", f"{dataset}, fifthwheel {fifthwheel.__version__}")
    _headline(page, rows, attention, settings)
    _attention(page, attention)
    _tables(page, rows)
    _histories(page, history, rows["changes"], attention)
    _failed(page, rows["trips"])
    write_page(Path(out), title="Fleet: fifthwheel", body=page.body(), plots=page.plots)
    return attention


def _headline(
    page: PageBuilder, rows: Mapping[str, Table], attention: Sequence[Attention], settings: FleetSettings
) -> None:
    trucks = {row["truck"] for row in rows["trips"]}
    good = sum(not row["error"] for row in rows["trips"])
    text = (
        f"{_counted(len(trucks), 'truck')}, {_counted(good, 'trip')}: "
        f"{_counted(len(attention), 'finding')} in {_counted(len({a.truck for a in attention}), 'truck')}."
        if attention
        else f"{_counted(len(trucks), 'truck')}, {_counted(good, 'trip')}: nothing needs attention."
    )
    state = "verdict" if attention else "verdict good"
    page.html(f'<section class="{state}" id="verdict"><p class="headline">{escape(text)}</p>')
    page.html(
        f"<p>The probability of a false change in the whole fleet is at most {percent(settings.false_alarms)}.</p>"
        "</section>"
    )


def _attention(page: PageBuilder, attention: Sequence[Attention]) -> None:
    if not attention:
        return
    page.heading("attention", "Needs attention")
    cells = [
        ("", [tables.code(a.truck), escape(a.kind), f"{a.date:%Y-%m-%d}" if a.date else "–", escape(a.text)])
        for a in attention[:MAX_ROWS]
    ]
    page.html(tables.table(ATTENTION, cells))


def _tables(page: PageBuilder, rows: Mapping[str, Table]) -> None:
    page.heading("trucks", "Trucks")
    page.hint(
        "Estimate of each tractor parameter at the last trip, from all trips with all trailers, ± sigma. "
        "Since first: change of the estimate since the first trip, or since the last change."
    )
    page.html(tables.table(TRUCKS, [("", [tables.code(r["truck"]), *_latest(r)]) for r in rows["trucks"][:MAX_ROWS]]))
    page.heading("trailers", "Trailers")
    page.hint("The same for each trailer; yaw inertia and payload height for each load.")
    cells = [
        ("", [tables.code(r["truck"]), escape(r["trailer"]) or "–", escape(r["load"]) or "–", *_latest(r)])
        for r in rows["trailers"][:MAX_ROWS]
    ]
    page.html(tables.table(TRAILERS, cells))
    if max(len(rows["trucks"]), len(rows["trailers"])) > MAX_ROWS:
        page.hint(f"The first {MAX_ROWS} rows; trucks.parquet and trailers.parquet have all.")


def _latest(row: Mapping[str, Any]) -> list[str]:
    change = percent(row["value"] / row["first_value"] - 1) if row["first_value"] and row["trips"] > 1 else "–"
    return [
        tables.code(row["parameter"]),
        with_sigma(row["value"], row["sigma"], row["unit"]),
        change,
        str(row["trips"]),
        f"{row['date']:%Y-%m-%d}",
    ]


def _histories(page: PageBuilder, history: Table, changes: Table, attention: Sequence[Attention]) -> None:
    trucks: dict[str, list[Mapping[str, Any]]] = {}
    for row in history:
        trucks.setdefault(row["truck"], []).append(row)
    first = dict.fromkeys(a.truck for a in attention if a.truck in trucks)
    order = [*first, *[truck for truck in trucks if truck not in first]]
    page.heading("histories", "Histories")
    page.hint(
        "Estimates over days from all trips (line, band of two sigma) and of each trip alone (points with one sigma). "
        "Most of the band is common to all days: errors of the vehicle file. Vertical lines: changes."
    )
    for truck in order[:MAX_HISTORIES]:
        page.subheading(truck, badge="needs attention" if truck in first else "")
        own = [change for change in changes if change["truck"] == truck and change["kind"] != OUTLIER]
        series: dict[tuple[str, str, str], list[Mapping[str, Any]]] = {}
        for row in sorted(trucks[truck], key=lambda row: row["date"]):
            series.setdefault((row["parameter"], row["trailer"] or "", row["load"] or ""), []).append(row)
        page.figures(_history(truck, key, rows, own) for key, rows in series.items())
    if len(order) > MAX_HISTORIES:
        page.hint(f"{MAX_HISTORIES} of {len(order)} trucks are drawn; history.parquet has all.")


def _history(
    truck: str, key: tuple[str, str, str], rows: Sequence[Mapping[str, Any]], changes: Sequence[Mapping[str, Any]]
) -> CaptionedPlot:
    parameter, trailer, load = key
    unit = shown(rows[0]["unit"])
    dates = [f"{row['date']:%Y-%m-%d %H:%M:%S}" for row in rows]
    value, sigma = ([row[name] * unit.factor for row in rows] for name in ("value", "sigma"))
    lower, upper = ([_rounded(v + k * s) for v, s in zip(value, sigma, strict=True)] for k in (-2, 2))
    area = primitives.polyline("± 2 sigma", dates + dates[::-1], upper + lower[::-1], primitives.BAND, 0)
    area |= {"fill": "toself", "fillcolor": primitives.BAND, "hoverinfo": "skip"}
    centre = primitives.polyline("all trips", dates, [_rounded(v) for v in value], BLUE, 1.8)
    centre["mode"] = "lines+markers" if len(rows) == 1 else "lines"
    data = [area, centre, *_points(rows, dates, unit.factor)]
    layout = primitives.layout("", unit.name, [primitives.vertical(f"{c['date']:%Y-%m-%d %H:%M:%S}") for c in changes])
    layout["xaxis"] |= {"type": "date", "nticks": 5}
    note = ", ".join(escape(text) for text in (trailer and f"trailer {trailer}", load and f"load {load}") if text)
    plot = ReportPlot(
        group=f"truck {truck}",
        figure={"data": data, "layout": layout},
        name=(truck, "history", "-".join(filter(None, key))),
    )
    return CaptionedPlot(tables.code(parameter), note, plot)


def _points(rows: Sequence[Mapping[str, Any]], dates: Sequence[str], factor: float) -> list[dict[str, Any]]:
    """Estimates of single trips; outliers in another colour."""
    traces = []
    for name, colour, outlier in (("trip alone", GREY, False), ("outlier", VERMILLION, True)):
        own = [k for k, row in enumerate(rows) if row["outlier"] is outlier and row["trip_value"] is not None]
        if own:
            sigma = [_rounded((rows[k]["trip_sigma"] or 0.0) * factor) for k in own]
            traces.append(
                {
                    "type": "scatter",
                    "mode": "markers",
                    "name": name,
                    "x": [dates[k] for k in own],
                    "y": [_rounded(rows[k]["trip_value"] * factor) for k in own],
                    "error_y": {"type": "data", "array": sigma, "thickness": 1, "width": 2},
                    "marker": {"color": colour, "size": 6},
                }
            )
    return traces


def _failed(page: PageBuilder, trips: Table) -> None:
    failed = [trip for trip in trips if trip["error"]]
    if not failed:
        return
    page.heading("failed", "Trips that were not processed")
    columns = (tables.Column("Log", "name"), tables.Column("Truck"), tables.Column("Error", "full-text"))
    rows = [("", [tables.code(t["log"]), escape(t["truck"]), escape(t["error"])]) for t in failed[:MAX_ROWS]]
    page.html(tables.table(columns, rows))


def _rounded(value: float) -> float:
    return float(f"{value:.5g}")


def _counted(count: int, noun: str) -> str:
    return f"{count} {noun}{'' if count == 1 else 's'}"
