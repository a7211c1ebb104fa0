"""The logs of the workspace: what they contain, plots of their channels, and windows that are left out."""

from collections.abc import Callable, Sequence
from contextlib import nullcontext
from functools import partial
from typing import Any

import numpy as np
from nicegui import events, run, ui

from fifthwheel.apps.app import documents, jobs, layout, runs
from fifthwheel.apps.app.workspace import VEHICLE, Workspace
from fifthwheel.base.errors import printable
from fifthwheel.base.pages.html import COURSE_POINTS, course
from fifthwheel.base.plots import Axis, Line, Panel, Plot, Span
from fifthwheel.base.types import Array
from fifthwheel.data.logs.row_time import find_row_time
from fifthwheel.data.logs.stored import StoredLog
from fifthwheel.data.logs.survey import ColumnContent, LogSurvey
from fifthwheel.data.record.timestamps import instant, origin
from fifthwheel.results.report.logs import column_cells

ROWS = 25
"""Channels of one page of the table."""
FEW = 3
"""Above this number of logs, a narrow screen folds their list."""
SEARCHED = 8
"""Above this number of channels there is a search."""
FIRST = 4
"""Channels that are drawn at first."""
MOST = 12
"""Channels that are drawn at the same time."""
MANY = 1_000_000
"""Samples of a channel whose small plot shows its spikes, because to find them takes longer than to show the page."""
_INSTANT = ".3f"
"""Form of an instant in a field, s."""
_PANEL = 130
"""Height of the plot of a channel, pixels."""
SPIKES = " (spikes outside the axis: double-click shows them)"
"""Behind the title of a plot."""


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
            "Drop logs here: CSV, Excel, Parquet, MF4, MATLAB, TDMS, MCAP, ULog or CAN traces; DBC and ARXML "
            f"files decode CAN frames. They are copied to {self.workspace.folder}."
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

    async def _try_example(self) -> None:
        await jobs.compute(runs.write_example, self.workspace.folder)
        self.refresh()

    def _chosen(self) -> str | None:
        """The log of the address, else the first that has been read."""
        known = [path.name for path in self.workspace.logs() if runs.is_stored(self.workspace, path.name)]
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
            if self.workspace.read(VEHICLE) is None:
                ui.button("Try it with an example log and truck", on_click=self._try_example).props("outline no-caps")
            return
        _read_next(self.workspace, logs)
        self._leave_out_unreadable(logs)
        chosen = self._chosen()
        place = layout.part("Logs", begins=True) if len(logs) > FEW else nullcontext()
        with place, ui.element("div").classes("fw-scroll fw-logs"), ui.element("table").props('aria-label="Logs"'):
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
                elif runs.is_stored(self.workspace, name):
                    survey = runs.survey(self.workspace, name)
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
        jobs.start(_key(name), runs.store, self.workspace.folder, name)
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
        if job.state in ("none", "done") and not runs.is_stored(workspace, name):
            jobs.start(_key(name), runs.store, workspace.folder, name)
            return


def _key(name: str) -> str:
    return f"read {name}"


_Course = tuple[Array, Array, tuple[float, float] | None]
"""Time (n,) s and values (n,) to draw, and the range of the axis if spikes are outside of it."""


def channels(workspace: Workspace, name: str, drawn: Sequence[str]) -> None:
    """Show a stored log, and draw some of its channels; those that it does not have are ignored."""
    log, survey = runs.opened(workspace, name), runs.survey(workspace, name)
    layout.heading(name)
    for note in survey.notes:
        ui.label(note)
    times = find_row_time(log)
    shown = [column for column in drawn if column in log.columns][:MOST]
    shown = shown or [n for n, c in survey.contents.items() if c.alive and n != times and c.sigma > 0][:FIRST]
    view = _View(workspace, name, log, shown)
    view.build()
    _table(log, survey, shown, view.draw)


