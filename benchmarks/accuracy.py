"""Accuracy of the estimated parameters and of their sigmas, over many seeds; writes accuracy.md beside this file.

    python benchmarks/accuracy.py [--seeds 50] [--jobs 2] [--only matched ...]

Each seed draws the sensor noise and the initial values: each stiffness and yaw inertia starts at 80 or 120 % of its
value in the vehicle file, the payload height at its prior mean. A case with `random_errors` also draws all uncertain
parameters and sensor errors, from the priors of the estimator. One stage has linear tyres for the linear truck, and
tyres that saturate for the nonlinear one, whose true stiffness is the nominal one, at small slip. Two stages have
linear tyres; the error of a stiffness on the nonlinear truck is then its distance from the range of effective
stiffness between steer angles of 0.1 and 1 degree (see docs/reproduction.md).

Columns: mean, rms and largest magnitude of the error; the Cramer-Rao bound where the model is exact; the mean sigma;
the fraction of the 90 % intervals that contain the true value; the fraction of the seeds with the verdict `converged`.
"""

import argparse
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np

from fifthwheel.apps.cheng_cebon_2011 import TwoStage, article
from fifthwheel.apps.cheng_cebon_2011.experiments import SPEED, point_payload
from fifthwheel.apps.studies.scenarios import effective_stiffness, initial_guess
from fifthwheel.base.names import ParameterPath
from fifthwheel.data.channels import SignalName
from fifthwheel.data.record import Record
from fifthwheel.data.record.record import segments_above
from fifthwheel.estimate.identify import OneStage, identify
from fifthwheel.estimate.identify.dataset import LogData
from fifthwheel.estimate.identify.given import applied
from fifthwheel.estimate.identify.one_stage.problem import Problem
from fifthwheel.estimate.identify.settings import CommonSettings
from fifthwheel.estimate.identify.setup import Setup
from fifthwheel.estimate.identify.unknowns.parameters import stage_1_names
from fifthwheel.estimate.online.learner import Learner
from fifthwheel.model.manoeuvres import lane_changes
from fifthwheel.model.plant import Plant, PlantRun, Properties, article_sensors
from fifthwheel.model.simulate import simulate
from fifthwheel.truck import Vehicle, get
from fifthwheel.truck.quantities import FRICTION, quantity_of
from trust_runs import peak_friction, sensor_sigma

RATES = ("yaw_rate", "roll_rate")
KNOWN = OneStage(given={"others": "exact", "sensors": "exact"}, tyres="linear")
"""All parameters except the five estimated ones are known exactly."""
UNCERTAIN = OneStage(
    tyres="linear",
    given={
        "steer.*.gain": "+- 3 %",
        "steer.*.offset": "+- 0.005 rad",
        "*_rate.*.offset": "+- 0.002 rad/s",
        "road.bank": "+- 0.035 rad",
    },
)
"""All parameters are uncertain as by default; the steering gain is known to 3 %, the bank to 2 degrees."""
SENSOR_ERRORS = OneStage(given={"others": "exact", "road.bank": "+- 0.03 rad"}, tyres="linear")
"""The sensor errors and the bank of the road are estimated too."""
SATURATING, SATURATING_UNCERTAIN = (replace(s, tyres="auto") for s in (KNOWN, UNCERTAIN))
"""The same for the nonlinear truck; the friction of the road is estimated too."""
ANY_PAYLOAD = replace(SATURATING, uniform_payload=False)
"""CoG height and roll inertia of the laden body are estimated separately."""
INTERVAL = 1.645
"""Half width of a 90 % interval, in standard deviations."""
Result = dict[str, tuple[float, float, str]]
"""Value, sigma and verdict by name."""


@dataclass(frozen=True)
class Case:
    """A truck, its run, and the settings of the estimator."""

    name: str
    title: str
    settings: CommonSettings
    lane_changes: int = 1
    nonlinear: bool = False
    random_errors: bool = False
    """Uncertain parameters and sensor errors are drawn from their priors."""
    point: bool = False
    """The payload is a point, while the estimator assumes a uniform payload."""
    recursive: bool = False
    bound: bool = False
    """The model is exact, so the Cramer-Rao bound applies."""
    vehicle: str = "cheng_cebon_2011"
    """Name in the catalogue."""

    @property
    def truck(self) -> Vehicle:
        """The vehicle."""
        return get(self.vehicle)


