"""The signal map, with what the truck's kinematics predict for each signal."""

from functools import partial
from typing import Any

from nicegui import ui

from fifthwheel.app import documents, inputs, jobs, layout
from fifthwheel.app.pages import signal_rows
from fifthwheel.app.pages.signal_plot import HEIGHT, signal_plot
from fifthwheel.app.workspace import SIGNALS, Workspace
from fifthwheel.checks import Finding
from fifthwheel.errors import FifthwheelError
from fifthwheel.logs import SignalMap
from fifthwheel.logs.edited_map import with_channel, without_channel
from fifthwheel.workflow import SignalEvidence


def build(workspace: Workspace) -> None:
    """Fill the page."""
    known = [path.name for path in workspace.logs() if inputs.is_stored(workspace, path.name)]
    if not known:
        ui.label("First drop a log on the page Log.")
        ui.link("To the page Log", layout.address("log"))
        return
    asked = ui.context.client.request.query_params.get("log")
    used = [name for name in inputs.used_logs(workspace) if name in known]
    name = asked if asked in known else (used or known)[0]
    if len(known) > 1:
        choose = ui.select(known, value=name, label="Log", on_change=lambda event: _open(str(event.value)))
        choose.classes("w-full").style("max-width: 30rem")
    _Page(workspace, name).build()


def _open(name: str) -> None:
    ui.navigate.to(f"{layout.address('signals')}?{layout.query(log=name)}")


