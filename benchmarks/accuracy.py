"""How well parameters are found, and whether their sigma can be believed: one command, one table, beside this file.

    python benchmarks/accuracy.py [--seeds 50] [--jobs 2] [--only matched ...]

Every case draws, seed by seed, the sensors' noise, whether each stiffness and yaw inertia starts at 80 or at 120 % of
what the vehicle file says, and, where it says so, everything that the estimator is told to be uncertain about, from the
very prior that it is told. The payload's height starts at 0.1 m. Errors of stiffness on the nonlinear truck count from
its effective range between 0.1 and 1 degree of steer (see docs/reproduction.md). For every parameter: mean and root
mean square of the error, its worst; the Cramer-Rao bound where the model is matched; the mean sigma told; and how many
of the 90 % intervals hold the truth.
"""

import argparse
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np

from fifthwheel import dynamics
from fifthwheel.identify import OneStage, TwoStage, article, identify
from fifthwheel.identify.parameters import longest_ending, one_stage_unknowns, stage_1_names
from fifthwheel.identify.problem import Problem
from fifthwheel.identify.recursive import Learner
from fifthwheel.identify.settings import Common
from fifthwheel.identify.stage import Log
from fifthwheel.logs import Record
from fifthwheel.observe.prepare import fast_enough, steered_as_logged
from fifthwheel.paper.experiments import KMH_88, effective_stiffness, point_payload
from fifthwheel.plant import Drive, Plant, Properties
from fifthwheel.plant import article as article_sensors
from fifthwheel.plant.courses import lane_changes
from fifthwheel.simulate import simulate
from fifthwheel.vehicle import Vehicle, get

TRUCK = get("cheng_cebon_2011")
KNOWN = OneStage(priors={}, consider={}, nuisances=False)
"""All but the five parameters is known."""
UNCERTAIN = OneStage(steer_gain_prior=0.03, steer_offset_prior=0.005, rate_offset_prior=0.002, bank_prior=0.035)
"""All that the default is uncertain about; steering ratio known to 3 %, bank to 2 degrees."""
ERRORS = OneStage(priors={}, consider={})
"""The sensors' errors and the road's bank are unknown too."""
APART = replace(KNOWN, uniform_payload=False)
INTERVAL = 1.645  # standard deviations, 90 %


@dataclass(frozen=True)
class Case:
    """A truck, what is driven, what the estimator knows."""

    name: str
    title: str
    settings: Common
    lane_changes: int = 1
    nonlinear: bool = False
    drawn: bool = False  # what the estimator is told to be uncertain about is drawn
    point: bool = False  # the payload is a point, which the estimator is not told
    recursive: bool = False
    bound: bool = False


CASES = (
    Case("matched", "Linear truck, all else known, 1 lane change", KNOWN, bound=True),
    Case("recursive", "The same, recursive, at the end of that lane change", KNOWN, recursive=True, bound=True),
    Case("drawn", "Linear truck, sensors' errors and the vehicle file drawn, 1 lane change", UNCERTAIN, drawn=True),
    Case("nonlinear", "Nonlinear truck, all else known, 1 lane change", KNOWN, nonlinear=True),
    Case(
        "flawed",
        "Nonlinear truck; vehicle file, steering gain (3 %), zeros and a bank (2 degrees) drawn, 1 lane change",
        UNCERTAIN,
        nonlinear=True,
        drawn=True,
    ),
    Case("point", "Nonlinear truck, point payload, 5 lane changes", APART, 5, nonlinear=True, point=True),
    Case("errors", "Linear truck, one stage, sensors' errors unknown too, 1 lane change", ERRORS),
    Case("two-stage 1", "Linear truck, two stages, 1 lane change", TwoStage()),
    Case("two-stage 5", "Linear truck, two stages, 5 lane changes", TwoStage(), 5),
    Case("article 5", "Linear truck, the article's preset, 5 lane changes", article(), 5),
    Case("article 12", "Linear truck, the article's preset, 12 lane changes", article(), 12),
    Case("one-stage 5", "Linear truck, one stage, all else known, 5 lane changes", KNOWN, 5, bound=True),
    Case("two-stage nonlinear", "Nonlinear truck, two stages, 1 lane change", TwoStage(), nonlinear=True),
)


@cache
def driven(count: int, bank: float, point: bool) -> Drive:
    """The nonlinear truck's lane changes."""
    truck = point_payload(TRUCK) if point else TRUCK
    return Plant(truck, Properties(bank=bank)).drive(lane_changes(count=count))


def drawn_file(settings: OneStage, seed: int) -> Vehicle:
    """The vehicle file of a truck of which this much is uncertain."""
    rng, values = np.random.default_rng([seed, 11]), TRUCK.parameters()
    sought = {*stage_1_names(TRUCK), "semitrailer.payload.height"}
    tables = settings.priors, settings.consider
    changed = {}
    for name, value in values.items():
        key = next((table[k] for table in tables if (k := longest_ending(name, table))), None)
        if key and value > 0 and name not in sought and not name.startswith("semitrailer.sprung."):
            changed[name] = value * float(np.exp(key * rng.normal()))
    return TRUCK.replace(changed)


def sensors_drawn(record: Record, settings: OneStage, seed: int) -> Record:
    """The record as sensors with zeros and gains would have shown it; wheels turn by gain (shown - zero)."""
    rng, signals = np.random.default_rng([seed, 13]), dict(record.signals)
    for name, shown in record.signals.items():
        if name.startswith("steer."):
            gain = 1 + settings.steer_gain_prior * rng.normal()
            signals[name] = shown / gain + settings.steer_offset_prior * rng.normal()
        elif "rate" in name:
            gain = 1 + settings.rate_gain_prior * rng.normal()
            signals[name] = gain * shown + settings.rate_offset_prior * rng.normal()
    return replace(record, signals=signals)


