"""A truck in ordinary driving on hilly roads: engine, gears, driver, traffic, wind, and the signals of its CAN bus.

The longitudinal motion only, as the truth for estimates of the mass, with the driveline of `powertrain`, rolling
resistance that depends on speed, gusts, filters and quantisation of SAE J1939-71 (EEC1, EEC3, CCVS). Starts and stops
are in it, which the tyres of the nonlinear truck do not have.
"""

import math

import numpy as np

from fifthwheel._types import Array
from fifthwheel.plant.powertrain import GRAVITY, RPM, STEP, DrivenTruck, Powertrain, Road
from fifthwheel.record import Record

SPEEDS = np.array([30, 50, 50, 60, 70, 80, 85, 85, 88]) / 3.6
"""Of traffic, m/s; a red light or a roundabout stops or slows it in between."""


def drive(
    truck: DrivenTruck, *, duration: float = 600.0, seed: int = 0, rate: float = 50.0, name: str = "drive"
) -> Record:
    """The log of a drive with stops and hills, all of it random.

    The reference has the true speed and grade.

    Args:
        duration: s.
        rate: of the log, Hz.

    Example:
        >>> from fifthwheel.plant.driving import DrivenTruck, drive
        >>> sorted(drive(DrivenTruck(mass=30e3), duration=20.0).signals)[:3]
        ['braking.tractor', 'driveline_engaged', 'engine_speed']
    """
    rng = np.random.default_rng(seed)
    n, every = round(duration / STEP), round(1 / (rate * STEP))
    road = Road(truck, rng, n)
    truth = _motion(truck, road, _traffic(rng, n))
    speed, engine, torque, friction, engaged, braking, grade = truth.T
    reference, lag = truck.max_torque, STEP / (0.05 + STEP)
    shown, filtered = np.empty(n), speed[0]
    for k in range(n):
        filtered += lag * (speed[k] - filtered)
        shown[k] = filtered
    late = round(max(truck.speed_delay - 0.05, 0.0) / STEP)
    shown = np.concatenate([np.full(late, shown[0]), shown])[:n] * truck.speed_scale
    rows, coarse = np.arange(0, n, every), np.arange(0, n, round(0.1 / STEP))
    quantum = 1 / 256 / 3.6
    sent = np.round(np.maximum(shown[coarse] + 0.01 * rng.normal(size=coarse.size), 0.0) / quantum) * quantum
    indicated = truck.torque_scale * torque + truck.torque_offset + friction
    signals = {
        "speed": np.interp(rows, coarse, sent),
        "engine_speed": np.round(engine[rows] / RPM * 8) / 8 * RPM,
        "engine_torque": np.round(indicated[rows] / reference * 100) / 100 * reference,
        "friction_torque": np.round(friction[rows] / reference * 100) / 100 * reference,
        "driveline_engaged": engaged[rows],
        "braking.tractor": braking[rows],
    }
    true = {"speed": speed[rows], "grade": grade[rows]}
    return Record(time=STEP * rows.astype(float), signals=signals, reference=true, name=name)


def _traffic(rng: np.random.Generator, n: int) -> Array:
    """The speed that traffic permits at every instant, m/s."""
    speed = np.empty(n)
    k = 0
    while k < n:
        for value, mean in ((rng.choice(SPEEDS), 45.0), (rng.choice([0.0, 5.0, 8.0, 14.0]), 5.0)):
            length = round(rng.exponential(mean) / STEP) + round(5 / STEP)
            speed[k : k + length] = value + rng.normal()
            k += length
    return np.maximum(speed, 0.0)


def _motion(truck: DrivenTruck, road: Road, traffic: Array) -> Array:
    """(N, 7): speed, engine speed, net torque, friction torque, clutch closed, braking, grade."""
    train, out = Powertrain(truck), np.empty((len(traffic), 7))
    rotating_wheels = truck.wheels * truck.wheel_inertia / truck.radius**2
    v = place = wanted = plan = 0.0
    for k, permitted in enumerate(traffic.tolist()):
        plan += (min(max(0.4 * (permitted - wanted), -0.8), 0.9) - plan) * STEP / 0.8  # m/s^2
        wanted = max(wanted + plan * STEP, 0.0)
        grade, resistance = road.grade(place), truck.resistance(v, v + truck.wind + road.gust(k))
        force = train.forces(wanted=wanted, plan=plan, v=v, resistance=resistance, grade=grade)
        total = truck.mass + rotating_wheels + force.inertia
        downhill = truck.mass * GRAVITY * grade / math.sqrt(1 + grade**2)
        v = max(v + (force.drive - resistance - downhill - force.brake) / total * STEP, 0.0)
        place += v * STEP
        train.turn(v)
        out[k] = v, train.engine_speed, train.torque, train.friction, train.engaged, train.braking, grade
    return out
