"""A learner that begins with the information of earlier logs."""

import copy
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import fifthwheel as fw
from fifthwheel.base.errors import SignalError, VehicleError
from fifthwheel.estimate.filters.model import unpack_array
from fifthwheel.estimate.identify.knowledge.information import Occasion
from fifthwheel.estimate.online.start import Considered
from fifthwheel.results.export.learner_model import texts_of

SETTINGS = fw.OneStage(tyres="linear")
OCCASION = Occasion(trailer="T 17", load="steel")


@pytest.fixture(scope="module")
def truck() -> fw.Vehicle:
    return fw.vehicle("cheng_cebon_2011")


@pytest.fixture(scope="module")
def record(truck: fw.Vehicle) -> fw.Record:
    return fw.simulate(truck, count=2, seed=3)


@pytest.fixture(scope="module")
def guess(truck: fw.Vehicle) -> fw.Vehicle:
    values = truck.parameters()
    return truck.replace({name: 1.2 * v for name, v in values.items() if name.endswith("cornering_stiffness")})


@pytest.fixture(scope="module")
def result(record: fw.Record, guess: fw.Vehicle) -> fw.Identification:
    return fw.identify([record], guess, SETTINGS, occasion=OCCASION)


@pytest.fixture
def learner(record: fw.Record, guess: fw.Vehicle, result: fw.Identification) -> fw.Learner:
    return fw.Learner(guess, record.signals, SETTINGS, knowledge=result.knowledge, occasion=OCCASION)


@pytest.mark.slow
def test_it_begins_with_the_joint_posterior(learner: fw.Learner, result: fw.Identification) -> None:
    """Of every shared unknown: mean and covariance, also those between estimated and considered ones."""
    setup, (z, P) = learner.live.setup, learner.live.joint()
    prior = result.knowledge.prior(setup, OCCASION)
    names = [u.name for u in setup.unknowns]
    places = [names.index(name) for name in prior.names]
    np.testing.assert_allclose(z[places], prior.mean, atol=1e-12)
    widened = prior.covariance * np.outer(prior.widening, prior.widening)
    np.testing.assert_allclose(P[np.ix_(places, places)], widened, atol=1e-9)
    assert {u.estimated for u in setup.unknowns if u.name in prior.names} == {True, False}
    others = np.delete(np.arange(len(names)), places)
    np.testing.assert_allclose(P[np.ix_(others, others)], np.eye(len(others)), atol=1e-12)


@pytest.mark.slow
def test_estimates_and_states_at_the_start_are_those_of_the_logs(
    learner: fw.Learner, result: fw.Identification, record: fw.Record, guess: fw.Vehicle, truck: fw.Vehicle
) -> None:
    """And the sideslip in later lane changes is within its sigma, mostly with a smaller error than without them."""
    for name in ("tractor.front.cornering_stiffness", "semitrailer.cornering_stiffness", "semitrailer.yaw_inertia"):
        assert learner[name].value == pytest.approx(result[name].value, rel=2e-2)
        assert learner[name].sigma == pytest.approx(result[name].sigma, rel=0.3)
    better = []
    for seed in range(9, 15):
        later = fw.simulate(truck, count=1, seed=seed)
        error, sigma = sideslip_error(copy.copy(learner), later)
        other, _ = sideslip_error(fw.Learner(guess, record.signals, SETTINGS), later)
        better.append(np.mean(error**2) < np.mean(other**2))
        assert np.mean(np.abs(error) < 2 * sigma) > 0.85
    assert sum(better) >= 4


def sideslip_error(learner: fw.Learner, later: fw.Record) -> tuple[np.ndarray, np.ndarray]:
    """Error and sigma of the tractor's sideslip after the first second, rad."""
    rows = [dict(zip(later.signals, row, strict=True)) for row in np.column_stack([*later.signals.values()]).tolist()]
    answers = [learner.push({"time": t, **row}) for t, row in zip(later.time.tolist(), rows, strict=True)][100:]
    values, sigma = ([a[name] for a in answers] for name in ("sideslip.tractor", "sideslip.tractor.sigma"))
    return np.array(values) - later.reference["sideslip.tractor"][100:], np.array(sigma)


