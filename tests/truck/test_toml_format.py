"""Vehicle files: accepted and refused quantities, refused files, and lossless round trips."""

import json
import pickle
import tomllib
from pathlib import Path

import pytest
import tomli_w
from hypothesis import given, settings
from hypothesis import strategies as st

from fifthwheel.base.errors import VehicleError
from fifthwheel.model.dynamics.model import topology
from fifthwheel.truck import Vehicle, catalogue, unit_of
from fifthwheel.truck.catalogue import edited
from fifthwheel.truck.toml_format import read_quantity
from fifthwheel.truck.uncertainty import changes

TEXT = catalogue.text("cheng_cebon_2011")
PATHS = tuple(catalogue.get("cheng_cebon_2011").parameters())


def test_round_trip(tmp_path: Path) -> None:
    for name in catalogue.names():
        vehicle = catalogue.get(name)
        assert Vehicle.loads(vehicle.to_toml()) == vehicle
    vehicle.save(tmp_path / "vehicle.toml")
    assert Vehicle.load(tmp_path / "vehicle.toml") == vehicle


def test_quantities() -> None:
    for text, unit, value in (
        (475000, "N/rad", 475e3),
        ("8.290313946973065 kN/deg", "N/rad", 475e3),
        ("7.2 t", "kg", 7200),
        ("34.90658503988659 N*m/deg", "N m/rad", 2e3),
        ("3 kN*m/(rad/s)", "N m s/rad", 3e3),
    ):
        assert read_quantity(text, unit, "x") == (pytest.approx(value, rel=1e-12), None)
    for wrong, unit in (("475 kN", "N/rad"), ("475 kN m", "N m/rad"), ("three m", "m"), (True, "m"), ([1.0], "m")):
        with pytest.raises(VehicleError, match=r"^a\.b: expected "):
            read_quantity(wrong, unit, "a.b")


@settings(max_examples=20, deadline=None)
@given(st.dictionaries(st.sampled_from(PATHS), st.just(0.0) | st.floats(0, 1e9)), st.sampled_from(PATHS))
def test_stated_sigmas_round_trip(stated: dict[str, float], path: str) -> None:
    vehicle = catalogue.get("cheng_cebon_2011").with_stated(stated)
    again = Vehicle.loads(vehicle.to_toml())
    assert again == vehicle
    assert hash(again) == hash(vehicle)
    assert again.stated == stated
    assert pickle.loads(pickle.dumps(vehicle)) == vehicle
    assert Vehicle(**json.loads(vehicle.model_dump_json())) == vehicle
    value = vehicle.parameters()[path]
    assert vehicle.replace({path: value * 1.001}).stated == stated
    assert topology(vehicle) == topology(catalogue.get("cheng_cebon_2011"))
    assert vehicle.with_logged_steering({"steer.tractor.front"}, "the log").stated == stated


def test_exact_files_and_stated_sigmas() -> None:
    vehicle = Vehicle.loads("exact = true\n" + TEXT)
    assert vehicle.is_exact
    assert vehicle.stated == dict.fromkeys(PATHS, 0.0)
    text = vehicle.to_toml()
    assert text.count("exact") == 1
    assert Vehicle.loads(text) == vehicle
    assert Vehicle.loads("exact = false\n" + TEXT) == Vehicle.loads(TEXT)
    assert not Vehicle.loads(TEXT).stated
    assert Vehicle.loads(("exact = true\n" + TEXT).replace('"7.2 t"', '"7.2 t exact"')).is_exact
    with pytest.raises(VehicleError, match=r"^tractor\.mass: expected no '\+-' where exact = true, got 72 kg; remove"):
        Vehicle.loads(("exact = true\n" + TEXT).replace('"7.2 t"', '"7.2 t +- 1 %"'))
    for sigmas, message in (
        ({"tractor.masss": 1.0}, r"^tractor\.masss: no such parameter in .*did you mean 'tractor\.mass'"),
        ({"tractor.mass": -1.0}, r"^stated\.tractor\.mass: expected a number >= 0, got -1"),
        ({"tractor.mass": float("inf")}, r"^stated\.tractor\.mass: expected a finite number"),
    ):
        with pytest.raises(VehicleError, match=message):
            Vehicle.loads(TEXT).with_stated(sigmas)


