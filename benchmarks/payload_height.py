"""What reduces the error and the sigma of the payload height on the nonlinear truck: a log with a known payload, or a
static roll test of the empty trailer, whose readings are those of the linear equilibrium.

    python benchmarks/payload_height.py [--seeds 20] [--one-scale]

Each seed draws the errors of the vehicle file from `truck.uncertainty.changes` and from the priors of the uncertain
numbers, and the errors of the sensors from the priors of `OneStage`. Suspension, lengths, unladen bodies, gains,
delays and misalignments are those of the truck, the same in all its logs; masses, CoG and offsets are drawn for each.
Each load is weighed on another scale, or all on one, as the knowledge of a truck assumes.
"""

import argparse
import math
from collections.abc import Mapping
from functools import cache
from typing import NamedTuple

import numpy as np

from fifthwheel.apps.workflow.measured_vehicle import roll_tested_vehicle
from fifthwheel.base.types import Array
from fifthwheel.base.units import STANDARD_GRAVITY
from fifthwheel.data.record import Record
from fifthwheel.estimate.identify import Identification, OneStage, identify
from fifthwheel.estimate.identify.knowledge.information import Occasion
from fifthwheel.estimate.identify.unknowns.parameters import stage_1_names
from fifthwheel.model.manoeuvres import lane_changes
from fifthwheel.model.plant import Plant, Sensor, measure
from fifthwheel.truck import Measured, RollTest, Vehicle
from fifthwheel.truck.quantities import MASS_SCALE, quantity_of
from fifthwheel.truck.roll_test import stiffness_of_rest
from fifthwheel.truck.uncertainty import changes
from knowledge import retyred
from trust_coverage import GYROS, INTERVAL, SPEED, STEER
from trust_runs import TRUCK, sensor_sigma, table

HEIGHT, STIFFNESS = "semitrailer.payload.height", "semitrailer.roll_stiffness"
SETTINGS = OneStage()
KNOWN = OneStage(given={HEIGHT: "exact", STIFFNESS: "+- 10 %"})
GYRO_ERRORS = ("misalignment", "delay", "gain")


class Load(NamedTuple):
    mass: float  # kg
    height: float  # m


LADEN, EMPTY = Load(20122.0, 1.23), Load(50.0, 0.1)
KNOWN_LOADS = {
    "with a log with 20.1 t, 0.8 m high": Load(20122.0, 0.8),
    "with a log with 10 t, 0.6 m high": Load(10000.0, 0.6),
    "with a log of the empty trailer": EMPTY,
}


class Draw(NamedTuple):
    """Errors of one truck, the same in all its logs, and the generator of all others."""

    factors: Mapping[str, float]
    changes: Mapping[str, float]
    gain: float
    steer_delay: float
    gyros: Mapping[str, tuple[float, ...]]  # `GYRO_ERRORS`
    rng: np.random.Generator
    scale: float | None  # error of the one scale of all loads, in standard deviations


def loaded(load: Load) -> Vehicle:
    p = TRUCK.parameters()
    mass = p["semitrailer.mass"] + load.mass - p["semitrailer.payload.mass"]
    truck = TRUCK.replace(
        {
            "semitrailer.mass": mass,
            "semitrailer.payload.mass": load.mass,
            HEIGHT: load.height,
            "semitrailer.yaw_inertia": p["semitrailer.yaw_inertia"] * mass / p["semitrailer.mass"],
        }
    )
    return retyred(truck)


@cache
def driven(load: Load) -> tuple[Array, Mapping[str, Array]]:
    run = Plant(loaded(load)).drive(lane_changes(count=1))
    return run.time, run.truth


def drawn(seed: int, one_scale: bool) -> Draw:
    rng = np.random.default_rng([seed, 5])
    factors = {}
    for path, value in TRUCK.parameters().items():
        row = quantity_of(path)
        if row.is_uncertain and value > 0 and path != "semitrailer.yaw_inertia":
            factors[path] = math.exp(row.sigma * rng.normal())

    def error(name: str) -> float:
        return sensor_sigma(name, SETTINGS) * rng.normal()

    return Draw(
        factors=factors,
        changes={change.name: rng.normal() for change in changes(TRUCK) if _is_shared(change.name)},
        gain=1 + error(f"{STEER}.gain"),
        steer_delay=error(f"{STEER}.delay") / 2,
        gyros={name: tuple(error(f"{name}.{kind}") for kind in GYRO_ERRORS) for name in GYROS},
        rng=rng,
        scale=np.random.default_rng([seed, 77]).normal() if one_scale else None,
    )


