"""Rates of clocks on predictions whose drift is known: both sides of every limit."""

import numpy as np
import pytest

from fifthwheel.estimate.time_bases.findings import channel_rates, common_rates
from fifthwheel.estimate.time_bases.predictions import RATE, Prediction
from tests.estimate.time_bases.test_known_lags import (
    ACCELERATION,
    ANGLE,
    SOURCES,
    STEER,
    WHITE,
    YAW,
    YAW2,
    prediction_of,
)
from tests.estimate.time_bases.test_lags import TIME, slow_noise


def drifting(rate, *, duration=60.0, noise=0.05, name=YAW2):
    """The rate that is found for a channel whose clock deviates by a rate, and its sigma."""
    n = round(duration * RATE)
    centre = duration / 2
    measured = np.interp(centre + (TIME[:n] - centre) / (1 + rate), TIME, SOURCES[name]) + noise * WHITE[name][:n]
    prediction = Prediction(
        time=TIME[:n],
        steer=STEER,
        names=(name,),
        measured=measured[:, None],
        predicted=SOURCES[name][None, :n, None],
        generic=False,
    )
    return list(channel_rates(prediction))


@pytest.mark.parametrize("rate", [-0.06, -0.01, 0.01, 0.04, 0.07])
def test_the_rate_of_a_drifting_clock(rate):
    (found,) = drifting(rate)
    assert found.signals == (YAW2,)
    assert abs(found.rate - rate) < max(2 * found.sigma, 0.003)
    assert 0.002 <= found.sigma < 0.01


def test_limits_of_a_drift():
    """From 0.005 and three sigma on, up to 0.08, in 30 s or more, and only of yaw, roll and articulation."""
    assert drifting(0.0) == drifting(0.004) == drifting(-0.004) == []
    assert drifting(0.1) == drifting(-0.1) == []
    assert drifting(0.05, duration=29.9) == []
    assert len(drifting(0.05, duration=31)) == 1
    assert drifting(0.05, noise=2.0) == []
    assert len(drifting(0.05, noise=0.5)) == 1
    assert drifting(0.05, name=ACCELERATION) == []


def articulated(rate, *, noise=0.001, gain=1.0):
    """The rate of a common clock, with the articulation as the integral of the difference of the yaw rates."""
    r1, r2 = 0.05 * SOURCES[YAW], 0.05 * SOURCES[YAW2]
    angle = np.concatenate([[0.0], np.cumsum((r2 - r1)[1:] + (r2 - r1)[:-1]) / 2 / RATE])
    measured = {YAW: r1, YAW2: r2, ANGLE: gain / (1 + rate) * angle + noise * slow_noise(9, 0.02)}
    return list(common_rates(prediction_of(measured)))


@pytest.mark.parametrize("rate", [-0.05, -0.04, 0.04, 0.06])
def test_the_rate_of_a_common_clock(rate):
    (found,) = articulated(rate)
    assert found.signals == ()
    assert abs(found.rate - rate) < 3 * found.sigma + 0.004
    assert 0 < found.sigma < 0.01


def test_limits_of_a_common_rate():
    """From 0.03 and three sigma on, with a sigma below 0.015, and the angle explained by the yaw rates."""
    assert articulated(0.0) == articulated(0.02) == articulated(-0.02) == []
    assert articulated(0.06, noise=0.05) == []
    assert articulated(0.0, gain=0.0) == []
