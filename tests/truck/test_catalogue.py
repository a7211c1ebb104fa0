"""The catalogue against the published numbers, each within half a unit of its last digit; templates; edited files."""

import re

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fifthwheel.base.errors import VehicleError
from fifthwheel.truck import Payload, Vehicle, catalogue, unit_of
from fifthwheel.truck.catalogue import COMBINATIONS, edited, template
from tests.truck.test_classes import TEXT

ARTICLE = catalogue.get("cheng_cebon_2011")


def with_shape(vehicle: Vehicle, shape: str) -> Vehicle:
    tractor, trailer = vehicle.units
    assert trailer.payload is not None
    payload = Payload(**(trailer.payload.model_dump() | {"shape": shape}))
    return vehicle.model_copy(update={"units": (tractor, trailer.model_copy(update={"payload": payload}))})


@pytest.mark.parametrize(
    ("payload_height", "cog_height", "half_cog", "roll_inertia", "half_inertia"),
    [
        (1.237, 1.602, 5e-4, 4.35e4, 50),  # 3.3, the simulation
        (1.257, 1.609, 5e-4, 4.40e4, 50),  # 4.3, the test track
        (1.084, 1.553, 5e-4, 3.99e4, 50),  # 3.3, estimate for the point payload
        (1.230, 1.600, 5e-3, 4.35e4 / 1.004, 50),  # the reference; 4.35e4 is within 0.4 % of it
    ],
)
def test_article_pairs(
    payload_height: float, cog_height: float, half_cog: float, roll_inertia: float, half_inertia: float
) -> None:
    derived = ARTICLE.replace({"semitrailer.payload.height": payload_height}).derived()
    assert abs(derived["semitrailer.cog_height"] - cog_height) <= half_cog
    assert abs(derived["semitrailer.roll_inertia"] - roll_inertia) <= half_inertia


def test_other_numbers_of_the_article() -> None:
    derived, p = with_shape(ARTICLE, "point").derived(), ARTICLE.parameters()
    assert abs(derived["semitrailer.roll_inertia"] - 33308) <= 0.5
    lever = p["semitrailer.sprung.cog_height"] - p["semitrailer.roll_axis_height"]
    about_axis = p["semitrailer.sprung.roll_inertia"] + p["semitrailer.sprung.mass"] * lever**2
    assert about_axis == pytest.approx(1.27e4, abs=1e-6)
    published = {"tractor.front": 4.75e5, "tractor.drive": 7.66e5, "semitrailer": 1.273e6}
    assert {path: p[f"{path}.cornering_stiffness"] for path in published} == published
    assert (p["semitrailer.yaw_inertia"], p["semitrailer.sprung.cog_height"]) == (4.137e5, 1.20)
    kingpin = ARTICLE.units[1].mass - ARTICLE.axle_loads()["semitrailer"] / 9.80665
    assert kingpin == pytest.approx(10.5e3, rel=0.01)


@pytest.mark.parametrize(("name", "payload"), [("auburn_6x4", 17000.0), ("auburn_6x4_unladen", 0.0)])
def test_auburn_sums(name: str, payload: float) -> None:
    """Mass, CoG and yaw inertia of each unit, computed again from the bodies of the published set."""
    tractor = [(6493.0, -1.384, 19658.0), (570.0, 0.0, 0.0), (785.0, -5.0, 0.0), (785.0, -6.27, 0.0)]
    trailer = [
        (3196.0, -7.303, 180015.0),
        (payload, -7.303, payload * (12**2 + 2.4**2) / 12),
        (665.0, -13.124, 0.0),
        (665.0, -14.412, 0.0),
    ]
    vehicle = catalogue.get(name)
    for unit, bodies in zip(vehicle.units, (tractor, trailer), strict=True):
        mass = sum(m for m, _, _ in bodies)
        cog = sum(m * x for m, x, _ in bodies) / mass
        assert unit.mass == mass
        assert unit.cog == pytest.approx(cog, abs=5e-4)
        assert unit.yaw_inertia == pytest.approx(sum(i + m * (x - cog) ** 2 for m, x, i in bodies), abs=0.5)
        sprung_cog, height = bodies[0][1], vehicle.derived()[f"{unit.name}.cog_height"]
        published = 130.0 if unit.name == "tractor" else 0.0
        product = published + unit.laden_sprung_mass * (sprung_cog - cog) * (height - unit.roll_axis_height)
        assert unit.sprung.roll_yaw_product == pytest.approx(product, abs=0.5)


@pytest.mark.parametrize("name", catalogue.names())
def test_every_entry_is_complete(name: str) -> None:
    vehicle = catalogue.get(name)
    assert vehicle.name == name
    assert vehicle.source
    assert all(load > 0 for load in vehicle.axle_loads().values())
    assert all(unit_of(path) for path in vehicle.parameters())
    values = [line for line in catalogue.text(name).splitlines() if " = " in line and not line.startswith(("#", "  "))]
    without_origin = [
        line for line in values if "#" not in line and not line.startswith(("name", "source", "steerable"))
    ]
    assert without_origin == []


def test_unknown_names_are_answered_with_similar_ones() -> None:
    with pytest.raises(VehicleError, match="did you mean 'cheng_cebon_2011'"):
        catalogue.get("cheng_cebon")
    with pytest.raises(VehicleError, match=r"a-double: no such combination; did you mean 'a_double'"):
        template("a-double")


