"""Gross mass from ten minutes of ordinary driving: errors, sigma and coverage over random trucks, roads and sensors.

    python benchmarks/mass.py [--seeds 40] [--first 0] [--minutes 10] [--cases 3] [--nonlinear]

The truth is `model.plant.powered`, which shares no code with the estimator. Each seed draws a mass from 16 to 42 t, the
numbers and sensor errors of the truck (`DrivenTruck.drawn`), its driver, road, traffic and wind. The estimator has the
driveline of no vehicle file, only the figures of heavy trucks, and starts from 40.6 t.

With --nonlinear, the truth is the nonlinear truck with 21 to 42 t in everyday driving: no stops, but bends, wheels that
slip, a body that pitches, and wheels whose rolling radius follows the load.

The last row combines the result with the sum of the axle loads of a laden tractor-semitrailer, each with 2 %.
"""

import argparse
import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace

import numpy as np

import fifthwheel as fw
from fifthwheel.base.types import Array
from fifthwheel.data.record import Record
from fifthwheel.model.manoeuvres import everyday
from fifthwheel.model.plant import DrivenTruck, Plant, Properties, bus_sensors
from fifthwheel.model.plant.powered import drive

TRUCK = fw.vehicle("cheng_cebon_2011")
MASSES = (16e3, 42e3)
"""kg"""
EMPTY = 20_528.0
"""Of the nonlinear truck, kg."""
AXLE_LOADS = np.array([0.17, 0.26, 0.57])
"""Fractions of the mass on the axle groups."""
CASES = {
    "all signals": ((), False),
    "without driveline_engaged": (("driveline_engaged",), False),
    "with a grade channel": ((), True),
}


def nonlinear_drive(truck: DrivenTruck, duration: float, seed: int) -> Record:
    """The signals of the bus of the nonlinear truck in everyday driving."""
    vehicle = fw.with_payload(TRUCK, truck.mass - EMPTY)
    properties = Properties(drag_area=truck.drag_area, rolling_resistance=truck.rolling_resistance)
    course = everyday(duration=duration, seed=seed)
    run = Plant(vehicle, properties).drive(course, driven=truck, seed=seed, rate=50.0)
    return replace(run.record(bus_sensors(vehicle, truck), seed=seed), reference={"grade": run.truth["grade"]})


def outcome(arguments: tuple[int, float, int, bool]) -> Array:
    """True mass, and for each case mass, sigma and the part of the driving, kg; then the mass by axle loads."""
    seed, minutes, cases, nonlinear = arguments
    rng = np.random.default_rng([seed, 20])
    mass = float(rng.uniform(EMPTY + 500 if nonlinear else MASSES[0], MASSES[1]))
    truck, duration = DrivenTruck.drawn(mass, rng), 60 * minutes
    record = nonlinear_drive(truck, duration, seed) if nonlinear else drive(truck, duration=duration, seed=seed)
    row = [mass]
    for dropped, with_grade in list(CASES.values())[:cases]:
        signals = {name: values for name, values in record.signals.items() if name not in dropped}
        if with_grade:
            noise = 0.003 * rng.normal() + 0.002 * rng.normal(size=len(record))
            signals["grade"] = record.reference["grade"] + noise
        result = fw.gross_mass([Record(time=record.time, signals=signals, name=record.name)], TRUCK)
        row += [result.mass, result.sigma, result.parts["driving"]]
    weighed = mass * float(AXLE_LOADS @ (1 + 0.02 * rng.normal(size=AXLE_LOADS.size)))
    return np.array([*row, weighed])


def line(name: str, mass: Array, sigma: Array, driving: Array, true: Array) -> str:
    """A row of the table, in percent of the mass."""
    error, sigma, driving = (mass / true - 1) * 100, sigma / true * 100, driving / true * 100
    inside = np.abs(error) < 1.645 * sigma
    numbers = [
        np.sqrt(np.mean(error**2)),
        error.mean(),
        np.abs(error).max(),
        np.sqrt(np.mean(sigma**2)),
        driving.mean(),
    ]
    return " | ".join([f"| {name}", *(f"{number:.2f}" for number in numbers), f"{100 * inside.mean():.0f} |"])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=40)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--cases", type=int, default=len(CASES), help="Only the first ones.")
    parser.add_argument("--nonlinear", action="store_true", help="The nonlinear truck.")
    options = parser.parse_args()
    rows = []
    with ProcessPoolExecutor(2) as pool:
        seeds = range(options.first, options.first + options.seeds)
        for seed, row in zip(
            seeds,
            pool.map(outcome, [(seed, options.minutes, options.cases, options.nonlinear) for seed in seeds]),
            strict=True,
        ):
            rows.append(row)
            print(f"seed {seed}: {row[0] / 1e3:.1f} t, estimate {row[1] / 1e3:.1f} t", file=sys.stderr, flush=True)
    results = np.array(rows)
    true, weighed = results[:, 0], results[:, -1]
    print("| signals | rms error, % | mean error, % | largest, % | sigma, % | of the driving, % | covered by 90 %, % |")
    print("|---|---|---|---|---|---|---|")
    for k, name in enumerate(list(CASES)[: options.cases]):
        print(line(name, *results[:, 1 + 3 * k : 4 + 3 * k].T, true))
    mass, sigma, driving = results[:, 1:4].T
    of_loads = 0.02 * float(np.linalg.norm(AXLE_LOADS)) * weighed
    both = (mass / sigma**2 + weighed / of_loads**2) / (sigma**-2 + of_loads**-2)
    print(line("all signals, and axle loads of 2 % each", both, (sigma**-2 + of_loads**-2) ** -0.5, driving, true))


if __name__ == "__main__":
    main()
