"""States that are wrong with status OK: runs with one or two wrong samples, for the observer and the learner.

    python benchmarks/faults.py [--cases 2000] [--learner 500]

Each case is a lane change of the linear truck, the second half of it after a gap, with an error of one sample of one or
two channels: at a start, soon after it, after the gap, or anywhere. Errors are log-uniform from 1e-3 to 10 SI, in one of
ten cases from 10 to 1e300, in one of twenty NaN. A state is wrong if it is more than 5 sigma from that of the run
without errors. The learner has learned from a lane change before.
"""

import argparse
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

import fifthwheel as fw
from fifthwheel._types import Array
from trust_runs import table

GAP, WRONG = 400, 5.0
Run = tuple[Array, Mapping[str, Array], Mapping[str, Array]]
"""Status, values and sigmas of a run."""


def damaged(record: fw.Record, rng: np.random.Generator) -> tuple[fw.Record, tuple[str, ...]]:
    """A record with wrong samples, and the quantities that are wrong."""
    signals, names = {name: values.copy() for name, values in record.signals.items()}, sorted(record.signals)
    chosen = rng.choice(names, size=rng.integers(1, 3), replace=False).tolist()
    for name in chosen:
        places = (0, 0, rng.integers(1, 12), GAP, GAP + rng.integers(1, 12), rng.integers(12, len(record.time)))
        error = 10 ** (rng.uniform(-3, 1) if rng.random() < 0.9 else rng.uniform(1, 300))
        wrong = np.nan if rng.random() < 0.05 else error * rng.choice([-1, 1])
        signals[name][rng.choice(places)] += wrong
    return replace(record, signals=signals), tuple(dict.fromkeys(name.split(".")[0] for name in chosen))


def observed(observer: fw.Observer, record: fw.Record) -> Run:
    """Of an observer."""
    states = observer.batch(record)
    return states.status, states.values, states.sigma


def learned(learner: fw.Learner, record: fw.Record) -> Run:
    """Of a learner."""
    own, names = learner.__copy__(), list(record.signals)
    rows = np.column_stack([record.signals[name] for name in names]).tolist()
    answers = [
        own.push({"time": time, **dict(zip(names, row, strict=True))})
        for time, row in zip((record.time + 100.0).tolist(), rows, strict=True)
    ]
    columns = {name: np.array([answer[name] for answer in answers]) for name in answers[0]}
    states = [name for name in columns if f"{name}.sigma" in columns]
    return columns["status"], {n: columns[n] for n in states}, {n: columns[f"{n}.sigma"] for n in states}


def deviation(found: Run, clean: Run) -> float:
    """The largest one of a state with status OK, in sigmas."""
    status, values, sigma = found
    ok = status == fw.Status.OK
    return max(float(np.max(np.abs(v - clean[1][n])[ok] / sigma[n][ok], initial=0.0)) for n, v in values.items())


def row(title: str, run: Callable[[fw.Record], Run], record: fw.Record, cases: int) -> tuple[str, ...]:
    """The row of a front end."""
    rng, clean, wrong, worst, of_steer = np.random.default_rng(16), run(record), 0, 0.0, 0
    for _ in range(cases):
        bad, quantities = damaged(record, rng)
        largest = deviation(run(bad), clean)
        wrong, worst = wrong + (largest > WRONG), max(worst, largest)
        of_steer += largest > WRONG and "steer" in quantities
    ok = np.mean(clean[0] == fw.Status.OK)
    return (title, str(cases), str(wrong), str(of_steer), f"{worst:.3g}", f"{1 - ok:.1%}")


def main() -> None:
    """Write faults.md."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=int, default=2000)
    parser.add_argument("--learner", type=int, default=500)
    arguments = parser.parse_args()
    truck = fw.vehicle("cheng_cebon_2011")
    record = fw.simulate(truck, count=1, seed=2)
    record = replace(record, time=record.time + np.where(np.arange(len(record.time)) < GAP, 0.0, 5.0))
    observer, learner = fw.Observer(truck, record.signals), fw.Learner(truck, record.signals)
    learner.learn(fw.simulate(truck, count=1, seed=3))
    rows = [
        row("observer", lambda r: observed(observer, r), record, arguments.cases),
        row("learner", lambda r: learned(learner, r), record, arguments.learner),
    ]
    heads = ("", "runs", "wrong with OK", "of these with a wrong steer angle", "largest error, sigma", "clean, not OK")
    lines = ["# Wrong states with status OK", "", (__doc__ or "").split("\n\n", 2)[2], *table(heads, rows), ""]
    Path(__file__).with_suffix(".md").write_text("\n".join(lines), encoding="utf-8")


if __name__ == "__main__":
    main()
