"""Both sides of every threshold of the diagnosis, with the numbers of the documentation and not those of the code."""

from dataclasses import replace

import numpy as np
import pytest

from fifthwheel.estimate.identify import Estimate, SensorError, Verdict
from fifthwheel.results.diagnose import residuals
from fifthwheel.results.diagnose.advice import next_steps
from fifthwheel.results.diagnose.cautions import has_wide_sigma, identification_cautions, state_cautions
from fifthwheel.results.diagnose.information_summary import dominant_terms
from fifthwheel.results.diagnose.messages import CautionKind
from fifthwheel.results.diagnose.residuals import FitQuality, predicted_logs
from fifthwheel.results.diagnose.summaries import RunSummary

BELOW, ABOVE = 1 - 1e-9, 1 + 1e-9
STEER, GYRO, HITCH = "steer.tractor.front", "yaw_rate.tractor", "articulation.semitrailer"
ACCELEROMETER = "lateral_acceleration.tractor"


def kinds(cautions):
    return [caution.kind for caution in cautions]


def estimate(sigma=0.1, value=1.0, **others):
    defaults = {"unit": "N/rad", "initial": 1.0, "verdict": Verdict.CONVERGED, "stage": 1, "prior": 0.3}
    return Estimate(name="tractor.front.cornering_stiffness", value=value, sigma=sigma, **(defaults | others))


def fit_of(explained, rms, noise=1.0, motion=1.0):
    return FitQuality(explained=explained, rms=rms, noise=noise, motion=motion)


def test_the_quality_of_a_fit():
    """Poor below 0.9 unless the residual is below 1.25 times the noise; unrelated below 0.05 unless noise hides it."""
    assert fit_of(0.9, 9.0).good
    assert not fit_of(0.9 * BELOW, 9.0).good
    assert fit_of(0.5, 1.25).good
    assert not fit_of(0.5, 1.25 * ABOVE).good
    assert not fit_of(0.05, 9.0).unrelated
    assert fit_of(0.05 * BELOW, 9.0).unrelated
    assert fit_of(0.0, 1.0, noise=3.0).unrelated
    assert not fit_of(0.0, 1.0, noise=3.0 * ABOVE).unrelated
    assert not fit_of(0.8, 1.3, noise=np.nan).noise_limited
    assert fit_of(0.0, 9.0, noise=4.0).unrelated  # larger than the noise explains


def test_an_unrelated_channel_needs_another_that_the_turns_explain(result):
    """More than 0.5 of the variance of one channel."""
    first, second = (replace(fit, rms=1e3) for fit in result.identification.fits[:2])
    for explained, kind in ((0.5, CautionKind.POOR_FIT), (0.5 * ABOVE, CautionKind.UNRELATED_CHANNEL)):
        fits = (replace(first, explained=0.0), replace(second, explained=explained))
        cautions = identification_cautions(replace(result.identification, fits=fits))
        assert [c.kind for c in cautions if c.signals == (first.signal,)] == [kind]
        assert [c.severity for c in cautions if c.signals == (second.signal,)] == ["warning"]
    for explained in (0.5, 0.5 * BELOW):
        fits = tuple(replace(f, identified_on=False, explained=e) for f, e in ((first, 0.0), (second, explained)))
        (log,) = predicted_logs(replace(result.identification, fits=fits))
        assert log.excited == (explained >= 0.5)


@pytest.mark.parametrize("verdict", Verdict)
@pytest.mark.parametrize("sign", [-1, 1])
def test_an_estimate_further_than_two_and_a_half_prior_sigmas(result, verdict, sign):
    """Of two stages, where the logs determine it, and not of a payload height, whose prior is wide."""
    near, far = (estimate(value=np.exp(sign * 2.5 * 0.3 * edge), verdict=verdict) for edge in (BELOW, ABOVE))
    of = replace(result.identification, covariance=None, doubts=(), fits=(), sensors=(), logs=())
    assert identification_cautions(replace(of, parameters=(near,))) == []
    determined = verdict in (Verdict.CONVERGED, Verdict.DOUBTFUL)
    cautions = identification_cautions(replace(of, parameters=(far,)))
    assert kinds(cautions) == [CautionKind.UNUSUAL_ESTIMATE] * determined
    assert identification_cautions(replace(of, parameters=(replace(far, name="semitrailer.payload.height"),))) == []


