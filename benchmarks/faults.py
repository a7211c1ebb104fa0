"""States that are wrong with status OK: runs with one or two wrong samples, wrong maps and frozen channels.

    python benchmarks/faults.py [--cases 10000] [--learner 5000] [--seed 77]

Each case of the first table is a lane change of the linear truck, the second half of it after a gap, with an error of
one sample of one or two channels: at a start, soon after it, after the gap, or anywhere. Errors are log-uniform from
1e-3 to 10 SI, in one of ten cases from 10 to 1e300, in one of twenty NaN. A state is wrong if it is more than 5 sigma
from that of the run without errors. The learner has learned from a lane change before.

The second table has four lane changes, of which all samples of a channel are wrong: a wrong sign, unit or channel, or
from the second lane change on a value that does not change any more. A state is wrong if it is more than 5 sigma from
the truth. The live learner starts without knowledge; its status is that of `fifthwheel live --learn`. A figure is the
number of samples that are wrong and OK, of 3200; behind it the time from the first wrong sample to the first one after
it that is not OK.

`push`, the export to C and the FMU give the statuses of the observer, and `Learner.push` is what a live learner asks:
tests compare them sample by sample.
"""

import argparse
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

import fifthwheel as fw
from fifthwheel.apps.live.learning import Learning
from fifthwheel.base.types import Array
from trust_runs import table

GAP, WRONG, FROZEN = 400, 5.0, 1000
Run = tuple[Array, Mapping[str, Array], Mapping[str, Array]]
"""Status, values and sigmas of a run."""
STEER, SPEED = "steer.tractor.front", "speed"
YAW, YAW_2, ROLL, ROLL_2 = "yaw_rate.tractor", "yaw_rate.semitrailer", "roll_rate.tractor", "roll_rate.semitrailer"


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


def pushed(learner: fw.Learner | Learning, record: fw.Record) -> Run:
    """Of a learner."""
    names = list(record.signals)
    rows = np.column_stack([record.signals[name] for name in names]).tolist()
    answers = [
        learner.push({"time": time, **dict(zip(names, row, strict=True))})
        for time, row in zip((record.time + 100.0).tolist(), rows, strict=True)
    ]
    columns = {name: np.array([answer[name] for answer in answers]) for name in answers[0]}
    states = [name for name in columns if f"{name}.sigma" in columns]
    return columns["status"], {n: columns[n] for n in states}, {n: columns[f"{n}.sigma"] for n in states}


def deviation(found: Run, right: Mapping[str, Array]) -> Array:
    """The largest one of a state from its right value, in sigmas (N,); 0 where the status is not OK."""
    status, values, sigma = found
    names = values.keys() & right.keys()
    with np.errstate(invalid="ignore"):
        largest = np.max([np.abs(values[n] - right[n]) / sigma[n] for n in names], axis=0)
    return np.where(status == fw.Status.OK, largest, 0.0)


def row(title: str, run: Callable[[fw.Record], Run], record: fw.Record, cases: int, seed: int) -> tuple[str, ...]:
    """The row of a front end with wrong samples."""
    rng, clean, wrong, worst, of_steer = np.random.default_rng(seed), run(record), 0, 0.0, 0
    for _ in range(cases):
        bad, quantities = damaged(record, rng)
        largest = deviation(run(bad), clean[1]).max()
        wrong, worst = wrong + (largest > WRONG), max(worst, largest)
        of_steer += largest > WRONG and "steer" in quantities
    counts = (int(np.sum(clean[0] == fw.Status.SETTLING)), int(np.sum(clean[0] != fw.Status.OK)))
    settling, marked = counts[0], counts[1] - counts[0]
    return (title, str(cases), str(wrong), str(of_steer), f"{worst:.3g}", str(settling), str(marked))


