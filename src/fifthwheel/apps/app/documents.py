"""What the pages show of results: documents, plots, and the files of a result with its report."""

import re
from contextlib import ExitStack, nullcontext
from pathlib import Path
from typing import Annotated, Any, Literal
from urllib.parse import quote

from fastapi import HTTPException, Query
from fastapi.responses import FileResponse, HTMLResponse, Response
from nicegui import app, events, ui

from fifthwheel.apps.app import layout, runs
from fifthwheel.apps.app.workspace import Workspace
from fifthwheel.base import pages
from fifthwheel.base.errors import FifthwheelError
from fifthwheel.base.pages import html
from fifthwheel.base.plots import Plot
from fifthwheel.base.plots.plotly_figure import figure
from fifthwheel.estimate.identify.knowledge.storage import IDENTIFICATION
from fifthwheel.results.report import comparison_page

Window = tuple[float, float]
LONG = 12
"""Rows of a table of which a narrow screen shows only the first."""
_UNUSED_BUTTONS = ["zoom2d", "select2d", "lasso2d", "toImage"]
_CLEAR = "rgba(0,0,0,0)"
CONFIG = {"displaylogo": False, "responsive": True, "modeBarButtonsToRemove": _UNUSED_BUTTONS}
ZOOM = ["xaxis.range[0]", "xaxis.range[1]", "xaxis.autorange"]
"""Of the event plotly_relayout, what `zoomed` needs."""
_KEPT = "zoom"
DATA = ("vehicle.toml", IDENTIFICATION, "states.parquet")
"""What can be downloaded of a result."""
FILES = ("report.html", *DATA)
"""What can be asked for."""
SANDBOX = "sandbox allow-scripts"
"""The report draws its plots, but cannot read or change anything else."""
_NAME = re.compile(r'(<h1>[^<]*<span class="result">)[^<]*<')
_TITLE = re.compile("<title>[^<]*</title>")


def show(*blocks: pages.Block) -> None:
    """Show blocks of a document in the page; a narrow screen folds the parts that follow the first table."""
    folds = False
    with ExitStack() as part:

        def begin(title: str) -> None:
            part.close()
            if folds:
                part.enter_context(layout.part(title))
            else:
                layout.heading(title)

        for block in blocks:
            match block:
                case pages.Headline():
                    ui.label(block.text).classes("text-weight-bold").props("role=status")
                    for column in block.columns:
                        show(*column)
                case pages.Heading():
                    begin(block.title)
                case pages.Items():
                    if block.lines and block.title:
                        begin(f"{block.title} ({len(block.lines)})")
                    if block.lines:
                        ui.html(_rendered(pages.Items(block.lines)), sanitize=False).classes("fw-list")
                case pages.Folded():
                    with ui.expansion(block.summary).classes("w-full"):
                        show(*block.blocks)
                case pages.Beside():
                    show(*block.blocks)
                case pages.Plots():
                    for each in block.plots:
                        show_plot(each.plot)
                case _:
                    long = isinstance(block, pages.Table) and len(block.rows) > LONG and block.label
                    with layout.part(long, begins=True) if long else nullcontext():
                        ui.html(_rendered(block), sanitize=False).classes("fw-scroll fw-table")
            folds = folds or isinstance(block, pages.Table)


def _rendered(block: pages.Block) -> str:
    return html.blocks([block])


def show_plot(plot: Plot, *, height: int = 300, label: str = "", log: str | None = None) -> ui.plotly:
    """Show a plot in the width of the page; the label is for screen readers, by default the title.

    Plots over the time of one log have one cursor, and keep their zoom between pages.
    """
    element = ui.plotly(drawn(plot, height=height, log=log)).classes("w-full").style(f"height: {height}px")
    element.props["role"] = "img"
    element.props["aria-label"] = label or plot.title
    if log is not None:
        over_time(element, log)
        element.on("plotly_relayout", lambda event: keep_zoom(log, zoomed(event)), args=ZOOM)
    return element


def over_time(element: ui.plotly, log: str) -> None:
    """Let a plot share the time cursor of a log."""
    element.classes("fw-time").props["data-log"] = log


