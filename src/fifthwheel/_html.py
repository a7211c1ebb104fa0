"""Small pieces of HTML for notebooks, without scripts. Texts may come from files and are escaped."""

from collections.abc import Iterable, Sequence
from html import escape

from fifthwheel.errors import printable

HEAD = "text-align:left;border-bottom:1px solid #999;padding:2px 10px 2px 0"
CELL = "text-align:left;padding:2px 10px 2px 0"


class Markup(str):
    """A text that is HTML already."""

    __slots__ = ()


def text(content: str) -> str:
    """A text as HTML; one that is `Markup` stays."""
    return content if isinstance(content, Markup) else escape(printable(content))


def table(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> Markup:
    """A table."""
    head = "".join(f'<th style="{HEAD}">{text(cell)}</th>' for cell in heads)
    body = "".join("<tr>" + "".join(f'<td style="{CELL}">{text(cell)}</td>' for cell in row) + "</tr>" for row in rows)
    return Markup(
        f'<table style="border-collapse:collapse"><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>'
    )


def block(title: str, *lines: str) -> str:
    """A title in bold with lines and tables below it."""
    parts = [line if isinstance(line, Markup) else f"<div>{text(line)}</div>" for line in lines if line]
    return f"<div><b>{text(title)}</b>{''.join(parts)}</div>"
