"""What to do next, for results of which each verdict, sigma and log is chosen."""

from dataclasses import replace

import numpy as np
import pytest

from fifthwheel.diagnose.advice import LANE_CHANGE, describe_remedy, next_steps
from fifthwheel.diagnose.cautions import describe_cause
from fifthwheel.diagnose.information_summary import ParameterInformation, information_summary
from fifthwheel.diagnose.run_summary import RunSummary, summarise_records, summarise_runs
from fifthwheel.diagnose.variance_budget import VarianceTerm
from fifthwheel.identify import Estimate, SensorError, Verdict
from fifthwheel.identify.design import Remedy
from fifthwheel.identify.design.assess import InformationAssessment, ParameterAssessment
from fifthwheel.identify.doubts import Cause

FRONT, REAR = "tractor.front.cornering_stiffness", "semitrailer.cornering_stiffness"
INERTIA, HEIGHT = "semitrailer.yaw_inertia", "semitrailer.payload.height"
AXIS, SOFTENING = "semitrailer.roll_axis_height", "tractor.softening"
UNITS = {FRONT: "N/rad", REAR: "N/rad", INERTIA: "kg m^2", HEIGHT: "m", AXIS: "m"}


def estimate(name, verdict=Verdict.CONVERGED, *, sigma=0.01, **others):
    defaults = {"value": 1.0, "initial": 1.0, "stage": 1, "prior": 0.3, "unit": UNITS[name]}
    return Estimate(name=name, verdict=verdict, sigma=sigma, **(defaults | others))


def of(result, *estimates, **others):
    """A result with these parameters, and nothing else to say."""
    fits = tuple(fit for fit in result.identification.fits if fit.identified_on)
    nothing = {"fits": fits, "variance_budget": {}, "uncertain": (), "sensors": (), "doubts": ()}
    return replace(result.identification, parameters=estimates, **(nothing | others))


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
        (Verdict.DOUBTFUL, "Check the numbers that the cautions name"),
        (Verdict.NOT_CONVERGED, "may compensate each other"),
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
    assert steps[FRONT, REAR].startswith(f"To improve {FRONT} and {REAR}, add a log with a lane change")
    assert "fast lane changes or a slalom" in steps[INERTIA,]
    assert "more roll" in steps[HEIGHT,]
    not_excited = estimate(FRONT, Verdict.NOT_EXCITED, sigma=0.3)
    assert any("To improve" in m for m in messages(of(result, not_excited)))
    for nothing in (
        estimate(FRONT, Verdict.NOT_IDENTIFIABLE, sigma=0.3),
        estimate(FRONT, Verdict.NOT_CONVERGED, sigma=0.3),
        estimate(FRONT, Verdict.NOT_EXCITED, sigma=None),
    ):
        assert not any("To improve" in m for m in messages(of(result, nothing)))
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
        steps = next_steps(of(result, estimate(HEIGHT, verdict, sigma=sigma), estimate(FRONT)))
        (step,) = (step for step in steps if step.signals)
        assert (step.signals, step.parameters) == (("roll_rate.semitrailer",), (HEIGHT,))
        assert step.message.startswith("Log the roll rate of the semitrailer (roll_rate.semitrailer)")
        assert f"do not determine {HEIGHT}, nor" in step.message
    for other in (
        estimate(HEIGHT, Verdict.NOT_EXCITED, sigma=0.3),
        estimate(HEIGHT, Verdict.NOT_IDENTIFIABLE, correlated_with=(AXIS,)),
        estimate(HEIGHT, Verdict.NOT_CONVERGED),
    ):
        assert not any(step.signals for step in next_steps(of(result, other)))


def test_what_separates_correlated_parameters(result):
    for other, cure in ((AXIS, f"fix {AXIS} at a value from another source (--fix)"), ("steer.x.gain", "calibration")):
        correlated = estimate(HEIGHT, Verdict.NOT_IDENTIFIABLE, correlated_with=(other, REAR))
        (step,) = (s for s in next_steps(of(result, correlated)) if "To identify" in s.message)
        assert step.parameters == (HEIGHT,)
        assert step.message.startswith(f"To identify {HEIGHT}, ")
        assert cure in step.message
        assert other in step.message
    assert not any("To identify" in m for m in messages(of(result, estimate(HEIGHT, correlated_with=(AXIS,)))))


def test_dominant_uncertainties(result):
    axis = estimate(AXIS, Verdict.FIXED, value=-2.0, sigma=0.3)
    wide = estimate(HEIGHT, sigma=0.1)
    for source, uncertain, text in (
        (
            AXIS,
            (axis,),
            f"60 % of the variance of {HEIGHT} comes from {AXIS} (assumed uncertainty 15 %). Measure it, or ",
        ),
        (AXIS, (axis,), f"--consider {AXIS}=5%"),
        (AXIS, (replace(axis, sigma=None),), "(assumed uncertainty 0 %)"),
        (SOFTENING, (), f"comes from {SOFTENING}. Tyres soften with the slip angle"),
        ("mass_scale", (), "comes from mass_scale. Measure it, and state its uncertainty in the vehicle file."),
    ):
        steps = next_steps(of(result, wide, variance_budget={HEIGHT: {source: 0.6}}, uncertain=uncertain))
        assert [step.parameters for step in steps if text in step.message] == [(HEIGHT,)]


