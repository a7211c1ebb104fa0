"""A document as a page: one HTML file that contains its style, its plots and plotly.js, so that it needs no network.

Plots and plotly.js are compressed (deflate) in base64. The page decompresses them itself (`inflate.js`): what a browser
has for it is asynchronous, and a page that is printed at once would have no plots.
"""

import base64
import functools
import json
import re
import zlib
from collections.abc import Callable, Sequence
from dataclasses import replace
from html import escape
from importlib import resources
from pathlib import Path
from typing import Any

from fifthwheel.base import pages
from fifthwheel.base.atomic import atomic_write
from fifthwheel.base.errors import FifthwheelError
from fifthwheel.base.lazy import require
from fifthwheel.base.native import cache
from fifthwheel.base.pages import html
from fifthwheel.base.plots import Plot, plotly_figure

POLICY = "default-src 'none'; script-src 'unsafe-inline' 'unsafe-eval'; style-src 'unsafe-inline'; img-src data: blob:"
"""What the page may load: nothing from elsewhere."""
LEVEL = 5
"""Of the compression; 9 takes twice as long for 1 % less."""
MARGINS = {"": {"l": 56, "r": 12, "t": 30, "b": 44}, "small": {"l": 46, "r": 10, "t": 26, "b": 40}}
"""Around a plot by its size, pixels."""
IMAGE_SIZES = {"tall": (6.4, 4.6), "small": (4.2, 3.0)}
"""Inches."""
IMAGE_FORMATS = ("svg", "png", "pdf")


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
    links = "".join(f'<a href="#{key}">{html.text(title)}</a>' for key, title in sections)
    subtitle = "".join(f'<p class="subtitle">{html.text(line)}</p>\n' for line in document.subtitle.splitlines())
    name = f'<span class="result">, {html.text(document.name)}</span>' if document.name else ""
    full_title = f"{document.title}, {document.name}" if document.name else document.title
    body = f"""{_head(full_title)}<main{' class="sheet"' * document.sheet}><h1>{html.text(document.title)}{name}</h1>
{subtitle}<nav>{links}</nav>
{html.blocks(document.blocks, place)}</main>
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
    """What is folded away at the end of the page, with a button that unfolds all of it."""
    if not parts:
        return ""
    button = '<button type="button" id="unfold">Unfold all, such as for printing</button>'
    return f'<section id="appendix"><h2>Appendix</h2>{button}\n{html.blocks(parts, place)}</section>'


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
        raise FifthwheelError(f"--figures: expected {', '.join(IMAGE_FORMATS)}, got {name}")
    try:
        require("matplotlib", "figures")
    except FifthwheelError as error:
        raise FifthwheelError(f"--figures: {error}") from None
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
<title>{html.text(title)}: fifthwheel</title>
<style>
{_asset("page.css").decode()}</style>
</head>
<body>
"""