@pytest.mark.parametrize("name", COMBINATIONS)
def test_a_template_has_the_geometry_of_its_model_and_the_numbers_of_its_classes(name: str) -> None:
    like, vehicle = catalogue.get(name), Vehicle.loads(template(name))
    assert [unit.vehicle_class for unit in vehicle.units] == list(COMBINATIONS[name])
    assert [c.kind for c in vehicle.couplings] == [c.kind for c in like.couplings]
    ours, theirs = vehicle.parameters(), like.parameters()
    places = [path for path in theirs if path.endswith("position")]
    assert {path: ours[path] for path in places} == {path: theirs[path] for path in places}
    assert {path for path in theirs if path not in ours} == set()
    given = set(ours) - set(vehicle.assumed)
    masses = {f"{u.name}.{key}" for u in like.units if u.payload for key in ("mass", "payload.mass")}
    assert given >= masses | set(places)
    assert "dolly.mass" not in given
    assert all(load > 0 for load in vehicle.axle_loads().values())


FILE = catalogue.text("cheng_cebon_2011")


def comments(text: str) -> list[str]:
    return [comment.strip() for comment in re.findall(r"#(.*)", text)]


@settings(max_examples=15, deadline=None)
@given(
    path=st.sampled_from(sorted(ARTICLE.parameters())), factor=st.floats(0.98, 1.02), sigma=st.none() | st.floats(0, 10)
)
def test_any_number_is_changed_alone(path: str, factor: float, sigma: float | None) -> None:
    changed = ARTICLE.replace({path: factor * ARTICLE.parameters()[path]})
    if sigma is not None:
        changed = changed.with_stated({path: sigma})
    text = edited(FILE, changed)
    assert Vehicle.loads(text) == changed
    assert sum(a != b for a, b in zip(text.splitlines(), FILE.splitlines(), strict=True)) <= 1
    assert len(comments(text)) == len(comments(FILE))


def test_the_comment_of_a_new_number_says_what_it_was() -> None:
    text = edited(FILE, ARTICLE.replace({"semitrailer.cornering_stiffness": 1.2e6}))
    assert 'cornering_stiffness = "1200000.0 N/rad"' in text
    assert '# was "1273 kN/rad": published, (11)' in text
    assert edited(FILE, ARTICLE) == FILE


def test_the_comment_behind_an_inline_table_says_what_it_was() -> None:
    file = catalogue.text("a_double").replace(
        '{ name = "drive_front", position = "-5 m" },', '{ name = "drive_front", position = "-5 m" }, # by tape'
    )
    changed = Vehicle.loads(file).replace(
        {f"tractor.drive_{k}.position": x for k, x in (("front", -5.05), ("rear", -6.3))}
    )
    text = edited(file, changed)
    assert Vehicle.loads(text) == changed
    assert '{ name = "drive_front", position = "-5.05 m" }, # was "-5 m": by tape\n' in text
    assert '{ name = "drive_rear", position = "-6.3 m" },\n' in text


def test_a_number_of_a_class_becomes_a_line() -> None:
    truck = Vehicle.loads(TEXT)
    paths = ("tractor.drive.cornering_stiffness", "semitrailer.yaw_inertia", "fifth_wheel.height")
    changed = truck.replace({path: 1.1 * truck.parameters()[path] for path in paths})
    text = edited(TEXT, changed)
    assert Vehicle.loads(text) == changed
    assert set(truck.assumed) - set(Vehicle.loads(text).assumed) == set(paths)
    again = edited(text, changed.replace({"semitrailer.yaw_inertia": 5e5}))
    assert Vehicle.loads(again).parameters()["semitrailer.yaw_inertia"] == 5e5


@pytest.mark.parametrize("other", [ARTICLE.lumped(), catalogue.get("auburn_6x4")])
def test_another_structure_has_its_own_text(other: Vehicle) -> None:
    assert Vehicle.loads(edited(FILE, other)) == other


def test_a_file_that_lists_its_assumed_numbers() -> None:
    truck = Vehicle.loads(TEXT)
    text = truck.to_toml()
    changed = truck.replace({"semitrailer.yaw_inertia": 4e5})
    assert Vehicle.loads(edited(text, changed)) == changed
    exact = Vehicle.loads("exact = true\n" + FILE)
    other = exact.replace({"semitrailer.yaw_inertia": 4e5})
    assert Vehicle.loads(edited("exact = true\n" + FILE, other)) == other


def test_an_assumed_number_becomes_a_key() -> None:
    """The number behind the # is not left beside it: both as keys would be no TOML."""
    assumed = '# yaw_inertia = "21900 kg m^2 +- 4900 kg m^2"   # radius of gyration'
    text = TEXT.replace('class = "tractor_4x2"\n', f'class = "tractor_4x2"\n{assumed}\n', 1)
    assert assumed in text
    vehicle = Vehicle.loads(text)
    changed = edited(text, vehicle.replace({"tractor.yaw_inertia": 25e3}))
    assert Vehicle.loads(changed).parameters()["tractor.yaw_inertia"] == 25e3
    assert "# yaw_inertia" not in changed
    assert '# was "21900 kg m^2 +- 4900 kg m^2", assumed: radius of gyration' in changed
