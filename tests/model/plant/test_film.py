"""Strip and animation: valid files with content, geometry of the drawn shapes, refused arguments."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fifthwheel.base.errors import SignalError
from fifthwheel.model.plant import PlantRun, Properties
from fifthwheel.truck import Vehicle, get

sys.path.insert(0, str(Path(__file__).resolve().parents[3] / "examples"))
from film import film

pytest.importorskip("matplotlib")


def synthetic_run(vehicle: Vehicle, *, yaw: float = 0.0, roll: float = 0.0, acceleration: float = 0.0) -> PlantRun:
    """Straight ahead at 20 m/s for 12 s without articulation, with a pulse of lateral acceleration at 8 s."""
    time = np.linspace(0, 12, 49)
    truth = {"speed": np.full_like(time, 20.0)}
    origin = 0.0
    for i, unit in enumerate(vehicle.units):
        if i:
            origin += vehicle.couplings[i - 1].leading_position - vehicle.couplings[i - 1].trailing_position
        distance = 20 * time + origin + unit.cog
        truth |= {
            f"position_x.{unit.name}": np.cos(yaw) * distance,
            f"position_y.{unit.name}": np.sin(yaw) * distance,
            f"yaw.{unit.name}": np.full_like(time, yaw),
            f"roll.{unit.name}": np.full_like(time, roll),
            f"lateral_acceleration.{unit.name}": acceleration * np.exp(-((time - 8) ** 2)),
        }
        for axle in unit.axles:
            truth[f"vertical_force.{unit.name}.{axle.name}"] = np.full_like(time, 7e4)
            truth[f"load_transfer.{unit.name}.{axle.name}"] = np.full_like(time, 10 * roll)
    return PlantRun(vehicle=vehicle, properties=Properties(), time=time, truth=truth, name="synthetic")


@pytest.mark.slow
def test_animation(tmp_path: Path):
    from PIL import Image

    run = synthetic_run(get("cheng_cebon_2011"), roll=0.01, acceleration=1.0)
    second = (run.time > 6.5) & (run.time <= 7.5)
    time, truth = run.time[second], {name: values[second] for name, values in run.truth.items()}
    short = replace(run, time=time - time[0], truth=truth)
    with Image.open(film(short, tmp_path / "film.gif")) as animation:
        assert animation.n_frames >= 15
        assert animation.info["duration"] == 50
        first = np.array(animation.convert("L"))
        animation.seek(animation.n_frames - 1)
        assert (np.array(animation.convert("L")) != first).mean() > 0.005


def test_any_chain_or_the_name_of_what_is_missing(tmp_path: Path):
    run = synthetic_run(get("a_double"), roll=0.01, acceleration=1.0)
    for name, message in (("film.mpeg", r"\.png, \.svg, \.gif"), ("strip.png", "roll.second: missing")):
        if name == "strip.png":
            path = film(run, tmp_path / "strip.SVG")
            assert path.read_text(encoding="utf-8").rstrip().endswith("</svg>")
            del run.truth["roll.second"]
        with pytest.raises(SignalError, match=message):
            film(run, tmp_path / name)
        assert not (tmp_path / name).exists()