CASES = (
    Case("matched", "Linear truck, all else known, 1 lane change", KNOWN, bound=True),
    Case("recursive", "Linear truck, recursive, all else known, 1 lane change", KNOWN, recursive=True, bound=True),
    Case(
        "random errors",
        "Linear truck, random vehicle parameters and sensor errors, 1 lane change",
        UNCERTAIN,
        random_errors=True,
    ),
    Case("nonlinear", "Nonlinear truck, all else known, 1 lane change", SATURATING, nonlinear=True),
    Case(
        "nonlinear, random errors",
        "Nonlinear truck, random vehicle parameters, steering gain (3 %), offsets and bank (2 degrees), 1 lane change",
        SATURATING_UNCERTAIN,
        nonlinear=True,
        random_errors=True,
    ),
    Case("point", "Nonlinear truck, point payload, 5 lane changes", ANY_PAYLOAD, 5, nonlinear=True, point=True),
    Case("sensor errors", "Linear truck, one stage, sensor errors estimated too, 1 lane change", SENSOR_ERRORS),
    Case("two-stage 1", "Linear truck, two stages, 1 lane change", TwoStage()),
    Case("two-stage 5", "Linear truck, two stages, 5 lane changes", TwoStage(), 5),
    Case("article 5", "Linear truck, the article's preset, 5 lane changes", article(), 5),
    Case("article 12", "Linear truck, the article's preset, 12 lane changes", article(), 12),
    Case("one-stage 5", "Linear truck, one stage, all else known, 5 lane changes", KNOWN, 5, bound=True),
    Case("two-stage nonlinear", "Nonlinear truck, two stages, 1 lane change", TwoStage(), nonlinear=True),
    *(
        Case(name, f"Linear {name}, all else known, 1 lane change", KNOWN, bound=True, vehicle=name)
        for name in ("b_double", "a_double", "truck_dolly_semitrailer", "truck_full_trailer")
    ),
)


@cache
def nonlinear_run(vehicle: str, count: int, bank: float, point: bool) -> PlantRun:
    """Lane changes of the nonlinear truck; bank in rad."""
    truck = point_payload(get(vehicle)) if point else get(vehicle)
    return Plant(truck, Properties(bank=bank)).drive(lane_changes(count=count))


def random_vehicle(truck: Vehicle, seed: int) -> Vehicle:
    """The vehicle file with errors of all uncertain parameters, drawn from their priors."""
    rng, values = np.random.default_rng([seed, 11]), truck.parameters()
    estimated = {*stage_1_names(truck), "semitrailer.payload.height"}
    changed = {}
    for name, value in values.items():
        row, path = quantity_of(name), ParameterPath.of(name)
        is_trailer_body = (path.unit, path.component) == ("semitrailer", "sprung")
        if row.is_uncertain and value > 0 and name not in estimated and not is_trailer_body:
            changed[name] = value * float(np.exp(row.sigma * rng.normal()))
    return truck.replace(changed)


def with_sensor_errors(record: Record, settings: OneStage, seed: int) -> Record:
    """The record with drawn offsets and gains; the true steer angle is gain (measured - offset)."""
    rng, signals = np.random.default_rng([seed, 13]), dict(record.signals)
    for name, values in record.signals.items():
        quantity = SignalName.of(name).quantity
        if quantity not in ("steer", *RATES):
            continue
        gain, offset = (sensor_sigma(f"{name}.{kind}", settings) * rng.normal() for kind in ("gain", "offset"))
        signals[name] = (values / (1 + gain) if quantity == "steer" else (1 + gain) * values) + offset
    return replace(record, signals=signals)


def simulated_record(case: Case, seed: int) -> Record:
    """The measured signals of one seed."""
    if case.nonlinear:
        bank = np.radians(2) * (1 if seed % 2 else -1) if case.random_errors else 0.0
        run = nonlinear_run(case.vehicle, case.lane_changes, bank, case.point)
        record = run.record(article_sensors(case.truck), seed=seed)
    else:
        record = simulate(case.truck, count=case.lane_changes, seed=seed)
    if case.random_errors and isinstance(case.settings, OneStage):
        record = with_sensor_errors(record, case.settings, seed)
    return record


def estimate(case: Case, seed: int) -> Result:
    """Identify the truck with the data of one seed."""
    record, assumed = simulated_record(case, seed), case.truck
    if case.random_errors and isinstance(case.settings, OneStage):
        assumed = random_vehicle(assumed, seed)
    guess = initial_guess(assumed, seed)
    if case.recursive and isinstance(case.settings, OneStage):
        learner = Learner(guess, record.signals, case.settings)
        learner.learn(record)
        return {e.name: (e.value, e.sigma or 0.0, str(e.verdict)) for e in learner.parameters}
    result = identify([record], guess, case.settings)
    return {e.name: (e.value, e.sigma or 0.0, str(e.verdict)) for e in (*result.parameters, *result.derived)}


