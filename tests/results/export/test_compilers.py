"""Exported estimators with other compilers, sanitizers, a static checker, and on emulated control units."""

import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fifthwheel.data.record import Record
from fifthwheel.estimate.filters.relinearised import RelinearisationSettings
from fifthwheel.estimate.identify.settings import OneStage
from fifthwheel.estimate.observe import Observer
from fifthwheel.estimate.online import Learner, LearnerSettings
from fifthwheel.model.simulate import simulate
from fifthwheel.results.export import export_c
from fifthwheel.results.export.project import LEARNER_SOURCES
from fifthwheel.truck import get
from tests.results.export import c_learner, test_c_observer
from tests.results.export.cortex_m import MISSING, emulated
from tests.results.export.test_c_observer import FAULTS, assert_equal, with_fault

pytestmark = pytest.mark.slow
TRUCK = get("cheng_cebon_2011")
PROGRAMS: dict[str, Any] = {"observer": test_c_observer, "learner": c_learner}
"""Modules that compile, replay and push an estimator."""
kinds = pytest.mark.parametrize("kind", PROGRAMS)


@pytest.fixture(scope="module")
def lane() -> Record:
    return simulate(TRUCK, count=1, seed=3)


@pytest.fixture(scope="module")
def estimators(lane: Record) -> dict[str, Any]:
    """An observer with 8 states; a learner of five parameters with passes within the record."""
    truck = TRUCK.replace({f"{path}.relaxation_length": 0.0 for path in TRUCK.axle_loads()})
    settings = OneStage(given={"others": "exact", "sensors": "exact"}, tyres="linear")
    passes = RelinearisationSettings(lag=20, samples=150, first_pass_limit=0.01, pass_limit=0.05)
    learner = Learner(TRUCK, lane.signals, settings, learner=LearnerSettings(relinearisation=passes))
    return {"observer": Observer(truck, lane.signals), "learner": learner}


@pytest.mark.parametrize(
    ("kind", "compiler", "precision"),
    [
        ("observer", "gcc", ()),
        ("observer", "clang", ("-DFW_FLOAT",)),
        ("learner", "gcc", ("-DFW_FLOAT",)),
        ("learner", "clang", ()),
    ],
)
def test_without_undefined_behaviour(
    kind: str, compiler: str, precision: tuple[str, ...], estimators: dict[str, Any], lane: Record, tmp_path: Path
) -> None:
    """The program ends with an error at undefined behaviour. Results in double precision: `test_c_learner`."""
    if shutil.which(compiler) is None:
        pytest.skip(f"{compiler} is not installed")
    estimator, sanitizers = estimators[kind], ("-fsanitize=address,undefined", "-fno-sanitize-recover=all")
    replay = PROGRAMS[kind].compiled(estimator, tmp_path, "-O0", *sanitizers, *precision, compiler=compiler)
    for fault in FAULTS:
        record = with_fault(lane, fault)
        saved = (str(tmp_path / f"{fault}.bin"),) if kind == "learner" else ()
        found = PROGRAMS[kind].replayed(replay, estimator, record, *saved)
        if kind == "learner" and precision and fault in ("gaps", "spikes"):
            expected, estimates = c_learner.pushed(estimator, record)
            assert c_learner.largest_difference(found[0], expected) < 1e-3
            assert c_learner.largest_deviation(found[1], estimates) < 1e-2
    if kind == "learner":  # refusals of stored estimates
        shutil.copy(Path(__file__).parent / "storage.c", tmp_path)
        storage = c_learner.linked(tmp_path, "storage.c", *sanitizers, *precision, compiler=compiler)
        text = c_learner.csv_text(estimator, lane)
        subprocess.run([storage], input=text, capture_output=True, text=True, check=True)


def test_tyres_that_saturate(lane: Record, tmp_path: Path) -> None:
    """The friction is one more estimate."""
    learner = Learner(TRUCK, lane.signals, OneStage(tyres="saturating"))
    program = c_learner.compiled(learner, tmp_path)
    states, found = c_learner.replayed(program, learner, lane, str(tmp_path / "learned.bin"))
    expected, estimates = c_learner.pushed(learner, lane)
    assert "road.friction" in found
    assert c_learner.largest_difference(states, expected) < 1e-11
    assert c_learner.largest_deviation(found, estimates) < 1e-10


def cppcheck(*arguments: str, folder: Path | None = None) -> subprocess.CompletedProcess[str]:
    return subprocess.run(["cppcheck", *arguments], cwd=folder, capture_output=True, text=True, check=False)


CPPCHECK = cppcheck("--version").stdout.split()[-1] if shutil.which("cppcheck") else None
"""The version of the static checker; None if it is not installed."""


