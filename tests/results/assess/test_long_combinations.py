"""Measures and figures of more than two units."""

import pytest

from fifthwheel.results.assess.lane_change import linear, measures
from fifthwheel.results.assess.rollover import rollover
from fifthwheel.results.assess.truck import Truck
from fifthwheel.truck import get


def test_a_drawbar_is_no_part_of_the_body_of_a_dolly():
    truck = Truck(vehicle=get("a_double"))
    dolly = truck.vehicle.unit("dolly")
    assert [front for _, front in truck.ends()] == [1.4, 0.0, dolly.axles[0].position, 0.0]


@pytest.mark.slow
def test_a_short_full_trailer_amplifies_most():
    """In the order that is known: tractor-semitrailer, B-double, A-double and truck with dolly, truck and trailer."""
    names = ("cheng_cebon_2011", "b_double", "a_double", "truck_full_trailer")
    values = [measures(linear(Truck(vehicle=get(name))))["rearward_amplification"] for name in names]
    assert values == sorted(values)
    assert 1.0 < values[0] < 1.3
    assert values[-1] > 2.3


@pytest.mark.parametrize("name", ["a_double", "truck_full_trailer"])
def test_rollover_of_each_roll_coupled_set(name):
    truck = Truck(vehicle=get(name))
    sets = rollover(truck)
    assert [s.units for s in sets] == {
        "a_double": [("tractor", "first"), ("dolly", "second")],
        "truck_full_trailer": [("truck",), ("dolly", "trailer")],
    }[name]
