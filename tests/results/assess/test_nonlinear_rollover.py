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
