"""Sideslip told elsewhere than under the CoG, as an optical sensor at the landing leg sees it."""

import numpy as np
import pytest

from fifthwheel.errors import SignalError
from fifthwheel.observe import Observer, ObserverSettings
from fifthwheel.simulate import simulate
from fifthwheel.vehicle import get


def test_sideslip_at_the_landing_leg():
    truck = get("cheng_cebon_2011")
    record = simulate(truck, count=1)
    here, there = (
        Observer(truck, record.signals, ObserverSettings(places=places)).batch(record)
        for places in ({}, {"sideslip.semitrailer": -2.34})
    )
    arm = -2.34 - truck.unit("semitrailer").cog
    turning = arm * here.values["yaw_rate.semitrailer"] / record.signals["speed"]
    expected = here.values["sideslip.semitrailer"] + turning
    np.testing.assert_allclose(there.values["sideslip.semitrailer"], expected, atol=1e-14)
    assert np.abs(turning).max() > 0.01
    np.testing.assert_array_equal(there.values["sideslip.tractor"], here.values["sideslip.tractor"])


def test_what_has_no_place():
    truck = get("cheng_cebon_2011")
    with pytest.raises(SignalError, match=r"roll\.tractor: has no place"):
        Observer(truck, simulate(truck, count=1).signals, ObserverSettings(places={"roll.tractor": 0.0}))
