"""Error, sigma and coverage of estimates and states, by what is known of the truck and by what is driven.

    python benchmarks/sharpness.py [--seeds 100] [--first 5000] [--jobs 2] [--only careful.five ...]
    python benchmarks/sharpness.py --only careful.speeds --hide semitrailer -o tractor_only.md  # no trailer sensor

Every seed draws the errors of all numbers of the vehicle file and of all sensors from what is stated of them:

* class: nothing is stated, the defaults hold (`truck.uncertainty`, `OneStage`);
* careful: masses from a weighbridge, lengths from a tape, sensors of a known class (`CAREFUL`).

The linear truck has the speed and the steer angle of a run of the nonlinear truck. It is an extreme case: tyres without
friction limit, on a road without drag. An estimate of the linear truck is compared with the stiffness of the model, one
of the nonlinear truck with the nominal stiffness of the tyre model.
"""

import argparse
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, fields, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from fifthwheel.apps.studies.scenarios import initial_guess
from fifthwheel.base.errors import FifthwheelError
from fifthwheel.base.names import ParameterPath
from fifthwheel.base.types import Array
from fifthwheel.data.channels import SignalName
from fifthwheel.data.record import Record
from fifthwheel.estimate.identify import Identification, OneStage, identify
from fifthwheel.estimate.identify.sensor_errors import log_sensors
from fifthwheel.estimate.observe import Observer, ObserverSettings
from fifthwheel.model.manoeuvres import Course, lane_changes
from fifthwheel.model.manoeuvres.catalogue import course
from fifthwheel.model.plant import Plant, PlantRun, Properties
from fifthwheel.truck import Vehicle
from trust_coverage import (
    IDENTIFIED,
    UNSEEN,
    Sample,
    drawn_file,
    linear_signals,
    log_errors,
    measured_record,
    observed_samples,
    row,
    shared_errors,
)
from trust_runs import TRUCK

TAPE = {"position": 0.01, "leading_position": 0.02, "trailing_position": 0.01}
"""m, by the last word of a path: axles by tape, and a fifth wheel that can be slid."""
WEIGHED = {"tractor.mass": 0.005, "semitrailer.mass": 0.005, "semitrailer.payload.mass": 0.01}
"""Fractions: a static weighbridge."""
CAREFUL_COG = {"tractor.cog": 0.02, "semitrailer.cog": 0.04}
"""m, from axle loads of 0.5 %."""
CAREFUL = {
    "steer.*.gain": "+- 3 %",
    "steer.*.delay": "+- 20 ms",
    "steer.*.offset": "+- 0.005 rad",
    "misalignment": "+- 0.7 deg",
}
"""Of an automotive steering sensor, and of gyros on a bracket with the default gain."""


def careful_truck() -> Vehicle:
    """The truck with stated standard deviations of masses and lengths."""
    given = TRUCK.parameters()
    sigmas = {path: sigma for path in given if (sigma := TAPE.get(ParameterPath.of(path).quantity))}
    return TRUCK.with_stated(sigmas | CAREFUL_COG | {path: f * given[path] for path, f in WEIGHED.items()})


KNOWLEDGE: Mapping[str, tuple[Vehicle, Mapping[str, str]]] = {
    "class": (TRUCK, {}),
    "careful": (careful_truck(), CAREFUL),
}
"""The truck with what is stated of it, and what is stated of the sensors."""
SPEEDS = (50 / 3.6, 70 / 3.6, 88 / 3.6)
RUNS: Mapping[str, Sequence[Course]] = {
    "one": [lane_changes(count=1)],
    "five": [lane_changes(count=5)],
    "speeds": [lane_changes(count=5, speed=speed) for speed in SPEEDS],
    "everyday": [],
    "minutes": [],
}
"""One lane change; five; five at each of three speeds; everyday driving of 150 s and of ten minutes."""
DURATIONS = {"everyday": 150.0, "minutes": 600.0}


@dataclass(frozen=True, kw_only=True)
class Draw:
    """One seed of one case."""

    knowledge: str
    run: str
    nonlinear: bool
    seed: int
    settings: tuple[tuple[str, str | float], ...] = ()
    """Further settings of the identification, not of the draw; other keys are the names of statements."""
    hidden: tuple[str, ...] = ()
    """Units without sensors."""

    def seen(self, record: Record) -> Record:
        """A record without the signals of the hidden units."""
        hidden = {name for name in record.signals if SignalName.of(name).unit in self.hidden}
        return replace(record, signals={n: values for n, values in record.signals.items() if n not in hidden})

    def chosen(self, settings: OneStage) -> OneStage:
        """The settings of the identification."""
        names = {field.name for field in fields(settings)}
        own: dict[str, Any] = {key: value for key, value in self.settings if key in names}
        given = {key: value for key, value in self.settings if key not in names}
        return replace(settings, given={**settings.given, **given}, **own)


def courses(draw: Draw) -> Sequence[Course]:
    """The courses of the logs, then that of the unseen log."""
    duration = DURATIONS.get(draw.run)
    if duration:
        own = [course("everyday", TRUCK, duration=duration, seed=draw.seed)]
        return [*own, course("everyday", TRUCK, duration=60.0, seed=draw.seed + 1_000_000)]
    return [*RUNS[draw.run], lane_changes(count=1)]


