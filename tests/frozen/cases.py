"""The cases: a name, and a function that computes results from logs which this package makes or which are present."""

import json
import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

import fifthwheel as fw
from fifthwheel.apps.fleet.trips import log_knowledge
from fifthwheel.apps.workflow.runs import run_identification
from fifthwheel.estimate.identify.knowledge.combination import combine
from fifthwheel.estimate.identify.sensor_errors import log_sensors
from fifthwheel.model.manoeuvres.catalogue import course
from fifthwheel.model.manoeuvres.open_loops import single_sine
from fifthwheel.model.plant import Plant, Properties, Sensor, article_sensors
from fifthwheel.model.plant.properties import with_changes
from tests.apps.fleet.synthetic import Synthetic

ROOT = Path(__file__).parents[2]
DATA = Path(os.environ.get("FIFTHWHEEL_DATA", ROOT.parent / "shared" / "data"))
"""Logs that are not part of the project."""
AUBURN = """
[time]
column = "t"
[signals]
speed = "vx"
"steer.tractor.front" = "steer_ang"
"yaw_rate.tractor" = "yaw_rate"
"articulation.semitrailer" = "hitch"
"yaw_rate.semitrailer" = { sum = ["yaw_rate", "hitch_rate"] }
"lateral_acceleration.tractor" = "imu_accel_y"
[reference]
"lateral_velocity.tractor" = "vy"
"""
TRUCK = fw.vehicle("cheng_cebon_2011")
GUESS = TRUCK.replace(
    {
        name: (0.85 if name.endswith("cornering_stiffness") else 1.15) * value
        for name, value in TRUCK.parameters().items()
        if name.endswith("cornering_stiffness") or name == "semitrailer.yaw_inertia"
    }
)
ACCELEROMETER = "lateral_acceleration.tractor"


@dataclass(frozen=True)
class Case:
    """One case."""

    run: Callable[[], Any]
    """Computes the results: nested data of numbers, texts and arrays."""
    data: str | None = None
    """Folder of `DATA` that it needs."""


CASES: dict[str, Case] = {}


def case(*, data: str | None = None) -> Callable[[Callable[[], Any]], Callable[[], Any]]:
    """Register a case under the name of its function."""

    def register(run: Callable[[], Any]) -> Callable[[], Any]:
        CASES[run.__name__] = Case(run, data)
        return run

    return register


@cache
def lane_changes() -> fw.Record:
    """Two lane changes of the linear truck."""
    return fw.simulate(TRUCK, count=2, seed=7, name="lanes")


@cache
def example() -> fw.Record:
    """Two lane changes of the nonlinear truck."""
    return fw.read_log(ROOT / "examples" / "lane_changes.csv")


@cache
def everyday() -> fw.Record:
    """Everyday driving of the nonlinear truck, with an articulation sensor and an accelerometer."""
    sensors = article_sensors(TRUCK) | {
        "articulation.semitrailer": Sensor(variance=0.002**2, bias=0.004),
        ACCELEROMETER: Sensor(variance=0.05**2, bias=0.1),
    }
    return Plant(TRUCK).drive(course("everyday", TRUCK, seed=3, duration=60.0)).record(sensors, seed=5)


@cache
def sine() -> fw.Record:
    """A single sine near the limit on a wet road."""
    plant = Plant(TRUCK, with_changes(Properties(), {"friction": 0.5}))
    return plant.drive(single_sine(TRUCK, acceleration=3.0)).record(article_sensors(TRUCK), seed=2)


@cache
def combination(name: str) -> fw.Record:
    """A lane change of a long combination, linear."""
    return fw.simulate(fw.vehicle(name), count=1, seed=4, speed=20.0, name=name)


def only(record: fw.Record, *quantities: str) -> fw.Record:
    """The record with speed, steer angles and signals of some quantities."""
    kept = {n: v for n, v in record.signals.items() if n.split(".")[0] in ("speed", "steer", *quantities)}
    return replace(record, signals=kept)


def states_of(states: fw.States) -> dict[str, Any]:
    """Everything in the states of a record."""
    parts = ("values", "sigma", "innovation", "innovation_sigma", "accepted")
    return {"status": states.status, "nis": states.nis} | {part: dict(getattr(states, part)) for part in parts}


def identified(records: list[fw.Record], vehicle: fw.Vehicle, settings: Any = None, **options: Any) -> dict[str, Any]:
    """Everything that `fifthwheel identify` computes."""
    run = run_identification(records, vehicle, settings, **options)
    contents = run.identification.as_dict()
    for part in ("version", "vehicle_file", "initial_vehicle_file", "settings"):
        contents.pop(part)
    return contents | {
        "series": {f"{fit.log}/{fit.signal}": fit.predicted for fit in run.identification.fits},
        "vehicle_parameters": run.identification.vehicle.parameters(),
        "states": {states.name: states_of(states) for states in run.states},
        "conclusion": run.conclusion.as_dict(),
        "remedies": run.outlook and run.outlook.as_dict(),
        "performance": run.performance and run.performance.as_dict(),
    }


# Identification


@case()
def one_stage() -> Any:
    return identified([lane_changes()], GUESS)


