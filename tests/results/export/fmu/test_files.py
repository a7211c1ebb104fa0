"""The files of an FMU: description, sources, licence; and what the export refuses."""

import shutil
import subprocess
import sys
import xml.etree.ElementTree as ET
import zipfile
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import pytest
from typer.testing import CliRunner

from fifthwheel.apps.cli import app
from fifthwheel.base.atomic import clean_up
from fifthwheel.base.errors import FifthwheelError, SignalError, VehicleError
from fifthwheel.estimate.observe import Observer
from fifthwheel.results.export import export_fmu
from fifthwheel.results.export.fmu import archive as fmu_archive
from fifthwheel.truck import Vehicle, get

COMPILER = shutil.which("gcc") or shutil.which("clang") or shutil.which("cc")
STRICT = ("-std=c99", "-Wall", "-Wextra", "-Wconversion", "-pedantic", "-Werror", "-fsyntax-only")
VERSIONS = (2, 3)
STEER = "steer.tractor.front"
SIGNALS = ("speed", STEER, "yaw_rate.tractor", "yaw_rate.semitrailer")
Archive = dict[str, str]


@pytest.fixture(scope="module")
def truck() -> Vehicle:
    return get("cheng_cebon_2011").with_logged_steering([STEER], "the test")


@pytest.fixture(scope="module")
def files(truck: Vehicle, tmp_path_factory: pytest.TempPathFactory) -> Callable[[str, int], Archive]:
    """The texts of an FMU of a kind and a version."""
    folder = tmp_path_factory.mktemp("fmu")
    small = truck.replace({f"{path}.relaxation_length": 0.0 for path in truck.axle_loads()})
    subjects = {"truck": truck, "observer": Observer(small, SIGNALS)}

    def read(kind: str, fmi: int) -> Archive:
        path = folder / f"{kind}{fmi}.fmu"
        if not path.exists():
            export_fmu(subjects[kind], path, fmi=fmi, platforms=[])
        return texts(path)

    return read


def texts(path: Path) -> Archive:
    with zipfile.ZipFile(path) as archive:
        return {name: archive.read(name).decode() for name in archive.namelist()}


def variables(files: Archive, fmi: int) -> dict[str, dict[str, str]]:
    """Attributes of the variables by name."""
    root = ET.fromstring(files["modelDescription.xml"])
    found = root.findall("ModelVariables/*")
    attributes = [element.attrib | (element[0].attrib if fmi == 2 else {}) for element in found]
    assert [int(a["valueReference"]) for a in attributes] == list(range(len(attributes)))
    by_name = {a["name"]: a for a in attributes}
    assert len(by_name) == len(attributes)
    return by_name


@pytest.mark.parametrize("fmi", VERSIONS)
def test_variables_of_truck_and_observer(files: Callable[[str, int], Archive], fmi: int) -> None:
    found = variables(files("truck", fmi), fmi)
    roles: dict[str, list[str]] = {}
    for name, attributes in found.items():
        roles.setdefault(attributes["causality"], []).append(name)
    assert roles["input"] == ["speed", STEER, "bank.road"]
    assert roles["parameter"] == [
        "tractor.front.cornering_stiffness",
        "tractor.drive.cornering_stiffness",
        "semitrailer.cornering_stiffness",
        "semitrailer.yaw_inertia",
        "semitrailer.payload.height",
    ]
    assert {"sideslip.semitrailer", "articulation.semitrailer", "lateral_acceleration.tractor"} <= {*roles["output"]}
    stiffness = found["semitrailer.cornering_stiffness"]
    assert (stiffness["variability"], stiffness["unit"], float(stiffness["start"])) == ("tunable", "N/rad", 1273e3)
    found = variables(files("observer", fmi), fmi)
    inputs = [name for name, a in found.items() if a["causality"] == "input"]
    assert inputs == ["speed", STEER, "measured.yaw_rate.tractor", "measured.yaw_rate.semitrailer"]
    outputs = {name for name, a in found.items() if a["causality"] == "output"}
    assert {"yaw_rate.tractor", "yaw_rate.tractor.sigma", "sideslip.semitrailer", "nis", "status"} <= outputs
    assert found["status"]["variability"] == "discrete"
    assert "4 inconsistent" in found["status"]["description"]
    assert (found["sample_time"]["variability"], found["sample_time"]["start"]) == ("fixed", "0.01")


@pytest.mark.parametrize("fmi", VERSIONS)
def test_units_are_defined_in_base_units(files: Callable[[str, int], Archive], fmi: int) -> None:
    archive = files("truck", fmi)
    root = ET.fromstring(archive["modelDescription.xml"])
    units = {unit.attrib["name"]: dict(unit[0].attrib) for unit in root.iter("Unit")}
    used = {a["unit"] for a in variables(archive, fmi).values() if "unit" in a}
    assert used == units.keys()
    assert units["rad/s"] == {"rad": "1", "s": "-1"}
    assert units["N/rad"] == {"kg": "1", "m": "1", "rad": "-1", "s": "-2"}


