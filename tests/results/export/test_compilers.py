"""The exported observer with other compilers, sanitizers, a static checker, and on emulated control units."""

import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from fifthwheel.data.record import Record
from fifthwheel.estimate.observe import Observer
from fifthwheel.model.simulate import simulate
from fifthwheel.results.export import export_c
from fifthwheel.truck import get
from tests.results.export.cortex_m import MISSING, emulated
from tests.results.export.test_c_observer import FAULTS, assert_equal, compiled, pushed, replayed, with_fault

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def lane() -> Record:
    return simulate(get("cheng_cebon_2011"), count=1, seed=3)


@pytest.fixture(scope="module")
def observer(lane: Record) -> Observer:
    """With 8 states: without relaxation lengths."""
    truck = get("cheng_cebon_2011")
    truck = truck.replace({f"{path}.relaxation_length": 0.0 for path in truck.axle_loads()})
    return Observer(truck, lane.signals)


@pytest.mark.parametrize(("compiler", "precision"), [("gcc", ()), ("clang", ("-DFW_FLOAT",))])
def test_without_undefined_behaviour(
    observer: Observer, lane: Record, tmp_path: Path, compiler: str, precision: tuple[str, ...]
) -> None:
    if shutil.which(compiler) is None:
        pytest.skip(f"{compiler} is not installed")
    sanitizers = ("-fsanitize=address,undefined", "-fno-sanitize-recover=all")
    replay = compiled(observer, tmp_path, "-O1", *sanitizers, *precision, compiler=shutil.which(compiler))
    for fault in FAULTS:  # the program ends with an error at undefined behaviour
        replayed(replay, observer, with_fault(lane, fault))


def cppcheck_version() -> str | None:
    """The version of the static checker; None if it is not installed."""
    if shutil.which("cppcheck") is None:
        return None
    return subprocess.run(["cppcheck", "--version"], capture_output=True, text=True, check=True).stdout.split()[-1]


def without_step(observer: Observer, folder: Path) -> None:
    """Export without the statements of the filter step, for which the static checker needs hours.

    They have no loops, branches or indices, and come from the same generator as the matrices, which stay.
    """
    export_c(observer, folder)
    head, name, body = (folder / "fw_model.h").read_text().partition("static void fw_step")
    step = body[: body.index("{")] + "{ (void)carry; (void)sample; next[0] = carry[0]; out[0] = sample[0]; }\n#endif\n"
    (folder / "fw_model.h").write_text(head + name + step)


@pytest.mark.skipif(shutil.which("cppcheck") is None, reason="cppcheck is not installed")
def test_the_static_checker_finds_nothing(observer: Observer, tmp_path: Path) -> None:
    without_step(observer, tmp_path)
    command = ["cppcheck", "--std=c99", "--enable=warning,portability,performance", "--error-exitcode=1", "--quiet"]
    done = subprocess.run([*command, "fw_observer.c"], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.skipif(cppcheck_version() != "2.10", reason="cppcheck 2.10 is not installed; others have other rules")
def test_deviations_from_misra_are_those_of_the_documentation(observer: Observer, tmp_path: Path) -> None:
    without_step(observer, tmp_path)
    command = ["cppcheck", "--std=c99", "--enable=style", "--addon=misra", "--quiet", "--template={file}:{line} {id}"]
    done = subprocess.run([*command, "fw_observer.c"], cwd=tmp_path, capture_output=True, text=True, check=False)
    found = set(re.findall(r"misra-c2012-([0-9.]+)", done.stderr))
    page = (Path(__file__).parents[3] / "docs" / "howto" / "export.md").read_text()
    documented = set(re.findall(r"^\| ([0-9]+\.[0-9]+) \|", page, re.MULTILINE))
    assert found, done.stderr  # the addon runs
    assert found == documented, done.stderr


def test_the_build_file(observer: Observer, lane: Record, tmp_path: Path) -> None:
    if shutil.which("cmake") is None:
        pytest.skip("cmake is not installed")
    export_c(observer, tmp_path)
    for command in (["cmake", "-S", ".", "-B", "build"], ["cmake", "--build", "build"]):
        subprocess.run(command, cwd=tmp_path, check=True, capture_output=True)
    assert_equal(replayed(tmp_path / "build" / "replay", observer, lane), pushed(observer, lane), 1e-12)


@pytest.mark.skipif(bool(MISSING), reason=f"{', '.join(MISSING)} not installed")
def test_a_control_unit_gives_what_the_host_gives(observer: Observer, lane: Record, tmp_path: Path) -> None:
    record = with_fault(lane, "gaps").cut(0.0, 4.0)
    found = emulated(observer, record, "cortex-m4", tmp_path)
    host = replayed(compiled(observer, tmp_path, "-DFW_FLOAT", "-ffp-contract=off"), observer, record)[:, 1:]
    expected = np.delete(host, 1, axis=1)  # without nis
    assert found.rows.shape == expected.shape
    assert (found.rows[:, 0] == expected[:, 0]).all()
    assert np.nanmax(np.abs(found.rows - expected) / np.nanmax(np.abs(expected), axis=0).clip(1e-12)) < 1e-5
    assert found.flash <= 120_000
    assert found.memory + found.stack <= 8_000
    assert np.median(found.instructions) <= 40_000
