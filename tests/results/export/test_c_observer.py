"""The exported observer in C against `Observer.push`, sample by sample, with faults of the signals."""

import contextlib
import shutil
import subprocess
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pytest

from fifthwheel import truck as vehicle
from fifthwheel.base.errors import FifthwheelError, SignalError
from fifthwheel.data.logs import write_record
from fifthwheel.data.record import Record
from fifthwheel.data.record.derived import article_gyro_variance
from fifthwheel.estimate.observe import Observer, ObserverSettings, Status
from fifthwheel.model.simulate import simulate
from fifthwheel.results.export import FILES, c_text, export_c
from fifthwheel.truck import Vehicle
from tests.model.dynamics.test_steering import lag
from tests.model.dynamics.test_tyres import brush

COMPILER = shutil.which("gcc") or shutil.which("clang") or shutil.which("cc")
pytestmark = pytest.mark.skipif(COMPILER is None, reason="no C compiler")
STRICT = ("-std=c99", "-Wall", "-Wextra", "-Wconversion", "-pedantic", "-Werror")
STEER = "steer.tractor.front"
ACCELERATION = "lateral_acceleration.tractor"
ERRORS = {f"{STEER}.offset": 0.002, f"{STEER}.gain": 1.03, f"{STEER}.delay": 0.04, "yaw_rate.tractor.offset": 0.001}
SETTINGS = {
    "plain": ObserverSettings(),
    "eager": ObserverSettings(
        sensor_errors=ERRORS,
        bank_mean=0.02,
        hold=0.05,
        max_gap=0.2,
        coast=0.1,
        gate=2.0,
        restart_after=0.0,
        min_speed=24.3,
    ),
    "bank": ObserverSettings(bank=0.04, bank_mean=0.01, estimate_bank=True, steer_offset=0.001),
    "own tyre law": ObserverSettings(friction=0.5, tyres=brush),
}
"""The own law has the sign function, which derivatives of abs have; "eager" also has errors of sensors."""
TOLERANCE = {"double": 1e-12, "float": 1e-4}
AMPLIFIED = {"reversed_steer": 5.0, "slow": 3.0}
"""Factor of the tolerance for a fault with which the filter starts again and again, which amplifies rounding: with
"slow" to 9e-13 on one processor."""
OF_BANK = 2.0
"""The same where the bank is estimated: small differences of the motion determine it (1e-14 rad of 0.01 rad)."""


OWN = {"lag": "0.2 s", "roll_steer": "0.1"}


def lag_and_roll_steer(steer, states, motion, p):
    wheels, rates = lag(steer, states, motion, p)
    return wheels | {"steer.semitrailer.rear": p["roll_steer"] * motion["roll.semitrailer"]}, rates


