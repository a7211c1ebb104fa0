"""What every evaluation shares: its result, the conditions of ISO 15037-2, and logs that are refused."""

import json
from dataclasses import replace

import numpy as np
import pytest

import fifthwheel as fw
from fifthwheel.base.errors import SignalError
from fifthwheel.data.record import Record
from fifthwheel.results.evaluate import METHODS
from tests.results.evaluate.conftest import NOISE, U

STEER = "steer.tractor.front"
MANOEUVRES = {
    "steady_state": "slowly_increasing_steer",
    "frequency_response": "random",
    "step": "step",
    "lane_change": "lane_changes",
    "pulse": "pulse",
    "sine_with_dwell": "sine_with_dwell",
}

ONE = {"lane_changes": {"count": 1}}


@pytest.fixture(scope="module")
def logs(truck):
    return {
        test: fw.simulate(truck, manoeuvre=name, speed=U, sensors=NOISE, rate=50.0, **ONE.get(name, {}))
        for test, name in MANOEUVRES.items()
    }


@pytest.mark.slow
@pytest.mark.parametrize("test", METHODS)
def test_every_measure_has_a_sigma_and_every_result_is_data(truck, logs, test):
    found = fw.evaluate(logs[test], test, vehicle=truck)
    assert len(found)
    assert all(np.isfinite(m.value) for m in found)
    measured = [m for m in found if set(m.signals) <= logs[test].signals.keys()]
    assert measured
    assert all(m.sigma is not None and m.sigma > 0 for m in measured)
    assert all((m.sigma, m.reason) == (None, "no sigma: from a reference signal") for m in found if m not in measured)
    assert len({values.size for values in found.arrays.values()}) == 1
    assert json.loads(json.dumps(found.as_dict(), allow_nan=False))["test"] == test
    assert list(found.to_pandas().index) == [m.name for m in found]
    assert found.plots()
    assert found.standard in METHODS[test].standard
    assert f"{found.title}, simulated" in str(found)
    assert "<table" in found._repr_html_()
    with pytest.raises(KeyError, match="not a measure of this test"):
        found["xyz"]


@pytest.mark.parametrize("test", METHODS)
def test_wrong_logs_are_refused_with_signal_and_cure(truck, logs, test):
    log, needed = logs[test], METHODS[test].shortest
    signals = dict(log.signals)
    cases: list[tuple[Record, str]] = [
        (_without(log, STEER), r"steer\.tractor\.front: not in .*; map the road-wheel angle"),
        (_without(log, "speed"), r"speed: not in simulated; .*; map a column"),
        (log.cut(0, needed / 2), rf"simulated: .* s long, this test needs at least {needed:g} s; give the whole run"),
        (_rows(log, slice(None, None, 50)), "simulated: sampled at 1 Hz, at least 10 Hz needed; log at a higher rate"),
        (log.with_signals({"speed": 0.1 * signals["speed"]}), "speed: 2.2 m/s in simulated, at least 5 m/s needed"),
        (_with_pause(log), "has a pause of more than 1 s; cut the record"),
    ]
    for wrong, message in cases:
        with pytest.raises(SignalError, match=message):
            fw.evaluate(wrong, test, vehicle=truck)
    with pytest.raises(SignalError, match=r"steer\.<unit>\.<axle>: not in simulated; map"):
        fw.evaluate(_without(log, STEER), test)
    bare = Record(time=log.time, signals={n: signals[n] for n in ("speed", STEER)}, name="bare")
    with pytest.raises(SignalError, match=r"(yaw_rate|articulation)\.\w+: not in bare; map a column to it"):
        fw.evaluate(bare, test, vehicle=truck)


@pytest.mark.slow
@pytest.mark.parametrize("with_vehicle", [True, False])
def test_implausible_signals_are_refused(truck, logs, with_vehicle):
    log, vehicle = logs["step"], truck if with_vehicle else None
    wrong = log.with_signals({STEER: np.degrees(log.signals[STEER])})
    with pytest.raises(SignalError, match=f"{STEER}: .*looks like degrees"):
        fw.evaluate(wrong, "step", vehicle=vehicle)
    notes = fw.evaluate(wrong, "step", vehicle=vehicle, check=False).notes
    assert any(note.startswith(STEER) and "looks like degrees" in note for note in notes)


@pytest.mark.slow
def test_conditions_that_are_not_met(truck, logs):
    log = logs["step"]
    swaying = 0.05 * np.sin(2 * np.pi * log.time) * (log.time < 1)
    changed = {"speed": log.signals["speed"] + 0.2 * log.time, "yaw_rate.tractor": log.signals["yaw_rate.tractor"]}
    changed["yaw_rate.tractor"] = changed["yaw_rate.tractor"] + swaying + 0.02
    found = fw.evaluate(_rows(log.with_signals(changed), slice(None, None, 5)), "step", vehicle=truck)
    assert {c.name: c.met for c in found.conditions} == {
        "sampling rate": False,
        "steady speed": False,
        "lateral acceleration": None,
        "straight entry": False,
        "offsets before the test": False,
    }
    good = fw.evaluate(log, "step", vehicle=truck)
    assert all(c.met is not False for c in good.conditions)
    assert "up to 1.6 m/s²" in next(c.found for c in good.conditions if c.name == "lateral acceleration")


