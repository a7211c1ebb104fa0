"""Numbers from vehicle classes: against the catalogue, by the laws that they follow, never instead of a stated one."""

import tomllib

import pytest
import tomli_w

from fifthwheel.base.errors import VehicleError
from fifthwheel.truck import Vehicle, catalogue
from fifthwheel.truck.classes import CLASSES

TEXT = """
name = "brochure"
[[unit]]
name = "tractor"
class = "tractor_4x2"
mass = "7.2 t"
[[unit.axle_group]]
name = "front"
position = "0 m"
[[unit.axle_group]]
name = "drive"
position = "-3.7 m"
[[unit]]
name = "semitrailer"
class = "semitrailer_3"
mass = "33.45 t +- 1 %"
[unit.payload]
mass = "20 t +- 300 kg"
[[unit.axle_group]]
axles = [
  { name = "front", position = "-6.7 m" },
  { name = "middle", position = "-8.0 m" },
  { name = "rear", position = "-9.3 m" },
]
[[coupling]]
leading_position = "-3.1 m"
"""
LADEN = '33.45 t +- 1 %"\n[unit.payload]\nmass = "20 t +- 300 kg"'
KNOWN = {"mass", "position", "leading_position", "trailing_position", "roll_yaw_product"}
"""Quantities that the files of the next test state."""


def edited(old: str, new: str) -> Vehicle:
    assert TEXT.count(old) >= 1
    return Vehicle.loads(TEXT.replace(old, new, 1))


@pytest.mark.parametrize(
    ("name", "classes"),
    [("cheng_cebon_2011", ["tractor_4x2", "semitrailer_3"]), ("auburn_6x4", ["tractor_6x4", "semitrailer_2"])],
)
def test_a_published_vehicle_is_within_the_uncertainty(name: str, classes: list[str]) -> None:
    """Of masses and lengths alone, the classes give every other number of the catalogue's vehicles."""
    truth = catalogue.get(name)
    table = tomllib.loads(truth.to_toml())
    for unit, kind in zip(table["unit"], classes, strict=True):
        unit["class"] = kind
        for part in (unit, unit["sprung"], unit.get("payload", {}), *unit["axle_group"]):
            for key in {"name", "class", "sprung", "payload", "axle_group", "axles", "steerable", *KNOWN} ^ part.keys():
                part.pop(key, None)
    for coupling in table["coupling"]:
        for key in ("height", "roll_stiffness", "roll_damping"):
            del coupling[key]
    completed = Vehicle.loads(tomli_w.dumps(table))
    values, true = completed.parameters(), truth.parameters()
    others = [path for path in true if path.rpartition(".")[2] not in KNOWN and path != "fifth_wheel.roll_damping"]
    assert set(completed.assumed) == set(others)
    deviation = {path: (values[path] - true[path]) / completed.stated[path] for path in others}
    # relaxation: the Auburn set has none
    far = {path: d for path, d in deviation.items() if abs(d) > 2.5 and not path.endswith("relaxation_length")}
    assert not far
    assert sum(abs(d) < 1 for d in deviation.values()) > 0.6 * len(deviation)


def test_what_the_file_states_stays() -> None:
    vehicle = edited('mass = "7.2 t"', 'mass = "7.2 t"\nyaw_inertia = "25000 kg m^2 +- 5 %"\ncog = "-1.1 m"')
    assert vehicle.parameters()["tractor.yaw_inertia"] == 25000
    assert vehicle.stated["tractor.yaw_inertia"] == pytest.approx(1250)
    assert "tractor.cog" not in vehicle.stated
    assert not {"tractor.yaw_inertia", "tractor.cog", "tractor.mass", "semitrailer.payload.mass"} & set(vehicle.assumed)


def test_numbers_scale_with_what_is_known() -> None:
    base, longer = edited("-3.7 m", "-3.7 m"), edited("-3.7 m", "-4.07 m")
    heavier = edited("33.45 t", "40 t")
    p, q, r = base.parameters(), longer.parameters(), heavier.parameters()
    assert q["tractor.yaw_inertia"] == pytest.approx(1.21 * p["tractor.yaw_inertia"])
    assert q["tractor.cog"] == pytest.approx(1.1 * p["tractor.cog"])
    loads, more = base.axle_loads(), heavier.axle_loads()
    for group, load in loads.items():
        key = f"{group}.cornering_stiffness"
        assert r[key] / p[key] == pytest.approx(more[group] / load)
    assert r["semitrailer.payload.mass"] == p["semitrailer.payload.mass"]
    assert r["semitrailer.sprung.mass"] == pytest.approx(p["semitrailer.sprung.mass"] + 6550)


