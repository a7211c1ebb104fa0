"""Wrong calls of the public names: each gets a FifthwheelError that names the value and has a cure."""

import functools
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pytest

import fifthwheel as fw

TRUCK: Any = fw.vehicle("cheng_cebon_2011")
RECORD: Any = fw.simulate(TRUCK, count=1)
FOLDER = Path("out")


@functools.cache
def result() -> Any:
    settings = fw.OneStage(given={"truck": "exact", "tractor.front.cornering_stiffness": "free"}, tyres="linear")
    return fw.identify([RECORD], TRUCK, settings)


def given(statements: Any) -> object:
    return fw.identify([RECORD], TRUCK, fw.OneStage(given=statements))


def study(**changes: Any) -> object:
    given = {"vehicles": ["cheng_cebon_2011"], "estimators": {"one": fw.OneStage()}, "seeds": [0]} | changes
    return fw.study(given.pop("vehicles"), given.pop("estimators"), FOLDER / "s", **given)


def record(**changes: Any) -> object:
    return fw.Record(**{"time": [0.0, 1.0], "signals": {"speed": [1.0, 2.0]}} | changes)


def response(**inputs: Any) -> object:
    given = {"time": [0.0, 0.1, 0.2], "steer": np.zeros(3)} | inputs
    return fw.linear_system(TRUCK, 20.0).response(given["time"], {"steer.tractor.front": given["steer"]})


