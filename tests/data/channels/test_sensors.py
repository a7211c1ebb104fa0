"""Sensors: classes and uncertainties in signals.toml, on their way to the priors of an identification."""

import math
import pickle
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest

import fifthwheel as fw
from fifthwheel.apps.workflow.runs import design_run, run_states
from fifthwheel.base.units import quantity
from fifthwheel.data.channels.sensors import SENSOR_CLASSES
from fifthwheel.estimate.identify.given import common_sensors, with_sensors
from fifthwheel.estimate.identify.unknowns.parameters import prior_of_sensor_error

STEER_ANGLE, YAW = "steer.tractor.front", "yaw_rate.tractor"
MAP = """
[signals]
speed = "v"
[signals."steer.tractor.front"]
column = "swa"
unit = "deg"
sensor = "steering wheel"
gain = "0.05 +- 2 %"
offset = "0.1 deg +- 0.05 deg"
delay = "20 ms +- 5 ms"
play = "0.1 deg +- 0.05 deg"
[signals."yaw_rate.tractor"]
column = "r"
sensor = "mems"
delay = "+- 2 ms"
misalignment = "0 deg +- 0.5 deg"
noise = "0.1 deg/s"
[signals."yaw_rate.semitrailer"]
column = "r2"
"""


@pytest.fixture(scope="module")
def truck() -> fw.Vehicle:
    return fw.vehicle("cheng_cebon_2011")


def with_keys(signal: str, keys: str) -> fw.SignalMap:
    part = "signals" if "reference" not in signal else "reference"
    return fw.SignalMap.parse(f'[{part}."{signal.removeprefix("reference.")}"]\ncolumn = "c"\n{keys}')


def test_a_map_states_priors_and_corrects_as_before() -> None:
    signal_map = fw.SignalMap.parse(MAP)
    steer = signal_map.signals[STEER_ANGLE]
    assert (steer.gain, steer.offset, steer.delay) == (0.05, "0.1 deg", 0.02)
    assert signal_map.sensors == {
        STEER_ANGLE: fw.SensorPrior(
            sensor_class="steering wheel",
            errors={
                "gain": (1.0, 0.02),
                "offset": (0.0, math.radians(0.05)),
                "delay": (0.0, 0.005),
                "play": (math.radians(0.1), math.radians(0.05)),
            },
        ),
        YAW: fw.SensorPrior(
            sensor_class="mems",
            errors={"delay": (0.0, 0.002), "misalignment": (0.0, math.radians(0.5))},
            noise=math.radians(0.1),
        ),
    }
    assert signal_map != fw.SignalMap.parse(MAP.replace("2 %", "3 %"))
    assert signal_map.model_copy(update={"time": None}).sensors == signal_map.sensors


def test_forms_of_a_statement() -> None:
    forms: dict[str, dict[str, tuple[float, float | None]]] = {
        'gain = "0.05"': {},
        'gain = "+- 2 %"': {"gain": (1.0, 0.02)},
        'gain = "-2 +- 0.1"': {"gain": (1.0, 0.05)},
        'gain = "0.05 exact"': {"gain": (1.0, 0.0)},
        'delay = "200 ms +- 5 %"': {"delay": (0.0, 0.01)},
        'offset = "+- 0.01 rad"': {"offset": (0.0, 0.01)},
        'play = "0.01 rad"': {"play": (0.01, None)},
        "play = 0.01": {"play": (0.01, None)},
    }
    for keys, errors in forms.items():
        expected = {kind: (mean, sigma and pytest.approx(sigma)) for kind, (mean, sigma) in errors.items()}
        assert with_keys(STEER_ANGLE, keys).sensors.get(STEER_ANGLE, fw.SensorPrior()).errors == expected


