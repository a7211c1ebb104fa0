"""The frame of a report: one HTML file with its style, its plots and plotly.js inside, so that it opens anywhere.

Plots and plotly.js are deflated, in base64; the browser inflates them (DecompressionStream, in browsers since 2023).
"""

import base64
import json
import zlib
from collections.abc import Sequence
from functools import cache
from html import escape
from importlib import resources
from pathlib import Path

from fifthwheel.report.lines import Plot
from fifthwheel.whole import whole

POLICY = "default-src 'none'; script-src 'unsafe-inline' 'unsafe-eval'; style-src 'unsafe-inline'; img-src data: blob:"
"""What the page may load: nothing from elsewhere."""


def write(path: Path, *, title: str, body: str, plots: Sequence[Plot]) -> None:
    """Write the page, whole or not at all."""
    figures = [{"group": plot.group, "name": plot.name, **plot.figure} for plot in plots]
    parts = [
        _head(title).encode(),
        body.encode(),
        b"\n<noscript><p>The plots need JavaScript; the tables do not.</p></noscript>\n",
    ]
    if plots:
        parts += [
            b'<p id="old" class="hint" hidden>This browser is too old for the plots, which need Chrome or Edge 80, '
            b"Firefox 113, Safari 16.4 or a later one. The tables need nothing.</p>\n",
            _packed("figures", packed(script_json(figures).encode())),
            _packed("library", _plotly_packed()),
            b"<script>",
            _asset("page.js"),
            b"</script>\n",
        ]
    parts.append(b"</body>\n</html>\n")
    with whole(path) as part:
        part.write_bytes(b"".join(parts))


def script_json(value: object) -> str:
    """JSON that can stand inside a <script>: no "<" that could end it; a number that is not finite is an error."""
    text = json.dumps(value, separators=(",", ":"), ensure_ascii=False, allow_nan=False)
    for character in "<>&\u2028\u2029":
        text = text.replace(character, f"\\u{ord(character):04x}")
    return text


def packed(data: bytes) -> bytes:
    """Deflated, in base64."""
    return base64.b64encode(zlib.compress(data, 9))


def unpacked(data: bytes) -> bytes:
    """What was packed."""
    return zlib.decompress(base64.b64decode(data))


def _packed(key: str, data: bytes) -> bytes:
    return b'<script type="application/octet-stream" id="%b">%b</script>\n' % (key.encode(), data)


@cache
def _plotly_packed() -> bytes:
    """The plotly.js that the installed plotly brings, without importing its figures."""
    return packed((resources.files("plotly") / "package_data" / "plotly.min.js").read_bytes())


@cache
def _asset(name: str) -> bytes:
    return (resources.files("fifthwheel.report") / name).read_bytes()


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
