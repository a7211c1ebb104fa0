"""The truck: its vehicle file, and the questions whose answers describe it, with a drawing to scale."""

from collections.abc import Mapping
from contextlib import suppress
from functools import partial
from typing import Any

from nicegui import events, ui

from fifthwheel.apps.app import documents, jobs, layout
from fifthwheel.apps.app.workspace import CHOICES, VEHICLE, Workspace
from fifthwheel.apps.workflow.new_vehicle import QUESTIONS, Question, new_vehicle
from fifthwheel.base.errors import FifthwheelError, VehicleError, printable
from fifthwheel.base.input_files import MAX_TOML_SIZE
from fifthwheel.estimate.identify.knowledge.load import with_payload
from fifthwheel.model.dynamics.summary import summarize
from fifthwheel.results.diagnose.predictions import assumed_numbers
from fifthwheel.results.report.vehicle import NOTHING_ASSUMED, assumed_blocks
from fifthwheel.truck import Vehicle, catalogue, unit_of
from fifthwheel.truck.spoken_names import named_unit, spoken
from fifthwheel.truck.toml_format import read_quantity
from fifthwheel.truck.weighing import unusual_masses

DESCRIBED = "described"
"""Of the element with the drawing, to which the questions refer."""
DETAILS = ("fifth_wheel_height", "load_height", "load_width", "floor_height", "load_shape", "trailer_tyres")
"""Questions that are folded away below the others."""
UNKNOWN = ""
"""The answer of a question that is left open."""
_BY_KEY: Mapping[str, Question] = {question.key: question for question in QUESTIONS}


def build(workspace: Workspace) -> None:
    current = workspace.vehicle()
    with ui.element("div").classes("fw-truck"):
        with ui.element("section").classes("fw-file").props('aria-label="Vehicle file"'):
            layout.heading("Vehicle file")
            _files(workspace, current)
            if current is None:
                ui.label("None yet. Answer the questions, import a file, or take a published vehicle.")
            else:
                _draw(current)
                for warning in unusual_masses(current):
                    layout.failure(warning)
                if any(unit.payload for unit in current.units):
                    with ui.expansion("Loads").classes("w-full"):
                        _loads(workspace, current)
                with ui.expansion("Handling").classes("w-full"):
                    _numbers(current)
                _assumed(current)
        with ui.element("section").classes("fw-form").props(f'aria-label="Questions" aria-details={DESCRIBED}'):
            asked = current is None or _new_text(workspace) not in (None, workspace.read(VEHICLE))
            with ui.expansion("Describe a tractor and its semitrailer", value=asked).classes("w-full"):
                ui.label(
                    "Answer what you know, with a unit and how well you know it, such as 7.7 m +- 2 cm. Leave the rest "
                    "open: published vehicles give the missing numbers, with their uncertainty. * needed"
                )
                state(workspace)
                _questions(workspace)
        with ui.element("section").classes("fw-preview").props(f'aria-label="Described truck" id={DESCRIBED}'):
            preview(workspace)


def _files(workspace: Workspace, current: Vehicle | None) -> None:
    def taken(text: str, label: str) -> None:
        """Replace the vehicle file; the answers to the questions go, because they describe another truck."""
        name = printable(Vehicle.loads(text).name)  # refuses what is not a vehicle
        choices = workspace.choices()
        workspace.write({VEHICLE: text, CHOICES: choices.model_copy(update={"truck": {}}).text()}, label)
        cleared = " The answers to the questions are cleared; undo restores them." if choices.truck else ""
        layout.reload(f"The vehicle file is {name} now.{cleared}")

    async def imported(event: events.UploadEventArguments) -> None:
        if event.file.size() > MAX_TOML_SIZE:
            raise VehicleError(f"{event.file.name}: larger than {MAX_TOML_SIZE // 1000} kB; not a vehicle file")
        text = await event.file.text()
        taken(text, f"import {event.file.name}")

    def published(event: events.ValueChangeEventArguments[Any]) -> None:
        taken(catalogue.text(event.value), f"use {event.value}")

    with ui.row().classes("items-center"):
        upload = ui.upload(on_upload=imported, auto_upload=True, max_files=1).classes("hidden").props("accept=.toml")
        ui.button("Import", icon="upload_file", on_click=lambda: upload.run_method("pickFiles")).props(
            "outline no-caps"
        ).tooltip("A vehicle file, TOML")
        if current is not None:
            text = workspace.read(VEHICLE) or ""
            ui.button("Export", icon="download", on_click=lambda: ui.download.content(text.encode(), VEHICLE)).props(
                "outline no-caps"
            ).tooltip("vehicle.toml")
        ui.select(list(catalogue.names()), label="Published vehicle", on_change=published).classes("fw-field").props(
            "dense"
        )


