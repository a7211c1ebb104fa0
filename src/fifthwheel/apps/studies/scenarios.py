"""Scenarios of a study: a truck in a manoeuvre with sensors. The seed draws the noise and the initial values."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from fifthwheel.base.arguments import expect_known
from fifthwheel.base.settings import Settings
from fifthwheel.base.types import Array
from fifthwheel.data.channels import SPEED, STEER, is_of
from fifthwheel.data.record import Record
from fifthwheel.estimate.identify.unknowns.parameters import stage_1_names
from fifthwheel.model.manoeuvres import MANOEUVRES, OpenLoop
from fifthwheel.model.manoeuvres import course as make_course
from fifthwheel.model.plant import Plant, PlantRun, Properties, Sensor, article_sensors, measure
from fifthwheel.model.simulate import simulate
from fifthwheel.truck import Vehicle

REFERENCE_STEER = (0.1, 1.0)
"""Steer angles of the steady turns of `effective_stiffness`, deg; those of Cheng and Cebon (2011), section 3.2."""


def initial_guess(assumed: Vehicle, seed: int, fixed: Mapping[str, float] | None = None) -> Vehicle:
    """A vehicle with each parameter of stage 1 at 80 or 120 %, and the fixed parameters at their values."""
    names = stage_1_names(assumed)
    factors = np.random.default_rng([seed, 7]).choice([0.8, 1.2], len(names))
    values = assumed.parameters()
    return assumed.replace({name: values[name] * f for name, f in zip(names, factors, strict=True)} | dict(fixed or {}))


def exact_guess(assumed: Vehicle, seed: int) -> Vehicle:
    """The vehicle itself, for estimators of states only.

    Example:
        >>> import fifthwheel as fw
        >>> truck = fw.vehicle("cheng_cebon_2011")
        >>> fw.exact_guess(truck, 0) is truck
        True
    """
    return assumed


@dataclass(frozen=True, kw_only=True)
class SimulatedRun(Settings):
    """A manoeuvre and the model that drives it; None is the default of the manoeuvre.

    Example:
        >>> import fifthwheel as fw
        >>> fw.SimulatedRun(manoeuvre="sweep", speed=20.0, duration=30.0).options()
        {'speed': 20.0, 'duration': 30.0}
    """

    manoeuvre: str = "lane_changes"
    """One of `MANOEUVRES` that the model has."""
    model: Literal["linear", "nonlinear"] = "linear"
    """The linear model of the estimators, or the nonlinear truck."""
    count: int | None = None
    """Number of lane changes."""
    speed: float | None = None
    """m/s."""
    duration: float | None = None
    """s."""
    rate: float = 100.0
    """Sampling rate, Hz."""
    properties: Properties = field(default_factory=Properties)
    """Properties of the nonlinear truck."""

    def __post_init__(self) -> None:
        super().__post_init__()
        expect_known("manoeuvre", [self.manoeuvre], MANOEUVRES)

    def options(self) -> dict[str, Any]:
        """Arguments of the manoeuvre that are given."""
        given = {"count": self.count, "speed": self.speed, "duration": self.duration}
        return {key: value for key, value in given.items() if value is not None}


@dataclass(frozen=True, kw_only=True)
class Scenario:
    """One truck in one manoeuvre with one set of sensors."""

    vehicle: Vehicle
    run: SimulatedRun
    sensors: Mapping[str, Sensor] | None = None  # by signal; None: those of Cheng and Cebon (2011)
    plant_run: PlantRun | None = None  # of the nonlinear truck; see `simulated`
    stiffness: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    """Range of effective cornering stiffness of the nonlinear truck, N/rad, by parameter."""

    def record(self, seed: int) -> Record:
        """Measured signals of a seed; every true signal that the model has as reference.

        Raises:
            SignalError: the model does not have the manoeuvre or the signal of a sensor.
        """
        fitted = article_sensors(self.vehicle) if self.sensors is None else self.sensors
        time, truth = self._truth(seed, fitted)
        return Record(time=time, signals=measure(time, truth, fitted, seed=seed), reference=truth, name=f"seed {seed}")

    def _truth(self, seed: int, fitted: Mapping[str, Sensor]) -> tuple[Array, Mapping[str, Array]]:
        if self.plant_run is not None:
            return self.plant_run.time, self.plant_run.truth
        rates = [f"{quantity}.{unit.name}" for quantity in ("yaw_rate", "roll_rate") for unit in self.vehicle.units]
        measured = [name for name in fitted if not is_of(name, SPEED, STEER)]
        exact = dict.fromkeys([*rates, *measured], 0.0)
        options = self.run.options()
        made = simulate(
            self.vehicle, manoeuvre=self.run.manoeuvre, rate=self.run.rate, seed=seed, sensors=exact, **options
        )
        steer = {name: np.zeros(len(made)) for name in self.vehicle.steer_signals()}
        return made.time, {**steer, **made.signals, **made.reference}


def true_value(
    vehicle: Vehicle, stiffness: Mapping[str, tuple[float, float]], parameter: str
) -> tuple[float, float, float] | None:
    """True value of a parameter or derived quantity, and the ends of its range; None if the truck has none.

    `stiffness` has the ranges of effective stiffness, if the tyres are nonlinear.
    """
    values = vehicle.parameters() | vehicle.derived()
    if parameter not in values:
        return None
    low, high = sorted(stiffness.get(parameter, (values[parameter],) * 2))
    return values[parameter], low, high


def simulated(vehicle: Vehicle, run: SimulatedRun) -> Scenario:
    """The scenario of a truck and a manoeuvre; the nonlinear truck is driven once, and random courses have seed 0."""
    if run.model == "linear":
        return Scenario(vehicle=vehicle, run=run)
    driven = Plant(vehicle, run.properties).drive(make_course(run.manoeuvre, vehicle, **run.options()), rate=run.rate)
    speed = float(np.mean(driven.truth["speed"]))
    ranges = effective_stiffness(vehicle, run.properties, speed)
    return Scenario(vehicle=vehicle, run=run, plant_run=driven, stiffness=ranges)


def effective_stiffness(
    truck: Vehicle, properties: Properties, speed: float, steer: tuple[float, float] = REFERENCE_STEER
) -> dict[str, tuple[float, float]]:
    """Side force divided by slip angle of every axle group in two steady turns, N/rad, by its parameter.

    The article uses steer angles of 0.1 and 1 degree; the slip angles at 1 degree are close to the largest of the lane
    change (section 3.2). The speed is in m/s, the steer angles of the two turns are in degrees.
    """
    plant = Plant(truck, properties)
    turns = []
    for degrees in steer:
        time = np.arange(0, 12.001, 0.01)
        angle = np.radians(degrees) * np.clip(time / 4, 0, 1)
        turns.append(plant.drive(OpenLoop(time=time, steer=angle, speed=np.full_like(time, speed), name="turn")).truth)

    def at_the_end(truth: Mapping[str, Array], axles: Sequence[str]) -> float:
        return sum(float(truth[f"lateral_force.{a}"][-1] / truth[f"slip_angle.{a}"][-1]) for a in axles)

    ranges = {}
    for unit in truck.units:
        for group in unit.axle_groups:
            first, second = (at_the_end(turn, [f"{unit.name}.{axle.name}" for axle in group.on_road]) for turn in turns)
            ranges[f"{unit.group_path(group)}.cornering_stiffness"] = first, second
    return ranges