def test_masses_follow_from_each_other() -> None:
    tare = CLASSES["semitrailer_3"].tare
    payload = edited('mass = "20 t +- 300 kg"', "")
    assert payload.unit("semitrailer").payload.mass == pytest.approx(33450 - tare.value)  # type: ignore[union-attr]
    assert payload.stated["semitrailer.payload.mass"] == tare.sigma
    unit = edited('mass = "33.45 t +- 1 %"', "")
    assert unit.unit("semitrailer").mass == pytest.approx(20000 + tare.value)
    assert unit.stated["semitrailer.mass"] == pytest.approx((tare.sigma**2 + 300**2) ** 0.5)
    unladen = edited('mass = "' + LADEN, "")
    assert unladen.unit("semitrailer").mass == tare.value


def test_the_steered_class_steers_the_last_axle() -> None:
    assert edited("semitrailer_3", "semitrailer_3").steer_signals() == ("steer.tractor.front",)
    assert edited("semitrailer_3", "semitrailer_3_steered").steer_signals()[1:] == ("steer.semitrailer.rear",)


def test_files_and_changes() -> None:
    vehicle = Vehicle.loads(TEXT)
    assert Vehicle.loads(vehicle.to_toml()) == vehicle
    assert hash(vehicle) == hash(Vehicle.loads(TEXT))
    path = "semitrailer.cornering_stiffness"
    assert path in vehicle.assumed
    estimated = vehicle.replace({path: 1e6})
    assert path not in estimated.assumed
    assert path not in estimated.stated  # the spread of the class is not that of the new value
    assert estimated.stated.keys() == vehicle.stated.keys() - {path}
    assert path in vehicle.replace({"tractor.mass": 8000.0}).assumed
    assert not [p for p in vehicle.lumped().assumed if p.startswith("semitrailer.payload")]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("tractor_4x2", "tractor_4x4", r"tractor\.class: no class 'tractor_4x4'; .*tractor_4x2"),
        ("tractor_4x2", "semitrailer_3", r"tractor\.axle_group: expected 1 for the class semitrailer_3 .*, got 2;"),
        (
            TEXT[TEXT.index("[[unit]]") : TEXT.index('[[unit]]\nname = "semi')],
            "",
            r"semitrailer\.class: .* behind another",
        ),
        ('[[coupling]]\nleading_position = "-3.1 m"', "", r"semitrailer\.class: .* give a coupling between each two"),
        ('position = "-3.7 m"', "", r"tractor\.drive\.position: expected a value, got none; give it"),
        ('leading_position = "-3.1 m"', "", r"fifth_wheel\.leading_position: expected a value, got none; give it"),
        ('mass = "33.45 t +- 1 %"', 'mass = "5 t"', r"semitrailer\.mass: expected more than payload and axles"),
        (LADEN, '5 t"\n[unit.payload]', r"payload\.mass: .*remove"),
        (
            'mass = "33.45 t +- 1 %"\n[unit.payload]\nmass = "20 t +- 300 kg"',
            "[unit.payload]",
            r"or the mass of the la",
        ),
        ('name = "brochure"', 'name = "b"\nexact = true', r"semitrailer\.mass: expected no '\+-' where exact = true"),
        ('class = "tractor_4x2"', "", r"tractor\.cog: expected a value, got none; give it, or give the unit a class"),
        ("[[coupling]]", "[[coupling]]\nleading_position = '-3 m'\n[[coupling]]", r"coupling: expected 1 .*, got 2"),
        ('"-3.1 m"', '"-13 m"', r"tractor\.front: expected a static load above 0, got -.* N; check the CoG"),
    ],
)
def test_errors_name_the_key_and_the_cure(old: str, new: str, message: str) -> None:
    with pytest.raises(VehicleError, match=message):
        edited(old, new)
    exact = TEXT.replace(" +- 1 %", "").replace(" +- 300 kg", "").replace("[[unit]]", "exact = true\n[[unit]]", 1)
    with pytest.raises(VehicleError, match=r"exact: expected every number where exact = true, .* is missing; give it"):
        Vehicle.loads(exact)


def test_the_uncertainty_of_a_stiffness_grows_away_from_the_usual_load() -> None:
    vehicle, unladen = Vehicle.loads(TEXT), edited("33.45 t +- 1 %", "28 t")
    path = "semitrailer.cornering_stiffness"
    assert unladen.stated[path] / unladen.parameters()[path] > vehicle.stated[path] / vehicle.parameters()[path] > 0.29


def test_a_relaxation_length_needs_no_class() -> None:
    """One that is omitted is assumed with its uncertainty; 0 is stated, and stays."""
    text = catalogue.get("auburn_6x4").to_toml()
    lines = [line for line in text.splitlines() if not line.startswith("relaxation_length")]
    omitted = Vehicle.loads("\n".join(lines).replace("exact = true", ""))
    groups = ("tractor.front", "tractor.drive", "semitrailer")
    assert set(omitted.assumed) == {f"{group}.relaxation_length" for group in groups}
    assert all(omitted.stated[path] == 0.1 and omitted.parameters()[path] == 0.45 for path in omitted.assumed)
    lag_free = omitted.replace(dict.fromkeys(omitted.assumed, 0.0))
    assert Vehicle.loads(lag_free.to_toml()) == lag_free
    assert not lag_free.assumed
