"""Files of long combinations to fill in."""

import pytest

from fifthwheel.base.errors import VehicleError
from fifthwheel.truck import Vehicle, catalogue
from fifthwheel.truck.catalogue import COMBINATIONS, template


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


def test_a_replaced_number_is_used() -> None:
    text = template("truck_full_trailer").replace('leading_position = "-7.4 m"', 'leading_position = "-7.1 m"')
    assert Vehicle.loads(text).couplings[0].leading_position == -7.1


def test_an_unknown_combination_is_refused() -> None:
    with pytest.raises(VehicleError, match=r"a-double: no such combination; did you mean 'a_double'"):
        template("a-double")
