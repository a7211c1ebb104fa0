"""What the constants of causes and doubts decide: each halved and doubled; writes constants.md.

    python benchmarks/constants.py [--seed 1] [--clean 20] [--jobs 1]

The faults and the clean logs of `causes`, as far as no check refuses them. The logs are fitted once under each
hypothesis; then the decisions are taken with each constant halved and doubled. The table has the faults whose first
cause is another one, those of which no cause is left, those with other doubtful estimates, and the clean pairs of logs
with a doubt.
"""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path
from types import ModuleType
from typing import Any

from causes import CAREFUL, FAULTS, logs_and_file, parser_of
from fifthwheel.apps.workflow.runs import run_identification
from fifthwheel.base.errors import FifthwheelError
from fifthwheel.estimate.identify import OneStage, doubts
from fifthwheel.estimate.identify.doubts import PriorTest
from fifthwheel.estimate.identify.one_stage import causes, identify
from fifthwheel.estimate.identify.one_stage.doubts import find_doubts
from fifthwheel.estimate.identify.unknowns import unknown
from trust_runs import table

CONSTANTS: tuple[tuple[ModuleType, str], ...] = (
    (unknown, "RATE"),
    (causes, "RANGE"),
    (causes, "MOST_HYPOTHESES"),
    (causes, "LEAST_LINEAR_ODDS"),
    (causes, "ABOUT_AS_LIKELY"),
    (causes, "LARGE_DISCREPANCY"),
    (causes, "LARGE_PULL"),
    (doubts, "STRONG_SCORE"),
    (doubts, "UNUSUAL_SENSOR_ERROR"),
    (doubts, "UNUSUAL_ESTIMATE"),
    (doubts, "HARMFUL_SHIFT"),
    (causes, "NONLINEAR_ACCELERATION"),
)
FACTORS = (0.5, 2.0)
Decision = tuple[str, tuple[str, ...]]
"""Name of the first cause, or "", and those of the doubtful estimates."""


@contextmanager
def replaced(module: ModuleType, name: str, value: Any) -> Iterator[None]:
    before = getattr(module, name)
    setattr(module, name, value)
    try:
        yield
    finally:
        setattr(module, name, before)


def variants() -> Iterator[tuple[str, ModuleType, str, Any]]:
    """Label, module, name and value."""
    for module, name in CONSTANTS:
        before = getattr(module, name)
        for factor in FACTORS:
            yield f"{name} x {factor:g}", module, name, type(before)(before * factor)


class Decisions:
    """Takes the place of `likely_causes`: the decisions with each constant, with fits that are made once."""

    def __init__(self) -> None:
        self.by_label: dict[str, Decision] = {}
        self._fits: dict[Any, Any] = {}

    def __call__(self, solution: Any, tests: Sequence[PriorTest], progress: Any = None) -> causes.Causes:
        with ExitStack() as stack:
            for name in ("_base", "_fitted", "_with_own_noise"):
                stack.enter_context(replaced(causes, name, partial(self._kept, getattr(causes, name))))
            usual = self._decide("", solution, tests)
            for label, module, name, value in variants():
                with replaced(module, name, value):
                    self._decide(label, solution, tests)
        return usual

    def _kept(self, function: Callable[..., Any], *arguments: Any) -> Any:
        names = (each.name if isinstance(each, PriorTest) else each for each in arguments)
        keys = (each if isinstance(each, str | tuple) else id(each) for each in names)
        key = (function.__name__, causes.RANGE, *keys)
        if key not in self._fits:
            self._fits[key] = function(*arguments), arguments  # which keep their ids
        return self._fits[key][0]

    def _decide(self, label: str, solution: Any, tests: Sequence[PriorTest]) -> causes.Causes:
        found = causes.likely_causes(solution, tests)
        doubtful = find_doubts(solution, found.likely, found.left)
        estimates = tuple(sorted({name for doubt in doubtful for name in doubt.parameters}))
        self.by_label[label] = found.likely[0].name if found.likely else "", estimates
        return found


def decisions(case: tuple[str, int]) -> dict[str, Decision]:
    """By the label of the variant; empty where a check refuses the logs."""
    name, seed = case
    records, vehicle = logs_and_file(seed)
    taken = Decisions()
    try:
        if fault := next((fault for fault in FAULTS if fault.name == name), None):
            records, vehicle = [fault.record(record) for record in records], fault.vehicle(vehicle)
        with replaced(identify, "likely_causes", taken):
            run_identification(records, vehicle, OneStage(given=CAREFUL))
    except FifthwheelError:
        return {}
    return taken.by_label


def main() -> None:
    arguments = parser_of(__doc__).parse_args()
    first = arguments.seed
    cases = [(fault.name, first) for fault in FAULTS]
    cases += [("", seed) for seed in range(first + 1, first + 1 + arguments.clean)]
    with ProcessPoolExecutor(arguments.jobs) as pool:
        found = []
        for case, taken in zip(cases, pool.map(decisions, cases), strict=True):
            found.append((case, taken))
            print(case, {label: taken[label] for label in taken if taken[label] != taken[""]}, flush=True)
    faulty = [taken for (name, _), taken in found if name and taken]
    clean = [taken for (name, _), taken in found if not name and taken]
    rows = []
    for label in ["", *[label for label, *_ in variants()]]:
        changed = sum(taken[label][0] != taken[""][0] for taken in faulty)
        none = sum(not taken[label][0] for taken in faulty)
        others = sum(taken[label][1] != taken[""][1] for taken in faulty)
        alarms = sum(bool(taken[label][1]) for taken in clean)
        rows.append((label or "as they are", str(changed), str(none), str(others), str(alarms)))
    head = ["constant", "another first cause", "no cause", "other doubtful estimates", "clean pairs with a doubt"]
    lines = [
        f"# Constants of causes and doubts, halved and doubled (seed {first})",
        "",
        f"{len(faulty)} faults that no check refuses, {len(clean)} clean pairs of logs.",
        "",
        *table(head, rows),
    ]
    Path(__file__).with_suffix(".md").write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
