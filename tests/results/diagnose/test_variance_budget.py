"""The variance budget against fits with another vehicle file."""

from dataclasses import replace

import pytest

from fifthwheel.estimate.identify import identify
from fifthwheel.results.diagnose.information_summary import dominant_terms, variance_budget

HEIGHT, AXIS = "semitrailer.payload.height", "semitrailer.roll_axis_height"


def test_a_fraction_is_the_reduction_of_the_variance_by_an_exact_number(result):
    """A fit with the roll axis fixed where the other one estimates it."""
    identification = result.identification
    (axis,) = [e for e in identification.uncertain if e.name == AXIS]
    truck = identification.initial_vehicle.replace({AXIS: axis.value})
    known = identify(result.records[:1], truck, replace(identification.settings, given={AXIS: "exact"}))
    (term,) = [term for term in variance_budget(identification, HEIGHT) if term.source == AXIS]
    assert term.fraction == pytest.approx(1 - (known[HEIGHT].sigma / identification[HEIGHT].sigma) ** 2, rel=0.1)


def test_the_remaining_uncertainty_is_that_of_the_estimates(result):
    identification = result.identification
    remaining = identification.remaining_uncertainty
    for e in identification.uncertain:
        prior = e.prior / e.initial if e.value > 0 else e.prior
        assert remaining[e.name] == pytest.approx(min(e.sigma / e.value / prior, 1.0))
    budget = identification.variance_budget[HEIGHT]
    assert remaining.keys() == budget.keys()
    assert max(remaining.values()) <= 1.0


def test_the_payload_height_depends_mostly_on_suspension_roll_axis_and_unladen_body(result):
    sources = [term.source for term in variance_budget(result.identification, HEIGHT)]
    assert set(sources[:3]) == {AXIS, "semitrailer.roll_stiffness", "semitrailer.sprung.cog_height"}
    for e in result.identification.parameters:
        fractions = [term.fraction for term in variance_budget(result.identification, e.name)]
        assert fractions == sorted(fractions, reverse=True)
        assert all(0 <= fraction < 1 for fraction in fractions)


def test_one_or_two_terms_above_half_of_the_variance_dominate(result):
    e = result.identification[HEIGHT]
    wide = replace(e, sigma=0.1 * e.value)

    def dominant(*fractions, estimate=wide):
        budget = {HEIGHT: dict(zip("abc", fractions, strict=False))}
        of = replace(result.identification, parameters=(estimate,), variance_budget=budget)
        return "".join(term.source for terms in dominant_terms(of).values() for term in terms)

    assert dominant(0.51, 0.4) == "a"
    assert dominant(0.5, 0.3, 0.1) == "ab"
    assert dominant(0.3, 0.2) == dominant(0.3, 0.19) == dominant(0.25, 0.25) == dominant(0.4, 0.05) == ""
    assert dominant(0.3, 0.21, 0.2) == "ab"
    assert dominant(0.51, estimate=replace(e, sigma=0.04 * e.value)) == ""


def test_without_a_budget_there_are_no_terms(result):
    identification = replace(result.identification, variance_budget={})
    assert variance_budget(identification, HEIGHT) == []
    assert dominant_terms(identification) == {}
