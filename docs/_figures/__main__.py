"""The build of the site, or `python docs/_figures`, draws all figures outside the gallery into docs/_static.

Only vehicle_model.svg is kept, because the README shows it.
"""

from pathlib import Path

import architecture
import speed_ratios
import tyre_law
import vehicle_model

FIGURES = {
    "architecture.svg": architecture.draw,
    "speed_ratios.svg": speed_ratios.draw,
    "tyre_law.svg": tyre_law.draw,
    "vehicle_model.svg": vehicle_model.draw,
}

if __name__ == "__main__":
    for name, draw in FIGURES.items():
        (Path(__file__).parents[1] / "_static" / name).write_text(draw(), encoding="utf-8")
