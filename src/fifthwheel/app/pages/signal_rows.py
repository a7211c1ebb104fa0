"""The fields of each signal of the map, and what the samples say about it."""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, Protocol

from nicegui import events, ui

from fifthwheel.app import layout
from fifthwheel.channels import SignalName
from fifthwheel.errors import printable
from fifthwheel.formatting import percent
from fifthwheel.logs import SignalMap
from fifthwheel.logs.mapping.survey import ColumnContent
from fifthwheel.logs.signal_map import SignalSource
from fifthwheel.record.signal_names import si_unit
from fifthwheel.workflow import ChannelEvidence, SignalEvidence

_NAMES = ("speed", "steer.{}.front", "yaw_rate.{}", "roll_rate.{}", "articulation.{}", "lateral_acceleration.{}")
_WAIT = 500
"""ms after the last key before a field counts."""
_BETTER = 0.05
"""Fraction of the variance by which the inverted signal must fit better for the sign to be doubted."""


class Editor(Protocol):
    """What the fields need of the page."""

    evidence: SignalEvidence | None
    columns: Mapping[str, ColumnContent]

    def signal_map(self) -> SignalMap:
        """The map as it is on disk."""

    async def change(self, signal: str, **keys: Any) -> None:
        """Change keys of a signal by a field."""

    async def set_and_show(self, signal: str, **keys: Any) -> None:
        """Change keys of a signal by a button."""

    async def remove(self, signal: str) -> None:
        """Remove a signal."""


def row(editor: Editor, signal: str, channel: SignalSource, *parts: Callable[[str], object]) -> None:
    """The fields of a signal.

    Args:
        editor: changes the map.
        signal: name of the signal.
        channel: its entry in the map.
        parts: further contents for a signal: its plot, what the prediction says.
    """
    with ui.element("section").classes("w-full") as section:
        section.props["aria-label"] = signal
        layout.heading(signal)
        with ui.row().classes("items-end w-full"):
            if channel.column is not None:
                _column(editor, signal, channel)
            else:
                ui.label(f"sum of {', '.join(map(printable, channel.columns))}")
            unit = _unit_in_log(editor, channel)
            text = ui.input("Unit", value=channel.unit or unit or si_unit(signal) or "")
            text.on_value_change(partial(_changed, editor, signal, "unit"))
            sign = ui.toggle({1: "+", -1: "−"}, value=channel.sign).props("dense")
            sign.props["aria-label"] = f"Sign of {signal}"
            sign.on_value_change(partial(_changed, editor, signal, "sign"))
            gain = ui.number("Gain", value=channel.gain, format="%.6g")
            gain.on_value_change(partial(_changed, editor, signal, "gain"))
            delay = ui.number("Delay, s", value=float(channel.delay), step=0.01, format="%.3f")
            delay.on_value_change(partial(_changed, editor, signal, "delay"))
            for field, key in ((text, "Unit"), (gain, "Gain"), (delay, "Delay")):
                field.props(f"dense debounce={_WAIT}").classes("w-24")
                field.props["aria-label"] = f"{key} of {signal}"
            button = ui.button("Remove", on_click=partial(editor.remove, signal)).props("flat dense no-caps")
            button.props["aria-label"] = f"Remove {signal}"
        for part in parts:
            part(signal)


def _column(editor: Editor, signal: str, channel: SignalSource) -> None:
    names = _with_numbers(editor)
    options = names if channel.column in names else [channel.column, *names]
    field = ui.select(options, value=channel.column, label="Column", with_input=True)
    field.props("dense").classes("w-64").props["aria-label"] = f"Column of {signal}"
    field.on_value_change(partial(_changed, editor, signal, "column"))


def _with_numbers(editor: Editor) -> list[str]:
    """Columns that may be signals."""
    return [name for name, content in editor.columns.items() if content.alive]


async def _changed(editor: Editor, signal: str, key: str, event: events.ValueChangeEventArguments[Any]) -> None:
    """A field has a new value; an empty one is the default."""
    value = event.value
    if key == "unit" and value == _unit_in_log(editor, editor.signal_map().signals[signal]):
        value = None
    await editor.change(signal, **{key: value})


def _unit_in_log(editor: Editor, channel: SignalSource) -> str | None:
    content = editor.columns.get(channel.columns[0])
    return content.column.unit if content is not None else None


def verdict(editor: Editor, signal: str) -> None:
    """What the prediction says about a signal, with buttons for sign and delay."""
    if editor.evidence is None:
        return
    channel = editor.evidence.channels.get(signal)
    mapped = editor.signal_map().signals.get(signal)
    if channel is None or mapped is None:
        ui.label("Not predicted: the predictions of the others depend on it." if channel is None else "")
        return
    with ui.row().classes("items-center").props("aria-live=polite"):
        ui.label(_words(channel))
        if channel.explained is not None and (channel.inverted or 0.0) > channel.explained + _BETTER:
            button = ui.button("Invert", on_click=partial(editor.set_and_show, signal, sign=-mapped.sign))
            button.props("outline dense no-caps").props["aria-label"] = f"Invert {signal}"
        if channel.offset is not None and abs(channel.offset.offset) > 2 * channel.offset.sigma:
            late = channel.offset.offset
            delay = round(float(mapped.delay) + late, 3)
            button = ui.button(f"Correct by {late:.2f} s", on_click=partial(editor.set_and_show, signal, delay=delay))
            button.props("outline dense no-caps").props["aria-label"] = f"Correct the delay of {signal} by {late:.2f} s"


def _words(channel: ChannelEvidence) -> str:
    if channel.explained is None:
        return "Cannot be compared: too few samples, or the truck does not turn."
    words = f"The prediction explains {percent(channel.explained)} of the variance"
    if (channel.inverted or 0.0) > channel.explained + _BETTER:
        words += f", with the sign inverted {percent(channel.inverted or 0.0)}"
    if channel.offset is not None:
        late = channel.offset.offset
        words += f"; {abs(late):.2f} ± {channel.offset.sigma:.2f} s {'late' if late > 0 else 'early'}"
        if channel.offset.significant:
            words += f", corrected {percent(channel.offset.explained)}"
    return f"{words}."


def adding(editor: Editor) -> None:
    """Fields that add a signal."""
    with ui.row().classes("items-end"):
        units = {SignalName.of(name).unit for name in editor.signal_map().signals} - {"", None}
        names = [name.format(unit) for unit in sorted(units or {"tractor", "semitrailer"}) for name in _NAMES]
        signal = ui.input("Signal to add", autocomplete=names).props("dense").classes("w-64")
        column = ui.select(_with_numbers(editor), label="Its column", with_input=True).props("dense").classes("w-64")

        async def add() -> None:
            if signal.value and column.value:
                await editor.set_and_show(signal.value.strip(), column=column.value)

        ui.button("Add", on_click=add).props("outline dense no-caps")
