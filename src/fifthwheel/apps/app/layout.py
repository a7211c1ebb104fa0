"""What all pages share: navigation, undo, errors, and the check that a tab is not stale."""

import logging
import math
import re
import traceback
from collections.abc import Awaitable, Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from importlib import resources
from pathlib import Path
from typing import Any, TypeVar
from urllib.parse import urlencode
from weakref import WeakKeyDictionary

from nicegui import Client, app, events, ui

from fifthwheel.apps.app import jobs, runs
from fifthwheel.apps.app.workspace import StaleError, Workspace
from fifthwheel.base.errors import FifthwheelError, printable
from fifthwheel.truck.spoken_names import spoken

T = TypeVar("T")
PAGES = ("log", "signals", "truck", "check", "identify", "explore", "compare", "history")
"""In the order of work; the first has the address /."""
ICON = (
    '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 16 16">'
    '<path d="M1 4h9v7H1zM11 6h3l1 3v2h-4z" fill="#1f5fa8"/>'
    '<circle cx="4" cy="12" r="2"/><circle cx="12.5" cy="12" r="2"/></svg>'
)
_THEME = "fw-theme"
"""Cookie with the name of the theme; cookies hold for every port of this computer."""
_THEMES: Mapping[str, tuple[str, bool | None]] = {
    "system": ("brightness_auto", None),
    "light": ("light_mode", False),
    "dark": ("dark_mode", True),
}
"""Icon, and whether the page is dark; None: as the system."""
_MESSAGE = "message"
"""Key of the note that a tab shows after its reload."""
POLL = 1.0
"""s between two looks for changes by other tabs."""
PROGRESS_POLL = 0.3
"""s between two looks at a job."""
NO_SIGNAL = "No signal has this name."


def register(folder: Path, builders: Mapping[str, Callable[[Workspace], None]]) -> None:
    """Let the server answer with the pages of a workspace; a builder fills each."""
    files = resources.files("fifthwheel.apps.app")
    style, script = (files.joinpath(name).read_text(encoding="utf-8") for name in ("style.css", "page.js"))
    ui.add_head_html(f"<style>{style}</style><script>{script}</script>", shared=True)
    logging.getLogger("nicegui").addFilter(_without_traceback)
    for name in PAGES:
        _register(name, builders[name], folder)


def _without_traceback(record: logging.LogRecord) -> bool:
    """Log an error that a message explains as one line."""
    if isinstance(record.msg, FifthwheelError):
        record.exc_info = None
    return True


def _register(name: str, build: Callable[[Workspace], None], folder: Path) -> None:
    @ui.page(address(name), title=f"{name.capitalize()} - {printable(folder.name)} - fifthwheel", language="en-US")
    def page() -> None:
        workspace = Workspace(folder)
        with frame(workspace, name):
            try:
                build(workspace)
            except runs.MissingError as missing:
                next_step(str(missing), missing.page)
            except FifthwheelError as error:
                failure(str(error))


def address(name: str) -> str:
    return "/" if name == PAGES[0] else f"/{name}"


@contextmanager
def frame(workspace: Workspace, name: str) -> Iterator[None]:
    """Header and main part of a page; what is built in the block is in the main part."""
    ui.on_exception(_show_error)
    ui.colors(primary="#1f5fa8")
    ui.html('<a class="fw-skip" href="#main">To the content</a>', sanitize=False)
    with ui.header().classes("fw-bar-top"):
        with ui.element("div").classes("fw-open"):
            ui.label("fifthwheel").classes("text-weight-bold")
            ui.label(printable(workspace.folder.name)).classes("ellipsis").tooltip(printable(str(workspace.folder)))
        with ui.element("nav").classes("fw-nav").props('aria-label="Pages"'):
            for number, page in enumerate(PAGES, 1):
                link = ui.link(f"{number} {page.capitalize()}", address(page))
                if page == name:
                    link.props("aria-current=page")
        with ui.element("div").classes("fw-tools"):
            shown = _undo_buttons[ui.context.client] = ui.refreshable(_show_undo_buttons)
            shown(workspace)
            _theme_button()
    ui.keyboard(on_key=partial(_on_key, workspace), ignore=["input", "select", "textarea"])
    with ui.element("div").classes("fw-page").props("id=main tabindex=-1"):
        with ui.element("h1"):
            ui.label(name.capitalize())
        yield
    ui.timer(0, _say_after_reload, once=True)
    ui.timer(POLL, lambda: _reload_if_stale(workspace))


