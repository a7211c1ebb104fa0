"""Errors and coverage of an identification near the limits of adhesion, with linear and with saturating tyres.

    python benchmarks/limits_coverage.py --seeds 40 --jobs 2

Single sines of the steer angle of the nonlinear truck, one log each. Each seed draws the errors of the vehicle file, of
the sensors and the bank of the road, see trust_coverage.py. The true stiffness of linear tyres is a range, see
trust.md; that of saturating tyres is the nominal one, at small slip.
"""

import argparse
import sys
from concurrent.futures import ProcessPoolExecutor
from itertools import product

from fifthwheel.base.errors import FifthwheelError
from trust_coverage import Draw, Sample, row, samples
from trust_runs import SINE, table

RUNS = (("0.65", 1.0), ("1", 1.0), ("2", 1.0), ("2.5", 1.0), ("1", 0.35), ("1.5", 0.35))
"""Lateral acceleration of the front axle, m/s^2, and factor of the friction of the tyres, whose peak is 0.74."""


def samples_of_log(draw: Draw) -> dict[str, Sample]:
    """`samples`; empty too if the unseen log is refused."""
    try:
        return samples(draw)
    except FifthwheelError as error:
        print(f"seed {draw.seed} of {draw.run}, {draw.tyres}: {error}", file=sys.stderr, flush=True)
        return {}


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=40)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=2)
    arguments = parser.parse_args()
    seeds = range(arguments.first, arguments.first + arguments.seeds)
    heads = ("", "converged", "coverage", "mean error", "rms error", "mean sigma", "sigma / rms error")
    with ProcessPoolExecutor(arguments.jobs) as pool:
        for (acceleration, friction), tyres in product(RUNS, ("linear", "saturating")):
            draws = [
                Draw(
                    run=SINE + acceleration,
                    nonlinear=True,
                    seed=seed,
                    duration=0.0,
                    changes=(("friction", friction),),
                    tyres=tyres,
                )
                for seed in seeds
            ]
            results = [result for result in pool.map(samples_of_log, draws) if result]
            print(f"\n## {acceleration} m/s², friction {friction:g} x 0.74, {tyres}: {len(results)} of {len(draws)}\n")
            names = results[0] if results else {}
            print("\n".join(table(heads, [row(name, [r[name] for r in results if name in r]) for name in names])))


if __name__ == "__main__":
    main()
