"""Tables and lists of a page; texts are escaped."""

import re
from collections.abc import Iterable, Sequence
from html import escape

from nicegui import ui

from fifthwheel.app import layout
from fifthwheel.errors import printable_lines


def table(heads: Sequence[str], rows: Iterable[Sequence[str]], *, label: str) -> ui.html:
    """A table; a name may break after a dot, and a wide table scrolls.

    Args:
        heads: of the columns; ">" at the end aligns a column to the right.
        label: for screen readers.
    """
    right = [' class="fw-right"' if head.endswith(">") else "" for head in heads]
    head = "".join(
        f'<th scope="col"{css}>{name(text.removesuffix(">"))}</th>' for text, css in zip(heads, right, strict=True)
    )
    body = "".join(
        f"<tr>{''.join(f'<td{css}>{name(cell)}</td>' for cell, css in zip(row, right, strict=True))}</tr>"
        for row in rows
    )
    html = f'<table aria-label="{escape(label)}"><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>'
    return ui.html(html, sanitize=False).classes("fw-scroll fw-table")


def texts(title: str, lines: Sequence[str]) -> None:
    """A list with a title; nothing if it is empty."""
    if not lines:
        return
    layout.heading(title)
    items = "".join(f"<li>{name(line)}</li>" for line in lines)
    ui.html(f"<ul>{items}</ul>", sanitize=False).classes("fw-list")


def name(text: str) -> str:
    """A text as HTML; the path of a parameter may break after a dot or an underscore."""
    html = escape(printable_lines(text)).replace("\n", "<br>")
    return _JOINT.sub(r"\1<wbr>", html)


_JOINT = re.compile(r"(?<=[a-z])([._])(?=[a-z])")
"""Within the path of a parameter."""