class _Page:
    """The map beside the evidence of one log."""

    def __init__(self, workspace: Workspace, name: str) -> None:
        self.workspace, self.name = workspace, name
        self.columns = inputs.survey(workspace, name).contents
        self.evidence: SignalEvidence | None = None
        self.error = ""
        self._latest = 0
        self._plots: dict[str, ui.plotly] = {}

    def build(self) -> None:
        """Fill the page."""
        known = self.workspace.vehicle() is not None
        truck = "your truck with uncertain tyres" if known else "usual trucks, for lack of a vehicle file"
        ui.label(
            "Each signal (blue) beside what speed and steer angle predict for it (orange). "
            f"The grey band is the range of {truck}. Every change is written to signals.toml."
        )
        with ui.row().classes("items-center"):
            button = ui.button("Propose a map", on_click=self.propose).props("outline dense no-caps")
            button.tooltip("By names, units and samples; replaces signals.toml, and can be undone")
            ui.button("Save as file", on_click=self._save).props("outline dense no-caps")
            self._busy = ui.spinner(size="1.5em").props('role=status aria-label="Computing"')
        self._findings()
        self._rows()
        signal_rows.adding(self)
        first = self.propose if self.workspace.read(SIGNALS) is None else self.compare
        ui.timer(0, first, once=True)

    async def propose(self) -> None:
        """Propose a map and write it."""
        self._busy.visible = True
        try:
            text = await jobs.compute(inputs.propose, self.workspace.folder, self.name)
        finally:
            self._busy.visible = False
        await self._write(text, "propose a map")
        self._rows.refresh()

    async def change(self, signal: str, **keys: Any) -> None:
        """Change keys of a signal."""
        text = self.workspace.read(SIGNALS) or ""
        changed = with_channel(text, signal, **keys)
        if changed != text:
            words = ", ".join(f"{key} {value}" for key, value in keys.items())
            await self._write(changed, f"{signal}: {words}")

    async def mend(self, finding: Finding) -> None:
        """Do what a finding proposes, for each of its signals."""
        text, channels = self.workspace.read(SIGNALS) or "", self.signal_map().signals
        for signal in (finding.signal, *finding.others):
            text = with_channel(text, signal, **_remedy(finding, channels.get(signal)))
        await self._write(text, f"mend {finding.signal}")
        self._rows.refresh()

    async def remove(self, signal: str) -> None:
        """Remove a signal from the map."""
        await self._write(without_channel(self.workspace.read(SIGNALS) or "", signal), f"remove {signal}")
        self._rows.refresh()

    async def set_and_show(self, signal: str, **keys: Any) -> None:
        """Change keys of a signal by a button, so that the fields must follow."""
        await self.change(signal, **keys)
        self._rows.refresh()

    async def compare(self) -> None:
        """Compute the evidence anew and show it."""
        self._latest += 1
        number = self._latest
        self._busy.visible = True
        try:
            evidence, error = await jobs.compute(inputs.evidence, self.workspace.folder, self.name), ""
        except FifthwheelError as refusal:
            evidence, error = None, str(refusal)
        if number != self._latest:
            return  # a later change is being computed
        self.evidence, self.error = evidence, error
        self._busy.visible = False
        self._findings.refresh()
        self._verdict.refresh()
        self._draw()

    def signal_map(self) -> SignalMap:
        """The map as it is on disk."""
        return self.workspace.signal_map() or SignalMap()

    async def _write(self, text: str, label: str) -> None:
        self.workspace.write({SIGNALS: text}, label)
        layout.undo_buttons.refresh()
        await self.compare()

    def _draw(self) -> None:
        for signal, element in self._plots.items():
            element.update_figure(self._figure(signal))

    def _figure(self, signal: str) -> dict[str, Any]:
        figure = documents.drawn(signal_plot(self.evidence, signal), height=HEIGHT)
        figure["layout"] |= {"showlegend": False, "uirevision": signal}
        figure["layout"]["margin"] |= {"t": 8}
        return figure

    def _course(self, signal: str) -> None:
        """The plot of a signal."""
        element = ui.plotly(self._figure(signal)).classes("fw-course")
        element.props["role"] = "img"
        element.props["aria-label"] = f"{signal} measured and predicted"
        self._plots[signal] = element

    @ui.refreshable_method
    def _verdict(self, signal: str) -> None:
        """What the prediction says about a signal."""
        signal_rows.verdict(self, signal)

    @ui.refreshable_method
    def _findings(self) -> None:
        """What speaks against the map, each with a button that mends it."""
        if self.error:
            layout.failure(self.error)
        findings = self.evidence.findings if self.evidence is not None else ()
        with ui.element("ul").props('aria-label="Findings" aria-live=polite'):
            for finding in findings:
                with ui.element("li"), ui.row().classes("items-center no-wrap"):
                    ui.label(str(finding)).classes("text-negative" if finding.severity == "error" else "")
                    if finding.remedy and finding.signal in self.signal_map().signals:
                        button = ui.button("Mend", on_click=partial(self.mend, finding)).props("dense no-caps")
                        button.props["aria-label"] = f"Mend {finding.signal}"
            if self.evidence is not None and not findings:
                with ui.element("li"):
                    ui.label("Nothing speaks against the map.")

    @ui.refreshable_method
    def _rows(self) -> None:
        """The signals of the map, with the fields that change them."""
        try:
            signal_map = self.signal_map()
        except FifthwheelError as error:
            layout.failure(f"{error}\nCorrect signals.toml with a text editor, or propose a map.")
            return
        self._plots.clear()
        for signal, channel in signal_map.signals.items():
            signal_rows.row(self, signal, channel, self._course, self._verdict)
        if signal_map.reference:
            ui.label(f"For comparison only: {', '.join(signal_map.reference)}")

    def _save(self) -> None:
        text = self.workspace.read(SIGNALS)
        if text is not None:
            ui.download.content(text, SIGNALS)


def _remedy(finding: Finding, channel: Any) -> dict[str, Any]:
    """Keys that remove a fault: a sign and a delay are relative to those that the channel has."""
    keys = dict(finding.remedy)
    if channel is not None and "delay" in keys:
        keys["delay"] = round(float(channel.delay) + float(keys["delay"]), 3)
    if channel is not None and "sign" in keys:
        keys["sign"] = -channel.sign
    return keys