def _theme_button() -> None:
    """The button that goes to the next theme; the browser keeps it."""
    request = ui.context.client.request
    chosen = request.cookies.get(_THEME, "") if request is not None else ""
    names = list(_THEMES)
    dark = ui.dark_mode()
    button = ui.button().props("flat dense color=white")

    def show(name: str) -> None:
        icon, dark.value = _THEMES[name]
        button.props(f"icon={icon}")
        button.props["aria-label"] = f"Theme: {name}"

    def turn() -> None:
        name = names[(names.index(button.props["aria-label"].removeprefix("Theme: ")) + 1) % len(names)]
        show(name)
        ui.run_javascript(f"document.cookie = '{_THEME}={name}; path=/; max-age=31536000; SameSite=Strict'")

    button.on_click(turn)
    with button:
        ui.tooltip("Theme: that of the system, light or dark")
    show(chosen if chosen in _THEMES else names[0])


def heading(text: str) -> None:
    """A heading below that of the page."""
    with ui.element("h2"):
        ui.label(printable(text))


@contextmanager
def part(title: str, *, begins: bool = False) -> Iterator[None]:
    """A part of a page below its heading; a narrow screen folds it, or shows how it `begins`; paper has all of it."""
    with ui.element("section").classes("fw-part w-full") as section:
        section.props["aria-label"] = printable(title)
        with ui.row().classes("items-center"):
            heading(title)
            more_button(section, f"More of {title}")
        with ui.element("div").classes(f"w-full {'fw-begun' if begins else 'fw-folded'}"):
            yield


def more_button(section: ui.element, label: str) -> None:
    """A button that unfolds a part on a narrow screen, and folds it again."""

    def turn() -> None:
        section.classes(toggle="fw-unfolded")
        button.props["aria-expanded"] = str("fw-unfolded" in section.classes).lower()

    button = ui.button("More", on_click=turn).props("flat dense no-caps aria-expanded=false").classes("fw-more")
    button.props["aria-label"] = printable(label)


def working_button(text: str, action: Callable[[], Awaitable[object]]) -> ui.button:
    """A button that shows that its action is not done yet."""

    async def act() -> None:
        button.props("loading")
        try:
            await action()
        finally:
            if not button.is_deleted:
                button.props(remove="loading")

    button = ui.button(text, on_click=act)
    return button


def plain(text: str) -> str:
    """A text from a file for a plot, where plotly reads markup."""
    return printable(text).replace("<", "&lt;")


def query(**values: str | Sequence[str]) -> str:
    """Values as the query of an address."""
    return urlencode(values, doseq=True)


def later(doing: str, compute: Callable[[], Awaitable[T]], build: Callable[[T], object]) -> None:
    """Build what is computed once the page is shown; see `fill`."""
    place = ui.column().classes("w-full")
    ui.timer(0, lambda: fill(place, doing, compute(), build), once=True)


async def fill(place: ui.column, doing: str, computed: Awaitable[T], build: Callable[[T], object]) -> None:
    """Show a spinner, then build what is computed, or say why it cannot be; `doing` is for screen readers."""
    place.clear()
    with place:
        ui.spinner(size="2em").props(f'role=status aria-label="{doing}"')
    try:
        show: Callable[[], object] = partial(build, await computed)
    except FifthwheelError as error:
        show = partial(failure, str(error))
    place.clear()
    with place:
        show()