def _draw(vehicle: Vehicle) -> None:
    """The truck to scale, with the legend clear of the axis."""
    element = documents.show_plot(vehicle.plot(), height=400)
    element.figure["layout"]["legend"]["y"] = -0.22
    element.update()


def _numbers(vehicle: Vehicle) -> None:
    try:
        summary = summarize(vehicle)
    except FifthwheelError as error:
        layout.failure(str(error))
        return
    documents.show(summary.table(summary.at_speed))


def _loads(workspace: Workspace, vehicle: Vehicle) -> None:
    """A field for each number of the load of each unit; an answer is written to the vehicle file at once."""

    def keep(path: str, field: ui.input) -> None:
        value, sigma = read_quantity(layout.with_decimal_points(field.value or ""), unit_of(path), spoken(path))
        unit, _, key = path.partition(".payload.")
        changed = with_payload(vehicle, value, unit=unit) if key == "mass" else vehicle.restated({path: value})
        changed = changed if sigma is None or path not in changed.parameters() else changed.with_stated({path: sigma})
        said = f"{spoken(path)} {value:g} {unit_of(path)}"
        workspace.write({VEHICLE: catalogue.edited(workspace.read(VEHICLE) or "", changed)}, said)
        layout.reload(f"{said} is in the vehicle file now.")

    for path, value in vehicle.parameters().items():
        if ".payload." in path:
            stated = (f"{number:.6g} {unit_of(path)}" for number in (value, vehicle.stated.get(path)) if number)
            with ui.element("div").classes("fw-question w-full"):
                ui.label(spoken(path))
                field = ui.input(value=" +- ".join(stated)).classes("w-full").props("dense outlined")
                field.props["aria-label"] = spoken(path)
                field.on("change", partial(keep, path, field))
    ui.label(
        "Mass of a load: the unladen mass stays, and inertia and tyres follow. A value, with +- and its sigma if known."
    )


def _assumed(vehicle: Vehicle) -> None:
    """The numbers that the vehicle file leaves to classes; their effects take some seconds."""
    if not vehicle.assumed:
        ui.label(NOTHING_ASSUMED)
        return
    with ui.expansion(f"{len(vehicle.assumed)} assumed numbers").classes("w-full"):
        place = ui.column().classes("w-full")
    with place:
        ui.label("Their effects are computed.")

    async def show() -> None:
        numbers = await jobs.compute(assumed_numbers, vehicle)
        place.clear()
        with place:
            documents.show(*assumed_blocks(numbers))

    ui.timer(0.1, show, once=True)


def _questions(workspace: Workspace) -> None:
    """The form; each answer is kept at once, and the drawing follows."""
    rows: dict[str, ui.element] = {}

    def keep(question: Question, value: str | None) -> None:
        answers = _valid(workspace.choices().truck)
        text = _answer(question, value or "")
        if text == answers.get(question.key, ""):
            return
        answers = {**answers, question.key: text} if text else {k: a for k, a in answers.items() if k != question.key}
        choices = workspace.choices().model_copy(update={"truck": answers})
        workspace.write_choices(choices, f"answer {question.key.replace('_', ' ')}")
        state.refresh()
        preview.refresh()
        show_needed(answers)

    def show_needed(answers: Mapping[str, str]) -> None:
        for question in QUESTIONS:
            rows[question.key].visible = _applies(question, answers)

    answers = _valid(workspace.choices().truck)
    details = [question.key for question in QUESTIONS if question.key in DETAILS]
    for question in QUESTIONS:
        if question.key not in details:
            rows[question.key] = _field(question, answers.get(question.key, UNKNOWN), partial(keep, question))
    with ui.expansion("Heights, load and tyres", value=any(key in answers for key in details)).classes("w-full"):
        for key in details:
            rows[key] = _field(_BY_KEY[key], answers.get(key, UNKNOWN), partial(keep, _BY_KEY[key]))
    show_needed(answers)


