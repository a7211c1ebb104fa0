"""Curves of two evaluations by hand: bands of gains, phases and histories, and the rule of the verdicts."""

import numpy as np
import pytest

from fifthwheel.results.evaluate import ComparedMeasure, Evaluation
from fifthwheel.results.evaluate.curves import compared_curves
from fifthwheel.results.evaluate.tolerances import Tolerance

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


def test_a_gain_has_a_band_relative_to_each_value():
    gain = 5.0 / FREQUENCY
    log = evaluation(frequency=FREQUENCY, gain__yaw_rate__tractor=gain)
    high = evaluation(frequency=FREQUENCY, gain__yaw_rate__tractor=gain + 0.6 * (FREQUENCY > 1))
    assert curve(high, log, gain="10 %").verdict == "outside"
    assert curve(high, log, gain="30 %").verdict == "inside"


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
        (0.5, 0.3, "undecided"),
        (1.5, 0.2, "outside"),
        (1.5, 0.3, "undecided"),
        (0.0, 0.6, "undecided"),
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
