"""Articulation angle of the trailer from signals of the tractor: error, sigma and coverage.

    python benchmarks/articulation.py [--seeds 20] [--first 9400] [--minutes 4] [--jobs 2] [--only careful class]
                                      [--hide engine_torque]

The nonlinear truck drives by engine and gears on hilly, banked roads in wind. Each seed draws the errors of all numbers
of the vehicle file and of all sensors as in sharpness.py:

* class: nothing is stated, the defaults hold (`truck.uncertainty`, `OneStage`);
* careful: masses from a weighbridge, lengths from a tape, sensors of a known class (`CAREFUL`).

The signals are those that most tractors have, at 25 Hz: speed, steer angle, yaw rate and lateral acceleration; the
trailer has none. Engine speed and torque, clutch and brakes, as the bus has them, give the grade. Speed is exact. The
accelerometer has offset, gain, delay and place drawn from the priors of `OneStage`. One everyday drive is identified.
States are those of this log, of an unseen everyday drive of two minutes and of unseen turns of 90 degrees at 6 m/s with
a radius of 20 m, the last two with offsets and banks of their own.
"""

import argparse
import math
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from fifthwheel.apps.studies.scenarios import initial_guess
from fifthwheel.base.errors import FifthwheelError
from fifthwheel.base.types import Array
from fifthwheel.data.record import Record
from fifthwheel.estimate.identify import OneStage, identify
from fifthwheel.estimate.identify.sensor_errors import log_sensors
from fifthwheel.estimate.observe import Observer, ObserverSettings
from fifthwheel.model.manoeuvres import Course, everyday, slow_turns
from fifthwheel.model.plant import DrivenTruck, Plant, Properties, Sensor, bus_sensors, measure
from sharpness import KNOWLEDGE
from trust_coverage import INTERVAL, drawn_file, log_errors, measured_record, shared_errors
from trust_runs import TRUCK, sensor_sigma

ANGLE, ACCELERATION = "articulation.semitrailer", "lateral_acceleration.tractor"
SIGNALS = ("speed", "steer.tractor.front", "yaw_rate.tractor")
ENGINE = ("engine_speed", "engine_torque", "friction_torque", "driveline_engaged", "braking.tractor")
RATE = 25.0
"""Hz"""
FAST = 30 / 3.6
"""m/s; the target of 0.5 deg holds above it."""
CASES = {
    "identified drive, above 30 km/h": 0.5,
    "unseen drive, above 30 km/h": 0.5,
    "unseen slow turns": 1.5,
}
"""Targets, deg rms."""
Samples = Mapping[str, tuple[Array, Array]]
"""Error and sigma of each sample, rad, by case."""


def accelerometer(settings: OneStage, rng: np.random.Generator) -> dict[str, float]:
    """Errors of the accelerometer that all logs share, SI."""
    kinds = ("gain", "delay", "position", "height")
    errors = {kind: sensor_sigma(f"{ACCELERATION}.{kind}", settings) * rng.normal() for kind in kinds}
    return errors | {"gain": 1 + errors["gain"]}


def log(
    path: Course,
    driven: DrivenTruck,
    errors: Mapping[str, float],
    sensor: Mapping[str, float],
    offset: float,
    seed: int,
) -> Record:
    """A log of the tractor's signals, with the true articulation angle as reference."""
    run = Plant(TRUCK, Properties(bank=errors["bank"])).drive(path, driven=driven, seed=seed, rate=RATE)
    time, truth = run.time, run.truth
    arms = sensor["position"] * np.gradient(truth["yaw_rate.tractor"], time)
    arms -= sensor["height"] * np.gradient(truth["roll_rate.tractor"], time)
    late = np.interp(time - sensor["delay"], time, truth[ACCELERATION] + arms)
    noisy = measure(
        time, {ACCELERATION: sensor["gain"] * late + offset}, {ACCELERATION: Sensor(variance=0.05**2)}, seed=seed
    )
    record = measured_record(time, truth, errors, f"{path.name} {seed}", seed)
    bus = {name: sensor for name, sensor in bus_sensors(TRUCK, run.driven).items() if name in ENGINE}
    signals = {name: record.signals[name] for name in SIGNALS} | noisy | measure(time, truth, bus, seed=seed)
    return replace(record, signals=signals, reference={ANGLE: truth[ANGLE]})


