"""The picture strip and the film: files of the right kind, not blank, and refused where they cannot be."""

from pathlib import Path

import numpy as np
import pytest

from fifthwheel.errors import SignalError
from fifthwheel.plant import Drive, Plant, course
from fifthwheel.report.film import film
from fifthwheel.vehicle import get

pytest.importorskip("mujoco")
pytest.importorskip("matplotlib")


@pytest.fixture(scope="module")
def drive() -> Drive:
    truck = get("cheng_cebon_2011")
    return Plant(truck).drive(course("lane_changes", truck, count=1))


def test_strip(drive: Drive, tmp_path: Path):
    from matplotlib.image import imread

    picture = imread(film(drive, tmp_path / "strip.png"))
    assert min(picture.shape[:2]) > 500
    assert np.std(picture[..., :3]) > 0.05
    assert [path.name for path in tmp_path.iterdir()] == ["strip.png"]


def test_film(drive: Drive, tmp_path: Path):
    from PIL import Image

    with Image.open(film(drive, tmp_path / "film.gif", start=1.0, stop=2.0)) as moving:
        assert moving.n_frames >= 15
        first = np.array(moving.convert("L"))
        moving.seek(moving.n_frames - 1)
        assert (np.array(moving.convert("L")) != first).mean() > 0.005


def test_refused(drive: Drive, tmp_path: Path):
    with pytest.raises(SignalError, match=r"\.png, \.svg, \.gif"):
        film(drive, tmp_path / "film.mpeg")
    with pytest.raises(SignalError):
        film(drive, tmp_path / "film.png", start=50.0, stop=60.0)
    assert not list(tmp_path.iterdir())
