"""What to do next, for results of which each verdict, sigma and log is chosen."""

from dataclasses import replace

import numpy as np
import pytest

from fifthwheel.estimate.design import Remedy
from fifthwheel.estimate.identify import Verdict
from fifthwheel.estimate.identify.doubts import Cause
from fifthwheel.results.diagnose import advice
from fifthwheel.results.diagnose.advice import LANE_CHANGE, next_steps
from fifthwheel.results.diagnose.doubt_cautions import describe_cause
from fifthwheel.results.diagnose.information_summary import describe_remedy
from fifthwheel.results.diagnose.summaries import RunSummary
from fifthwheel.truck.spoken_names import named
from tests.results.diagnose.chosen import (
    AXIS,
    FRONT,
    HEIGHT,
    INERTIA,
    REAR,
    SOFTENING,
    assessment,
    estimate,
    of,
    outlook,
)

WITHOUT_ROLL_RATES = ("speed", "steer.tractor.front", "yaw_rate.tractor", "yaw_rate.semitrailer")


def messages(identification, *arguments):
    return [step.message for step in next_steps(identification, *arguments)]


def test_a_good_result_needs_a_validation_only(result):
    good = of(result, estimate(FRONT))
    (step,) = next_steps(good)
    assert "Validate the result" in step.message
    assert step.parameters == step.signals == step.logs == ()
    (fit, *fits) = good.fits
    assert next_steps(replace(good, fits=(*fits, replace(fit, identified_on=False)))) == []
    assert not any("Validate" in m for m in messages(of(result, estimate(FRONT, Verdict.NOT_CONVERGED))))


@pytest.mark.parametrize(
    ("verdict", "text"),
    [
        (Verdict.AT_BOUND, "usually indicates an error in the vehicle file or a log"),
        (Verdict.DOUBTFUL, "Check what the cautions name"),
        (Verdict.NOT_CONVERGED, "The search had not ended"),
    ],
)
def test_verdicts(result, verdict, text):
    steps = next_steps(of(result, estimate(FRONT, verdict), estimate(REAR, verdict), estimate(INERTIA)))
    assert [step.parameters for step in steps if text in step.message] == [(FRONT, REAR)]
    assert not any(text in m for m in messages(of(result, estimate(FRONT))))


def test_poorly_predicted_logs_are_to_be_used(result):
    unseen = [replace(fit, identified_on=False, explained=0.5, rms=1e3) for fit in of(result).fits]
    one = of(result, estimate(FRONT), fits=tuple(replace(fit, log="a") for fit in unseen))
    first = next_steps(one)[0]
    assert (first.message, first.logs) == (
        "Use a for the identification too, because it is predicted poorly.",
        ("a",),
    )
    two = replace(one, fits=(*one.fits, *(replace(fit, log="b") for fit in unseen)))
    first = next_steps(two)[0]
    assert first.message == "Use a and b for the identification too, because they are predicted poorly."
    assert first.logs == ("a", "b")


def test_more_excitation_by_the_quantity_that_is_missing(result):
    wide = [estimate(name, sigma=0.2) for name in (FRONT, REAR, INERTIA, HEIGHT)]
    steps = {step.parameters: step.message for step in next_steps(of(result, *wide)) if "To improve" in step.message}
    assert list(steps) == [(FRONT, REAR), (INERTIA,), (HEIGHT,)]
    assert steps[FRONT, REAR].startswith(f"To improve {named(FRONT)} and {named(REAR)}, add a log with a lane change")
    assert "fast lane changes or a slalom" in steps[INERTIA,]
    assert "more roll" in steps[HEIGHT,]
    not_excited = estimate(FRONT, Verdict.NOT_EXCITED, sigma=0.3)
    assert any("To improve" in m for m in messages(of(result, not_excited)))
    for nothing in (
        estimate(FRONT, Verdict.NOT_IDENTIFIABLE, sigma=0.3),
        estimate(FRONT, Verdict.NOT_CONVERGED, sigma=0.3),
        estimate(FRONT, Verdict.NOT_EXCITED, sigma=None),
    ):
        assert not any("To improve" in m for m in messages(of(result, nothing, signals=WITHOUT_ROLL_RATES)))
    budget = {FRONT: {AXIS: 0.6}}  # another run would not help
    assert not any("To improve" in m for m in messages(of(result, estimate(FRONT, sigma=0.2), variance_budget=budget)))