def next_step(message: str, page: str) -> None:
    """What is missing on this page, and a link to the page that provides it."""
    with ui.element("div").classes("fw-next"):
        ui.icon("info", size="sm").props("aria-hidden=true")
        ui.label(message)
        ui.link(f"To the page {page.capitalize()}", address(page))


def finding(severity: str, message: str) -> None:
    """A finding with the icon and the colour of its severity."""
    with ui.element("div").classes(f"fw-finding {severity}"):
        icons = {"error": "error", "warning": "warning", "good": "check_circle"}
        ui.icon(icons[severity]).props("role=img aria-hidden=false").props["aria-label"] = severity
        ui.label(message)


def failure(message: str) -> ui.label:
    """A message in the page; screen readers read it at once."""
    return ui.label(message).classes("text-negative").style("white-space: pre-line").props("role=alert")


def say(message: str) -> None:
    """A short note that vanishes; screen readers read it."""
    ui.notify(message, position="bottom", multi_line=True)


async def confirmed(question: str, action: str) -> bool:
    """Whether the user confirms an action that cannot be undone."""
    with ui.dialog() as dialog, ui.card():
        ui.label(printable(question))
        with ui.row():
            ui.button(action, on_click=lambda: dialog.submit(True)).props("color=negative no-caps")
            ui.button("Keep", on_click=lambda: dialog.submit(False)).props("outline autofocus no-caps")
    return bool(await dialog)


def typed_number(text: str | None) -> float | None:
    """The number in a field, with a decimal point or a decimal comma; None for an empty field.

    Raises:
        FifthwheelError: the text is no number, or has separators of thousands.
    """
    plain = (text or "").strip().replace("\u2212", "-")
    if not plain:
        return None
    plain = with_decimal_points(plain)
    if not _NUMBER.fullmatch(plain):
        raise FifthwheelError(f"expected a number without separators of thousands, got {plain!r}; correct it")
    return float(plain)


def with_decimal_points(text: str) -> str:
    """A text with its decimal commas as points; a comma that may separate thousands, as in 1,234, stays.

    >>> with_decimal_points("0,8 m +- 2,5 cm"), with_decimal_points("1,234 kg")
    ('0.8 m +- 2.5 cm', '1,234 kg')
    """
    return _DECIMAL_COMMA.sub(r"\1.\2", text)


_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d{1,2})?")
_THOUSANDS = r"[1-9]\d{0,2},\d{3}(?!\d)"
_DECIMAL_COMMA = re.compile(rf"(?<![\d.,])(?!{_THOUSANDS})(\d*),(\d+)(?![\d.,])")


def number_field(
    label: str,
    value: float | None,
    change: Callable[[float | None], Any] = lambda number: None,
    *,
    form: str = ".6g",
    limits: tuple[float, float] = (-math.inf, math.inf),
) -> ui.input:
    """A field for a number; a text that is none, or is outside the limits, is refused below the field.

    When the field is left, it shows the number with a decimal point.
    """

    def error(text: str | None) -> str | None:
        try:
            number = typed_number(text)
        except FifthwheelError as refusal:
            return str(refusal)
        low, high = limits
        return None if number is None or low <= number <= high else f"expected {low:g} to {high:g}, got {number:g}"

    def changed(event: events.ValueChangeEventArguments[Any]) -> Any:
        return None if error(event.value) else change(typed_number(event.value))

    def show() -> None:
        if not error(field.value):
            field.set_value(with_decimal_points(field.value or ""))

    field = ui.input(label, value=shown_number(value, form), validation=error).props(
        "inputmode=decimal hide-bottom-space"
    )
    field.on_value_change(changed)
    field.on("blur", show)
    return field


def search(label: str, find: Callable[[str], object]) -> ui.input:
    """A field for a part of a name; `find` is called with the text when it changes."""
    field = ui.input(label, on_change=lambda event: find(event.value or ""))
    return field.props("dense clearable debounce=300")