def zoomed(event: events.GenericEventArguments) -> Window | Literal[False] | None:
    """The window to which a user has zoomed, s; None for the whole log, False for another change."""
    if event.args.get(ZOOM[2]):
        return None
    low, high = event.args.get(ZOOM[0]), event.args.get(ZOOM[1])
    return False if low is None or high is None else (float(low), float(high))


def keep_zoom(log: str, window: Window | Literal[False] | None) -> None:
    """Keep the window of a log for other pages of this tab, s from the beginning of the axis; False changes nothing."""
    if window is not False:
        app.storage.tab[_KEPT] = {**app.storage.tab.get(_KEPT, {}), log: window}


def kept_zoom(log: str) -> Window | None:
    """The window of a log that this tab has zoomed to; None for the whole log."""
    if not ui.context.client.has_socket_connection:
        return None  # what a tab keeps is known when it is connected
    kept = app.storage.tab.get(_KEPT, {}).get(log)
    return (float(kept[0]), float(kept[1])) if kept else None


def preload() -> None:
    """Let the browser load plotly.js before the first plot, while a log is read."""
    ui.plotly({"data": []}).style("position: absolute; width: 1px; height: 1px; visibility: hidden").props(
        'aria-hidden="true"'
    )


def drawn(plot: Plot, *, height: int, log: str | None = None) -> dict[str, Any]:
    """A plot as `ui.plotly` takes it; over the time of a log in the window that the tab has zoomed to."""
    content = figure(plot)
    own: dict[str, Any] = {"height": height, "autosize": True, "paper_bgcolor": _CLEAR, "plot_bgcolor": _CLEAR}
    own["modebar"] = content["layout"]["modebar"] | {"bgcolor": _CLEAR, "color": "#999999", "activecolor": "#333333"}
    if log is not None:
        own["hovermode"] = False  # the time cursor shows the values
        if window := kept_zoom(log):
            own["xaxis"] = content["layout"]["xaxis"] | {"range": list(window), "autorange": False}
    return content | {"layout": content["layout"] | own, "config": CONFIG}


def register_files(folder: Path) -> None:
    """Answer requests for files of results."""

    @app.get("/runs/{name}/{file}")
    def answer(name: str, file: str) -> Response:
        try:
            path = Workspace(folder).run(name) / file
        except FifthwheelError:
            raise HTTPException(404) from None
        if file not in FILES or path.is_symlink() or not path.is_file():
            raise HTTPException(404)
        if file == "report.html":
            headers = {"Content-Security-Policy": SANDBOX, "Cache-Control": "no-store"}
            return HTMLResponse(_report(path, name), headers=headers)
        return FileResponse(path, filename=f"{name}-{file}", headers={"Cache-Control": "no-store"})

    @app.get("/compared.{kind}")
    def compared(kind: str, run: Annotated[list[str], Query()]) -> Response:
        try:
            found = runs.comparison(folder, run)
            if kind == "csv":
                return Response(found.to_csv(), media_type="text/csv", headers=_attached("compared.csv"))
            if kind == "html":
                content, _ = html.page(comparison_page(found))
                return Response(content, media_type="text/html", headers=_attached("compared.html"))
        except FifthwheelError as error:
            raise HTTPException(404, str(error)) from None
        raise HTTPException(404)


def _report(path: Path, name: str) -> str:
    """The report with the present name of the result, which may have been renamed."""
    shown = html.text(name)
    named = _NAME.sub(lambda found: f"{found[1]}, {shown}<", path.read_text(encoding="utf-8"), count=1)
    return _TITLE.sub(lambda _: f"<title>{shown}: fifthwheel</title>", named, count=1)


def _attached(name: str) -> dict[str, str]:
    return {"Content-Disposition": f'attachment; filename="{name}"', "Cache-Control": "no-store"}


def file_address(run: str, file: str) -> str:
    return f"/runs/{quote(run, safe='')}/{file}"


def show_report(run: str) -> None:
    frame = ui.element("iframe").classes("fw-report")
    frame.props["sandbox"] = "allow-scripts"
    frame.props["title"] = f"Report of {run}"
    frame.props["src"] = file_address(run, "report.html")