def test_only_runs_of_the_identification_are_straight(result):
    wide, used = estimate(FRONT, sigma=0.2), result.identification.logs[0].name

    def advice(*runs):
        summaries = [RunSummary(name=name, speed=(20.0, 25.0), acceleration=a) for name, a in runs]
        return messages(of(result, wide), summaries)[0]

    straight = f"Drive two or more lane changes ({LANE_CHANGE}) and add that log. The present logs reach a lateral "
    assert advice((used, 0.3)).startswith(f"{straight}acceleration of only 0.30 m/s²")
    assert advice((used, 0.3), (used, 0.4)).startswith(f"{straight}acceleration of only 0.40 m/s²")
    for runs in ([(used, 0.3), (used, 1.0)], [("other", 0.3)], [(used, np.nan)], []):
        assert advice(*runs).startswith("To improve")
    assert advice((used, np.nan), (used, 0.3)).startswith(straight)
    lonely = messages(of(result, estimate(FRONT)), [RunSummary(name=used, speed=(20.0, 25.0), acceleration=0.1)])
    assert not any("lane changes" in m for m in lonely)


def test_a_missing_roll_rate(result):
    for verdict, sigma in ((Verdict.NOT_IDENTIFIABLE, 0.3), (Verdict.NOT_EXCITED, None)):
        missing = estimate(HEIGHT, verdict, sigma=sigma)
        steps = next_steps(of(result, missing, estimate(FRONT), signals=WITHOUT_ROLL_RATES))
        (step,) = (step for step in steps if step.signals)
        assert (step.signals, step.parameters) == (("roll_rate.semitrailer",), (HEIGHT,))
        assert step.message.startswith("Log the roll rate of the trailer and identify again.")
        assert f"do not determine {named(HEIGHT)}, nor" in step.message
        assert step.option == "roll_rate.semitrailer"
    for other in (
        estimate(HEIGHT, Verdict.NOT_EXCITED, sigma=0.3),
        estimate(HEIGHT, Verdict.NOT_IDENTIFIABLE, correlated_with=(AXIS,)),
        estimate(HEIGHT, Verdict.NOT_CONVERGED),
    ):
        assert not any(step.signals for step in next_steps(of(result, other, signals=WITHOUT_ROLL_RATES)))


@pytest.mark.parametrize(("verdict", "sigma"), [(Verdict.NOT_IDENTIFIABLE, 0.3), (Verdict.NOT_EXCITED, None)])
def test_a_logged_roll_rate_needs_more_roll(result, verdict, sigma):
    logged = of(result, estimate(HEIGHT, verdict, sigma=sigma))
    assert "roll_rate.semitrailer" in logged.signals
    steps = next_steps(logged)
    assert not any(step.signals or "Log the roll rate" in step.message for step in steps)
    assert any(step.parameters == (HEIGHT,) and "add lane changes with more roll" in step.message for step in steps)


def test_what_separates_correlated_parameters(result):
    stated = f"state {named(AXIS)} with its uncertainty from another source"
    for other, cure, option in (
        (AXIS, stated, f'given={{"{AXIS}": "VALUE +- SIGMA"}}'),
        ("steer.x.gain", "calibration", ""),
    ):
        correlated = estimate(HEIGHT, Verdict.NOT_IDENTIFIABLE, correlated_with=(other, REAR))
        (step,) = (s for s in next_steps(of(result, correlated)) if "To identify" in s.message)
        assert step.parameters == (HEIGHT,)
        assert step.message.startswith(f"To identify {named(HEIGHT)}, ")
        assert cure in step.message
        assert named(other) in step.message
        assert step.option == option
    assert not any("To identify" in m for m in messages(of(result, estimate(HEIGHT, correlated_with=(AXIS,)))))


