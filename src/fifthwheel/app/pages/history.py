"""The truck's history: estimates over the dates of all logs that a result knows, and what each log added."""

from nicegui import ui

from fifthwheel.app import documents, jobs, layout, runs
from fifthwheel.app.workspace import Workspace


def build(workspace: Workspace) -> None:
    results = runs.known_results(workspace)
    if not results:
        layout.next_step("There is no result with knowledge of its logs yet; identify in one stage.", "identify")
        return
    query = ui.context.client.request.query_params.get("run")
    chosen = query if query in results else results[0]
    select = ui.select(results, value=chosen, label="Result").classes("fw-field")
    select.on_value_change(lambda event: ui.navigate.to(f"?{layout.query(run=str(event.value))}"))
    place = ui.column().classes("w-full")
    with place:
        ui.spinner(size="2em").props('role=status aria-label="Combining the logs"')

    async def show() -> None:
        computed = jobs.compute(runs.history, workspace.folder, chosen)
        await layout.fill(place, computed, lambda found: documents.show(*found.blocks))

    ui.timer(0, show, once=True)