@case()
def one_stage_nonlinear() -> Any:
    return identified([example()], fw.Vehicle.load(ROOT / "examples" / "truck.toml"), validate=[sine()])


@case()
def one_stage_everyday() -> Any:
    return identified([everyday()], GUESS)


@case()
def one_stage_saturating() -> Any:
    return identified(
        [sine()], GUESS, fw.OneStage(tyres="saturating", given={"road.friction": 0.6}), validate=[lane_changes()]
    )


@case()
def prediction_error() -> Any:
    return identified([lane_changes()], GUESS, fw.OneStage(form="prediction_error"))


@case()
def exact_file_and_sensors() -> Any:
    return identified([lane_changes()], GUESS, fw.OneStage(given={"others": "exact", "sensors": "exact"}))


@case()
def priors_fixed_and_noise() -> Any:
    settings = fw.OneStage(
        given={
            "others": "exact",
            "tractor.drive.cornering_stiffness": "exact",
            "roll_stiffness": "+- 10 %",
            "tractor.yaw_inertia": "+- 5 %",
            "roll_damping": "+- 20 %",
            "semitrailer.mass": "+- 1 %",
            "yaw_rate.*.delay": "+- 20 ms",
        },
        noise={"yaw_rate.tractor": 4e-6},
        adapt_noise=False,
    )
    return identified([lane_changes(), fw.simulate(TRUCK, count=1, seed=8, name="other")], GUESS, settings)


@case()
def any_load() -> Any:
    return identified([lane_changes()], GUESS, fw.OneStage(uniform_payload=False))


@case()
def without_roll_rates() -> Any:
    return identified([only(lane_changes(), "yaw_rate")], GUESS)


@case()
def other_time_base() -> Any:
    record = everyday()
    bases = {name: "trailer" for name in record.signals if name.endswith("semitrailer")}
    return identified([only(replace(record, time_bases=bases), "yaw_rate", "articulation")], GUESS)


@case()
def full_trailer_without_dolly_gyro() -> Any:
    record = combination("truck_full_trailer")
    kept = {n: v for n, v in record.signals.items() if not n.endswith(".dolly")}
    return identified([replace(record, signals=kept)], fw.vehicle("truck_full_trailer"))


@case()
def two_stage() -> Any:
    return identified([lane_changes()], GUESS, fw.TwoStage(rounds=2))


@case()
def two_stage_nonlinear() -> Any:
    return identified([example()], GUESS, fw.TwoStage())


@case()
def article() -> Any:
    return identified([fw.simulate(TRUCK, count=6, seed=3)], GUESS, fw.article())


@case()
def other_log() -> Any:
    result = fw.identify([lane_changes()], GUESS)
    sensors = log_sensors(result, everyday(), result.vehicle)
    return {"settings": sensors.settings, "uncertainty": sensors.uncertainty and sensors.uncertainty.as_dict()}


@case(data="real_truck")
def real_truck() -> Any:
    signals = fw.SignalMap.parse(AUBURN)
    names = {"bend": "run01_s_bend", "ramp": "run02_exit_ramp"}
    bend, ramp = (fw.read_log(DATA / "real_truck" / f"{f}.csv", signals, name=n) for n, f in names.items())
    return {
        "one stage": summary(identified([bend, ramp], fw.vehicle("auburn_6x4"))),
        "saturating": summary(identified([ramp], fw.vehicle("auburn_6x4"), fw.OneStage(tyres="saturating"))),
        "two stages": summary(identified([bend], fw.vehicle("auburn_6x4"), fw.TwoStage(), validate=[ramp])),
    }


def summary(contents: dict[str, Any]) -> dict[str, Any]:
    """The results of a log of others, without what belongs to single samples."""
    parts = ("parameters", "derived", "uncertain", "sensors", "doubts", "variance_budget", "fit", "logs", "conclusion")
    rms = {
        name: {n: float(np.sqrt(np.nanmean(v**2))) for n, v in {**s["values"], **s["sigma"]}.items()}
        for name, s in contents["states"].items()
    }
    return {part: contents[part] for part in parts} | {"states": rms}


# Sample by sample


@case()
def observer() -> Any:
    return dict(observed(lane_changes(), fw.ObserverSettings()))


@case()
def observer_saturating() -> Any:
    settings = fw.ObserverSettings(
        friction=0.5, surroundings={"brakes.drive_axle": 1.0}, positions={"sideslip.tractor": 1.0}
    )
    return dict(observed(sine(), settings))


@case()
def observer_with_faults() -> Any:
    record = everyday()
    signals = {name: values.copy() for name, values in record.signals.items()}
    signals["yaw_rate.tractor"][500:520] = 3.0
    signals["roll_rate.semitrailer"][1000:1600] = np.nan
    signals["steer.tractor.front"][2000:2030] = np.nan
    signals["speed"][3000:3200] = 1.0
    keep = np.ones(len(record), dtype=bool)
    keep[4000:4200] = False
    faulty = replace(record, time=record.time[keep], signals={n: v[keep] for n, v in signals.items()}, reference={})
    return dict(observed(faulty, fw.ObserverSettings(estimate_bank=True)))


