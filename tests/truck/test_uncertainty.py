"""Changes of a vehicle against hand calculations, and the rules that hold for any stated standard deviations."""

import math
from collections.abc import Mapping

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fifthwheel.truck import Vehicle, catalogue, changes
from tests.truck.test_vehicle import b_double, group
from tests.truck.test_vehicle import unit as make_unit

ARTICLE = catalogue.get("cheng_cebon_2011")
PATHS = tuple(ARTICLE.parameters())
TRIDEM = {f"semitrailer.{axle}.position" for axle in ("front", "middle", "rear")}

any_stated = st.dictionaries(st.sampled_from(PATHS), st.sampled_from([0.0, 1e-3, 0.7, 50.0]))


def slopes(vehicle: Vehicle) -> dict[str, Mapping[str, float]]:
    return {change.name: change.slopes for change in changes(vehicle)}


@pytest.mark.parametrize("name", catalogue.names())
def test_names(name: str) -> None:
    vehicle, expected = catalogue.get(name), ["mass_scale"]
    for unit in vehicle.units:
        load = ["payload.mass"] if unit.payload else []
        behind = [] if unit is vehicle.units[-1] else ["coupling"]
        expected += [f"{unit.name}.{key}" for key in ("mass", *load, "cog", "axle_positions", *behind)]
    expected += [f"{coupling.name}.yaw_damping" for coupling in vehicle.couplings if coupling.yaw_damping]
    assert list(slopes(vehicle)) == expected
    values = vehicle.parameters()
    for change in changes(vehicle):  # one standard deviation gives a possible vehicle
        for sign in (-1, 1):
            vehicle.replace({path: values[path] + sign * slope for path, slope in change.slopes.items()})


def test_masses_by_hand() -> None:
    by_name = slopes(ARTICLE)
    tractor = {"mass": 144.0, "sprung.mass": 106.0, "yaw_inertia": 440.0, "sprung.roll_inertia": 60.0}
    trailer = {"mass": 669.0, "sprung.mass": 221.56, "payload.mass": 402.44, "yaw_inertia": 8274.0}
    trailer["sprung.roll_inertia"] = 219.95420416
    both = {"tractor": tractor, "semitrailer": trailer}
    expected = {f"{unit}.{key}": value for unit, values in both.items() for key, value in values.items()}
    assert by_name["mass_scale"] == pytest.approx(expected, rel=1e-12)
    assert by_name["tractor.mass"] == pytest.approx({"tractor.mass": 144.0, "tractor.sprung.mass": 106.0}, rel=1e-12)
    assert by_name["semitrailer.payload.mass"] == pytest.approx(
        {"semitrailer.payload.mass": 603.66, "semitrailer.sprung.mass": -603.66}, rel=1e-12
    )
    product = slopes(catalogue.get("auburn_6x4"))["mass_scale"]["semitrailer.sprung.roll_yaw_product"]
    assert product == pytest.approx(183.4, rel=1e-12)


def test_lengths_by_hand() -> None:
    moved = ARTICLE.replace(
        {f"semitrailer.{axle}.position": x - 0.5 for axle, x in [("front", -6.7), ("middle", -8.0), ("rear", -9.3)]}
        | {"fifth_wheel.trailing_position": -0.5, "semitrailer.cog": -5.99}
    )
    for truck in (ARTICLE, moved):  # distances do not depend on the origin
        by_name = slopes(truck)
        assert by_name["tractor.cog"] == {"tractor.cog": 0.05}
        assert by_name["semitrailer.cog"] == {"semitrailer.cog": 0.15}
        assert by_name["tractor.axle_positions"] == pytest.approx({"tractor.drive.position": -0.03}, rel=1e-12)
        assert by_name["tractor.coupling"] == pytest.approx({"fifth_wheel.leading_position": 0.037}, rel=1e-12)
        places = {"front": 6.7, "middle": 8.0, "rear": 9.3}
        expected = {f"semitrailer.{axle}.position": -0.03 * x / 9.3 for axle, x in places.items()}
        assert by_name["semitrailer.axle_positions"] == pytest.approx(expected, rel=1e-12)
    middle = slopes(b_double())["middle.coupling"]  # axles 6 and 8 m behind the kingpin
    assert middle == pytest.approx({"rear_wheel.leading_position": 0.07}, rel=1e-12)
    two_groups = make_unit("middle", cog=-4, axle_groups=(group("front", -2), group("rear", -6, -8)))
    chain = b_double()
    chain = Vehicle(name="chain", units=(chain.units[0], two_groups, chain.units[2]), couplings=chain.couplings)
    assert slopes(chain)["middle.coupling"] == middle  # the wheelbase ends at the last group


