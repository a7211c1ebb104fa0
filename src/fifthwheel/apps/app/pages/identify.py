"""What the logs can tell before an identification, what is known then, and the identification itself."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from html import escape
from pathlib import Path, PurePosixPath
from typing import Any, get_args, get_origin, get_type_hints

from nicegui import ui

from fifthwheel.apps.app import documents, jobs, layout, runs
from fifthwheel.apps.app.workspace import SIGNALS, VEHICLE, Choices, Workspace
from fifthwheel.apps.workflow.start import starts_of
from fifthwheel.base.errors import FifthwheelError, SignalError, printable
from fifthwheel.base.formatting import enumerated
from fifthwheel.base.options import IdentifyOptions
from fifthwheel.base.settings import options_of
from fifthwheel.base.spelling import NAME_OF_RESULT, ONLY_PREDICT, question
from fifthwheel.data.channels import SignalName, error_kinds, is_sensor_error
from fifthwheel.estimate.identify import OneStage
from fifthwheel.estimate.identify.given import possible_names
from fifthwheel.estimate.identify.setup import with_tyre_law
from fifthwheel.estimate.identify.statement import GROUPS, Statement, parse
from fifthwheel.results.report.information import information_document
from fifthwheel.truck import Vehicle
from fifthwheel.truck.spoken_names import spoken

KEY = "identify"
"""Of the job."""
MANY = {**GROUPS, "*": "All numbers"}
STATEMENTS = "statements"
"""The option whose texts `stated_numbers` turns into sentences."""


def build_check(workspace: Workspace) -> None:
    ui.label(
        "The sigma that an identification of the logs would reach for each parameter, predicted from the vehicle file "
        "without a fit, and what would reduce it. The settings are those of the page Identify."
    )
    runs.logs(workspace, workspace.choices())
    runs.vehicle(workspace)
    _check_result(workspace)


@ui.refreshable
def _check_result(workspace: Workspace) -> None:
    """The check of the present files; it is computed if there is none."""
    key = f"check {runs.stamp(workspace)}"
    job = jobs.get(key)
    if job.state == "none":
        job = jobs.start(key, runs.check, workspace.folder)
    layout.show_progress(key, lambda _: _check_result.refresh())
    if job.state == "done":
        documents.show(*information_document(job.result).blocks)
        ui.link("Identify these logs", layout.address("identify"))
    elif not job.running:
        layout.failure(job.error or "The check was cancelled.")
        ui.button("Check again", on_click=lambda: _check_again(workspace, key)).props("outline no-caps")


def _check_again(workspace: Workspace, key: str) -> None:
    jobs.start(key, runs.check, workspace.folder)
    _check_result.refresh()


def of_truck_and_sensors(workspace: Workspace, truck: Vehicle) -> list[str]:
    """What vehicle file and signal map state."""
    assumed = len(truck.assumed)
    numbers = f"{assumed} numbers are not in its file and are assumed" if assumed else "no number is assumed"
    said = [f"Truck: {truck.name}; {numbers}."]
    sensors = workspace.signal_map().sensors
    for name, sensor in sensors.items():
        kind = f"a sensor of the class {sensor.sensor_class}" if sensor.sensor_class else f"errors of {SIGNALS}"
        said.append(f"{spoken(name)}: {kind}.")
    others = "All other sensors" if sensors else "Sensors"
    return [*said, f"{others}: the usual errors and noise of their kind."]


def stated_numbers(workspace: Workspace, choices: Choices) -> dict[str, str]:
    """Sentences of what the user states of numbers, by the texts of the statements."""
    return {
        str(statement): _sentence(statement) for statement in map(parse, runs.options(workspace, choices).statements)
    }


def _sentence(statement: Statement) -> str:
    if statement.kind == "free":
        return f"{words_of(statement.name)}: unknown; only the logs determine it."
    spread = {"exact": "exact", "sigma": f"± {statement.sigma}"}.get(statement.kind, "")
    mark = ", " if statement.value and statement.kind == "exact" else " "
    return f"{words_of(statement.name)}: {mark.join(part for part in (str(statement.value), spread) if part)}."


def words_of(name: str) -> str:
    """A number, or many of them, in words.

    >>> words_of("steer.*.delay"), words_of("sensors"), words_of("tractor.mass")
    ('All sensors, steer angle delay', 'All errors of the sensors and clocks', 'Tractor, mass')
    """
    return MANY.get(name) or spoken(name).replace("*,", "All sensors,", 1)


def changed_settings(choices: Choices) -> list[str]:
    """The other settings that are not the default."""
    said = []
    for key, option in options_of(IdentifyOptions).items():
        value = choices.identify.get(key)
        if value is None or key == STATEMENTS:
            continue
        label = question(key, option)
        if isinstance(value, bool):
            said.append(f"{label}: {'yes' if value else 'no'}.")
        else:
            chosen = enumerated([str(each) for each in value]) if isinstance(value, list | tuple) else str(value)
            said.append(f"{label}: {option.choices.get(chosen, chosen)}.")
    if validate := choices.identify.get("validate"):
        said.append(f"{ONLY_PREDICT}: {enumerated([Path(name).name for name in validate])}.")
    return said


def numbers(workspace: Workspace, truck: Vehicle) -> Mapping[str, str]:
    """The numbers that a user can state: names with their words, those that are estimated first."""
    signals = workspace.signal_map().signals
    errors = [f"{signal}.{kind}" for signal in signals for kind in error_kinds(signal)]
    possible = possible_names(truck, with_tyre_law(truck, OneStage())[0])
    kinds = [f"{SignalName.of(signal).quantity}.*.{kind}" for signal in signals for kind in error_kinds(signal)]
    names = (
        *(name for name in possible if not is_sensor_error(name)),
        *truck.moved_by_wheelbase(),
        *errors,
        *kinds,
        *MANY,
    )
    return {name: f"{words_of(name)} ({name})" for name in dict.fromkeys(names)}


def build(workspace: Workspace) -> None:
    truck = runs.vehicle(workspace)
    runs.logs(workspace, workspace.choices())
    with ui.expansion("Logs, what is known, and settings", value=not runs.results(workspace)).classes("w-full"):
        _Settings(workspace, truck).build()
    _run(workspace)


class _Settings:
    """The fields of the settings; each is kept when it changes."""

    def __init__(self, workspace: Workspace, truck: Vehicle) -> None:
        self.workspace, self.truck = workspace, truck

    def build(self) -> None:
        used = runs.used_logs(self.workspace)
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
        removable = {str(parse(text)): text for text in choices.identify.get(STATEMENTS, ())}
        with ui.element("ul").classes("fw-known").props('aria-label="What is known"'):
            for text in of_truck_and_sensors(self.workspace, self.truck):
                ui.html(escape(printable(text)), sanitize=False, tag="li")
            for statement, text in stated_numbers(self.workspace, choices).items():
                with ui.element("li"):
                    ui.label(printable(text))
                    if statement in removable:
                        button = ui.button(icon="close", on_click=partial(self._unstate, removable[statement]))
                        button.props("flat dense size=sm").props["aria-label"] = f"Remove: {printable(text)}"
            for text in changed_settings(choices):
                ui.html(escape(printable(text)), sanitize=False, tag="li")

    def _statement(self, label: str) -> None:
        with ui.element("div").classes("fw-question"):
            ui.label(label)
            known = dict(numbers(self.workspace, self.truck))
            typed: dict[str, Any] = {"new_value_mode": "add-unique", "key_generator": str}  # such as the end of a path
            name = ui.select(known, label="Number", with_input=True, **typed)
            value = ui.input("What you know", placeholder="33.4 t +- 0.5 %")
            for field in (name, value):
                field.classes("w-full").props("dense outlined hide-bottom-space")

            def add() -> None:
                if not (name.value and value.value):
                    raise SignalError("Number: pick one, or type a name and press Enter; then say what you know")
                given = self._value(STATEMENTS, [])
                self._keep(STATEMENTS, [], [*given, f"{name.value}={layout.with_decimal_points(value.value)}"])
                name.value, value.value = None, ""

            ui.button("Add", icon="add", on_click=add).props("outline dense no-caps")
            ui.label(
                "A value, +- its sigma, or both; exact; or free, if nothing is known. "
                "road.friction is also dry, wet, snow or ice."
            ).classes("text-caption")

    def _unstate(self, text: str) -> None:
        self._keep(STATEMENTS, [], [each for each in self._value(STATEMENTS, []) if each != text])

    def _fields(self, used: Sequence[str]) -> None:
        for key, option in options_of(IdentifyOptions).items():
            kind, label, choices = get_type_hints(IdentifyOptions)[key], question(key, option), option.choices
            help = "" if choices else f"{option.help.removesuffix('.')}."  # which names the choices of the command line
            if key == runs.KNOWLEDGE:
                choices = {"": "the vehicle file"} | {name: name for name in runs.known_results(self.workspace)}
                help = "A result of the same truck: begin with the information of its logs."
            if key == STATEMENTS:
                self._statement(label)
            elif choices:
                self._question(key, label, help, next(iter(choices)), partial(_choice, choices))
            elif kind is bool:
                self._question(key, label, help, getattr(IdentifyOptions, key), partial(_switch, label))
            elif get_origin(kind) is tuple:
                self._question(key, label, help, [], partial(_several, ()))
            elif str in get_args(kind):
                self._question(key, label, help, "", _text)
            else:
                self._question(key, label, help, None, _number, partial(_whole_number, label))
        logs = "Logs for validation; the others are identified on."
        self._question("validate", ONLY_PREDICT, logs, [], partial(_several, used))

    def _question(
        self,
        key: str,
        label: str,
        help: str,
        default: Any,
        make: Callable[[Any], Any],
        convert: Callable[[Any], Any] = lambda value: value,
    ) -> None:
        """A field below its label and above its explanation; a choice that is refused is taken back."""
        switch = isinstance(default, bool)  # which has its label beside it
        with ui.element("div").classes("fw-question"):
            if not switch:
                ui.label(label)
            field = make(self._value(key, default))
            if help:
                ui.label(help).classes("text-caption")
        field.props["aria-label"] = label if switch else f"{label}. {help}".rstrip()
        if not switch:
            field.classes("w-full").props("dense outlined")

        async def change(event: Any) -> None:  # not within the event: NiceGUI would not send the value back
            try:
                self._keep(key, default, default if event.value in ("", None) else convert(event.value))
            except FifthwheelError:
                kept = self._value(key, default)
                field.set_value(layout.shown_number(kept) if isinstance(kept, float | int | None) else kept)
                raise

        field.on_value_change(change)

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


def _choice(choices: Mapping[str, str], value: Any) -> ui.select:
    return ui.select(dict(choices), value=value if value in choices else next(iter(choices)))


def _switch(label: str, value: Any) -> ui.checkbox:
    return ui.checkbox(label, value=bool(value))


def _several(names: Sequence[str], value: Any) -> ui.select:
    """Some of the names; of no names, any texts."""
    chosen = [text for text in value if isinstance(text, str)]
    typed: dict[str, Any] = {} if names else {"new_value_mode": "add-unique"}
    known = list(dict.fromkeys([*names, *chosen]))
    return ui.select(known, value=chosen, multiple=True, with_input=True, **typed).props("use-chips")


def _text(value: Any) -> ui.input:
    return ui.input(value=value).props("debounce=600")


def _number(value: Any) -> ui.input:
    return ui.input(value=layout.shown_number(value)).props("clearable debounce=600 inputmode=decimal")


def _whole_number(label: str, text: str) -> int | None:
    value = layout.typed_number(text)
    if value is not None and value != round(value):
        raise FifthwheelError(f"{label}: expected a whole number, got {text}; correct it")
    return None if value is None else round(value)


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
    with ui.row().classes("items-center"):
        select = ui.select(runs.labels(workspace), value=chosen, label="Result").classes("fw-field")
        select.on_value_change(lambda event: ui.navigate.to(f"?{layout.query(run=str(event.value))}"))
        take = ui.button("Use the identified truck", on_click=lambda: _take(workspace, chosen))
        take.props("outline no-caps").tooltip("It replaces vehicle.toml; this can be undone")
    with layout.part("Report", begins=True):
        documents.show_report(chosen)
    with ui.row().classes("items-center"):
        ui.link("Open in a new tab", documents.file_address(chosen, "report.html"), new_tab=True)
        for file in documents.DATA:
            if (workspace.run(chosen) / file).is_file():
                ui.link(file, documents.file_address(chosen, file))
        rename = ui.button("Rename", on_click=lambda: _rename(workspace, chosen)).props("outline no-caps")
        rename.props["aria-label"] = f"Rename {printable(chosen)}"
        _delete_button(workspace, chosen)


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
