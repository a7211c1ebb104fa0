"""The logs of the workspace: what they contain, plots of their channels, and windows that are left out."""

from functools import partial
from typing import Any

from nicegui import events, ui

from fifthwheel.app import inputs, jobs, layout, progress
from fifthwheel.app.pages.log_channels import channels
from fifthwheel.app.workspace import Workspace
from fifthwheel.errors import printable


def build(workspace: Workspace) -> None:
    """Fill the page."""
    ui.label(
        "Drop logs here: CSV, Parquet, MF4, MATLAB, MCAP or CAN traces; DBC and ARXML files decode CAN frames. "
        f"They are copied to {workspace.folder}."
    )
    upload = ui.upload(multiple=True, auto_upload=True, label="Drop files, or pick them with +")
    upload.classes("w-full").props('aria-label="Drop files, or pick them"')
    upload.on_upload(lambda event: _keep(workspace, event))
    upload.on_multi_upload(lambda: (upload.reset(), _logs.refresh()))
    upload.on("failed", lambda: layout.say("Refused: too large, or there is no space."))
    _logs(workspace)


async def _keep(workspace: Workspace, event: events.UploadEventArguments) -> None:
    """Keep a dropped file; it appears under its name when it is complete."""
    path = workspace.place_for(event.file.name)
    workspace.require_space(event.file.size())
    part = path.with_name(f".{path.name}.part")
    try:
        await event.file.save(part)
        part.rename(path)
    finally:
        part.unlink(missing_ok=True)
    if path.name != event.file.name:
        layout.say(f"{printable(event.file.name)}: kept as {path.name}")


@ui.refreshable
def _logs(workspace: Workspace) -> None:
    """The list of logs, the reading of those that are new, and the chosen log."""
    databases = workspace.databases()
    if databases:
        ui.label(f"CAN databases: {', '.join(path.name for path in databases)}")
    logs = [path.name for path in workspace.logs()]
    if not logs:
        ui.label("No log yet.")
        return
    _read_next(workspace, logs)
    query = ui.context.client.request.query_params
    known = [name for name in logs if inputs.stored_folder(workspace, name).exists()]
    chosen = query.get("log") if query.get("log") in known else next(iter(known), None)
    with ui.element("div").classes("fw-scroll"), ui.element("table").props('aria-label="Logs"'):
        for name in logs:
            _log_row(workspace, name, chosen=name == chosen)
    for name in logs:
        progress.show(_key(name), lambda job: _logs.refresh())
    if chosen is not None:
        channels(workspace, chosen, query.getlist("channel") if query.get("log") == chosen else [])


def _log_row(workspace: Workspace, name: str, *, chosen: bool) -> None:
    """A log of the list: whether it is used, its name, its length, and what can be done with it."""
    choices, job = workspace.choices(), jobs.get(_key(name))

    def use(event: events.ValueChangeEventArguments[Any]) -> None:
        label = f"{'use' if event.value else 'leave out'} {name}"
        workspace.write_choices(workspace.choices().with_log(name, use=event.value), label)

    with ui.element("tr"):
        with ui.element("td"):
            box = ui.checkbox(value=choices.of(name).use, on_change=use)
            box.props["aria-label"] = f"Use {name}"
        with ui.element("td"):
            link = ui.link(name, f"?{layout.query(log=name)}")
            if chosen:
                link.props("aria-current=true").classes("text-weight-bold")
        with ui.element("td"):
            if job is not None and job.state in ("failed", "cancelled"):
                layout.failure(job.error or "reading was cancelled")
            elif inputs.stored_folder(workspace, name).exists():
                survey = inputs.survey(workspace, name)
                ui.label(f"{survey.stop - survey.start:.1f} s, {len(survey.contents)} channels")
            else:
                ui.label("waits to be read")
        with ui.element("td"):
            if job is not None and job.state in ("failed", "cancelled"):
                ui.button("Read again", on_click=partial(_read_again, workspace, name)).props("flat dense no-caps")
            remove = ui.button("Remove", on_click=partial(_ask_to_remove, workspace, name))
            remove.props("flat dense no-caps").props["aria-label"] = f"Remove {name}"


def _read_next(workspace: Workspace, logs: list[str]) -> None:
    """Read the first log that has not been read, unless one is being read: reading needs memory."""
    states = {name: jobs.get(_key(name)) for name in logs}
    if any(job is not None and job.running for job in states.values()):
        return
    for name, job in states.items():
        if job is None and not inputs.stored_folder(workspace, name).exists():
            jobs.start(_key(name), inputs.store, workspace.folder, name)
            return


def _read_again(workspace: Workspace, name: str) -> None:
    jobs.start(_key(name), inputs.store, workspace.folder, name)
    _logs.refresh()


async def _ask_to_remove(workspace: Workspace, name: str) -> None:
    """Remove a log after a question, because this cannot be undone."""
    with ui.dialog() as dialog, ui.card():
        ui.label(f"Delete {name} from {workspace.folder / 'logs'}? This cannot be undone.")
        with ui.row():
            ui.button("Delete", on_click=lambda: dialog.submit(True)).props("color=negative")
            ui.button("Keep", on_click=lambda: dialog.submit(False)).props("outline autofocus")
    if await dialog:
        job = jobs.get(_key(name))
        if job is not None:
            job.cancel()
        try:
            workspace.remove_log(name)
        finally:
            _logs.refresh()


def _key(name: str) -> str:
    return f"read {name}"
