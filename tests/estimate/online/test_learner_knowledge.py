"""A learner that begins with the information of earlier logs, and what it learned as information for later ones."""

import copy
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import fifthwheel as fw
from fifthwheel.base.errors import SignalError, VehicleError
from fifthwheel.estimate.filters.model import unpack_array
from fifthwheel.estimate.identify.knowledge.information import Occasion
from fifthwheel.estimate.online.learned import learned_information
from fifthwheel.estimate.online.start import Considered
from fifthwheel.results.export.learner_model import texts_of
from tests.estimate.online.conftest import samples

SETTINGS = fw.OneStage(tyres="linear")
OCCASION = Occasion(trailer="T 17", load="steel")
TRAILER, FRONT = "semitrailer.cornering_stiffness", "tractor.front.cornering_stiffness"
STIFFNESSES = (FRONT, "tractor.drive.cornering_stiffness", TRAILER)


@pytest.fixture(scope="module")
def guess(truck: fw.Vehicle) -> fw.Vehicle:
    values = truck.parameters()
    return truck.replace({name: 1.2 * v for name, v in values.items() if name.endswith("cornering_stiffness")})


@pytest.fixture(scope="module")
def records(truck: fw.Vehicle) -> list[fw.Record]:
    return [fw.simulate(truck, count=1, seed=seed, name=f"run {seed}") for seed in (3, 4)]


@pytest.fixture(scope="module")
def result(records: list[fw.Record], guess: fw.Vehicle) -> fw.Identification:
    return fw.identify(records[:1], guess, SETTINGS, occasion=OCCASION)


@pytest.fixture
def learner(records: list[fw.Record], guess: fw.Vehicle, result: fw.Identification) -> fw.Learner:
    """One that begins with the information of the first record."""
    return fw.Learner(guess, records[0].signals, SETTINGS, knowledge=result.knowledge, occasion=OCCASION)


@pytest.fixture(scope="module")
def first(records: list[fw.Record], guess: fw.Vehicle) -> fw.Learner:
    """A learner without knowledge after the first record; tests must not change it."""
    learner = fw.Learner(guess, records[0].signals, SETTINGS, occasion=OCCASION)
    learner.learn(records[0])
    return learner


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
    learner: fw.Learner, result: fw.Identification, truck: fw.Vehicle
) -> None:
    """And the sideslip in a later lane change is within its sigma."""
    for name in (FRONT, TRAILER, "semitrailer.yaw_inertia"):
        assert learner[name].value == pytest.approx(result[name].value, rel=2e-2)
        assert learner[name].sigma == pytest.approx(result[name].sigma, rel=0.3)
    later, name = fw.simulate(truck, count=1, seed=9), "sideslip.tractor"
    answers = [learner.push(sample) for sample in samples(later)][100:]
    error = np.array([answer[name] for answer in answers]) - later.reference[name][100:]
    assert np.mean(np.abs(error) < 2 * np.array([answer[f"{name}.sigma"] for answer in answers])) > 0.85


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


def test_learning_saving_and_copying_keep_what_is_known(
    learner: fw.Learner, tmp_path: Path, records: list[fw.Record], result: fw.Identification
) -> None:
    """More driving does not enlarge sigma, and the log is one more beside that with which the learner began."""
    assert len(learner.knowledge.logs) == 1
    before = {value.name: value.sigma for value in learner.parameters}
    learner.learn(records[1])
    for value in learner.parameters:
        assert value.sigma <= 1.02 * before[value.name]
    known = learner.knowledge
    assert [log.name for log in known.logs][:1] == ["run 3"]
    assert len(known.logs) == len(known.with_logs(known.logs).logs) == 2  # what it learned counts once
    learner.save(tmp_path / "truck.json")
    again, twin = fw.Learner.load(tmp_path / "truck.json"), copy.copy(learner)
    for name in (FRONT, learner.live.setup.considered_unknowns[0].name):
        for other in (again, twin):
            assert other[name].value == pytest.approx(learner[name].value, rel=1e-9)
            assert other[name].sigma == pytest.approx(learner[name].sigma, rel=1e-6)
    assert_explained(learner)


def assert_explained(learner: fw.Learner) -> None:
    """Start and what was learned give the estimates.

    With the effect of considered unknowns, but for directions in which the walk exceeds what was learned.
    """
    live = learner.live
    n = len(live.setup.estimated_unknowns)
    (z0, P0), (z1, P1) = ((z[:n], P[:n, :n]) for z, P in (live.joint(live.began), live.joint()))
    information, vector = learned_information(live)
    total = np.linalg.inv(P0) + information
    z = np.linalg.solve(total, np.linalg.solve(P0, z0) + vector)
    parameters = np.array([not u.is_sensor_error for u in live.setup.estimated_unknowns])
    unit = np.sqrt(np.diag(P1))
    np.testing.assert_allclose(((z - z1) / unit)[parameters], 0.0, atol=0.25)
    np.testing.assert_allclose(np.sqrt(np.diag(np.linalg.inv(total)))[parameters], unit[parameters], rtol=0.1)
    assert np.linalg.eigvalsh(information)[0] > -1e-9 * np.abs(information).max()
    assert np.linalg.eigvalsh(information)[-1] > 1


