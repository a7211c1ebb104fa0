"""Blocks of a document as HTML, for a notebook or as a page in one file, which needs no network.

The page contains its style, its plots and plotly.js. Plots and plotly.js are compressed (deflate) in base64. The page
decompresses them itself (`inflate.js`): what a browser has for it is asynchronous, and a page that is printed at once
would have no plots.
"""

import base64
import functools
import json
import re
import zlib
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from html import escape
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from fifthwheel.base import pages
from fifthwheel.base.atomic import atomic_write
from fifthwheel.base.errors import FifthwheelError, printable_lines
from fifthwheel.base.lazy import require
from fifthwheel.base.native import cache
from fifthwheel.base.plots import Plot, downsample, plotly_figure
from fifthwheel.base.plots.items import BLUE
from fifthwheel.base.spelling import setting
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
POLICY = "default-src 'none'; script-src 'unsafe-inline' 'unsafe-eval'; style-src 'unsafe-inline'; img-src data: blob:"
"""What the page may load: nothing from elsewhere."""
LEVEL = 5
"""Of the compression; 9 takes twice as long for 1 % less."""
MARGINS = {"": {"l": 56, "r": 12, "t": 30, "b": 44}, "small": {"l": 46, "r": 10, "t": 26, "b": 40}}
"""Around a plot by its size, pixels."""
IMAGE_SIZES = {"tall": (6.4, 4.6), "small": (4.2, 3.0)}
"""Inches."""
IMAGE_FORMATS = ("svg", "png", "pdf")


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


def course(time: Array, values: Array, visible: tuple[float, float] | None = None) -> pages.Markup:
    """A line as small as a word: values (n,) over time (n,) as SVG, interrupted at gaps, in a range or that of all."""
    values = values if visible is None else np.clip(values, *visible)
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


def write(path: Path, document: pages.Document, *, images: str | None = None) -> list[Path]:
    """Write a document as a page, atomically.

    Args:
        images: "svg", "png" or "pdf" to write every figure into the folder "figures" beside the page too.

    Returns:
        The images that were written.

    Raises:
        FifthwheelError: the format of the images is unknown, or matplotlib is not installed.
        OSError: a file cannot be written.
    """
    content, figures = page(document)
    written = [] if images is None else save_images(path.parent / "figures", figures, images)
    with atomic_write(path) as temporary:
        temporary.write_bytes(content)
    return written


def page(document: pages.Document) -> tuple[bytes, list[pages.CaptionedPlot]]:
    """The bytes of the page, and its figures in their order."""
    figures: list[pages.CaptionedPlot] = []

    def place(figure: pages.CaptionedPlot) -> str:
        figures.append(figure)
        return f"plot{len(figures) - 1}"

    sections = [(block.key, block.title) for block in document.blocks if isinstance(block, pages.Heading) and block.key]
    if document.appendix:
        sections.append(("appendix", "Appendix"))
    links = "".join(f'<a href="#{key}">{text(title)}</a>' for key, title in sections)
    subtitle = "".join(f'<p class="subtitle">{text(line)}</p>\n' for line in document.subtitle.splitlines())
    name = f'<span class="result">, {text(document.name)}</span>' if document.name else ""
    full_title = f"{document.title}, {document.name}" if document.name else document.title
    body = f"""{_head(full_title)}<main{' class="sheet"' * document.sheet}><h1>{text(document.title)}{name}</h1>
{subtitle}<nav>{links}</nav>
{blocks(document.blocks, place)}</main>
{_appendix(document.appendix, place)}
<noscript><p>The plots need JavaScript; the tables do not.</p></noscript>
"""
    content = [body.encode()]
    if figures:
        content += [
            _data_script("figures", compressed(f"[{','.join(script_json(_drawn(f)) for f in figures)}]".encode())),
            _data_script("library", _plotly()),
            b"<script>",
            _asset("inflate.js"),
            _asset("page.js"),
            b"</script>\n",
        ]
    return b"".join([*content, b"</body>\n</html>\n"]), figures


