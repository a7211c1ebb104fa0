"""Knowledge of a truck from logs: its dependence on the order of the logs, bad logs, and logs with several loads.

    python benchmarks/knowledge.py [--seeds 16] [--first 7000] [--jobs 1] [--plants nonlinear linear]

Every seed draws the errors of all numbers of the vehicle file and of all sensors from what is stated of them
(`sharpness.CAREFUL`). Gains, delays and misalignments are the same in all logs of a seed. Each log has its own offsets,
bank, and cornering stiffness of each axle group (2.5 %). A log is one lane change.

* Order: four logs at 60, 70, 80 and 88 km/h in one call; one after another; in reverse order; each alone, combined
  afterwards as by `fifthwheel fleet`; and learned on line, where the knowledge of the learner counts.
* Fifth log: after the four logs in order, a fifth at 75 km/h, which is good or has an error (`BAD`).
* Two loads: a log at 80 km/h with the payload of unknown height, alone and after a log of the trailer with a known load
  of 500 kg. Both trucks have the same tyres: the cornering stiffness at each load follows from the tyre model.
* Ten trips: three loads in turn, each of another unknown height, after the log of the nearly empty trailer.

Coverage counts errors below 2 sigma; 95 % are nominal. Errors and sigmas are in per cent of the true value.
"""

import argparse
import datetime
import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from fifthwheel.apps.studies.scenarios import initial_guess
from fifthwheel.base.errors import FifthwheelError
from fifthwheel.base.types import Array
from fifthwheel.data.record import Record
from fifthwheel.estimate.identify import Identification, OneStage, identify
from fifthwheel.estimate.identify.knowledge.information import LogKnowledge, Occasion
from fifthwheel.estimate.identify.knowledge.knowledge import Knowledge
from fifthwheel.estimate.online import Learner
from fifthwheel.model.manoeuvres import lane_changes
from fifthwheel.model.plant import MagicFormula, Plant, Properties
from fifthwheel.truck import Vehicle
from fifthwheel.truck.quantities import FRICTION, quantity_of
from sharpness import CAREFUL, WEIGHED, careful_truck
from trust_coverage import STEER, drawn_file, linear_signals, log_errors, measured_record, shared_errors
from trust_runs import TRUCK, table

SPEEDS = (60.0, 70.0, 80.0, 88.0)
"""km/h"""
FIFTH_SPEED, LADEN_SPEED = 75.0, 80.0
WAYS = ("in one call", "one after another", "in reverse order", "each alone, combined", "learned on line")
BAD = {
    "good": "none",
    "late": "steer angle 0.25 s late",
    "trailer": "another trailer: 40 % less mass, half the yaw inertia, wheelbase 1 m shorter",
    "tyres": "trailer tyres 20 % softer",
    "gyro": "gain of the tractor's yaw rate 5 % off",
}
HEIGHT, STIFFNESS = "semitrailer.payload.height", "semitrailer.cornering_stiffness"
TYRES = {"tractor.front": 2, "tractor.drive": 4, "semitrailer": 6}
OWN = tuple(f"semitrailer.{key}" for key in ("mass", "cog", "yaw_inertia", "sprung.mass", "payload.mass"))
"""Numbers of the vehicle file that are stated anew for every load."""
LOADS = {"empty": (500.0, 0.2), "steel": (20122.0, 0.9), "laden": (20122.0, 1.23), "grain": (16000.0, 1.6)}
"""Mass, kg, and height, m."""
DATE = datetime.datetime(2026, 1, 1, tzinfo=datetime.UTC)
Numbers = Mapping[str, tuple[float, float]]
"""Value and sigma of parameters."""


@dataclass(frozen=True, kw_only=True)
class Draw:
    """One seed of one plant."""

    nonlinear: bool
    seed: int
    parts: tuple[str, ...]


@dataclass(kw_only=True)
class Found:
    """The results of one seed."""

    ways: dict[str, Numbers] = field(default_factory=dict)
    fifth: dict[str, str] = field(default_factory=dict)
    false_alarms: int = 0
    """Of the four good logs."""
    heights: dict[str, tuple[float, float]] = field(default_factory=dict)
    """Error and sigma as fractions."""