def outlook(*assessments):
    return InformationAssessment(
        vehicle="a", logs=("a",), speed=25.0, findings=(), parameters=assessments, noise={}, cautions=(), notes=(),
        version="",
    )  # fmt: skip


def assessment(name, *remedies, sigma=0.1, verdict=Verdict.CONVERGED, value=2.0):
    return ParameterAssessment(
        name=name, value=value, unit="1", prior=0.3, sigma=sigma, conditional_sigma=0.1, verdict=verdict,
        correlated_with=(), remedies=remedies,
    )  # fmt: skip


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
            "Predicted sigma if one more lane change (SAE J2179) at 90 km/h is driven (lower limit): "
            f"{FRONT} 5 % and {REAR} 5 %.",
            (FRONT, REAR),
        ),
        (f"Predicted sigma if roll_rate.semitrailer is logged (lower limit): {REAR} 15 %.", (REAR,)),
    ]


def test_changes_in_words():
    assert describe_remedy(Remedy(drive="again")) == "if the same run is repeated"
    assert describe_remedy(Remedy(drive="lane_change")) == "if one more lane change is driven"
    both = Remedy(drive="lane_change", channel="roll_rate.tractor")
    assert describe_remedy(both, "a slalom") == "if roll_rate.tractor is logged and a slalom is driven"


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
    (negative,) = row(estimate(FRONT, sigma=0.1), useful, value=-2.0).improvements
    assert negative.relative_sigma == 0.0899 / 2.0


def information(e, **others):
    return ParameterInformation(estimate=e, **others)


def test_the_part_of_the_prior_that_remains():
    """Of a stiffness relative to its value, of a height in metres; at most all."""
    assert information(estimate(FRONT, sigma=0.06, value=2.0)).remaining == pytest.approx(0.1)
    assert information(estimate(FRONT, sigma=0.06, value=-2.0, initial=-1.0)).remaining == pytest.approx(0.1)
    assert information(estimate(HEIGHT, sigma=0.06, value=2.0)).remaining == pytest.approx(0.2)
    assert information(estimate(FRONT, sigma=0.06, value=0.0)).remaining == pytest.approx(0.2)
    assert information(estimate(FRONT, sigma=9.0)).remaining == 1.0
    assert information(estimate(FRONT, sigma=None)).remaining == 1.0
    assert information(estimate(FRONT, prior=None)).remaining is None
    assert information(estimate(FRONT, sigma=0.06, value=2.0)).change == "±30 % → ±3 %"
    assert information(estimate(HEIGHT, sigma=0.06)).change == "±0.30 m → ±0.060 m"
    assert information(estimate(FRONT, sigma=None)).change == "±30 % → –"
    assert information(estimate(FRONT, prior=None, sigma=0.06)).change == "±6 %"


def test_messages_of_the_information_summary():
    correlated = estimate(FRONT, sigma=0.0499, correlated_with=(REAR, AXIS))
    accurate = f"Accurate. Its error is correlated with the errors of {REAR} and {AXIS}."
    strong = f"Strongly correlated with {REAR} and {AXIS}."
    assert information(correlated).messages == (accurate,)
    assert information(replace(correlated, value=-1.0)).messages == (accurate,)
    for changes in ({"sigma": 0.0501}, {"verdict": Verdict.NOT_CONVERGED}, {"sigma": None}):
        assert information(replace(correlated, **changes)).messages == (strong,)
    assert information(estimate(FRONT), correlation=(REAR, 0.61)).messages == (f"Correlated with {REAR} (0.61).",)
    terms = tuple(
        VarianceTerm(parameter=FRONT, source=s, fraction=f) for s, f in ((AXIS, 0.5), (REAR, 0.3), ("c", 0.1))
    )
    assert information(estimate(FRONT), budget=terms[:1]).messages == (
        f"50 % of its variance comes from the uncertainty of {AXIS}.",
    )
    assert information(estimate(FRONT), budget=terms).messages == (
        f"50 % of its variance comes from the uncertainty of {AXIS}, 30 % from that of {REAR}.",
    )
    (noise,) = information(estimate(FRONT, sigma=0.2), noise_sigma=0.1).messages
    assert noise.startswith("Sigma is 2.0 times the sigma from sensor noise alone")
    assert information(estimate(FRONT, sigma=None), noise_sigma=0.1).messages == ()


