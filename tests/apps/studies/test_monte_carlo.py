"""Studies: the table, equal results for equal seeds, and what an interrupt or a kill leaves."""

import os
import signal
import subprocess
import sys
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from pyarrow import parquet

from fifthwheel.apps.cheng_cebon_2011 import TwoStage
from fifthwheel.apps.studies import Estimates, Identified, Learned, SimulatedRun, StatesOf, exact_guess, observer, study
from fifthwheel.apps.studies.estimators import as_estimator
from fifthwheel.apps.studies.monte_carlo import _rms_errors
from fifthwheel.apps.studies.result_table import COLUMNS, ResultTable, RunName
from fifthwheel.apps.studies.scenarios import simulated
from fifthwheel.base.errors import FifthwheelError, SignalError
from fifthwheel.data.record import Record
from fifthwheel.estimate.identify import OneStage
from fifthwheel.estimate.observe import Observer
from fifthwheel.estimate.online import Learner, LearnerSettings
from fifthwheel.model.plant import Sensor, article_sensors
from fifthwheel.truck import Vehicle, get
from tests.test_architecture import SOURCE

TRUCK = "cheng_cebon_2011"
STIFFNESS = "semitrailer.cornering_stiffness"
SHORT = {"short": SimulatedRun(manoeuvre="sweep", duration=2.0)}


@dataclass(frozen=True)
class Value:
    name: str = STIFFNESS
    value: float = 1.0
    sigma: float | None = None
    verdict: str = "guess"


@dataclass
class MeanYawRate:
    """An own estimator: the parameter is a mean of the noisy signal, the state is the signal itself."""

    factor: float = 1.0

    def __call__(self, record: Record, vehicle: Vehicle, /) -> Estimates:
        assert not record.reference
        yaw_rate = record.signals["yaw_rate.tractor"]
        value = Value(value=self.factor * float(np.mean(yaw_rate)))
        initial = Value(name="tractor.yaw_inertia", value=vehicle.parameters()["tractor.yaw_inertia"])
        return Estimates(parameters=(value, initial), states={"yaw_rate.tractor": yaw_rate, "other": yaw_rate})


class Counting(MeanYawRate):
    """Counts its calls."""

    calls = 0

    def __call__(self, record: Record, vehicle: Vehicle, /) -> Estimates:
        Counting.calls += 1
        return super().__call__(record, vehicle)


def run(out: Path, estimators=None, **options) -> pa.Table:
    options = {"manoeuvres": SHORT, "seeds": range(2), "jobs": 1} | options
    return study([TRUCK], estimators or {"own": MeanYawRate()}, out, **options)


def without_time(table: pa.Table) -> list[dict]:
    return table.drop_columns(["seconds"]).to_pylist()


def test_a_row_for_each_run_and_parameter(tmp_path: Path) -> None:
    out = tmp_path / "new" / "study.parquet"
    noisy = {"yaw_rate.tractor": Sensor(variance=4e-6), "speed": Sensor(), "steer.tractor.front": Sensor()}
    table = run(out, sensors={"article": None, "noisy": noisy})
    assert table.column_names == [*COLUMNS, "rms.yaw_rate.tractor"]
    assert table.num_rows == 2 * 2 * 2  # sensors, seeds, parameters
    assert parquet.read_table(out).to_pylist() == table.to_pylist()
    assert [path.name for path in out.parent.iterdir()] == [out.name]
    rows = table.to_pylist()
    truth = get(TRUCK).parameters()
    assert {row["truth"] for row in rows if row["parameter"] == STIFFNESS} == {truth[STIFFNESS]}
    assert {row["unit"] for row in rows} == {"N/rad", "kg m^2"}
    assert all(row["truth_low"] == row["truth_high"] == row["truth"] for row in rows)
    rms = {row["sensors"]: row["rms.yaw_rate.tractor"] for row in rows}
    assert rms["noisy"] == pytest.approx(2e-3, rel=0.15)  # the standard deviation of its noise
    assert rms["article"] == pytest.approx(article_sensors(get(TRUCK))["yaw_rate.tractor"].variance ** 0.5, rel=0.15)


def test_initial_values_are_drawn_by_the_seed(tmp_path: Path) -> None:
    true = get(TRUCK).parameters()[STIFFNESS]

    class Initial:
        def __call__(self, record: Record, vehicle: Vehicle, /) -> Estimates:
            return Estimates(parameters=(Value(value=vehicle.parameters()[STIFFNESS]),))

    drawn = run(tmp_path / "a.parquet", {"own": Initial()}, seeds=range(8)).column("estimate").to_pylist()
    assert {round(value / true, 9) for value in drawn} == {0.8, 1.2}
    exact = run(tmp_path / "b.parquet", {"own": Initial()}, guess=exact_guess).column("estimate").to_pylist()
    assert set(exact) == {true}


