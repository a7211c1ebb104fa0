"""The reproduction: simulate the trucks, identify over the seeds on all cores, write tables and figures."""

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Mapping
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from fifthwheel._atomic import atomic_write
from fifthwheel.errors import FifthwheelError
from fifthwheel.studies.cheng_cebon_2011 import figures, table
from fifthwheel.studies.cheng_cebon_2011.comparison import Row, VariantErrors, compare, compare_variants
from fifthwheel.studies.cheng_cebon_2011.experiments import Experiment, section_3, section_4, variants, with_variant
from fifthwheel.studies.cheng_cebon_2011.outcomes import Outcome, outcome
from fifthwheel.vehicle import get

_FIGURES = [f"figure_{number}.{kind}" for number in range(4, 10) for kind in ("png", "svg")]
FILES = ("reproduction.md", "reproduction.csv", *_FIGURES)
"""Files of a reproduction."""

Progress = Callable[[str, int, int], None]
"""Called with a title, the steps done and all steps."""


@dataclass(frozen=True, kw_only=True)
class Extent:
    """How much is computed."""

    seeds: int = 20
    """Seeds of every arm of every experiment."""
    repetitions: int = 12
    """Lane changes; the article needs more than 10."""
    variant_seeds: Mapping[str, int]
    """Seeds of every variant, by arm; empty for no variants."""


FULL = Extent(variant_seeds={"article": 3, "default": 1})
QUICK = Extent(seeds=3, repetitions=6, variant_seeds={})


@dataclass(frozen=True, kw_only=True)
class Reproduction:
    """Results, and the files that contain them."""

    experiments: Mapping[str, Experiment]
    outcomes: tuple[Outcome, ...]
    rows: tuple[Row, ...]
    variants: tuple[VariantErrors, ...]
    files: tuple[Path, ...]


def reproduce(out: Path, *, quick: bool = False, progress: Progress = lambda *_: None) -> Reproduction:
    """Reproduce sections 3 and 4 of the article on the nonlinear truck.

    Args:
        out: folder for reproduction.md, reproduction.csv and the figures; created if it is missing.
        quick: fewer seeds, fewer lane changes and no variants, so more random error.
        progress: called while the trucks are simulated and identified.

    Raises:
        FifthwheelError: MuJoCo or matplotlib is not installed.
    """
    for module in ("mujoco", "matplotlib"):
        try:
            __import__(module)
        except ImportError:
            raise FifthwheelError(
                f"the reproduction needs {module}, which is not installed; pip install 'fifthwheel[studies]'"
            ) from None
    extent = QUICK if quick else FULL
    experiments, changed = simulate(extent, progress)
    outcomes = identify_all(experiments, changed, extent, progress)
    rows = compare(experiments, outcomes)
    variant_errors = compare_variants(changed, outcomes)
    remarks = list(table.REMARKS)
    if quick:
        remarks.insert(
            0,
            f"A quick run with {extent.seeds} seeds and {extent.repetitions} lane changes, without variants: its"
            " results have a larger random error than those of a full run.",
        )
    out.mkdir(parents=True, exist_ok=True)
    texts = {
        "reproduction.md": table.markdown(rows, variant_errors, remarks),
        "reproduction.csv": table.as_csv(rows),
    }
    for name, text in texts.items():
        with atomic_write(out / name) as temporary:
            temporary.write_text(text, encoding="utf-8")
    drawn = figures.draw(experiments, outcomes, out)
    return Reproduction(
        experiments=experiments,
        outcomes=tuple(o for o in outcomes if o.experiment in experiments),
        rows=tuple(rows),
        variants=tuple(variant_errors),
        files=(*(out / name for name in texts), *drawn),
    )


def simulate(extent: Extent, progress: Progress) -> tuple[dict[str, Experiment], dict[str, Experiment]]:
    """The experiments of the article and the variants of section 3, by name, with their runs."""
    n = extent.repetitions
    selected = variants(get("cheng_cebon_2011")) if extent.variant_seeds else ()
    makers: list[Callable[[], Experiment]] = [
        partial(section_3, repetitions=n),
        partial(section_3, repetitions=n, point=True),
        partial(section_4, repetitions=n),
        partial(section_4, repetitions=n, errors=True),
    ]
    total = len(makers) + len(selected)
    experiments: list[Experiment] = []
    for make in makers:
        progress("simulating", len(experiments), total)
        experiments.append(make())
    changed: list[Experiment] = []
    for variant in selected:
        progress("simulating", len(experiments) + len(changed), total)
        changed.append(with_variant(experiments[0], variant, repetitions=n))
    progress("simulating", total, total)
    return {e.name: e for e in experiments}, {e.name: e for e in changed}


_experiments: dict[str, Experiment] = {}
"""The experiments in a worker process."""


def _start_worker(experiments: dict[str, Experiment]) -> None:
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # Ctrl-C ends the process without a traceback
    threading.Thread(target=_end_with_parent, daemon=True).start()
    _experiments.update(experiments)


def _end_with_parent() -> None:
    """A parent that is killed cannot end its workers, which would wait for tasks forever."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _identify(name: str, arm_index: int, seed: int) -> Outcome:
    return outcome(_experiments[name], arm_index, seed, keep=seed == 0)


def identify_all(
    experiments: dict[str, Experiment], changed: dict[str, Experiment], extent: Extent, progress: Progress
) -> list[Outcome]:
    """Every outcome in the order of experiments, arms and seeds, computed with one process per core."""
    tasks = [
        (name, i, seed)
        for name, experiment in (experiments | changed).items()
        for i, arm in enumerate(experiment.arms)
        for seed in range(extent.seeds if name in experiments else extent.variant_seeds[arm.name])
    ]
    done: dict[tuple[str, int, int], Outcome] = {}
    workers = max(1, min(os.cpu_count() or 1, 16))
    with ProcessPoolExecutor(
        workers,
        mp_context=multiprocessing.get_context("spawn"),
        initializer=_start_worker,
        initargs=(experiments | changed,),
    ) as pool:
        futures = {pool.submit(_identify, *task): task for task in tasks}
        for future in as_completed(futures):
            done[futures[future]] = future.result()
            progress("identifying", len(done), len(tasks))
    return [done[task] for task in tasks]
