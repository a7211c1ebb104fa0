"""Gross mass from ordinary driving: on closed-form motion, on the truth of `plant.powered`, with faults in the log."""

import math

import numpy as np
import pytest

import fifthwheel as fw
from fifthwheel.base.units import STANDARD_GRAVITY
from fifthwheel.estimate.longitudinal import drive_axle_braking
from fifthwheel.model.plant.powered import DrivenTruck, drive
from fifthwheel.truck.driveline import AIR_DENSITY, driveline_numbers

TRUCK = fw.vehicle("cheng_cebon_2011")
MASS = 26e3


def changed(record, **signals):
    """The record with other signals; None removes one."""
    kept = {name: values for name, values in {**record.signals, **signals}.items() if values is not None}
    return fw.Record(time=record.time, signals=kept, reference=record.reference, name=record.name)


@pytest.fixture(scope="module")
def log():
    return drive(DrivenTruck(mass=MASS), duration=300.0, seed=5)


@pytest.fixture(scope="module")
def result(log):
    return fw.gross_mass([log], TRUCK)


def pulses(mass, *, grade=0.0, gain=1.0):
    """A log with a drive force that changes every 6 s, exactly integrated, with the noise of a wheel speed sensor."""
    numbers = driveline_numbers(TRUCK.driveline, TRUCK.stated)
    time = np.arange(0, 240, 0.02)
    force = np.where(time % 12 < 6, 20e3, 2e3)
    total = mass + sum(TRUCK.tyres().values()) * numbers["rotating_mass"][0]
    speed = np.empty(time.size)
    v = 15.0
    for k in range(time.size):
        speed[k] = v
        drag = AIR_DENSITY / 2 * numbers["drag_area"][0] * v**2
        slope = math.sin(math.atan(grade)) + numbers["rolling_resistance"][0]
        v += 0.02 * (force[k] - drag - mass * STANDARD_GRAVITY * slope) / total
    speed += 0.01 * np.random.default_rng(1).normal(size=speed.size)
    signals = {"speed": speed, "drive_force": gain * force, "braking.tractor": np.zeros(time.size)}
    return fw.Record(time=time, signals=signals, name="pulses")


@pytest.mark.slow
def test_an_exactly_integrated_motion_gives_its_mass_and_the_scale_of_the_force_is_in_sigma():
    """On a constant unknown grade; the mass scales with the force."""
    for grade in (0.0, 0.02):
        exact = fw.gross_mass([pulses(30e3, grade=grade)], TRUCK)
        assert abs(exact.mass - 30e3) < 2.5 * exact.parts["driving"]
        assert exact.parts["driving"] < 0.01 * 30e3
        assert exact.sigma == pytest.approx(math.hypot(*exact.parts.values()))
    scaled = pulses(30e3, grade=0.02, gain=1.02)
    assert fw.gross_mass([scaled], TRUCK).mass / exact.mass == pytest.approx(1.02, abs=0.004)
    stated = fw.Vehicle.loads(TRUCK.to_toml() + '\n[driveline]\ntorque_scale = "1.02 +- 0.1 %"\n')
    corrected = fw.gross_mass([scaled], stated)
    assert corrected.mass == pytest.approx(exact.mass, rel=0.003)
    assert corrected.sigma < exact.sigma


def test_a_drive_on_unknown_hills_gives_the_mass_within_its_sigma(result):
    assert result.verdict is fw.Verdict.CONVERGED
    assert abs(result.mass - MASS) < 2.5 * result.sigma
    assert 0.02 * MASS < result.sigma < 0.06 * MASS


def test_more_and_fewer_signals_and_another_start(log, result):
    """A grade reduces sigma, gear changes are found without their signal, the start has no effect, and a retarder,
    whose torque is negative, leaves samples out."""
    graded = fw.gross_mass([changed(log, grade=log.reference["grade"])], TRUCK)
    assert graded.parts["driving"] < 0.7 * result.parts["driving"]
    without = fw.gross_mass([changed(log, driveline_engaged=None)], TRUCK)
    for found in (graded, without):
        assert abs(found.mass - MASS) < 2.5 * found.sigma
    assert fw.gross_mass([log], fw.with_payload(TRUCK, 3000.0)).mass == pytest.approx(result.mass, rel=0.003)
    retarder = np.where((log.time > 50) & (log.time < 100), -20.0, 0.0)
    assert fw.gross_mass([changed(log, **{"braking.tractor.retarder": retarder})], TRUCK).used < result.used - 10