def test_stated_sigmas_by_path() -> None:
    text = TEXT.replace('mass = "7.2 t"', 'mass = "7.2 t +- 2 %"').replace('"-5.49 m"', '"-5.49 m ± 0.1 m"')
    text = text.replace('"-8.0 m"', '"-8 +- 0.02 m"').replace('"1273 kN/rad"', '"1273 kN/rad exact"')
    text = text.replace('"-3.1 m"', '"-3.1 m +/- 5 cm"').replace('"-3.7 m"', '"-3.7 m +- 1 %"')
    text = text.replace('"20122 kg"', '"20122 kg +- 0.3 t"').replace('name = "fifth_wheel"\n', "")
    assert Vehicle.loads(text).stated == {
        "tractor.mass": pytest.approx(144),
        "tractor.drive.position": pytest.approx(0.037),
        "semitrailer.cog": 0.1,
        "semitrailer.payload.mass": 300.0,
        "semitrailer.middle.position": 0.02,
        "semitrailer.cornering_stiffness": 0.0,
        "fifth_wheel.leading_position": 0.05,
    }
    assert Vehicle.loads(text).parameters() == Vehicle.loads(TEXT).parameters()


def test_places_of_accelerometers() -> None:
    """Tables with stated sigmas; one without a table of its own is at the place of the unit's accelerometer. They do
    not change the motion, so no other number depends on them."""
    place = '[unit.accelerometer]\nposition = "-1.2 +- 0.1 m"\nheight = 0.9\n'
    table = '[unit.accelerometers.rear]\nposition = "-4.1 +- 0.2 m"\nheight = "1.1 m"\n'
    text = TEXT.replace("[[unit.axle_group]]", place + table + "[[unit.axle_group]]", 1)
    vehicle = Vehicle.loads(text)
    assert vehicle.parameters()["tractor.accelerometer.height"] == 0.9
    assert vehicle.parameters()["tractor.accelerometers.rear.position"] == -4.1
    assert vehicle.stated == {"tractor.accelerometer.position": 0.1, "tractor.accelerometers.rear.position": 0.2}
    assert Vehicle.loads(vehicle.to_toml()) == vehicle
    assert changes(vehicle) == changes(Vehicle.loads(TEXT))
    tractor = vehicle.units[0]
    assert tractor.place_of_accelerometer("rear") == tractor.accelerometers["rear"]
    assert tractor.place_of_accelerometer("front") == tractor.place_of_accelerometer() == tractor.accelerometer
    assert 'height = "0.7 m"' in edited(text, vehicle.replace({"tractor.accelerometers.rear.height": 0.7}))
    for old, new, message in (
        ('height = "1.1 m"\n', "x = 1\n", r"tractor\.accelerometers\.rear\.x: no such key"),
        ('height = "1.1 m"\n', "", r"tractor\.accelerometers\.rear\.height: expected a value, got none"),
        (table, '[unit.accelerometers]\nrear = "-4.1 m"\n', r"tractor\.accelerometers\.rear: expected a table"),
        ("accelerometers.rear", "accelerometers.Rear", "expected a name of lower-case letters"),
        ('name = "drive"', 'name = "accelerometer"', "reserved"),
    ):
        with pytest.raises(VehicleError, match=message):
            Vehicle.loads(text.replace(old, new))


def test_pneumatic_trail() -> None:
    """A parameter only of the groups that state it; the model of other vehicles does not have it."""
    path, plain = "tractor.front.pneumatic_trail", Vehicle.loads(TEXT)
    vehicle = Vehicle.loads(
        TEXT.replace("steerable = true\n", 'steerable = true\npneumatic_trail = "5 cm +- 1 cm"\n', 1)
    )
    assert vehicle.parameters() == plain.parameters() | {path: 0.05}
    assert vehicle.stated == {path: 0.01}
    assert Vehicle.loads(vehicle.to_toml()) == vehicle
    assert unit_of(path) == "m"
    assert [change.slopes for change in changes(vehicle) if change.name == path] == [{path: 0.01}]
    assert topology(vehicle) != topology(plain)
    assert plain.replace({path: 0.05}).with_stated({path: 0.01}) == vehicle
    with pytest.raises(VehicleError, match="pneumatic_trail: no such parameter"):
        plain.with_stated({path: 0.01})
    with pytest.raises(VehicleError, match=r"pneumatic_trail: expected a number <= 0.5, got 5.0; check its unit"):
        plain.replace({path: 5.0})


