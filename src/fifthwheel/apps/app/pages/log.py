"""The logs of the workspace: what they contain, plots of their channels, and windows that are left out."""

from functools import partial
from typing import Any

from nicegui import events, ui

from fifthwheel.apps.app import documents, inputs, jobs, layout
from fifthwheel.apps.app.pages.log_channels import channels
from fifthwheel.apps.app.workspace import Workspace
from fifthwheel.base.errors import printable


def build(workspace: Workspace) -> None:
    _Page(workspace).build()


class _Page:
    """The dropped files, and the channels of one of them."""

    def __init__(self, workspace: Workspace) -> None:
        self.workspace = workspace
        self._query = ui.context.client.request.query_params
        self._shown: str | None = None

    def build(self) -> None:
        ui.label(
            "Drop logs here: CSV, Parquet, MF4, MATLAB, MCAP or CAN traces; DBC and ARXML files decode CAN frames. "
            f"They are copied to {self.workspace.folder}."
        )
        upload = ui.upload(multiple=True, auto_upload=True, label="Drop files, or pick them with +")
        upload.classes("w-full").props('aria-label="Drop files, or pick them"')
        upload.on_upload(self._keep)
        # Not `reset`, which aborts an upload that the browser has not heard the answer of, so that it counts as failed.
        upload.on("uploaded", lambda: upload.run_method("removeUploadedFiles"), args=[])
        upload.on("failed", lambda: layout.say("Refused: too large, or there is no space."), args=[])
        documents.preload()
        self._logs()
        self._channels()

    def refresh(self) -> None:
        """Show the list of logs anew; the plot stays unless another log is shown."""
        self._logs.refresh()
        if self._chosen() != self._shown:
            self._channels.refresh()

    async def _keep(self, event: events.UploadEventArguments) -> None:
        self.workspace.require_space(event.file.size())
        part = self.workspace.part()
        try:
            await event.file.save(part)
            path = self.workspace.keep(part, event.file.name)
        finally:
            part.unlink(missing_ok=True)
        if path.name != event.file.name:
            layout.say(f"{printable(event.file.name)}: kept as {path.name}")
        self.refresh()

    def _chosen(self) -> str | None:
        """The log of the address, else the first that has been read."""
        known = [path.name for path in self.workspace.logs() if inputs.is_stored(self.workspace, path.name)]
        asked = self._query.get("log")
        return asked if asked in known else next(iter(known), None)

    @ui.refreshable_method
    def _logs(self) -> None:
        databases = self.workspace.databases()
        if databases:
            ui.label(f"CAN databases: {', '.join(path.name for path in databases)}")
        logs = [path.name for path in self.workspace.logs()]
        if not logs:
            ui.label("No log yet.")
            return
        _read_next(self.workspace, logs)
        self._leave_out_unreadable(logs)
        chosen = self._chosen()
        with ui.element("div").classes("fw-scroll fw-logs"), ui.element("table").props('aria-label="Logs"'):
            for name in logs:
                self._row(name, chosen=name == chosen)
        for name in logs:
            layout.show_progress(_key(name), lambda job: self.refresh())

    def _leave_out_unreadable(self, logs: list[str]) -> None:
        """Untick the logs that cannot be read, so that no check or identification needs them."""
        for name in logs:
            job, choices = jobs.get(_key(name)), self.workspace.choices()
            if job.state == "failed" and choices.of(name).use:
                self.workspace.write_choices(choices.with_log(name, use=False), f"leave out {name}")
                layout.refresh_undo_buttons()

    @ui.refreshable_method
    def _channels(self) -> None:
        self._shown = self._chosen()
        if self._shown is not None:
            asked = self._query.getlist("channel") if self._query.get("log") == self._shown else []
            channels(self.workspace, self._shown, asked)

    def _row(self, name: str, *, chosen: bool) -> None:
        """A log of the list: whether it is used, its name, its length, and what can be done with it."""
        choices, job = self.workspace.choices(), jobs.get(_key(name))

        def use(event: events.ValueChangeEventArguments[Any]) -> None:
            label = f"{'use' if event.value else 'leave out'} {name}"
            self.workspace.write_choices(self.workspace.choices().with_log(name, use=event.value), label)

        with ui.element("tr"):
            with ui.element("td"):
                box = ui.checkbox(value=choices.of(name).use, on_change=use)
                box.props["aria-label"] = f"Use {name}"
                box.set_enabled(job.state != "failed")
            with ui.element("td"):
                link = ui.link(name, f"?{layout.query(log=name)}")
                if chosen:
                    link.props("aria-current=true").classes("text-weight-bold")
            with ui.element("td"):
                if job.unfinished:
                    layout.failure(job.error or "reading was cancelled")
                elif inputs.is_stored(self.workspace, name):
                    survey = inputs.survey(self.workspace, name)
                    if survey.start <= survey.stop:
                        ui.label(f"{survey.stop - survey.start:.1f} s, {len(survey.contents)} channels")
                    else:
                        self._ask_for_time(name, list(survey.contents))
                else:
                    ui.label("waits to be read")
            with ui.element("td"):
                if job.unfinished:
                    ui.button("Read again", on_click=partial(self._read_again, name)).props("flat dense no-caps")
                remove = ui.button("Remove", on_click=partial(self._ask_to_remove, name))
                remove.props("flat dense no-caps").props["aria-label"] = f"Remove {name}"

    def _ask_for_time(self, name: str, columns: list[str]) -> None:
        """A field for the time column, where no column has the name of a time."""

        def choose(event: events.ValueChangeEventArguments[Any]) -> None:
            label = f"time of {name}: {event.value}"
            self.workspace.write_choices(self.workspace.choices().with_log(name, time=event.value), label)
            self.refresh()

        layout.failure("No column has the name of a time. Choose the column with the seconds:")
        field = ui.select(columns, label="Time column", with_input=True, on_change=choose).props("dense")
        field.props["aria-label"] = f"Time column of {name}"

    def _read_again(self, name: str) -> None:
        self.workspace.write_choices(self.workspace.choices().with_log(name, use=True), f"use {name}")
        jobs.start(_key(name), inputs.store, self.workspace.folder, name)
        self.refresh()

    async def _ask_to_remove(self, name: str) -> None:
        """Remove a log after a question, because this cannot be undone."""
        question = f"Delete {name} from {self.workspace.folder / 'logs'}? This cannot be undone."
        if await layout.confirmed(question, "Delete"):
            jobs.get(_key(name)).cancel()
            try:
                self.workspace.remove_log(name)
            finally:
                self.refresh()


def _read_next(workspace: Workspace, logs: list[str]) -> None:
    """Read the first log that has not been read, unless one is being read: reading needs memory."""
    states = {name: jobs.get(_key(name)) for name in logs}
    if any(job.running for job in states.values()):
        return
    for name, job in states.items():
        if job.state in ("none", "done") and not inputs.is_stored(workspace, name):
            jobs.start(_key(name), inputs.store, workspace.folder, name)
            return


def _key(name: str) -> str:
    return f"read {name}"
