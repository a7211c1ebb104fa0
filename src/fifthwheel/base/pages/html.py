"""Blocks of a document as HTML."""

import re
from collections.abc import Callable, Iterable, Sequence
from html import escape

import numpy as np

from fifthwheel.base import pages
from fifthwheel.base.errors import printable_lines
from fifthwheel.base.plots import downsample
from fifthwheel.base.plots.items import BLUE
from fifthwheel.base.types import Array

NOTEBOOK_STYLE = (
    ".fifthwheel table { border-collapse: collapse; } .fifthwheel code { font: inherit; background: none; }"
    " .fifthwheel th, .fifthwheel td { text-align: left; padding: 2px 10px 2px 0; }"
    " .fifthwheel th { border-bottom: 1px solid #999; } .fifthwheel p { margin: 0; }"
    " .fifthwheel .n { text-align: right; }"
)
COURSE_WIDTH, COURSE_HEIGHT = 140, 22
"""Pixels."""
COURSE_POINTS = 2 * COURSE_WIDTH
_OPTION = re.compile(r"(?<!\w)--\w[\w-]*")
_JOINT = re.compile(r"(?<=[^\W\d])([._/])(?=\w)")
"""Where a path may break."""


class Displayed:
    """Base of a result that `print` and a notebook show as a document."""

    def _document(self) -> pages.Document:
        raise NotImplementedError

    def __str__(self) -> str:
        return str(self._document())

    def _repr_html_(self) -> str:
        """What a notebook shows."""
        return notebook(self._document())


def notebook(document: pages.Document) -> str:
    """A document in a notebook: without scripts and plots, with a style of its own."""
    style = f"<style>{NOTEBOOK_STYLE}</style><b>{text(document.title)}</b>"
    return f'<div class="fifthwheel">{style}{blocks(document.blocks)}</div>'


def blocks(parts: Iterable[pages.Block], place: Callable[[pages.CaptionedPlot], str] = lambda _: "") -> str:
    """Blocks as HTML; `place` gives the id of the place of a figure."""
    return "\n".join(_block(part, place) for part in parts)


def _block(block: pages.Block, place: Callable[[pages.CaptionedPlot], str]) -> str:
    match block:
        case pages.Markup():
            return block
        case pages.Table():
            return _table(block)
        case pages.Items():
            return _items(block)
        case pages.Paragraph():
            return f"<p{_attribute('class', 'hint' * isinstance(block, pages.Hint))}>{prose(block.text)}</p>"
        case pages.Heading():
            badge = f' <span class="badge">{text(block.badge)}</span>' if block.badge else ""
            level = "h2" if block.key else "h3"
            return f"<{level}{_attribute('id', block.key)}>{text(block.title)}{badge}</{level}>"
        case pages.Headline():
            columns = [content for column in block.columns if (content := blocks(column, place).strip())]
            lists = "".join(f"<div>{column}</div>" for column in columns)
            lists = f'<div class="lists">{lists}</div>' if lists else ""
            kind = f"verdict{' good' * block.good}"
            return f'<section class="{kind}" id="verdict"><p class="headline">{text(block.text)}</p>{lists}</section>'
        case pages.Values():
            rows = (
                f"<dt>{cell(pages.Code(name))}</dt><dd>{text(str(value))}</dd>" for name, value in block.values.items()
            )
            return f"<dl>{''.join(rows)}</dl>"
        case pages.Plots():
            small = all(figure.small for figure in block.plots)
            figures = "\n".join(_figure(figure, place(figure)) for figure in block.plots)
            return f'<div class="plots{" three" * small}">\n{figures}\n</div>'
        case pages.Folded():
            summary = cell(block.summary) + (f": <span>{text(block.detail)}</span>" if block.detail else "")
            if not block.blocks:
                return f'<p class="hint">{summary}</p>'
            key = _attribute("id", block.key)
            return f"<details{key}><summary>{summary}</summary>{blocks(block.blocks, place)}</details>"
        case pages.Beside():
            return f'<div class="beside">{"".join(f"<div>{_block(part, place)}</div>" for part in block.blocks)}</div>'
        case _:
            lines = "\n".join(block.text.splitlines())
            return f"<pre>{escape(printable_lines(lines))}</pre>"


