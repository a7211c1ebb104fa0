"""The strip and the film: files of the right kind, not blank, refused where they cannot be; left is left."""

import sys
from pathlib import Path

import numpy as np
import pytest

from fifthwheel.errors import FifthwheelError, SignalError
from fifthwheel.plant import Drive, Plant, Properties, course
from fifthwheel.report.film import LIGHT, _parts, _Scene, _window, film
from fifthwheel.vehicle import Vehicle, get

pytest.importorskip("matplotlib")


@pytest.fixture(scope="module")
def drive() -> Drive:
    pytest.importorskip("mujoco")
    truck = get("cheng_cebon_2011")
    return Plant(truck).drive(course("lane_changes", truck, count=1, speed=88 / 3.6))


def made_up(vehicle: Vehicle, *, yaw: float = 0.0, roll: float = 0.0, pull: float = 0.0) -> Drive:
    """Straight ahead at 20 m/s for 12 s, as a stiff rod, with one pulse of lateral acceleration at 8 s."""
    time = np.linspace(0, 12, 49)
    truth = {"speed": np.full_like(time, 20.0)}
    origin = 0.0
    for i, unit in enumerate(vehicle.units):
        if i:
            origin += vehicle.couplings[i - 1].leading_position - vehicle.couplings[i - 1].trailing_position
        along = 20 * time + origin + unit.cog
        truth |= {
            f"position_x.{unit.name}": np.cos(yaw) * along,
            f"position_y.{unit.name}": np.sin(yaw) * along,
            f"yaw.{unit.name}": np.full_like(time, yaw),
            f"roll.{unit.name}": np.full_like(time, roll),
            f"lateral_acceleration.{unit.name}": pull * np.exp(-((time - 8) ** 2)),
        }
        for axle in unit.axles:
            truth[f"vertical_force.{unit.name}.{axle.name}"] = np.full_like(time, 7e4)
            truth[f"load_transfer.{unit.name}.{axle.name}"] = np.full_like(time, 10 * roll)
    return Drive(vehicle=vehicle, properties=Properties(), time=time, truth=truth, name="made up")


def semitrailer() -> Vehicle:
    return get("cheng_cebon_2011")


def alone() -> Vehicle:
    told = semitrailer().model_dump()
    return Vehicle(name="truck", units=told["units"][:1])


def b_double() -> Vehicle:
    told = semitrailer().model_dump()
    tractor, trailer = told["units"]
    wheel = told["couplings"][0]
    second = wheel | {"name": "second", "leading_position": -7.8}
    return Vehicle(name="b_double", units=[tractor, trailer | {"name": "lead"}, trailer], couplings=[wheel, second])


def with_dolly() -> Vehicle:
    told = semitrailer().model_dump()
    tractor, trailer = told["units"]
    wheel, axles = told["couplings"][0], trailer["axle_groups"][0]
    dolly = trailer | {"name": "dolly", "cog": -4.0, "payload": None}
    dolly["axle_groups"] = [axles | {"axles": [{"name": "axle", "position": -4.0}]}]
    eye = wheel | {"name": "eye", "leading_position": -5.3}
    return Vehicle(
        name="dolly", units=[tractor, dolly, trailer], couplings=[eye, wheel | {"leading_position": -4.0, "name": "on"}]
    )


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
        assert moving.info["duration"] == 50
        first = np.array(moving.convert("L"))
        moving.seek(moving.n_frames - 1)
        assert (np.array(moving.convert("L")) != first).mean() > 0.005


def test_refused(drive: Drive, tmp_path: Path):
    with pytest.raises(SignalError, match=r"\.png, \.svg, \.gif"):
        film(drive, tmp_path / "film.mpeg")
    with pytest.raises(SignalError):
        film(drive, tmp_path / "film.png", start=50.0, stop=60.0)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("vehicle", [alone, b_double, with_dolly])
def test_any_chain(vehicle, tmp_path: Path):
    path = film(made_up(vehicle(), roll=0.01, pull=1.0), tmp_path / "strip.SVG")
    assert path.read_text(encoding="utf-8").rstrip().endswith("</svg>")


def test_same_drive_same_file(tmp_path: Path):
    drive = made_up(semitrailer())
    once, twice = (film(drive, tmp_path / name).read_bytes() for name in ("a.svg", "b.svg"))
    assert once == twice


@pytest.mark.parametrize(
    ("vehicle", "bodies"), [(alone, [0]), (semitrailer, [1]), (b_double, [1, 2]), (with_dolly, [0, 2])]
)
def test_who_has_a_body(vehicle, bodies):
    truck = vehicle()
    parts = [_parts(truck, i) for i in range(len(truck.units))]
    assert [i for i, found in enumerate(parts) if LIGHT in [part[0] for part in found]] == bodies
    assert all(rear < front for found in parts for _, rear, front, _ in found)
    for unit, ((_, rear, front, _), *more) in zip(truck.units, parts, strict=True):  # the frame bears every axle
        front = max([front, *(part[2] for part in more)])
        assert all(rear < axle.position < front for axle in unit.axles)


