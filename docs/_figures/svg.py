"""Shapes of an SVG file as text, so that a figure is the same on every machine and shows its changes."""

from collections.abc import Sequence
from html import escape

STYLE = """
  text { font: 14px sans-serif; fill: #222 } .small { font-size: 12px } .middle { text-anchor: middle }
  .line { stroke: #222; stroke-width: 1.5; fill: none } .thin { stroke: #888; stroke-width: 1; fill: none }
  .box { fill: #e8eef7; stroke: #4a6fa5; stroke-width: 1.5 } .load { fill: #f7efdd; stroke: #b08b3e; stroke-width: 1.5 }
  .axis { stroke: #b3261e; stroke-width: 2; fill: none; marker-end: url(#arrow-axis) } .axis-text { fill: #b3261e }
  .dimension { stroke: #555; stroke-width: 1; fill: none; marker-end: url(#arrow); marker-start: url(#arrow) }
  .flow { stroke: #222; stroke-width: 1.5; fill: none; marker-end: url(#arrow) } .dark { fill: #333 }
  .measured { stroke: #b3261e; stroke-width: 1.5; fill: none; stroke-dasharray: 5 4 }
"""
MARKER = (
    '<marker id="{0}" viewBox="0 0 10 10" refX="9" refY="5" markerWidth="7" markerHeight="7" '
    'orient="auto-start-reverse"><path d="M 0 1 L 10 5 L 0 9 z" fill="{1}"/></marker>'
)


def picture(width: int, height: int, title: str, shapes: Sequence[str]) -> str:
    """The text of a file."""
    markers = MARKER.format("arrow", "#555") + MARKER.format("arrow-axis", "#b3261e")
    body = "\n".join(f"  {shape}" for shape in shapes)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width}" role="img">\n'
        f"  <title>{escape(title)}</title>\n  <style>{STYLE}</style>\n  <defs>{markers}</defs>\n"
        f'  <rect width="{width}" height="{height}" fill="white"/>\n{body}\n</svg>\n'
    )


def path(points: Sequence[tuple[float, float]], kind: str = "line") -> str:
    steps = " L ".join(f"{x:g} {y:g}" for x, y in points)
    return f'<path class="{kind}" d="M {steps}"/>'


def box(x: float, y: float, width: float, height: float, kind: str = "box", turn: str = "") -> str:
    transform = f' transform="{turn}"' if turn else ""
    return f'<rect class="{kind}" x="{x:g}" y="{y:g}" width="{width:g}" height="{height:g}" rx="3"{transform}/>'


def circle(x: float, y: float, radius: float, kind: str = "line") -> str:
    return f'<circle class="{kind}" cx="{x:g}" cy="{y:g}" r="{radius:g}"/>'


def arc(x1: float, y1: float, radius: float, x2: float, y2: float, *, sweep: int, kind: str = "axis") -> str:
    return f'<path class="{kind}" d="M {x1:g} {y1:g} A {radius:g} {radius:g} 0 0 {sweep} {x2:g} {y2:g}"/>'


def label(x: float, y: float, text: str, kind: str = "") -> str:
    return f'<text class="{kind}" x="{x:g}" y="{y:g}">{escape(text)}</text>'