def test_dominant_uncertainties_are_one_step_for_each_parameter(result):
    axis = estimate(AXIS, Verdict.NOT_EXCITED, value=-2.0, sigma=0.3, initial=-1.5, prior=0.3)
    wide, height = estimate(HEIGHT, sigma=0.1), named(HEIGHT)

    def step(budget):
        identification = of(result, wide, variance_budget={HEIGHT: budget}, uncertain=(axis,))
        (found,) = (s for s in next_steps(identification) if s.parameters == (HEIGHT,))
        return found

    both = step({AXIS: 0.4, "mass_scale": 0.2})
    assert both.message == (
        f"Measure {named(AXIS)} and the scale of all masses: about 60 % of the variance of {height} comes from them. "
        "Or calibrate the suspension: by a log with a known payload, or by a static test."
    )
    assert both.option == (
        f'given={{"{AXIS}": "+- 5 %"}}\nmass_scale in the vehicle file\nknowledge="RESULT" Occasion(load="NAME")\n'
        "fifthwheel roll-test"
    )
    masses = step({"mass_scale": 0.6})
    assert masses.message == f"Measure the scale of all masses: about 60 % of the variance of {height} comes from it."
    softening = step({SOFTENING: 0.6})
    assert softening.message.startswith("Drive with less lateral acceleration: 60 % of the variance of")
    assert softening.option == 'tyres="saturating"'


def test_no_step_has_an_option_or_a_path_in_its_words(result):
    verdicts = [Verdict.NOT_IDENTIFIABLE, Verdict.AT_BOUND, Verdict.NOT_CONVERGED, Verdict.NOT_EXCITED]
    estimates = [estimate(n, v, sigma=0.3) for n, v in zip((HEIGHT, FRONT, REAR, INERTIA), verdicts, strict=True)]
    steps = [
        *next_steps(of(result, *estimates)),
        *next_steps(of(result, estimate(HEIGHT, sigma=0.1), variance_budget={HEIGHT: {AXIS: 0.6}})),
    ]
    assert len(steps) >= 6
    assert not [step for step in steps if "--" in step.message or "_" in step.message]


def test_the_predicted_effect_of_changes(result):
    run, channel = Remedy(drive="lane_change", sigma=0.1), Remedy(channel="roll_rate.semitrailer", sigma=0.3)
    known = Remedy(known=(AXIS,), sigma=0.2)
    future = outlook(assessment(FRONT, run, known), assessment(REAR, run, channel), assessment(INERTIA, run))
    estimates = (
        estimate(FRONT, Verdict.NOT_EXCITED), estimate(REAR, Verdict.NOT_IDENTIFIABLE), estimate(INERTIA)
    )  # fmt: skip
    predicted = [s for s in next_steps(of(result, *estimates), (), future) if "Predicted" in s.message]
    assert [(s.message, s.parameters) for s in predicted] == [
        (
            "Predicted sigma if one more lane change (SAE J2179) at 90 km/h is driven, at best: "
            f"5 % for {named(FRONT)} and 5 % for {named(REAR)}.",
            (FRONT, REAR),
        ),
        (f"Predicted sigma if the roll rate of the trailer is logged, at best: 15 % for {named(REAR)}.", (REAR,)),
    ]


def test_changes_in_words():
    assert describe_remedy(Remedy(drive="again")) == "if the same run is repeated"
    assert describe_remedy(Remedy(drive="lane_change")) == "if one more lane change is driven"
    both = Remedy(drive="lane_change", channel="roll_rate.tractor")
    assert describe_remedy(both, "a slalom") == "if roll_rate.tractor is logged and a slalom is driven"


def cause(changes, name=None, prior_sigmas=4.0):
    return Cause(name=name or next(iter(changes)), changes=changes, prior_sigmas=prior_sigmas)


