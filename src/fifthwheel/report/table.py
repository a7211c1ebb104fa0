"""A table that becomes a row of cards on a narrow screen, where it would have to be scrolled."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from html import escape


@dataclass(frozen=True)
class Column:
    """A column."""

    head: str
    kind: str = ""
    """Words: "name" and "full" have a line of their own on a card, "main" is bold there, "n" is a number, "w" does not
    break."""
    short: str = ""
    """What stands before its cell on a card, where there is no head."""


def path(name: str) -> str:
    """The path of a parameter or signal, or of a file; it may break behind a dot or a slash."""
    return f"<code>{escape(name).replace('.', '.<wbr>').replace('/', '/<wbr>')}</code>"


def table(columns: Sequence[Column], rows: Iterable[tuple[str, Sequence[str]]]) -> str:
    """Cells are HTML; the first of each row is its class."""
    head = "".join(f"<th{_quoted('class', c.kind)}>{escape(c.head)}</th>" for c in columns)
    body = "".join(f"<tr{_quoted('class', kind)}>{''.join(map(_cell, columns, cells))}</tr>\n" for kind, cells in rows)
    return f'<div class="scroll"><table><thead><tr>{head}</tr></thead><tbody>\n{body}</tbody></table></div>'


def _cell(column: Column, text: str) -> str:
    kind = f"{column.kind} none".strip() if text in ("", "–") else column.kind
    return f"<td{_quoted('class', kind)}{_quoted('data-short', column.short)}>{text}</td>"


def _quoted(name: str, value: str) -> str:
    return f' {name}="{escape(value)}"' if value else ""
