"""Measures and figures of more than two units."""

import numpy as np
import pytest

from fifthwheel.base.plots import Line
from fifthwheel.results.assess.lane_change import linear, measures
from fifthwheel.results.assess.low_speed_turn import turn
from fifthwheel.results.assess.rollover import rollover
from fifthwheel.results.assess.truck import Truck
from fifthwheel.results.report.assessment import roll_by_acceleration, turn_from_above
from fifthwheel.truck import Vehicle, get


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


def test_figures_of_as_many_units_as_a_vehicle_can_have():
    b_double = get("b_double")
    tractor, lead, last = b_double.units
    first, second = b_double.couplings
    leads = [lead.model_copy(update={"name": f"lead_{k}"}) for k in range(6)]
    wheels = [second.model_copy(update={"name": f"wheel_{k}"}) for k in range(6)]
    truck = Truck(vehicle=Vehicle(name="train", units=(tractor, *leads, last), couplings=(first, *wheels)))
    run = turn(truck)
    assert np.isfinite(run.headings).all()
    assert len(turn_from_above(truck, run).items) == 8 + 2
    assert sum(isinstance(item, Line) for item in roll_by_acceleration(rollover(truck)).items) == 8


@pytest.mark.parametrize("name", ["a_double", "truck_full_trailer"])
def test_rollover_of_each_roll_coupled_set(name):
    truck = Truck(vehicle=get(name))
    sets = rollover(truck)
    assert [s.units for s in sets] == {
        "a_double": [("tractor", "first"), ("dolly", "second")],
        "truck_full_trailer": [("truck",), ("dolly", "trailer")],
    }[name]
