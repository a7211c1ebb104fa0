"""What the reader is told: what is known, what is not, what to do."""

from dataclasses import replace

import numpy as np
import pytest

from fifthwheel import vehicle
from fifthwheel.identify import SensorError, Verdict, identify
from fifthwheel.report import facts
from fifthwheel.report.state_words import conclude_states
from fifthwheel.report.words import conclude, spoken
from fifthwheel.simulate import simulate

from .conftest import NASTY


def with_verdict(identification, verdict, **changes):
    """The identification with its first parameter changed."""
    first, *rest = identification.parameters
    return replace(identification, parameters=(replace(first, verdict=verdict, **changes), *rest))


def test_all_known(found):
    told = conclude(found.identification, found.records[:1])
    assert told.good
    assert told.headline == "All 5 parameters are known from 1 log, 1 of them roughly."
    assert len([line for line in told.found if "vehicle file" in line]) == 5
    assert any("CoG height" in line for line in told.found)
    assert told.unknown == ()


def test_a_wide_sigma_is_roughly(found):
    told = conclude(with_verdict(found.identification, Verdict.CONVERGED, sigma=2e5))
    assert "2 of them roughly" in told.headline
    assert "roughly" in told.found[0]
    assert any("For tractor.front.cornering_stiffness" in line for line in told.next_steps)


@pytest.mark.parametrize(
    ("verdict", "changes", "said", "advised"),
    [
        (Verdict.NOT_CONVERGED, {}, "provisional", "add another log"),
        (Verdict.AT_BOUND, {}, "edge of what is allowed", "wrong vehicle file"),
        (Verdict.HELD, {}, "held at", ""),
        (Verdict.NOT_EXCITED, {"sigma": 1e5}, "not excited", "lane change"),
        (Verdict.NOT_EXCITED, {"sigma": None}, "not sought, no roll rate", "Log the roll rate of the tractor"),
    ],
)
def test_each_verdict_says_what_and_what_next(found, verdict, changes, said, advised):
    told = conclude(with_verdict(found.identification, verdict, **changes), found.records)
    assert any(said in line for line in told.unknown)
    assert any(advised in line for line in told.next_steps) or not advised
    assert "4 of 5" in told.headline or verdict is Verdict.HELD


def test_a_straight_road_tells_nothing():
    truck = vehicle.get("cheng_cebon_2011")
    record = simulate(truck, manoeuvre="straight", duration=10, seed=3, name="straight")
    identification = identify([record], truck)
    for records in ([record], []):  # the terminal has no records
        told = conclude(identification, records)
        assert told.headline.startswith("No parameter is known from 1 log")
        assert "two lane changes" in told.next_steps[0]
        assert "as good as straight" in told.next_steps[0]


def test_a_straight_log_beside_a_lively_one_is_not_blamed(found):
    fits = [
        replace(f, log="straight", explained=0.0, rms=facts.white_noise(f.measured)) for f in found.identification.fits
    ]
    told = conclude(replace(found.identification, fits=(*found.identification.fits, *fits)))
    assert not any("Next to nothing" in line for line in told.cautions)
    dead = replace(found.identification.fits[0], explained=0.0)
    told = conclude(replace(found.identification, fits=(dead, *found.identification.fits[1:])))
    assert any("Next to nothing" in line for line in told.cautions)


def test_states_that_do_not_fit_are_told_of_an_identification(found):
    loud = replace(found.states[0], innovation={n: 3 * v for n, v in found.states[0].innovation.items()})
    told = conclude(found.identification, found.records, states=[loud])
    assert any("bands are too narrow" in line for line in told.cautions)


def test_a_wrong_steering_ratio_is_pointed_at(found):
    error = SensorError(name="steer.tractor.front.gain", value=1.25, sigma=0.05, unit="1", log=None)
    told = conclude(replace(found.identification, sensors=(error,)))
    assert any("1.250 ± 0.050 times as far" in line for line in told.cautions)
    assert any("ratio" in line for line in told.next_steps)


def test_a_poor_prediction_is_no_proof(found):
    identification = found.identification
    good = conclude(identification)
    assert any("only predicted" in line for line in good.found) or any(NASTY in line for line in good.cautions)
    fits = tuple(f if f.identified_on else replace(f, explained=0.3, rms=10 * f.rms) for f in identification.fits)
    told = conclude(replace(identification, fits=fits))
    assert any("30.0 % is explained" in line for line in told.cautions)
    assert told.next_steps[0].startswith("Identify on")
    assert not any("only predicted" in line for line in told.found)


def test_another_speed_is_an_extrapolation(found):
    slow = found.records[1].with_signals({"speed": np.full(len(found.records[1]), 12.0)})
    told = conclude(found.identification, [found.records[0], slow])
    assert any("43 km/h" in line and "extrapolation" in line for line in told.cautions)


def test_states_in_words(found):
    told = conclude_states(found.states, found.records)
    assert not told.good
    assert any("too slow for the model" in line for line in told.found)
    assert any("sideslip.semitrailer" in line and "deg" in line for line in told.found)
    loud = replace(found.states[0], innovation={n: 3 * v for n, v in found.states[0].innovation.items()})
    told = conclude_states([loud], found.records)
    assert any("bands are too narrow" in line for line in told.cautions)
    assert told.headline.endswith("do not rely on these states.")
    assert not any("reliable" in line for line in told.found)
    assert told.next_steps


def test_white_noise():
    time = np.arange(5000) * 0.01
    noise = 0.02 * np.random.default_rng(0).standard_normal(5000)
    assert facts.white_noise(np.sin(time) + noise) == pytest.approx(0.02, rel=0.05)
    assert np.isnan(facts.white_noise(time[:5]))


def test_sideways_acceleration(found):
    drive = facts.driven(found.identification, found.records[:1])[0]
    without = facts.driven(found.identification, [])[0]
    assert 1.0 < drive.acceleration < 3.0
    assert without.acceleration == pytest.approx(drive.acceleration, rel=0.01)
    assert drive.speed == pytest.approx((88 / 3.6, 88 / 3.6))


def test_spoken():
    assert spoken("semitrailer.cog_height") == "semitrailer CoG height"


def test_a_value_far_from_the_vehicle_file_is_doubted(found):
    first = found.identification.parameters[0]
    told = conclude(with_verdict(found.identification, Verdict.CONVERGED, value=2.8 * first.initial))
    assert any("2.8 times the vehicle file's" in line for line in told.cautions)
    assert not any("times the vehicle file's" in line for line in conclude(found.identification).cautions)
