"""Simulated records of the linear model, with the noise of real sensors: for tests, demonstrations and benchmarks."""

from collections.abc import Mapping

import numpy as np

from fifthwheel.base.arguments import expect, expect_number, expect_road_speed
from fifthwheel.base.errors import VehicleError
from fifthwheel.data.channels import ROLL, ROLL_RATE, is_of
from fifthwheel.data.record import Record
from fifthwheel.data.record.derived import article_gyro_variance
from fifthwheel.model import dynamics
from fifthwheel.model.dynamics.simulation import free_response
from fifthwheel.model.manoeuvres import linear_course
from fifthwheel.truck import Vehicle
from fifthwheel.truck.steering import require_roll


def simulate(
    vehicle: Vehicle,
    *,
    manoeuvre: str = "lane_changes",
    count: int | None = None,
    speed: float = 88 / 3.6,
    rate: float = 100.0,
    duration: float | None = None,
    seed: int = 0,
    sensors: Mapping[str, float] | None = None,
    roll: bool = True,
    name: str = "simulated",
) -> Record:
    """Simulate a manoeuvre by the linear model: noisy sensors as signals, the true states as reference.

    Args:
        vehicle: truck, stable at this speed.
        manoeuvre: one of `manoeuvres.LINEAR_MANOEUVRES`.
        count: number of lane changes, to the left and to the right in turn. Default: 15; other manoeuvres have none.
        speed: constant, m/s.
        rate: sampling rate, Hz.
        duration: s; by default that of the manoeuvre, or 60 s.
        seed: seed of the sensors' noise and of the random manoeuvre.
        sensors: variance of the noise by signal, SI squared; by default the gyros of Cheng and Cebon (2011).
        roll: use the yaw-roll model, or the yaw model.
        name: name of the record.

    Raises:
        SignalError: the speed is out of range, or the linear model does not have the manoeuvre or a sensor, or the
            manoeuvre no `count`.
        VehicleError: `vehicle` is not one, or unstable at this speed.

    Example:
        >>> import fifthwheel as fw
        >>> fw.simulate(fw.vehicle("cheng_cebon_2011"), count=2, seed=1).span
        (0.0, 15.99)
    """
    expect("vehicle", vehicle, Vehicle)
    require_roll(vehicle.steering, roll)
    if count is not None:
        expect_number("count", count, ge=1, whole=True)
    expect_number("rate", rate, ge=5, le=1000, unit="Hz")
    expect_number("seed", seed, ge=0, whole=True)
    if duration is not None:
        expect_number("duration", duration, ge=1, le=36000, unit="s")
    for signal, variance in (sensors or {}).items():
        expect_number(f"sensors, {signal}", variance, ge=0)
    expect_road_speed(speed)
    if not dynamics.is_stable(vehicle, speed, roll=roll):
        raise VehicleError(f"{vehicle.name}: unstable at {speed:.1f} m/s; simulate it below its critical speed")
    first = vehicle.with_logged_steering(vehicle.steer_signals(), vehicle.name).steer_signals()[0]
    time, steer = linear_course(
        manoeuvre, vehicle, speed=speed, rate=rate, count=count, duration=duration, seed=seed, roll=roll
    )
    inputs = {n: steer if n == first else np.zeros_like(time) for n in vehicle.steer_signals()}
    inputs["speed"] = np.full_like(time, speed)
    units = [unit.name for unit in vehicle.units]
    sensors = article_gyro_variance(units) if sensors is None else sensors
    sensors = {n: v for n, v in sensors.items() if roll or not is_of(n, ROLL, ROLL_RATE)}
    states = [f"sideslip.{u}" for u in units] + [f"roll.{u}" for u in units if roll]
    states += [f"articulation.{u}" for u in units[1:]]
    outputs = (*sensors, *states)
    model = dynamics.model(vehicle, outputs, roll=roll)
    _, y = free_response(model, dynamics.all_parameters(vehicle, outputs), time, inputs)
    noise = np.random.default_rng(seed).normal(size=(len(time), len(sensors)))
    measured = {n: y[:, i] + np.sqrt(variance) * noise[:, i] for i, (n, variance) in enumerate(sensors.items())}
    return Record(
        time=time,
        signals={n: values for n, values in inputs.items() if n in ("speed", first)} | measured,
        reference={n: y[:, len(sensors) + i] for i, n in enumerate(states)},
        name=name,
    )
