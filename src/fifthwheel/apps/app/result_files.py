"""The report of a result in a frame without rights, and the files of a result."""

import re
from pathlib import Path
from typing import Annotated
from urllib.parse import quote

from fastapi import HTTPException, Query
from fastapi.responses import FileResponse, HTMLResponse, Response
from nicegui import app, ui

from fifthwheel.apps.app import runs
from fifthwheel.apps.app.words import page_in_workbench
from fifthwheel.apps.app.workspace import Workspace
from fifthwheel.base.errors import FifthwheelError
from fifthwheel.base.pages import html
from fifthwheel.results.report import comparison_page

DATA = ("vehicle.toml", "identification.json", "states.parquet")
"""What can be downloaded of a result."""
FILES = ("report.html", *DATA)
"""What can be asked for."""
SANDBOX = "sandbox allow-scripts"
"""The report draws its plots, but cannot read or change anything else."""


_NAME = re.compile(r'(<h1>[^<]*<span class="result">)[^<]*<')
_TITLE = re.compile("<title>[^<]*</title>")


def register(folder: Path) -> None:
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
    return page_in_workbench(_TITLE.sub(lambda _: f"<title>{shown}: fifthwheel</title>", named, count=1))


def _attached(name: str) -> dict[str, str]:
    return {"Content-Disposition": f'attachment; filename="{name}"', "Cache-Control": "no-store"}


def address(run: str, file: str) -> str:
    return f"/runs/{quote(run, safe='')}/{file}"


def show(run: str) -> None:
    frame = ui.element("iframe").classes("fw-report")
    frame.props["sandbox"] = "allow-scripts"
    frame.props["title"] = f"Report of {run}"
    frame.props["src"] = address(run, "report.html")