@pytest.mark.parametrize("sign", [-1, 1])
def test_causes_in_words(result, sign):
    vehicle = result.identification.initial_vehicle
    values = vehicle.parameters()
    later = sign > 0
    times = "4.0 times the assumed uncertainty"
    mass, stiffness, sensitivity = "tractor.mass", "semitrailer.roll_stiffness", "tyre.stiffness_load_sensitivity"
    larger = "larger" if later else "smaller"
    position = "tractor.front.position"
    for what, text in (
        (
            cause({"time_base.scale": sign * 0.02}, "time_base"),
            f"the time base runs 2 % too {'slow' if later else 'fast'} (timestamps)",
        ),
        (cause({mass: sign * 0.1 * values[mass]}, "mass_scale", sign * 4.0), f"all masses are 10 % {larger} ({times})"),
        (
            cause({"yaw_rate.tractor.delay": sign * 0.05}, prior_sigmas=sign * 4.0),
            f"yaw_rate.tractor is 50 ms {'late' if later else 'early'} ({times})",
        ),
        (
            cause({"tractor.softening": sign * 1.0}),
            f'the tyres of tractor soften more with the slip angle: use tyres="saturating" ({times})',
        ),
        (
            replace(cause({sensitivity: sign * 0.16}), prior_mean=0.2),
            f"{sensitivity} is 1.8 times its prior value ({times})"
            if later
            else "the stiffness of the tyres hardly depends on their load, as in simulations with linear tyres: "
            f'there use tyres="linear" ({times})',
        ),
        (
            cause(
                {position: sign * 0.1, "tractor.drive.position": sign * -0.25, "tractor.drive.static_load": 5e3},
                "tractor.axle_positions",
            ),
            "the axles of the tractor are up to 0.25 m "
            f"{'closer to' if later else 'further from'} its front axle ({times})",
        ),
        (
            cause({"yaw_rate.tractor.gain": sign * 0.1}),
            f"yaw_rate.tractor is {'1.10' if later else '0.900'} times the true value ({times})",
        ),
        (
            cause({"steer.tractor.front.gain": sign * 0.1}),
            f"the road wheels turn by {'1.10' if later else '0.900'} times steer.tractor.front ({times})",
        ),
        (
            cause({"steer.tractor.front.offset": sign * 0.01}, "steer.tractor.front.offset@1"),
            f"steer.tractor.front has an offset of {'' if later else '−'}0.573 deg in b ({times})",
        ),
        (
            cause({"roll_rate.tractor.misalignment": sign * 0.1}),
            f"the gyro of roll_rate.tractor is turned by 5.73 deg, so that it measures another axis too ({times})",
        ),
        (
            cause({position: sign * 0.1}),
            f"{position} is 0.10 m further to the {'front' if later else 'rear'} ({times})",
        ),
        (cause({stiffness: sign * 0.2 * values[stiffness]}), f"{stiffness} is 20 % {larger} ({times})"),
        (
            cause({stiffness: sign * 0.2 * values[stiffness], mass: 1.0}),
            f"{stiffness} is 20 % {larger} with 1 other numbers that belong to it ({times})",
        ),
        (
            cause({stiffness: sign * 0.2 * values[stiffness]}, f"{stiffness}.variation@1"),
            f"{stiffness} is 20 % {larger} in b than in all logs together ({times})",
        ),
    ):
        assert describe_cause(what, vehicle, ("a", "b")) == text


@pytest.mark.parametrize(
    "end", ["semitrailer.payload.height", "fifth_wheel.roll_stiffness", "tractor.drive.roll_damping"]
)
def test_what_acts_on_roll_needs_more_roll(end: str) -> None:
    assert advice._excited_by(end) == advice.ROLL


def test_a_suspension_stays_with_another_load() -> None:
    assert advice._is_of_suspension("fifth_wheel.roll_stiffness")
    assert not advice._is_of_suspension("semitrailer.payload.height")
    assert not advice._is_of_suspension("semitrailer.yaw_inertia")