def retyred(truck: Vehicle) -> Vehicle:
    """A truck with the tyres of `TRUCK`: the cornering stiffness at its axle loads."""
    tyre, before, now = MagicFormula(), TRUCK.axle_loads(), truck.axle_loads()
    stiffness = TRUCK.parameters()
    return truck.replace(
        {
            (name := f"{path}.cornering_stiffness"): stiffness[name]
            * tyre.cornering_stiffness(now[path] / n)
            / tyre.cornering_stiffness(before[path] / n)
            for path, n in TYRES.items()
        }
    )


def loaded(load: str) -> Vehicle:
    """The truck with another load."""
    p, (mass, height) = TRUCK.parameters(), LOADS[load]
    total = p["semitrailer.mass"] + mass - p["semitrailer.payload.mass"]
    values = {
        "semitrailer.mass": total,
        "semitrailer.payload.mass": mass,
        "semitrailer.yaw_inertia": p["semitrailer.yaw_inertia"] * total / p["semitrailer.mass"],
    }
    return retyred(TRUCK.replace(values | {HEIGHT: height}))


def other_trailer() -> Vehicle:
    """The truck with another trailer."""
    p = TRUCK.parameters()
    removed = 0.4 * p["semitrailer.mass"]
    values = {f"semitrailer.{axle.name}.position": axle.position + 1.0 for axle in TRUCK.units[1].axles}
    values |= {name: p[name] - removed for name in ("semitrailer.mass", "semitrailer.payload.mass")}
    return retyred(TRUCK.replace(values | {"semitrailer.yaw_inertia": p["semitrailer.yaw_inertia"] / 2}))


class Truth:
    """The truck and the sensors of one seed, and its logs."""

    def __init__(self, draw: Draw) -> None:
        self.draw, self.settings = draw, OneStage(given=CAREFUL)
        self.rng = np.random.default_rng([draw.seed, 29])
        self.file = initial_guess(drawn_file(careful_truck(), self.rng), draw.seed)
        self.shared = shared_errors(self.settings, self.rng)
        self.number = 0

    def log(self, speed: float, truck: Vehicle = TRUCK, errors: Mapping[str, float] | None = None) -> Record:
        """A log of a truck with additional errors of sensors."""
        own = self.shared | log_errors(self.settings, self.rng)
        own |= {key: own[key] + error for key, error in (errors or {}).items()}
        p, sigma = truck.parameters(), quantity_of("cornering_stiffness.variation").sigma
        names = [f"{path}.cornering_stiffness" for path in TYRES]
        varied = truck.replace({name: p[name] * math.exp(sigma * self.rng.normal()) for name in names})
        bank = own["bank"]
        run = Plant(varied, Properties(bank=bank if self.draw.nonlinear else 0.0)).drive(
            lane_changes(count=1, speed=speed / 3.6)
        )
        signals = (run.time, run.truth) if self.draw.nonlinear else linear_signals(run, bank, varied)
        self.number += 1
        return measured_record(*signals, own, f"log {self.number:02d}", self.draw.seed * 100 + self.number)

    def occasion(self, log: Record, load: str = "") -> Occasion:
        """Of a log: one an hour, in the order in which they were driven."""
        return Occasion(load=load, date=DATE + datetime.timedelta(hours=int(log.name.split()[1])))

    def file_of(self, load: str) -> Vehicle:
        """The file of the truck with another load: masses, CoG and yaw inertia have errors of their own."""
        truck, laden, file = loaded(load), TRUCK.parameters(), self.file.parameters()
        p = truck.parameters()
        weighed = careful_truck().stated | {path: f * p[path] for path, f in WEIGHED.items()}
        own = drawn_file(truck.with_stated(weighed), self.rng)
        guess = initial_guess(own, self.draw.seed + self.number)
        of_load = {path: guess.parameters()[path] for path in OWN}
        values = {path: p[path] * file[path] / laden[path] if laden[path] else file[path] for path in p}
        return guess.replace(values | of_load | {HEIGHT: p[HEIGHT]})


def numbers(result: Identification) -> Numbers:
    """The estimates that logs share."""
    return {e.name: (e.value, e.sigma or math.nan) for e in result.parameters if e.name != FRICTION}


def after_another(logs: Sequence[Record], truth: Truth) -> Identification:
    """Each log identified with the knowledge of those before it."""
    result = None
    for log in logs:
        knowledge = result.knowledge if result else None
        result = identify([log], truth.file, truth.settings, knowledge=knowledge, occasion=truth.occasion(log))
    assert result
    return result


