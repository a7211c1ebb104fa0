"""What the logs contribute to each parameter, and what would reduce its sigma."""

import pytest

from fifthwheel.estimate.design import Remedy
from fifthwheel.estimate.design.assess import predict_sigmas
from fifthwheel.estimate.identify import Verdict, identify
from fifthwheel.model.simulate import simulate
from fifthwheel.results.diagnose.advice import next_steps
from fifthwheel.results.diagnose.information_summary import (
    information_summary,
    variance_budget,
)
from fifthwheel.results.diagnose.summaries import summarise_runs
from fifthwheel.truck import get
from fifthwheel.truck.quantities import FRICTION
from fifthwheel.truck.spoken_names import named
from tests.results.diagnose.chosen import AXIS, FRONT, HEIGHT, REAR, assessment, estimate, of, outlook


@pytest.fixture(scope="module")
def straight():
    truck = get("cheng_cebon_2011")
    record = simulate(truck, manoeuvre="straight", duration=10, seed=3, name="straight")
    return record, identify([record], truck)


def test_lane_changes_leave_little_of_the_prior_sigma(result):
    rows = {row.estimate.name: row for row in information_summary(result.identification)}
    assert set(rows) == {e.name for e in result.identification.parameters}
    front = rows["tractor.front.cornering_stiffness"]
    e = result.identification[front.estimate.name]
    assert front.remaining == pytest.approx((e.sigma / e.value) / (e.prior / e.initial))
    assert front.remaining < 0.5
    assert front.change.startswith("±30 % → ±")
    height = rows["semitrailer.payload.height"]
    assert height.remaining == pytest.approx(height.estimate.sigma / height.estimate.prior)
    assert height.change.startswith("±0.75 m → ±")


@pytest.mark.slow
def test_a_straight_run_contains_no_information_and_a_lane_change_would(straight):
    record, identification = straight
    outlook = predict_sigmas([record], identification.vehicle)
    rows = information_summary(identification, outlook)
    assert {row.estimate.verdict for row in rows} == {Verdict.NOT_EXCITED}
    predicted = [row for row in rows if row.estimate.name != FRICTION]  # the prediction has linear tyres
    assert len(predicted) == len(rows) - 1
    assert all(any("one more lane change" in message for message in row.messages) for row in predicted)
    first, second, *_ = next_steps(identification, summarise_runs(identification, [record]), outlook)
    assert "two or more lane changes" in first.message
    assert set(first.parameters) == {e.name for e in identification.parameters}
    assert second.message.startswith("Predicted sigma if one more lane change (SAE J2179) at 88 km/h is driven")
    front = outlook["tractor.front.cornering_stiffness"]
    sigma = front.remedies[0].sigma / front.value
    assert f"{100 * sigma:.2g} % for {named('tractor.front.cornering_stiffness')}" in second.message


def test_the_information_summary_of_an_outlook(result):
    """Sigma above 1.5 times that of the noise is due to autocorrelation, otherwise changes are listed that bring it
    below 0.9."""

    def row(e, *remedies, **others):
        return information_summary(of(result, e), outlook(assessment(FRONT, *remedies, **others)))[0]

    useful, useless = Remedy(drive="again", sigma=0.0899), Remedy(drive="lane_change", sigma=0.0901)
    for verdict in (Verdict.CONVERGED, Verdict.NOT_CONVERGED):
        assert row(estimate(FRONT, verdict, sigma=0.151), useful).noise_sigma == 0.1
        assert row(estimate(FRONT, verdict, sigma=0.151), useful).improvements == ()
        assert row(estimate(FRONT, verdict, sigma=0.149)).noise_sigma is None
    assert row(estimate(FRONT, Verdict.NOT_EXCITED, sigma=0.2)).noise_sigma is None
    assert row(estimate(FRONT, sigma=0.2), verdict=Verdict.NOT_EXCITED).noise_sigma is None
    improvements = row(estimate(FRONT, sigma=0.1), useful, useless).improvements
    assert improvements == ((useful, 0.0899 / 2.0),)
    assert len(row(estimate(FRONT, Verdict.NOT_EXCITED, sigma=None), useful, useless).improvements) == 2
    assert row(estimate(REAR, sigma=0.2), useful).improvements == ()
    fixed = of(result, estimate(FRONT, Verdict.FIXED), estimate(REAR))
    assert [r.estimate.name for r in information_summary(fixed)] == [REAR]


def test_the_remaining_uncertainty_is_that_of_the_estimates(result):
    identification = result.identification
    remaining = identification.remaining_uncertainty
    for e in identification.uncertain:
        prior = e.prior / e.initial if e.value > 0 else e.prior
        assert remaining[e.name] == pytest.approx(min(e.sigma / e.value / prior, 1.0))
    budget = identification.variance_budget[HEIGHT]
    assert remaining.keys() == budget.keys()
    assert max(remaining.values()) <= 1.0
    sources = [term.source for term in variance_budget(result.identification, HEIGHT)]
    assert set(sources[:3]) == {AXIS, "semitrailer.roll_stiffness", "semitrailer.sprung.cog_height"}
    for e in result.identification.parameters:
        fractions = [term.fraction for term in variance_budget(result.identification, e.name)]
        assert fractions == sorted(fractions, reverse=True)
        assert all(0 <= fraction < 1 for fraction in fractions)