REFUSED = [
    ("speed", 'gain = "1 +- 2 %"', r"speed: gain: no identification .* expected delay; remove the '\+-' of its"),
    ("speed", 'sensor = "ins"', "speed: sensor: .*no class has this quantity; remove it"),
    ("roll.tractor", 'offset = "+- 1 deg"', "offset: .* no error of this signal is estimated"),
    ("articulation.semitrailer", 'gain = "1 +- 2 %"', "gain: .* expected offset, noise; remove the"),
    ("articulation.semitrailer", 'play = "1 deg"', "play: .* expected offset, noise; remove play"),
    (STEER_ANGLE, 'misalignment = "1 deg"', "misalignment: .* expected offset, gain, delay, play; remove mis"),
    (STEER_ANGLE, 'noise = "1 deg"', "noise: .* expected offset, gain, delay, play; remove noise"),
    (STEER_ANGLE, 'play = "-1 deg"', "play: expected 0 or more"),
    (STEER_ANGLE, 'gain = "0 +- 1"', "gain: expected another number than 0"),
    (STEER_ANGLE, 'gain = "1 +- 1 deg"', r"gain: after '\+-': expected 1"),
    (STEER_ANGLE, 'sensor = "mems"', "sensor: expected a class of steer, got 'mems'; available: steering wheel, w"),
    (YAW, 'sensor = "mem"', "sensor: expected a class of yaw_rate, got 'mem'; did you mean 'mems'"),
    (YAW, 'noise = "0 deg/s"', "noise: expected a finite number above 0"),
    (YAW, 'noise = "1 deg/s +- 1 deg/s"', "noise: expected one standard deviation, without"),
    (YAW, 'delay = "+- 5 %"', "delay: .*percent of 0 is 0"),
    (YAW, 'delay = "1 ms +- 5"', "delay: .*write '\\+- 5 ms'"),
    (f"reference.{YAW}", 'sensor = "mems"', "reference.yaw_rate.tractor: sensor: .* no class has this .*; remove it"),
    (f"reference.{YAW}", 'gain = "1 +- 2 %"', r"reference.yaw_rate.tractor: gain: .* no error .* estimated; remove"),
]


def test_what_cannot_be_used_is_refused() -> None:
    for signal, keys, message in REFUSED:
        with pytest.raises(fw.SignalError, match=message):
            with_keys(signal, keys)


def test_priority(truck: fw.Vehicle) -> None:
    """A single error of the settings, the statement, the class, all sensors of a kind as changed, the default."""
    sensors = fw.SignalMap.parse(MAP).sensors

    def prior(kind: str, settings: fw.OneStage, signal: str = STEER_ANGLE) -> Any:
        return prior_of_sensor_error(truck, f"{signal}.{kind}", with_sensors(truck, settings, sensors))

    assert prior("gain", fw.OneStage(given={f"{STEER_ANGLE}.gain": "1.01 +- 0.001"})) == (1.01, 0.001)
    assert prior("gain", fw.OneStage(given={"steer.*.gain": "+- 0.1"})) == (1.0, pytest.approx(0.02))
    assert prior("gain", fw.OneStage(), YAW) == (1.0, 0.0075)
    assert prior("gain", fw.OneStage(given={"yaw_rate.*.gain": "+- 0.02"}), YAW) == (1.0, 0.02)
    assert prior("delay", fw.OneStage(), YAW) == (0.0, 0.002)
    assert prior("gain", fw.OneStage(), "yaw_rate.semitrailer") == (1.0, 0.005)
    settings = with_sensors(truck, fw.OneStage(noise={"yaw_rate.semitrailer": 1e-6}), sensors)
    assert settings.noise == {"yaw_rate.semitrailer": 1e-6, YAW: pytest.approx(math.radians(0.1) ** 2)}
    assert with_sensors(truck, settings, sensors) == settings
    assert with_sensors(truck, fw.OneStage(), {}) == fw.OneStage()
    other = with_sensors(truck, fw.OneStage(), {"yaw_rate.dolly": fw.SensorPrior(sensor_class="ins")})
    assert other == fw.OneStage()


@pytest.fixture(scope="module")
def record(truck: fw.Vehicle) -> fw.Record:
    return fw.simulate(truck, count=1)


def stating(record: fw.Record, sensors: dict[str, fw.SensorPrior], name: str = "run") -> fw.Record:
    return replace(record, name=name, sensors=sensors)


GYRO = fw.SensorPrior(sensor_class="mems", errors={"gain": (1.0, 0.002)})


def test_they_stay_with_a_record_and_its_file(record: fw.Record, tmp_path: Path) -> None:
    """A damaged statement in a file is refused."""
    stated = stating(record, {YAW: GYRO})
    assert stated.cut(0, 2).sensors == stated.with_signals({}).sensors == {YAW: GYRO}
    assert pickle.loads(pickle.dumps(stated)).sensors == {YAW: GYRO}
    path = tmp_path / "log.parquet"
    for name, expected in ((path.name, {YAW: GYRO}), ("log.csv", {})):
        fw.write_record(stated, tmp_path / name)
        assert fw.read_log(tmp_path / name).sensors == expected
    text = f'[signals."{YAW}"]\ncolumn = "{YAW}"\nsensor = "ins"\ndelay = "+- 1 ms"'
    updated = fw.read_log(path, fw.SignalMap.parse(text)).sensors[YAW]
    assert updated == fw.SensorPrior(sensor_class="ins", errors={"gain": (1.0, 0.002), "delay": (0.0, 0.001)})
    with pytest.raises(fw.SignalError, match="speed: gain"):
        stating(record, {"speed": GYRO})
    table = pq.read_table(path)
    place = table.schema.get_field_index(f"{YAW} [rad/s]")
    field = table.schema.field(place)
    for damaged in (b"{", b"[]", b"[" * 100_000, b'{"noise": -1}', b'{"other": 1}'):
        schema = table.schema.set(place, field.with_metadata({**field.metadata, b"sensor": damaged}))
        pq.write_table(table.cast(schema), path)
        with pytest.raises(fw.SignalError, match=r"tractor: expected the statements on a sensor, .*; write"):
            fw.read_log(path)