def test_a_missing_roll_angle_gaps_and_reference_signals_are_noted(truck, logs):
    log = logs["lane_change"]
    kept = {n: v for n, v in log.signals.items() if n != "roll.tractor"}
    found = fw.evaluate(Record(time=log.time, signals=kept), "lane_change", vehicle=truck)
    assert any(note.startswith("lateral_acceleration.tractor contains g times the roll angle") for note in found.notes)
    assert not any("lateral_acceleration.semitrailer contains" in note for note in found.notes)
    log = logs["step"]
    roll = log.signals["roll.tractor"].copy()
    roll[100:200] = np.nan
    found = fw.evaluate(log.with_signals({"roll.tractor": roll}), "step", vehicle=truck)
    assert any(note.startswith("left out: roll.tractor: ") for note in found.notes)
    assert not any("roll.tractor" in m.name for m in found)
    assert any("Reference signals are evaluated too: sideslip.tractor" in note for note in found.notes)


def test_measured_signals_come_before_reference_signals(truck, logs):
    """The pulse takes a measured yaw rate instead of a reference signal, which would give no sigma."""
    log = logs["pulse"]
    kept = {n: v for n, v in log.signals.items() if n != "articulation.semitrailer"}
    referred = {"articulation.semitrailer": log.signals["articulation.semitrailer"]}
    found = fw.evaluate(Record(time=log.time, signals=kept, reference=referred), "pulse", vehicle=truck)
    assert found["yaw_damping"].signals == ("yaw_rate.semitrailer",)
    assert found["yaw_damping"].sigma > 0


def test_a_long_gap_of_a_needed_signal_is_named(truck, logs):
    log = logs["lane_change"]
    rate = log.signals["yaw_rate.tractor"].copy()
    rate[100:250] = np.nan
    kept = {n: log.signals[n] for n in (STEER, "speed", "yaw_rate.semitrailer")}
    broken = Record(time=log.time, signals={**kept, "yaw_rate.tractor": rate}, name="broken")
    with pytest.raises(SignalError, match=r"yaw_rate\.tractor: missing from 1\.98 to 5\.00 s; up to 0\.5 s"):
        fw.evaluate(broken, "lane_change", vehicle=truck, check=False)


@pytest.mark.slow
@pytest.mark.parametrize("test", ["lane_change", "frequency_response"])
def test_an_amplification_names_its_units(truck, logs, test):
    found = {vehicle: fw.evaluate(logs[test], test, vehicle=vehicle) for vehicle in (truck, None)}
    assert [(m.name, m.value) for m in found[None]] == [(m.name, m.value) for m in found[truck]]
    notes = {vehicle: evaluation.notes for vehicle, evaluation in found.items()}
    assert "Rearward amplification: semitrailer divided by tractor." in notes[truck]
    assert any("divided by tractor, in the order of the columns, since no vehicle is" in note for note in notes[None])
    kept = {n: v for n, v in logs[test].signals.items() if not n.endswith("semitrailer")}
    log = Record(time=logs[test].time, signals=kept, name="tractor_only")
    if test == "lane_change":
        with pytest.raises(SignalError, match=r"yaw_rate\.semitrailer: not in tractor_only"):
            fw.evaluate(log, test, vehicle=truck)
    else:
        assert any("No rearward amplification" in note for note in fw.evaluate(log, test, vehicle=truck).notes)


@pytest.mark.slow
def test_stated_sensors_time_bases_and_other_steer_angles_are_noted(truck, logs):
    log, gyro = logs["step"], fw.SensorPrior(sensor_class="mems")
    log = log.with_signals({"steer.semitrailer.rear": -0.5 * log.signals[STEER]})
    stated = replace(log, sensors={"yaw_rate.tractor": gyro}, time_bases={"yaw_rate.tractor": "imu"})
    assert "Other steer angles are not evaluated: steer.semitrailer.rear." in fw.evaluate(log, "step").notes
    notes = fw.evaluate(stated, "step", vehicle=truck).notes
    assert "Stated errors of sensors are neither corrected nor in sigma: yaw_rate.tractor." in notes
    assert "Times contain the time offset of signals on another time base: yaw_rate.tractor." in notes


def _without(log, name):
    signals = {n: v for n, v in log.signals.items() if n != name}
    return Record(time=log.time, signals=signals, reference=log.reference, name=log.name)


def _rows(log, rows):
    signals = {n: v[rows] for n, v in log.signals.items()}
    return Record(time=log.time[rows], signals=signals, name=log.name)


def _with_pause(log):
    time = log.time + 5.0 * (log.time > log.time[len(log) // 2])
    return Record(time=time, signals=log.signals, name=log.name)