def test_number_of_tyres() -> None:
    """By default four on a driven axle, two on each other one; a file may give another number."""
    truck = Vehicle.loads(TEXT)
    assert truck.tyres() == {"tractor.front": 2, "tractor.drive": 4, "semitrailer": 6}
    twin = Vehicle.loads(TEXT.replace("axles = [", "tyres = 12\naxles = ["))
    assert Vehicle.loads(twin.to_toml()) == twin
    assert twin.tyres()["semitrailer"] == 12
    with pytest.raises(VehicleError, match=r"tyres: expected a number >= 2, got 1"):
        Vehicle.loads(TEXT.replace("axles = [", "tyres = 1\naxles = ["))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"475 kN/rad"', '"475 kN/m"', r"^tractor\.front\.cornering_stiffness: expected N/rad or .*got 'kN/m'"),
        (
            "floor_height",
            "floor_hight",
            r"^semitrailer\.payload\.floor_hight: no such key; did you mean 'floor_height'",
        ),
        ("[[unit.axle_group]]", "[[unit.axel_group]]", r"^tractor\.axel_group: .*did you mean 'axle_group'"),
        ("[unit.payload]", "[[unit.payload]]", r"^semitrailer\.payload: expected a table"),
        ("[[coupling]]", "[coupling]", r"^coupling: expected an array of tables"),
        ("steerable = true\n", 'steerable = "perhaps"\n', r"^tractor\.front\.steerable: expected"),
        ('position = "0 m"  ', 'axles = []\nposition = "0 m"  ', r"^tractor\.front: expected either axles or position"),
        ('mass = "7.2 t"', 'mass = "-7.2 t"', r"^tractor\.mass: expected 200 to 300000 kg, the range .*got -7.2 t"),
        (
            '"-3.7 m"',
            '"-0.37 m"',
            r"^tractor: expected 0\.5 to 25 m between neighbouring axles, got 0\.37 m between front and drive",
        ),
        ('"5700 kN m/rad"', '"5700 N m/rad"', r"expected 10000 to 1e\+08 N m/rad, .*got 5700 N m/rad; "),
        ('mass = "7.2 t"', "mass = ", r"^expected TOML"),
        ('"7.2 t"', '"7.2 t +- 2 m"', r"^tractor\.mass: after '\+-': expected kg or .*got 'm'; give .* in percent"),
        (
            '"7.2 t"',
            '"7.2 t +- -2 %"',
            r"^tractor\.mass: after '\+-': expected a finite .*, 0 or more, got .*magnitude",
        ),
        ('"0 kg m^2"', '"0 kg m^2 +- 2 %"', r"^tractor\.sprung\.roll_yaw_product: after .*percent of 0 is 0"),
        ("source", "exact = 1\nsource", r"^exact: expected true or false, got 1; write exact = true"),
        ("source", 'stated = "7 t"\nsource', r"^stated: no such key"),
    ],
)
def test_wrong_files_are_refused(old: str, new: str, message: str) -> None:
    assert old in TEXT
    with pytest.raises(VehicleError, match=message):
        Vehicle.loads(TEXT.replace(old, new))


def test_unreadable_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(VehicleError, match="nowhere"):
        Vehicle.load(tmp_path / "nowhere.toml")
    (tmp_path / "bad.toml").write_text(TEXT.replace("fifth_wheel", "Fifth wheel"), encoding="utf-8")
    with pytest.raises(VehicleError, match=r"bad\.toml: .*name: expected a name of lower-case"):
        Vehicle.load(tmp_path / "bad.toml")


def test_the_size_of_a_vehicle_is_limited() -> None:
    """The time to compile a model grows quickly with its number of states."""
    tables = tomllib.loads(TEXT)
    axles = [{"name": f"a{k}", "position": f"{-k} m"} for k in range(17)]
    group = {
        key: value for key, value in tables["unit"][0]["axle_group"][0].items() if key not in ("position", "steerable")
    }
    with pytest.raises(VehicleError, match=r"axles: expected at most 16, got 17"):
        Vehicle.loads(
            tomli_w.dumps({**tables, "unit": [{**tables["unit"][0], "axle_group": [{**group, "axles": axles}]}]})
        )
    many = {"unit": [{**tables["unit"][1], "name": f"u{k}"} for k in range(9)]}
    many["coupling"] = [{**tables["coupling"][0], "name": f"c{k}", "leading_position": "-9 m"} for k in range(8)]
    with pytest.raises(VehicleError, match=r"^units: expected at most 8, got 9"):
        Vehicle.loads(tomli_w.dumps(tables | many))