def samples(seed: int, knowledge: str, minutes: float, hidden: Sequence[str] = ()) -> Samples:
    """Errors and sigmas of one seed without some signals; empty if a log is refused."""
    truck, given = KNOWLEDGE[knowledge]
    settings, rng = OneStage(given=given), np.random.default_rng([seed, 37])
    file, shared, sensor = drawn_file(truck, rng), shared_errors(settings, rng), accelerometer(settings, rng)
    driven = DrivenTruck.drawn(1.0, rng)
    courses = everyday(duration=60 * minutes, seed=seed), everyday(duration=120.0, seed=seed + 1_000_000), slow_turns()
    logs = []
    for i, path in enumerate(courses):
        offset = sensor_sigma(f"{ACCELERATION}.offset", settings) * rng.normal()
        record = log(path, driven, shared | log_errors(settings, rng), sensor, offset, 10 * seed + i)
        logs.append(replace(record, signals={k: v for k, v in record.signals.items() if k not in hidden}))
    try:
        result = identify(logs[:1], initial_guess(file, seed), settings)
    except FifthwheelError as error:
        print(f"seed {seed}: {error}", flush=True)
        return {}
    found = [_errors(logs[0], result.observer(log=logs[0].name), result.uncertainty(logs[0].name))]
    for unseen in logs[1:]:
        sensors = log_sensors(result, unseen, result.vehicle)
        observer = Observer(result.vehicle, unseen.signals, ObserverSettings(**sensors.settings))
        found.append(_errors(unseen, observer, sensors.uncertainty))
    return dict(zip(CASES, found, strict=True))


def _errors(record: Record, observer: Observer, uncertainty: object) -> tuple[Array, Array]:
    """Error and sigma of the articulation angle, rad, above 30 km/h, and of slow turns everywhere."""
    states = observer.batch(record, uncertainty)
    error = states.values[ANGLE] - record.reference[ANGLE]
    used = np.isfinite(error) & ((record.signals["speed"] > FAST) | record.name.startswith("slow_turns"))
    return error[used], states.sigma[ANGLE][used]


def row(case: str, results: Sequence[Samples]) -> str:
    """A row of the table, in degrees; the rms of each seed, and the coverage of all samples."""
    of_seeds = [tuple(np.degrees(x) for x in result[case]) for result in results]
    rms = np.array([np.sqrt(np.mean(error**2)) for error, _ in of_seeds])
    error, sigma = (np.concatenate(parts) for parts in zip(*of_seeds, strict=True))
    covered = np.array([np.mean(np.abs(e) <= INTERVAL * s) for e, s in of_seeds])
    numbers = (np.sqrt(np.mean(rms**2)), np.median(rms), rms.max(), error.mean(), np.sqrt(np.mean(sigma**2)))
    error = f" ± {100 * covered.std(ddof=1) / math.sqrt(len(covered)):.0f}" if len(covered) > 1 else ""
    cells = [case, f"{CASES[case]:g}", *(f"{number:.2f}" for number in numbers)]
    return f"| {' | '.join(cells)} | {100 * covered.mean():.0f}{error} |"


def table(knowledge: str, results: Sequence[Samples], count: int) -> list[str]:
    """The table of one knowledge, as lines of Markdown."""
    head = ("states of", "target", "rms", "median seed", "worst seed", "mean error", "sigma", "covered, %")
    lines = [f"## {knowledge}", "", f"{len(results)} of {count} seeds.", "", f"| {' | '.join(head)} |"]
    return [*lines, "|---" * len(head) + "|", *(row(case, results) for case in (CASES if results else ())), ""]


def main() -> None:
    """Run the seeds and write articulation.md."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--first", type=int, default=9400, help="the first seed")
    parser.add_argument("--minutes", type=float, default=4.0, help="of the identified drive")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--only", nargs="*", default=["careful", "class"], choices=list(KNOWLEDGE))
    parser.add_argument("--hide", nargs="*", default=[], metavar="SIGNAL", help="signals to leave out of the logs")
    parser.add_argument("-o", type=Path, default=Path(__file__).with_suffix(".md"))
    arguments = parser.parse_args()
    lines = ["# Articulation from tractor signals", "", (__doc__ or "").split("\n\n", 2)[2], ""]
    lines += ["Degrees. The 90 % intervals should contain 85 to 95 % of the true angles; ± is one standard error.", ""]
    seeds = range(arguments.first, arguments.first + arguments.seeds)
    with ProcessPoolExecutor(arguments.jobs) as pool:
        for knowledge in arguments.only:
            results, done = list[Samples](), 0
            run = partial(samples, knowledge=knowledge, minutes=arguments.minutes, hidden=arguments.hide)
            for done, result in enumerate(pool.map(run, seeds), 1):
                results += [result] if result else []
                print(f"{knowledge}, seed {seeds[done - 1]}", *(row(c, [result]) for c in result), sep="\n", flush=True)
                text = "\n".join([*lines, *table(knowledge, results, done)])
                arguments.o.write_text(text, encoding="utf-8")
            lines += table(knowledge, results, done)


if __name__ == "__main__":
    main()
