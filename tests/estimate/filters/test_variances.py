"""Default variances: those of the article, and which of them a sensor gets."""

import numpy as np
import pytest

from fifthwheel.base.errors import SignalError
from fifthwheel.data.channels import MEASURED, SIDESLIP
from fifthwheel.data.record.derived import article_gyro_variance
from fifthwheel.estimate.filters.variances import (
    OBSERVER_PROCESS_VARIANCE,
    PROCESS_VARIANCE,
    process_covariance,
    sensor_variance,
)
from fifthwheel.truck import get

TRUCK = get("cheng_cebon_2011")
UNITS = ("tractor", "semitrailer")


def test_process_noise_of_the_observer_is_that_of_the_article() -> None:
    """Equation (14): 1e-8 rad^2 per step of 10 ms; sideslip times 20 m/s is a lateral velocity."""
    for quantity in ("yaw_rate", "articulation", "roll", "roll_rate"):
        assert OBSERVER_PROCESS_VARIANCE[quantity] == pytest.approx(1e-8 / 0.01)
    assert OBSERVER_PROCESS_VARIANCE["lateral_velocity"] == pytest.approx(20**2 * 1e-8 / 0.01)
    assert OBSERVER_PROCESS_VARIANCE.keys() == PROCESS_VARIANCE.keys()
    covariance = process_covariance(("roll.a", "yaw_rate.b"), {"yaw_rate": 2.0, "roll": 3.0}, 0.5)
    np.testing.assert_array_equal(covariance, np.diag([1.5, 1.0]))
    for table in (OBSERVER_PROCESS_VARIANCE, PROCESS_VARIANCE):
        assert table["slip_angle"] == 0.0  # the relaxation of a tyre is exact
        assert table["bank"] == pytest.approx(0.002**2)


def test_the_variance_of_a_sensor() -> None:
    """As given; else of the article's gyros, which differ from unit to unit; else that of its quantity."""
    article = dict(article_gyro_variance(UNITS))
    for name, variance in article.items():
        assert sensor_variance(TRUCK, name, {}) == variance
        assert sensor_variance(TRUCK, name, {name: 7.0}) == 7.0
    for channel in (*MEASURED, SIDESLIP):
        first, other = channel.noise
        quantity = channel.quantity
        assert sensor_variance(TRUCK, f"{quantity}.tractor", {f"{quantity}.semitrailer": 7.0}) == first
        assert sensor_variance(TRUCK, f"{quantity}.semitrailer", {}) == other
    with pytest.raises(SignalError, match="no sensor measures it"):
        sensor_variance(TRUCK, "load_transfer.semitrailer", {})
