"""Which masses are unusual."""

import pytest

from fifthwheel.truck import Vehicle, catalogue
from fifthwheel.truck.weighing import unusual_masses
from tests.truck.test_classes import TEXT

PAYLOAD, BODY = "semitrailer.payload.mass", "semitrailer.sprung.mass"
CLASSED = Vehicle.loads(TEXT.replace('"20 t +- 300 kg"', '"26 t"'))
"""Its semitrailer weighs 33.45 t, of which 2.16 t are axles and 26 t the load."""


@pytest.mark.parametrize("name", catalogue.names())
def test_no_mass_of_the_catalogue_is_unusual(name: str) -> None:
    assert not list(unusual_masses(catalogue.get(name)))


def test_an_empty_unit_that_is_heavier_than_others_of_its_class() -> None:
    assert not list(unusual_masses(CLASSED))
    (warning,) = unusual_masses(CLASSED.replace({PAYLOAD: 20e3, BODY: 11.29e3}))
    assert warning == (
        "semitrailer: the empty semitrailer weighs 13.4 t by the masses of the vehicle file, and 7.5 ± 1.5 t as others"
        " of the class semitrailer_3 do; check the mass of the load and the axle loads by the weighbridge"
    )
    (warning,) = unusual_masses(CLASSED.replace({"tractor.mass": 10e3, "tractor.sprung.mass": 8e3}))
    assert warning.startswith("tractor: the tractor weighs 10.0 t by")
    assert warning.endswith("do; check the axle loads by the weighbridge")


@pytest.mark.parametrize("vehicle", [CLASSED, catalogue.get("cheng_cebon_2011")])
def test_axles_that_weigh_more_or_less_than_usual(vehicle: Vehicle) -> None:
    trailer = vehicle.unit("semitrailer")
    for change, mass in ((5e3, "7"), (-1.6e3, "0")):
        changed = vehicle.replace({BODY: trailer.sprung.mass - change})
        (warning,) = unusual_masses(changed)
        assert warning.startswith(f"semitrailer: axles and wheels weigh {mass}."), warning
        assert "less sprung.mass and payload.mass; usual are 2.2 t; check" in warning
