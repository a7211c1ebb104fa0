"""The numbers of a vehicle, against formulas and the analysis of the linear model."""

from xml.etree import ElementTree

import numpy as np
import pytest

from fifthwheel.base.units import STANDARD_GRAVITY as GRAVITY
from fifthwheel.model.dynamics import critical_speed, modes, understeer_gradient
from fifthwheel.model.dynamics.summary import summarize
from fifthwheel.truck import get

TRUCK = get("cheng_cebon_2011")


def test_the_understeer_gradient_is_that_of_the_axle_loads():
    """Static load by cornering stiffness, front less rear, each in its share of the lateral force."""
    truck = get("auburn_6x4")
    tractor, loads = truck.units[0], truck.axle_loads()
    front, *rear = (loads[tractor.group_path(g)] / g.cornering_stiffness for g in tractor.axle_groups)
    assert len(rear) == 1
    assert understeer_gradient(truck) * GRAVITY == pytest.approx(front - rear[0], rel=1e-6)


def test_the_summary():
    soft = TRUCK.replace({"tractor.drive.cornering_stiffness": 4.0e5})
    for truck in (TRUCK, soft):
        summary = summarize(truck, 20.0)
        assert summary.axle_loads == truck.axle_loads()
        assert summary.critical_speed == critical_speed(truck)
        assert all(any(f == mode.frequency for mode in modes(truck, 20.0)) for f, _ in summary.modes)
    assert summary.critical_speed is not None
    assert f"{3.6 * summary.critical_speed:.0f} km/h" in str(summary)
    assert summarize(soft, summary.critical_speed + 1).rearward_amplification is None
    rows = dict(summary.rows())
    assert float(rows["understeer gradient"].split()[0].replace("−", "-")) == pytest.approx(
        np.degrees(summary.understeer_gradient * GRAVITY), abs=0.005
    )
    tree = ElementTree.fromstring(summary._repr_html_())
    assert len(list(tree.iter("tr"))) == len(summary.rows()) + 1


def test_an_oscillation_in_roll_is_named_by_the_units_that_roll_and_their_phase():
    rolls = [motion for motion in summarize(get("articulated_bus")).motions if motion != "yaw"]
    assert rolls == ["roll, front and rear", "roll, rear against front"]
    rolls = [motion for motion in summarize(get("b_double")).motions if motion != "yaw"]
    assert len(set(rolls)) == 3
    assert rolls[1] == "roll, tractor and lead against semitrailer"
