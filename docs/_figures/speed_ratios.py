"""Processor time of `fifthwheel identify`, commit by commit, from the table of benchmarks/speed_history.py."""

import csv
import math
from pathlib import Path

import svg

TABLE = Path(__file__).parents[2] / "benchmarks" / "speed_history.csv"
WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM = 780, 370, 60, 560, 50, 310
LOWEST, HIGHEST, TICKS = 4.0, 80.0, (5, 10, 20, 40, 80)


def draw() -> str:
    """The figure."""
    with TABLE.open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    dates = {row["commit"]: row["date"] for row in rows}
    distance = (RIGHT - LEFT - 60) / max(len(dates) - 1, 1)
    places = {commit: round(LEFT + 30 + i * distance, 1) for i, commit in enumerate(dates)}
    shapes = [
        svg.path([(LEFT, TOP), (LEFT, BOTTOM), (RIGHT, BOTTOM)], "thin"),
        svg.label(12, 28, "processor time of fifthwheel identify, in bare imports of the libraries"),
    ]
    for tick in TICKS:
        shapes.append(svg.path([(LEFT - 4, _height(tick)), (RIGHT, _height(tick))], "thin"))
        shapes.append(svg.label(LEFT - 26, _height(tick) + 4, str(tick), "small"))
    for commit, date in dates.items():
        shapes += [
            svg.label(places[commit], BOTTOM + 20, commit[:6], "small middle"),
            svg.label(places[commit], BOTTOM + 36, date[5:], "small middle"),
        ]
    names: list[tuple[float, str]] = []
    for what in dict.fromkeys(row["what"] for row in rows):
        own = [row for row in rows if row["what"] == what]
        points = [(places[row["commit"]], _height(float(row["bare_imports"]))) for row in own]
        shapes += [svg.path(points), *(svg.circle(x, y, 3, "dark") for x, y in points)]
        names.append((points[-1][1] + 4, what.removeprefix("identify, ")))
    last = 0.0
    for y, name in sorted(names):
        last = max(y, last + 14)  # below each other
        shapes.append(svg.label(RIGHT + 6, last, name, "small"))
    return svg.picture(WIDTH, HEIGHT, "Processor time of identify, commit by commit", shapes)


def _height(ratio: float) -> float:
    share = math.log(ratio / LOWEST) / math.log(HIGHEST / LOWEST)
    return round(BOTTOM - share * (BOTTOM - TOP), 1)
