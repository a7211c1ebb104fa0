"""The wheelbase of a trailer from a minute of slow turns and one lane change; writes wheelbase.md.

    python benchmarks/wheelbase.py [--seeds 20] [--first 7000] [--jobs 1]

The nonlinear truck of `sharpness.careful_truck` with errors of all numbers and sensors (`sharpness.CAREFUL`), but the
distance of the trailer's axles from its kingpin has an error of 40 cm (5 %), and is stated so. The signals are speed,
steer angle, and yaw and roll rates of both units. Each seed has its own errors.
"""

import argparse
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path

import numpy as np

from causes import AXLES, moved
from fifthwheel.apps.studies.scenarios import initial_guess
from fifthwheel.estimate.identify import OneStage, identify
from fifthwheel.model.manoeuvres import lane_changes
from fifthwheel.model.manoeuvres.courses import slow_turns
from fifthwheel.model.plant import Plant, Properties
from sharpness import CAREFUL, careful_truck
from trust_coverage import drawn_file, log_errors, measured_record, shared_errors
from trust_runs import TRUCK, table

PRIOR = 0.4
"""m"""
WHEELBASE = "semitrailer.wheelbase"
NAMES = (
    *("tractor.front.cornering_stiffness", "tractor.drive.cornering_stiffness", "semitrailer.cornering_stiffness"),
    *("semitrailer.yaw_inertia", WHEELBASE),
)


def errors(seed: int, *, turns: bool = True) -> dict[str, tuple[float, float]]:
    """Error and sigma of each estimate as fractions of the true value; none where it is not a result."""
    rng, settings = np.random.default_rng([seed, 47]), OneStage(given=CAREFUL)
    vehicle = initial_guess(drawn_file(careful_truck(), rng), seed)
    shared, records = shared_errors(settings, rng), []
    courses = {"lane change": lane_changes(count=1, speed=80 / 3.6)} | ({"turns": slow_turns()} if turns else {})
    for i, (name, course) in enumerate(courses.items()):
        own = shared | log_errors(settings, rng)
        run = Plant(TRUCK, Properties(bank=own["bank"])).drive(course)
        records.append(measured_record(run.time, run.truth, own, name, 100 * seed + i))
    stated = moved(AXLES, rng.normal(0, PRIOR), vehicle).with_stated(dict.fromkeys(AXLES, PRIOR))
    result, true = identify(records, stated, settings), TRUCK.parameters() | TRUCK.derived()
    found = {e.name: e for e in (*result.parameters, *result.derived) if e.sigma is not None}
    return {n: (found[n].value / true[n] - 1, (found[n].sigma or 0.0) / true[n]) for n in NAMES if n in found}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--first", type=int, default=7000)
    parser.add_argument("--jobs", type=int, default=1)
    arguments = parser.parse_args()
    seeds = range(arguments.first, arguments.first + arguments.seeds)
    lines = ["# The wheelbase of a trailer from slow turns", "", f"{len(seeds)} seeds from {seeds[0]} on.", ""]
    with ProcessPoolExecutor(arguments.jobs) as pool:
        for turns in (True, False):
            runs = list(pool.map(partial(errors, turns=turns), seeds))
            rows = []
            for name in NAMES:
                e, s = (np.array([run[name][k] for run in runs if name in run]) for k in (0, 1))
                if len(e):
                    inside = np.abs(e) < 1.645 * s
                    numbers = [100 * np.sqrt(np.mean(e**2)), 100 * np.mean(e), 100 * np.mean(s), 100 * np.mean(inside)]
                    rows.append((name, str(len(e)), *[f"{number:.2f}" for number in numbers]))
            heading = "A minute of slow turns and a lane change" if turns else "The lane change alone"
            heads = ["estimate", "results", "rms error %", "mean error %", "mean sigma %", "90 % intervals contain %"]
            lines += [f"## {heading}", "", *table(heads, rows), ""]
            print(*lines[-len(rows) - 5 :], sep="\n", flush=True)
    Path(__file__).with_suffix(".md").write_text("\n".join(lines))


if __name__ == "__main__":
    main()
