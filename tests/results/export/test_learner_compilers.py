"""The exported learner with other compilers, sanitizers, a static checker, and on an emulated control unit."""

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from fifthwheel.data.record import Record
from fifthwheel.estimate.filters.relinearised import RelinearisationSettings
from fifthwheel.estimate.identify.settings import OneStage
from fifthwheel.estimate.online import Learner, LearnerSettings
from fifthwheel.model.simulate import simulate
from fifthwheel.results.export import export_c
from fifthwheel.results.export.project import LEARNER_SOURCES
from fifthwheel.truck import get
from tests.results.export.c_learner import (
    compiled,
    csv_text,
    largest_deviation,
    largest_difference,
    linked,
    pushed,
    replayed,
)
from tests.results.export.cortex_m import MISSING, emulated
from tests.results.export.test_c_observer import FAULTS, with_fault

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def lane() -> Record:
    return simulate(get("cheng_cebon_2011"), count=1, seed=3)


@pytest.fixture(scope="module")
def learner(lane: Record) -> Learner:
    """Five parameters, all other numbers are known; with passes within the record."""
    settings = OneStage(given={"others": "exact", "sensors": "exact"}, tyres="linear")
    passes = RelinearisationSettings(lag=20, samples=150, first_pass_limit=0.01, pass_limit=0.05)
    truck = get("cheng_cebon_2011")
    return Learner(truck, lane.signals, settings, learner=LearnerSettings(relinearisation=passes))


@pytest.mark.parametrize(("compiler", "precision"), [("gcc", ("-DFW_FLOAT",)), ("clang", ())])
def test_without_undefined_behaviour(
    learner: Learner, lane: Record, tmp_path: Path, compiler: str, precision: tuple[str, ...]
) -> None:
    if shutil.which(compiler) is None:
        pytest.skip(f"{compiler} is not installed")
    sanitizers = ("-fsanitize=address,undefined", "-fno-sanitize-recover=all")
    replay = compiled(learner, tmp_path, "-O0", *sanitizers, *precision, compiler=shutil.which(compiler))
    for fault in FAULTS:  # the program ends with an error at undefined behaviour
        record = with_fault(lane, fault)
        states, found = replayed(replay, learner, record, str(tmp_path / f"{fault}.bin"))
        if precision and fault in ("gaps", "spikes"):  # in double precision: `test_c_learner`
            expected, estimates = pushed(learner, record)
            assert largest_difference(states, expected) < 1e-3
            assert largest_deviation(found, estimates) < 1e-2
    shutil.copy(Path(__file__).parent / "storage.c", tmp_path)  # refusals of stored estimates
    storage = linked(tmp_path, "storage.c", *sanitizers, *precision, compiler=shutil.which(compiler))
    subprocess.run([storage], input=csv_text(learner, lane), capture_output=True, text=True, check=True)


def test_tyres_that_saturate(lane: Record, tmp_path: Path) -> None:
    """The friction is one more estimate."""
    learner = Learner(get("cheng_cebon_2011"), lane.signals, OneStage(tyres="saturating"))
    states, found = replayed(compiled(learner, tmp_path), learner, lane, str(tmp_path / "learned.bin"))
    expected, estimates = pushed(learner, lane)
    assert "road.friction" in found
    assert largest_difference(states, expected) < 1e-11
    assert largest_deviation(found, estimates) < 1e-10


def test_the_static_checker_finds_nothing(learner: Learner, tmp_path: Path) -> None:
    """Without the generated functions, which have no loops, branches or indices."""
    if shutil.which("cppcheck") is None:
        pytest.skip("cppcheck is not installed")
    export_c(learner, tmp_path)
    sources = [name for name in LEARNER_SOURCES if name != "fw_learner_model.c"]
    command = ["cppcheck", "--std=c99", "--enable=warning,portability,performance", "--error-exitcode=1", "--quiet"]
    done = subprocess.run([*command, *sources], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_the_build_file(learner: Learner, lane: Record, tmp_path: Path) -> None:
    if shutil.which("cmake") is None:
        pytest.skip("cmake is not installed")
    export_c(learner, tmp_path)
    for command in (["cmake", "-S", ".", "-B", "build", "-DCMAKE_BUILD_TYPE=Debug"], ["cmake", "--build", "build"]):
        subprocess.run(command, cwd=tmp_path, check=True, capture_output=True)
    states, _ = replayed(tmp_path / "build" / "replay", learner, lane)
    assert largest_difference(states, pushed(learner, lane)[0]) < 1e-12


@pytest.mark.skipif(bool(MISSING), reason=f"{', '.join(MISSING)} not installed")
def test_a_control_unit_gives_what_the_host_gives(learner: Learner, lane: Record, tmp_path: Path) -> None:
    record = with_fault(lane, "gaps").cut(0.0, 4.0)
    found = emulated(learner, record, "cortex-m7", tmp_path, "-Os")
    host = replayed(compiled(learner, tmp_path, "-DFW_FLOAT", "-ffp-contract=off"), learner, record)[0]
    expected = np.delete(host, [0, 2], axis=1)  # without time and learning
    assert (found.rows[:, 0] == expected[:, 0]).all()
    assert host[:, 2].any()
    assert np.nanmax(np.abs(found.rows - expected) / np.nanmax(np.abs(expected), axis=0).clip(1e-12)) < 1e-4
    assert found.flash <= 160_000
    assert found.memory + found.stack <= 50_000
    assert np.median(found.instructions) <= 200_000