def unusual(result, name, value, sigma, settings):
    error = SensorError(name=name, value=value, sigma=sigma, unit="1", log=None)
    of = replace(result.identification, settings=settings, sensors=(error,), doubts=(), fits=(), logs=(), parameters=())
    assert identification_cautions(of) == []  # of one stage, whose doubts say what is unusual
    of = replace(of, covariance=None)
    cautions = identification_cautions(of)
    assert kinds(cautions) in ([], [CautionKind(name.rpartition(".")[2])])
    return bool(cautions)


SENSOR_ERRORS = [
    (f"{STEER}.offset", 0.0, "rad"),
    (f"{STEER}.play", 0.0, "rad"),
    (f"{GYRO}.offset", 0.0, "rad/s"),
    (f"{GYRO}.gain", 1.0, ""),
    (f"{GYRO}.misalignment", 0.0, "rad"),
    (f"{HITCH}.offset", 0.0, "rad"),
    (f"{ACCELEROMETER}.offset", 0.0, "m/s^2"),
    (f"{ACCELEROMETER}.gain", 1.0, ""),
    (f"{ACCELEROMETER}.delay", 0.0, "s"),
]


@pytest.mark.parametrize(("name", "mean", "unit"), SENSOR_ERRORS)
@pytest.mark.parametrize("sign", [-1, 1])
def test_a_sensor_error_further_than_two_and_a_half_prior_sigmas(result, name, mean, unit, sign):
    """The prior is that of the settings, here a number that no other error has."""
    settings = replace(result.identification.settings, given={name: f"+- 0.0377 {unit}"})
    assert not unusual(result, name, mean + sign * 2.5 * 0.0377 * (1 - 1e-6), 1e-6, settings)
    assert unusual(result, name, mean + sign * 2.5 * 0.0377 * (1 + 1e-6), 1e-6, settings)


@pytest.mark.parametrize("sign", [-1, 1])
def test_steering_gain_delay_and_misalignment_must_be_significant(result, sign):
    """A gain by 0.1 and two sigmas, a delay by 20 ms and three sigmas, a misalignment by two sigmas.

    A delay by 2.5 prior sigmas is unusual in any case, a smaller misalignment never.
    """
    settings = result.identification.settings
    delay, misalignment = 2.5 * 0.05, 2.5 * np.radians(1)
    for name, mean, values in (
        (f"{STEER}.gain", 1.0, {0.01: 0.1, 0.05: 0.1, 0.06: 0.12, 0.2: 0.4}),
        (f"{STEER}.delay", 0.0, {0.001: 0.02, 0.02 / 3: 0.02, 0.01: 0.03, 0.1: delay}),
        (f"{GYRO}.misalignment", 0.0, {0.01: misalignment, 0.1: 0.2}),
    ):
        for sigma, limit in values.items():
            assert not unusual(result, name, mean + sign * limit * (1 - 1e-6), sigma, settings), (name, sigma)
            assert unusual(result, name, mean + sign * limit * (1 + 1e-6), sigma, settings), (name, sigma)


def test_rejected_samples_and_the_lateral_acceleration_of_a_run(result):
    log = result.identification.logs[0]
    for rejected, expected in ((0.05, []), (0.05 * ABOVE, [CautionKind.REJECTED_SAMPLES])):
        of = replace(result.identification, fits=(), logs=(replace(log, rejected={GYRO: rejected}),))
        assert kinds(identification_cautions(of)) == expected
    of = replace(result.identification, fits=(), settings=replace(result.identification.settings, tyres="linear"))
    for acceleration, expected in ((3.0, []), (3.0 * ABOVE, [CautionKind.NONLINEAR_RANGE])):
        run = RunSummary(name="run", speed=(20.0, 25.0), acceleration=acceleration)
        assert kinds(identification_cautions(of, [run])) == expected


