"""What the logs can tell before an identification: predicted sigma of each parameter, and what would reduce it."""

from html import escape

from nicegui import ui

from fifthwheel.app import jobs, layout, progress, runs, tables
from fifthwheel.app.workspace import Workspace
from fifthwheel.formatting import relative, with_sigma
from fifthwheel.identify.design.assess import InformationAssessment, ParameterAssessment
from fifthwheel.report.text import information
from fifthwheel.report.text.words import spoken_verdict


def build(workspace: Workspace) -> None:
    """Fill the page."""
    ui.label(
        "The sigma that an identification of the logs would reach for each parameter, predicted from the vehicle file "
        "without a fit, and what would reduce it. The settings are those of the page Identify."
    )
    runs.logs(workspace, workspace.choices())
    runs.vehicle(workspace)
    _result(workspace)


@ui.refreshable
def _result(workspace: Workspace) -> None:
    """The check of the present files; it is computed if there is none."""
    key = f"check {runs.stamp(workspace)}"
    job = jobs.get(key) or jobs.start(key, runs.check, workspace.folder)
    progress.show(key, lambda _: _result.refresh())
    if job.state == "done":
        _show(job.result)
    elif not job.running:
        layout.failure(job.error or "The check was cancelled.")
        ui.button("Check again", on_click=lambda: _again(workspace, key)).props("outline no-caps")


def _again(workspace: Workspace, key: str) -> None:
    jobs.start(key, runs.check, workspace.folder)
    _result.refresh()


def _show(outlook: InformationAssessment) -> None:
    ui.label(information.headline(outlook)).classes("text-weight-bold").props("role=status")
    tables.texts("Errors in the logs", information.errors(outlook))
    ui.html(_bars(outlook), sanitize=False).classes("fw-scroll fw-table")
    tables.texts("What would help", information.improvements(outlook))
    tables.texts("Strongly correlated", information.separation(outlook))
    tables.texts("Cautions", information.warnings(outlook))
    tables.texts("Notes", [*outlook.notes, *information.notes(outlook)])
    ui.link("Identify these logs", layout.address("identify"))


def _bars(outlook: InformationAssessment) -> str:
    """A row for each parameter: its prior sigma, and the predicted one, as bars of up to 100 % of its value."""
    heads = "".join(
        f'<th scope="col"{css}>{head}</th>'
        for head, css in (
            ("Parameter", ""),
            ("Value", _LESS),
            ("Prior", _LESS),
            ("Predicted", _RIGHT),
            ("Prior and predicted sigma", ""),
            ("Verdict", ""),
        )
    )
    rows = "".join(map(_row, outlook.parameters))
    return f'<table aria-label="Predicted sigma"><thead><tr>{heads}</tr></thead><tbody>{rows}</tbody></table>'


_RIGHT, _LESS = ' class="fw-right"', ' class="fw-right fw-wide"'
"""Numbers; the second are left out on a narrow screen."""


def _row(p: ParameterAssessment) -> str:
    known = information.is_identifiable(p)
    prior, predicted = (min(sigma / abs(p.value), 1.0) if p.value else 1.0 for sigma in (p.prior, p.sigma))
    bar = (
        f'<div class="fw-bar" aria-hidden="true"><span class="prior" style="width: {100 * prior:.1f}%"></span>'
        f'<span class="predicted" style="width: {100 * predicted if known else 0:.1f}%"></span></div>'
    )
    texts = (
        with_sigma(p.value, None, p.unit),
        f"±{relative(p.value, p.prior)}",
        f"±{relative(p.value, p.sigma)}" if known else "–",
    )
    classes = (_LESS, _LESS, _RIGHT)
    cells = "".join(f"<td{css}>{escape(text)}</td>" for text, css in zip(texts, classes, strict=True))
    verdict = escape(spoken_verdict(p.verdict, predicted=True))
    return f"<tr><td>{tables.name(p.name)}</td>{cells}<td>{bar}</td><td>{verdict}</td></tr>"
