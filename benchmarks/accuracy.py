"""Errors of the two-stage identification on the linear yaw-roll plant, over noise seeds and 80 % / 120 % starts.

    python benchmarks/accuracy.py [--seeds 20] [--lane-changes 1 2 5 10]

The plant is the linear truck of the catalogue with the article's gyro noise, in repeated SAE lane changes; each seed
draws the noise and, for every parameter of stage 1, whether it starts at 80 or at 120 %. The payload starts at 0.1 m.
For every parameter: mean and root mean square of the error, its worst, the root mean square of error / sigma (1 where
sigma is honest), and the lane changes driven until it stayed within 1 % of its own average.
"""

import argparse
from collections.abc import Sequence

import numpy as np

from fifthwheel import vehicle
from fifthwheel.identify import Identification, Settings, article, identify
from fifthwheel.identify.parameters import stage_1_names
from fifthwheel.simulate import LaneChange, simulate
from fifthwheel.vehicle import Vehicle


def start(truck: Vehicle, seed: int) -> Vehicle:
    """The truck with each parameter of stage 1 at 80 or at 120 %."""
    names = stage_1_names(truck)
    factors = np.random.default_rng([seed, 7]).choice([0.8, 1.2], len(names))
    values = truck.parameters()
    return truck.replace({name: values[name] * factor for name, factor in zip(names, factors, strict=True)})


def run(truck: Vehicle, settings: Settings, count: int, seed: int) -> Identification:
    """One identification."""
    return identify([simulate(truck, count=count, seed=seed)], start(truck, seed), settings)


def table(truck: Vehicle, settings: Settings, count: int, seeds: Sequence[int]) -> dict[str, dict[str, float]]:
    """Statistics by parameter, errors as a part of the truth."""
    found = [run(truck, settings, count, seed) for seed in seeds]
    truth = truck.parameters() | truck.derived()
    rows = {}
    for estimate in (*found[0].parameters, *found[0].derived):
        name = estimate.name
        error = np.array([f[name].value for f in found]) / truth[name] - 1
        sigma = np.array([f[name].sigma or np.nan for f in found]) / truth[name]
        settled = np.array([np.nan if f[name].settled is None else f[name].settled for f in found], dtype=float)
        rows[name] = {
            "mean": float(error.mean()),
            "rms": float(np.sqrt(np.mean(error**2))),
            "worst": float(np.abs(error).max()),
            "error/sigma": float(np.sqrt(np.mean((error / sigma) ** 2))),
            "settled": float(np.median(np.where(np.isnan(settled), np.inf, settled)) / LaneChange().period(88 / 3.6)),
            "converged": float(np.mean([f[name].verdict == "converged" for f in found])),
        }
    return rows


def main() -> None:
    """Print a table for each preset and number of lane changes."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--lane-changes", type=int, nargs="+", default=[1, 2, 5, 10, 15])
    options = parser.parse_args()
    truck = vehicle.get("cheng_cebon_2011")  # as the article models it: side forces act at once
    truck = truck.replace({f"{path}.relaxation_length": 0.0 for path in truck.axle_loads()})
    for settings in (Settings(), Settings(preset="default, one round", rounds=1), article()):
        for count in options.lane_changes:
            print(f"\n{settings.preset}, {count} lane changes, {options.seeds} seeds")
            print(f"{'':38s} {'mean %':>8} {'rms %':>8} {'worst %':>8} {'err/sig':>8} {'settled':>8} {'conv.':>6}")
            for name, row in table(truck, settings, count, range(options.seeds)).items():
                print(
                    f"{name:38s} {100 * row['mean']:8.2f} {100 * row['rms']:8.2f} {100 * row['worst']:8.2f}"
                    f" {row['error/sigma']:8.2f} {row['settled']:8.1f} {row['converged']:6.0%}"
                )


if __name__ == "__main__":
    main()
