"""Is a result honest where the driving says little? Prints a line for each log, then a table by kind and truck.

    python benchmarks/quasi_steady.py [--seeds 40] [--first 0] [--jobs 2] [--kinds turn ramp ...] [--trucks linear ...]

Every seed draws the run, the errors of the vehicle file, of all sensors and of the guess. The foreign truck is the
nonlinear one with drawn tyre curves, aligning moments, steering compliance, roll steer and frame torsion, none of which
the model has. The columns: logs that end with an error; converged estimates, those within their 90 % interval and those
beyond 3 sigma; in how many logs yaw inertia or payload height converge; doubted results; sideslip of both units in the
samples with the status OK: how many these are, rms error, rms sigma and how many are within the 90 % interval.
"""

import argparse
import math
import warnings
from collections.abc import Callable, Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field

import numpy as np

from fifthwheel.apps.studies.scenarios import initial_guess
from fifthwheel.base.errors import FifthwheelError
from fifthwheel.base.types import Array
from fifthwheel.estimate.identify import OneStage, identify
from fifthwheel.estimate.observe import Status
from fifthwheel.model.manoeuvres import Course, OpenLoop, lane_changes
from fifthwheel.model.manoeuvres.courses import everyday
from fifthwheel.model.manoeuvres.open_loops import single_track_steer
from fifthwheel.model.plant import Plant, Properties
from fifthwheel.model.plant.properties import MagicFormula
from trust_coverage import drawn_file, linear_signals, log_errors, measured_record, shared_errors
from trust_runs import TRUCK, table

TRUCKS = ("linear", "nonlinear", "foreign")
INTERVAL = 1.645
UNKNOWABLE = ("semitrailer.yaw_inertia", "semitrailer.payload.height")
"""In a constant turn."""
RATE = 100.0
"""Hz"""
START = 20.0
"""Time of a turn before its log begins, s."""


def open_loop(name: str, acceleration: Array, speed: float) -> OpenLoop:
    """A run at constant speed, m/s, with steer angles for a steady lateral acceleration, m/s^2."""
    steer = acceleration * single_track_steer(TRUCK, speed, 1.0)
    time = np.arange(len(steer)) / RATE
    return OpenLoop(time=time, steer=steer, speed=np.full_like(time, speed), name=name)


def times(duration: float) -> Array:
    """At RATE."""
    return np.arange(round(duration * RATE)) / RATE


def turn(rng: np.random.Generator) -> Course:
    """A constant turn, with the way into it in half of the runs."""
    t = times(START + rng.uniform(30, 80))
    begin = START - 12 if rng.random() < 0.5 else START + 3
    return open_loop("turn", rng.uniform(0.7, 2.2) * np.clip((t - begin) / 4, 0, 1), rng.uniform(10, 22))


def ramp(rng: np.random.Generator) -> Course:
    """A slow ramp of the steer angle."""
    t = times(rng.uniform(40, 80))
    return open_loop("ramp", rng.uniform(1.5, 2.8) * np.clip((t - 2) / (t[-1] - 2), 0, 1), rng.uniform(10, 22))


def sine(rng: np.random.Generator) -> Course:
    """A slow sine."""
    period = rng.uniform(15, 40)
    t = times(3 * period)
    return open_loop("sine", rng.uniform(0.7, 2.0) * np.sin(2 * np.pi * t / period), rng.uniform(12, 24))


def motorway(rng: np.random.Generator) -> Course:
    """Gentle bends at 80 to 88 km/h, smoothed over seconds."""
    t = times(rng.uniform(120, 300))
    noise = rng.normal(size=t.size)
    width = round(rng.uniform(4, 8) * RATE)
    window = np.hanning(width)
    smooth = np.convolve(noise, window, mode="same")
    return open_loop("motorway", rng.uniform(0.2, 0.5) * smooth / smooth.std(), rng.uniform(80, 88) / 3.6)


def roundabouts(rng: np.random.Generator) -> Course:
    """Three roundabouts: to the right, then to the left for a while, and to the right."""
    t, acceleration = times(90.0), np.zeros(9000)
    for start in (5.0, 33.0, 61.0):
        half, level = rng.uniform(4, 8), rng.uniform(1.0, 2.0)
        for begin, length, side in ((0.0, 3.0, -0.6), (4.0, half, 1.0), (5.0 + half, 3.0, -0.6)):
            inside = (t - start - begin) / length
            acceleration += side * level * np.clip(4 * np.minimum(inside, 1 - inside), 0, 1)
    return open_loop("roundabouts", acceleration, rng.uniform(7, 10))


def changes(rng: np.random.Generator) -> Course:
    """Lane changes, for comparison."""
    return lane_changes(count=int(rng.integers(1, 4)), speed=rng.uniform(60, 88) / 3.6)


def mixed(rng: np.random.Generator) -> Course:
    """Everyday driving, for comparison."""
    return everyday(duration=rng.uniform(100, 240), seed=int(rng.integers(1 << 30)))


KINDS: Mapping[str, Callable[[np.random.Generator], Course]] = {
    f.__name__: f for f in (turn, ramp, sine, motorway, roundabouts, changes, mixed)
}