@pytest.mark.slow
def test_equal_seeds_give_equal_tables_in_any_number_of_processes_and_on_a_cluster(tmp_path: Path) -> None:
    distributed = pytest.importorskip("distributed")
    one, two = (run(tmp_path / f"{jobs}.parquet", jobs=jobs) for jobs in (1, 2))
    with distributed.LocalCluster(2, threads_per_worker=1, host="127.0.0.1", dashboard_address=":0") as workers:
        cluster = run(tmp_path / "cluster.parquet", scheduler=workers.scheduler_address)
    assert without_time(one) == without_time(two) == without_time(cluster)
    assert len({row["estimate"] for row in one.to_pylist() if row["parameter"] == STIFFNESS}) == 2


def test_runs_are_added_and_not_repeated(tmp_path: Path) -> None:
    out = tmp_path / "study.parquet"
    Counting.calls = 0
    first = run(out, {"own": Counting()})
    assert Counting.calls == 2
    more = run(out, {"own": Counting()}, seeds=range(4))
    assert Counting.calls == 4
    assert without_time(more)[:4] == without_time(first)
    changed = run(out, {"own": Counting(factor=2.0)}, seeds=range(1))
    assert Counting.calls == 5
    assert changed.num_rows == more.num_rows  # replaces the run of this name
    assert changed.to_pylist()[0]["estimate"] == 2 * more.to_pylist()[0]["estimate"]
    run(out, {"own": Counting(factor=2.0)}, seeds=range(1), manoeuvres={"short": replace(SHORT["short"], speed=20.0)})
    assert Counting.calls == 6


def test_a_failed_run_is_a_row(tmp_path: Path) -> None:
    class Failing:
        def __call__(self, record: Record, vehicle: Vehicle, /) -> Estimates:
            raise SignalError("yaw_rate.tractor: too noisy")

    table = run(tmp_path / "study.parquet", {"failing": Failing(), "own": MeanYawRate()}, seeds=[7])
    failed, *others = table.to_pylist()
    assert (failed["parameter"], failed["error"], failed["estimate"]) == ("", "yaw_rate.tractor: too noisy", None)
    assert all(row["error"] == "" for row in others)


class Killed(MeanYawRate):
    def __call__(self, record: Record, vehicle: Vehicle, /) -> Estimates:
        if vehicle.parameters()[STIFFNESS] > get(TRUCK).parameters()[STIFFNESS]:
            os.kill(os.getpid(), signal.SIGKILL)
        return super().__call__(record, vehicle)


@pytest.mark.slow
def test_a_worker_that_is_killed(tmp_path: Path) -> None:
    with pytest.raises(FifthwheelError, match="its process ended 3 times"):
        run(tmp_path / "a.parquet", {"own": Killed()}, seeds=range(6), jobs=2)
    assert (tmp_path / "a.parquet").exists()


def test_an_interrupt_keeps_finished_runs(tmp_path: Path) -> None:
    out = tmp_path / "study.parquet"

    def interrupt(title: str, done: int, total: int) -> None:
        if (title, done) == ("estimating", 1):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run(out, progress=interrupt)
    assert len(set(parquet.read_table(out).column("seed").to_pylist())) == 1
    assert without_time(run(out)) == without_time(run(tmp_path / "whole.parquet"))


KILLED = """
import os, time
from pathlib import Path
from tests.apps.studies.test_monte_carlo import MeanYawRate, run

class Slow(MeanYawRate):
    def __call__(self, record, vehicle, /):
        if Path("second").exists():
            print("ready", flush=True)
            time.sleep(60)
        Path("second").touch()
        return super().__call__(record, vehicle)

run(Path("study.parquet"), {"own": Slow()})
"""


