"""Sideslip at another position than under the CoG, such as that of an optical sensor at the landing legs."""

import numpy as np
import pytest

from fifthwheel.base.errors import SignalError
from fifthwheel.estimate.observe import Observer, ObserverSettings
from fifthwheel.model.simulate import simulate
from fifthwheel.truck import get


def test_sideslip_at_the_landing_legs():
    truck = get("cheng_cebon_2011")
    record = simulate(truck, count=1)
    at_cog, at_legs = (
        Observer(truck, record.signals, ObserverSettings(positions=positions)).batch(record)
        for positions in ({}, {"sideslip.semitrailer": -2.34})
    )
    arm = -2.34 - truck.unit("semitrailer").cog
    difference = arm * at_cog.values["yaw_rate.semitrailer"] / record.signals["speed"]
    expected = at_cog.values["sideslip.semitrailer"] + difference
    np.testing.assert_allclose(at_legs.values["sideslip.semitrailer"], expected, atol=1e-14)
    assert np.abs(difference).max() > 0.01
    np.testing.assert_array_equal(at_legs.values["sideslip.tractor"], at_cog.values["sideslip.tractor"])


def test_position_of_a_signal_without_position_is_refused():
    truck = get("cheng_cebon_2011")
    with pytest.raises(SignalError, match=r"roll\.tractor: has no position"):
        Observer(truck, simulate(truck, count=1).signals, ObserverSettings(positions={"roll.tractor": 0.0}))
