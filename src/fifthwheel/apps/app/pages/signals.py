"""The signal map, with what the truck's kinematics predict for each signal."""

from dataclasses import replace
from functools import partial
from typing import Any

from nicegui import events, ui

from fifthwheel.apps.app import documents, jobs, layout, runs
from fifthwheel.apps.app.workspace import SIGNALS, Workspace
from fifthwheel.apps.workflow.inputs import steered_axle
from fifthwheel.base.errors import FifthwheelError, SignalError, printable
from fifthwheel.base.formatting import digits, percent
from fifthwheel.base.plots import Axis, Band, Item, Line, Panel, Plot
from fifthwheel.base.plots.items import BLUE, GREY, VERMILLION, range_without_spikes, visible_range
from fifthwheel.data.channels import IDENTIFIED, SignalName, si_unit
from fifthwheel.data.channels.sensors import fitting_classes
from fifthwheel.data.checks import Fault, Finding
from fifthwheel.data.checks.findings import uncertain_delay, warning
from fifthwheel.data.logs import SignalMap
from fifthwheel.data.logs.map_text import with_channel, without_channel
from fifthwheel.data.logs.propose import missing_signals
from fifthwheel.data.logs.signal_map import SignalSource
from fifthwheel.estimate.time_bases.evidence import ChannelEvidence, SignalEvidence
from fifthwheel.estimate.time_bases.offsets import TimeOffset
from fifthwheel.truck import Vehicle

HEIGHT = 170
"""Height of the plot of a signal, pixels."""
_TEXTS = ("gain", "delay")
"""Keys whose fields are texts with an uncertainty."""
_WAIT = 500
"""ms after the last key before a field counts."""


def build(workspace: Workspace) -> None:
    known = [path.name for path in workspace.logs() if runs.is_stored(workspace, path.name)]
    if not known:
        layout.next_step("There is no log yet; drop one on the page Log.", "log")
        return
    asked = ui.context.client.request.query_params.get("log")
    used = [name for name in runs.used_logs(workspace) if name in known]
    name = asked if asked in known else (used or known)[0]
    if len(known) > 1:
        choose = ui.select(known, value=name, label="Log").classes("w-full").style("max-width: 30rem")
        choose.on_value_change(lambda event: ui.navigate.to(f"?{layout.query(log=str(event.value))}"))
    _Page(workspace, name).build()


