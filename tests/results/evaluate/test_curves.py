"""Curves, and the tolerances of measures and curves."""

import numpy as np
import pytest

from fifthwheel.base.errors import SignalError
from fifthwheel.base.units import STANDARD_GRAVITY
from fifthwheel.results.evaluate import ComparedMeasure, Evaluation
from fifthwheel.results.evaluate.curves import compared_curves
from fifthwheel.results.evaluate.tolerances import DEFAULTS, Tolerance, require_used, tolerance_of

FREQUENCY = np.linspace(0.1, 2.0, 20)
TIME = np.arange(0.0, 100.0, 0.1)


def evaluation(start=None, **arrays):
    columns = {name.replace("__", "."): values for name, values in arrays.items()}
    texts = dict.fromkeys(("log", "test", "title", "standard"), "x")
    noise = dict.fromkeys(columns, 0.0)
    return Evaluation(**texts, measures=(), conditions=(), arrays=columns, noise=noise, start=start)


def curve(results, log, **stated):
    (found,) = compared_curves(results, log, stated)
    return found


def test_phases_are_compared_without_whole_turns():
    phase = -FREQUENCY
    log = evaluation(frequency=FREQUENCY, phase__yaw_rate__tractor=phase)
    turned = evaluation(frequency=FREQUENCY, phase__yaw_rate__tractor=phase - 2 * np.pi + 0.1)
    assert curve(turned, log, phase="6 deg").verdict == "inside"
    assert curve(turned, log, phase="5 deg").exceedance == pytest.approx(0.1 - np.radians(5))


def test_points_of_a_history_at_which_nothing_happens_do_not_count():
    """A wrong response for 4 s of 100 s is less than 5 % of all points."""
    active = np.where((TIME >= 10) & (TIME < 14), 0.1, 0.0)
    log, results = (evaluation(10.0, time=TIME, yaw_rate__tractor=scale * active) for scale in (1.0, 1.5))
    found = curve(results, log, yaw_rate="10 %")
    assert (found.verdict, found.inside) == ("outside", 0.0)
    assert found.exceedance == pytest.approx(0.04)


@pytest.mark.parametrize(
    ("difference", "sigma", "verdict"),
    [
        (0.5, 0.2, "inside"),
        (1.5, 0.2, "outside"),
        (1.5, 0.3, "undecided"),
        (-1.5, 0.2, "outside"),
        (0.0, None, "undecided"),
    ],
)
def test_a_measure_needs_two_sigma(difference, sigma, verdict):
    tolerance = Tolerance.parse("overshoot", "1", "1")
    texts = {"name": "overshoot", "title": "overshoot", "unit": "1"}
    assert ComparedMeasure(**texts, log=3.0, results=3.0 + difference, sigma=sigma, tolerance=tolerance).verdict == (
        verdict
    )


GRADIENT = "rad s^2/m"


@pytest.mark.parametrize(
    ("text", "unit", "relative", "absolute"),
    [
        ("5%", "rad/s", 0.05, 0.0),
        ("0.1 deg/g", GRADIENT, 0.0, np.radians(0.1) / STANDARD_GRAVITY),
        ("5 % + 20 ms", "s", 0.05, 0.02),
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
        ("-5 %", "tolerance yaw_rate=-5 %: expected finite numbers above 0; correct it"),
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
