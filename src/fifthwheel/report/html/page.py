"""The frame of a page: one HTML file that contains its style, its plots and plotly.js, so that it needs no network.

Plots and plotly.js are compressed (deflate) in base64; the browser decompresses them with DecompressionStream.
"""

import base64
import functools
import json
import zlib
from collections.abc import Sequence
from html import escape
from importlib import resources
from pathlib import Path

from fifthwheel._atomic import atomic_write
from fifthwheel.native import cache
from fifthwheel.report.figures.primitives import ReportPlot

POLICY = "default-src 'none'; script-src 'unsafe-inline' 'unsafe-eval'; style-src 'unsafe-inline'; img-src data: blob:"
"""What the page may load: nothing from elsewhere."""
LEVEL = 5
"""Of the compression; 9 takes twice as long for 1 % less."""


def write_page(path: Path, *, title: str, body: str, plots: Sequence[ReportPlot]) -> None:
    """Write the page atomically."""
    figures = [{"group": plot.group, "name": plot.name, **plot.figure} for plot in plots]
    content = [
        _head(title).encode(),
        body.encode(),
        b"\n<noscript><p>The plots need JavaScript; the tables do not.</p></noscript>\n",
    ]
    if plots:
        content += [
            b'<p id="unsupported" class="hint" hidden>This browser is too old for the plots. They need Chrome or Edge '
            b"80, Firefox 113, Safari 16.4 or later. The tables are complete.</p>\n",
            _data_script("figures", compressed(script_json(figures).encode())),
            _data_script("library", _plotly()),
            b"<script>",
            _asset("page.js"),
            b"</script>\n",
        ]
    content.append(b"</body>\n</html>\n")
    with atomic_write(path) as temporary:
        temporary.write_bytes(b"".join(content))


def script_json(value: object) -> str:
    """JSON that cannot end a <script>; a number that is not finite is an error."""
    text = json.dumps(value, separators=(",", ":"), ensure_ascii=False, allow_nan=False)
    for character in "<>&\u2028\u2029":
        text = text.replace(character, f"\\u{ord(character):04x}")
    return text


def compressed(data: bytes) -> bytes:
    """Data compressed by deflate, in base64."""
    return base64.b64encode(zlib.compress(data, LEVEL))


def decompressed(data: bytes) -> bytes:
    """The inverse of `compressed`."""
    return zlib.decompress(base64.b64decode(data))


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
<title>{escape(title)}</title>
<style>
{_asset("page.css").decode()}</style>
</head>
<body>
"""