class _View:
    """The plot of some channels in a window of time, and the choice of windows."""

    def __init__(self, workspace: Workspace, name: str, log: StoredLog, shown: list[str]) -> None:
        self._workspace, self._name, self._log, self._shown = workspace, name, log, shown
        self._whole = log.span()
        self._origin = origin(self._whole[0])
        self._range = self._whole
        self._selecting = False

    def build(self) -> None:
        low, high = self._relative(self._whole)
        with ui.row().classes("items-center"):
            mode = ui.toggle({False: "Zoom", True: "Select"}, value=False, on_change=self._set_mode)
            mode.props('aria-label="What dragging in the plot does" dense no-caps')
            self._from, self._to = (
                layout.number_field(label, instant, form=_INSTANT)
                for label, instant in (("From, s", low), ("To, s", high))
            )
            for field in (self._from, self._to):
                field.props("dense").classes("w-28")
            for text, action in (
                ("Show", lambda: self._show(self._chosen())),
                ("Whole log", lambda: self._show(self._whole)),
                ("Exclude", self._exclude),
                ("Keep only this", self._keep_only),
            ):
                ui.button(text, on_click=action).props("outline dense no-caps")
        self._plot = documents.show_plot(self._described([]), height=self._height())
        documents.over_time(self._plot, self._name)
        self._plot.on("plotly_relayout", self._on_zoom, args=documents.ZOOM)
        self._plot.on("plotly_selected", self._on_select, args=["range"])
        self._windows()
        ui.timer(0, self._draw_first, once=True)

    async def _draw_first(self) -> None:
        """Draw the window that this tab has zoomed to on any page."""
        low, high = documents.kept_zoom(self._name) or self._relative(self._whole)
        self._choose((low + self._origin, high + self._origin))
        self._range = self._chosen()
        await self.draw()

    async def draw(self, shown: Sequence[str] | None = None) -> None:
        """Draw the window; with other channels if some are given."""
        if shown is not None:
            self._shown = list(shown)
            self._plot.style(f"height: {self._height()}px")
            query = layout.query(log=self._name, channel=self._shown)
            ui.navigate.history.replace(f"?{query}")
        names = list(self._shown)
        lines = await run.io_bound(_read, self._log, names, *self._range)
        if lines is None or names != self._shown:
            return  # the server ends, or another choice was made meanwhile
        figure = documents.drawn(self._described(lines), height=self._height())
        figure["layout"] |= {
            "dragmode": "select" if self._selecting else "zoom",
            "selectdirection": "h",
            "hovermode": False,
        }
        bottom = {"range": list(self._relative(self._range)), "autorange": False}
        figure["layout"]["xaxis"] |= bottom
        self._plot.update_figure(figure)

    def _described(self, lines: Sequence[_Course]) -> Plot:
        empty = (np.array([np.nan]), np.array([np.nan]), None)
        spans = [Span(*self._relative(window)) for window in self._excluded()]
        at = f" after {instant(self._origin)}" if self._origin else ""
        panels = [
            Panel(
                title=layout.plain(column) + SPIKES * (visible is not None),
                items=[Line(time - self._origin, values, gaps=False), *spans],
                x=Axis(label=f"time{at}", unit="s"),
                y=Axis(unit=layout.plain(self._log.columns[column].unit or ""), range=visible),
            )
            for column, (time, values, visible) in zip(self._shown, lines or [empty] * len(self._shown), strict=True)
        ]
        nothing = Panel(items=[Line(*empty[:2])], title="tick channels in the table")
        return Plot(panels=panels or [nothing])

    def _height(self) -> int:
        return 80 + _PANEL * max(len(self._shown), 1)

    def _relative(self, window: tuple[float, float]) -> tuple[float, float]:
        return window[0] - self._origin, window[1] - self._origin

    def _chosen(self) -> tuple[float, float]:
        low, high = sorted(layout.typed_number(field.value) or 0.0 for field in (self._from, self._to))
        return max(low + self._origin, self._whole[0]), min(high + self._origin, self._whole[1])

    def _choose(self, window: tuple[float, float]) -> None:
        for field, end in zip((self._from, self._to), self._relative(window), strict=True):
            field.value = layout.shown_number(end, _INSTANT)

    async def _show(self, window: tuple[float, float]) -> None:
        self._range = window if window[1] > window[0] else self._whole
        self._choose(self._range)
        documents.keep_zoom(self._name, None if self._range == self._whole else self._relative(self._range))
        await self.draw()

    async def _set_mode(self, event: events.ValueChangeEventArguments[Any]) -> None:
        self._selecting = bool(event.value)
        await self.draw()

    async def _on_zoom(self, event: events.GenericEventArguments) -> None:
        window = documents.zoomed(event)
        if window is None and self._range != self._whole:  # else plotly.js shows the spikes too
            await self._show(self._whole)
        elif window:
            await self._show((window[0] + self._origin, window[1] + self._origin))

    def _on_select(self, event: events.GenericEventArguments) -> None:
        window = (event.args or {}).get("range", {}).get("x")
        if window:
            self._choose((min(window) + self._origin, max(window) + self._origin))

    def _excluded(self) -> tuple[tuple[float, float], ...]:
        return self._workspace.choices().of(self._name).exclude

    async def _set_excluded(self, windows: Sequence[tuple[float, float]], label: str) -> None:
        rounded = tuple(sorted({(round(low, 3), round(high, 3)) for low, high in windows if high > low}))
        choices = self._workspace.choices().with_log(self._name, exclude=rounded)
        self._workspace.write_choices(choices, label)
        layout.refresh_undo_buttons()
        self._windows.refresh()
        await self.draw()

    async def _exclude(self) -> None:
        low, high = self._relative(self._chosen())
        await self._set_excluded([*self._excluded(), self._chosen()], f"exclude {low:.2f} to {high:.2f} s")

    async def _keep_only(self) -> None:
        low, high = self._chosen()
        outside = [(self._whole[0], low - 1e-3), (high + 1e-3, self._whole[1])]
        start, stop = self._relative((low, high))
        await self._set_excluded(outside, f"keep only {start:.2f} to {stop:.2f} s")

    @ui.refreshable_method
    def _windows(self) -> None:
        windows = self._excluded()
        with ui.element("ul").props('aria-label="Excluded windows"'):
            for window in windows:
                low, high = self._relative(window)
                with ui.element("li"), ui.row().classes("items-center"):
                    ui.label(f"excluded: {low:.2f} to {high:.2f} s")
                    others = [other for other in windows if other != window]
                    label = f"use {low:.2f} to {high:.2f} s again"
                    button = ui.button("Use again", on_click=partial(self._set_excluded, others, label))
                    button.props("flat dense no-caps").props["aria-label"] = label.capitalize()


