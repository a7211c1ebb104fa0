"""Masses and CoG positions from axle loads, and axle loads from them; unusual masses."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fifthwheel.base.errors import VehicleError
from fifthwheel.base.units import STANDARD_GRAVITY
from fifthwheel.truck import Vehicle, catalogue, with_axle_loads
from fifthwheel.truck.weighing import unusual_masses
from tests.truck.test_classes import TEXT

ARTICLE = catalogue.get("cheng_cebon_2011")
TRUE_TRACTOR = {
    "tractor.front": 7200 * STANDARD_GRAVITY * (3.7 - 1.03) / 3.7,
    "tractor.drive": 7200 * STANDARD_GRAVITY * 1.03 / 3.7,
}


def loaded(mass: float, cog: float) -> Vehicle:
    """The article's vehicle with another payload and CoG of the trailer."""
    return ARTICLE.replace(
        {"semitrailer.mass": 33450 - 20122 + mass, "semitrailer.payload.mass": mass, "semitrailer.cog": cog}
    )


@settings(max_examples=20)
@given(mass=st.floats(100, 30e3), cog=st.floats(-7.5, -1))
def test_round_trip(mass: float, cog: float) -> None:
    """Also without the front axle."""
    truth = loaded(mass, cog)
    weighed = with_axle_loads(ARTICLE, truth.axle_loads())
    assert weighed.parameters() == pytest.approx(truth.parameters(), rel=1e-9)
    assert weighed.axle_loads() == pytest.approx(truth.axle_loads(), rel=1e-9)
    loads = {path: load for path, load in truth.axle_loads().items() if path != "tractor.front"}
    assert with_axle_loads(ARTICLE, loads).parameters() == pytest.approx(truth.parameters(), rel=1e-9)


def test_the_tractor_by_its_unladen_loads_or_alone() -> None:
    truth = ARTICLE.replace({"tractor.mass": 7500.0, "tractor.sprung.mass": 5600.0, "tractor.cog": -1.2})
    front = 7500.0 * STANDARD_GRAVITY * (3.7 - 1.2) / 3.7
    tractor = {"tractor.front": front, "tractor.drive": 7500.0 * STANDARD_GRAVITY - front}
    weighed = with_axle_loads(ARTICLE, truth.axle_loads(), unladen_tractor=tractor)
    assert weighed.parameters() == pytest.approx(truth.parameters(), rel=1e-9)
    alone, truth = (Vehicle(name="alone", units=vehicle.units[:1]) for vehicle in (ARTICLE, truth))
    assert with_axle_loads(alone, truth.axle_loads()).parameters() == pytest.approx(truth.parameters(), rel=1e-9)


def test_without_payload_the_difference_goes_to_the_sprung_body() -> None:
    empty = catalogue.get("auburn_6x4_unladen")
    truth = empty.replace({"semitrailer.mass": 4726, "semitrailer.sprung.mass": 3396})
    weighed = with_axle_loads(empty, truth.axle_loads())
    assert weighed.parameters() == pytest.approx(truth.parameters(), rel=1e-12)


def test_loads_that_contradict_the_tractors_cog_are_refused() -> None:
    loads = ARTICLE.axle_loads()
    shifted = loads | {"tractor.front": loads["tractor.front"] + 5000, "tractor.drive": loads["tractor.drive"] - 5000}
    with pytest.raises(VehicleError, match=r"tractor\.front: expected 67642 N .*, got 72642 N; check tractor\.cog"):
        with_axle_loads(ARTICLE, shifted)
    assert with_axle_loads(ARTICLE, shifted, tolerance=0.05).units[1].mass == pytest.approx(33450)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"semitrailer.axles": 1.0}, r"semitrailer\.axles: no such axle load; did you mean 'semitrailer'"),
        ({"tractor.drive": 0.0}, r"tractor\.drive: expected a load > 0 N"),
        ({"tractor.drive": float("nan")}, r"tractor\.drive: expected a load > 0 N"),
        (TRUE_TRACTOR | {"tractor.front": 4e4}, r"expected more than the tractor's own 70608 N"),
        ({"semitrailer": 1e4}, r"semitrailer: expected more than 13328 kg, its mass without payload"),
    ],
)
def test_impossible_loads_are_refused(change: dict[str, float], message: str) -> None:
    with pytest.raises(VehicleError, match=message):
        with_axle_loads(ARTICLE, ARTICLE.axle_loads() | change)