def _is_shared(change: str) -> bool:
    return change != MASS_SCALE and not change.endswith(("mass", "cog"))


def file_of(draw: Draw, load: Load) -> Vehicle:
    truck = loaded(load)
    values = truck.parameters()
    for change in changes(truck):
        z = draw.changes.get(change.name) or draw.rng.normal()
        z = draw.scale if draw.scale is not None and change.name == MASS_SCALE else z
        for path, slope in change.slopes.items():
            values[path] += z * slope
    for path, factor in draw.factors.items():
        values[path] *= factor
    for path in stage_1_names(truck):
        values[path] *= draw.rng.choice([0.8, 1.2])
    return truck.replace(values | {HEIGHT: load.height})


def logged(draw: Draw, load: Load) -> Record:
    time, truth = driven(load)
    offset = sensor_sigma(f"{STEER}.offset", SETTINGS) * draw.rng.normal()
    steer = np.interp(time - draw.steer_delay, time, truth[STEER]) / draw.gain + offset
    measured = {SPEED: truth[SPEED], STEER: steer}
    for name, (angle, latency, gain) in draw.gyros.items():
        yaw = name.startswith("yaw")
        other = name.replace("yaw", "roll") if yaw else name.replace("roll", "yaw")
        values = math.cos(angle) * truth[name] + (1 if yaw else -1) * math.sin(angle) * truth[other]
        bias = sensor_sigma(f"{name}.offset", SETTINGS) * draw.rng.normal()
        measured[name] = (1 + gain) * np.interp(time - latency, time, values) + bias
    sensors = {name: Sensor(variance=GYROS.get(name, 0.0)) for name in measured}
    return Record(time=time, signals=measure(time, measured, sensors, seed=int(draw.rng.integers(1 << 30))), name="log")


def tested(draw: Draw, file: Vehicle) -> Vehicle:
    """The file with the result of a static roll test: 2 t are moved by 0.9 m."""
    empty, load, shift, z = loaded(EMPTY), 2000.0, 0.9, 0.9
    trailer = empty.units[-1]
    (group,) = trailer.axle_groups
    stiffness = group.total_roll_stiffness + stiffness_of_rest(empty, trailer.name)
    roll = load * STANDARD_GRAVITY * shift / stiffness
    exact = (load, shift, roll, roll * (z - trailer.roll_axis_height), z)
    sigmas = (0.01 * load, 0.005, 0.02 * roll, 1.5e-4, 0.005)
    readings = [Measured(v + s * draw.rng.normal(), s) for v, s in zip(exact, sigmas, strict=True)]
    result = roll_tested_vehicle(file_of(draw, EMPTY), RollTest(trailer.name, *readings))
    return file.replace({path: result.parameters()[path] for path in result.stated}).with_stated(result.stated)


def results(seed: int, one_scale: bool) -> dict[str, Identification]:
    draw = drawn(seed, one_scale)
    file, record = file_of(draw, LADEN), logged(draw, LADEN)
    found = {"alone": identify([record], file, SETTINGS)}
    for name, load in KNOWN_LOADS.items():
        reference = identify([logged(draw, load)], file_of(draw, load), KNOWN, occasion=Occasion(load="known"))
        knowledge = reference.knowledge
        found[name] = identify([record], file, SETTINGS, knowledge=knowledge, occasion=Occasion(load="unknown"))
    found["with a static roll test"] = identify([record], tested(draw, file), SETTINGS)
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--one-scale", action="store_true", help="weigh all loads on one scale")
    arguments, of_seeds = parser.parse_args(), []
    for seed in range(arguments.seeds):
        of_seeds.append({name: found[HEIGHT] for name, found in results(seed, arguments.one_scale).items()})
        print(f"seed {seed}", flush=True)
    rows = []
    for name in of_seeds[0]:
        error = np.array([found[name].value / LADEN.height - 1 for found in of_seeds])
        sigma = np.array([(found[name].sigma or np.nan) / LADEN.height for found in of_seeds])
        rms, covered = np.sqrt(np.mean(error**2)), np.mean(np.abs(error) <= INTERVAL * sigma)
        rows.append((name, f"{np.mean(error):+.1%}", f"{rms:.1%}", f"{np.mean(sigma):.1%}", f"{covered:.0%}"))
    print("\n".join(table(("payload height", "mean error", "rms error", "mean sigma", "coverage of 90 %"), rows)))


if __name__ == "__main__":
    main()