@pytest.mark.slow
def test_a_kill_loses_only_the_runs_in_progress(tmp_path: Path) -> None:
    paths = {"PYTHONPATH": os.pathsep.join([str(SOURCE.parent), str(Path(__file__).parents[3])])}
    process = subprocess.Popen(
        [sys.executable, "-c", KILLED], cwd=tmp_path, env=os.environ | paths, stdout=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "ready\n"
    process.send_signal(signal.SIGKILL)
    process.communicate(timeout=10)
    out = tmp_path / "study.parquet"
    assert not out.exists()
    assert list(ResultTable(out).runs) == [RunName(TRUCK, "short", "article", "own", 0)]
    table = run(out, {"new": MeanYawRate()}, seeds=[5])
    assert set(table.column("estimator").to_pylist()) == {"own", "new"}
    assert sorted(path.name for path in tmp_path.iterdir()) == ["second", "study.parquet"]


def test_a_torn_line_of_the_journal_is_left_out(tmp_path: Path) -> None:
    table = ResultTable(tmp_path / "t.parquet")
    names = [RunName("truck", "turn", "all", "own", seed) for seed in range(3)]
    for name in names:
        table.add(name, [{**name._asdict(), "digest": "1", "estimate": 0.1}])
    table.journal.write_bytes(table.journal.read_bytes()[:-20])
    again = ResultTable(tmp_path / "t.parquet")
    assert list(again.runs) == names[:2]
    again.add(names[2], [{**names[2]._asdict(), "digest": "2", "estimate": 0.2}])
    again.save()
    saved = ResultTable(tmp_path / "t.parquet")
    assert [saved.done(name, digest) for name, digest in zip(names, "112", strict=True)] == [True] * 3
    assert not saved.done(names[0], "2")
    assert not table.journal.exists()


def test_what_a_study_refuses(tmp_path: Path) -> None:
    """A table in use, another file, what is no estimator, and one that another process cannot import."""
    out = tmp_path / "study.parquet"
    with pytest.raises(FifthwheelError, match="in use"):
        run(out, progress=lambda *_: run(out))
    parquet.write_table(pa.table({"time": [0.0]}), tmp_path / "log.parquet")
    with pytest.raises(FifthwheelError, match="not the table of a study"):
        run(tmp_path / "log.parquet")
    assert parquet.read_table(tmp_path / "log.parquet").column_names == ["time"]
    with pytest.raises(FifthwheelError, match="expected OneStage"):
        study([TRUCK], {"own": 3}, "unused.parquet")  # type: ignore[dict-item]
    with pytest.raises(FifthwheelError, match="jobs=1"):
        run(out, {"own": lambda record, vehicle: Estimates()}, jobs=2)


def test_states_of_a_known_truck_equal_the_observer(tmp_path: Path) -> None:
    table = run(tmp_path / "study.parquet", {"kalman": StatesOf(observer)}, guess=exact_guess, seeds=[3])
    assert table.column("parameter").to_pylist() == [""]
    record = simulated(get(TRUCK), SHORT["short"]).record(3)
    states = Observer(get(TRUCK), record.signals).batch(replace(record, reference={})).values
    error = states["sideslip.semitrailer"] - record.reference["sideslip.semitrailer"]
    assert table.column("rms.sideslip.semitrailer")[0].as_py() == pytest.approx(np.sqrt(np.nanmean(error**2)))


@pytest.mark.slow
def test_settings_are_estimators(tmp_path: Path) -> None:
    """A learner as a study calls it equals a learner that gets the record."""
    five = OneStage(given={"others": "exact", "sensors": "exact"}, tyres="linear")  # quickly compiled
    table = run(tmp_path / "study.parquet", {"recursive": Learned(settings=five)}, guess=exact_guess, seeds=[3])
    record = simulated(get(TRUCK), SHORT["short"]).record(3)
    learner = Learner(get(TRUCK), record.signals, five)
    learner.learn(record)
    expected = {p.name: p.value for p in learner.parameters}
    assert dict(zip(table["parameter"].to_pylist(), table["estimate"].to_pylist(), strict=True)) == expected
    assert table["rms.sideslip.semitrailer"][0].as_py() > 0
    assert as_estimator(TwoStage()) == Identified(TwoStage())
    assert as_estimator(LearnerSettings(hold=0.1)) == Learned(OneStage(), LearnerSettings(hold=0.1))


def test_a_filter_that_gives_up_has_no_rms():
    """NaN is not left out of an rms error, and a state of a wrong length is an error of its run."""
    time = np.arange(0.0, 1.0, 0.01)
    record = Record(time=time, signals={"speed": 20 + 0 * time}, reference={"roll.tractor": 0.01 * time})
    settled, missing = time >= 0.1, np.where(time < 0.9, 0.0, np.nan)
    rms, error = _rms_errors(record, {"roll.tractor": np.where(time < 0.98, 0.0, np.nan)}, settled)
    assert rms["roll.tractor"] == pytest.approx(0.01 * np.sqrt(np.mean(time[10:98] ** 2)))
    assert not error
    for values, text in ((missing, "no estimate in 11 % of the samples"), (time[:3], "expected 100 values")):
        rms, error = _rms_errors(record, {"roll.tractor": values}, settled)
        assert not rms
        assert text in error
