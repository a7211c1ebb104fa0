"""Each kind of caution: what it concerns, and that a good identification has none."""

from dataclasses import replace

import numpy as np
import pytest

from fifthwheel.estimate.identify import SensorError
from fifthwheel.estimate.identify.doubts import Cause, Doubt, DoubtKind
from fifthwheel.results.diagnose.cautions import fit_cautions, identification_cautions, state_cautions
from fifthwheel.results.diagnose.messages import CautionKind, ranked
from fifthwheel.results.diagnose.residuals import white_noise_sigma
from fifthwheel.truck.weighing import unusual_masses

STEER = "steer.tractor.front"


def only(cautions, kind):
    """The one caution of a kind."""
    (caution,) = [c for c in cautions if c.kind is kind]
    assert str(caution) == f"{caution.message} {caution.cure}"
    assert caution.message.endswith(".")
    assert caution.cure.endswith(".")
    return caution


def test_a_good_identification_has_none(result):
    fits = tuple(fit for fit in result.identification.fits if fit.identified_on)
    assert identification_cautions(replace(result.identification, fits=fits), [], result.states[:1]) == []


def test_unusual_masses_of_the_vehicle_file_are_a_caution_that_explains_no_other(result):
    vehicle = result.identification.initial_vehicle
    empty = vehicle.parameters()["tractor.sprung.mass"]
    heavy = vehicle.replace({"tractor.sprung.mass": 0.5 * empty})
    (expected,) = unusual_masses(heavy)
    cautions = identification_cautions(replace(result.identification, initial_vehicle=heavy))
    (found,) = [c for c in cautions if c.kind is CautionKind.MASS]
    assert str(found) == f"{expected}."
    fit = replace(found, kind=CautionKind.POOR_FIT)
    assert ranked([fit, found]) == ([found, fit], [])


def test_an_unrelated_channel_is_an_error_unless_the_run_is_straight(result):
    first, *rest = result.identification.fits
    unrelated = replace(result.identification, fits=(replace(first, explained=0.0), *rest))
    caution = only(identification_cautions(unrelated), CautionKind.UNRELATED_CHANNEL)
    assert caution.severity == "error"
    assert (caution.signals, caution.log) == ((first.signal,), first.log)
    straight = [replace(f, log="straight", explained=0.0, rms=white_noise_sigma(f.measured)) for f in (first, *rest)]
    both = replace(result.identification, fits=(first, *rest, *straight))
    assert not [c for c in identification_cautions(both) if c.log == "straight"]


def noise_alone(fit, sigma=0.02, motion=0.1):
    """A fit of a channel whose noise is so many times its motion, with its residual at the level of the noise."""
    predicted = motion * sigma * fit.predicted / np.std(fit.predicted)
    measured = predicted + np.random.default_rng(0).normal(size=len(predicted)) * sigma
    rms = float(np.std(measured - predicted))
    explained = 1 - rms**2 / float(np.var(measured))
    return replace(fit, measured=measured, predicted=predicted, rms=rms, explained=explained)


def test_a_residual_of_sensor_noise_alone_is_no_caution(result):
    """A noisy roll rate gyro in everyday driving: the model cannot explain more, whatever is estimated from it."""
    for k, fit in enumerate(result.identification.fits):
        if not fit.identified_on:
            continue
        fits = list(result.identification.fits)
        fits[k] = noise_alone(fit)
        assert abs(fits[k].explained) < 0.05
        cautions = list(fit_cautions(replace(result.identification, fits=tuple(fits))))
        assert not [c for c in cautions if c.signals == (fit.signal,) and c.log == fit.log], fit.signal


def test_noise_without_the_predicted_motion_is_unrelated(result):
    """The residual is not larger than the noise of the channel, but the motion should be visible in it."""
    first, *rest = result.identification.fits
    wrong = noise_alone(first, motion=0.5)
    measured = wrong.measured - wrong.predicted
    rms = float(np.std(measured - wrong.predicted))
    wrong = replace(wrong, measured=measured, rms=rms, explained=1 - rms**2 / float(np.var(measured)))
    caution = only(fit_cautions(replace(result.identification, fits=(wrong, *rest))), CautionKind.UNRELATED_CHANNEL)
    assert caution.signals == (first.signal,)


def test_large_innovations_are_one_caution_for_a_log(result):
    states = result.states[0]
    large = replace(states, innovation={n: 3 * v for n, v in states.innovation.items()})
    caution = only(state_cautions(large, "vehicle file"), CautionKind.LARGE_INNOVATIONS)
    assert caution.signals == tuple(states.innovation)
    assert caution.value == pytest.approx(3.0, rel=0.1)
    assert "identification.json" in caution.cure
    spiked = replace(states, accepted={n: a & (np.arange(len(a)) % 20 > 0) for n, a in states.accepted.items()})
    rejected = [c for c in state_cautions(spiked, "vehicle file") if c.kind is CautionKind.REJECTED_SAMPLES]
    assert {c.signals[0] for c in rejected} == set(states.innovation)
    assert [c.value for c in rejected] == pytest.approx([0.05] * len(rejected), rel=0.05)


def test_a_doubt_has_a_caution(result):
    """An assumption that the residuals contradict, and a sensor error far outside its prior."""
    doubts = (
        Doubt(
            kind=DoubtKind.ASSUMPTION,
            causes=(
                Cause(name="mass_scale", changes={"semitrailer.mass": 3120.0}, prior_sigmas=5.0),
                Cause(name="yaw_rate.tractor.delay", changes={"yaw_rate.tractor.delay": 0.05}, prior_sigmas=5.0),
                Cause(name="time_base", changes={"time_base.scale": 0.01}, prior_sigmas=5.0),
            ),
            parameters=("semitrailer.yaw_inertia",),
            statistic=12.0,
        ),
        Doubt(
            kind=DoubtKind.SENSOR,
            causes=(Cause(name=f"{STEER}.play", changes={f"{STEER}.play": 0.013}, prior_sigmas=3.8),),
            parameters=("tractor.front.cornering_stiffness",),
            statistic=3.8,
        ),
    )
    sensor = SensorError(name=f"{STEER}.play", value=0.013, sigma=0.01, unit="rad", log=None)
    cautions = identification_cautions(replace(result.identification, sensors=(sensor,), doubts=doubts))
    assumption, play = only(cautions, CautionKind.ASSUMPTION), only(cautions, CautionKind.PLAY)
    assert assumption.parameters == ("semitrailer.yaw_inertia",)
    for text in ("all masses are", "larger", "yaw_rate.tractor is 50 ms late", "the time base runs 1 % too slow"):
        assert text in assumption.message, assumption.message
    assert play.parameters == ("tractor.front.cornering_stiffness",)
