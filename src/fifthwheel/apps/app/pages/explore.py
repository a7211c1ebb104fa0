"""The truck with other numbers: predicted against measured at once, and responses of the linear model."""

import asyncio
import math
import time
from collections.abc import Sequence
from dataclasses import replace
from html import escape
from typing import Any
from weakref import WeakSet

from nicegui import events, ui

from fifthwheel.apps.app import documents, jobs, layout, runs
from fifthwheel.apps.app.workspace import CHOICES, VEHICLE, Workspace
from fifthwheel.base import pages
from fifthwheel.base.errors import FifthwheelError
from fifthwheel.base.formatting import approximate, percent, with_sigma
from fifthwheel.base.plots import Line, Panel, Plot, Points
from fifthwheel.base.plots.items import BLUE, VERMILLION
from fifthwheel.data.channels import si_unit
from fifthwheel.data.record import Record
from fifthwheel.estimate.identify import Fit, OneStage
from fifthwheel.estimate.identify.result.display import fit_panel, prediction
from fifthwheel.estimate.identify.unknowns.parameters import estimated_parameters
from fifthwheel.model.dynamics import linear_system
from fifthwheel.results import plot
from fifthwheel.results.diagnose import LogPrediction
from fifthwheel.results.report.conclusion import counted
from fifthwheel.truck import Vehicle, unit_of
from fifthwheel.truck.catalogue import edited
from fifthwheel.truck.spoken_names import named_unit, spoken

KINDS = ("step response", "Bode diagram", "handling diagram")
FACTOR = 2.0
"""A slider reaches from the number of the vehicle file by this factor in both directions."""
FIRST = 8
"""Sliders that a narrow screen does not fold."""
STEPS = 40
"""Of a slider in each direction."""
SPEEDS = (20.0, 120.0)
"""Least and largest speed, km/h."""
REST = 0.4
"""s without a movement, after which the sliders are kept."""


_pages: WeakSet["_Page"] = WeakSet()
"""Of all tabs."""


def build(workspace: Workspace) -> None:
    for page in list(_pages):
        if page.workspace.folder == workspace.folder and not page.workspace.stale and page.keep_what_moved():
            workspace.seen = page.workspace.seen
    page = _Page(workspace, runs.vehicle(workspace), runs.used_logs(workspace))
    _pages.add(page)
    page.build()