class _Page:
    """The map beside the evidence of one log."""

    def __init__(self, workspace: Workspace, name: str) -> None:
        self.workspace, self.name = workspace, name
        self.columns = runs.survey(workspace, name).contents
        self.evidence: SignalEvidence | None = None
        self.error = ""
        self._latest = 0
        self._plots: dict[str, ui.plotly] = {}
        self._sections: dict[str, ui.element] = {}
        self._fields: dict[str, dict[str, Any]] = {}
        self._refusals: dict[str, ui.label] = {}
        self._found = ""

    def build(self) -> None:
        known = self.workspace.vehicle() is not None
        truck = "your truck with uncertain tyres" if known else "usual trucks, for lack of a vehicle file"
        ui.label(
            "Each signal (blue) beside what speed and steer angle predict for it (orange). "
            f"The grey band is the range of {truck}. Every change is written to signals.toml."
        )
        with ui.row().classes("items-center"):
            button = layout.working_button("Propose a map", self.propose).props("outline dense no-caps")
            button.tooltip("By names, units and samples; replaces signals.toml, and can be undone")
            ui.button("Save as file", on_click=self._save).props("outline dense no-caps")
            self._busy = ui.spinner(size="1.5em").props('role=status aria-label="Computing"')
        self._findings()
        layout.search("Find a signal", self._find)
        self._rows()
        self._adding()
        first = self.propose if self.workspace.read(SIGNALS) is None else self.compare
        ui.timer(0, first, once=True)

    def _find(self, text: str) -> None:
        self._found = text
        for signal, section in self._sections.items():
            section.visible = layout.contains(signal, text)

    async def propose(self) -> None:
        self._busy.visible = True
        try:
            text = await jobs.compute(runs.propose, self.workspace.folder, self.name)
        finally:
            self._busy.visible = False
        await self._write(text, "propose a map")
        self._rows.refresh()

    async def change(self, signal: str, **keys: Any) -> None:
        text = self.workspace.read(SIGNALS) or ""
        changed = with_channel(text, signal, **keys)
        if changed != text:
            words = ", ".join(f"{key} {value}" for key, value in keys.items())
            await self._write(changed, f"{signal}: {words}")

    async def mend(self, finding: Finding) -> None:
        """Do what a finding proposes, for each of its signals."""
        text, channels = self.workspace.read(SIGNALS) or "", self.workspace.signal_map().signals
        for signal in (finding.signal, *finding.others):
            text = with_channel(text, signal, **_remedy(finding, channels.get(signal)))
        await self._write(text, f"mend {finding.signal}")
        self._rows.refresh()

    async def remove(self, signal: str) -> None:
        await self._write(without_channel(self.workspace.read(SIGNALS) or "", signal), f"remove {signal}")
        self._rows.refresh()

    async def set_and_show(self, signal: str, **keys: Any) -> None:
        """Change keys of a signal by a button, so that the fields must follow."""
        await self.change(signal, **keys)
        self._rows.refresh()

    async def compare(self) -> None:
        self._latest += 1
        number = self._latest
        self._busy.visible = True
        try:
            evidence, error = await jobs.compute(runs.evidence, self.workspace.folder, self.name), ""
        except FifthwheelError as refusal:
            evidence, error = None, str(refusal)
        if number != self._latest:
            return  # a later change is being computed
        self.evidence, self.error = evidence, error
        self._busy.visible = False
        self._findings.refresh()
        self._verdict.refresh()
        self._draw()

    async def _write(self, text: str, label: str) -> None:
        self.workspace.write({SIGNALS: text}, label)
        layout.refresh_undo_buttons()
        await self.compare()

    def _draw(self) -> None:
        for signal, element in self._plots.items():
            element.update_figure(self._figure(signal))

    def _figure(self, signal: str) -> dict[str, Any]:
        figure = documents.drawn(_plot(self.evidence, signal), height=HEIGHT, log=self.name)
        figure["layout"] |= {"showlegend": False, "uirevision": str(documents.kept_zoom(self.name))}
        figure["layout"]["margin"] |= {"t": 20}
        return figure

    def _course(self, signal: str) -> None:
        element = ui.plotly(self._figure(signal)).classes("fw-course")
        element.props["role"] = "img"
        element.props["aria-label"] = f"{signal} measured and predicted"
        documents.over_time(element, self.name)
        element.on("plotly_relayout", self._zoom, args=documents.ZOOM)
        self._plots[signal] = element

    def _zoom(self, event: events.GenericEventArguments) -> None:
        """Show all signals in the window of the one that was zoomed."""
        window = documents.zoomed(event)
        if window is not False and window != documents.kept_zoom(self.name):
            documents.keep_zoom(self.name, window)
            self._draw()

    @ui.refreshable_method
    def _findings(self) -> None:
        if self.error:
            layout.failure(self.error)
        if self.evidence is None:
            return
        signal_map, findings = self.workspace.signal_map(), self.evidence.findings
        missing, doubtful = objections(self.evidence, signal_map, self.workspace.vehicle())
        lines: list[tuple[str, str]] = [(f.severity, f.message) for f in findings if f.signal not in signal_map.signals]
        again = ["If the log has these, propose a map again, or add them below."] if missing else []
        lines += [("warning", text) for text in (*missing, *again)]
        below = dict.fromkeys([f.signal for f in findings if f.signal in signal_map.signals] + doubtful)
        if below:
            lines.append(("warning", f"See below: {', '.join(below)}."))
        if not lines and any(channel.explained is not None for channel in self.evidence.channels.values()):
            lines = [("good", "Nothing speaks against the map.")]
        with ui.element("ul").props('aria-label="Findings" aria-live=polite'):
            for severity, text in lines or [("warning", "No signal can be compared with a prediction.")]:
                with ui.element("li"):
                    layout.finding(severity, text)

    @ui.refreshable_method
    def _rows(self) -> None:
        try:
            signal_map = self.workspace.signal_map()
        except FifthwheelError as error:
            layout.failure(f"{error}\nCorrect signals.toml with a text editor, or propose a map.")
            return
        self._plots.clear()
        self._sections.clear()
        for signal, channel in signal_map.signals.items():
            self._row(signal, channel)
        if signal_map.reference:
            ui.label(f"For comparison only: {', '.join(signal_map.reference)}")

    def _row(self, signal: str, channel: SignalSource) -> None:
        with ui.element("section").classes("fw-part w-full") as section:
            section.props["aria-label"] = signal
            section.visible = layout.contains(signal, self._found)
            self._sections[signal] = section
            with ui.row().classes("items-center"):
                layout.heading(signal)
                layout.more_button(section, f"Plot and keys of {signal}")
            with ui.row().classes("items-start w-full fw-folded"):
                fields: dict[str, Any] = {}
                if channel.column is not None:
                    fields["column"] = self._column(signal, channel)
                else:
                    ui.label(f"sum of {', '.join(map(printable, channel.columns))}")
                fields["unit"] = ui.input("Unit", value=self._shown(signal, channel)["unit"])
                fields["unit"].on("change", lambda: self._changed(signal, "unit", fields["unit"].value))
                fields["sign"] = ui.toggle({1: "+", -1: "−"}, value=channel.sign).props("dense")
                fields["sign"].props["aria-label"] = f"Sign of {signal}"
                fields["sign"].on_value_change(lambda event: self._changed(signal, "sign", event.value))
                for key, label, example in (("gain", "Gain", "0.05 +- 2 %"), ("delay", "Delay, s", "0.28 s +- 50 ms")):
                    field = fields[key] = ui.input(label, value=channel.text_of(key), placeholder=example)
                    field.on_value_change(lambda event, key=key: self._typed(signal, key, event.value))
                    field.on("blur", partial(self._left, signal, field)).props(f"debounce={_WAIT}")
                if classes := fitting_classes(SignalName.of(signal).quantity):
                    fields["sensor"] = ui.select(
                        {"": "usual", **{name: name for name in classes}}, label="Sensor class"
                    )
                    fields["sensor"].value = channel.sensor
                    fields["sensor"].on_value_change(lambda event: self._changed(signal, "sensor", event.value))
                fields["clock"] = ui.input("Logger", value=channel.clock or "", placeholder="that of the others")
                fields["clock"].on("change", lambda: self._changed(signal, "clock", fields["clock"].value or None))
                for key in fields.keys() - {"column", "sign"}:
                    width = "w-20" if key == "unit" else "w-36"
                    fields[key].props("dense").classes(width).props["aria-label"] = f"{key.capitalize()} of {signal}"
                self._fields[signal] = fields
                button = ui.button("Remove", on_click=partial(self.remove, signal)).props("flat dense no-caps")
                button.props["aria-label"] = f"Remove {signal}"
            self._refusals[signal] = layout.failure("")
            self._refusals[signal].bind_visibility_from(self._refusals[signal], "text", bool)
            with ui.element("div").classes("fw-folded w-full"):
                self._course(signal)
            self._verdict(signal)

    def _shown(self, signal: str, channel: SignalSource) -> dict[str, Any]:
        """What the fields of a signal show of the file."""
        unit = channel.unit or self._unit_in_log(channel) or si_unit(signal) or ""
        texts = {key: channel.text_of(key) for key in _TEXTS}
        own = {"sensor": channel.sensor, "clock": channel.clock or ""}
        return {"column": channel.column, "unit": unit, "sign": channel.sign, **texts, **own}

    def _show_file(self, signal: str) -> None:
        shown = self._shown(signal, self.workspace.signal_map().signals[signal])
        for key, field in self._fields[signal].items():
            field.set_value(shown[key])

    def _column(self, signal: str, channel: SignalSource) -> ui.select:
        names = self._with_numbers()
        options = names if channel.column in names else [channel.column, *names]
        field = ui.select(options, value=channel.column, label="Column", with_input=True)
        field.props("dense").classes("w-64").props["aria-label"] = f"Column of {signal}"
        field.on_value_change(lambda event: self._changed(signal, "column", event.value))
        return field

    def _with_numbers(self) -> list[str]:
        return [name for name, content in self.columns.items() if content.alive]

    async def _changed(self, signal: str, key: str, value: Any) -> None:
        """A field has a new value; an empty one is the default. After a refusal, the field shows the file again."""
        if key == "unit" and value in ("", self._unit_in_log(self.workspace.signal_map().signals[signal])):
            value = None
        await self._set(signal, key, value)
        if self._refusals[signal].text:
            self._show_file(signal)

    def _left(self, signal: str, field: ui.input) -> None:
        """A number has a decimal point when its field is left; after a refusal it is that of the file."""
        if self._refusals[signal].text:
            self._show_file(signal)
        else:
            field.set_value(layout.with_decimal_points(field.value or ""))

    async def _typed(self, signal: str, key: str, text: str | None) -> None:
        """A number, or a text with its unit and "+-", is in a field."""
        plain = layout.with_decimal_points((text or "").strip())
        known = self.workspace.signal_map().signals[signal].text_of(key)
        if plain == known:
            return
        try:
            number = None if set(plain) & set("±%s") or "+-" in plain else layout.typed_number(plain)
            value = number if plain and number is not None and "+-" not in known else plain or None
        except FifthwheelError as refusal:
            self._refusals[signal].text = str(refusal)
            return
        await self._set(signal, key, value)

    async def _set(self, signal: str, key: str, value: Any) -> None:
        """Change a key of a signal; a refusal is shown in its row until the next change."""
        if value == getattr(self.workspace.signal_map().signals[signal], key) and key not in _TEXTS:
            return
        refusal = self._refusals[signal]
        refusal.text = ""
        try:
            await self.change(signal, **{key: value})
        except SignalError as error:
            refusal.text = str(error)

    def _unit_in_log(self, channel: SignalSource) -> str | None:
        content = self.columns.get(channel.columns[0])
        return content.column.unit if content is not None else None

    def _adding(self) -> None:
        with ui.row().classes("items-end"):
            units = {SignalName.of(name).unit for name in self.workspace.signal_map().signals} - {"", None}
            names = ["speed"]
            for unit in sorted(units or {"tractor", "semitrailer"}):
                names += [f"steer.{unit}.front", *[f"{channel.quantity}.{unit}" for channel in IDENTIFIED]]
            signal = ui.input("Signal to add", autocomplete=names).props("dense").classes("w-64")
            column = ui.select(self._with_numbers(), label="Its column", with_input=True).props("dense").classes("w-64")

            async def add() -> None:
                if signal.value and column.value:
                    await self.set_and_show(signal.value.strip(), column=column.value)

            ui.button("Add", on_click=add).props("outline dense no-caps")

    @ui.refreshable_method
    def _verdict(self, signal: str) -> None:
        """What the prediction says about a signal, with buttons for sign and delay."""
        if self.evidence is None:
            return
        for finding in self.evidence.findings:
            if signal == finding.signal:
                with ui.row().classes("items-center no-wrap"):
                    layout.finding(finding.severity, finding.message)
                    if "delay" in finding.remedy:
                        together = dict.fromkeys([*finding.others, *self._late_with(self.evidence, signal)])
                        finding = replace(finding, others=tuple(name for name in together if name != signal))
                    if finding.remedy:
                        button = layout.working_button("Mend", partial(self.mend, finding)).props("dense no-caps")
                        button.props["aria-label"] = f"Mend {signal}"
        channel = self.evidence.channels.get(signal)
        mapped = self.workspace.signal_map().signals.get(signal)
        if channel is None or mapped is None:
            ui.label("An input: the other signals are predicted from it." if channel is None else "")
            return
        with ui.row().classes("items-center").props("aria-live=polite"):
            ui.label(_words(channel))
            if channel.is_inverted:
                button = layout.working_button("Invert", partial(self.set_and_show, signal, sign=-mapped.sign))
                button.props("outline dense no-caps").props["aria-label"] = f"Invert {signal}"
            late = self._late_with(self.evidence, signal)
            known = any("delay" in f.remedy and {f.signal, *f.others} & late.keys() for f in self.evidence.findings)
            if signal == next(iter(late), None) and not known:
                weights = [offset.sigma**-2 for offset in late.values()]
                mean = sum(w * o.offset for w, o in zip(weights, late.values(), strict=True)) / sum(weights)
                found = warning(signal, Fault.TIME_OFFSET, "late", remedy={"delay": mean}, sigma=sum(weights) ** -0.5)
                mend = partial(self.mend, replace(found, others=tuple(late)[1:]))
                button = layout.working_button(f"Correct by {mean:.2f} s", mend).props("outline dense no-caps")
                label = f"Correct the delay of {' and '.join(late)} by {mean:.2f} s"
                button.tooltip(label).props["aria-label"] = label

    def _late_with(self, evidence: SignalEvidence, signal: str) -> dict[str, TimeOffset]:
        """The late signals of the logger of a signal; a unit has one logger if the map does not name others."""
        signals = self.workspace.signal_map().signals

        def logger(name: str) -> str | None:
            return signals[name].clock or SignalName.of(name).unit

        return {
            name: channel.offset
            for name, channel in evidence.channels.items()
            if name in signals and logger(name) == logger(signal)
            if channel.offset is not None and abs(channel.offset.offset) > 2 * channel.offset.sigma
        }

    def _save(self) -> None:
        text = self.workspace.read(SIGNALS)
        if text is not None:
            ui.download.content(text, SIGNALS)


