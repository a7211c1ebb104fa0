"""Wrong calls of the public names: each gets a FifthwheelError that names the value and has a cure."""

import functools
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
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


WRONG: dict[str, Callable[[], object]] = {
    "identify path": lambda: fw.identify("log.csv", TRUCK),
    "identify list of paths": lambda: fw.identify(["log.csv"], TRUCK),
    "identify DataFrame": lambda: fw.identify(RECORD.to_pandas(), TRUCK),
    "identify list of DataFrame": lambda: fw.identify([RECORD.to_pandas()], TRUCK),
    "identify one record": lambda: fw.identify(RECORD, TRUCK),
    "identify none": lambda: fw.identify([], TRUCK),
    "identify None": lambda: fw.identify(None, TRUCK),
    "identify vehicle str": lambda: fw.identify([RECORD], "truck.toml"),
    "identify vehicle dict": lambda: fw.identify([RECORD], {"mass": 1}),
    "identify vehicle None": lambda: fw.identify([RECORD], None),
    "identify swapped": lambda: fw.identify(TRUCK, [RECORD]),
    "identify settings class": lambda: fw.identify([RECORD], TRUCK, fw.OneStage),
    "identify settings str": lambda: fw.identify([RECORD], TRUCK, "one_stage"),
    "identify settings dict": lambda: fw.identify([RECORD], TRUCK, {"given": {}}),
    "identify settings article fn": lambda: fw.identify([RECORD], TRUCK, fw.article),
    "identify knowledge path": lambda: fw.identify([RECORD], TRUCK, knowledge="k.json"),
    "identify knowledge result": lambda: fw.identify([RECORD], TRUCK, knowledge=result()),
    "identify occasion str": lambda: fw.identify([RECORD], TRUCK, occasion="trailer"),
    "identify validate path": lambda: fw.identify([RECORD], TRUCK, validate="log.csv"),
    "identify validate record": lambda: fw.identify([RECORD], TRUCK, validate=RECORD),
    "identify same twice": lambda: fw.identify([RECORD, RECORD], TRUCK),
    "settings given str": lambda: fw.OneStage(given="tractor.mass"),
    "settings given list": lambda: fw.OneStage(given=["cornering_stiffness"]),
    "settings given None": lambda: fw.OneStage(given={"cornering_stiffness": None}),
    "settings given tuple": lambda: fw.OneStage(given={"cornering_stiffness": (4e5, 4e4)}),
    "settings given nan": lambda: given({"road.friction": float("nan")}),
    "settings given percent nan": lambda: given({"cornering_stiffness": "+- nan %"}),
    "settings given negative": lambda: given({"cornering_stiffness": "+- -30 %"}),
    "settings given no sigma": lambda: given({"cornering_stiffness": "+-"}),
    "settings given 1000 %": lambda: given({"cornering_stiffness": "+- 1000 %"}),
    "settings given typo": lambda: given({"tractor.mas": "exact"}),
    "settings given typo of an end": lambda: given({"cornering_stifness": "+- 10 %"}),
    "settings given typo of a pattern": lambda: given({"tractor.*.cornering_stifness": "+- 10 %"}),
    "settings given typo of a sensor": lambda: given({"yaw_rate.tracktor.gain": "+- 1 %"}),
    "settings given typo of an error": lambda: given({"yaw_rate.tractor.gian": "+- 1 %"}),
    "settings given free typo": lambda: given({"semitrailer.yaw_inerta": "free"}),
    "settings given free mass": lambda: given({"semitrailer.mass": "free"}),
    "settings given free bank": lambda: given({"road.bank": "free"}),
    "settings given exact and free": lambda: given({"*tractor.yaw_inertia": "exact", "tractor.yaw_inertia*": "free"}),
    "settings given one value for many": lambda: given({"cornering_stiffness": "4e5 N/rad"}),
    "settings given no unit": lambda: given({"semitrailer.mass": "33000 +- 1 %"}),
    "settings given wrong unit": lambda: given({"semitrailer.mass": "33 m"}),
    "settings given wrong unit of sigma": lambda: given({"steer.*.delay": "+- 5 deg"}),
    "settings given uncertain group": lambda: fw.OneStage(given={"others": "+- 10 %"}),
    "settings given friction": lambda: given({"road.friction": 75}),
    "settings given road": lambda: given({"road.friction": "damp"}),
    "settings noise typo": lambda: fw.OneStage(noise={"yaw_rate.tracktor": 1e-5, "yaw": 1}),
    "settings noise unit": lambda: fw.identify([RECORD], TRUCK, fw.OneStage(noise={"yaw_rate.tracktor": 1e-5})),
    "settings tyres": lambda: fw.OneStage(tyres="nonlinear"),
    "settings min_speed str": lambda: fw.OneStage(min_speed="30 km/h"),
    "settings iterations": lambda: fw.OneStage(iterations=2.5),
    "two stage passes": lambda: fw.TwoStage(passes=0),
    "two stage Q_p typo": lambda: fw.identify([RECORD], TRUCK, fw.TwoStage(Q_p={"yaw_inerta": 1.0})),
    "two stage Q_x typo": lambda: fw.identify([RECORD], TRUCK, fw.TwoStage(Q_x={"yaw_rate.tracktor": 1e-8})),
    "learner settings": lambda: fw.LearnerSettings(hold=-1),
    "learner discrepancy typo": lambda: fw.Learner(
        TRUCK, RECORD.signals, learner=fw.LearnerSettings(discrepancy={"yaw_rat": 1.0})
    ),
    "learner vehicle": lambda: fw.Learner("truck.toml", RECORD.signals),
    "learner signals str": lambda: fw.Learner(TRUCK, "speed"),
    "learner signals typo": lambda: fw.Learner(TRUCK, ["speed", "yaw_rate.tracktor"]),
    "learner settings cls": lambda: fw.Learner(TRUCK, RECORD.signals, fw.OneStage),
    "learner settings is learner settings": lambda: fw.Learner(TRUCK, RECORD.signals, fw.LearnerSettings()),
    "learner record": lambda: fw.Learner(TRUCK, RECORD),
    "learner sensors": lambda: fw.Learner(TRUCK, RECORD.signals, sensors={"yaw_rate.tracktor": fw.SensorPrior()}),
    "observer vehicle": lambda: fw.Observer("truck.toml", RECORD.signals),
    "observer result": lambda: fw.Observer(result(), RECORD.signals),
    "observer signals str": lambda: fw.Observer(TRUCK, "speed"),
    "observer signals typo": lambda: fw.Observer(TRUCK, ["speed", "steer.tractor.frnt", "yaw_rate.tractor"]),
    "observer settings cls": lambda: fw.Observer(TRUCK, RECORD.signals, fw.ObserverSettings),
    "observer settings OneStage": lambda: fw.Observer(TRUCK, RECORD.signals, fw.OneStage()),
    "observer record": lambda: fw.Observer(TRUCK, RECORD),
    "observer settings friction": lambda: fw.ObserverSettings(friction="dry"),
    "observer settings half_track": lambda: fw.ObserverSettings(half_track=2040),
    "observer settings surroundings": lambda: fw.ObserverSettings(surroundings={"brakes.drive_axle": "50 %"}),
    "observer surroundings typo": lambda: fw.Observer(
        TRUCK, RECORD.signals, fw.ObserverSettings(surroundings={"tyre.shap": 1.0})
    ),
    "observer push": lambda: fw.Observer(TRUCK, RECORD.signals).push({"time": "now"}),
    "observer push dict": lambda: fw.Observer(TRUCK, RECORD.signals).push({"spee": 1}),
    "observer push list": lambda: fw.Observer(TRUCK, RECORD.signals).push([1, 2, 3]),
    "observer push str": lambda: fw.Observer(TRUCK, RECORD.signals).push({"time": 0.0, "speed": "20 m/s"}),
    "observer run path": lambda: fw.Observer(TRUCK, RECORD.signals).batch("log.csv"),
    "observer run DataFrame": lambda: fw.Observer(TRUCK, RECORD.signals).batch(RECORD.to_pandas()),
    "observer run list": lambda: fw.Observer(TRUCK, RECORD.signals).batch([RECORD]),
    "record shape": lambda: fw.Record(time=[0.0, 1.0, 2.0], signals={"speed": [1.0, 2.0]}),
    "record 2d": lambda: fw.Record(time=[0.0, 1.0], signals={"speed": [[1.0, 2.0], [1, 2]]}),
    "record time decreasing": lambda: fw.Record(time=[0.0, -1.0], signals={"speed": [1.0, 2.0]}),
    "record time nan": lambda: fw.Record(time=[0.0, float("nan")], signals={"speed": [1.0, 2.0]}),
    "record text": lambda: fw.Record(time=[0.0, 1.0], signals={"speed": ["a", "b"]}),
    "record complex": lambda: fw.Record(time=[0.0, 1.0], signals={"speed": [1j, 2]}),
    "record signals list": lambda: fw.Record(time=[0.0, 1.0], signals=[1, 2]),
    "record signals frame": lambda: fw.Record(time=[0.0, 1.0], signals=pd.DataFrame({"speed": [1.0, 2.0]})),
    "record time datetime": lambda: fw.Record(time=pd.date_range("2020", periods=2), signals={"speed": [1.0, 2.0]}),
    "record name int": lambda: fw.Record(time=[0.0, 1.0], signals={"speed": [1.0, 2.0]}, name=3),
    "record kmh": lambda: (
        fw.Record(time=[0.0, 1.0], signals={"speed": [80.0, 80.0]})
        and fw.identify(
            [fw.Record(time=RECORD.time, signals={**RECORD.signals, "speed": RECORD.signals["speed"] * 3.6})], TRUCK
        )
    ),
    "record sensors typo": lambda: fw.Record(
        time=[0.0, 1.0], signals={"speed": [1.0, 2.0]}, sensors={"sped": fw.SensorPrior()}
    ),
    "record sensors str": lambda: fw.Record(time=[0.0, 1.0], signals={"speed": [1.0, 2.0]}, sensors={"speed": "good"}),
    "record cut": lambda: RECORD.cut("a", "b"),
    "record with_signals": lambda: RECORD.with_signals({"yaw": RECORD.time}),
    "SensorPrior noise": lambda: fw.SensorPrior(noise=-1),
    "simulate str": lambda: fw.simulate("cheng_cebon_2011"),
    "simulate manoeuvre": lambda: fw.simulate(TRUCK, manoeuvre="lane_change"),
    "simulate count": lambda: fw.simulate(TRUCK, count=0),
    "simulate count float": lambda: fw.simulate(TRUCK, count=1.5),
    "simulate speed neg": lambda: fw.simulate(TRUCK, speed=-20),
    "simulate speed str": lambda: fw.simulate(TRUCK, speed="80 km/h"),
    "simulate speed kmh": lambda: fw.simulate(TRUCK, speed=300.0),
    "simulate rate": lambda: fw.simulate(TRUCK, rate=0),
    "simulate seed": lambda: fw.simulate(TRUCK, seed=-1),
    "simulate seed float": lambda: fw.simulate(TRUCK, seed=0.5),
    "simulate sensors": lambda: fw.simulate(TRUCK, sensors={"yaw_rate.tracktor": 1e-3}),
    "simulate sensors neg": lambda: fw.simulate(TRUCK, sensors={"yaw_rate.tractor": -1e-3}),
    "simulate duration": lambda: fw.simulate(TRUCK, duration=float("nan")),
    "vehicle unknown": lambda: fw.vehicle("cheng"),
    "vehicle path": lambda: fw.vehicle("truck.toml"),
    "vehicle None": lambda: fw.vehicle(None),
    "vehicle replace typo": lambda: TRUCK.replace({"tractor.mas": 1}),
    "vehicle replace str": lambda: TRUCK.replace({"tractor.mass": "7 t"}),
    "vehicle replace nan": lambda: TRUCK.replace({"tractor.mass": float("nan")}),
    "vehicle replace kw": lambda: TRUCK.replace("tractor.mass"),
    "vehicle with_stated neg": lambda: TRUCK.with_stated({"tractor.mass": -1.0}),
    "vehicle with_stated typo": lambda: TRUCK.with_stated({"tractor.mas": 1.0}),
    "vehicle load missing": lambda: fw.Vehicle.load("none.toml"),
    "vehicle unit": lambda: TRUCK.unit("trailer"),
    "read_log missing": lambda: fw.read_log("none.csv"),
    "read_log map path": lambda: fw.read_log("none.csv", "map.toml"),
    "read_log exclude": lambda: fw.read_log("none.csv", exclude=(1, 2)),
    "read_log frame": lambda: fw.read_log(RECORD.to_pandas()),
    "SignalMap parse": lambda: fw.SignalMap.parse("signals=3"),
    "LiveMap": lambda: fw.LiveMap("map.toml", ["a"]),
    "linear_system speed": lambda: fw.linear_system(TRUCK, 0.0),
    "linear_system speed str": lambda: fw.linear_system(TRUCK, "80 km/h"),
    "linear_system outputs": lambda: fw.linear_system(TRUCK, 20.0, ["yaw"]),
    "linear_system vehicle": lambda: fw.linear_system("t", 20.0),
    "summarize": lambda: fw.summarize("t"),
    "summarize speed": lambda: fw.summarize(TRUCK, -3),
    "assess str": lambda: fw.assess("t"),
    "assess speed": lambda: fw.assess(TRUCK, speed=-1, cheap=True),
    "assess body typo": lambda: fw.assess(TRUCK, body={"widht": 2.5}, cheap=True),
    "assess body str": lambda: fw.assess(TRUCK, body={"width": "wide"}, cheap=True),
    "assess changes": lambda: fw.assess(TRUCK, changes={"tractor.mas": 1.0}, cheap=True),
    "assess sigmas": lambda: fw.assess(TRUCK, sigmas={"tractor.mas": 1.0}, cheap=True),
    "assess sigmas neg": lambda: fw.assess(TRUCK, sigmas={"tractor.mass": -1.0}, cheap=True),
    "check_signals path": lambda: fw.check_signals("log.csv"),
    "check_signals vehicle": lambda: fw.check_signals(RECORD, "t"),
    "check_signals frame": lambda: fw.check_signals(RECORD.to_pandas()),
    "predict_sigmas rec": lambda: fw.predict_sigmas(RECORD, TRUCK),
    "predict_sigmas paths": lambda: fw.predict_sigmas(["log.csv"], TRUCK),
    "predict_sigmas TwoStage": lambda: fw.predict_sigmas([RECORD], TRUCK, fw.TwoStage()),
    "design targets typo": lambda: fw.design_experiment(TRUCK, {"semitrailer.yaw_inerta": 0.05}),
    "design targets neg": lambda: fw.design_experiment(TRUCK, {"semitrailer.yaw_inertia": -0.05}),
    "design targets percent": lambda: fw.design_experiment(TRUCK, {"semitrailer.yaw_inertia": "5 %"}),
    "design targets 5": lambda: fw.design_experiment(TRUCK, {"semitrailer.yaw_inertia": 5}),
    "design channels": lambda: fw.design_experiment(TRUCK, channels=["yaw_rate.tracktor"]),
    "design channels str": lambda: fw.design_experiment(TRUCK, channels="yaw_rate.tractor"),
    "design vehicle": lambda: fw.design_experiment("t"),
    "gross_mass path": lambda: fw.gross_mass(["l.csv"], TRUCK),
    "gross_mass record": lambda: fw.gross_mass(RECORD, TRUCK),
    "gross_mass none": lambda: fw.gross_mass([RECORD], TRUCK),
    "with_payload neg": lambda: fw.with_payload(TRUCK, -1.0),
    "with_payload str": lambda: fw.with_payload(TRUCK, "20 t"),
    "with_payload vehicle": lambda: fw.with_payload("t", 1.0),
    "write_record path": lambda: fw.write_record("r", FOLDER / "a.csv"),
    "write_record ext": lambda: fw.write_record(RECORD, FOLDER / "a.xls"),
    "write_report": lambda: fw.write_report(FOLDER / "a", "r", [RECORD], title="t"),
    "write_report recs": lambda: fw.write_report(FOLDER / "a", result(), RECORD, title="t"),
    "export_c": lambda: fw.export_c(TRUCK, FOLDER / "c"),
    "export_fmu": lambda: fw.export_fmu(result(), FOLDER / "c.fmu"),
    "export_fmu fmi": lambda: fw.export_fmu(TRUCK, FOLDER / "c.fmu", fmi=1),
    "export_fmu outputs": lambda: fw.export_fmu(TRUCK, FOLDER / "c.fmu", outputs=["yaw"]),
    "compare records": lambda: fw.compare([RECORD, RECORD]),
    "compare one path": lambda: fw.compare({"a": "out/a", "b": "out/b"}),
    "study trucks": lambda: fw.study(["none"], {"one": fw.OneStage()}, FOLDER / "s"),
    "study trucks str": lambda: fw.study("cheng_cebon_2011", {"one": fw.OneStage()}, FOLDER / "s"),
    "study estimators list": lambda: fw.study(["cheng_cebon_2011"], [fw.OneStage()], FOLDER / "s"),
    "study estimator class": lambda: fw.study(["cheng_cebon_2011"], {"one": fw.OneStage}, FOLDER / "s"),
    "study estimator str": lambda: fw.study(["cheng_cebon_2011"], {"one": "default"}, FOLDER / "s"),
    "study seeds": lambda: fw.study(["cheng_cebon_2011"], {"one": fw.OneStage()}, FOLDER / "s", seeds=3),
    "study seeds float": lambda: fw.study(["cheng_cebon_2011"], {"one": fw.OneStage()}, FOLDER / "s", seeds=[0.5]),
    "study seeds none": lambda: fw.study(["cheng_cebon_2011"], {"one": fw.OneStage()}, FOLDER / "s", seeds=[]),
    "study manoeuvres": lambda: fw.study(
        ["cheng_cebon_2011"], {"one": fw.OneStage()}, FOLDER / "s", manoeuvres=["lane_changes"], seeds=[0]
    ),
    "study sensors": lambda: fw.study(
        ["cheng_cebon_2011"], {"one": fw.OneStage()}, FOLDER / "s", sensors={"a": {"yaw": 1}}, seeds=[0]
    ),
    "study scheduler": lambda: fw.study(
        ["cheng_cebon_2011"], {"one": fw.OneStage()}, FOLDER / "s", scheduler="foo", seeds=[0]
    ),
    "study jobs": lambda: fw.study(["cheng_cebon_2011"], {"one": fw.OneStage()}, FOLDER / "s", jobs=-2, seeds=[0]),
    "SimulatedRun": lambda: fw.SimulatedRun(manoeuvre="slalom"),
    "SimulatedRun model": lambda: fw.SimulatedRun(model="bicycle"),
    "SimulatedRun properties": lambda: fw.SimulatedRun(properties={"friction": 0.5}),
    "Body": lambda: fw.Body(width=-1),
    "Body mm": lambda: fw.Body(width=2550),
    "Occasion date": lambda: fw.Occasion(date="yesterday"),
    "Identification load": lambda: fw.Identification.load("none"),
    "Identification plot": lambda: result().plot("history"),
    "Identification observer": lambda: result().observer("speed"),
    "uncertainty": lambda: fw.Uncertainty(names=("a",), covariance=np.eye(2)),
    "uncertainty indefinite": lambda: fw.Uncertainty(names=("a", "b"), covariance=np.array([[1, 2], [2, 1.0]])),
    "uncertainty nan": lambda: fw.Uncertainty(names=("a",), covariance=np.array([[float("nan")]])),
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
