"""Comparison of identifications: differences in sigmas, and what the runs share."""

from dataclasses import replace

import numpy as np
import pytest

from fifthwheel.base.errors import SignalError
from fifthwheel.estimate.identify import Verdict
from fifthwheel.results.assess.assessment import assess
from fifthwheel.results.diagnose import compare, spoken
from fifthwheel.results.report.comparison import comparison_headline
from tests.results.diagnose.chosen import AXIS, FRONT, REAR, SOFTENING, estimate, of


def run(result, log, *estimates, **others):
    """A result on a log of this name."""
    logs = tuple(replace(summary, name=log) for summary in result.identification.logs[:1])
    return of(result, *estimates, **{"logs": logs, "knowledge": None, **others})


def difference(a, b, parameter=0):
    return compare({"a": a, "b": b}).parameters[parameter].differences[1]


def estimated(comparison):
    """The parameters without derived quantities."""
    return [p for p in comparison.parameters if not p.derived]


def test_independent_errors_add(result):
    a, b = run(result, "1", estimate(FRONT, sigma=0.03)), run(result, "2", estimate(FRONT, value=1.1, sigma=0.04))
    found = difference(a, b)
    assert found.value == pytest.approx(0.1)
    assert found.sigma == pytest.approx(0.05)
    assert found.sigmas == pytest.approx(2.0)
    assert not found.at_least
    assert difference(a, run(result, "2", estimate(FRONT, **FIXED))).sigma == pytest.approx(0.03)
    assert compare({"a": a, "b": run(result, "2", estimate(FRONT, sigma=0.03))}).rows()[1][5] == "0.0 sigma"


def test_errors_of_a_common_vehicle_file_cancel(result):
    """9/25 and 16/25 of the variances come from the softening: 0.05^2 (16/25 + 9/25) + (0.03 - 0.04)^2."""
    a = run(result, "1", estimate(FRONT, sigma=0.05), variance_budget={FRONT: {SOFTENING: 9 / 25}})
    b = run(result, "2", estimate(FRONT, value=1.1, sigma=0.05), variance_budget={FRONT: {SOFTENING: 16 / 25}})
    assert difference(a, b).sigma == pytest.approx(np.sqrt(0.04**2 + 0.03**2 + 0.01**2))
    other = replace(b, initial_vehicle=b.initial_vehicle.replace({AXIS: 0.9 * b.initial_vehicle.parameters()[AXIS]}))
    budget = {"variance_budget": {FRONT: {AXIS: 9 / 25}}}
    a, b, other = (replace(one, **budget, parameters=(estimate(FRONT, sigma=0.05),)) for one in (a, b, other))
    assert difference(a, b).sigma == pytest.approx(np.sqrt(2) * 0.04)
    assert difference(a, other).sigma == pytest.approx(np.sqrt(2) * 0.05)  # of different vehicle files they do not


def test_what_the_logs_add_to_an_uncertain_number_is_independent(result):
    """The logs of both leave 60 % of the prior sigma: the shift by the prior is 0.6 of the part in the budget."""
    others = {"variance_budget": {FRONT: {SOFTENING: 16 / 25}}, "remaining_uncertainty": {SOFTENING: 0.6}}
    a, b = (run(result, log, estimate(FRONT, sigma=0.05), **others) for log in "12")
    assert difference(a, b).sigma == pytest.approx(np.sqrt(2 * (0.05**2 - 0.024**2)))


def test_logs_that_a_run_began_with_are_shared_too(result):
    knowledge = result.identification.knowledge
    first = run(result, "1", estimate(FRONT, sigma=0.03), knowledge=knowledge)
    assert difference(first, run(result, "2", estimate(FRONT, sigma=0.03), knowledge=knowledge)).at_least
    aside = replace(knowledge, logs=tuple(replace(log, set_aside="late") for log in knowledge.logs))
    assert not difference(first, run(result, "2", estimate(FRONT, sigma=0.03), knowledge=aside)).at_least


def test_shared_logs_make_the_difference_a_lower_bound(result):
    a, b = (run(result, "1", estimate(FRONT, sigma=0.03), estimate(REAR, **fixed)) for fixed in ({}, FIXED))
    comparison = compare({"a": a, "b": b})
    assert [p.differences[1].at_least for p in estimated(comparison)] == [True, False]
    assert any("a and b share 1" in note for note in comparison.notes)
    moved = compare({"a": a, "b": run(result, "1", estimate(FRONT, value=1.1, sigma=0.03), estimate(REAR, **FIXED))})
    assert moved.rows()[1][5].startswith("at least +")


FIXED = {"verdict": Verdict.FIXED, "sigma": None}


