"""Identification: settings, progress and report."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from html import escape
from pathlib import PurePosixPath
from typing import Any, get_args, get_origin, get_type_hints

from nicegui import ui

from fifthwheel.apps.app import inputs, jobs, known, layout, result_files, runs
from fifthwheel.apps.app.workspace import VEHICLE, Workspace
from fifthwheel.apps.workflow.start import starts_of
from fifthwheel.base.errors import FifthwheelError, printable
from fifthwheel.base.options import IdentifyOptions
from fifthwheel.base.settings import options_of
from fifthwheel.base.spelling import NAME_OF_RESULT, ONLY_PREDICT, question
from fifthwheel.estimate.identify.statement import parse
from fifthwheel.truck import Vehicle

KEY = "identify"
"""Of the job."""
_KNOWLEDGE = "A result of the same truck: begin with the information of its logs."
"""Help of the choice of an earlier result."""


def build(workspace: Workspace) -> None:
    truck = runs.vehicle(workspace)
    runs.logs(workspace, workspace.choices())
    _Settings(workspace, truck).build()
    _run(workspace)


class _Settings:
    """The fields of the settings; each is kept when it changes."""

    def __init__(self, workspace: Workspace, truck: Vehicle) -> None:
        self.workspace, self.truck = workspace, truck

    def build(self) -> None:
        used = inputs.used_logs(self.workspace)
        windows = sum(len(self.workspace.choices().of(name).exclude) for name in used)
        left_out = f" {windows} windows are left out." if windows else ""
        ui.label(f"Logs: {', '.join(map(printable, used))}.{left_out}")
        self._sentences()
        button = ui.button("Settings", icon="tune").props("outline no-caps")
        with ui.element("section").classes("fw-columns w-full").props('aria-label="Settings"') as fields:
            self._fields(used)

        def show(visible: bool) -> None:
            fields.visible = visible
            button.props["aria-expanded"] = str(visible).lower()

        button.on_click(lambda: show(not fields.visible))
        show(False)

    @ui.refreshable_method
    def _sentences(self) -> None:
        choices = self.workspace.choices()
        removable = {str(parse(text)): text for text in choices.identify.get(known.STATEMENTS, ())}
        with ui.element("ul").classes("fw-known").props('aria-label="What is known"'):
            for text in known.of_truck_and_sensors(self.workspace, self.truck):
                ui.html(escape(printable(text)), sanitize=False, tag="li")
            for statement, text in known.stated(self.workspace, choices).items():
                with ui.element("li"):
                    ui.label(printable(text))
                    if statement in removable:
                        button = ui.button(icon="close", on_click=partial(self._unstate, removable[statement]))
                        button.props("flat dense size=sm").props["aria-label"] = f"Remove: {printable(text)}"
            for text in known.changed_settings(choices):
                ui.html(escape(printable(text)), sanitize=False, tag="li")

    def _statement(self, label: str) -> None:
        with ui.element("div").classes("fw-question"):
            ui.label(label)
            name = ui.select(dict(known.numbers(self.workspace, self.truck)), label="Number", with_input=True)
            value = ui.input("What you know", placeholder="33.4 t +- 0.5 %")
            for field in (name, value):
                field.classes("w-full").props("dense outlined hide-bottom-space")

            def add() -> None:
                if name.value and value.value:
                    given = self._value(known.STATEMENTS, [])
                    stated = f"{name.value}={layout.with_decimal_points(value.value)}"
                    self._keep(known.STATEMENTS, [], [*given, stated])
                    name.value, value.value = None, ""

            ui.button("Add", icon="add", on_click=add).props("outline dense no-caps")
            ui.label(
                "A value, +- its sigma, or both; exact; or free, if nothing is known. "
                "road.friction is also dry, wet, snow or ice."
            ).classes("text-caption")

    def _unstate(self, text: str) -> None:
        self._keep(known.STATEMENTS, [], [each for each in self._value(known.STATEMENTS, []) if each != text])

    def _fields(self, used: Sequence[str]) -> None:
        for key, option in options_of(IdentifyOptions).items():
            kind, label = get_type_hints(IdentifyOptions)[key], question(key, option)
            help = option.help.removesuffix(".") + "."
            if key == known.STATEMENTS:
                self._statement(label)
            elif key == runs.KNOWLEDGE:
                results = {"": "the vehicle file"} | {name: name for name in runs.known_results(self.workspace)}
                self._choice(key, label, results, _KNOWLEDGE)
            elif option.choices:
                self._choice(key, label, option.choices, help)
            elif kind is bool:
                self._switch(key, label, getattr(IdentifyOptions, key), help)
            elif get_origin(kind) is tuple:
                self._list(key, label, [], help)
            elif str in get_args(kind):
                self._text(key, label, help)
            else:
                self._number(key, label, int in get_args(kind), help)
        self._list("validate", ONLY_PREDICT, list(used), "Logs for validation; the others are identified on.")

    def _keep(self, key: str, default: Any, value: Any) -> None:
        """Keep a setting that the options accept; a default is not written."""
        choices = self.workspace.choices()
        settings = {name: kept for name, kept in choices.identify.items() if name != key}
        if value not in (default, None):
            settings[key] = value
        if settings == choices.identify:
            return
        changed = choices.model_copy(update={"identify": settings})
        used, _ = runs.logs(self.workspace, changed)
        paths = [self.workspace.log(name) for name in used]
        starts_of(self.truck, runs.options(self.workspace, changed), paths)  # refuses what is wrong
        self.workspace.write_choices(changed, f"set {key.replace('_', ' ')}")
        layout.refresh_undo_buttons()
        self._sentences.refresh()

    def _value(self, key: str, default: Any) -> Any:
        return self.workspace.choices().identify.get(key, default)

    def _choice(self, key: str, label: str, choices: Mapping[str, str], help: str) -> None:
        first = next(iter(choices))
        value = self._value(key, first)
        with self._place(label, help) as named:
            self._bind(ui.select(dict(choices), value=value if value in choices else first), key, first, named)

    def _list(self, key: str, label: str, names: list[str], help: str) -> None:
        value = [text for text in self._value(key, []) if isinstance(text, str)]
        typed: dict[str, Any] = {} if names else {"new_value_mode": "add-unique"}
        known = list(dict.fromkeys([*names, *value]))
        with self._place(label, help) as named:
            field = ui.select(known, value=value, multiple=True, with_input=True, **typed)
            self._bind(field.props("use-chips"), key, [], named)

    def _text(self, key: str, label: str, help: str) -> None:
        with self._place(label, help) as named:
            self._bind(ui.input(value=self._value(key, "")).props("debounce=600"), key, "", named)

    def _number(self, key: str, label: str, whole: bool, help: str) -> None:
        def number(text: str) -> float | int | None:
            value = layout.typed_number(text)
            if whole and value is not None and value != round(value):
                raise FifthwheelError(f"{label}: expected a whole number, got {text}; correct it")
            return round(value) if whole and value is not None else value

        with self._place(label, help) as named:
            field = ui.input(value=layout.shown_number(self._value(key, None)))
            self._bind(field.props("clearable debounce=600 inputmode=decimal"), key, None, named, number)

    def _switch(self, key: str, label: str, default: bool, help: str) -> None:
        with self._place("", help):
            self._bind(ui.checkbox(label, value=bool(self._value(key, default))), key, default, label)

    @contextmanager
    def _place(self, label: str, help: str) -> Iterator[str]:
        """The place of a field below its label and above its explanation; gives the name for screen readers."""
        with ui.element("div").classes("fw-question"):
            if label:
                ui.label(label)
            yield f"{label}. {help}"
            ui.label(help).classes("text-caption")

    def _bind(
        self, field: Any, key: str, default: Any, named: str, convert: Callable[[Any], Any] = lambda value: value
    ) -> None:
        """Keep what is chosen; a choice that is refused is taken back."""
        field.props["aria-label"] = named
        if not isinstance(field, ui.checkbox):
            field.classes("w-full").props("dense outlined")

        async def change(event: Any) -> None:  # not within the event: NiceGUI would not send the value back
            try:
                self._keep(key, default, default if event.value in ("", None) else convert(event.value))
            except FifthwheelError:
                kept = self._value(key, default)
                field.set_value(layout.shown_number(kept) if isinstance(kept, float | int | None) else kept)
                raise

        field.on_value_change(change)


@ui.refreshable
def _run(workspace: Workspace) -> None:
    job = jobs.get(KEY)
    if job.running:
        layout.show_progress(KEY, partial(_ended, workspace))
    else:
        if job.state == "failed":
            layout.failure(job.error)
        elif job.state == "cancelled":
            ui.label("Cancelled; no result was changed.").props("role=status")
        with ui.row().classes("items-end"):
            made = job.product if job.unfinished else runs.next_name(workspace)
            name = ui.input(NAME_OF_RESULT, value=made).classes("fw-field")
            ui.button("Identify", icon="play_arrow", on_click=lambda: _start(workspace, name.value)).props("no-caps")
    for left in runs.interrupted(workspace) if not job.running else ():
        with ui.row().classes("items-center"):
            ui.label(f"{printable(left)}: interrupted before its end, without a result. Start it again, or delete it.")
            _delete_button(workspace, left)
    results = runs.results(workspace)
    if results:
        query = ui.context.client.request.query_params.get("run")
        _result(workspace, results, query if query in results else results[0])


async def _start(workspace: Workspace, name: str) -> None:
    plain, folder = plain_name(name), workspace.folder
    question = f"There is a result {plain} already. Replace it? This cannot be undone."
    if plain in runs.results(workspace) and not await layout.confirmed(question, "Replace"):
        return
    discard = partial(runs.discard_empty, folder, plain)
    jobs.start(KEY, runs.identify, folder, plain, product=plain, on_cancel=discard)
    _run.refresh()


def plain_name(name: str) -> str:
    """The name of a result, which stays in the folder of results; FifthwheelError for another one."""
    plain = printable(name).strip()
    if not plain or PurePosixPath(plain).name != plain or plain.startswith(".") or "\\" in plain or len(plain) > 80:
        raise FifthwheelError("name: expected letters, digits, spaces or -, without a slash; choose another one")
    return plain


def _ended(workspace: Workspace, job: jobs.Job) -> None:
    if job.state == "done":
        layout.say(f"{job.result}: done")
    _run.refresh()


def _result(workspace: Workspace, results: list[str], chosen: str) -> None:
    layout.heading("Report")
    with ui.row().classes("items-center"):
        select = ui.select(runs.labels(workspace), value=chosen, label="Result").classes("fw-field")
        select.on_value_change(lambda event: ui.navigate.to(f"?{layout.query(run=str(event.value))}"))
        ui.link("Open in a new tab", result_files.address(chosen, "report.html"), new_tab=True)
        for file in result_files.DATA:
            if (workspace.run(chosen) / file).is_file():
                ui.link(file, result_files.address(chosen, file))
        take = ui.button("Use the identified truck", on_click=lambda: _take(workspace, chosen))
        take.props("outline no-caps").tooltip("It replaces vehicle.toml; this can be undone")
        rename = ui.button("Rename", on_click=lambda: _rename(workspace, chosen)).props("outline no-caps")
        rename.props["aria-label"] = f"Rename {printable(chosen)}"
        _delete_button(workspace, chosen)
    result_files.show(chosen)


def _delete_button(workspace: Workspace, name: str) -> None:
    button = ui.button("Delete", on_click=lambda: _delete(workspace, name)).props("flat no-caps")
    button.props["aria-label"] = f"Delete {printable(name)}"


async def _delete(workspace: Workspace, name: str) -> None:
    if await layout.confirmed(f"Delete the result {name} with all its files? This cannot be undone.", "Delete"):
        workspace.remove_run(name)
        ui.navigate.to(layout.address("identify"))


async def _rename(workspace: Workspace, name: str) -> None:
    with ui.dialog() as dialog, ui.card():
        field = ui.input(f"New name of {printable(name)}", value=name).classes("fw-field")
        with ui.row():
            ui.button("Rename", on_click=lambda: dialog.submit(field.value)).props("no-caps")
            ui.button("Keep", on_click=lambda: dialog.submit(None)).props("outline no-caps")
    typed = await dialog
    if typed and (new := plain_name(typed)) != name:
        workspace.rename_run(name, new)
        ui.navigate.to(f"{layout.address('identify')}?{layout.query(run=new)}")


def _take(workspace: Workspace, name: str) -> None:
    text = (workspace.run(name) / VEHICLE).read_text(encoding="utf-8")
    workspace.write({VEHICLE: text}, f"use the truck of {name}")
    layout.reload(f"{VEHICLE} is the identified truck of {printable(name)} now.")