def _figure(figure: pages.CaptionedPlot, key: str) -> str:
    caption = cell(figure.name) + (f": {text(figure.text)}" if figure.text else "")
    note = f"<small>{text(figure.note)}</small>" if figure.note else ""
    wide = figure.size == "wide"
    style = f' style="--panels: {len(figure.plot.panels)}"' * wide
    place = f'<div class="{f"plot {figure.size}".rstrip()}" id="{key}"{style}></div>'
    return f"<figure{_attribute('class', 'wide' * wide)}><figcaption>{caption}{note}</figcaption>{place}</figure>"


def _items(items: pages.Items) -> str:
    if not items.lines:
        return ""
    tag, head = "ol" if items.ordered else "ul", f"<h3>{text(items.title)}</h3>" if items.title else ""
    return f"{head}<{tag}>{''.join(f'<li>{prose(line)}</li>' for line in items.lines)}</{tag}>"


def _table(table: pages.Table) -> str:
    columns = table.columns
    heads = "".join(f'<th scope="col"{_attribute("class", c.style)}>{text(c.head)}</th>' for c in columns)
    rows = "\n".join(_row(columns, row) for row in table.rows)
    label = _attribute("aria-label", table.label)
    head = f"<thead><tr>{heads}</tr></thead>"
    return f'<div class="scroll"><table{label}>{head}<tbody>\n{rows}\n</tbody></table></div>'


def _row(columns: Sequence[pages.TableColumn], row: Sequence[pages.Cell]) -> str:
    tone = next((cell.row for cell in row if isinstance(cell, pages.Mark)), "")
    cells = []
    for column, content in zip(columns, row, strict=True):
        none = " none" * (content in ("", "–"))
        attributes = _attribute("class", (column.style + none).strip()) + _attribute("data-label", column.label)
        cells.append(f"<td{attributes}>{cell(content)}</td>")
    return f"<tr{_attribute('class', tone)}>{''.join(cells)}</tr>"


def _attribute(name: str, value: str) -> str:
    return f' {name}="{escape(value)}"' if value else ""


def cell(content: pages.Cell) -> str:
    match content:
        case pages.Markup():
            return content
        case pages.Code():
            broken = _JOINT.sub(r"\1<wbr/>", text(content))
            return f"<code>{broken}</code>"
        case pages.Mark():
            symbol = f'<span class="mark">{text(content.symbol)}</span>' if content.symbol else ""
            return f'<span class="{content.kind}">{symbol}{text(content.text)}</span>'
        case pages.Hinted():
            return f'<span title="{text(content.hint)}">{text(content.text)}</span>'
        case _:
            return text(content)


def text(content: str) -> str:
    """A text as HTML, without control characters."""
    return escape(printable_lines(content)).replace("\n", "<br/>")


def prose(content: str) -> str:
    """A text as HTML that does not break between a number and its sigma or per cent sign, nor within an option."""
    html = text(content).replace(" ± ", "\u00a0±\u00a0").replace(" %", "\u00a0%")
    return _OPTION.sub(r'<span class="option">\g<0></span>', html)


def course(time: Array, values: Array) -> pages.Markup:
    """A line as small as a word: values (n,) over time (n,) as SVG that fills its height, interrupted at gaps."""
    finite = values[np.isfinite(values)]
    low, high = (float(finite.min()), float(finite.max())) if finite.size else (0.0, 0.0)
    x = (time - time[0]) / (time[-1] - time[0] or 1.0) * (COURSE_WIDTH - 2) + 1
    y = COURSE_HEIGHT - 1 - (values - low) / ((high - low) or 1.0) * (COURSE_HEIGHT - 2)
    path = "".join(
        "M" + "L".join(f"{x[k]:.1f},{y[k]:.1f}" for k in rows) for rows in downsample.rows(time, values, COURSE_POINTS)
    )
    return pages.Markup(
        f'<svg width="{COURSE_WIDTH}" height="{COURSE_HEIGHT}" role="img">'
        f'<path d="{path}" fill="none" stroke="{BLUE}"/></svg>'
    )