def foreign(rng: np.random.Generator, bank: float) -> Properties:
    """A truck of another structure."""
    tyre = MagicFormula(
        PCY1=rng.uniform(1.1, 1.65),
        PEY1=rng.uniform(-0.6, 0.4),
        PDY1=rng.uniform(0.65, 0.9),
        PKY2=rng.uniform(2.2, 3.6),
    )
    return Properties(
        tyre=tyre,
        bank=bank,
        aligning=rng.uniform(0.5, 1.2),
        steering_compliance=rng.uniform(0.0, 2e-6),
        roll_steer={"tractor.drive": rng.uniform(-0.05, 0.1), "semitrailer": rng.uniform(-0.05, 0.1)},
        frame_torsion=rng.uniform(1e6, 4e6),
    )


@dataclass(kw_only=True)
class Outcome:
    """Of one log."""

    error: str = ""
    z: dict[str, float] = field(default_factory=dict)
    """Errors over sigma of the converged estimates."""
    doubts: list[str] = field(default_factory=list)
    slip: list[tuple[Array, Array]] = field(default_factory=list)
    """Error and sigma, rad, of the sideslip of each unit in the samples with the status OK."""
    samples: int = 0


def outcome(case: tuple[int, str, str]) -> Outcome:
    """Identify one log."""
    seed, kind, truck = case
    rng, settings = np.random.default_rng([seed, 71, list(KINDS).index(kind)]), OneStage()
    errors = shared_errors(settings, rng) | log_errors(settings, rng)
    course, bank = KINDS[kind](rng), errors["bank"] if truck != "linear" else 0.0
    run = Plant(TRUCK, foreign(rng, bank) if truck == "foreign" else Properties(bank=bank)).drive(course, rate=RATE)
    time, truth = (run.time, run.truth) if truck != "linear" else linear_signals(run, errors["bank"])
    if kind == "turn":
        truth = {name: values[time >= START] for name, values in truth.items()}
        time = time[time >= START] - START
    record = measured_record(time, truth, errors, "log", seed)
    file = drawn_file(TRUCK, np.random.default_rng([seed, 72]))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            result = identify([record], initial_guess(file, seed), settings)
            states = result.observer(log=record.name).batch(record, result.uncertainty(record.name))
        except FifthwheelError as error:
            return Outcome(error=f"refused: {error}")
        except Exception as error:  # what must not happen is counted
            return Outcome(error=f"CRASHED: {type(error).__name__}: {error}")
    true, found = TRUCK.parameters(), Outcome(samples=len(time))
    for e in result.parameters:
        if e.verdict == "converged" and e.sigma and e.name in true:
            found.z[e.name] = (e.value - true[e.name]) / e.sigma
    found.doubts = [f"{d.kind}: {', '.join(c.name for c in d.causes)}" for d in result.doubts]
    ok = np.asarray(states.status) == Status.OK
    for unit in ("tractor", "semitrailer"):
        name = f"sideslip.{unit}"
        error = states.values[name] - record.reference[name]
        found.slip.append((error[ok], states.sigma[name][ok]))
    return found


def row(kind: str, truck: str, found: list[Outcome]) -> tuple[str, ...]:
    """Of a table."""
    z = np.array([value for f in found for value in f.z.values()])
    cells = [f"{kind}, {truck}", str(sum(bool(f.error) for f in found)), str(z.size)]
    cells += [f"{100 * np.mean(np.abs(z) < INTERVAL):.0f} %" if z.size else "-", str(np.sum(np.abs(z) > 3))]
    cells += [str(sum(name in f.z for f in found)) for name in UNKNOWABLE]
    cells.append(str(sum(bool(f.doubts) for f in found)))
    slips = [f.slip for f in found if f.slip]
    for unit in range(2):
        error, sigma = (np.concatenate([np.zeros(0), *[s[unit][i] for s in slips]]) for i in (0, 1))
        if unit == 0:
            cells.append(f"{100 * error.size / max(sum(f.samples for f in found), 1):.0f} %")
        if error.size:
            rms = [f"{math.degrees(np.sqrt(np.mean(x**2))):.2f}" for x in (error, sigma)]
            cells.append(f"{rms[0]} ({rms[1]}), {100 * np.mean(np.abs(error) < INTERVAL * sigma):.0f} %")
        else:
            cells.append("-")
    return tuple(cells)


def main() -> None:
    """Identify the logs."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=40)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--kinds", nargs="*", choices=KINDS, default=list(KINDS))
    parser.add_argument("--trucks", nargs="*", choices=TRUCKS, default=TRUCKS)
    arguments = parser.parse_args()
    heads = ("log", "errors", "converged", "within 90 %", "beyond 3 sigma", "yaw inertia", "height", "doubted", "OK")
    rows = []
    with ProcessPoolExecutor(arguments.jobs) as pool:
        for kind in arguments.kinds:
            for truck in arguments.trucks:
                cases = [(seed, kind, truck) for seed in range(arguments.first, arguments.first + arguments.seeds)]
                found = list(pool.map(outcome, cases))
                for (seed, *_), f in zip(cases, found, strict=True):
                    shown = " ".join(f"{name.split('.')[0][:4]}.{name[-9:]} {z:+.1f}" for name, z in f.z.items())
                    print(f"{kind}, {truck}, {seed}: {f.error or shown} {'; '.join(f.doubts)}", flush=True)
                rows.append(row(kind, truck, found))
                print(rows[-1], flush=True)
    units = ("sideslip tractor: rms (sigma), within 90 %, deg", "semitrailer")
    print("\n".join(table((*heads, *units), rows)))


if __name__ == "__main__":
    main()