def _appendix(parts: Sequence[pages.Folded], place: Callable[[pages.CaptionedPlot], str]) -> str:
    """What is folded away at the end of the page. It is unfolded in print."""
    if not parts:
        return ""
    return f'<section id="appendix"><h2>Appendix</h2>\n{blocks(parts, place)}</section>'


def _drawn(figure: pages.CaptionedPlot) -> dict[str, Any]:
    """A figure as the script of the page takes it; the script makes a legend that wraps."""
    drawn = plotly_figure.figure(_untitled(figure))
    layout = {"showlegend": False, "margin": MARGINS.get(figure.size, MARGINS[""])}
    return {"group": figure.group, "name": figure.path, "data": drawn["data"], "layout": drawn["layout"] | layout}


def _untitled(figure: pages.CaptionedPlot) -> Plot:
    """A plot without titles, in place of which a figure has its caption; many panels keep theirs."""
    plot = figure.plot
    titled = figure.size == "wide"
    return replace(plot, title="", panels=plot.panels if titled else [replace(p, title="") for p in plot.panels])


def checked_format(name: str) -> str:
    """The format of images, if they can be written in it.

    Raises:
        FifthwheelError: the format is unknown, or matplotlib is not installed.
    """
    if name not in IMAGE_FORMATS:
        raise FifthwheelError(f"{setting('figures')}: expected {', '.join(IMAGE_FORMATS)}, got {name}")
    try:
        require("matplotlib", "figures")
    except FifthwheelError as error:
        raise FifthwheelError(f"{setting('figures')}: {error}") from None
    return name


def save_images(folder: Path, figures: Sequence[pages.CaptionedPlot], image_format: str) -> list[Path]:
    """Write every figure as folder/log/section/signal.format; returns the paths; errors as of `checked_format`."""
    checked_format(image_format)
    written: list[Path] = []
    for figure in figures:
        path = folder.joinpath(*map(file_name, figure.path))
        path, number = path.with_name(f"{path.name}.{image_format}"), 2
        while path in written:
            path, number = path.with_name(f"{path.stem} {number}.{image_format}"), number + 1
        path.parent.mkdir(parents=True, exist_ok=True)
        log, _, name = figure.path
        size = (8.0, 0.6 + 1.2 * len(figure.plot.panels)) if figure.size == "wide" else IMAGE_SIZES.get(figure.size)
        replace(_untitled(figure), title=f"{log}: {name}").save(path, size=size)
        written.append(path)
    return written


def file_name(text: str) -> str:
    """A text as a file name that every file system accepts."""
    return re.sub(r"[^\w.+ -]+", "_", text).strip(" .")[:80] or "_"


def script_json(value: object) -> str:
    """JSON that cannot end a <script>; a number that is not finite is an error."""
    text = json.dumps(value, separators=(",", ":"), ensure_ascii=False, allow_nan=False)
    for character in "<>&\u2028\u2029":
        text = text.replace(character, f"\\u{ord(character):04x}")
    return text


def compressed(data: bytes) -> bytes:
    """Data compressed by deflate, in base64."""
    return base64.b64encode(zlib.compress(data, LEVEL))


def _data_script(key: str, data: bytes) -> bytes:
    return b'<script type="application/octet-stream" id="%b">%b</script>\n' % (key.encode(), data)


@functools.cache
def _plotly() -> bytes:
    """The plotly.js of the installed plotly, compressed; a cache on disk has it from an earlier report."""
    script = (resources.files("plotly") / "package_data" / "plotly.min.js").read_bytes()
    key = cache.DIGEST(b"plotly.js, deflate %d\n" % LEVEL + script).digest()
    result = cache.read(key)
    if result is None:
        result = compressed(script)
        cache.write(key, result)
    return result


@functools.cache
def _asset(name: str) -> bytes:
    return (resources.files(__package__) / name).read_bytes()


def _head(title: str) -> str:
    return f"""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="{escape(POLICY)}">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{text(title)}: fifthwheel</title>
<style>
{_asset("page.css").decode()}</style>
</head>
<body>
"""