def contains(name: str, text: str) -> bool:
    """Whether a name of a signal, its path or in words, contains a text.

    >>> contains("yaw_rate.semitrailer", "Trailer, yaw"), contains("Trailer, yaw rate", "yaw_rate")
    (True, True)
    """
    part, *names = (each.lower().replace("_", " ").strip() for each in (text, name, spoken(name)))
    return any(part in each for each in names)


def shown_number(value: float | None, form: str = ".6g") -> str:
    """A number in a field."""
    return "" if value is None else f"{value:{form}}"


def reload(message: str = "") -> None:
    """Show the page anew; then the message as a note, if there is one."""
    if message:
        app.storage.tab[_MESSAGE] = message
    ui.run_javascript("location.reload()")


def show_progress(key: str, on_end: Callable[[jobs.Job], object]) -> None:
    """Show a job while it runs, with a button that cancels it; `on_end` is called once when it ends."""
    job = jobs.get(key)
    if not job.running:
        return
    with ui.column().classes("w-full q-py-sm gap-1") as place:
        with ui.row().classes("items-center"):
            text = ui.label(job.words()).props("role=status aria-live=polite")
            ui.button("Cancel", icon="close", on_click=job.cancel).props("outline dense no-caps")
        bar = ui.linear_progress(show_value=False).props('aria-label="Progress" role=progressbar')

    def update() -> None:
        if not job.running:
            timer.cancel()
            place.delete()
            on_end(job)
            return
        bar.props(
            "indeterminate" if job.fraction is None else "", remove="" if job.fraction is None else "indeterminate"
        )
        bar.value = job.fraction or 0.0
        text.text = job.words()

    timer = ui.timer(PROGRESS_POLL, update)


def _say_after_reload() -> None:
    if message := app.storage.tab.pop(_MESSAGE, ""):
        say(message)


_undo_buttons: WeakKeyDictionary[Client, Any] = WeakKeyDictionary()
"""Of each tab."""


def refresh_undo_buttons() -> None:
    """Show in this tab what can be undone now; other tabs reload when they find the change."""
    _undo_buttons[ui.context.client].refresh()


def _show_undo_buttons(workspace: Workspace) -> None:
    undo, redo = workspace.undoable()
    for word, keys, label, action in (("Undo", "Z", undo, workspace.undo), ("Redo", "Y", redo, workspace.redo)):
        text = f"{word}: {label}" if label else f"Nothing to {word.lower()}"
        button = ui.button(icon=word.lower(), on_click=partial(_step, action)).props("flat dense color=white")
        button.props["aria-label"] = text
        button.tooltip(f"{text} (Ctrl+{keys})")


def _step(action: Callable[[], str | None]) -> None:
    if action() is not None:
        reload()


def _on_key(workspace: Workspace, event: events.KeyEventArguments) -> None:
    if event.action.keydown and not event.action.repeat and (event.modifiers.ctrl or event.modifiers.meta):
        if event.key == "z" and not event.modifiers.shift:
            _step(workspace.undo)
        elif event.key == "y" or (event.key == "Z" and event.modifiers.shift):
            _step(workspace.redo)


def _reload_if_stale(workspace: Workspace) -> None:
    if workspace.stale:
        workspace.seen = ""  # so that a change that arrives before the reload is refused
        reload()


def _show_error(error: Exception) -> None:
    if isinstance(error, StaleError):
        ui.notify(str(error), type="warning", timeout=8000)
        ui.timer(2.0, reload, once=True)
    elif isinstance(error, FifthwheelError):
        ui.notify(str(error), type="negative", multi_line=True, timeout=10000, close_button="Close")
    elif isinstance(error, OSError):
        ui.notify(f"{error.filename or 'file'}: {error.strerror or error}", type="negative", close_button="Close")
    else:
        traceback.print_exception(error)
        ui.notify(f"internal error: {type(error).__name__}; see the terminal", type="negative", close_button="Close")