def test_what_differs_in_the_vehicle_files_is_noted(result):
    a = run(result, "1", estimate(FRONT, sigma=0.05))
    longer = a.initial_vehicle.replace({"semitrailer.cog": -5.25})
    b = run(result, "1", estimate(FRONT, value=1.1, sigma=0.05), initial_vehicle=longer)
    notes = compare({"a": a, "b": b}).notes
    assert notes[0].startswith(
        "The vehicle file of b differs from that of a: Trailer, CoG position −5.25 m instead of "
    )
    assert notes[1].endswith("It shows the effect of the vehicle files.")
    same = compare({"a": a, "b": a}).notes
    assert not any("differs" in note for note in same)
    assert any(note.endswith("Vehicle files and settings are equal.") for note in same)


def test_cog_height_and_rollover_threshold_of_each_run_follow_the_parameters(result):
    a = run(result, "1", estimate(FRONT, sigma=0.03))
    path = "semitrailer.payload.height"
    higher = a.vehicle.replace({path: 1.2 * a.vehicle.parameters()[path]})
    height = [e for e in a.derived if e.name == "semitrailer.cog_height"]
    b = run(result, "2", estimate(FRONT, sigma=0.03), vehicle=higher)
    *_, cog, threshold = compare({"a": a, "b": b}).parameters
    assert (cog.name, cog.estimates) == ("semitrailer.cog_height", (height[0], height[0]))
    expected = [assess(each, cheap=True)["rollover_threshold"] for each in (a, b)]
    assert [(e.value, e.sigma) for e in threshold.estimates] == [(m.value, m.sigma) for m in expected]
    assert threshold.differences[1].value < 0
    assert threshold.differences[1].sigma == pytest.approx(np.hypot(*[m.sigma for m in expected]))
    assert threshold.in_sigmas(1).startswith("at least −")


def test_differences_in_the_unit_in_per_cent_and_in_sigmas(result):
    a = run(result, "1", estimate(FRONT, value=4.8e5, sigma=3e3))
    b = run(result, "2", estimate(FRONT, value=4.32e5, sigma=4e3))
    row = compare({"a": a, "b": b}).rows()[1]
    assert row[3:] == ("−48.0 ± 5.0 kN/rad", "−10.0 ± 1.0 %", "−9.6 sigma")
    row = compare({"b": b, "a": a}).rows()[1]
    assert row[3] == "+48.0 ± 5.0 kN/rad"


def test_the_headline_names_what_differs_most(result):
    a = run(result, "1", estimate(FRONT, sigma=0.03), estimate(REAR, sigma=0.03))
    b = run(result, "2", estimate(FRONT, value=0.8, sigma=0.04), estimate(REAR, value=1.4, sigma=0.04))
    assert comparison_headline(compare({"a": a, "b": b})) == (
        f"Differs most from a: {spoken(REAR)} of b, +40.0 ± 5.0 % (+8.0 sigma). "
        "1 other difference is beyond chance too."
    )


def test_the_headline_omits_what_a_run_does_not_identify(result):
    a = run(result, "1", estimate(FRONT, sigma=0.03), estimate(REAR, sigma=0.03))
    unknown = estimate(REAR, value=1.4, sigma=0.04, verdict=Verdict.NOT_IDENTIFIABLE)
    b = run(result, "2", estimate(FRONT, value=0.8, sigma=0.04), unknown)
    for first, second in ((a, b), (b, a)):
        assert f"{spoken(FRONT)} of" in comparison_headline(compare({"a": first, "b": second}))
        assert spoken(REAR) not in comparison_headline(compare({"a": first, "b": second}))


def test_chance_takes_the_number_of_differences_into_account(result):
    """2.1 sigma is beyond chance alone, and not as the largest of two differences."""
    a, b = (run(result, log, estimate(FRONT, value=v, sigma=0.05 / 2**0.5)) for log, v in (("1", 1.0), ("2", 1.105)))
    c = run(result, "3", estimate(FRONT, sigma=0.05 / 2**0.5))
    assert len(compare({"a": a, "b": b}).beyond_chance()) == 1
    other = replace(b, derived=tuple(replace(e, value=2 * e.value) for e in b.derived))  # they do not count
    assert len(compare({"a": a, "b": other}).beyond_chance()) == 1
    assert compare({"a": a, "b": b, "c": c}).beyond_chance() == []
    assert comparison_headline(compare({"a": a, "b": b, "c": c})).startswith(
        f"No difference beyond chance. Largest: {spoken(FRONT)} of b, +10.5 ± 5.0 % (+2.1 sigma)"
    )


def test_a_single_run_is_refused_and_csv_has_no_formulas(result):
    with pytest.raises(SignalError, match="at least two"):
        compare({"a": result.identification})
    a, b = run(result, "1", estimate(FRONT)), run(result, "2", estimate(FRONT))
    lines = compare({"=1+1": a, "b,c": b}).to_csv().splitlines()
    assert lines[1].startswith(f"{FRONT},'=1+1,1.0,0.01,N/rad,converged")
    assert lines[2].startswith(f'{FRONT},"b,c",1.0')
