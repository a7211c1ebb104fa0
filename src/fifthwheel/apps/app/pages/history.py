"""The truck's history: estimates over the dates of all logs that a result knows, and what each log added."""

from functools import partial

from nicegui import ui

from fifthwheel.apps.app import documents, jobs, layout, runs
from fifthwheel.apps.app.workspace import Workspace


def build(workspace: Workspace) -> None:
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