@pytest.mark.skipif(COMPILER is None, reason="no C compiler")
@pytest.mark.parametrize("kind", ["truck", "observer"])
@pytest.mark.parametrize("fmi", VERSIONS)
def test_the_named_sources_compile_without_warnings(
    files: Callable[[str, int], Archive], kind: str, fmi: int, tmp_path: Path
) -> None:
    archive = files(kind, fmi)
    for name, text in archive.items():
        if name.startswith("sources/"):
            (tmp_path / Path(name).name).write_text(text)
    listed = ET.fromstring(archive["sources/buildDescription.xml" if fmi == 3 else "modelDescription.xml"])
    names = [element.attrib["name"] for element in listed.iter("SourceFile" if fmi == 3 else "File")]
    assert f"fmu_{kind}.c" in names
    assert COMPILER
    done = subprocess.run([COMPILER, *STRICT, *names], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[:2000]


def test_equal_models_give_equal_files(files: Callable[[str, int], Archive], truck: Vehicle, tmp_path: Path) -> None:
    """With our licence; and other numbers another token, so that a library is not used with another description."""
    licence = Path(__file__).parents[4] / "LICENSE"
    assert files("truck", 3)["documentation/licenses/license.txt"] == licence.read_text()
    first, second = (export_fmu(truck, tmp_path / name, platforms=[]).read_bytes() for name in "ab")
    assert first == second
    tokens = set()
    for path in (tmp_path / "a", export_fmu(truck.replace({"tractor.mass": 7000.0}), tmp_path / "c", platforms=[])):
        token = ET.fromstring(texts(path)["modelDescription.xml"]).attrib["instantiationToken"]
        assert f'#define FMU_TOKEN "{token}"' in texts(path)["sources/fmu_model.h"]
        tokens.add(token)
    assert len(tokens) == 2


def test_outputs_and_tunable_parameters_can_be_chosen(truck: Vehicle, tmp_path: Path) -> None:
    path = tmp_path / "truck.fmu"
    export_fmu(truck, path, outputs=["roll.semitrailer", "roll.semitrailer"], tunable=["roll_stiffness"], platforms=[])
    found = variables(texts(path), 3)
    assert [name for name, a in found.items() if a["causality"] == "output"] == ["roll.semitrailer"]
    assert "fifth_wheel.roll_stiffness" in found
    assert "semitrailer.cornering_stiffness" not in found
    export_fmu(truck, path, tunable=[], platforms=[])
    assert "parameter" not in {a["causality"] for a in variables(texts(path), 3).values()}
    assert "(void)parameters;" in texts(path)["sources/fw_truck.h"]  # no warning of an argument that is not used


def test_what_cannot_be_exported_is_refused(truck: Vehicle, tmp_path: Path) -> None:
    path = tmp_path / "x.fmu"
    with pytest.raises(FifthwheelError, match="fmi: expected 2 or 3, got 1"):
        export_fmu(truck, path, fmi=1)
    with pytest.raises(FifthwheelError, match="x86_64-darwin: no platform of an FMU"):
        export_fmu(truck, path, platforms=["x86_64-darwin"])
    with pytest.raises(FifthwheelError, match="an observer has its own outputs"):
        export_fmu(Observer(truck, SIGNALS), path, tunable=["cornering_stiffness"])
    with pytest.raises(VehicleError, match="stiffness_of_tyres: no such parameter"):
        export_fmu(truck, path, tunable=["stiffness_of_tyres"])
    with pytest.raises(FifthwheelError, match=r"tractor\.cog: expected above 0 to be tunable, got -1\.03"):
        export_fmu(truck, path, tunable=["tractor.cog"])
    with pytest.raises(SignalError, match=r"bank\.road: an input of the truck"):
        export_fmu(truck, path, outputs=["bank.road"])
    with pytest.raises(SignalError, match=r"pitch\.tractor: no such quantity"):
        export_fmu(truck, path, outputs=["pitch.tractor"])
    assert not path.exists()


def test_a_missing_compiler_is_named(truck: Vehicle, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "ziglang", None)
    with pytest.raises(FifthwheelError, match=r"ziglang is needed but not installed; pip install 'fifthwheel\[fmu\]'"):
        export_fmu(truck, tmp_path / "truck.fmu")


def test_a_signal_leaves_no_folder_of_the_compiler(
    truck: Vehicle, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folders = []

    def interrupted(folder: Path, *arguments: object) -> bytes:
        assert (folder / "freestanding" / "math.h").is_file()
        clean_up()  # as the command does when a signal ends it at once
        folders.append(folder)
        return b""

    monkeypatch.setitem(sys.modules, "ziglang", ModuleType("ziglang"))
    monkeypatch.setattr(fmu_archive, "_library", interrupted)
    export_fmu(truck, tmp_path / "truck.fmu", platforms=["x86_64-linux"])
    assert [folder.exists() for folder in folders] == [False]


def test_the_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    command = ["export", "fmu", "-v", "cheng_cebon_2011", "--sources-only"]
    done = CliRunner().invoke(app, [*command, "--what", "truck", "--fmi", "2", "--signal", "yaw_rate.tractor"])
    assert done.output == "fifthwheel-truck.fmu: FMI 2.0 co-simulation, sources only\n"
    assert "yaw_rate.tractor" in variables(texts(tmp_path / "fifthwheel-truck.fmu"), 2)
    again = CliRunner().invoke(app, [*command, "--what", "truck"])
    assert isinstance(again.exception, FifthwheelError)
    assert "exists" in str(again.exception)
    wrong = CliRunner().invoke(app, [*command, "--what", "truck", "--bank", "--out", "x.fmu"])
    assert str(wrong.exception) == "--bank: only for --what observer; remove it, or export the observer"
    done = CliRunner().invoke(app, [*command, *(f"--signal={name}" for name in SIGNALS), "--json"])
    assert '"file": "fifthwheel-observer.fmu"' in done.output
    assert "measured.yaw_rate.tractor" in variables(texts(tmp_path / "fifthwheel-observer.fmu"), 3)