def _remedy(finding: Finding, channel: Any) -> dict[str, Any]:
    """Keys that remove a fault: a sign and a delay are relative to those that the channel has."""
    keys = dict(finding.remedy)
    if channel is not None and "delay" in keys:
        delay = float(channel.delay) + float(keys["delay"])
        is_stated = "+-" in channel.text_of("delay")  # its sigma stays
        keys["delay"] = round(delay, 3) if is_stated else uncertain_delay(delay, finding.sigma or 0.0)
    if channel is not None and "sign" in keys:
        keys["sign"] = -channel.sign
    return keys


def objections(evidence: SignalEvidence, signal_map: SignalMap, truck: Vehicle | None) -> tuple[list[str], list[str]]:
    """What speaks against a map besides the findings: what is missing, and the signals that predictions contradict."""
    units = ("tractor", "semitrailer") if truck is None else [unit.name for unit in truck.units]
    reported = {name for finding in evidence.findings for name in (finding.signal, *finding.others)}
    doubtful = [
        name
        for name, channel in evidence.channels.items()
        if name not in reported and (channel.is_inverted or channel.is_late or channel.is_scaled)
    ]
    return missing_signals(signal_map, units, steered_axle(truck)), doubtful


def _words(channel: ChannelEvidence) -> str:
    if channel.explained is None:
        return "Cannot be compared: too few samples, or the truck does not turn."
    words = f"With a free gain and offset, the prediction explains {percent(channel.explained)} of the variance"
    if channel.is_scaled and channel.gain is not None:
        larger = (
            f"{digits(max(channel.gain, 1 / channel.gain), 2)} times too {'small' if channel.gain > 1 else 'large'}"
        )
        words = (
            f"The prediction is {larger}: correct unit or gain of this signal, of the speed or of the steer angle. "
            f"Times {digits(channel.gain, 2)}, it explains {percent(channel.explained)} of the variance"
        )
    if channel.is_inverted:
        words += f", with the sign inverted {percent(channel.inverted or 0.0)}"
    if channel.offset is not None:
        late = channel.offset.offset
        words += f"; {abs(late):.2f} ± {channel.offset.sigma:.2f} s {'late' if late > 0 else 'early'}"
        if channel.offset.significant:
            words += f", corrected {percent(channel.offset.explained)}"
    return f"{words}."


def _plot(evidence: SignalEvidence | None, signal: str) -> Plot:
    items: list[Item] = []
    visible: tuple[float, float] | None = None
    if evidence is not None and signal in evidence.others:
        time, values = evidence.others[signal]
        visible = range_without_spikes(values)
        items = [Line(time, values, name="measured", colour=BLUE, gaps=False)]
    elif evidence is not None and signal in evidence.channels:
        time, channel = evidence.time, evidence.channels[signal]
        if within := range_without_spikes(channel.measured):
            visible = visible_range(within, channel.lowest, channel.highest)
        items = [
            Band(time, channel.lowest, channel.highest, name="range of the prediction", colour=GREY),
            Line(time, channel.measured, name="measured", colour=BLUE),
            Line(time, channel.predicted, name="predicted", colour=VERMILLION, width=1.5),
        ]
    y = Axis(unit=si_unit(signal) or "", range=visible)
    return Plot(panels=[Panel(items=items, x=Axis(label="time", unit="s"), y=y)])