@cache
def driven(path: Course, bank: float) -> PlantRun:
    """A run of the nonlinear truck on a road with a bank, rad."""
    return Plant(TRUCK, Properties(bank=bank)).drive(path)


def true_signals(path: Course, bank: float, nonlinear: bool) -> tuple[Array, Mapping[str, Array]]:
    """Time (N,) and true signals and states (N,) each of a run; bank in rad."""
    run = driven(path, bank if nonlinear else 0.0)
    return (run.time, run.truth) if nonlinear else linear_signals(run, bank)


def samples(draw: Draw) -> dict[str, Sample]:
    """Errors and sigmas of all estimates and states by name, as fractions and in rad; empty if a log is refused."""
    truck, given = KNOWLEDGE[draw.knowledge]
    settings, rng = OneStage(given=given), np.random.default_rng([draw.seed, 29])
    file, shared, paths = drawn_file(truck, rng), shared_errors(settings, rng), courses(draw)
    logs = []
    for i, path in enumerate(paths):
        errors = shared | log_errors(settings, rng)
        signals = true_signals(path, errors["bank"], draw.nonlinear)
        logs.append(draw.seen(measured_record(*signals, errors, f"log {i}", draw.seed * 100 + i)))
    try:
        result = identify(logs[:-1], initial_guess(file, draw.seed), draw.chosen(settings))
    except FifthwheelError as error:
        print(f"seed {draw.seed}: {error}", flush=True)
        return {}
    return dict(estimate_samples(result)) | dict(state_samples(result, logs[0], logs[-1]))


def estimate_samples(result: Identification) -> Iterator[tuple[str, Sample]]:
    """Of the estimated parameters, and of the CoG height."""
    truth = TRUCK.parameters() | TRUCK.derived()
    for e in (*result.parameters, *result.derived):
        if e.name in truth:
            error, sigma = e.value / truth[e.name] - 1, (e.sigma or 0.0) / truth[e.name]
            yield e.name, Sample(error=np.array([error]), sigma=np.array([sigma]), converged=e.verdict == "converged")


def state_samples(result: Identification, record: Record, unseen: Record) -> Iterator[tuple[str, Sample]]:
    """Of the first log as `fifthwheel identify` estimates them, and of another log as `fifthwheel states -i`."""
    sensors = log_sensors(result, unseen, result.vehicle)
    observers = {
        IDENTIFIED: (record, result.observer(log=record.name), result.uncertainty(record.name)),
        UNSEEN: (
            unseen,
            Observer(result.vehicle, unseen.signals, ObserverSettings(**sensors.settings)),
            sensors.uncertainty,
        ),
    }
    return observed_samples(observers)


def case_table(title: str, draws: Sequence[Draw], pool: ProcessPoolExecutor) -> list[str]:
    """The table of one case, as lines of Markdown."""
    results = []
    for i, result in enumerate(pool.map(samples, draws), 1):
        results += [result] if result else []
        print(f"[{i}/{len(draws)}] {title}", flush=True)
    heads = ("", "converged", "coverage", "mean error", "rms error", "mean sigma", "sigma / rms error")
    rows = [row(name, [result[name] for result in results if name in result]) for name in (results or [{}])[0]]
    lines = [f"## {title}", "", f"{len(results)} of {len(draws)} seeds.", ""]
    return [*lines, *(f"| {' | '.join(cells)} |" for cells in (heads, ["---"] * len(heads), *rows)), ""]


def main() -> None:
    """Run the cases and write sharpness.md."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=100)
    parser.add_argument("--first", type=int, default=5000, help="the first seed")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--only", nargs="*", default=["class.one", "careful.one", "careful.speeds", "careful.minutes"])
    parser.add_argument("--plants", nargs="*", default=["nonlinear", "linear"])
    parser.add_argument(
        "--set", nargs="*", default=[], help="settings of OneStage, such as tyres=linear, or statements"
    )
    parser.add_argument("--hide", nargs="*", default=[], help="units without sensors, such as semitrailer")
    parser.add_argument("-o", type=Path, default=Path(__file__).with_suffix(".md"))
    arguments = parser.parse_args()
    chosen = []
    for text in arguments.set:
        key, _, value = text.partition("=")
        try:
            chosen.append((key, float(value)))
        except ValueError:
            chosen.append((key, value))
    lines = ["# Sharpness", "", (__doc__ or "").split("\n\n", 2)[2], ""]
    with ProcessPoolExecutor(arguments.jobs) as pool:
        for case in arguments.only:
            knowledge, _, run = case.partition(".")
            for plant in arguments.plants:
                draws = [
                    Draw(
                        knowledge=knowledge,
                        run=run,
                        nonlinear=plant == "nonlinear",
                        seed=s,
                        settings=tuple(chosen),
                        hidden=tuple(arguments.hide),
                    )
                    for s in range(arguments.first, arguments.first + arguments.seeds)
                ]
                lines += case_table(f"{case}, {plant} truck", draws, pool)
                arguments.o.write_text("\n".join(lines), encoding="utf-8")


if __name__ == "__main__":
    main()