@pytest.mark.parametrize("yaw", [0.0, 0.2, 3.0])
def test_from_above_is_true_to_scale_and_the_way_ahead_is_up(yaw):
    drive = made_up(semitrailer(), yaw=yaw)
    drive.truth["yaw.semitrailer"] = drive.truth["yaw.semitrailer"] + 0.05 * (drive.time > 6)  # points to the left then
    body = max(_polygons(_Scene(drive, np.array([3.0, 9.0]), 5.0), "above", 1), key=lambda shape: np.ptp(shape.imag))
    ((rear, front),) = [(rear, front) for shade, rear, front, _ in _parts(drive.vehicle, 1) if shade == LIGHT]
    assert abs(body[1] - body[0]) == pytest.approx(front - rear)
    assert np.angle(body[1] - body[0]) == pytest.approx(np.pi / 2 + 0.05)


@pytest.mark.parametrize("roll", [0.02, -0.02])
def test_body_leans_and_presses_down_its_tyre_on_the_side_of_its_roll(roll):
    drive, leans = made_up(semitrailer(), roll=roll), []
    for factor in (1.0, 5.0):
        shapes = _polygons(_Scene(drive, np.array([3.0, 9.0]), factor), "behind", 0)
        body = max(shapes, key=lambda shape: np.abs(shape - shape.mean()).max())  # of either unit: both lean
        leans.append(np.angle((body[1] - body[0]) / 1j))
        left, right = sorted((s for s in shapes if np.ptp(s.real) < 0.5), key=lambda shape: shape.real.mean())
        assert np.sign(left.imag.max() - right.imag.max()) == np.sign(roll)
    assert leans == pytest.approx([-roll, -5 * roll])


def test_window_is_where_it_is_lively():
    first, last = _window(made_up(semitrailer(), pull=-2.0), None, None, 4.0)
    assert first == pytest.approx(6.0)
    assert last == pytest.approx(10.0)
    assert _window(made_up(semitrailer()), None, 3.0, 4.0) == (0.0, 3.0)
    assert _window(made_up(semitrailer()), 10.0, None, 4.0) == (10.0, 12.0)
    assert _window(made_up(semitrailer()), None, None, 20.0) == (0.0, 12.0)


@pytest.mark.parametrize("given", [{"start": 3.0, "stop": 2.0}, {"start": -1.0}, {"stop": 12.5}, {"start": np.nan}])
def test_windows_that_cannot_be(given, tmp_path: Path):
    with pytest.raises(SignalError, match="start, stop"):
        film(made_up(semitrailer()), tmp_path / "strip.png", **given)


@pytest.mark.parametrize("factor", [0.0, -1.0, np.nan, 100.0])
def test_factors_that_cannot_be(factor, tmp_path: Path):
    with pytest.raises(SignalError, match="exaggerate"):
        film(made_up(semitrailer()), tmp_path / "strip.png", exaggerate=factor)


@pytest.mark.parametrize("name", ["roll.semitrailer", "speed", "load_transfer.semitrailer.rear"])
def test_names_what_is_missing(name, tmp_path: Path):
    drive = made_up(semitrailer())
    del drive.truth[name]
    with pytest.raises(SignalError, match=f"{name}: missing"):
        film(drive, tmp_path / "strip.png")


def test_without_matplotlib(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(FifthwheelError, match=r"\.\[paper\]"):
        film(made_up(semitrailer()), tmp_path / "strip.png")


def test_an_old_file_stays_when_drawing_fails(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    def fail(*_args: object, **_more: object) -> None:
        raise OSError("disk full")

    (tmp_path / "strip.png").write_text("old", encoding="utf-8")
    monkeypatch.setattr("matplotlib.figure.Figure.savefig", fail)
    with pytest.raises(OSError, match="disk full"):
        film(made_up(semitrailer()), tmp_path / "strip.png")
    assert [(path.name, path.read_text(encoding="utf-8")) for path in tmp_path.iterdir()] == [("strip.png", "old")]


def _polygons(scene: _Scene, view: str, k: int) -> list[np.ndarray]:
    """Corners of all that is drawn filled, right + i up, m."""
    from matplotlib.figure import Figure

    axes = Figure().add_subplot()
    getattr(scene, view)(axes, k)
    return [patch.get_xy()[:-1] @ [1, 1j] for patch in axes.patches]
