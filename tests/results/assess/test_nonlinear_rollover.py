"""The rollover threshold of the nonlinear truck beside that of the linear springs."""

import pytest

from fifthwheel.results.assess.nonlinear import rollover_threshold
from fifthwheel.results.assess.rollover import measure
from fifthwheel.results.assess.truck import Truck
from fifthwheel.truck import get

pytest.importorskip("mujoco")
pytestmark = pytest.mark.slow


def test_a_high_load_rolls_over_at_the_threshold_of_the_linear_springs():
    truck = Truck(vehicle=get("cheng_cebon_2011").replace({"semitrailer.payload.height": 3.0}))
    threshold = rollover_threshold(truck)["rollover_threshold"]
    assert threshold == pytest.approx(measure(truck)["rollover_threshold"], rel=0.02)


@pytest.mark.parametrize(
    ("name", "first"),
    [("a_double", "tractor+first"), ("truck_full_trailer", "dolly+trailer")],
)
def test_the_set_that_rolls_over_first_is_that_of_the_linear_springs(name, first):
    truck = Truck(vehicle=get(name))
    linear, nonlinear = measure(truck), rollover_threshold(truck)
    sets = {k: v for k, v in linear.items() if k.startswith("rollover_threshold.")} or {
        f"rollover_threshold.{first}": 1
    }
    assert set(nonlinear) == {"rollover_threshold", f"rollover_threshold.{first}"}
    assert min(sets, key=lambda k: sets[k]) == f"rollover_threshold.{first}"
    assert nonlinear["rollover_threshold"] == pytest.approx(linear["rollover_threshold"], rel=0.1)