def combined(logs: Sequence[LogKnowledge]) -> Numbers:
    """The estimates of logs that were identified alone."""
    together = Knowledge(logs=tuple(logs)).combined
    last = len(together.logs) - 1
    return {unknown.name: together.estimate(last, unknown) for unknown in together.parameters(last)}


def learned(logs: Sequence[Record], truth: Truth) -> Numbers:
    """The estimates from the knowledge of a learner after all logs, with linear tyres, its default."""
    learner = Learner(truth.file, logs[0].signals, replace(truth.settings, tyres="linear"))
    for i, log in enumerate(logs):
        learner.learn(replace(log, time=log.time + 3600.0 * i))
    return combined(learner.knowledge.logs)


def order(truth: Truth, logs: Sequence[Record], in_order: Identification) -> dict[str, Numbers]:
    """The estimates of four logs in every way."""
    alone = [identify([log], truth.file, truth.settings, occasion=truth.occasion(log)) for log in logs]
    return {
        WAYS[0]: numbers(identify(logs, truth.file, truth.settings)),
        WAYS[1]: numbers(in_order),
        WAYS[2]: numbers(after_another(logs[::-1], truth)),
        WAYS[3]: combined([log for result in alone for log in result.knowledge.logs]),
        WAYS[4]: learned(logs, truth),
    }


def fifth_logs(truth: Truth, before: Identification) -> Iterator[tuple[str, str]]:
    """What becomes of a fifth log, by its error."""
    softer = TRUCK.replace({STIFFNESS: 0.8 * TRUCK.parameters()[STIFFNESS]})
    trucks = {"trailer": other_trailer(), "tyres": softer}
    errors = {"late": {f"{STEER}.delay": 0.25}, "gyro": {"yaw_rate.tractor.gain": 0.05}}
    for kind in BAD:
        truck = trucks.get(kind, TRUCK)
        log = truth.log(FIFTH_SPEED, truck, errors.get(kind))
        try:
            result = identify(
                [log], truth.file, truth.settings, knowledge=before.knowledge, occasion=truth.occasion(log)
            )
        except FifthwheelError as error:
            yield kind, f"refused: {type(error).__name__}"
            continue
        yield kind, outcome(result, log.name, far_off(result, (TRUCK, truck)) - far_off(before, (TRUCK,)))


def far_off(result: Identification, trucks: Sequence[Vehicle]) -> set[str]:
    """The estimates that are more than 2 sigma off all trucks."""
    values = [truck.parameters() for truck in trucks]
    return {
        name
        for name, (value, sigma) in numbers(result).items()
        if min(abs(value - p[name]) for p in values) > 2 * sigma
    }


def outcome(result: Identification, log: str, off: set[str]) -> str:
    """Set aside, dated, noted by a doubt, or averaged: then whether estimates are off that were not before."""
    (own,) = [known for known in result.knowledge.logs if known.name == log]
    if own.set_aside:
        return "set aside"
    if own.changed:
        return f"dated: {', '.join(own.changed)}"
    state = ", an estimate newly off" if off else ""
    return ("doubt" if result.doubts else "averaged") + state


def loads(truth: Truth, trips: bool) -> dict[str, tuple[float, float]]:
    """Error and sigma of the payload height alone and after a log with a known load."""
    known = replace(truth.settings, given={**truth.settings.given, HEIGHT: "exact"})
    empty = truth.log(LADEN_SPEED, loaded("empty"))
    first = identify([empty], truth.file_of("empty"), known, occasion=truth.occasion(empty, "empty"))
    laden, file = truth.log(LADEN_SPEED), truth.file
    alone = identify([laden], file, truth.settings)
    occasion = truth.occasion(laden, "laden")
    after = identify([laden], file, truth.settings, knowledge=first.knowledge, occasion=occasion)
    found = {"alone": height(alone, "laden"), "after a log of 500 kg": height(after, "laden")}
    if not trips:
        return found
    knowledge, files = first.knowledge, {"laden": file} | {load: truth.file_of(load) for load in ("steel", "grain")}
    for i in range(10):
        load = ("steel", "laden", "grain")[i % 3]
        log = truth.log(SPEEDS[i % 4], loaded(load))
        occasion = truth.occasion(log, load)
        result = identify([log], files[load], truth.settings, knowledge=knowledge, occasion=occasion)
        knowledge = result.knowledge
        if i < 3 or i > 6:
            found |= {f"trip {i + 1}": height(result, load)}
    return found


