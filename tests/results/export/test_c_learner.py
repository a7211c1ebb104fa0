"""The exported learner in C against `Learner.push`, sample by sample, with faults of the signals."""

import copy
import math
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fifthwheel.data.record import Record
from fifthwheel.estimate.filters.relinearised import RelinearisationSettings
from fifthwheel.estimate.identify.doubts import DoubtKind
from fifthwheel.estimate.identify.settings import OneStage
from fifthwheel.estimate.observe import Status
from fifthwheel.estimate.online import Learner, LearnerSettings
from fifthwheel.model.dynamics import critical_speed
from fifthwheel.model.simulate import simulate
from fifthwheel.results.export import LEARNER_FILES
from fifthwheel.truck import Vehicle, get
from tests.model.dynamics.test_lagrangian import b_double
from tests.results.export.c_learner import (
    COMPILER,
    compiled,
    csv_text,
    largest_deviation,
    largest_difference,
    linked,
    pushed,
    replayed,
)
from tests.results.export.test_c_observer import FAULTS, with_fault

pytestmark = pytest.mark.skipif(COMPILER is None, reason="no C compiler")

FIVE = OneStage(given={"others": "exact", "sensors": "exact"}, tyres="linear")
"""Five parameters; all other numbers are known."""
SHORT = RelinearisationSettings(lag=20, samples=150)
SETTINGS = {
    "passes": (FIVE, LearnerSettings(relinearisation=replace(SHORT, first_pass_limit=0.01, pass_limit=0.05))),
    "sensor errors": (
        replace(FIVE, given={"others": "exact", "road.bank": "+- 0.03 rad"}),
        LearnerSettings(relinearisation=SHORT, hold=0.05, max_gap=0.2, coast=0.1, settling_time=0.2),
    ),
}
STATES, ESTIMATES = 1e-12, 1e-11
"""Largest difference in double precision, of states relative to their range, of estimates in sigmas, in a log of
`SAMPLES`. Rounding accumulates as a random walk."""
SAMPLES = 800
AMPLIFIED = dict.fromkeys(("reversed_steer", "slow", "gaps"), 100.0)
"""Factor of both for faults after which the state restarts. This amplifies rounding, most at low speed, because the
relaxation of tyres and axles is slow there."""


@pytest.fixture(scope="module")
def truck() -> Vehicle:
    return get("cheng_cebon_2011")


@pytest.fixture(scope="module")
def guess(truck: Vehicle) -> Vehicle:
    """With wrong stiffnesses."""
    values = truck.parameters()
    stiffnesses = [name for name in values if name.endswith("cornering_stiffness")]
    return truck.replace({name: values[name] * (0.7 + 0.5 * (i % 2)) for i, name in enumerate(stiffnesses)})


@pytest.fixture(scope="module")
def lane(truck: Vehicle) -> Record:
    """A lane change."""
    return simulate(truck, count=1, seed=3)


@pytest.fixture(scope="module")
def passing(guess: Vehicle, lane: Record, tmp_path_factory: pytest.TempPathFactory) -> tuple[Learner, Path]:
    """A learner with many passes, and its program in double precision."""
    settings, limits = SETTINGS["passes"]
    learner = Learner(guess, lane.signals, settings, learner=limits)
    return learner, compiled(learner, tmp_path_factory.mktemp("c"))


def assert_equal(learner: Learner, program: Path, record: Record) -> tuple[np.ndarray, set[str]]:
    """Equal results of C and Python; returns the states, see `pushed`, and the verdicts."""
    (expected, estimates), (states, found) = pushed(learner, record), replayed(program, learner, record)
    factor = AMPLIFIED.get(record.name, 1.0) * math.sqrt(max(len(record) / SAMPLES, 1.0))
    assert largest_difference(states, expected) < factor * STATES
    assert largest_deviation(found, estimates) < factor * ESTIMATES
    return expected, {verdict for _, _, verdict in estimates.values()}


def assert_equal_with_faults(learner: Learner, program: Path, lane: Record) -> set[float]:
    """Equal results for all faults; returns the statuses that were seen."""
    seen, judged, learned = set(), set(), 0.0
    for fault in FAULTS:
        expected, verdicts = assert_equal(learner, program, with_fault(lane, fault))
        judged |= verdicts
        seen |= set(expected[:, 1].tolist())
        learned += expected[:, 2].sum()
    assert judged >= {"converged", "doubtful"}
    assert learned > 1000
    return seen


@pytest.mark.slow
def test_every_fault_gives_what_push_gives(passing: tuple[Learner, Path], lane: Record) -> None:
    assert assert_equal_with_faults(*passing, lane) == set(Status)


