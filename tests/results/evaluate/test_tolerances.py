"""Tolerances: their texts, the longest key that fits, and what is refused."""

import numpy as np
import pytest

from fifthwheel.base.errors import SignalError
from fifthwheel.base.units import STANDARD_GRAVITY
from fifthwheel.results.evaluate.tolerances import DEFAULTS, Tolerance, require_used, tolerance_of

GRADIENT = "rad s^2/m"


@pytest.mark.parametrize(
    ("text", "unit", "relative", "absolute"),
    [
        ("5%", "rad/s", 0.05, 0.0),
        ("0.1 deg/g", GRADIENT, 0.0, np.radians(0.1) / STANDARD_GRAVITY),
        ("5 % + 20 ms", "s", 0.05, 0.02),
        ("20ms + 5%", "s", 0.05, 0.02),
        ("0.05", "1", 0.0, 0.05),
    ],
)
def test_texts(text, unit, relative, absolute):
    found = Tolerance.parse("key", text, unit)
    assert (found.relative, found.absolute) == pytest.approx((relative, absolute), rel=1e-12)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("5 kg", r"tolerance yaw_rate=5 kg: expected rad/s .* got 'kg'; give percent, a value in rad/s"),
        ("5", "tolerance yaw_rate=5: expected a number with a unit"),
        ("wide", "tolerance yaw_rate=wide: expected a number"),
        ("-5 %", "tolerance yaw_rate=-5 %: expected finite numbers above 0; correct it"),
        ("5 % + 0 deg/s", "expected finite numbers above 0"),
        ("1 deg/s +- 5 %", "expected a number|above 0"),
    ],
)
def test_wrong_texts(text, message):
    with pytest.raises(SignalError, match=message):
        Tolerance.parse("yaw_rate", text, "rad/s")


def test_the_longest_key_that_ends_at_a_dot_applies():
    stated = {"yaw_rate": "1 %", "yaw_rate.tractor": "2 %", "yaw_rate_ratio": "3 %"}
    assert tolerance_of("yaw_rate.tractor", "rad/s", stated).text == "2 %"
    assert tolerance_of("yaw_rate.semitrailer", "rad/s", stated).text == "1 %"
    assert tolerance_of("yaw_rate_ratio_1000ms.yaw_rate.tractor", "1", stated).text == "0.05"
    with pytest.raises(SignalError, match="tolerance yaw_rate_ratio: nothing with this name is compared"):
        require_used(stated, ["yaw_rate.tractor"])
    assert DEFAULTS["phase"] == tolerance_of("phase.yaw_rate.tractor", "rad", {}).text