def test_stated_masses_by_hand() -> None:
    by_name = slopes(ARTICLE.with_stated({"semitrailer.mass": 334.5}))
    assert not any(path.startswith("semitrailer.") for path in by_name["mass_scale"])
    assert by_name["semitrailer.mass"] == pytest.approx(
        {"semitrailer.mass": 334.5, "semitrailer.sprung.mass": 110.78, "semitrailer.payload.mass": 201.22}, rel=1e-12
    )
    by_name = slopes(ARTICLE.with_stated({"semitrailer.payload.mass": 0.0}))
    assert "semitrailer.payload.mass" not in by_name
    assert by_name["semitrailer.mass"] == pytest.approx(
        {"semitrailer.mass": 669.0, "semitrailer.sprung.mass": 624.0}, rel=1e-12
    )
    by_name = slopes(ARTICLE.with_stated({"semitrailer.sprung.mass": 100.0}))
    assert "semitrailer.payload.mass" not in by_name
    assert by_name["semitrailer.sprung.mass"] == {"semitrailer.sprung.mass": 100.0, "semitrailer.payload.mass": -100.0}
    assert by_name["mass_scale"]["semitrailer.payload.mass"] == pytest.approx(624.0, rel=1e-12)
    by_name = slopes(ARTICLE.with_stated({"tractor.mass": 0.0, "semitrailer.mass": 0.0}))
    assert not {"mass_scale", "tractor.mass", "semitrailer.mass"} & set(by_name)


def test_stated_positions_and_other_numbers_by_hand() -> None:
    stated = {
        "semitrailer.middle.position": 0.01,
        "fifth_wheel.leading_position": 0.02,
        "fifth_wheel.trailing_position": 0.03,
        "tractor.yaw_inertia": 500.0,
        "tractor.front.roll_stiffness": 1e4,
    }
    by_name = slopes(ARTICLE.with_stated(stated))
    assert {path: by_name[path] for path in stated} == {path: {path: sigma} for path, sigma in stated.items()}
    assert set(by_name["semitrailer.axle_positions"]) == {"semitrailer.front.position", "semitrailer.rear.position"}
    assert "tractor.coupling" not in by_name
    assert "tractor.yaw_inertia" not in by_name["mass_scale"]


def test_the_axles_of_a_group_share_their_stated_error() -> None:
    """They are measured to the middle of the group, whose position then has the stated standard deviation."""
    by_name = slopes(ARTICLE.with_stated(dict.fromkeys(TRIDEM, 0.01)))
    assert by_name["semitrailer.axle_positions"] == dict.fromkeys(sorted(TRIDEM), 0.01)
    assert not TRIDEM & by_name.keys()
    assert "semitrailer.axle_positions" not in slopes(ARTICLE.with_stated(dict.fromkeys(TRIDEM, 0.0)))
    truck = catalogue.get("auburn_6x4")
    names = [axle.name for axle in truck.units[0].axle_groups[1].axles]
    drive = {f"tractor.{name}.position": 0.02 for name in names}
    by_name = slopes(truck.with_stated(drive))
    assert by_name["tractor.drive.axle_positions"] == drive
    assert not drive.keys() & by_name.get("tractor.axle_positions", {}).keys()


@settings(max_examples=30)
@given(any_stated)
def test_a_stated_number_has_its_stated_standard_deviation(stated: dict[str, float]) -> None:
    found = changes(ARTICLE.with_stated(stated))
    for path, sigma in stated.items():
        altering = {change.name: abs(change.slopes[path]) for change in found if path in change.slopes}
        together = path.startswith("semitrailer.") and path.endswith(".position") and stated.keys() >= TRIDEM
        name = "semitrailer.axle_positions" if together else path
        assert altering == (pytest.approx({name: sigma}, rel=1e-12) if sigma else {})


@settings(max_examples=30)
@given(any_stated)
def test_the_mass_of_a_unit_is_altered_only_by_weighing_it(stated: dict[str, float]) -> None:
    by_name = slopes(ARTICLE.with_stated(stated))
    for unit in ("tractor", "semitrailer"):
        altering = {name for name, by_path in by_name.items() if f"{unit}.mass" in by_path}
        assert altering <= {"mass_scale", f"{unit}.mass"}
    masses = ("semitrailer.sprung.mass", "semitrailer.payload.mass")
    for name in masses:  # the division of the laden body does not alter their sum, unless both are stated
        if name in by_name and not set(masses) <= set(stated):
            assert sum(by_name[name].get(path, 0.0) for path in masses) == 0


def test_lumping_does_not_alter_the_uncertainty_of_the_laden_body() -> None:
    """With both masses stated, their sum has the standard deviation of the lumped body."""
    stated = {"semitrailer.sprung.mass": 30.0, "semitrailer.payload.mass": 40.0, "semitrailer.payload.height": 0.1}
    truck = ARTICLE.with_stated(stated | {"tractor.cog": 0.02, "semitrailer.sprung.cog_height": 0.0})
    both = [sum(change.slopes.get(path, 0.0) for path in stated if path.endswith("mass")) for change in changes(truck)]
    assert math.hypot(*both) == pytest.approx(50.0, rel=1e-12)
    assert truck.lumped().stated == {"semitrailer.sprung.mass": pytest.approx(50.0), "tractor.cog": 0.02}
    exact = ARTICLE.with_stated(dict.fromkeys(PATHS, 0.0))
    assert changes(exact) == ()
    assert exact.lumped().is_exact
    assert not exact.with_stated({"semitrailer.payload.height": 0.1}).lumped().is_exact
