"""The variance budget against fits with another vehicle file."""

from dataclasses import replace

import numpy as np
import pytest

from fifthwheel.diagnose.information_summary import dominant_terms, variance_budget
from fifthwheel.identify import identify

HEIGHT, AXIS = "semitrailer.payload.height", "semitrailer.roll_axis_height"


def test_a_fraction_is_the_square_of_the_shift_by_one_sigma(result):
    """Two fits with the roll axis one sigma higher and lower: a considered parameter shifts the estimate linearly."""
    identification, start = result.identification, result.identification.initial_vehicle
    value, sigma = start.parameters()[AXIS], identification.settings.consider["roll_axis_height"]
    low, high = (
        identify(result.records[:1], start.replace({AXIS: value * np.exp(sign * sigma)}))[HEIGHT].value
        for sign in (-1, 1)
    )
    (term,) = [term for term in variance_budget(identification, HEIGHT) if term.source == AXIS]
    assert term.fraction == pytest.approx(((high - low) / 2 / identification[HEIGHT].sigma) ** 2, rel=0.1)


def test_the_payload_height_depends_mostly_on_the_roll_axis(result):
    assert variance_budget(result.identification, HEIGHT)[0].source == AXIS
    for e in result.identification.parameters:
        fractions = [term.fraction for term in variance_budget(result.identification, e.name)]
        assert fractions == sorted(fractions, reverse=True)
        assert 0.5 < sum(fractions) <= 1.001


def test_a_term_above_half_of_the_variance_dominates(result):
    identification = result.identification
    assert dominant_terms(identification)
    for e in identification.parameters:
        largest = variance_budget(identification, e.name)[0]
        assert (largest in dominant_terms(identification)) == (largest.fraction > 0.5 and e.sigma > 0.05 * e.value)


def test_without_a_budget_there_are_no_terms(result):
    identification = replace(result.identification, variance_budget={})
    assert variance_budget(identification, HEIGHT) == []
    assert dominant_terms(identification) == []
