"""What the logs can tell before an identification: predicted sigma of each parameter, and what would reduce it."""

from nicegui import ui

from fifthwheel.apps.app import documents, jobs, layout, runs
from fifthwheel.apps.app.workspace import Workspace
from fifthwheel.results.report.information import information_document


def build(workspace: Workspace) -> None:
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
    job = jobs.get(key)
    if job.state == "none":
        job = jobs.start(key, runs.check, workspace.folder)
    layout.show_progress(key, lambda _: _result.refresh())
    if job.state == "done":
        documents.show(*information_document(job.result).blocks)
        ui.link("Identify these logs", layout.address("identify"))
    elif not job.running:
        layout.failure(job.error or "The check was cancelled.")
        ui.button("Check again", on_click=lambda: _again(workspace, key)).props("outline no-caps")


def _again(workspace: Workspace, key: str) -> None:
    jobs.start(key, runs.check, workspace.folder)
    _result.refresh()