@pytest.mark.slow
def test_sensor_errors_and_verdicts(guess: Vehicle, truck: Vehicle, lane: Record, tmp_path: Path) -> None:
    """Offsets, gains, delays and the play of the steering; all faults, and a roll rate that has no samples."""
    settings, limits = SETTINGS["sensor errors"]
    learner = Learner(guess, lane.signals, settings, learner=limits)
    program = compiled(learner, tmp_path)
    seen = assert_equal_with_faults(learner, program, lane)
    assert seen >= set(Status) - {Status.INCONSISTENT}  # discrepancies explain some faults
    record = simulate(truck, count=1, seed=5)
    signals = {n: np.array(v) for n, v in record.signals.items()}
    signals["roll_rate.semitrailer"][:] = np.nan
    _, verdicts = assert_equal(learner, program, Record(time=record.time, signals=signals, name="without"))
    assert verdicts == {"converged", "not_excited", "not_identifiable"}


@pytest.mark.slow
def test_three_units_with_two_steered_axles(tmp_path: Path) -> None:
    train = b_double()
    record = simulate(train, count=1, seed=1)
    signals = {n: v for n, v in record.signals.items() if not n.startswith("roll_rate")}
    signals["steer.last.steered"] = -0.1 * record.signals["steer.tractor.front"]
    record = Record(time=record.time, signals=signals, name="train")
    learner = Learner(train, record.signals, FIVE)
    assert len(learner.live.setup.inputs) == 3
    assert {e.name.split(".")[0] for e in learner.parameters} == {"tractor", "lead", "last"}
    assert_equal(learner, compiled(learner, tmp_path), record)


@pytest.mark.slow
def test_a_contradicted_assumption_is_a_doubt(truck: Vehicle, lane: Record, tmp_path: Path) -> None:
    """With and without more information on its cause than its prior has."""
    learner = Learner(truck, lane.signals, OneStage(tyres="linear"))
    program, cog, concerned = compiled(learner, tmp_path), truck.parameters()["semitrailer.cog"], set()
    for count, error in ((4, 1.2), (1, 1.5)):
        record = simulate(truck.replace({"semitrailer.cog": cog + error}), count=count, seed=5)
        learned = copy.copy(learner)
        learned.learn(record)
        concerned |= {cause.name for d in learned.doubts if d.kind == DoubtKind.ASSUMPTION for cause in d.causes[:1]}
        assert_equal(learner, program, record)
    assert concerned == {"semitrailer.cog"}


@pytest.mark.slow
def test_an_unstable_vehicle_starts_at_zero(truck: Vehicle, lane: Record, tmp_path: Path) -> None:
    stiffness = "tractor.drive.cornering_stiffness"
    unstable = truck.replace({stiffness: 0.6 * truck.parameters()[stiffness]})
    critical = critical_speed(unstable)
    assert critical is not None
    assert critical < lane.signals["speed"].min()
    learner = Learner(unstable, lane.signals, FIVE)
    assert_equal(learner, compiled(learner, tmp_path), lane)


def test_saved_estimates_continue(passing: tuple[Learner, Path], lane: Record, truck: Vehicle, tmp_path: Path) -> None:
    """As those of `Learner.save` and `Learner.load`; a file with a wrong byte is refused."""
    learner, program = passing
    later, saved = simulate(truck, count=1, seed=4), tmp_path / "estimates.bin"
    replayed(program, learner, lane, str(saved))
    states, found = replayed(program, learner, later, str(saved))
    first = copy.copy(learner)
    first.learn(lane)
    first.save(tmp_path / "learner.json")
    expected, estimates = pushed(Learner.load(tmp_path / "learner.json"), later)
    assert largest_difference(states, expected) < STATES
    assert largest_deviation(found, estimates) < ESTIMATES
    content = bytearray(saved.read_bytes())
    content[len(content) // 2] ^= 1
    saved.write_bytes(content)
    done = subprocess.run([program, "estimates.csv", saved], input="", capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "damaged" in done.stderr


def test_wrong_estimates_are_refused_and_a_reset_keeps_estimates(passing: tuple[Learner, Path], lane: Record) -> None:
    learner, program = passing
    header = (program.parent / "fw_samples.h").read_text()
    assert "FW_ESTIMATE_TRACTOR_FRONT_CORNERING_STIFFNESS = 0, /* tractor.front.cornering_stiffness, N/rad */" in header
    assert not any("@" in (program.parent / name).read_text() for name in LEARNER_FILES)
    shutil.copy(Path(__file__).parent / "storage.c", program.parent)
    storage = linked(program.parent, "storage.c")
    done = subprocess.run([storage], input=csv_text(learner, lane), capture_output=True, text=True, check=True)
    *rows, found = done.stdout.splitlines()
    states, _ = replayed(program, learner, lane)
    sigma = 3 + (states.shape[1] - 3) // 2
    np.testing.assert_array_equal(np.array([row.split(",") for row in rows], dtype=float), states[:, [3, sigma]])
    assert found == "1,1,1,1,1"
