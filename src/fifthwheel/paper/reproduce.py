"""All of it: drive the trucks, identify over the seeds on every core, write table and figures."""

import multiprocessing
import os
import signal
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fifthwheel.errors import FifthwheelError
from fifthwheel.paper import figures, table
from fifthwheel.paper.experiments import Experiment, on_test_vehicle, simulation
from fifthwheel.paper.runs import Outcome, run
from fifthwheel.paper.variants import variants, varied
from fifthwheel.vehicle import get
from fifthwheel.whole import whole

Progress = Callable[[str, int, int], None]


@dataclass(frozen=True, kw_only=True)
class Extent:
    """How much is run."""

    seeds: int = 20
    """Of noise and of starts, for every experiment and arm."""
    repetitions: int = 12
    """Of the lane change; the article needs more than 10."""
    variant_seeds: Mapping[str, int]
    """Of each variant, by arm."""


FULL = Extent(variant_seeds={"article": 3, "default": 1})
QUICK = Extent(seeds=3, repetitions=6, variant_seeds={})


@dataclass(frozen=True, kw_only=True)
class Reproduction:
    """What was found, and the files it is in."""

    experiments: Mapping[str, Experiment]
    outcomes: tuple[Outcome, ...]
    rows: "tuple[table.Row, ...]"
    variants: "tuple[table.Variant, ...]"
    files: tuple[Path, ...]


_experiments: dict[str, Experiment] = {}


def _begin(experiments: dict[str, Experiment]) -> None:
    """In a new process: what the tasks are about; Ctrl-C ends it at once."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    _experiments.update(experiments)


def _task(name: str, arm: int, seed: int) -> Outcome:
    experiment = _experiments[name]
    return run(experiment.drive, experiment.sensors, experiment.arms[arm], seed, experiment=name, keep=seed == 0)


def reproduce(out: Path, *, quick: bool = False, progress: Progress = lambda *_: None) -> Reproduction:
    """Section 3 and section 4 of the article, on the nonlinear truck.

    Args:
        out: folder for reproduction.md, reproduction.csv and the figures; made if missing.
        quick: fewer seeds and repetitions, and no variants; the numbers then scatter.
        progress: called with a title, the number of parts done and of all.

    Raises:
        FifthwheelError: MuJoCo or matplotlib is missing.
    """
    for needed in ("mujoco", "matplotlib"):
        try:
            __import__(needed)
        except ImportError:
            raise FifthwheelError(f"{needed} is missing: pip install '.[paper]' in the checkout") from None
    extent = QUICK if quick else FULL
    experiments = driven(extent, progress)
    kept = [name for name in experiments if name in CASES]
    outcomes = identified(experiments, extent, progress)
    main = [outcome for outcome in outcomes if outcome.experiment in kept]
    shown = {name: experiments[name] for name in kept}
    rows = tuple(table.rows(shown, main))
    moved = tuple(varied_rows(experiments, outcomes))
    out.mkdir(parents=True, exist_ok=True)
    texts = {
        "reproduction.md": table.markdown(rows, moved, remarks(extent, quick=quick)),
        "reproduction.csv": table.as_csv(rows),
    }
    for name, text in texts.items():
        with whole(out / name) as part:
            part.write_text(text, encoding="utf-8")
    drawn = figures.draw(shown, main, out)
    return Reproduction(
        experiments=shown,
        outcomes=tuple(main),
        rows=rows,
        variants=moved,
        files=(*(out / name for name in texts), *drawn),
    )


CASES = ("simulation", "point payload", "test vehicle", "test vehicle, flawed")


def driven(extent: Extent, progress: Progress) -> dict[str, Experiment]:
    """Every experiment with its drive, the variants behind the article's own."""
    made: dict[str, Experiment] = {}
    n = extent.repetitions
    jobs: list[Callable[[], Experiment]] = [
        lambda: simulation(repetitions=n),
        lambda: simulation(repetitions=n, name="point payload"),
        lambda: on_test_vehicle(repetitions=n, flawed=False),
        lambda: on_test_vehicle(repetitions=n, flawed=True),
    ]
    if extent.variant_seeds:
        jobs += [
            lambda variant=variant: varied(made["simulation"], variant, repetitions=n)  # type: ignore[misc]
            for variant in variants(get("cheng_cebon_2011"))
        ]
    for i, job in enumerate(jobs):
        progress("driving the trucks", i, len(jobs))
        experiment = job()
        made[experiment.name] = experiment
    progress("driving the trucks", len(jobs), len(jobs))
    return made


def identified(experiments: dict[str, Experiment], extent: Extent, progress: Progress) -> list[Outcome]:
    """Every run, in the order of experiments, arms and seeds, on as many processes as there are cores."""
    tasks = [
        (name, arm, seed)
        for name, experiment in experiments.items()
        for arm in range(len(experiment.arms))
        for seed in range(seeds_of(name, experiment.arms[arm].name, extent))
    ]
    done: dict[tuple[str, int, int], Outcome] = {}
    context = multiprocessing.get_context("spawn")
    workers = max(1, min(os.cpu_count() or 1, 16))
    with ProcessPoolExecutor(workers, mp_context=context, initializer=_begin, initargs=(experiments,)) as pool:
        futures = {pool.submit(_task, *task): task for task in tasks}
        for future in as_completed(futures):
            done[futures[future]] = future.result()
            progress("identifying", len(done), len(tasks))
    return [done[task] for task in tasks]


def seeds_of(name: str, arm: str, extent: Extent) -> int:
    """How many seeds an experiment's arm is run with."""
    return extent.seeds if name in CASES else extent.variant_seeds[arm]


def varied_rows(experiments: Mapping[str, Experiment], outcomes: Sequence[Outcome]) -> "list[table.Variant]":
    """Mean error of each variant and arm, per cent."""
    found = []
    for name, experiment in experiments.items():
        if name in CASES:
            continue
        truth = experiment.drive.vehicle.parameters() | experiment.drive.vehicle.derived()
        for arm in experiment.arms:
            runs = [o for o in outcomes if o.experiment == name and o.arm == arm.name]
            errors = {
                quantity: 100 * (float(np.mean([o.values[quantity] for o in runs])) / truth[quantity] - 1)
                for quantity in runs[0].values
            }
            found.append(table.Variant(name=f"{name} ({arm.name})", values=errors, seeds=len(runs)))
    return found


def remarks(extent: Extent, *, quick: bool) -> list[str]:
    """What a reader has to know beside the numbers."""
    told = [
        "The article's TruckSim vehicle is not public. Ours is a multibody truck of the published and implied "
        "values, the rest of it chosen; its tyres have a relaxation length and are not linear, its axles roll "
        "on their tyres.",
        "The preset is the article's, with its models: no relaxation length, yaw alone in stage 1. Its P_p(0) "
        "and its sampling are not published; ours are Q_p and 100 Hz. The table of variants, in a full run, "
        "says what they move.",
        "What moves the preset's payload height most is what the estimator is told of the truck: where its "
        "suspensions' roll centres are, and how stiff they are in roll. A published 0.6 % says that TruckSim "
        "and the estimator were told the same, not that a height is known so well.",
        "Section 4's speed, true tyres and optical noise are ours. Sideslip at the landing leg is that of the "
        "road below the body, as an optical sensor on it sees it.",
    ]
    if quick:
        told.insert(
            0, f"A quick run: {extent.seeds} seeds, {extent.repetitions} lane changes, no variants. It scatters."
        )
    return told
