"""The reproduction: simulate the trucks, identify over the seeds on all cores, write tables and figures."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from fifthwheel.apps.cheng_cebon_2011 import figures, table
from fifthwheel.apps.cheng_cebon_2011.comparison import Row, compare, compare_variants
from fifthwheel.apps.cheng_cebon_2011.experiments import (
    RESULTS,
    Experiment,
    section_3,
    section_4,
    variants,
    with_variant,
)
from fifthwheel.apps.cheng_cebon_2011.outcomes import Outcome, history_table, outcome, parameter_table
from fifthwheel.apps.cluster import results_of
from fifthwheel.apps.studies.result_table import write_table
from fifthwheel.base.errors import FifthwheelError, VehicleError
from fifthwheel.base.lazy import require
from fifthwheel.base.pages import html
from fifthwheel.estimate.identify.settings import Progress
from fifthwheel.truck import Vehicle, get

PAGE = "reproduction.html"
FILES = (PAGE, "parameters.parquet", "histories.parquet", *[f"figure_{number}.svg" for number in range(4, 10)])
"""Files of a reproduction."""
ARMS = ("article", "default", "one stage", "default, front fixed")
"""Names of the arms; section 4 without errors has all of them."""


@dataclass(frozen=True, kw_only=True)
class Extent:
    """How much is computed."""

    seeds: int = 20  # seeds of every arm of every experiment
    repetitions: int = 12  # lane changes; the article needs more than 10
    variant_seeds: Mapping[str, int]  # seeds of every variant, by arm; empty for no variants


FULL = Extent(variant_seeds={"article": 3, "default": 1})
QUICK = Extent(seeds=3, repetitions=6, variant_seeds={})


@dataclass(frozen=True, kw_only=True)
class Reproduction:
    """Results, and the files that contain them."""

    rows: tuple[Row, ...]
    files: tuple[Path, ...]


def reproduce(
    out: Path,
    *,
    quick: bool = False,
    seeds: int | None = None,
    arms: Sequence[str] = (),
    vehicle: Vehicle | None = None,
    progress: Progress = lambda *_: None,
) -> Reproduction:
    """Reproduce sections 3 and 4 of the article on the nonlinear truck; the files are `FILES` in the folder `out`.

    `quick` takes fewer seeds, fewer lane changes and no variants, so that the random error is larger. `seeds` is the
    number of seeds of every experiment, `arms` names those to compute, by default all. With a vehicle in place of that
    of section 3, section 4 and the variants are left out, and nothing is compared with published numbers.

    Raises:
        FifthwheelError: MuJoCo or matplotlib is not installed; an arm does not exist; seeds are below 1.
        VehicleError: the vehicle does not have the parameters of the article's truck.
    """
    for module in ("mujoco", "matplotlib"):
        require(module, "studies")
    if unknown := [arm for arm in arms if arm not in ARMS]:
        raise FifthwheelError(f"arms: no arm {unknown[0]!r}; choose from {', '.join(map(repr, ARMS))}")
    if seeds is not None and seeds < 1:
        raise FifthwheelError(f"seeds: expected 1 or more, got {seeds}")
    if vehicle is not None:
        _require_article_parameters(vehicle)
    extent = QUICK if quick else FULL
    extent = replace(extent, seeds=seeds or extent.seeds, variant_seeds=extent.variant_seeds if vehicle is None else {})
    experiments, changed = simulate(extent, progress, arms, vehicle)
    outcomes = identify_all(experiments, changed, extent, progress)
    rows = compare(experiments, outcomes)
    remarks = list(table.REMARKS)
    if quick:
        remarks.insert(
            0,
            f"A quick run with {extent.seeds} seeds and {extent.repetitions} lane changes, without variants: its"
            " results have a larger random error than those of a full run.",
        )
    out.mkdir(parents=True, exist_ok=True)
    tables = {"parameters.parquet": parameter_table, "histories.parquet": history_table}
    for name, made in tables.items():
        write_table(made(experiments | changed, outcomes), out / name)
    drawn = figures.captioned(experiments, outcomes)
    html.write(out / PAGE, table.document(rows, compare_variants(changed, outcomes), remarks, drawn))
    images = [out / f"{figure.path[-1].replace(' ', '_')}.svg" for figure in drawn]
    for figure, image in zip(drawn, images, strict=True):
        figure.plot.save(image, size=(7.2, 1.5 + 0.7 * len(figure.plot.panels)))
    return Reproduction(rows=tuple(rows), files=(out / PAGE, *(out / name for name in tables), *images))


def _require_article_parameters(vehicle: Vehicle) -> None:
    """Raise a VehicleError where a truck does not have the parameters that the article estimates."""
    values = vehicle.parameters() | vehicle.derived()
    missing = [p.quantity for p in RESULTS if p.case == "simulation" and p.quantity not in values]
    if missing:
        raise VehicleError(
            f"{missing[0]}: not in {vehicle.name}; the reproduction needs a tractor and a laden semitrailer with the"
            " names of `fifthwheel vehicle cheng_cebon_2011`; use study() for other vehicles"
        )


def simulate(
    extent: Extent, progress: Progress, arms: Sequence[str] = (), vehicle: Vehicle | None = None
) -> tuple[dict[str, Experiment], dict[str, Experiment]]:
    """The experiments of the article and the variants of section 3, by name, with their runs and the chosen arms."""
    n = extent.repetitions
    selected = variants(get("cheng_cebon_2011")) if extent.variant_seeds else ()
    makers = [partial(section_3, repetitions=n, truck=vehicle, point=point) for point in (False, True)]
    if vehicle is None:
        makers += [partial(section_4, repetitions=n, errors=errors) for errors in (False, True)]
    total = len(makers) + len(selected)
    made: list[Experiment] = []
    for number, make in enumerate(makers):
        progress("simulating", number, total)
        made.append(make())
    changed: list[Experiment] = []
    for number, variant in enumerate(selected, len(makers)):
        progress("simulating", number, total)
        changed.append(with_variant(made[0], variant, repetitions=n))
    progress("simulating", total, total)
    return _with_arms(made, arms), _with_arms(changed, arms)


def _with_arms(experiments: Sequence[Experiment], arms: Sequence[str]) -> dict[str, Experiment]:
    """Experiments by name with some of their arms, all if none is given; without those that have none of them."""
    chosen = [replace(e, arms=tuple(arm for arm in e.arms if not arms or arm.name in arms)) for e in experiments]
    return {e.name: e for e in chosen if e.arms}


def _identify(experiments: Mapping[str, Experiment], task: tuple[str, int, int]) -> Outcome:
    name, arm_index, seed = task
    return outcome(experiments[name], arm_index, seed, keep=seed == 0)


def identify_all(
    experiments: dict[str, Experiment], changed: dict[str, Experiment], extent: Extent, progress: Progress
) -> list[Outcome]:
    """Every outcome in the order of experiments, arms and seeds."""
    tasks = [
        (name, i, seed)
        for name, experiment in (experiments | changed).items()
        for i, arm in enumerate(experiment.arms)
        for seed in range(extent.seeds if name in experiments else extent.variant_seeds[arm.name])
    ]
    done: dict[tuple[str, int, int], Outcome] = {}
    for task, result in results_of(_identify, experiments | changed, tasks):
        done[task] = result
        progress("identifying", len(done), len(tasks))
    return [done[task] for task in tasks]