class _Page:
    """Sliders, and the plots that follow them."""

    def __init__(self, workspace: Workspace, truck: Vehicle, used: list[str]) -> None:
        self.workspace, self.truck, self.used = workspace, truck, used
        kept = workspace.choices().explore
        given = truck.parameters()
        self.values = {path: float(value) for path, value in dict(kept.get("values", {})).items() if path in given}
        self.log = kept.get("log") if kept.get("log") in used else next(iter(used), None)
        self.speed = float(kept.get("speed", 80.0))
        self.kind = str(kept["kind"]) if kept.get("kind") in KINDS else KINDS[0]
        self.record: Record | None = None
        self.prediction: LogPrediction | None = None
        self._moved: float | None = None
        self._busy = False
        self._pending = False
        self._found = ""
        self._fit_plot: ui.plotly | None = None

    def build(self) -> None:
        ui.timer(REST, self._keep_what_rests)
        with ui.element("div").classes("fw-columns"):
            with ui.element("div"):
                with ui.element("section").props('aria-label="Predicted against measured"'):
                    layout.heading("Predicted against measured")
                    self._fit_part()
                with layout.part("Linear model"):
                    self._model_part()
            with ui.element("section").classes("fw-sticky").props('aria-label="Numbers of the truck"'):
                self._sliders()

    # Sliders

    @ui.refreshable_method
    def _sliders(self) -> None:
        layout.heading("Numbers of the truck")
        with ui.row():
            ui.button("Back to the vehicle file", on_click=self._reset).props("outline dense no-caps")
            take = ui.button("Write to vehicle.toml", on_click=self._take).props("outline dense no-caps")
            take.tooltip("The numbers of the sliders replace those of the file; this can be undone")
        first = estimated_parameters(self.truck, OneStage())
        for path in first[:FIRST]:
            self._slider(path)
        others = [path for path, value in self.truck.parameters().items() if value and path not in first]
        with layout.part("Other numbers"):
            for path in first[FIRST:]:
                self._slider(path)
            for unit in dict.fromkeys(path.partition(".")[0] for path in others):
                changed = any(path in self.values for path in others if path.partition(".")[0] == unit)
                with ui.expansion(named_unit(unit), value=changed).classes("w-full"):
                    for path in others:
                        if path.partition(".")[0] == unit:
                            self._slider(path)

    def _slider(self, path: str) -> None:
        given = self.truck.parameters()[path]
        value = self.values.get(path, given)
        with ui.element("div").classes("fw-slider"):
            ui.label(spoken(path)).tooltip(path)
            number = ui.label(with_sigma(value, None, unit_of(path)))
            # The input of the browser works with keys and screen readers. As HTML, because an update of the page would
            # set the value of an element back.
            steps = round(STEPS * math.log(value / given, FACTOR))
            slider = ui.html(
                f'<input type="range" min="{-STEPS}" max="{STEPS}" value="{steps}" aria-label="{escape(spoken(path))}" '
                f'aria-describedby="{number.html_id}">',
                sanitize=False,
            )

        async def follow(event: events.GenericEventArguments) -> None:
            steps = int(event.args)
            changed = given * FACTOR ** (steps / STEPS)
            self.values = {k: v for k, v in {**self.values, path: changed}.items() if steps or k != path}
            number.text = with_sigma(changed, None, unit_of(path))
            self._moved = time.monotonic()
            await self._update()

        value_of = "(event) => emit(Number(event.target.value))"
        slider.on("input", follow, js_handler=value_of, throttle=0.05)

    def _keep_what_rests(self) -> None:
        """Keep the sliders when they have not moved for a while, as one change."""
        if self._moved is not None and time.monotonic() - self._moved > REST:
            self.keep_what_moved()

    def keep_what_moved(self) -> bool:
        """Keep the sliders if they have moved since; so they are kept too when the tab is reloaded."""
        moved, self._moved = self._moved is not None, None
        if moved:
            self._keep()
        return moved

    def _keep(self) -> None:
        shown = {"values": self.values, "log": self.log, "speed": self.speed, "kind": self.kind}
        choices = self.workspace.choices()
        changed = choices.model_copy(update={"explore": {k: v for k, v in shown.items() if v is not None}})
        if changed != choices:
            self.workspace.write_choices(changed, "explore other numbers")
            layout.refresh_undo_buttons()

    async def _reset(self) -> None:
        self.values = {}
        self._keep()
        self._sliders.refresh()
        await self._update()

    def _take(self) -> None:
        if not self.values:
            raise FifthwheelError("No slider is moved; there is nothing to write.")
        text = edited(self.workspace.read(VEHICLE) or "", self.truck.replace(self.values))
        cleared = self.workspace.choices().model_copy(update={"explore": {}})
        self.workspace.write({VEHICLE: text, CHOICES: cleared.text()}, "write the numbers of Explore")
        numbers = counted(len(self.values), "number")
        layout.reload(f"{numbers} written to {VEHICLE}. Undo restores the file, and the sliders as they were.")

    # Predicted against measured

    def _fit_part(self) -> None:
        if self.log is None:
            layout.next_step("There is no log yet; drop one on the page Log.", "log")
            return
        if len(self.used) > 1:
            choose = ui.select(self.used, value=self.log, label="Log").classes("fw-field")
            choose.on_value_change(self._other_log)
        self._place = ui.column().classes("w-full")
        with self._place:
            ui.spinner(size="2em").props('role=status aria-label="Reading the log"')
        ui.timer(0, self._load, once=True)

    async def _other_log(self, event: Any) -> None:
        self.log = str(event.value)
        self._keep()
        await self._load()

    async def _load(self) -> None:
        assert self.log is not None
        self.record = self.prediction = None
        try:
            record = await jobs.compute(runs.record, self.workspace.folder, self.log)
            self.prediction = await asyncio.to_thread(LogPrediction.of, record, self.truck)
            self.record = record
            self._given = await asyncio.to_thread(self.prediction.fits, {})
        except FifthwheelError as error:
            self._place.clear()
            with self._place:
                layout.failure(str(error))
            return
        self._place.clear()
        with self._place:
            layout.search("Find a signal", self._find)
            self._fit_place = ui.column().classes("w-full")
        await self._find("")

    async def _find(self, text: str) -> None:
        self._found, self._fit_plot = text, None
        given = self._shown(self._given)
        self._fit_place.clear()
        with self._fit_place:
            if given:
                plot, height = fit_plot(given, given), 150 * len(given) + 90
                label = "Measured and predicted signals"
                self._fit_rows = ui.column().classes("w-full")
                with layout.part("Signals"):
                    ui.label("Grey: measured. Blue and dashed: the vehicle file. Orange: with the sliders.")
                    self._fit_plot = documents.show_plot(plot, height=height, label=label, log=self.log)
            else:
                ui.label(layout.NO_SIGNAL).props("role=status")
        await self._update()

    def _shown(self, fits: list[Fit]) -> list[Fit]:
        return [fit for fit in fits if layout.contains(fit.signal, self._found)]

    # Responses

    def _model_part(self) -> None:
        with ui.row().classes("items-center"):
            kind = ui.toggle(list(KINDS), value=self.kind).props('no-caps aria-label="Plot of the linear model"')

            def change(speed: float | None = None) -> None:
                self.kind, self.speed = kind.value, speed or self.speed
                self._keep()
                self._draw_model()

            speed = layout.number_field("Speed, km/h", self.speed, change, limits=SPEEDS)
            speed.props("debounce=600").classes("fw-field")
            kind.on_value_change(lambda _: change())
        self._model_error = ui.label().classes("text-negative").props("role=alert")
        self._model_plot = ui.plotly({}).classes("w-full")
        self._model_plot.props["role"] = "img"
        self._draw_model()

    def _draw_model(self) -> None:
        try:
            changed = self.truck.replace(self.values)
            drawn = model_plot(self.kind, self.truck, changed, self.speed / 3.6, self.record)
        except FifthwheelError as error:
            self._model_error.text = str(error)
            return
        self._model_error.text = ""
        height = 420 if self.kind == "handling diagram" else 150 * len(drawn.panels) + 110
        self._model_plot.style(f"height: {height}px")
        self._model_plot.props["aria-label"] = f"{self.kind} of the linear model"
        self._model_plot.update_figure(documents.drawn(drawn, height=height))

    async def _update(self) -> None:
        """Draw what the sliders give; while one drawing is computed, only the latest position waits."""
        if self._busy:
            self._pending = True
            return
        self._busy = self._pending = True
        try:
            while self._pending:
                self._pending = False
                await self._draw()
        finally:
            self._busy = False

    async def _draw(self) -> None:
        if self.prediction is not None:
            try:
                fits = await asyncio.to_thread(self.prediction.fits, dict(self.values))
            except FifthwheelError as error:
                layout.say(str(error))
                return
            if self._fit_plot is not None:
                given, changed = self._shown(self._given), self._shown(fits)
                figure = documents.drawn(fit_plot(given, changed), height=150 * len(given) + 90, log=self.log)
                figure["layout"]["uirevision"] = self.log
                self._fit_plot.update_figure(figure)
                self._fit_rows.clear()
                with self._fit_rows:
                    documents.show(fit_table(given, changed))
        self._draw_model()


