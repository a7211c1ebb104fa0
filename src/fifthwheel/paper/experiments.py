"""The article's experiments on the nonlinear truck: what is driven, what the estimator is told, how it is set.

An experiment is one drive of the plant and several arms: settings of the identification with the truck it starts from.
Every arm sees the same noise, seed by seed; each parameter of stage 1 starts at 80 or at 120 % of what the estimator is
told, drawn by the seed, and the payload's height at 0.1 m (3.1, 3.3).
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from fifthwheel.identify import TwoStage, article
from fifthwheel.paper.published import FRONT
from fifthwheel.plant import Drive, OpenLoop, Plant, Properties, Sensor
from fifthwheel.plant import article as article_sensors
from fifthwheel.plant.courses import lane_changes, on_test_track
from fifthwheel.vehicle import AxleGroup, Vehicle, get

Array = NDArray[np.float64]

KMH_88 = 88 / 3.6
STEER = "steer.tractor.front"
LANDING_LEG = "sideslip.semitrailer.landing_leg"
OPTICAL = 0.002
"""Standard deviation of the optical sensor's sideslip, rad; the article does not tell it."""


@dataclass(frozen=True, kw_only=True)
class Arm:
    """One way to identify."""

    name: str
    settings: TwoStage
    told: Vehicle  # that the starts are drawn around
    held: Mapping[str, float] = field(default_factory=dict)  # values of what is held


@dataclass(frozen=True, kw_only=True)
class Experiment:
    """One drive and the arms that look at it."""

    name: str  # the case of `published.RESULTS`
    drive: Drive
    sensors: Mapping[str, Sensor]
    arms: tuple[Arm, ...]
    stiffness: Mapping[str, tuple[float, float]]  # effective, at 0.1 and at 1 degree of steer, by group, N/rad


def point_payload(truck: Vehicle) -> Vehicle:
    """The truck with its payload at half its height on the centre line."""
    units = [
        unit.model_copy(update={"payload": unit.payload.model_copy(update={"shape": "point"})})
        if unit.payload
        else unit
        for unit in truck.units
    ]
    return Vehicle(**truck.model_copy(update={"units": tuple(units)}).model_dump())


def scaled(truck: Vehicle, word: str, factor: float) -> Vehicle:
    """The truck with a property of every axle group multiplied."""
    values = truck.parameters()
    return truck.replace({path: value * factor for path, value in values.items() if is_of_group(path, word)})


def is_of_group(path: str, word: str) -> bool:
    """Whether a path is that property of an axle group (couplings have some of the same name)."""
    return path.rpartition(".")[2] == word and not path.startswith("fifth_wheel.")


def effective_stiffness(
    truck: Vehicle, properties: Properties, speed: float, steer: tuple[float, float] = (0.1, 1.0)
) -> dict[str, tuple[float, float]]:
    """Side force by slip angle of every axle group in two steady turns, N/rad, by the name of its stiffness.

    The article turns at 0.1 and 1 degree of steer, the latter since its slip angles are close to the largest of the
    lane change (3.2).
    """
    plant = Plant(truck, properties)
    turns = []
    for degrees in steer:
        time = np.arange(0, 12.001, 0.01)
        angle = np.radians(degrees) * np.clip(time / 4, 0, 1)
        turns.append(plant.drive(OpenLoop(time=time, steer=angle, speed=np.full_like(time, speed), name="turn")).truth)
    return {
        f"{unit.group_path(group)}.cornering_stiffness": (
            stiffness_in(turns[0], unit.name, group),
            stiffness_in(turns[1], unit.name, group),
        )
        for unit in truck.units
        for group in unit.axle_groups
    }


def stiffness_in(truth: Mapping[str, Array], unit: str, group: AxleGroup) -> float:
    """Side force by slip angle of a group's axles at the end of a turn, N/rad."""
    axles = [f"{unit}.{axle.name}" for axle in group.axles]
    return sum(float(truth[f"lateral_force.{a}"][-1] / truth[f"slip_angle.{a}"][-1]) for a in axles)


def simulation(*, repetitions: int, properties: Properties | None = None, name: str = "simulation") -> Experiment:
    """Section 3: repeated SAE lane changes at 88 km/h."""
    properties = properties or Properties()
    truck = get("cheng_cebon_2011")
    driven = point_payload(truck) if name == "point payload" else truck
    return Experiment(
        name=name,
        drive=Plant(driven, properties).drive(lane_changes(count=repetitions), name=name),
        sensors=article_sensors(truck),
        arms=(
            Arm(name="article", settings=article(), told=truck),
            Arm(name="default", settings=TwoStage(), told=truck),
        ),
        stiffness=effective_stiffness(truck, properties, KMH_88),
    )


MAKERS = 4.20e5
"""Front cornering stiffness that the article holds for its vehicle, N/rad (4.2)."""
SOFT = 1.1
"""Suspension roll stiffness that the estimator believes, by the true one, in the test with flaws."""
OFFSETS = {
    "steer.tractor.front": 0.001,
    "yaw_rate.tractor": 0.002,
    "yaw_rate.semitrailer": -0.001,
    "roll_rate.tractor": 0.002,
    "roll_rate.semitrailer": -0.001,
}
"""Of the signals in the test with flaws, rad and rad/s."""


def on_test_vehicle(*, repetitions: int, flawed: bool) -> Experiment:
    """Section 4 on a truck close to the test vehicle: 4 m in 30 m at 35 km/h, front stiffness held at the maker's.

    Args:
        flawed: with what the article suspects of its own test: a suspension 10 % stiffer in the estimator than on the
            truck, and offsets of the signals.
    """
    truck = get("cheng_cebon_2011_vehicle")
    told = scaled(truck, "roll_stiffness", SOFT) if flawed else truck
    sensors = article_sensors(truck)
    if flawed:
        sensors |= {name: replace(sensors[name], bias=bias) for name, bias in OFFSETS.items()}
    # 600, 1000 and 400 of C1r, C2 and I2zz are 0.05 to 0.1 % of them, (15)
    published = article(held=(FRONT,), forgetting=0.9995, random_walk=0.0007)
    hold = TwoStage(held=(FRONT,))
    name = "test vehicle, flawed" if flawed else "test vehicle"
    drive = Plant(truck).drive(on_test_track(count=repetitions), name=name)
    largest = float(np.degrees(np.abs(drive.truth[STEER]).max()))  # where slip angles are those of this lane change
    return Experiment(
        name=name,
        drive=drive,
        sensors=sensors,
        arms=(
            Arm(name="article", settings=published, told=told, held={FRONT: MAKERS}),
            Arm(name="default", settings=TwoStage(), told=told),
            *([] if flawed else [Arm(name="default, front held", settings=hold, told=told, held={FRONT: MAKERS})]),
        ),
        stiffness=effective_stiffness(truck, drive.properties, 35 / 3.6, (0.1, largest)),
    )
