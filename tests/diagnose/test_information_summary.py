"""What the logs contribute to each parameter, and what would reduce its sigma."""

from dataclasses import replace

import pytest

from fifthwheel import vehicle
from fifthwheel.diagnose.advice import next_steps
from fifthwheel.diagnose.information_summary import information_summary
from fifthwheel.diagnose.run_summary import summarise_runs
from fifthwheel.identify import identify
from fifthwheel.identify.design.assess import assess_information
from fifthwheel.simulate import simulate


@pytest.fixture(scope="module")
def straight():
    truck = vehicle.get("cheng_cebon_2011")
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
    assert height.change.startswith("±1.0 m → ±")


def test_a_straight_run_contains_no_information_and_a_lane_change_would(straight):
    record, identification = straight
    outlook = assess_information([record], identification.vehicle)
    rows = information_summary(identification, outlook)
    assert all(row.remaining > 0.95 for row in rows)
    assert all(any("one more lane change" in message for message in row.messages) for row in rows)
    first, second, *_ = next_steps(identification, summarise_runs(identification, [record]), outlook)
    assert "two or more lane changes" in first.message
    assert set(first.parameters) == {e.name for e in identification.parameters}
    assert second.message.startswith("Predicted sigma if one more lane change (SAE J2179) at 88 km/h is driven")
    sigma = outlook["tractor.front.cornering_stiffness"].remedies[0].sigma / 4.75e5
    assert f"tractor.front.cornering_stiffness {100 * sigma:.2g} %" in second.message


def test_a_sigma_far_above_the_sensor_noise_is_due_to_autocorrelation(result):
    e = result.identification.parameters[0]
    outlook = assess_information(result.records[:1], result.identification.vehicle)
    wide = replace(e, sigma=5 * outlook[e.name].sigma)
    row = information_summary(replace(result.identification, parameters=(wide,)), outlook)[0]
    assert row.noise_sigma == outlook[e.name].sigma
    assert any("Sigma is 5" in message for message in row.messages)
    assert row.improvements == ()