def record_of(case: Case, seed: int) -> Record:
    """What one seed's sensors show."""
    if case.nonlinear:
        bank = np.radians(2) * (1 if seed % 2 else -1) if case.drawn else 0.0
        record = driven(case.lane_changes, bank, case.point).record(article_sensors(TRUCK), seed=seed)
    else:
        record = simulate(TRUCK, count=case.lane_changes, seed=seed)
    if case.drawn and isinstance(case.settings, OneStage):
        record = sensors_drawn(record, case.settings, seed)
    return record


def start(case: Case, seed: int) -> Vehicle:
    """What the estimator is told, each parameter of stage 1 at 80 or at 120 %."""
    told = drawn_file(case.settings, seed) if case.drawn and isinstance(case.settings, OneStage) else TRUCK
    names, values = stage_1_names(told), told.parameters()
    factors = np.random.default_rng([seed, 7]).choice([0.8, 1.2], len(names))
    return told.replace({name: values[name] * f for name, f in zip(names, factors, strict=True)})


def run(case: Case, seed: int) -> dict[str, tuple[float, float, str]]:
    """Value, sigma and verdict by name."""
    record, told = record_of(case, seed), start(case, seed)
    if case.recursive and isinstance(case.settings, OneStage):
        learner = Learner(told, record.signals, case.settings)
        learner.learn(record)
        return {e.name: (e.value, e.sigma or 0.0, str(e.verdict)) for e in learner.parameters}
    found = identify([record], told, case.settings)
    return {e.name: (e.value, e.sigma or 0.0, str(e.verdict)) for e in (*found.parameters, *found.derived)}


def bound(case: Case) -> dict[str, float]:
    """Cramer-Rao bound of each parameter, as a part of it, with the prior that the estimator has."""
    record = simulate(TRUCK, count=case.lane_changes, seed=0)
    truck, values = steered_as_logged(TRUCK, record), TRUCK.parameters()
    outputs = tuple(name for name in record.signals if "rate" in name)
    assert isinstance(case.settings, OneStage)
    settings = replace(case.settings, initial_payload_height=None, outlier=1e9)
    model = dynamics.model(truck, outputs, roll=True, free=tuple(dynamics.all_parameters(truck, outputs)))
    unknowns = one_stage_unknowns(truck, outputs, settings)
    problem = Problem(model, truck, [Log(name="bound", sections=fast_enough(record, 5.0))], unknowns, settings)
    sigma = np.sqrt(np.diag(np.linalg.inv(problem.expand(np.zeros(len(problem.names))).hessian)))
    return {
        u.name: float(sigma[i] * u.scale * (1.0 if u.logarithmic else 1 / values[u.name]))
        for i, u in enumerate(unknowns)
    }


def table(case: Case, found: Sequence[dict[str, tuple[float, float, str]]]) -> list[str]:
    """Lines of Markdown."""
    truck = point_payload(TRUCK) if case.point else TRUCK
    truth = truck.parameters() | truck.derived()
    ranges = effective_stiffness(TRUCK, Properties(), KMH_88) if case.nonlinear else {}
    limits = bound(case) if case.bound else {}
    lines = [
        f"## {case.title}",
        "",
        f"{len(found)} seeds. All in per cent.",
        "",
        "| | mean | rms | worst | bound | rms / bound | sigma | covered | converged |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for name in found[0]:
        if case.point and ".sprung." in name:
            continue  # of the laden body, which the truck's file does not have
        low, high = sorted(ranges.get(name, (truth[name], truth[name])))
        value, sigma = (np.array([one[name][i] for one in found]) for i in (0, 1))
        near = np.clip(value, low, high)
        error, told = value / near - 1, sigma / near
        rms = float(np.sqrt(np.mean(error**2)))
        told_bound = [f"{100 * limits[name]:.2f}", f"{rms / limits[name]:.2f}"] if name in limits else ["", ""]
        cells = [f"{100 * error.mean():+.2f}", f"{100 * rms:.2f}", f"{100 * np.abs(error).max():.2f}", *told_bound]
        cells += [f"{100 * told.mean():.2f}", f"{100 * np.mean(np.abs(error) <= INTERVAL * told):.0f}"]
        cells.append(f"{100 * np.mean([one[name][2] == 'converged' for one in found]):.0f}")
        lines.append(f"| {name} | " + " | ".join(cells) + " |")
    return [*lines, ""]


def main() -> None:
    """Run the cases and write accuracy.md beside this file."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=50, help="of each case; twice as many where all is matched")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--only", nargs="+", choices=[case.name for case in CASES], help="print these, write nothing")
    options = parser.parse_args()
    text = [
        "# Accuracy",
        "",
        "Written by `python benchmarks/accuracy.py`; what is measured, and how, stands there.",
        "",
    ]
    with ProcessPoolExecutor(options.jobs) as pool:
        for case in CASES:
            if options.only and case.name not in options.only:
                continue
            seeds = range(options.seeds * (2 if case.bound else 1))
            begun = time.perf_counter()
            found = list(pool.map(run, [case] * len(seeds), seeds, chunksize=5))
            lines = table(case, found)
            print("\n".join(lines), flush=True)
            print(f"{(time.perf_counter() - begun) * options.jobs / len(seeds):.2f} s a seed\n", flush=True)
            text += lines
    if not options.only:
        Path(__file__).with_suffix(".md").write_text("\n".join(text), encoding="utf-8")


if __name__ == "__main__":
    main()
