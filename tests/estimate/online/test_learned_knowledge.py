"""What a learner learned, as knowledge for later logs and learners."""

import copy
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import fifthwheel as fw
from fifthwheel.estimate.identify.knowledge.information import Occasion
from fifthwheel.estimate.online.learned import learned_information

pytestmark = pytest.mark.slow

SETTINGS = fw.OneStage(tyres="linear")
OCCASION = Occasion(trailer="T 17", load="steel")
STIFFNESSES = tuple(f"{path}.cornering_stiffness" for path in ("tractor.front", "tractor.drive", "semitrailer"))


@pytest.fixture(scope="module")
def truck() -> fw.Vehicle:
    return fw.vehicle("cheng_cebon_2011")


@pytest.fixture(scope="module")
def guess(truck: fw.Vehicle) -> fw.Vehicle:
    values = truck.parameters()
    return truck.replace({name: 1.2 * v for name, v in values.items() if name.endswith("cornering_stiffness")})


@pytest.fixture(scope="module")
def records(truck: fw.Vehicle) -> list[fw.Record]:
    return [fw.simulate(truck, count=1, seed=seed, name=f"run {seed}") for seed in (3, 4)]


@pytest.fixture(scope="module")
def earlier(records: list[fw.Record], guess: fw.Vehicle) -> fw.Knowledge:
    return fw.identify(records[:1], guess, SETTINGS, occasion=OCCASION).knowledge


def learner_of(record: fw.Record, guess: fw.Vehicle, knowledge: fw.Knowledge | None = None) -> fw.Learner:
    learner = fw.Learner(guess, record.signals, SETTINGS, knowledge=knowledge, occasion=OCCASION)
    learner.learn(record)
    return learner


@pytest.fixture(scope="module")
def first(records: list[fw.Record], guess: fw.Vehicle) -> fw.Learner:
    """A learner after the first record; tests must not change it."""
    return learner_of(records[0], guess)


@pytest.fixture(scope="module")
def second(records: list[fw.Record], guess: fw.Vehicle, earlier: fw.Knowledge) -> fw.Learner:
    """One that began with the information of the first record, after the second one."""
    return learner_of(records[1], guess, earlier)


@pytest.mark.parametrize("known", [False, True])
def test_start_and_what_was_learned_give_the_estimates(
    records: list[fw.Record], guess: fw.Vehicle, second: fw.Learner, known: bool
) -> None:
    """With the effect of considered unknowns, but for directions in which the walk exceeds what was learned."""
    live = (second if known else learner_of(records[1], guess)).live
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


def test_a_later_learner_and_identification_begin_with_it(
    records: list[fw.Record], guess: fw.Vehicle, truck: fw.Vehicle, first: fw.Learner
) -> None:
    """Values stay, and sigma grows by the variation of the stiffness from log to log only."""
    learner = first
    (log,) = learner.knowledge.logs
    assert (log.trailer, log.load, log.tractor) == ("T 17", "steel", "tractor")
    later = fw.Learner(guess, records[1].signals, SETTINGS, knowledge=learner.knowledge, occasion=OCCASION)
    result = fw.identify(records[1:], guess, SETTINGS, knowledge=learner.knowledge, occasion=OCCASION)
    alone = fw.identify(records[1:], guess, SETTINGS)
    for name in STIFFNESSES:
        assert later[name].value == pytest.approx(learner[name].value, rel=0.03)
        assert learner[name].sigma < 1.01 * later[name].sigma < 1.4 * learner[name].sigma
        assert result[name].sigma < 1.02 * alone[name].sigma
        assert abs(result[name].value - truck.parameters()[name]) < 3 * result[name].sigma


def test_a_learner_adds_its_log_to_those_that_it_began_with(
    records: list[fw.Record], guess: fw.Vehicle, earlier: fw.Knowledge, second: fw.Learner
) -> None:
    known = second.knowledge
    assert [log.name for log in known.logs][:1] == ["run 3"]
    assert len(known.logs) == 2
    again = known.with_logs(second.knowledge.logs)
    assert len(again.logs) == 2  # what it learned counts once
    unused = fw.Learner(guess, records[1].signals, SETTINGS, knowledge=earlier, occasion=OCCASION)
    assert len(unused.knowledge.logs) == 1


def test_each_coupling_is_a_log_and_the_file_keeps_them(
    records: list[fw.Record], guess: fw.Vehicle, first: fw.Learner, tmp_path: Path
) -> None:
    learner = copy.copy(first)
    learner.couple("T 3", guess)
    shifted = replace(records[1], time=records[1].time + 100.0)
    learner.learn(shifted)
    learner.couple("T 17", guess)
    learner.learn(replace(records[1], time=records[1].time + 200.0))
    logs = learner.knowledge.logs
    assert [(log.trailer, log.load) for log in logs] == [("T 17", "steel"), ("T 3", ""), ("T 17", "steel")]
    assert len({log.digest for log in logs}) == 3
    learner.save(tmp_path / "learned.json")
    loaded = fw.Learner.load(tmp_path / "learned.json").knowledge.logs
    for log, again in zip(logs, loaded, strict=True):
        assert (log.digest, log.trailer, log.load, log.name) == (again.digest, again.trailer, again.load, again.name)
        scale = np.abs(log.information.information).max()
        np.testing.assert_allclose(again.information.information, log.information.information, atol=1e-6 * scale)


def test_fixing_a_parameter_ends_a_log(records: list[fw.Record], guess: fw.Vehicle) -> None:
    settings = fw.OneStage(given={"others": "exact", "sensors": "exact"}, tyres="linear")
    learner = fw.Learner(guess, records[0].signals, settings)
    learner.learn(records[0])
    fixed = learner.with_fixed(guess, {"semitrailer.yaw_inertia": learner["semitrailer.yaw_inertia"].value})
    (log,) = fixed.knowledge.logs
    assert "semitrailer.yaw_inertia" in log.estimated
