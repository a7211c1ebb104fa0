"""FMUs in FMPy: the truck against the simulation in Python, the observer against `Observer.push`."""

import importlib.util
import re
import shutil
import subprocess
import zipfile
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

from fifthwheel.data.record import Record
from fifthwheel.estimate.observe import Observer, ObserverSettings, Status
from fifthwheel.model import dynamics
from fifthwheel.model.dynamics import linear_system
from fifthwheel.model.dynamics.simulation import free_response
from fifthwheel.model.simulate import simulate
from fifthwheel.results.export import PLATFORMS, export_fmu
from fifthwheel.results.export.fmu.models import default_outputs
from fifthwheel.truck import Vehicle, get
from tests.results.export.fmu import Unit
from tests.results.export.test_c_observer import missing_inputs, missing_measurements

MISSING = [name for name in ("fmpy", "ziglang") if importlib.util.find_spec(name) is None]
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(bool(MISSING), reason=f"not installed: {', '.join(MISSING)}; pip install ziglang fmpy"),
    pytest.mark.filterwarnings("ignore::DeprecationWarning"),
]
VERSIONS = (2, 3)
STEER = "steer.tractor.front"
STIFFNESS = "semitrailer.cornering_stiffness"
TOLERANCE = 1e-10


@pytest.fixture(scope="module")
def truck() -> Vehicle:
    """With relaxation lengths and one steered axle."""
    return get("cheng_cebon_2011").with_logged_steering([STEER], "the test")


@pytest.fixture(scope="module")
def observer(truck: Vehicle) -> Observer:
    """Without relaxation lengths, with bank, sensor errors, and short times."""
    truck = truck.replace({f"{path}.relaxation_length": 0.0 for path in truck.axle_loads()})
    signals = ["speed", STEER, "yaw_rate.tractor", "yaw_rate.semitrailer", "roll_rate.semitrailer"]
    errors = {f"{STEER}.offset": 0.002, "yaw_rate.tractor.offset": 0.001}
    return Observer(truck, signals, ObserverSettings(sensor_errors=errors, bank=0.03, hold=0.05, coast=0.1))


@pytest.fixture(scope="module")
def trucks(truck: Vehicle, tmp_path_factory: pytest.TempPathFactory) -> Mapping[int, Path]:
    """The FMU of the truck in each version; that of version 3 for all platforms."""
    folder = tmp_path_factory.mktemp("truck")
    platforms: Mapping[int, tuple[str, ...]] = {2: ("x86_64-linux",), 3: tuple(PLATFORMS)}
    return {fmi: export_fmu(truck, folder / f"{fmi}.fmu", fmi=fmi, platforms=platforms[fmi]) for fmi in VERSIONS}


@pytest.fixture(scope="module")
def observers(observer: Observer, tmp_path_factory: pytest.TempPathFactory) -> Mapping[int, Path]:
    """The FMU of the observer in each version."""
    folder = tmp_path_factory.mktemp("observer")
    return {fmi: export_fmu(observer, folder / f"{fmi}.fmu", fmi=fmi, platforms=["x86_64-linux"]) for fmi in VERSIONS}


@pytest.fixture
def inputs() -> dict[str, np.ndarray]:
    """Random inputs of 300 steps, from walking to motorway speed."""
    rng, n = np.random.default_rng(5), 300
    return {"speed": np.linspace(2.0, 32.0, n), STEER: np.cumsum(rng.normal(0, 0.002, n))}


def assert_close(actual: np.ndarray, expected: np.ndarray, tolerance: float = TOLERANCE) -> None:
    """Equal within a fraction of the range of each column."""
    assert actual.shape == expected.shape
    assert (np.isnan(actual) == np.isnan(expected)).all()
    span = np.nanmax(np.abs(expected), axis=0)
    assert span.min() > 0
    assert np.nanmax(np.abs(actual - expected) / span) <= tolerance