@pytest.mark.slow
def test_a_later_learner_and_identification_begin_with_what_was_learned(
    records: list[fw.Record], guess: fw.Vehicle, truck: fw.Vehicle, first: fw.Learner
) -> None:
    """Values stay, and sigma grows by the variation of the stiffness from log to log only."""
    assert_explained(first)
    (log,) = first.knowledge.logs
    assert (log.trailer, log.load, log.tractor) == ("T 17", "steel", "tractor")
    later = fw.Learner(guess, records[1].signals, SETTINGS, knowledge=first.knowledge, occasion=OCCASION)
    result = fw.identify(records[1:], guess, SETTINGS, knowledge=first.knowledge, occasion=OCCASION)
    alone = fw.identify(records[1:], guess, SETTINGS)
    for name in STIFFNESSES:
        assert later[name].value == pytest.approx(first[name].value, rel=0.03)
        assert first[name].sigma < 1.01 * later[name].sigma < 1.4 * first[name].sigma
        assert result[name].sigma < 1.02 * alone[name].sigma
        assert abs(result[name].value - truck.parameters()[name]) < 3 * result[name].sigma


@pytest.mark.slow
def test_each_coupling_is_a_log_and_the_file_keeps_them(
    records: list[fw.Record], guess: fw.Vehicle, first: fw.Learner, tmp_path: Path
) -> None:
    learner = copy.copy(first)
    for trailer, start in (("T 3", 100.0), ("T 17", 200.0)):
        learner.couple(trailer, guess)
        learner.learn(replace(records[1], time=records[1].time + start))
    logs = learner.knowledge.logs
    assert [(log.trailer, log.load) for log in logs] == [("T 17", "steel"), ("T 3", ""), ("T 17", "steel")]
    assert len({log.digest for log in logs}) == 3
    learner.save(tmp_path / "learned.json")
    loaded = fw.Learner.load(tmp_path / "learned.json").knowledge.logs
    for log, again in zip(logs, loaded, strict=True):
        assert (log.digest, log.trailer, log.load, log.name) == (again.digest, again.trailer, again.load, again.name)
        scale = np.abs(log.information.information).max()
        np.testing.assert_allclose(again.information.information, log.information.information, atol=1e-6 * scale)


def test_another_trailer_begins_from_its_prior_and_the_known_one_from_the_logs(
    guess: fw.Vehicle, records: list[fw.Record], result: fw.Identification
) -> None:
    other = Occasion(trailer="T 3")
    learner = fw.Learner(guess, records[0].signals, SETTINGS, knowledge=result.knowledge, occasion=other)
    assert learner.trailer == "T 3"
    wide, narrow = learner[TRAILER].sigma, learner[FRONT].sigma
    assert wide > 3 * result[TRAILER].sigma
    learner.couple("T 17", guess)
    assert learner[TRAILER].sigma < 0.5 * wide
    assert learner[FRONT].sigma == pytest.approx(narrow, rel=1e-6)
    learner.couple("T 3", guess)
    assert learner[TRAILER].sigma == pytest.approx(wide, rel=1e-6)


def test_without_information_the_considered_unknowns_have_their_priors(
    guess: fw.Vehicle, records: list[fw.Record]
) -> None:
    assert fw.Learner(guess, records[0].signals, SETTINGS).live.considered.is_prior
    for mean, covariance in (
        ([0.0, 0.0], [[1.0, 0.1], [0.1, 1.0]]),
        ([0.0, 1.0], [[1.0, 0.0], [0.0, 1.0]]),
        ([0.0, 0.0], [[1.0, 0.0], [0.0, 0.5]]),
    ):
        assert not Considered.of(np.array(mean), np.array(covariance)).is_prior


def test_what_does_not_fit_is_refused(
    learner: fw.Learner, result: fw.Identification, records: list[fw.Record], guess: fw.Vehicle
) -> None:
    signals = records[0].signals
    other = fw.Knowledge(logs=tuple(replace(log, tractor="lorry") for log in result.knowledge.logs))
    with pytest.raises(VehicleError, match="knowledge is of a truck whose first unit is lorry"):
        fw.Learner(guess, signals, SETTINGS, knowledge=other)
    heavier = guess.replace({"semitrailer.mass": 1.2 * guess.parameters()["semitrailer.mass"]})
    with pytest.raises(SignalError, match="another load"):
        fw.Learner(heavier, signals, SETTINGS, knowledge=result.knowledge, occasion=OCCASION)
    with pytest.raises(SignalError, match="C code"):
        texts_of(learner)