@pytest.mark.slow
def test_two_logs_are_better_than_one(log, result):
    second = drive(DrivenTruck(mass=MASS), duration=300.0, seed=6)
    other, both = (fw.gross_mass(logs, TRUCK) for logs in ([second], [log, second]))
    independent = np.hypot(1 / result.parts["driving"], 1 / other.parts["driving"])
    assert 1 / both.parts["driving"] == pytest.approx(independent, rel=0.25)  # the noise is estimated jointly
    assert abs(both.mass - MASS) < 2.5 * both.sigma


def test_a_slipping_clutch_leaves_samples_out(log, result):
    """A driveline that is not engaged while the engine gives torque transmits an unknown force, and not none."""
    torque = log.signals["engine_torque"] - log.signals["friction_torque"]
    slips = (log.time % 40 > 20) & (log.time % 40 < 26) & (torque > 200)
    record = changed(log, driveline_engaged=np.where(slips, 0.0, log.signals["driveline_engaged"]))
    other = fw.gross_mass([record], TRUCK)
    assert other.used < result.used - 5
    assert abs(other.mass - result.mass) < 1.5 * other.parts["driving"]


def test_gaps_and_reversing_are_left_out(log, result):
    """A fifth of the log without torque, a tenth without speed, and a reversing manoeuvre with a wrong force."""
    torque, speed, time = log.signals["engine_torque"].copy(), log.signals["speed"].copy(), log.time
    torque[(time > 100) & (time < 160)] = np.nan
    speed[(time > 170) & (time < 200)] = np.nan
    speed[(time > 250) & (time < 260)] = -3.0
    faulty = fw.gross_mass([changed(log, engine_torque=torque, speed=speed)], TRUCK)
    assert faulty.used < result.used - 70
    assert abs(faulty.mass - MASS) < 2.5 * faulty.sigma


def test_braking_is_left_out(log, result):
    """The brake force is large; where its flag is on once only, the mass of the log is wrong."""
    once = np.where(np.arange(len(log)) < 50, 1.0, 0.0)
    blind = fw.gross_mass([changed(log, **{"braking.tractor": once})], TRUCK)
    assert abs(blind.mass - MASS) > 2 * abs(result.mass - MASS)


def test_logs_that_do_not_inform_the_mass_are_refused(log):
    """Brakes that are never on count as unknown grade: errors of up to 20 %, with a verdict that says converged."""
    time, rng, record = np.arange(0, 120, 0.1), np.random.default_rng(0), pulses(30e3)
    speed, force = 22 + 0.01 * rng.normal(size=time.size), np.full(time.size, 6e3)
    steady = {"speed": speed, "drive_force": force, "braking.tractor": 0 * time}
    reversed_force = -record.signals["drive_force"]
    for bad, message in (
        *(
            (changed(log, **{name: None}), rf"{name}: not in drive; .*signals\.toml")
            for name in ("speed", "braking.tractor", "engine_speed", "engine_torque")
        ),
        (changed(log, speed=0 * log.time), "the force is known for 0 s, at least 20 s"),
        (changed(record, drive_force=reversed_force), "does not follow the force; check the units and signs"),
        (fw.Record(time=time, signals=steady, name="steady"), "log a drive with gear changes and accelerations"),
        (changed(log, **{"braking.tractor": 0 * log.time}), r"braking\.tractor: never on .* the speed falls by up to"),
    ):
        with pytest.raises(fw.SignalError, match=message):
            fw.gross_mass([bad], TRUCK)
    with pytest.raises(fw.SignalError, match=r"write \[record\]"):
        fw.gross_mass(log, TRUCK)


@pytest.mark.parametrize(
    ("signals", "expected"),
    [
        ({"braking.tractor": 0.0}, (1.0, 0.05)),  # engine and retarder alone slow the truck down
        ({"braking.tractor": 0.0, "braking.tractor.retarder": -20.0}, (1.0, 0.05)),
        ({"braking.tractor": 1.0}, (0.3, math.hypot(0.05, 0.3))),
        ({"braking.tractor": np.nan}, (0.3, math.hypot(0.05, 0.3))),
        ({"braking.tractor.retarder": -20.0}, None),  # the service brakes may act
        ({}, None),
    ],
)
def test_the_switch_of_the_service_brakes_shows_who_brakes(signals, expected):
    time = np.arange(0, 20, 0.05)
    record = fw.Record(time=time, signals={"speed": 20 - 0.5 * time}, name="slower")
    found = drive_axle_braking(record.with_signals({name: np.full(400, value) for name, value in signals.items()}))
    assert found == (expected and pytest.approx(expected))
    steady = record.with_signals({"speed": np.full(400, 20.0), "braking.tractor": np.zeros(400)})
    assert drive_axle_braking(steady) is None