def export_checked(estimator: Any, folder: Path) -> list[str]:
    """Export, and the sources to check: without the generated functions, which have no loops, branches or indices.

    For the statements of the step of the observer's filter the static checker would need hours.
    """
    export_c(estimator, folder)
    if isinstance(estimator, Learner):
        return [name for name in LEARNER_SOURCES if name != "fw_learner_model.c"]
    head, name, body = (folder / "fw_model.h").read_text().partition("static void fw_step")
    step = body[: body.index("{")] + "{ (void)carry; (void)sample; next[0] = carry[0]; out[0] = sample[0]; }\n#endif\n"
    (folder / "fw_model.h").write_text(head + name + step)
    return ["fw_observer.c"]


@kinds
@pytest.mark.skipif(CPPCHECK is None, reason="cppcheck is not installed")
def test_the_static_checker_finds_nothing(kind: str, estimators: dict[str, Any], tmp_path: Path) -> None:
    sources = export_checked(estimators[kind], tmp_path)
    rules = ["--std=c99", "--enable=warning,portability,performance", "--error-exitcode=1", "--quiet"]
    done = cppcheck(*rules, *sources, folder=tmp_path)
    assert done.returncode == 0, done.stderr


@pytest.mark.skipif(CPPCHECK != "2.10", reason="cppcheck 2.10 is not installed; others have other rules")
def test_deviations_from_misra_are_those_of_the_documentation(estimators: dict[str, Any], tmp_path: Path) -> None:
    sources = export_checked(estimators["observer"], tmp_path)
    rules = ["--std=c99", "--enable=style", "--addon=misra", "--quiet", "--template={file}:{line} {id}"]
    done = cppcheck(*rules, *sources, folder=tmp_path)
    found = set(re.findall(r"misra-c2012-([0-9.]+)", done.stderr))
    page = (Path(__file__).parents[3] / "docs" / "howto" / "export.md").read_text()
    assert found == set(re.findall(r"^\| ([0-9]+\.[0-9]+) \|", page, re.MULTILINE)) != set(), done.stderr


@kinds
@pytest.mark.skipif(shutil.which("cmake") is None, reason="cmake is not installed")
def test_the_build_file(kind: str, estimators: dict[str, Any], lane: Record, tmp_path: Path) -> None:
    estimator, record = estimators[kind], lane.cut(0, 1)
    export_c(estimator, tmp_path)
    for command in (["cmake", "-S", ".", "-B", "build", "-DCMAKE_BUILD_TYPE=Debug"], ["cmake", "--build", "build"]):
        subprocess.run(command, cwd=tmp_path, check=True, capture_output=True)
    found = PROGRAMS[kind].replayed(tmp_path / "build" / "replay", estimator, record)
    expected = PROGRAMS[kind].pushed(estimator, record)
    if kind == "observer":
        assert_equal(found, expected, 1e-12)
    else:
        assert c_learner.largest_difference(found[0], expected[0]) < 1e-12


@pytest.mark.skipif(bool(MISSING), reason=f"{', '.join(MISSING)} not installed")
@pytest.mark.parametrize(
    ("kind", "core", "optimisation", "tolerance", "flash", "memory", "instructions"),
    [
        ("observer", "cortex-m4", "-O2", 1e-5, 120_000, 8_000, 40_000),
        ("learner", "cortex-m7", "-Os", 1e-4, 160_000, 50_000, 200_000),
    ],
)
def test_a_control_unit_gives_what_the_host_gives(
    kind: str, core: str, optimisation: str, tolerance: float, flash: int, memory: int, instructions: int,
    estimators: dict[str, Any], lane: Record, tmp_path: Path,
) -> None:  # fmt: skip
    estimator, record, programs = estimators[kind], with_fault(lane, "gaps").cut(0.0, 4.0), PROGRAMS[kind]
    found = emulated(estimator, record, core, tmp_path, optimisation)
    program = programs.compiled(estimator, tmp_path, "-DFW_FLOAT", "-ffp-contract=off")
    host = programs.replayed(program, estimator, record)
    host = host if kind == "observer" else host[0]
    expected = np.delete(host, [0, 2], axis=1)  # without time, and nis or learning
    assert found.rows.shape == expected.shape
    assert (found.rows[:, 0] == expected[:, 0]).all()
    assert host[:, 2].any()
    assert np.nanmax(np.abs(found.rows - expected) / np.nanmax(np.abs(expected), axis=0).clip(1e-12)) < tolerance
    assert found.flash <= flash
    assert found.memory + found.stack <= memory
    assert np.median(found.instructions) <= instructions
