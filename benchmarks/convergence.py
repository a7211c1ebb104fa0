"""Does every search converge, on logs of all kinds? Prints a line for each log, then a table.

    python benchmarks/convergence.py [--logs 100] [--first 0] [--jobs 2] [--longest 600] [--braking]

Every seed draws a truck (linear or nonlinear), a run, its duration, its brakes, the errors of the vehicle file, of all
sensors and of the guess, the delay of the trailer's logger and what of it the signal map corrects, single spikes and
bursts, a window that is cut out, sampling rates, and whether the tractor has an accelerometer. A log is right if all
stiffnesses and the yaw inertia are within 2 sigma.

With --braking, every run is four lane changes at a speed that falls at 0.2 to 1.5 m/s^2 and rises again, and half of
the logs have a switch of the service brakes.
"""

import argparse
import math
import time as clock
import warnings
from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from fifthwheel.apps.studies.scenarios import initial_guess
from fifthwheel.base.errors import FifthwheelError
from fifthwheel.base.types import Array
from fifthwheel.data.record import Record
from fifthwheel.estimate.identify import Identification, OneStage, identify
from fifthwheel.model.manoeuvres import Course, OpenLoop, lane_changes
from fifthwheel.model.manoeuvres.courses import everyday
from fifthwheel.model.plant import Plant, Properties
from trust_coverage import drawn_file, linear_signals, log_errors, measured_record, shared_errors
from trust_runs import TRUCK

BRAKES: Mapping[str, Mapping[str, float]] = {
    "retarder": {"tractor.drive": 1.0},
    "service": {},
    "both": {"tractor.drive": 0.6, "tractor.front": 0.15, "semitrailer": 0.25},
}
TRAILER = ("yaw_rate.semitrailer", "roll_rate.semitrailer")
LARGEST = {"speed": 50.0, "steer": 0.3, "yaw_rate": 5.0, "roll_rate": 5.0, "lateral_acceleration": 80.0}
"""Of a spike, SI."""


@dataclass(frozen=True, kw_only=True)
class Case:
    """What a seed draws."""

    seed: int
    nonlinear: bool
    course: Course
    brakes: str
    switch: bool
    what: str


def drawn_case(seed: int, longest: float, *, braking: bool) -> Case:
    """The truck and the run of a seed."""
    rng = np.random.default_rng([seed, 61])
    nonlinear, brakes, switch = bool(rng.random() < 0.7) or braking, str(rng.choice(list(BRAKES))), False
    if braking:
        deceleration, switch = float(rng.uniform(0.2, 1.5)), bool(rng.random() < 0.5)
        course: Course = slowed(lane_changes(count=4), deceleration)
        what = f"{deceleration:.2f} m/s^2{', switch' if switch else ''}"
    elif rng.random() < 0.35 or not nonlinear:
        count = int(rng.integers(1, 7))
        course = lane_changes(count=count, speed=rng.uniform(50, 88) / 3.6)
        what = f"{count} lane changes"
    else:
        duration = float(math.exp(rng.uniform(math.log(20), math.log(longest))))
        course, what = everyday(duration=duration, seed=seed), f"{duration:.0f} s everyday"
    return Case(seed=seed, nonlinear=nonlinear, course=course, brakes=brakes, switch=switch, what=what)


def slowed(course: Course, deceleration: float) -> Course:
    """The course with a speed that falls by 4 m/s, in m/s^2, and rises again at 0.3 m/s^2, again and again."""
    assert not isinstance(course, OpenLoop)
    speed, falls = course.speed.copy(), False
    first = float(speed[0])
    for i in range(1, speed.size):
        falls = speed[i - 1] > first - 4 if falls else course.arc[i] > 60 and speed[i - 1] >= first
        rate = -deceleration if falls else 0.3
        speed[i] = min(math.sqrt(speed[i - 1] ** 2 + 2 * rate * (course.arc[i] - course.arc[i - 1])), first)
    return replace(course, speed=speed)


