"""Results beside each other, and the history of a truck: estimates over the dates of all logs that a result knows."""

from dataclasses import replace
from functools import partial

from nicegui import ui

from fifthwheel.apps.app import documents, jobs, layout, runs
from fifthwheel.apps.app.workspace import Workspace
from fifthwheel.base.plots import Plot
from fifthwheel.results.diagnose import Comparison
from fifthwheel.results.report.comparison import comparison_document

MOST = 6
"""Results that are compared without being asked for."""


def build(workspace: Workspace) -> None:
    results = runs.results(workspace)
    if len(results) < 2:
        layout.next_step("There are fewer than two results; identify again, with other logs or settings.", "identify")
        return
    asked = ui.context.client.request.query_params.getlist("run")
    chosen = [name for name in asked if name in results] if asked else results[:MOST][::-1]
    _choice(results, chosen)
    if len(chosen) < 2:
        ui.label("Choose a second result." if chosen else "Choose two results.").props("role=status")
        return
    compare = partial(jobs.compute, runs.comparison, workspace.folder, chosen)
    layout.later("Comparing", compare, lambda found: _comparison(workspace, found, chosen))


def _choice(results: list[str], chosen: list[str]) -> None:
    select = ui.select(results, value=chosen, multiple=True, label="Results; the first is the reference")
    select.classes("w-full").props("use-chips")

    opened = False

    def show(opens: bool) -> None:
        nonlocal opened
        opened = opens
        change()

    def change() -> None:
        if not opened and select.value != chosen:
            ui.navigate.to(f"?{layout.query(run=select.value or [''])}")

    select.on("popup-show", lambda: show(True))
    select.on("popup-hide", lambda: show(False))
    select.on_value_change(change)


def _comparison(workspace: Workspace, found: Comparison, chosen: list[str]) -> None:
    documents.show(*comparison_document(found).blocks)
    with ui.row().classes("items-center"):
        for kind in ("csv", "html"):
            address = f"/compared.{kind}?{layout.query(run=chosen)}"
            ui.link(f"Save as {kind.upper()}", address)
        for name in chosen:
            ui.link(f"vehicle.toml of {name}", documents.file_address(name, "vehicle.toml"))
    with layout.part("Estimates ± 1 sigma"), ui.element("div").classes("fw-grid"):
        for parameter, plot in found.plots().items():
            with ui.element("div"):
                documents.show_plot(plot, height=90 + 34 * len(chosen), label=f"Estimates of {parameter}")
    if used := runs.used_logs(workspace):
        with layout.part("Measured and predicted, with linear tyres"):
            _overlay(workspace, chosen, used)


def _overlay(workspace: Workspace, chosen: list[str], used: list[str]) -> None:
    drawn: Plot | None = None
    part = ""

    def find(text: str) -> None:
        nonlocal part
        part = text
        if drawn is not None:
            show(drawn)

    with ui.row().classes("items-end"):
        choose = ui.select(used, value=used[0], label="Log").classes("fw-field")
        layout.search("Find a signal", find)
    place = ui.column().classes("w-full")

    def show(plot: Plot) -> None:
        nonlocal drawn
        drawn = plot
        panels = [panel for panel in plot.panels if layout.contains(panel.title, part)]
        place.clear()
        with place:
            if panels:
                documents.show_plot(replace(plot, panels=panels), height=170 * len(panels) + 100, log=str(choose.value))
            else:
                ui.label(layout.NO_SIGNAL).props("role=status")

    async def draw() -> None:
        computed = jobs.compute(runs.overlay, workspace.folder, chosen, str(choose.value))
        await layout.fill(place, "Predicting", computed, show)

    choose.on_value_change(draw)
    ui.timer(0, draw, once=True)


def build_history(workspace: Workspace) -> None:
    results = runs.known_results(workspace)
    if not results:
        layout.next_step("There is no result with knowledge of its logs yet; identify in one stage.", "identify")
        return
    query = ui.context.client.request.query_params.get("run")
    chosen = query if query in results else results[0]
    select = ui.select(results, value=chosen, label="Result").classes("fw-field")
    select.on_value_change(lambda event: ui.navigate.to(f"?{layout.query(run=str(event.value))}"))
    combine = partial(jobs.compute, runs.history, workspace.folder, chosen)
    layout.later("Combining the logs", combine, lambda found: documents.show(*found.blocks))
