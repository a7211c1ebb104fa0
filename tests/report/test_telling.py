"""What the logs told of each parameter, and what would tell more."""

from dataclasses import replace

import pytest

from fifthwheel import vehicle
from fifthwheel.identify import identify
from fifthwheel.identify.outlook import outlook
from fifthwheel.report import telling
from fifthwheel.report.observed import Given
from fifthwheel.report.words import conclude
from fifthwheel.simulate import simulate


@pytest.fixture(scope="module")
def straight():
    truck = vehicle.get("cheng_cebon_2011")
    record = simulate(truck, manoeuvre="straight", duration=10, seed=3, name="straight")
    return record, identify([record], truck)


def test_a_good_log_leaves_little_of_the_prior(found):
    told = {one.name: one for one in telling.told(found.identification)}
    assert set(told) == {e.name for e in found.identification.parameters}
    front = told["tractor.front.cornering_stiffness"]
    e = found.identification[front.name]
    assert front.left == pytest.approx((e.sigma / e.value) / (e.prior / e.initial))
    assert front.left < 0.5
    assert telling.in_short(front).startswith("±30 % → ±")
    height = told["semitrailer.payload.height"]
    assert height.left == pytest.approx(height.after / height.before)
    assert telling.in_short(height).startswith("±1.0 m → ±")


def test_debts_are_parts_of_the_variance(found):
    for one in telling.told(found.identification):
        assert all(0 < part <= 1 for _, part in one.debts)
        assert sum(part for _, part in one.debts) <= 1.001
    height = next(one for one in telling.told(found.identification) if one.name.endswith("payload.height"))
    assert height.debts[0][0] == "semitrailer.roll_axis_height"


def test_a_straight_drive_tells_nothing_and_a_lane_change_would(straight):
    record, identification = straight
    reckoned = outlook([record], identification.vehicle)
    rows = telling.told(identification, reckoned)
    assert all(one.left > 0.95 for one in rows)
    assert all(any("one more lane change" in line for line in telling.lines(one)) for one in rows)
    html = telling.html(rows)
    assert html.count('class="untold"') == len(rows)
    steps = conclude(identification, [record], reckoned).next_steps
    assert "two lane changes" in steps[0]
    assert "By reckoning, one lane change" in steps[1]
    assert "tractor.front.cornering_stiffness to ±" in steps[1]


def test_residuals_that_hang_together_are_told(found):
    e = found.identification.parameters[0]
    reckoned = outlook(found.records[:1], found.identification.vehicle)
    wide = replace(e, sigma=5 * reckoned[e.name].sigma)
    row = telling.told(replace(found.identification, parameters=(wide,)), reckoned)[0]
    assert any("Sigma is 5" in line for line in telling.lines(row))
    assert row.helps == ()


def test_what_states_were_given_is_said():
    assert "(-i)" in Given().in_words()
    assert "(-i)" not in Given().in_words(identified=True)
    names = ("tractor.yaw_inertia", "steer.tractor.front.offset@a", "steer.tractor.front.offset@", "yaw_rate.x.gain")
    told = Given(smoothed=True, uncertain=names).in_words()
    assert "(1 of its parameters)" in told
    assert "2 errors" in told
    assert "Smoothed" in told