def test_the_largest_correlation_is_that_of_an_estimated_unknown(result):
    """Not of the same parameter, of a fixed one, or of another log than those of the identification."""
    covariance, first = result.identification.covariance, estimate(FRONT)
    names = (FRONT, REAR, AXIS, "yaw_rate.tractor.offset@a", "yaw_rate.tractor.offset@", "roll_rate.tractor.offset@a")
    factor = np.array([1.0, 0.55, 0.9, -0.7, 0.95, 0.8])  # correlations with the first
    P = np.outer(factor, factor) + np.diag(1 - factor**2)
    scale = np.array([3.0, 1.0, 2.0, 5.0, 1.0, 1.0])
    joint = replace(covariance, names=names, covariance=P * np.outer(scale, scale))
    offset = SensorError(name="yaw_rate.tractor.offset", value=0.0, sigma=0.1, unit="rad/s", log="a")

    def found(*parameters, **others):
        return information_summary(of(result, *parameters, covariance=joint, **others))[0].correlation

    assert found(first, estimate(REAR), sensors=(offset,)) == ("yaw_rate.tractor.offset@a", pytest.approx(0.7))
    assert found(first, estimate(REAR)) == (REAR, pytest.approx(0.55))
    assert found(first) is None
    assert found(first, uncertain=(estimate(AXIS, Verdict.FIXED),)) is None
    assert found(first, uncertain=(estimate(AXIS),)) == (AXIS, pytest.approx(0.9))
    assert found(replace(first, correlated_with=(REAR,)), estimate(REAR)) is None
    assert found(replace(first, verdict=Verdict.NOT_CONVERGED), estimate(REAR)) is None
    assert found(estimate(HEIGHT), estimate(REAR)) is None


def test_the_runs_of_an_identification(result):
    """With the offset of the gyro of each log removed, at speeds of the model, and without a record by its fit."""
    record, identification = result.records[0], result.identification
    n = len(record)
    speed = np.where(np.arange(n) < n // 2, 20.0, 4.9)
    steady = record.with_signals({"speed": speed, "yaw_rate.tractor": np.full(n, 0.06)})
    first, other = steady, replace(steady, name="b")
    plain = summarise_records([first, other], "tractor", {"b": 0.01})
    assert [run.acceleration for run in plain] == pytest.approx([1.2, 1.0])
    assert {run.speed for run in plain} == {(20.0, 20.0)}
    assert summarise_records([first], min_speed=4.0)[0].speed == (4.9, 20.0)
    assert summarise_records([first], min_speed=20.0)[0].speed == (20.0, 20.0)
    assert np.isnan(summarise_records([first], "semitrailer2")[0].acceleration)
    without = replace(first, signals={"speed": speed})
    assert np.isnan(summarise_records([without])[0].acceleration)
    assert summarise_records([without])[0].speed == (20.0, 20.0)
    assert np.isnan(summarise_records([replace(first, signals={"yaw_rate.tractor": speed})])[0].speed).all()
    renamed = replace(steady, signals={"speed": speed, "roll_rate.a": speed, "yaw_rate.a": np.full(n, 0.06)})
    assert summarise_records([renamed])[0].acceleration == pytest.approx(1.2)

    log = identification.logs[0]
    fit = next(f for f in identification.fits if f.signal == "yaw_rate.tractor" and f.log == log.name)
    constant = replace(fit, measured=np.full(len(fit.measured), 0.05))
    offset = SensorError(name="yaw_rate.tractor.offset", value=0.01, sigma=0.001, unit="rad/s", log=log.name)
    bare = replace(identification, fits=(constant,), sensors=(offset,), logs=(log,))
    (run,) = summarise_runs(bare, [])
    assert run.acceleration == pytest.approx(log.speed[1] * 0.04)
    assert (run.name, run.speed) == (log.name, log.speed)
    (run,) = summarise_runs(bare, [replace(steady, name=log.name)])
    assert run.acceleration == pytest.approx(20.0 * 0.05)
    unnamed = replace(offset, log=None)
    assert summarise_runs(replace(bare, sensors=(unnamed,)), [])[0].acceleration == pytest.approx(log.speed[1] * 0.05)
    assert np.isnan(summarise_runs(replace(bare, fits=()), [])[0].acceleration)


def cause(changes, name=None, prior_sigmas=4.0):
    return Cause(name=name or next(iter(changes)), changes=changes, prior_sigmas=prior_sigmas)


@pytest.mark.parametrize("sign", [-1, 1])
def test_causes_in_words(result, sign):
    vehicle = result.identification.initial_vehicle
    values = vehicle.parameters()
    later = sign > 0
    times = "4.0 times the assumed uncertainty"
    mass, stiffness = "tractor.mass", "semitrailer.roll_stiffness"
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
        (cause({"tractor.softening": sign * 1.0}), f"the tyres of tractor soften with the slip angle ({times})"),
        (
            cause({position: sign * 0.1, "tractor.drive.position": sign * -0.25}, "tractor.axle_positions"),
            f"the axles of tractor are up to 0.25 m {'closer to' if later else 'further from'} its front ({times})",
        ),
        (cause({"yaw_rate.tractor.gain": sign * 0.1}), f"yaw_rate.tractor.gain is different ({times})"),
        (
            cause({position: sign * 0.1}),
            f"{position} is 0.10 m further to the {'front' if later else 'rear'} ({times})",
        ),
        (cause({stiffness: sign * 0.2 * values[stiffness]}), f"{stiffness} is 20 % {larger} ({times})"),
        (
            cause({stiffness: sign * 0.2 * values[stiffness], mass: 1.0}),
            f"{stiffness} is 20 % {larger} with 1 other numbers that belong to it ({times})",
        ),
    ):
        assert describe_cause(what, vehicle) == text