def cramer_rao_bound(case: Case) -> dict[str, float]:
    """Cramer-Rao bound of each parameter, relative to its value, with the prior of the estimator."""
    record = simulate(case.truck, count=case.lane_changes, seed=0)
    truck, values = case.truck.with_logged_steering(record.signals, record.name), case.truck.parameters()
    outputs = tuple(name for name in record.signals if SignalName.of(name).quantity in RATES)
    assert isinstance(case.settings, OneStage)
    given = {**case.settings.given, "payload.height": "+- 0.75 m"}  # at the height of the truck
    truck, settings = applied(truck, replace(case.settings, given=given, outlier=1e9))
    setup = Setup.of(truck, outputs, settings)
    unknowns = setup.unknowns
    problem = Problem(setup, [LogData(name="bound", segments=segments_above(record, 5.0))])
    sigma = np.sqrt(np.diag(np.linalg.inv(problem.expand(np.zeros(len(problem.names))).hessian)))
    return {
        u.name: float(sigma[i] * u.scale * (1.0 if u.logarithmic else 1 / values[u.name]))
        for i, u in enumerate(unknowns)
    }


def table(case: Case, results: Sequence[Result]) -> list[str]:
    """The section of a case, as lines of Markdown."""
    truck = point_payload(case.truck) if case.point else case.truck
    truth = truck.parameters() | truck.derived()
    two_stages = not isinstance(case.settings, OneStage)
    ranges = effective_stiffness(case.truck, Properties(), SPEED) if case.nonlinear and two_stages else {}
    ranges |= {FRICTION: peak_friction(())}
    bounds = cramer_rao_bound(case) if case.bound else {}
    lines = [
        f"## {case.title}",
        "",
        f"{len(results)} seeds. All numbers in per cent.",
        "",
        "| | mean | rms | worst | bound | rms / bound | sigma | coverage | converged |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for name in results[0]:
        if case.point and ParameterPath.of(name).component == "sprung":
            continue  # of the laden body; the vehicle file has no true value
        low, high = sorted(ranges[name] if name in ranges else (truth[name], truth[name]))
        value, sigma = (np.array([result[name][i] for result in results]) for i in (0, 1))
        nearest = np.clip(value, low, high)
        error, relative_sigma = value / nearest - 1, sigma / nearest
        rms = float(np.sqrt(np.mean(error**2)))
        cells = [f"{100 * error.mean():+.2f}", f"{100 * rms:.2f}", f"{100 * np.abs(error).max():.2f}"]
        cells += [f"{100 * bounds[name]:.2f}", f"{rms / bounds[name]:.2f}"] if name in bounds else ["", ""]
        coverage = np.mean(np.abs(error) <= INTERVAL * relative_sigma)
        cells += [f"{100 * relative_sigma.mean():.2f}", f"{100 * coverage:.0f}"]
        cells.append(f"{100 * np.mean([result[name][2] == 'converged' for result in results]):.0f}")
        lines.append(f"| {name} | " + " | ".join(cells) + " |")
    return [*lines, ""]


def main() -> None:
    """Run the cases and write accuracy.md beside this file."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "--seeds", type=int, default=50, help="seeds of each case; twice as many with a Cramer-Rao bound"
    )
    parser.add_argument("--jobs", type=int, default=2, help="processes")
    parser.add_argument(
        "--only", nargs="+", choices=[case.name for case in CASES], help="print these cases; write no file"
    )
    options = parser.parse_args()
    text = [
        "# Accuracy",
        "",
        "Written by `python benchmarks/accuracy.py`; the docstring of this script explains the cases and the columns.",
        "",
    ]
    with ProcessPoolExecutor(options.jobs) as pool:
        for case in CASES:
            if options.only and case.name not in options.only:
                continue
            seeds = range(options.seeds * (2 if case.bound else 1))
            start = time.perf_counter()
            lines = table(case, list(pool.map(estimate, [case] * len(seeds), seeds, chunksize=5)))
            print("\n".join(lines), flush=True)
            print(f"{(time.perf_counter() - start) * options.jobs / len(seeds):.2f} s per seed\n", flush=True)
            text += lines
    if not options.only:
        Path(__file__).with_suffix(".md").write_text("\n".join(text), encoding="utf-8")


if __name__ == "__main__":
    main()