def height(result: Identification, load: str) -> tuple[float, float]:
    """Error and sigma of the payload height as fractions."""
    true = LOADS[load][1]
    return result[HEIGHT].value / true - 1, (result[HEIGHT].sigma or math.nan) / true


def results(draw: Draw) -> Found:
    """Of one seed."""
    truth, found = Truth(draw), Found()
    if {"order", "fifth"} & set(draw.parts):
        logs = [truth.log(speed) for speed in SPEEDS]
        in_order = after_another(logs, truth)
        found.false_alarms = sum(bool(log.set_aside or log.changed) for log in in_order.knowledge.logs)
        if "order" in draw.parts:
            found.ways = order(truth, logs, in_order)
        if "fifth" in draw.parts:
            found.fifth = dict(fifth_logs(truth, in_order))
    if "loads" in draw.parts:
        found.heights = loads(truth, "trips" in draw.parts)
    return found


def of_errors(error: Array, sigma: Array) -> tuple[str, ...]:
    """Coverage, rms error, mean sigma."""
    numbers = (100 * np.sqrt(np.mean(error**2)), 100 * np.mean(sigma))
    return f"{np.mean(np.abs(error) < 2 * sigma):.0%}", *(f"{x:.2f}" for x in numbers)


def order_table(found: Sequence[Found]) -> list[str]:
    """Of every parameter in every way."""
    truth, rows = TRUCK.parameters(), []
    for name in found[0].ways[WAYS[0]]:
        for way in WAYS:
            (reference, unit), (value, sigma) = (
                np.array([f.ways[key][name] for f in found if f.ways]).T for key in (WAYS[0], way)
            )
            shift = (value - reference) / unit
            errors = of_errors(value / truth[name] - 1, sigma / truth[name])
            differences = (np.abs(shift).max(), np.sqrt(np.mean(shift**2)), np.mean(sigma / unit))
            rows.append((name, way, *(f"{x:.2f}" for x in differences), *errors))
    heads = ("", "", "largest difference / sigma", "rms", "sigma ratio", "coverage", "rms error", "mean sigma")
    return table(heads, rows)


def fifth_table(found: Sequence[Found]) -> list[str]:
    """What becomes of a fifth log."""
    counts = {kind: Counter(f.fifth[kind] for f in found) for kind in BAD}
    rows = [(text, "; ".join(f"{n} {state}" for state, n in counts[kind].most_common())) for kind, text in BAD.items()]
    return table(("error of the fifth log", "outcome, number of seeds"), rows)


def height_table(found: Sequence[Found]) -> list[str]:
    """Of the payload height."""
    rows = []
    for name in found[0].heights:
        error, sigma = np.array([f.heights[name] for f in found]).T
        rows.append((name, f"{100 * np.mean(error):.2f}", *of_errors(error, sigma)))
    return table(("payload height", "mean error", "coverage", "rms error", "mean sigma"), rows)


def main() -> None:
    """Run the seeds and write knowledge.md."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=16)
    parser.add_argument("--first", type=int, default=7000, help="the first seed")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--plants", nargs="*", default=["nonlinear", "linear"])
    parser.add_argument("--parts", nargs="*", default=["order", "fifth", "loads"], help="also trips, with loads")
    parser.add_argument("-o", type=Path, default=Path(__file__).with_suffix(".md"))
    arguments = parser.parse_args()
    lines = ["# Knowledge", "", (__doc__ or "").split("\n\n", 2)[2]]
    with ProcessPoolExecutor(arguments.jobs) as pool:
        for plant in arguments.plants:
            seeds = range(arguments.first, arguments.first + arguments.seeds)
            draws = [Draw(nonlinear=plant == "nonlinear", seed=s, parts=tuple(arguments.parts)) for s in seeds]
            found, before = list[Found](), len(lines)
            for draw, result in zip(draws, pool.map(results, draws), strict=True):
                found.append(result)
                print(f"{plant}, seed {draw.seed}", flush=True)
                lines[before:] = [f"## {plant.capitalize()} truck, {len(found)} seeds", ""]
                if found[0].ways:
                    alarms = sum(f.false_alarms for f in found)
                    lines += [
                        *order_table(found),
                        "",
                        f"{alarms} of {3 * len(found)} good logs set aside or dated.",
                        "",
                    ]
                lines += [*fifth_table(found), ""] if found[0].fifth else []
                lines += [*height_table(found), ""] if found[0].heights else []
                arguments.o.write_text("\n".join(lines), encoding="utf-8")


if __name__ == "__main__":
    main()