WRONG: dict[str, Callable[[], object]] = {
    "identify milliseconds": lambda: fw.identify([fw.Record.from_arrays(RECORD.time * 1e3, RECORD.signals)], TRUCK),
    "response decreasing": lambda: response(time=[0.2, 0.1, 0.0]),
    "response uneven": lambda: response(time=[0.0, 0.1, 0.3]),
    "response short": lambda: response(steer=np.zeros(2)),
    "step negative": lambda: fw.linear_system(TRUCK, 20.0).step(-0.01),
    "step nan": lambda: fw.linear_system(TRUCK, 20.0).step(float("nan")),
    "sample negative": lambda: result().posterior.sample(-1),
    "sample fraction": lambda: result().posterior.sample(2.5),
    "export_c onto a file": lambda: fw.export_c(fw.Observer(TRUCK, RECORD.signals), __file__),
    "table of rows": lambda: fw.Record.from_table([[0.0, 1.0]]),
    "table without time": lambda: fw.Record.from_table(pa.table({"speed": [1.0]})),
    "table of texts": lambda: fw.Record.from_table(pa.table({"time": [0.0], "speed": ["fast"]})),
    "identify path": lambda: fw.identify("log.csv", TRUCK),
    "identify DataFrame": lambda: fw.identify(RECORD.to_pandas(), TRUCK),
    "identify one record": lambda: fw.identify(RECORD, TRUCK),
    "identify none": lambda: fw.identify([], TRUCK),
    "identify vehicle str": lambda: fw.identify([RECORD], "truck.toml"),
    "identify swapped": lambda: fw.identify(TRUCK, [RECORD]),
    "identify settings article fn": lambda: fw.identify([RECORD], TRUCK, fw.article),
    "identify knowledge path": lambda: fw.identify([RECORD], TRUCK, knowledge="k.json"),
    "identify knowledge result": lambda: fw.identify([RECORD], TRUCK, knowledge=result()),
    "identify occasion str": lambda: fw.identify([RECORD], TRUCK, occasion="trailer"),
    "identify validate path": lambda: fw.identify([RECORD], TRUCK, validate="log.csv"),
    "identify same twice": lambda: fw.identify([RECORD, RECORD], TRUCK),
    "settings given str": lambda: fw.OneStage(given="tractor.mass"),
    "settings given tuple": lambda: fw.OneStage(given={"cornering_stiffness": (4e5, 4e4)}),
    "settings given nan": lambda: given({"road.friction": float("nan")}),
    "settings given negative": lambda: given({"cornering_stiffness": "+- -30 %"}),
    "settings given typo": lambda: given({"tractor.mas": "exact"}),
    "settings given typo of an end": lambda: given({"cornering_stifness": "+- 10 %"}),
    "settings given typo of a sensor": lambda: given({"yaw_rate.tracktor.gain": "+- 1 %"}),
    "settings given typo of an error": lambda: given({"yaw_rate.tractor.gian": "+- 1 %"}),
    "settings given free mass": lambda: given({"semitrailer.mass": "free"}),
    "settings given exact and free": lambda: given({"*tractor.yaw_inertia": "exact", "tractor.yaw_inertia*": "free"}),
    "settings given one value for many": lambda: given({"cornering_stiffness": "4e5 N/rad"}),
    "settings given no unit": lambda: given({"semitrailer.mass": "33000 +- 1 %"}),
    "settings given wrong unit": lambda: given({"semitrailer.mass": "33 m"}),
    "settings given uncertain group": lambda: fw.OneStage(given={"others": "+- 10 %"}),
    "settings given friction": lambda: given({"road.friction": 75}),
    "settings noise typo": lambda: fw.OneStage(noise={"yaw_rate.tracktor": 1e-5, "yaw": 1}),
    "settings tyres": lambda: fw.OneStage(tyres="nonlinear"),
    "settings min_speed str": lambda: fw.OneStage(min_speed="30 km/h"),
    "two stage passes": lambda: fw.TwoStage(passes=0),
    "two stage Q_p typo": lambda: fw.identify([RECORD], TRUCK, fw.TwoStage(Q_p={"yaw_inerta": 1.0})),
    "learner settings": lambda: fw.LearnerSettings(hold=-1),
    "learner discrepancy typo": lambda: fw.Learner(
        TRUCK, RECORD.signals, learner=fw.LearnerSettings(discrepancy={"yaw_rat": 1.0})
    ),
    "learner settings is learner settings": lambda: fw.Learner(TRUCK, RECORD.signals, fw.LearnerSettings()),
    "learner sensors": lambda: fw.Learner(TRUCK, RECORD.signals, sensors={"yaw_rate.tracktor": fw.SensorPrior()}),
    "observer vehicle": lambda: fw.Observer("truck.toml", RECORD.signals),
    "observer result": lambda: fw.Observer(result(), RECORD.signals),
    "observer signals str": lambda: fw.Observer(TRUCK, "speed"),
    "observer signals typo": lambda: fw.Observer(TRUCK, ["speed", "steer.tractor.frnt", "yaw_rate.tractor"]),
    "observer settings OneStage": lambda: fw.Observer(TRUCK, RECORD.signals, fw.OneStage()),
    "observer record": lambda: fw.Observer(TRUCK, RECORD),
    "observer settings surroundings": lambda: fw.ObserverSettings(surroundings={"brakes.drive_axle": "50 %"}),
    "observer surroundings typo": lambda: fw.Observer(
        TRUCK, RECORD.signals, fw.ObserverSettings(surroundings={"tyre.shap": 1.0})
    ),
    "observer push dict": lambda: fw.Observer(TRUCK, RECORD.signals).push({"spee": 1}),
    "observer push str": lambda: fw.Observer(TRUCK, RECORD.signals).push({"time": 0.0, "speed": "20 m/s"}),
    "observer run DataFrame": lambda: fw.Observer(TRUCK, RECORD.signals).batch(RECORD.to_pandas()),
    "record shape": lambda: record(time=[0.0, 1.0, 2.0]),
    "record text": lambda: record(signals={"speed": ["a", "b"]}),
    "record signals list": lambda: record(signals=[1, 2]),
    "record time datetime": lambda: record(time=pd.date_range("2020", periods=2)),
    "record kmh": lambda: fw.identify([RECORD.with_signals({"speed": RECORD.signals["speed"] * 3.6})], TRUCK),
    "record sensors typo": lambda: record(sensors={"sped": fw.SensorPrior()}),
    "record sensors str": lambda: record(sensors={"speed": "good"}),
    "record cut": lambda: RECORD.cut("a", "b"),
    "record with_signals": lambda: RECORD.with_signals({"yaw": RECORD.time}),
    "SensorPrior noise": lambda: fw.SensorPrior(noise=-1),
    "simulate manoeuvre": lambda: fw.simulate(TRUCK, manoeuvre="lane_change"),
    "simulate count": lambda: fw.simulate(TRUCK, count=0),
    "simulate speed kmh": lambda: fw.simulate(TRUCK, speed=300.0),
    "simulate rate": lambda: fw.simulate(TRUCK, rate=0),
    "simulate sensors": lambda: fw.simulate(TRUCK, sensors={"yaw_rate.tracktor": 1e-3}),
    "vehicle unknown": lambda: fw.vehicle("cheng"),
    "vehicle replace typo": lambda: TRUCK.replace({"tractor.mas": 1}),
    "vehicle replace str": lambda: TRUCK.replace({"tractor.mass": "7 t"}),
    "vehicle with_stated neg": lambda: TRUCK.with_stated({"tractor.mass": -1.0}),
    "vehicle load missing": lambda: fw.Vehicle.load("none.toml"),
    "vehicle unit": lambda: TRUCK.unit("trailer"),
    "read_log missing": lambda: fw.read_log("none.csv"),
    "read_log exclude": lambda: fw.read_log("none.csv", exclude=(1, 2)),
    "SignalMap parse": lambda: fw.SignalMap.parse("signals=3"),
    "LiveMap": lambda: fw.LiveMap("map.toml", ["a"]),
    "linear_system speed": lambda: fw.linear_system(TRUCK, 0.0),
    "linear_system outputs": lambda: fw.linear_system(TRUCK, 20.0, ["yaw"]),
    "summarize speed": lambda: fw.summarize(TRUCK, -3),
    "assess body typo": lambda: fw.assess(TRUCK, body={"widht": 2.5}, cheap=True),
    "assess changes": lambda: fw.assess(TRUCK, changes={"tractor.mas": 1.0}, cheap=True),
    "check_signals frame": lambda: fw.check_signals(RECORD.to_pandas()),
    "predict_sigmas paths": lambda: fw.predict_sigmas(["log.csv"], TRUCK),
    "predict_sigmas TwoStage": lambda: fw.predict_sigmas([RECORD], TRUCK, fw.TwoStage()),
    "design targets typo": lambda: fw.design_experiment(TRUCK, {"semitrailer.yaw_inerta": 0.05}),
    "design channels": lambda: fw.design_experiment(TRUCK, channels=["yaw_rate.tracktor"]),
    "gross_mass none": lambda: fw.gross_mass([RECORD], TRUCK),
    "with_payload neg": lambda: fw.with_payload(TRUCK, -1.0),
    "write_record path": lambda: fw.write_record("r", FOLDER / "a.csv"),
    "write_record ext": lambda: fw.write_record(RECORD, FOLDER / "a.xls"),
    "write_report": lambda: fw.write_report(FOLDER / "a", "r", [RECORD], title="t"),
    "export_c": lambda: fw.export_c(TRUCK, FOLDER / "c"),
    "export_fmu": lambda: fw.export_fmu(result(), FOLDER / "c.fmu"),
    "export_fmu outputs": lambda: fw.export_fmu(TRUCK, FOLDER / "c.fmu", outputs=["yaw"]),
    "compare records": lambda: fw.compare([RECORD, RECORD]),
    "study trucks": lambda: study(vehicles=["none"]),
    "study estimators list": lambda: study(estimators=[fw.OneStage()]),
    "study estimator str": lambda: study(estimators={"one": "default"}),
    "study seeds": lambda: study(seeds=3),
    "study manoeuvres": lambda: study(manoeuvres=["lane_changes"]),
    "study sensors": lambda: study(sensors={"a": {"yaw": 1}}),
    "study scheduler": lambda: study(scheduler="foo"),
    "study jobs": lambda: study(jobs=-2),
    "SimulatedRun": lambda: fw.SimulatedRun(manoeuvre="slalom"),
    "SimulatedRun properties": lambda: fw.SimulatedRun(properties={"friction": 0.5}),
    "Body": lambda: fw.Body(width=-1),
    "Occasion date": lambda: fw.Occasion(date="yesterday"),
    "Identification load": lambda: fw.Identification.load("none"),
    "Identification plot": lambda: result().plot("history"),
    "Identification observer": lambda: result().observer("speed"),
    "uncertainty": lambda: fw.Uncertainty(names=("a",), covariance=np.eye(2)),
    "uncertainty indefinite": lambda: fw.Uncertainty(names=("a", "b"), covariance=np.array([[1, 2], [2, 1.0]])),
    "plot vehicles": lambda: fw.plot.bode("t"),
    "Knowledge": lambda: fw.Knowledge(logs=("a",)),
}