def held_response(truck: Vehicle, steps: np.ndarray, inputs: Mapping[str, np.ndarray]) -> np.ndarray:
    """Outputs in Python after each step, with inputs that are constant during it."""
    names = default_outputs(truck)
    model, values = dynamics.model(truck, names, roll=True), dynamics.all_parameters(truck, names)
    x, rows = np.zeros(len(model.states)), []
    for k, step in enumerate(steps):
        held = {name: np.full(2, column[k]) for name, column in inputs.items()}
        states, outputs = free_response(model, values, np.array([0.0, step]), held, x)
        x = states[-1]
        rows.append(outputs[-1])
    return np.array(rows)


def run(unit: Unit, truck: Vehicle, steps: np.ndarray, inputs: Mapping[str, np.ndarray]) -> np.ndarray:
    """The same in an FMU."""
    rows = []
    for k, step in enumerate(steps):
        unit.set({name: column[k] for name, column in inputs.items()})
        unit.step(float(step))
        rows.append(unit.get(default_outputs(truck)))
    return np.array(rows)


@pytest.mark.parametrize("fmi", VERSIONS)
def test_descriptions_are_valid(fmi: int, trucks: Mapping[int, Path], observers: Mapping[int, Path]) -> None:
    """By the schemas of the standard, and by the rules that FMPy checks besides."""
    from fmpy.validation import validate_fmu

    assert validate_fmu(str(trucks[fmi])) == []
    assert validate_fmu(str(observers[fmi])) == []


@pytest.mark.parametrize("fmi", VERSIONS)
def test_the_truck_moves_as_in_python(
    fmi: int, truck: Vehicle, trucks: Mapping[int, Path], inputs: dict[str, np.ndarray], tmp_path: Path
) -> None:
    steps = np.random.default_rng(1).uniform(0.001, 0.03, len(inputs["speed"]))
    with Unit(trucks[fmi], tmp_path) as unit:
        assert_close(run(unit, truck, steps, inputs), held_response(truck, steps, inputs))


def test_derivatives_of_inputs_give_the_simulation_of_a_log(
    truck: Vehicle, trucks: Mapping[int, Path], inputs: dict[str, np.ndarray], tmp_path: Path
) -> None:
    names, time = default_outputs(truck), np.arange(len(inputs["speed"])) * 0.01
    _, expected = free_response(
        dynamics.model(truck, names, roll=True), dynamics.all_parameters(truck, names), time, inputs
    )
    with Unit(trucks[2], tmp_path) as unit:
        rows = []
        references = [unit.references[name] for name in inputs]
        for k in range(len(time) - 1):
            unit.set({name: column[k] for name, column in inputs.items()})
            slopes = [(column[k + 1] - column[k]) / 0.01 for column in inputs.values()]
            unit.slave.setRealInputDerivatives(references, [1] * len(references), slopes)
            unit.step(0.01, 0.01 * k)
            rows.append(unit.get(names))
    assert_close(np.array(rows), expected[1:])


def test_parameters_are_tunable(
    truck: Vehicle, trucks: Mapping[int, Path], inputs: dict[str, np.ndarray], tmp_path: Path
) -> None:
    """At the start and between steps; the model then divides steps by the changed eigenvalues."""
    changes = {STIFFNESS: 2e6, "semitrailer.payload.height": 2.0, "semitrailer.yaw_inertia": 3e5}
    changed, steps = truck.replace(changes), np.full(len(inputs["speed"]), 0.005)
    fast = {**inputs, "speed": inputs["speed"] + 10}
    expected = held_response(changed, steps, fast)
    with Unit(trucks[3], tmp_path, changes) as unit:
        assert_close(run(unit, truck, steps, fast), expected)
    with Unit(trucks[3], tmp_path) as unit:
        unit.set(changes)
        assert_close(run(unit, truck, steps, fast), expected)


