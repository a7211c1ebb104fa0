"""Axle loads of a log against those of the vehicle file."""

import numpy as np
import pytest

from fifthwheel.errors import SignalError
from fifthwheel.record import Record
from fifthwheel.simulate import simulate
from fifthwheel.vehicle import get
from fifthwheel.workflow import axle_load_differences, weigh_vehicle

TRUCK = get("cheng_cebon_2011")


def loaded(loads: dict[str, float]) -> Record:
    """A straight run with constant axle loads, N."""
    record = simulate(TRUCK, manoeuvre="straight", duration=5, name="run")
    return record.with_signals({f"axle_load.{group}": np.full(len(record), load) for group, load in loads.items()})


def test_only_loads_beyond_the_tolerance_are_listed():
    loads = TRUCK.axle_loads()
    plain = simulate(TRUCK, manoeuvre="straight", duration=5)
    assert axle_load_differences(TRUCK, [plain, loaded(loads)]) == ()
    record = loaded(
        {**loads, "tractor.drive": 1.04 * loads["tractor.drive"], "semitrailer": 0.9 * loads["semitrailer"]}
    )
    (difference,) = axle_load_differences(TRUCK, [record])
    assert (difference.log, difference.group) == ("run", "semitrailer")
    assert difference.measured == pytest.approx(0.9 * difference.expected)
    assert difference.expected == loads["semitrailer"]
    assert len(axle_load_differences(TRUCK, [record], tolerance=0.03)) == 2


def test_weighing_finds_the_masses_of_another_vehicle():
    heavier = TRUCK.replace({"semitrailer.mass": 30000.0, "semitrailer.payload.mass": 16672.0})
    weighed = weigh_vehicle(loaded(heavier.axle_loads()), TRUCK)
    assert weighed.vehicle.parameters()["semitrailer.mass"] == pytest.approx(30000, rel=1e-6)
    assert weighed.vehicle.source.endswith("; weighed by run")
    assert weighed.loads.keys() == heavier.axle_loads().keys()
    assert axle_load_differences(weighed.vehicle, [loaded(heavier.axle_loads())]) == ()


def test_a_load_of_a_group_that_the_vehicle_does_not_have_is_refused():
    with pytest.raises(SignalError, match=r"axle_load\.dolly: .* has no axle group dolly; it has tractor\.front"):
        weigh_vehicle(loaded({**TRUCK.axle_loads(), "dolly": 5e4}), TRUCK)
