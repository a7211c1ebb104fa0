"""A line as small as a word."""

import numpy as np

from fifthwheel._html import Markup
from fifthwheel._types import Array
from fifthwheel.plots import downsample
from fifthwheel.plots.palette import BLUE

WIDTH, HEIGHT = 140, 22
"""Pixels."""
POINTS = 2 * WIDTH


def sparkline(time: Array, values: Array) -> Markup:
    """Values (n,) over time (n,) as inline SVG that fills its height; interrupted at gaps."""
    finite = values[np.isfinite(values)]
    low, high = (float(finite.min()), float(finite.max())) if finite.size else (0.0, 0.0)
    x = (time - time[0]) / (time[-1] - time[0] or 1.0) * (WIDTH - 2) + 1
    y = HEIGHT - 1 - (values - low) / ((high - low) or 1.0) * (HEIGHT - 2)
    path = "".join(
        "M" + "L".join(f"{x[k]:.1f},{y[k]:.1f}" for k in rows) for rows in downsample.rows(time, values, POINTS)
    )
    return Markup(
        f'<svg width="{WIDTH}" height="{HEIGHT}" role="img"><path d="{path}" fill="none" stroke="{BLUE}"/></svg>'
    )