def test_logs_that_disagree_are_refused(record: fw.Record) -> None:
    records = [stating(record, {YAW: GYRO}, "a"), stating(record, {}, "b")]
    with pytest.raises(fw.SignalError, match=r"yaw_rate.tractor: expected one sensor .* mems, .*no class.*signals"):
        common_sensors(records)
    assert common_sensors(records[:1] * 2) == {YAW: GYRO}


ONE = fw.OneStage(given={"truck": "exact", "tractor.front.cornering_stiffness": "free"}, tyres="linear")
"""Estimates one number of the truck."""


@pytest.mark.slow
def test_an_identification_and_its_check_have_the_stated_priors(record: fw.Record, truck: fw.Vehicle) -> None:
    """The misalignment of the yaw rate gyro is hardly informed by one lane change: its sigma is that of the prior."""
    exact = fw.SensorPrior(errors={"misalignment": (0.0, 1e-5)})
    result = fw.identify([stating(record, {YAW: exact})], truck, ONE)
    (sigma,) = (error.sigma for error in result.sensors if error.name == f"{YAW}.misalignment")
    assert sigma == pytest.approx(1e-5, rel=0.01)
    stated = stating(record, {STEER_ANGLE: fw.SensorPrior(sensor_class="wheel angle")})
    (with_class,), (without,) = (fw.predict_sigmas([r], truck, ONE).parameters for r in (stated, record))
    assert with_class.sigma < 0.97 * without.sigma


def test_who_does_not_use_them_says_so(record: fw.Record, truck: fw.Vehicle) -> None:
    stated = [stating(record, {YAW: GYRO})]
    (note,) = run_states(stated, truck).notes
    assert note == "What is stated of the sensors of yaw_rate.tractor is used with identification only."
    assert run_states([record], truck).notes == ()
    notes = fw.identify(stated, truck, fw.TwoStage(passes=1)).notes
    assert any("do not use the sensor classes" in note and YAW in note for note in notes)


def test_a_design_has_them(truck: fw.Vehicle, monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[fw.OneStage] = []
    monkeypatch.setattr("fifthwheel.estimate.design.design_experiment", lambda *a, **_: seen.append(a[2]))
    design_run(truck, sensors={YAW: GYRO})
    assert seen[0].given[f"{YAW}.gain"] == "1.0 +- 0.002"


@pytest.mark.slow
def test_a_learner_has_them(record: fw.Record, truck: fw.Vehicle) -> None:
    learner = fw.Learner(truck, record.signals, ONE, sensors={YAW: GYRO})
    assert learner[f"{YAW}.gain"].sigma == pytest.approx(0.002)
    with pytest.raises(fw.SignalError, match=r"states sensors \(yaw_rate.semitrailer\)"):
        learner.learn(stating(record, {"yaw_rate.semitrailer": GYRO}).cut(1.5, np.inf))


def test_the_table_of_the_documentation_is_that_of_the_code() -> None:
    def sigmas(cell: str) -> list[float]:
        units = ((text, "m/s^2" if "m/s" in text else "rad/s" if "/s" in text else "rad") for text in cell.split(", "))
        return [quantity(text, unit) for text, unit in units if text]

    page = (Path(__file__).parents[3] / "docs" / "signals.md").read_text(encoding="utf-8").replace("²", "^2")
    for name, known in SENSOR_CLASSES.items():
        row = next(line for line in page.splitlines() if line.startswith(f"| `{name}` |"))
        gain, delay, misalignment, play, offset, noise = (cell.strip() for cell in row.split("|")[3:9])
        assert (quantity(gain, "1"), quantity(delay, "s")) == pytest.approx((known.gain, known.delay))
        assert sigmas(misalignment) == pytest.approx([known.misalignment] if known.misalignment else [])
        assert sigmas(play) == pytest.approx([known.play] if "steer" in known.offset else [])
        assert sigmas(noise) == pytest.approx(list(known.noise.values()))
        assert sorted({*sigmas(offset)}) == pytest.approx(sorted({*known.offset.values()}))