def test_sigma_of_states_contains_the_joint_covariance(learner: fw.Learner) -> None:
    """The variance of a state is that of its derivatives by all unknowns under their joint covariance.

    A rate that is reported depends on the misalignment of its gyro besides.
    """
    learner.push({"time": 0.0, "speed": 20.0, "steer.tractor.front": 0.02})
    live = learner.live
    layout, carry = live.filter.layout, live.filter.carry[0]
    V = carry[layout.V].reshape(layout.n_x, -1, order="F")
    unit = np.append(np.ones(layout.n_z), live.considered.sigma)
    _, covariance = live.joint()
    c = covariance / np.outer(unit, unit)
    P = unpack_array(carry[layout.P], layout.n_x) + V @ c @ V.T
    values, names = live.view.read(), live.view.names
    states = list(live.model.chain.states)
    shared = [name for name in names if name in states and not name.startswith(("yaw_rate", "roll_rate"))]
    assert len(shared) == 4
    for name in shared:
        i, k = names.index(name), states.index(name)
        assert values[2 * i + 1] == pytest.approx(np.sqrt(P[k, k]), rel=1e-9)


def test_more_driving_does_not_enlarge_sigma(learner: fw.Learner, truck: fw.Vehicle) -> None:
    before = {value.name: value.sigma for value in learner.parameters}
    learner.learn(fw.simulate(truck, count=3, seed=8))
    for value in learner.parameters:
        assert value.sigma <= 1.02 * before[value.name]


def test_save_and_load_keep_what_is_known(learner: fw.Learner, tmp_path: Path, record: fw.Record) -> None:
    learner.learn(record)
    learner.save(tmp_path / "truck.json")
    again, twin = fw.Learner.load(tmp_path / "truck.json"), copy.copy(learner)
    for name in ("tractor.front.cornering_stiffness", learner.live.setup.considered_unknowns[0].name):
        for other in (again, twin):
            assert other[name].value == pytest.approx(learner[name].value, rel=1e-9)
            assert other[name].sigma == pytest.approx(learner[name].sigma, rel=1e-6)


def test_another_trailer_begins_from_its_prior_and_the_known_one_from_the_logs(
    guess: fw.Vehicle, record: fw.Record, result: fw.Identification
) -> None:
    other = Occasion(trailer="T 3")
    learner = fw.Learner(guess, record.signals, SETTINGS, knowledge=result.knowledge, occasion=other)
    assert learner.trailer == "T 3"
    name, front = "semitrailer.cornering_stiffness", "tractor.front.cornering_stiffness"
    wide, narrow = learner[name].sigma, learner[front].sigma
    assert wide > 3 * result[name].sigma
    learner.couple("T 17", guess)
    assert learner[name].sigma < 0.5 * wide
    assert learner[front].sigma == pytest.approx(narrow, rel=1e-6)
    learner.couple("T 3", guess)
    assert learner[name].sigma == pytest.approx(wide, rel=1e-6)


def test_without_information_the_considered_unknowns_have_their_priors(guess: fw.Vehicle, record: fw.Record) -> None:
    learner = fw.Learner(guess, record.signals, SETTINGS)
    assert learner.live.considered.is_prior
    assert not Considered.of(np.zeros(2), np.array([[1.0, 0.1], [0.1, 1.0]])).is_prior
    assert not Considered.of(np.array([0.0, 1.0]), np.eye(2)).is_prior
    assert not Considered.of(np.zeros(2), np.diag([1.0, 0.5])).is_prior


def test_what_does_not_fit_is_refused(
    learner: fw.Learner, result: fw.Identification, record: fw.Record, guess: fw.Vehicle
) -> None:
    other = fw.Knowledge(logs=tuple(replace(log, tractor="lorry") for log in result.knowledge.logs))
    with pytest.raises(VehicleError, match="knowledge is of a truck whose first unit is lorry"):
        fw.Learner(guess, record.signals, SETTINGS, knowledge=other)
    heavier = guess.replace({"semitrailer.mass": 1.2 * guess.parameters()["semitrailer.mass"]})
    with pytest.raises(SignalError, match="another load"):
        fw.Learner(heavier, record.signals, SETTINGS, knowledge=result.knowledge, occasion=OCCASION)
    with pytest.raises(SignalError, match="C code"):
        texts_of(learner)
