"""Accuracy of the learner: against the fit of complete logs, and of its sigmas."""

from dataclasses import replace

import numpy as np
import pytest

from fifthwheel.data.record import Record
from fifthwheel.estimate.filters.relinearised import RelinearisationSettings
from fifthwheel.estimate.identify import identify
from fifthwheel.estimate.identify.settings import OneStage
from fifthwheel.estimate.identify.unknowns.parameters import one_stage_unknowns, stage_1_names
from fifthwheel.estimate.online import Learner, LearnerSettings
from fifthwheel.model.simulate import simulate
from fifthwheel.truck import Vehicle
from tests.estimate.online.conftest import FIVE, HEIGHT, assert_identified, learn, samples

LINEAR = OneStage(tyres="linear")
GYROS = ("yaw_rate.tractor", "yaw_rate.semitrailer", "roll_rate.tractor", "roll_rate.semitrailer")


@pytest.mark.slow
def test_estimates_agree_with_the_fit_of_the_log(truck: Vehicle, guess: Vehicle) -> None:
    """With default settings, and the tyres of the logs. The fit estimates the uncertain numbers that the learner
    considers; they are right here, so that the difference is less than a sigma of the fit."""
    differences, settings = [], replace(LINEAR, given={"softening": "exact"})  # the truck is linear
    for seed in range(2):
        record = simulate(truck, count=1, seed=seed)
        fit, learner = identify([record], guess, replace(settings, adapt_noise=False)), learn(guess, record, settings)
        differences.append([(learner[e.name].value - e.value) / e.sigma for e in fit.parameters if e.sigma])
    assert (np.sqrt(np.mean(np.square(differences), axis=0)) < 1.0).all()


@pytest.mark.slow
def test_sigma_includes_considered_parameters(truck: Vehicle) -> None:
    """Trucks that differ from the vehicle file within its uncertainty: the errors agree with sigma."""
    steered = truck.with_logged_steering(simulate(truck, count=1).signals, "record")
    uncertain = [u for u in one_stage_unknowns(steered, GYROS, LINEAR) if u.logarithmic and u.is_uncertain]
    normalised = []
    for seed in range(4):
        draws = np.random.default_rng(seed).normal(size=len(uncertain))
        factors = np.exp([u.scale * value for u, value in zip(uncertain, draws, strict=True)])
        truth = steered.replace({u.name: u.centre * float(f) for u, f in zip(uncertain, factors, strict=True)})
        names = stage_1_names(truck)
        factors = np.random.default_rng(100 + seed).choice([0.8, 1.2], len(names))
        guess = steered.replace({n: truth.parameters()[n] * f for n, f in zip(names, factors, strict=True)})
        learner = learn(guess, simulate(truth, count=2, seed=seed), LINEAR)
        normalised += [
            (learner[name].value - truth.parameters()[name]) / learner[name].sigma for name in (*names, HEIGHT)
        ]
    assert np.sqrt(np.mean(np.square(normalised))) < 1.5


def test_a_long_segment_is_learned_in_parts(truck: Vehicle, guess: Vehicle) -> None:
    record = simulate(truck, manoeuvre="random", duration=20.0, seed=1)
    settings = LearnerSettings(relinearisation=RelinearisationSettings(samples=300))
    assert_identified(learn(guess, record, learner=settings), truck)


def test_long_and_uneven_steps_are_divided(truck: Vehicle, guess: Vehicle) -> None:
    record = simulate(truck, count=3, seed=4)
    kept = np.random.default_rng(1).random(len(record)) < 0.2
    signals = {name: values[kept] for name, values in record.signals.items()}
    assert_identified(learn(guess, Record(time=record.time[kept], signals=signals)), truck, sigmas=6.0)


def test_errors_of_the_states_agree_with_their_sigmas(truck: Vehicle, guess: Vehicle) -> None:
    """Before anything is learned, and after."""
    before, after = [], []
    for seed in range(4):
        record = simulate(truck, count=1, seed=seed)
        learner = Learner(guess, record.signals, FIVE)
        answers = [learner.push(sample) for sample in samples(record)]
        for errors, k in ((before, 110), (after, 600)):
            for name in ("sideslip.tractor", "sideslip.semitrailer", "roll.semitrailer", "articulation.semitrailer"):
                error = answers[k][name] - record.reference[name][k]
                errors.append(error / answers[k][f"{name}.sigma"])
    for errors in (before, after):
        assert np.sqrt(np.mean(np.square(errors))) < 2.0
        assert np.max(np.abs(errors)) < 5.0


@pytest.mark.slow
def test_errors_of_the_states_do_not_grow_from_one_lane_change_to_the_next(truck: Vehicle) -> None:
    """The bank and the steering offset move the truck alike; without new starts sigma grows to 2 deg in one minute."""
    record = simulate(truck, count=6, seed=1)
    learner = Learner(truck, record.signals)
    states = [learner.push(sample) for sample in samples(record)]
    for name in ("sideslip.tractor", "sideslip.semitrailer", "roll.semitrailer"):
        sigma = np.array([state[f"{name}.sigma"] for state in states])
        error = np.array([state[name] for state in states]) - record.reference[name]
        early, late = record.time < 20, record.time > record.time[-1] - 20
        assert sigma[late].max() < 1.2 * sigma[early].max()
        assert np.abs(error[late]).max() < 3 * sigma[late].min()