def log_of(case: Case) -> tuple[Record, OneStage]:
    """The log of a case, as a map gives it, and the settings that state its sensors."""
    rng, settings = np.random.default_rng([case.seed, 62]), OneStage()
    errors = shared_errors(settings, rng) | log_errors(settings, rng)
    bank = errors["bank"] if case.nonlinear else 0.0
    run = Plant(TRUCK, Properties(bank=bank, brakes=BRAKES[case.brakes])).drive(case.course)
    time, truth = (run.time, run.truth) if case.nonlinear else linear_signals(run, errors["bank"])
    record = measured_record(time, truth, errors, "log", case.seed)
    signals = dict(record.signals)
    if case.switch:
        falls = np.gradient(truth["speed"], time) < -0.15
        signals["braking.tractor"] = np.where(falls & (case.brakes != "retarder"), 1.0, 0.0)
    if case.nonlinear and rng.random() < 0.4:
        name = "lateral_acceleration.tractor"
        offset, noise = 0.2 * rng.normal(), 0.15 * rng.normal(size=time.size)
        signals[name] = 1.02 * truth[name] + offset + noise
    late, corrected = (0.0, 0.0) if rng.random() < 0.5 else (0.25, 0.25 + 0.03 * rng.normal())
    for name in TRAILER if late else ():
        shifted = np.interp(time, time + late - corrected, signals[name])  # timestamps corrected by the map
        signals[name] = shifted
    if rng.random() < 0.5:  # a speed of the bus
        signals["speed"] = np.round(signals["speed"] * 256 * 3.6) / (256 * 3.6) + 0.03 * rng.normal(size=time.size)
        keep = np.arange(time.size) % 10 == 0
        keep[[0, -1]] = True
        signals["speed"] = np.where(keep, signals["speed"], np.nan)
    if rng.random() < 0.5:
        for _ in range(int(rng.integers(1, 8))):
            spike(signals, rng)
    if rng.random() < 0.3 and time[-1] > 30:
        start = rng.uniform(5, time[-1] - 10)
        cut = (time > start) & (time < start + rng.uniform(0.2, 3.0))
        signals = {name: np.where(cut, np.nan, values) for name, values in signals.items()}
    return replace(record, signals=signals), settings


def spike(signals: dict[str, Array], rng: np.random.Generator) -> None:
    """Add a spike of one to five samples to one of the signals."""
    name = str(rng.choice([name for name in signals if name.partition(".")[0] in LARGEST]))
    first, length = int(rng.integers(10, signals[name].size - 20)), int(rng.integers(1, 6))
    values = signals[name].copy()
    values[first : first + length] += rng.choice([-1, 1]) * LARGEST[name.partition(".")[0]] * rng.uniform(0.3, 1)
    signals[name] = values


def result_of(seed: int, longest: float, braking: bool) -> tuple[str, dict[str, float], float, int, str]:
    """What was drawn, z of the estimates by name, CPU in s, steps and a summary; no estimates after an error."""
    case = drawn_case(seed, longest, braking=braking)
    record, settings = log_of(case)
    file = drawn_file(TRUCK, np.random.default_rng([seed, 63]))
    start, what = clock.process_time(), f"{case.what}, {'nonlinear' if case.nonlinear else 'linear'}, {case.brakes}"
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            result = identify([record], initial_guess(file, seed), settings)
        except FifthwheelError as error:
            return what, {}, clock.process_time() - start, 0, f"refused: {error}"
        except Exception as error:  # what must not happen is counted
            return what, {}, clock.process_time() - start, 0, f"CRASHED: {type(error).__name__}: {error}"
    return what, z_of(result), clock.process_time() - start, result.rounds, summary_of(result)


def z_of(result: Identification) -> dict[str, float]:
    """Errors of the estimated parameters over their sigma, by name."""
    truth = TRUCK.parameters()
    return {e.name: (e.value - truth[e.name]) / e.sigma for e in result.parameters if e.name in truth and e.sigma}


def summary_of(result: Identification) -> str:
    """Verdicts and doubts."""
    verdicts = " ".join(str(e.verdict)[:5] for e in result.parameters)
    return f"{verdicts} {[(str(d.kind), [c.name for c in d.causes]) for d in result.doubts]}"


def main() -> None:
    """Identify the logs."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--logs", type=int, default=100)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--longest", type=float, default=600.0, help="duration, s")
    parser.add_argument("--braking", action="store_true")
    arguments = parser.parse_args()
    seeds, counts, cpu = range(arguments.first, arguments.first + arguments.logs), dict[str, int](), 0.0
    all_z = list[float]()
    of_all = partial(result_of, longest=arguments.longest, braking=arguments.braking)
    with ProcessPoolExecutor(arguments.jobs) as pool:
        for seed, found in zip(seeds, pool.map(of_all, seeds), strict=True):
            what, z, seconds, steps, text = found
            right = bool(z) and max(map(abs, z.values())) < 2
            outcome = text.split(":")[0] if not z else "not converged" if "not_c" in text else "converged"
            outcome += "" if not z else ", right" if right else ", beyond 2 sigma"
            counts[outcome], cpu = counts.get(outcome, 0) + 1, cpu + seconds
            doubted = bool(z) and not text.endswith(" []")
            counts["doubted"] = counts.get("doubted", 0) + doubted
            all_z += z.values()
            shown = " ".join(f"{value:+.1f}" for value in z.values())
            print(f"{seed}: {what}: {outcome}, {steps} steps, {seconds:.0f} s: {shown} {text}", flush=True)
    within = np.mean(np.abs(all_z) < 1.645)
    print({**counts, "within 90 %": f"{100 * within:.0f} %", "cpu": round(cpu)})


if __name__ == "__main__":
    main()