def fit_plot(given: list[Fit], changed: list[Fit]) -> Plot:
    """Each signal as measured, as predicted by the vehicle file, and as predicted with the changed numbers."""
    panels = [
        fit_panel(
            after,
            prediction(before, "vehicle file", BLUE, "dash"),
            prediction(after, "sliders", VERMILLION),
            title=spoken(after.signal),
        )
        for before, after in zip(given, changed, strict=True)
    ]
    return Plot(panels=panels)


def fit_table(given: list[Fit], changed: list[Fit]) -> pages.Table:
    """Signal, and explained fraction and residual of both."""
    rows: list[Sequence[pages.Cell]] = []
    for before, after in zip(given, changed, strict=True):
        cells = [
            f"{percent(max(fit.explained, 0.0), round_down=True)}, {approximate(fit.rms, si_unit(fit.signal))}"
            for fit in (before, after)
        ]
        rows.append((pages.Hinted(spoken(after.signal), after.signal), *cells))
    return pages.Table(("Explained, residual rms", "vehicle file>", "sliders>"), rows, label="Fit of each signal")


def model_plot(kind: str, given: Vehicle, changed: Vehicle, speed: float, record: Record | None = None) -> Plot:
    """A plot of the linear model at a speed, m/s, with both sets of numbers.

    The record gives points of the handling diagram. A FifthwheelError if the vehicle has no such response.
    """
    return Plot(panels=list(map(_together, *[_panels(kind, v, speed, record) for v in (given, changed)])))


def _panels(kind: str, vehicle: Vehicle, speed: float, record: Record | None) -> list[Panel]:
    if kind == "handling diagram":
        return list(plot.handling_diagram(vehicle, [record] if record is not None else []).panels)
    yaw = [f"yaw_rate.{unit.name}" for unit in vehicle.units]
    system = linear_system(vehicle, speed, [*yaw, *[f"roll.{unit.name}" for unit in vehicle.units]])
    if kind == "step response":
        return [replace(panel, title=spoken(panel.title)) for panel in plot.step_response(system).panels]
    return [replace(panel, title=spoken(name)) for name in yaw for panel in plot.bode(system, name).panels]


def _together(given: Panel, changed: Panel) -> Panel:
    """The line of the vehicle file, dashed, then that of the sliders; points of the first are left out."""
    old = [replace(i, colour=BLUE, dash="dash", name="vehicle file") for i in given.items if isinstance(i, Line)]
    new = [replace(i, colour=VERMILLION, name="sliders") if isinstance(i, Line) else i for i in changed.items]
    points = [item for item in new if isinstance(item, Points)]
    rest = [item for item in new if not isinstance(item, Points)]
    return replace(changed, items=[*points, *old, *rest])