def test_stiff_parameters_at_low_speed(truck: Vehicle, tmp_path: Path) -> None:
    """Against the exact step: with the steps of the exported parameters, the changed ones would be unstable."""
    truck = truck.replace({f"{path}.relaxation_length": 0.0 for path in truck.axle_loads()})
    exported = truck.parameters()
    stiffnesses = [f"{path}.cornering_stiffness" for path in truck.axle_loads()]
    changes = {name: 8 * exported[name] for name in stiffnesses}
    changes["semitrailer.yaw_inertia"] = exported["semitrailer.yaw_inertia"] / 8
    system = linear_system(truck.replace(changes), 1.5, ["yaw_rate.tractor", "roll.semitrailer"])
    F, G, H = system.step(0.05)
    x, expected, rows = np.zeros(len(system.states)), [], []
    path = export_fmu(truck, tmp_path / "truck.fmu", platforms=["x86_64-linux"])
    with Unit(path, tmp_path / "unit", changes) as unit:
        for k in range(100):
            steer = 0.1 * np.sin(0.3 * k)
            x = F @ x + (G + H)[:, 0] * steer
            expected.append(system.C @ x)
            unit.set({"speed": 1.5, STEER: steer})
            unit.step(0.05)
            rows.append(unit.get(system.outputs))
    assert_close(np.array(rows), np.array(expected), 1e-5)


def test_the_bank_acts_as_in_python(truck: Vehicle, trucks: Mapping[int, Path], tmp_path: Path) -> None:
    names = default_outputs(truck)
    model, values = dynamics.model(truck, names, roll=True, bank=True), dynamics.all_parameters(truck, names)
    x0 = np.zeros(len(model.states))
    x0[-1] = 0.04
    time = np.arange(300) * 0.01
    held = {"speed": np.full(300, 20.0), STEER: np.full(300, 0.005)}
    _, expected = free_response(model, values, time, held, x0)
    with Unit(trucks[3], tmp_path) as unit:
        columns = {**held, "bank.road": np.full(300, 0.04)}
        found = run(unit, truck, np.full(299, 0.01), columns)
    assert_close(found, expected[1:])


@pytest.mark.parametrize("fmi", VERSIONS)
def test_the_observer_gives_what_push_gives(
    fmi: int, observer: Observer, observers: Mapping[int, Path], tmp_path: Path
) -> None:
    record = simulate(observer.vehicle, count=1, seed=3)
    signals = {name: np.array(values) for name, values in record.signals.items()}
    missing_measurements(record.time, signals)
    missing_inputs(record.time, signals)
    record = Record(time=record.time, signals=signals, name="missing")
    observer.reset()
    names = [name for state in observer.reported for name in (state, f"{state}.sigma")]
    statuses, expected, found = set(), [], []
    with Unit(observers[fmi], tmp_path) as unit:
        assert np.isnan(unit.get(names)).all()
        for k, time in enumerate(record.time.tolist()):
            sample = {name: signals[name][k] for name in (*observer.inputs, *observer.outputs)}
            answer = observer.push({"time": time, **sample})
            unit.set({name if name in observer.inputs else f"measured.{name}": x for name, x in sample.items()})
            unit.step(0.01, time)
            assert unit.status() == answer["status"]
            statuses.add(unit.status())
            expected.append([answer[name] for name in (*names, "nis")])
            found.append(unit.get([*names, "nis"]))
    assert_close(np.array(found), np.array(expected))
    assert {Status.OK, Status.COASTING, Status.INPUT_MISSING} <= statuses


def assert_pushed(unit: Unit, observer: Observer, record: Record, *, step: float = 0.01, every: int = 1) -> None:
    """The FMU gives what `push` gives, which gets every so many samples."""
    observer.reset()
    names, expected, found = list(observer.reported), [], []
    for k, time in enumerate(record.time.tolist()[:600]):
        sample = {name: record.signals[name][k] for name in (*observer.inputs, *observer.outputs)}
        if k % every == 0:
            answer = observer.push({"time": time, **sample})
        unit.set({name if name in observer.inputs else f"measured.{name}": x for name, x in sample.items()})
        unit.step(step, time)
        expected.append([answer[name] for name in names])
        found.append(unit.get(names))
    assert_close(np.array(found), np.array(expected))


