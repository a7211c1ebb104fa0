"""Vehicle files: accepted and refused quantities, refused files, and lossless round trips."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fifthwheel.errors import VehicleError
from fifthwheel.vehicle import catalogue, dump, load, save
from fifthwheel.vehicle.files import loads, read_quantity

TEXT = catalogue.text("cheng_cebon_2011")


@pytest.mark.parametrize("name", catalogue.names())
def test_round_trip(name: str, tmp_path: Path) -> None:
    vehicle = catalogue.get(name)
    assert loads(dump(vehicle)) == vehicle
    save(vehicle, tmp_path / "vehicle.toml")
    assert load(tmp_path / "vehicle.toml") == vehicle


@given(st.floats(1e4, 1e7))
def test_round_trip_is_exact(stiffness: float) -> None:
    vehicle = catalogue.get("cheng_cebon_2011").replace({"semitrailer.cornering_stiffness": stiffness})
    assert loads(dump(vehicle)) == vehicle


@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [
        (475000, "N/rad", 475e3),
        ("475000", "N/rad", 475e3),
        ("475 kN/rad", "N/rad", 475e3),
        ("475kN/rad", "N/rad", 475e3),
        ("8.290313946973065 kN/deg", "N/rad", 475e3),
        ("8290.313946973065 N/degree", "N/rad", 475e3),
        ("4.75e2 kN / rad", "N/rad", 475e3),
        ("7.2 t", "kg", 7200),
        ("15000 lb", "kg", 6803.88555),
        ("-3700 mm", "m", -3.7),
        ("22000 kg m^2", "kg m^2", 22e3),
        ("22 t*m**2", "kg m^2", 22e3),
        ("22000 kg·m²", "kg m^2", 22e3),
        ("2 kN m/rad", "N m/rad", 2e3),
        ("34.90658503988659 N*m/deg", "N m/rad", 2e3),
        ("3 kN m s/rad", "N m s/rad", 3e3),
        ("3 kN*m/(rad/s)", "N m s/rad", 3e3),
    ],
)
def test_quantities(text: object, unit: str, value: float) -> None:
    assert read_quantity(text, unit, "x") == (pytest.approx(value, rel=1e-12), None)


@pytest.mark.parametrize(
    ("value", "unit"),
    [
        ("475 kN/m", "N/rad"),
        ("475 kN", "N/rad"),  # no angle
        ("475 kN m/rad", "N/rad"),
        ("475 kN/rad", "N m/rad"),
        ("475 kN m", "N m/rad"),
        ("3 kN m/rad", "N m s/rad"),
        ("3 kg", "m"),
        ("3 furlongish", "m"),
        ("3 m^^", "m"),
        ("three m", "m"),
        ("", "m"),
        (True, "m"),
        ([1.0], "m"),
    ],
)
def test_wrong_quantities_are_refused(value: object, unit: str) -> None:
    with pytest.raises(VehicleError, match=r"^a\.b: expected "):
        read_quantity(value, unit, "a.b")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"475 kN/rad"', '"475 kN/m"', r"^tractor\.front\.cornering_stiffness: expected N/rad or .*got 'kN/m'"),
        ('"1273 kN/rad"', '"1273 kN"', r"^semitrailer\.cornering_stiffness: expected N/rad or .*got 'kN'"),
        ('"-8.0 m"', '"-8.0 kg"', r"^semitrailer\.middle\.position: expected m or .*got 'kg'"),
        ('"5.3 t"', '"5.3 m"', r"^tractor\.sprung\.mass: expected kg or .*got 'm'"),
        (
            "floor_height",
            "floor_hight",
            r"^semitrailer\.payload\.floor_hight: no such key; did you mean 'floor_height'",
        ),
        ("[[unit.axle_group]]", "[[unit.axel_group]]", r"^tractor\.axel_group: .*did you mean 'axle_group'"),
        ("[[coupling]]", "[[couplings]]", r"^couplings: no such key; did you mean 'coupling'"),
        ("[unit.payload]", "[[unit.payload]]", r"^semitrailer\.payload: expected a table"),
        ("[[coupling]]", "[coupling]", r"^coupling: expected an array of tables"),
        ("steerable = true\n", 'steerable = "perhaps"\n', r"^tractor\.front\.steerable: expected"),
        ('position = "0 m"  ', 'axles = []\nposition = "0 m"  ', r"^tractor\.front: expected either axles or position"),
        ('mass = "7.2 t"', 'mass = "-7.2 t"', r"^tractor\.mass: expected a number > 0, got -7200"),
        ('mass = "7.2 t"', "mass = ", r"^expected TOML"),
    ],
)
def test_wrong_files_are_refused(old: str, new: str, message: str) -> None:
    assert old in TEXT
    with pytest.raises(VehicleError, match=message):
        loads(TEXT.replace(old, new))


def test_unreadable_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(VehicleError, match="nowhere"):
        load(tmp_path / "nowhere.toml")
    (tmp_path / "bad.toml").write_text(TEXT.replace("fifth_wheel", "Fifth wheel"), encoding="utf-8")
    with pytest.raises(VehicleError, match=r"bad\.toml: .*name: expected a name of lower-case"):
        load(tmp_path / "bad.toml")
