"""A truck in ordinary driving on hilly roads: engine, gears, driver, traffic, wind, and the signals of its CAN bus.

The longitudinal motion only, as the truth for estimates of the mass, with the driveline of `powertrain`, rolling
resistance that depends on speed, gusts, filters and quantisation of SAE J1939-71 (EEC1, EEC3, CCVS). Starts and stops
are in it, which the tyres of the nonlinear truck do not have.
"""

import math

import numpy as np

from fifthwheel.base.types import Array
from fifthwheel.data.record import Record
from fifthwheel.model.plant.powertrain import GRAVITY, SIGNALS, STEP, DrivenTruck, Powertrain, Road
from fifthwheel.model.plant.sensors import driveline_sensors, measure

SPEEDS = np.array([30, 50, 50, 60, 70, 80, 85, 85, 88]) / 3.6
"""Of traffic, m/s; a red light or a roundabout stops or slows it in between."""
TRUE = ("speed", *SIGNALS[:-1], "braking.tractor", "grade")
"""True signals, SI."""


def drive(
    truck: DrivenTruck, *, duration: float = 600.0, seed: int = 0, rate: float = 50.0, name: str = "drive"
) -> Record:
    """The log of a drive of a duration, s, with stops and hills, all of it random, at a sampling rate, Hz.

    The reference has the true speed and grade.
    """
    rng = np.random.default_rng(seed)
    n, every = round(duration / STEP), round(1 / (rate * STEP))
    road = Road(truck, rng, n)
    motion = _motion(truck, road, _traffic(rng, n))[::every]
    time, truth = STEP * np.arange(0, n, every, dtype=np.float64), dict(zip(TRUE, motion.T, strict=True))
    reference = {name: truth[name] for name in ("speed", "grade")}
    return Record(
        time=time, signals=measure(time, truth, driveline_sensors(truck), seed=seed), reference=reference, name=name
    )


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
    """(N, 7): the signals `TRUE`."""
    train, out = Powertrain(truck), np.empty((len(traffic), len(TRUE)))
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
        out[k] = v, *train.signals, grade
    return out