@pytest.mark.parametrize("name", ["a_double", "truck_full_trailer"])
def test_long_combinations_have_the_weighed_loads(name: str) -> None:
    """Loads of payloads 20 % lighter and 0.3 m further back: the result has these loads, and so the same total mass."""
    vehicle = catalogue.get(name)
    values = {}
    for unit in vehicle.units:
        if unit.payload:
            values[f"{unit.name}.payload.mass"] = 0.8 * unit.payload.mass
            values[f"{unit.name}.mass"] = unit.mass - 0.2 * unit.payload.mass
            values[f"{unit.name}.cog"] = unit.cog - 0.1
    truth = vehicle.replace(values)
    weighed = with_axle_loads(vehicle, truth.axle_loads())
    assert weighed.axle_loads() == pytest.approx(truth.axle_loads(), rel=1e-9)
    assert sum(u.mass for u in weighed.units) == pytest.approx(sum(u.mass for u in truth.units), rel=1e-9)
    if name == "truck_full_trailer":  # it puts no load on its truck, which has two unknowns and two loads
        assert (weighed.units[0].mass, weighed.units[0].cog) == pytest.approx(
            (truth.units[0].mass, truth.units[0].cog), rel=1e-9
        )
    for ours, true in zip(weighed.units, truth.units, strict=True):
        assert ours.mass == pytest.approx(true.mass, rel=0.06), true.name
        assert ours.mass - ours.laden_sprung_mass == pytest.approx(true.mass - true.laden_sprung_mass)


def test_a_long_combination_needs_all_loads() -> None:
    vehicle = catalogue.get("b_double")
    loads = vehicle.axle_loads()
    with pytest.raises(VehicleError, match=r"lead: expected a load > 0 N, got None"):
        with_axle_loads(vehicle, {path: load for path, load in loads.items() if path != "lead"})
    with pytest.raises(VehicleError, match=r"unladen_tractor: expected none for b_double"):
        with_axle_loads(vehicle, loads, unladen_tractor={})


PAYLOAD, BODY = "semitrailer.payload.mass", "semitrailer.sprung.mass"
CLASSED = Vehicle.loads(TEXT.replace('"20 t +- 300 kg"', '"26 t"'))
"""Its semitrailer weighs 33.45 t, of which 2.16 t are axles and 26 t the load."""


def test_an_empty_unit_that_is_heavier_than_others_of_its_class() -> None:
    for vehicle in (CLASSED, *map(catalogue.get, catalogue.names())):
        assert not list(unusual_masses(vehicle))
    (warning,) = unusual_masses(CLASSED.replace({PAYLOAD: 20e3, BODY: 11.29e3}))
    assert warning == (
        "semitrailer: the empty semitrailer weighs 13.4 t by the masses of the vehicle file, and 7.5 ± 1.5 t as others"
        " of the class semitrailer_3 do; check the mass of the load and the axle loads by the weighbridge"
    )
    (warning,) = unusual_masses(CLASSED.replace({"tractor.mass": 10e3, "tractor.sprung.mass": 8e3}))
    assert warning.startswith("tractor: the tractor weighs 10.0 t by")
    assert warning.endswith("do; check the axle loads by the weighbridge")


def test_axles_that_weigh_more_or_less_than_usual() -> None:
    trailer = ARTICLE.unit("semitrailer")
    for change, mass in ((5e3, "7"), (-1.6e3, "0")):
        changed = ARTICLE.replace({BODY: trailer.sprung.mass - change})
        (warning,) = unusual_masses(changed)
        assert warning.startswith(f"semitrailer: axles and wheels weigh {mass}."), warning
        assert "less sprung.mass and payload.mass; usual are 2.2 t; check" in warning