def observed(record: fw.Record, settings: fw.ObserverSettings) -> Iterator[tuple[str, Any]]:
    """States of a record by push, batch and smoother, with and without uncertainty, and the exported C."""
    observer = fw.Observer(TRUCK, record.signals, settings)
    pushed = [observer.push(sample) for sample in samples(record)]
    yield "push", {key: np.array([answer[key] for answer in pushed]) for key in pushed[-1]}
    yield "batch", states_of(observer.batch(record))
    yield "smooth", states_of(observer.smooth(record))
    names = ("tractor.drive.cornering_stiffness", "semitrailer.mass", "steer.tractor.front.gain")
    sigma = np.array([40e3, 500.0, 0.02])
    uncertainty = fw.Uncertainty(names=names, covariance=np.diag(sigma**2))
    yield "uncertain", states_of(observer.batch(record, uncertainty))
    yield "uncertain smooth", states_of(observer.smooth(record, uncertainty))
    yield "C", exported(observer)


def samples(record: fw.Record) -> Iterator[dict[str, float]]:
    """The samples of a record."""
    columns = {"time": record.time.tolist()} | {name: values.tolist() for name, values in record.signals.items()}
    for k in range(len(record)):
        yield {name: values[k] for name, values in columns.items()}


def exported(estimator: fw.Observer | fw.Learner) -> dict[str, str]:
    """The generated files."""
    from fifthwheel.results.export.project import learner_texts, observer_texts

    return learner_texts(estimator) if isinstance(estimator, fw.Learner) else observer_texts(estimator)


@case()
def learner() -> Any:
    return learned(lane_changes(), fw.OneStage(tyres="linear"))


@case()
def learner_saturating() -> Any:
    return learned(sine(), fw.OneStage(tyres="saturating"))


@case()
def learner_everyday() -> Any:
    settings = fw.OneStage(
        given={"sensors": "exact", "road.bank": "exact", "tractor.front.cornering_stiffness": "exact"}
    )
    return learned(only(everyday(), "yaw_rate", "articulation"), settings)


def learned(record: fw.Record, settings: fw.OneStage) -> dict[str, Any]:
    """States and estimates of a learner; those after another trailer; the exported C."""
    learner = fw.Learner(GUESS, record.signals, settings)
    pushed = [learner.push(sample) for sample in samples(record)]
    content = learner.content()
    for part in ("vehicle", "settings", "learner", "knowledge"):  # the last one has a date
        content.pop(part)
    result: dict[str, Any] = {
        "push": {key: np.array([answer[key] for answer in pushed]) for key in pushed[-1]},
        "content": content,
        "parameters": [(v.name, v.value, v.sigma, str(v.verdict)) for v in (*learner.parameters, *learner.sensors)],
        "doubts": [repr(doubt) for doubt in learner.doubts],
        "C": exported(learner),
    }
    learner.couple("other", GUESS)
    result["coupled"] = [(v.name, v.value, v.sigma, str(v.verdict)) for v in learner.parameters]
    return result


# What uses the estimators


@case()
def check() -> Any:
    return fw.predict_sigmas([lane_changes()], GUESS).as_dict()


@case()
def check_everyday() -> Any:
    record = only(everyday(), "yaw_rate", "articulation", "lateral_acceleration")
    late = {n: np.roll(v, 30) if n == "yaw_rate.semitrailer" else v for n, v in record.signals.items()}
    return {
        "information": fw.predict_sigmas([record], GUESS).as_dict(),
        "late": [repr(finding) for finding in fw.check_signals(replace(record, signals=late), GUESS)],
    }


@case()
def findings() -> Any:
    """Findings on a log, one corruption at a time."""
    record = example()
    result = {"": [repr(finding) for finding in fw.check_signals(record, TRUCK)]}
    for name in record.signals:
        for fault in ("inverted", "degrees", "stuck", "spike"):
            values = record.signals[name].copy()
            if fault == "inverted":
                values *= -1
            elif fault == "degrees":
                values *= 57.3
            elif fault == "stuck":
                values[:] = values[0]
            else:
                values[300:302] += 40 * values.std() + 1
            found = fw.check_signals(record.with_signals({name: values}), TRUCK)
            result[f"{name} {fault}"] = [repr(finding) for finding in found]
    return result


@case()
def design() -> Any:
    plan = json.loads(fw.design_experiment(GUESS, {"semitrailer.yaw_inertia": 0.1}).to_json())
    del plan["alternatives"]  # runs of equal merit, of which rounding decides
    return plan


@case()
def assess() -> Any:
    return fw.assess(TRUCK, speed=80 / 3.6, cheap=True).as_dict()


@case()
def fleet() -> Any:
    rng = np.random.default_rng(3)
    truck, rows = Synthetic(rng), []
    for k in range(6):
        if k:
            truck.step(3, 0.004)
        rows.append(truck.trip(3 * k))
    result = combine([log_knowledge(row) for row in rows], tyre_walk=0.004, false_alarm=0.001)
    return [[repr(result.estimate(k, unknown)) for unknown in result.parameters(k)] for k in range(len(rows))]
