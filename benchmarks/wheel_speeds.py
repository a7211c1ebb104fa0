"""What wheel speeds of one trailer axle give, where the trailer has no gyro.

On the nonlinear truck, two lane changes at each of 50, 70 and 88 km/h. Drawn errors of all numbers of the vehicle file,
of all sensors and of the track, as in sharpness.py (careful). The wheel speeds have a noise of 0.02 m/s, a resolution
of 1/256 km/h, 20 values a second, a latency of up to 60 ms, and rolling radii that differ by 0.5 % (standard deviation)
between the sides. The rolling radii follow the wheel loads by the Magic Formula.

    python benchmarks/wheel_speeds.py --seeds 5 --first 8000 [--learner [--noise 0.002]]

prints error and sigma of each parameter, with the tractor's gyros alone, with wheel speeds and with gyros of the
trailer, and the estimated and the true difference of the rolling radii; of one stage, or of a learner with linear
tyres, which learns from one log after the other, with one difference of the radii.
"""

import argparse
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from fifthwheel.apps.studies.scenarios import initial_guess
from fifthwheel.data.record import Record
from fifthwheel.estimate.identify import OneStage, identify
from fifthwheel.estimate.online import Learner
from fifthwheel.model.manoeuvres import lane_changes
from fifthwheel.model.plant import Plant, Properties
from fifthwheel.model.plant.sensors import Sensor, measure
from fifthwheel.truck import Vehicle
from sharpness import CAREFUL, SPEEDS, careful_truck
from trust_coverage import INTERVAL, drawn_file, log_errors, measured_record, shared_errors
from trust_runs import TRUCK, sensor_sigma

AXLE = "semitrailer.middle"
NAME = f"wheel_speed_difference.{AXLE}"
OFFSET = f"{NAME}.offset"
PARAMETERS = (
    "tractor.front.cornering_stiffness",
    "tractor.drive.cornering_stiffness",
    "semitrailer.cornering_stiffness",
    "semitrailer.yaw_inertia",
)
SENSORS = {"tractor alone": (), "wheel speeds": ("wheel_speed",), "trailer gyros": ("yaw_rate", "roll_rate")}
"""Signals of the trailer by case."""


@dataclass(frozen=True, kw_only=True)
class Result:
    """Errors and sigmas of one case."""

    parameters: Mapping[str, tuple[float, float]]
    """As fractions."""
    offsets: Sequence[tuple[float, float]]
    """Estimated less true difference of the rolling radii of each log."""


def wheel_speeds(
    truth: Mapping[str, np.ndarray], time: np.ndarray, difference: float, latency: float, seed: int
) -> dict[str, np.ndarray]:
    """Measured wheel speeds of the axle, with a relative difference of the rolling radii, right less left."""
    common = {"variance": 0.02**2, "quantisation": 1 / 256 / 3.6, "rate": 20.0, "latency": latency}
    scales = {"left": 1 - difference / 2, "right": 1 + difference / 2}
    sensors = {f"wheel_speed.{AXLE}.{side}": Sensor(scale=scale, **common) for side, scale in scales.items()}
    return measure(time, truth, sensors, seed=seed)


def of_seed(seed: int, cases: Sequence[str], *, learner: bool = False, noise: float | None = None) -> dict[str, Result]:
    """The results of one seed by case; `noise` is stated of the wheel speed difference."""
    stated = {} if noise is None else {NAME: noise**2}
    settings, rng = OneStage(given=CAREFUL, noise=stated), np.random.default_rng([seed, 31])
    file, shared = drawn_file(careful_truck(), rng), shared_errors(settings, rng)
    latency, half_track = rng.uniform(0, 0.06), 1 + sensor_sigma(f"{NAME}.gain", settings) * rng.normal()
    records, differences = [], []
    for i, speed in enumerate(SPEEDS):
        errors = shared | log_errors(settings, rng)
        properties = Properties(bank=errors["bank"], half_track=half_track)
        run = Plant(TRUCK, properties).drive(lane_changes(count=2, speed=speed))
        record = measured_record(run.time, run.truth, errors, f"log {i}", 100 * seed + i)
        drawn = sensor_sigma(OFFSET, settings) * rng.normal()
        differences.append(differences[0] if learner and differences else drawn)
        wheels = wheel_speeds(run.truth, run.time, differences[-1], latency, 100 * seed + i)
        records.append(record.with_signals(wheels))
    truth, results = TRUCK.parameters(), {}
    for case in cases:
        seen = [_seen(record, SENSORS[case]) for record in records]
        result = (_learned if learner else identify)(seen, initial_guess(file, seed), settings)
        estimates = {name: result[name] for name in PARAMETERS}
        offsets = [e for e in result.sensors if e.name == OFFSET]
        results[case] = Result(
            parameters={n: (e.value / truth[n] - 1, (e.sigma or 0.0) / truth[n]) for n, e in estimates.items()},
            offsets=[(e.value - d, e.sigma) for e, d in zip(offsets[::-1], differences[::-1], strict=False)],
        )
    return results


def _learned(records: Sequence[Record], vehicle: Vehicle, settings: OneStage) -> Learner:
    """A learner after all records, an hour apart."""
    learner = Learner(vehicle, records[0].signals, replace(settings, tyres="linear"))
    for i, record in enumerate(records):
        learner.learn(replace(record, time=record.time + 3600.0 * i))
    return learner


def _seen(record: Record, of_trailer: Sequence[str]) -> Record:
    """The record with some signals of the trailer only."""
    signals = {
        name: values
        for name, values in record.signals.items()
        if ".semitrailer" not in name or name.startswith(tuple(of_trailer) or ("none",))
    }
    return Record(time=record.time, signals=signals, name=record.name)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--first", type=int, default=7000, help="the first seed")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--cases", nargs="*", default=list(SENSORS), choices=list(SENSORS))
    parser.add_argument("--learner", action="store_true", help="learn in place of one stage")
    parser.add_argument(
        "--noise", type=float, help="of the wheel speed difference, one sigma; a learner does not fit it"
    )
    arguments = parser.parse_args()
    seeds = range(arguments.first, arguments.first + arguments.seeds)
    run, results = partial(of_seed, cases=arguments.cases, learner=arguments.learner, noise=arguments.noise), []
    with ProcessPoolExecutor(arguments.jobs) as pool:
        for seed, result in zip(seeds, pool.map(run, seeds), strict=True):
            results.append(result)
            print(seed, {case: each.parameters for case, each in result.items()}, flush=True)
    print(
        "\n| parameter | trailer's sensors | rms error | mean sigma | 90 % intervals contain |\n|---|---|---|---|---|"
    )
    for name in PARAMETERS:
        for case in arguments.cases:
            _print_row(name, case, [r[case].parameters[name] for r in results])
    if "wheel speeds" in arguments.cases:
        _print_row("difference of the radii", "wheel speeds", [o for r in results for o in r["wheel speeds"].offsets])


def _print_row(name: str, case: str, samples: Sequence[tuple[float, float]]) -> None:
    error, sigma = np.array(samples).T
    covered = np.mean(np.abs(error) <= INTERVAL * sigma)
    print(f"| {name} | {case} | {np.sqrt(np.mean(error**2)):.2%} | {np.mean(sigma):.2%} | {covered:.0%} |")


if __name__ == "__main__":
    main()