def _read(log: StoredLog, names: Sequence[str], start: float, stop: float) -> list[_Course]:
    return [(*log.window(name, start, stop), log.range_without_spikes(name, start, stop)) for name in names]


def _table(log: StoredLog, survey: LogSurvey, shown: Sequence[str], draw: Callable[[Sequence[str]], object]) -> None:
    """The channels with unit, rate, range, missing samples and a small plot; those that are ticked are drawn."""
    ticked = dict.fromkeys(shown)
    text, first = "", 0

    async def tick(name: str, event: events.ValueChangeEventArguments[Any]) -> None:
        if event.value:
            ticked[name] = None
        else:
            ticked.pop(name, None)
        if len(ticked) > MOST:
            layout.say(f"At most {MOST} channels are drawn.")
        await draw(list(ticked)[:MOST])  # type: ignore[misc]

    def search(part: str) -> None:
        nonlocal text, first
        text, first = part.lower(), 0
        rows.refresh()

    def turn(step: int) -> None:
        nonlocal first
        first += step
        rows.refresh()

    @ui.refreshable
    def rows() -> None:
        names = [name for name in survey.contents if text in name.lower()]
        place = ui.element("div").classes("fw-scroll fw-channels")
        with place, ui.element("table").props('aria-label="Channels"'):
            with ui.element("thead"), ui.element("tr"):
                for head in ("Plot", "Channel", "Unit", "Hz", "From", "To", "Empty", "Course"):
                    with ui.element("th").props("scope=col"):
                        ui.label(head)
            with ui.element("tbody"):
                for name in names[first : first + ROWS]:
                    _row(log, name, survey.contents[name], name in ticked, partial(tick, name))
        if len(names) > ROWS:
            with ui.row().classes("items-center"):
                back = ui.button("Back", on_click=lambda: turn(-ROWS)).props("flat dense no-caps")
                back.set_enabled(first > 0)
                ui.label(f"{first + 1} to {min(first + ROWS, len(names))} of {len(names)}")
                more = ui.button("More", on_click=lambda: turn(ROWS)).props("flat dense no-caps")
                more.set_enabled(first + ROWS < len(names))

    with layout.part("Channels"):
        if len(survey.contents) > SEARCHED:
            layout.search("Find a channel", search)
        rows()


def _row(log: StoredLog, name: str, content: ColumnContent, ticked: bool, tick: Callable[..., object]) -> None:
    present = content.fault is None and content.missing < content.samples
    with ui.element("tr"):
        with ui.element("td"):
            if present:
                box = ui.checkbox(value=ticked, on_change=tick).props("dense")
                box.props["aria-label"] = f"Plot {printable(name)}"
        for cell in (name, *column_cells(content)):
            with ui.element("td"):
                ui.label(printable(cell))
        with ui.element("td"):
            if present:
                visible = log.range_without_spikes(name, *log.span()) if content.samples < MANY else None
                drawn = course(*log.window(name, *log.span(), points=COURSE_POINTS), visible)
                ui.html(drawn, sanitize=False).props('aria-hidden="true"')
