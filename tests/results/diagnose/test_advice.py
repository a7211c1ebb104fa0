"""What to do next, for results of which each verdict, sigma and log is chosen."""

from dataclasses import replace

import pytest

from fifthwheel.estimate.identify import Verdict
from fifthwheel.results.diagnose.advice import next_steps
from fifthwheel.truck.spoken_names import named
from tests.results.diagnose.chosen import (
    AXIS,
    FRONT,
    HEIGHT,
    INERTIA,
    REAR,
    SOFTENING,
    estimate,
    of,
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