def wrong_maps() -> dict[str, Callable[[Mapping[str, Array]], dict[str, Array]]]:
    """What is wrong -> the signals that change."""

    def sign(*names: str) -> Callable[[Mapping[str, Array]], dict[str, Array]]:
        return lambda s: {name: -s[name] for name in names}

    def scaled(name: str, factor: float) -> Callable[[Mapping[str, Array]], dict[str, Array]]:
        return lambda s: {name: factor * s[name]}

    def exchanged(a: str, b: str) -> Callable[[Mapping[str, Array]], dict[str, Array]]:
        return lambda s: {a: s[b], b: s[a]}

    def frozen(name: str) -> Callable[[Mapping[str, Array]], dict[str, Array]]:
        return lambda s: {name: np.where(np.arange(len(s[name])) < FROZEN, s[name], s[name][FROZEN])}

    return {
        "nothing": lambda s: {},
        "sign of the steer angle": sign(STEER),
        "sign of the tractor's yaw rate": sign(YAW),
        "sign of the trailer's yaw rate": sign(YAW_2),
        "sign of both yaw rates": sign(YAW, YAW_2),
        "sign of the tractor's roll rate": sign(ROLL),
        "sign of the trailer's roll rate": sign(ROLL_2),
        "yaw rates exchanged": exchanged(YAW, YAW_2),
        "roll rates exchanged": exchanged(ROLL, ROLL_2),
        "the trailer's yaw and roll rate exchanged": exchanged(YAW_2, ROLL_2),
        "tractor's yaw rate in deg/s": scaled(YAW, np.degrees(1.0)),
        "steer angle in deg": scaled(STEER, np.degrees(1.0)),
        "steering wheel for steer angle": scaled(STEER, 18.0),
        "speed in m/s as km/h": scaled(SPEED, 1 / 3.6),
        "speed in mph as km/h": scaled(SPEED, 1.609),
        "steer angle frozen": frozen(STEER),
        "tractor's yaw rate frozen": frozen(YAW),
        "trailer's yaw rate frozen": frozen(YAW_2),
        "tractor's roll rate frozen": frozen(ROLL),
        "trailer's roll rate frozen": frozen(ROLL_2),
    }


def cell(found: Run, record: fw.Record) -> str:
    """Wrong samples that are OK, and the time to the first status that is not, s."""
    wrong = deviation(found, record.reference) > WRONG
    if not wrong.any():
        return "0"
    first = int(wrong.argmax())
    marked = np.flatnonzero(found[0][first:] != fw.Status.OK)
    return (
        f"{wrong.sum()}; {record.time[first + marked[0]] - record.time[first]:.2f} s"
        if marked.size
        else f"{wrong.sum()}"
    )


def main() -> None:
    """Write faults.md."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=int, default=10000)
    parser.add_argument("--learner", type=int, default=5000)
    parser.add_argument("--seed", type=int, default=77)
    arguments = parser.parse_args()
    truck = fw.vehicle("cheng_cebon_2011")
    record = fw.simulate(truck, count=1, seed=2)
    record = replace(record, time=record.time + np.where(np.arange(len(record.time)) < GAP, 0.0, 5.0))
    observer, learner = fw.Observer(truck, record.signals), fw.Learner(truck, record.signals)
    learner.learn(fw.simulate(truck, count=1, seed=3))
    samples = [
        row("observer", lambda r: observed(observer, r), record, arguments.cases, arguments.seed),
        row("learner", lambda r: pushed(learner.__copy__(), r), record, arguments.learner, arguments.seed),
    ]
    lanes = fw.simulate(truck, count=4, seed=11)
    maps = []
    for title, change in wrong_maps().items():
        wrong = replace(lanes, signals={**lanes.signals, **change(lanes.signals)})
        live = Learning(fw.Learner(truck, wrong.signals), truck)
        maps.append((title, cell(observed(observer, wrong), lanes), cell(pushed(live, wrong), lanes)))
    heads = ("", "runs", "wrong with OK", "of these with a wrong steer angle", "largest error, sigma")
    clean = ("clean run: settling, of 800", "otherwise not OK")
    lines = ["# Wrong states with status OK", "", (__doc__ or "").split("\n\n", 2)[2]]
    lines += [*table((*heads, *clean), samples), "", *table(("wrong", "observer", "live learner"), maps), ""]
    Path(__file__).with_suffix(".md").write_text("\n".join(lines), encoding="utf-8")


if __name__ == "__main__":
    main()