def test_tyres_that_saturate(truck: Vehicle, tmp_path: Path) -> None:
    """The FMU has its own arc tangent, and sine, cosine and exponential of the compiler."""
    truck = truck.replace({f"{path}.relaxation_length": 0.0 for path in truck.axle_loads()})
    record = simulate(truck, count=1, seed=3)
    signals = [name for name in record.signals if not name.startswith("roll_rate")]
    observer = Observer(truck, signals, ObserverSettings(friction=0.3))
    path = export_fmu(observer, tmp_path / "observer.fmu", fmi=3, platforms=["x86_64-linux"])
    with Unit(path, tmp_path / "unpacked") as unit:
        assert_pushed(unit, observer, record)


def test_short_steps_give_a_sample_each_sample_time(
    observer: Observer, observers: Mapping[int, Path], tmp_path: Path
) -> None:
    """Steps of 4 ms and a sample time of 10 ms: every third step is a sample."""
    record = simulate(observer.vehicle, count=1, seed=3, rate=250.0)
    with Unit(observers[3], tmp_path, {"sample_time": 0.01}) as unit:
        assert_pushed(unit, observer, record, step=0.004, every=3)


@pytest.mark.parametrize("fmi", VERSIONS)
def test_a_stored_state_continues_equally(
    fmi: int, truck: Vehicle, trucks: Mapping[int, Path], observers: Mapping[int, Path], tmp_path: Path
) -> None:
    for path, outputs in ((trucks[fmi], default_outputs(truck)), (observers[fmi], ["sideslip.semitrailer", "nis"])):
        with Unit(path, tmp_path) as unit:
            runs = []
            unit.set({"speed": 20.0, STEER: 0.02})
            for _ in range(20):
                unit.step(0.01)
            state, time = unit.state(), unit.time
            for continued in (state, unit.copied(state)):
                unit.restore(continued, time)
                for _ in range(30):
                    unit.step(0.01)
                runs.append(unit.get(outputs))
            assert runs[0] == runs[1]
            assert not np.isnan(runs[0]).any()


def test_instances_are_independent_and_reset_begins_anew(
    truck: Vehicle, trucks: Mapping[int, Path], inputs: dict[str, np.ndarray], tmp_path: Path
) -> None:
    steps = np.full(50, 0.01)
    names = default_outputs(truck)
    with Unit(trucks[3], tmp_path / "a") as first, Unit(trucks[3], tmp_path / "b") as second:
        for k in range(50):
            for unit, sign in ((first, 1.0), (second, -1.0)):
                unit.set({"speed": 20.0, STEER: sign * inputs[STEER][k]})
                unit.step(0.01)
        assert first.get(names) == [-value for value in second.get(names)]
        before = first.get(names)
        first.slave.reset()
        first.begin({})
        assert set(first.get(["yaw_rate.tractor", "roll.semitrailer"])) == {0.0}
        columns = {"speed": np.full(50, 20.0), STEER: inputs[STEER]}
        assert run(first, truck, steps, columns)[-1].tolist() == before


@pytest.mark.parametrize("fmi", VERSIONS)
@pytest.mark.parametrize(
    ("values", "step", "time", "message"),
    [
        ({STEER: np.nan}, 0.01, 0.0, "steer.tractor.front: expected -1.2 to 1.2 rad; connect it"),
        ({"speed": 0.0}, 0.01, 0.0, "speed: expected 0.1 to 60 m/s"),
        ({STIFFNESS: -1.0}, 0.01, 0.0, f"{STIFFNESS}: expected 159125 to 1.0184e+07 N/rad"),
        ({}, 0.0, 0.0, "communicationStepSize: expected a number above 0 s"),
        ({}, 1e6, 0.0, "communicationStepSize: the model needs too many steps"),
        ({}, 0.01, 0.5, "currentCommunicationPoint: expected the end of the last step"),
        ({"yaw_rate.tractor": 1.0}, 0.01, 0.0, "neither an input nor a parameter"),
    ],
)
def test_errors_are_named_and_change_nothing(
    fmi: int,
    values: dict[str, float],
    step: float,
    time: float,
    message: str,
    trucks: Mapping[int, Path],
    tmp_path: Path,
) -> None:
    from fmpy.fmi1 import FMICallException

    good = {"speed": 20.0, STEER: 0.01}
    outputs = ["yaw_rate.tractor", "roll.semitrailer"]
    with Unit(trucks[fmi], tmp_path) as unit:
        state = unit.state()
        with pytest.raises(FMICallException, match="error"):
            unit.step(step, time, values)
        assert message in unit.messages[-1]
        unit.set(good)
        unit.step(0.01, 0.0)
        after = unit.get(outputs)
        unit.restore(state, 0.0)
        unit.set(good)
        unit.step(0.01, 0.0)
        assert unit.get(outputs) == after