def _open_questions(given: Mapping[str, str]) -> tuple[list[str], list[str]]:
    """The questions whose answers are refused, and those that still need an answer."""
    shown = [question for question in QUESTIONS if _applies(question, given) and question.key in given]
    refused = [question.text for question in shown if _error(question, given[question.key]) is not None]
    return refused, [question.text for question in QUESTIONS if question.required and question.key not in given]


def _described(given: Mapping[str, str]) -> str:
    """The vehicle file that complete answers describe; a VehicleError if there is no such truck."""
    return new_vehicle({key: text for key, text in given.items() if _applies(_BY_KEY[key], given)})


@ui.refreshable
def state(workspace: Workspace) -> None:
    """What the answers describe, or what is missing: in front of the questions, for screen readers too."""
    given = _valid(workspace.choices().truck)
    refused, missing = _open_questions(given)
    if refused:
        layout.failure(f"Correct or remove the answer to: {'; '.join(refused)}.")
    if missing:
        ui.label(f"Still needed: {'; '.join(missing)}.").props("role=status")
    if refused or missing:
        return
    try:
        truck = Vehicle.loads(_described(given))
    except VehicleError as error:
        layout.failure(str(error))
        return
    masses = " and ".join(f"{named_unit(unit.name)} {unit.mass / 1e3:.1f} t" for unit in truck.units)
    ui.label(f"Described and drawn: {masses}.").props("role=status")


@ui.refreshable
def preview(workspace: Workspace) -> None:
    """The drawing of the truck that the answers describe, and the button that takes it, if they are complete."""
    text = _new_text(workspace)
    if text is None or text == workspace.read(VEHICLE):  # which is drawn already
        if text is None and workspace.choices().truck:
            ui.button("Use this truck", icon="check").props("no-caps").disable()
        return

    def take() -> None:
        workspace.write({VEHICLE: text}, "describe the truck")
        layout.reload()

    layout.heading("Described truck")
    _draw(Vehicle.loads(text))
    ui.button("Use this truck", icon="check", on_click=take).props("no-caps")


def _new_text(workspace: Workspace) -> str | None:
    """The vehicle file that the answers describe; None if they do not describe one."""
    given = _valid(workspace.choices().truck)
    with suppress(VehicleError):  # `state` shows it
        return None if any(_open_questions(given)) else _described(given)
    return None


def _valid(answers: Mapping[str, str]) -> dict[str, str]:
    return {key: text for key, text in answers.items() if key in _BY_KEY}


def _applies(question: Question, answers: Mapping[str, str]) -> bool:
    """Whether the answers need this question; not as long as an answer that decides is missing or wrong."""
    try:
        return not question.unused(answers)
    except (KeyError, FifthwheelError):
        return False


def _answer(question: Question, text: str) -> str:
    """A text as an answer: a number may have a decimal comma, the commas of a slip separate its loads."""
    return layout.with_decimal_points(text.strip()) if question.unit else text.strip()


def _error(question: Question, text: str) -> str | None:
    """Why a text is no answer; None if it is one, or empty."""
    try:
        if answer := _answer(question, text):
            question.parse(answer)
    except VehicleError as error:
        return str(error)
    return None


def _field(question: Question, answer: str, keep: Any) -> ui.element:
    with ui.element("div").classes("fw-question w-full") as row:
        ui.label(question.text + (" *" if question.required else ""))
        field: ui.select | ui.input
        if question.choices:
            field = ui.select([UNKNOWN, *question.choices], value=answer if answer in question.choices else UNKNOWN)
            field.on_value_change(lambda event: keep(event.value))
        else:
            field = ui.input(value=answer, placeholder=question.example, validation=partial(_error, question))
            field.on("change", lambda: keep(field.value))
        field.classes("w-full").props("dense outlined hide-bottom-space")
        field.props["aria-label"] = question.text
        if question.required:
            field.props["aria-required"] = "true"
    return row