def test_innovations_of_states(result):
    """An rms of 1.5; 2 % rejected."""
    states = result.states[0]
    n = len(states.time)
    (name, *_) = states.innovation
    ones = replace(
        states,
        innovation={name: np.ones(n)},
        innovation_sigma={name: np.ones(n)},
        accepted={name: np.ones(n, dtype=bool)},
    )
    assert state_cautions_of(ones) == []
    for rms, expected in ((1.5, []), (1.5 * ABOVE, [CautionKind.LARGE_INNOVATIONS])):
        assert state_cautions_of(replace(ones, innovation={name: np.full(n, rms)})) == expected
    hundred = replace(ones, innovation={name: np.ones(100)}, innovation_sigma={name: np.ones(100)})
    for count, expected in ((2, []), (3, [CautionKind.REJECTED_SAMPLES])):
        assert state_cautions_of(replace(hundred, accepted={name: np.arange(100) >= count})) == expected


def state_cautions_of(states):
    return kinds(state_cautions(states, "identified truck"))


def test_sigmas_of_estimates(result):
    """Wide above 15 % of the value; from 5 % on, a term above half of the variance dominates."""
    for value in (-1.0, 1.0):
        assert not has_wide_sigma(estimate(0.15, value))
        assert has_wide_sigma(estimate(0.15 * ABOVE, value))
    assert not has_wide_sigma(estimate(0.9, verdict=Verdict.NOT_EXCITED))
    assert not has_wide_sigma(estimate(None))
    for sigma, fraction, dominates in ((0.05, 0.51, True), (0.05 * BELOW, 0.51, False), (0.05, 0.5, False)):
        e = estimate(sigma)
        of = replace(result.identification, parameters=(e,), variance_budget={e.name: {"a": fraction, "b": 0.1}})
        assert [term.source for terms in dominant_terms(of).values() for term in terms] == ["a"] * dominates
        assert dominant_terms(replace(of, parameters=(replace(e, verdict=Verdict.DOUBTFUL),))) == {}


def test_a_run_up_to_half_a_metre_per_second_squared_is_straight(result):
    e = estimate(0.31, verdict=Verdict.NOT_EXCITED)
    of = replace(result.identification, parameters=(e,), variance_budget={})
    for acceleration, straight in ((0.5 * BELOW, True), (0.5, False)):
        run = RunSummary(name=of.logs[0].name, speed=(20.0, 25.0), acceleration=acceleration)
        messages = [step.message for step in next_steps(of, [run])]
        assert any("almost straight running" in message for message in messages) == straight


@pytest.mark.parametrize(
    ("rms", "count", "text"),
    [
        (1.51, 1000, "too narrow"),
        (1.5, 1000, "no practical effect"),
        (0.6, 1000, "no practical effect"),
        (0.59, 1000, "wider than necessary"),
        (1.0, 30, "is expected."),
        (1.0, 29, "too few"),
        (np.nan, 1000, "too few"),
    ],
)
def test_innovations_in_words(rms, count, text):
    assert text in residuals.describe_innovation_rms(rms, count)


def test_a_wheel_lifts_at_a_load_transfer_ratio_of_095(result):
    """On either side, of the group that lifts first; samples without states do not count."""
    states = result.states[0]
    for ratio, expected in ((0.95 * BELOW, []), (-0.95 * ABOVE, [CautionKind.WHEEL_LIFT])):
        later = np.where(states.time < 3, np.nan, ratio)
        lifting = {
            "load_transfer.tractor.drive": np.where(states.time < 4, 0.0, ratio),
            "load_transfer.semitrailer": later,
        }
        cautions = list(state_cautions(replace(states, values={**states.values, **lifting}), "vehicle file"))
        assert kinds(cautions) == expected
        assert all("a wheel of semitrailer lifts at 3.0 s" in c.message for c in cautions)