@pytest.mark.parametrize("fmi", VERSIONS)
def test_an_importer_that_expects_more_is_refused(fmi: int, observers: Mapping[int, Path], tmp_path: Path) -> None:
    from fmpy.fmi1 import FMICallException

    with Unit(observers[fmi], tmp_path) as unit:
        with pytest.raises(FMICallException):
            unit.slave.getBoolean([1])
        assert "not part of this FMU" in unit.messages[-1]
        with pytest.raises(FMICallException):
            unit.set({"sample_time": 0.02})
        assert "fixed parameter: cannot change" in unit.messages[-1]
        component, unit.slave.guid = unit.slave.component, "{00000000-0000-0000-0000-000000000000}"
        with pytest.raises(Exception, match="Failed to instantiate"):
            unit.slave.instantiate()
        unit.slave.component = component


@pytest.mark.skipif(shutil.which("gcc") is None, reason="no gcc")
@pytest.mark.parametrize("fmi", VERSIONS)
def test_functions_have_the_types_of_the_standard(fmi: int, trucks: Mapping[int, Path], tmp_path: Path) -> None:
    """The compiler compares them with the headers of the standard."""
    import fmpy

    headers = Path(fmpy.__file__).parent / "c-code"
    with zipfile.ZipFile(trucks[fmi]) as archive:
        archive.extractall(tmp_path)
    strict = ["gcc", "-std=c99", "-fsyntax-only", "-Wall", "-Werror", "-Wmissing-prototypes", f"-I{headers}"]
    command = [*strict, "-include", f"fmi{fmi}Functions.h", f"fmi{fmi}.c"]
    done = subprocess.run(command, cwd=tmp_path / "sources", capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[:2000]


@pytest.mark.skipif(shutil.which("gcc") is None, reason="no gcc")
def test_an_importer_compiles_the_sources(
    truck: Vehicle, trucks: Mapping[int, Path], inputs: dict[str, np.ndarray], tmp_path: Path
) -> None:
    from fmpy.build import build_platform_binary

    place = tmp_path / "unit"
    with zipfile.ZipFile(trucks[3]) as archive:
        archive.extractall(place)
    shutil.rmtree(place / "binaries")
    (tmp_path / "build").mkdir()
    build_platform_binary(place, build_dir=tmp_path / "build")
    path = tmp_path / "compiled.fmu"
    with zipfile.ZipFile(path, "w") as archive:
        for file in place.rglob("*"):
            archive.write(file, file.relative_to(place))
    steps = np.full(50, 0.01)
    with Unit(path, tmp_path / "own") as unit:
        assert_close(run(unit, truck, steps, inputs), held_response(truck, steps, inputs))


def test_the_libraries_need_no_c_library(trucks: Mapping[int, Path]) -> None:
    """For Windows only kernel32.dll; for Linux no library at all: calloc and free are in every process."""
    with zipfile.ZipFile(trucks[3]) as archive:
        windows, linux = (
            archive.read(f"binaries/x86_64-{name}/cheng_cebon_2011_truck.{suffix}")
            for name, suffix in (("windows", "dll"), ("linux", "so"))
        )
    assert windows[:2] == b"MZ"
    assert b"\0fmi3DoStep\0" in windows
    needed = {name.lower() for name in re.findall(rb"[\w-]+\.dll", windows, re.IGNORECASE)}
    assert needed <= {b"kernel32.dll", b"cheng_cebon_2011_truck.dll"}
    assert b"libc.so" not in linux
    assert b"GLIBC" not in linux