def compiled(observer: Observer, folder: Path, *flags: str, compiler: str | None = COMPILER) -> Path:
    """The replay program of an exported observer, which has all files."""
    assert [path.name for path in export_c(observer, folder)] == [*FILES] == sorted(FILES, key=FILES.index)
    assert compiler
    command = [compiler, *STRICT, *flags, "fw_observer.c", "replay.c", "-lm", "-o", "replay"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[:2000]
    assert not done.stderr
    return folder / "replay"


def replayed(program: Path, observer: Observer, record: Record) -> np.ndarray:
    """[time, status, nis, states, sigmas] of each sample that the program accepts."""
    columns = [record.time, *[record.signals[name] for name in (*observer.inputs, *observer.outputs)]]
    lines = "\n".join(",".join(map(repr, row)) for row in np.column_stack(columns).tolist())
    done = subprocess.run([program], input=lines, capture_output=True, text=True, check=True)
    return numbers(done.stdout, observer)


def numbers(text: str, observer: Observer) -> np.ndarray:
    """The rows below the names of the columns."""
    names, *rows = [line.split(",") for line in text.splitlines()]
    assert names == ["time", "status", "nis", *observer.reported, *[f"{n}.sigma" for n in observer.reported]]
    return np.array(rows, dtype=float)


def pushed(observer: Observer, record: Record) -> np.ndarray:
    """The same by `push`; samples that it refuses are left out."""
    observer.reset()
    names = [*observer.reported, *[f"{name}.sigma" for name in observer.reported]]
    rows = []
    for k, time in enumerate(record.time.tolist()):
        sample = {"time": time} | {name: values[k] for name, values in record.signals.items()}
        answer = observer.push(sample)
        rows.append([answer["time"], answer["status"], answer["nis"], *[answer[name] for name in names]])
    return np.array(rows)


def assert_equal(actual: np.ndarray, expected: np.ndarray, tolerance: float) -> None:
    """Equal times and statuses; values within a fraction of the range of their column."""
    assert actual.shape == expected.shape
    assert (actual[:, :2] == expected[:, :2]).all()
    assert (np.isnan(actual) == np.isnan(expected)).all()
    span = np.nanmax(np.abs(expected[:, 2:]), axis=0)
    assert (np.nanmax(np.abs(actual - expected)[:, 2:], axis=0) <= tolerance * span).all()


Fault = Callable[[np.ndarray, dict[str, np.ndarray]], np.ndarray]


def missing_measurements(time: np.ndarray, signals: dict[str, np.ndarray]) -> np.ndarray:
    signals["yaw_rate.tractor"][100:130] = np.nan
    for name in signals:
        if name != "speed" and not name.startswith("steer"):
            signals[name][300:450] = np.nan
    return time


def missing_inputs(time: np.ndarray, signals: dict[str, np.ndarray]) -> np.ndarray:
    signals[STEER][50:60] = np.nan
    signals["speed"][200:330] = np.nan
    return time


def spikes(time: np.ndarray, signals: dict[str, np.ndarray]) -> np.ndarray:
    for k, value in enumerate((0.6, 10.0, -1e30, 1e300, -1e300, np.nan)):
        signals[STEER][40 + 60 * k] = value
        signals["yaw_rate.semitrailer"][70 + 60 * k] = value
    signals["speed"][[100, 101, 250]] = 0.0, 500.0, -3.0
    return time


def gaps(time: np.ndarray, signals: dict[str, np.ndarray]) -> np.ndarray:
    return time + 0.3 * (np.arange(len(time)) > 150) + 0.9 * (np.arange(len(time)) > 300)


def outages(time: np.ndarray, signals: dict[str, np.ndarray]) -> np.ndarray:
    return time + 30.0 * (np.arange(len(time)) > 200)


def uneven(time: np.ndarray, signals: dict[str, np.ndarray]) -> np.ndarray:
    return time + np.random.default_rng(0).uniform(0, 0.009, len(time))


def slow(time: np.ndarray, signals: dict[str, np.ndarray]) -> np.ndarray:
    signals["speed"][:] *= np.interp(np.arange(len(time)), [100, 250, 400], [1.0, 0.1, 1.0])
    return time


def reversed_steer(time: np.ndarray, signals: dict[str, np.ndarray]) -> np.ndarray:
    signals[STEER][:] *= -1.0
    return time


FAULTS: Mapping[str, Fault] = {
    fault.__name__: fault
    for fault in (missing_measurements, missing_inputs, spikes, gaps, outages, uneven, slow, reversed_steer)
}


def with_fault(record: Record, fault: str) -> Record:
    """The record with a fault; values that are not finite stand for missing samples."""
    signals = {name: np.array(values) for name, values in record.signals.items()}
    return Record(time=FAULTS[fault](np.array(record.time), signals), signals=signals, name=fault)


@pytest.fixture(scope="module")
def truck() -> Vehicle:
    """With 8 states: without relaxation lengths."""
    truck = vehicle.get("cheng_cebon_2011")
    return truck.replace({f"{path}.relaxation_length": 0.0 for path in truck.axle_loads()})


@pytest.fixture(scope="module")
def lane(truck: Vehicle) -> Record:
    """A lane change of 5.7 s."""
    return simulate(truck, count=1, seed=3)


Exported = tuple[Observer, Path]
"""An observer and its program in double precision."""


@pytest.fixture(scope="module")
def plain(truck: Vehicle, lane: Record, tmp_path_factory: pytest.TempPathFactory) -> Exported:
    observer = Observer(truck, lane.signals)
    return observer, compiled(observer, tmp_path_factory.mktemp("c"))


@pytest.fixture(params=SETTINGS)
def program(request: pytest.FixtureRequest, plain: Exported, truck: Vehicle, lane: Record, tmp_path: Path) -> Exported:
    if request.param == "plain":
        return plain
    observer = Observer(truck, lane.signals, SETTINGS[request.param])
    return observer, compiled(observer, tmp_path)


@pytest.mark.slow
def test_every_fault_gives_what_push_gives(program: Exported, lane: Record) -> None:
    (observer, replay), seen = program, set()
    plain, estimates_bank = observer.settings == SETTINGS["plain"], observer.settings.estimate_bank
    for fault in FAULTS if plain else ("missing_measurements", "missing_inputs", "spikes", "slow", "reversed_steer"):
        record = with_fault(lane, fault)
        expected = pushed(observer, record)
        tolerance = TOLERANCE["double"] * AMPLIFIED.get(fault, 1.0) * (OF_BANK if estimates_bank else 1.0)
        assert_equal(replayed(replay, observer, record), expected, tolerance)
        seen |= set(expected[:, 1].tolist())
    assert {Status.OK, Status.INPUT_MISSING, Status.TOO_SLOW} <= seen
    assert seen & {Status.COASTING, Status.INCONSISTENT}


@pytest.mark.slow
def test_own_equations_of_the_steering(truck: Vehicle, tmp_path: Path) -> None:
    """A lag of the front axle and roll steer of the trailer; the C code starts at their steady state, too.

    An accelerometer and its offset are among the signals.
    """
    lane = simulate(
        truck, count=1, seed=1, sensors=article_gyro_variance(["tractor", "semitrailer"]) | {ACCELERATION: 0.01}
    )
    own = truck.with_logged_steering([STEER], "the lane change")
    own = own.with_steering(lag_and_roll_steer, states={"actuator.tractor": "0.01 rad"}, parameters=OWN)
    settings = ObserverSettings(tyres="saturating", friction=0.5, sensor_errors={f"{ACCELERATION}.offset": 0.1})
    observer = Observer(own, lane.signals, settings)
    assert ACCELERATION in observer.outputs
    assert "actuator.tractor" in observer.reported
    replay = compiled(observer, tmp_path)
    for record in (lane, with_fault(lane, "missing_inputs"), with_fault(lane, "outages")):
        assert_equal(replayed(replay, observer, record), pushed(observer, record), TOLERANCE["double"])


@pytest.mark.slow
def test_single_precision(truck: Vehicle, lane: Record, tmp_path: Path) -> None:
    observer = Observer(truck, lane.signals)
    replay = compiled(observer, tmp_path, "-DFW_FLOAT")
    for fault in ("gaps", "missing_inputs", "spikes"):
        record = with_fault(lane, fault)
        assert_equal(replayed(replay, observer, record), pushed(observer, record), TOLERANCE["float"])


@pytest.mark.parametrize("model", ["yaw only", pytest.param("relaxation lengths", marks=pytest.mark.slow)])
def test_other_models(model: str, truck: Vehicle, tmp_path: Path) -> None:
    train = truck if model == "yaw only" else vehicle.get("cheng_cebon_2011")
    record = simulate(train, count=1, seed=1)
    signals = {n: v for n, v in record.signals.items() if model != "yaw only" or "roll" not in n}
    record = Record(time=record.time, signals=signals, name=model)
    observer = Observer(train, signals)
    assert_equal(replayed(compiled(observer, tmp_path), observer, record), pushed(observer, record), 1e-12)


def test_a_clock_that_was_set_back_is_a_new_start(plain: Exported, lane: Record) -> None:
    observer, replay = plain
    rows = np.column_stack([lane.time, *[lane.signals[name] for name in (*observer.inputs, *observer.outputs)]])[:250]
    rows[20, 0] += 3600.0
    lines = [",".join(map(repr, row)) for row in rows.tolist()]
    done = subprocess.run([replay], input="\n".join(lines), capture_output=True, text=True, check=True)
    observer.reset()
    answers = []
    for row in rows.tolist():
        with contextlib.suppress(SignalError):
            answers.append(observer.push(dict(zip(("time", *observer.inputs, *observer.outputs), row, strict=True))))
    found = np.array([[float(cell) for cell in line.split(",")] for line in done.stdout.splitlines()[-len(answers) :]])
    assert done.stderr.count("time is not after") == len(rows) - len(answers) > 90
    assert found[:, 0] == pytest.approx([answer["time"] for answer in answers])
    assert found[-1, 1] == answers[-1]["status"]
    observer.reset()


def test_the_program_reads_a_file_with_names(plain: Exported, lane: Record, tmp_path: Path) -> None:
    """In any order, with other columns, units and empty fields; another unit or a missing signal is refused."""
    observer, replay = plain
    write_record(lane, tmp_path / "log.csv")
    text = (tmp_path / "log.csv").read_text()
    done = subprocess.run([replay], input=text, capture_output=True, text=True, check=True)
    assert_equal(numbers(done.stdout, observer), pushed(observer, lane), TOLERANCE["double"])
    for wrong in (text.replace("yaw_rate.tractor [rad/s]", "yaw_rate.tractor [deg/s]"), text.replace("speed", "v")):
        done = subprocess.run([replay], input=wrong, capture_output=True, text=True, check=False)
        assert (done.returncode, done.stdout) == (2, "")
        assert "a signal is missing; expected time [s] speed [m/s]" in done.stderr
    surplus = text.splitlines()[1] + ",1.0\n"
    done = subprocess.run([replay], input=surplus, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "columns; name them in the first line" in done.stderr


def test_the_header_names_the_signals_and_refuses_the_same_name(plain: Exported) -> None:
    folder = plain[1].parent
    header = (folder / "fw_samples.h").read_text()
    assert "FW_INPUT_STEER_TRACTOR_FRONT = 1, /* steer.tractor.front, rad */" in header
    assert "FW_STATE_SIDESLIP_SEMITRAILER" in header
    assert not any("@" in (folder / name).read_text() for name in FILES)
    inputs = dict.fromkeys(("speed", "steer.a.b_c", "steer.a_b.c"), "")
    with pytest.raises(FifthwheelError, match=r"steer\.a\.b_c, steer\.a_b\.c.*rename a unit"):
        c_text.enumerations({"INPUT": inputs})