@pytest.mark.parametrize("call", WRONG.values(), ids=list(WRONG))
@pytest.mark.filterwarnings("ignore")
def test_a_wrong_call_is_refused(call: Callable[[], object], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(fw.FifthwheelError) as refused:
        call()
    assert re.search("; ", str(refused.value)), refused.value


def test_the_class_of_settings_is_named() -> None:
    with pytest.raises(
        fw.SignalError, match=r"settings: expected a CommonSettings, got the class OneStage; write OneStage\(\)"
    ):
        fw.identify([RECORD], TRUCK, fw.OneStage)  # type: ignore[arg-type]


def test_an_own_estimator_that_fails_is_a_row(tmp_path: Path) -> None:
    def fails(record: fw.Record, vehicle: fw.Vehicle) -> fw.Estimates:
        raise ZeroDivisionError("by zero")

    def returns_nothing(record: fw.Record, vehicle: fw.Vehicle) -> Any:
        return None

    runs = {"one": fw.SimulatedRun(count=1)}
    estimators = {"fails": fails, "nothing": returns_nothing}
    table = fw.study(["cheng_cebon_2011"], estimators, tmp_path / "s.parquet", manoeuvres=runs, seeds=[0], jobs=1)
    assert table["error"].to_pylist() == [
        "ZeroDivisionError: by zero",
        "nothing, result: expected an Estimates, got NoneType; correct it",
    ]
