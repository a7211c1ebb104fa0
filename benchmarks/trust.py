"""How often is an identification wrong without saying so? Writes trust.md beside this file.

    python benchmarks/trust.py [--runs one five everyday] [--only CATEGORY ...] [--every N] [--seeds 1] [--jobs 1]
    python benchmarks/trust.py --false-alarms [--seeds 20]
    python benchmarks/trust.py --coverage [--seeds 20]
    python benchmarks/trust.py --check

Each case corrupts a log of the nonlinear truck, its run, or the vehicle file by one fault of `trust_corruptions`, and
identifies the truck with the default settings. Every stiffness and yaw inertia starts at 80 or 120 % of the value in
the vehicle file.

The error of a parameter divided by its sigma is z. The error of a stiffness is its distance from the range of the
nominal stiffness and the effective stiffness at steer angles of 0.1 and 1 degree. A parameter is wrong if |z| > 3. The
outcome of a case is

    refused   the identification raised an error of this package: the log or the vehicle file is not used
    within    no parameter is wrong
    flagged   each wrong parameter has another verdict than `converged`, or a message names the cause
    silent    a wrong parameter has the verdict `converged`, and no message names the cause
    crashed   another exception

`--check` applies every corruption once, without an identification. `--cases` takes single corruptions by their names.

The messages are the cautions and notes that `fifthwheel identify` prints. A message that also appears without the
corruption, with any numbers, does not count. Next steps do not count: they are advice that always holds.
"""

import argparse
import multiprocessing
import re
import time
import warnings
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import cache
from itertools import product
from pathlib import Path

import numpy as np

from fifthwheel.apps.studies.scenarios import initial_guess
from fifthwheel.base.errors import FifthwheelError
from fifthwheel.data.record import Record
from fifthwheel.estimate.identify import Identification, identify
from fifthwheel.estimate.observe import Observer, States
from fifthwheel.model.plant import Properties, article_sensors
from fifthwheel.model.plant.properties import with_changes
from fifthwheel.model.simulate import simulate
from fifthwheel.results.diagnose.cautions import Caution, identification_cautions
from fifthwheel.results.diagnose.summaries import summarise_runs
from fifthwheel.results.report import conclude_identification
from trust_corruptions import CORRUPTIONS, Corruption
from trust_coverage import coverage_tables
from trust_runs import RUNS, TRUCK, Changes, Range, driven, table, true_ranges

LIMIT = 3.0
"""A parameter with a larger |z| is wrong."""
MUTE = "silent without any message"
"""Column for the silent cases in which no message differs from those without the corruption."""
QUICK_STEP = 14
"""`--quick` takes one of so many corruptions of each category."""


class Outcome(StrEnum):
    """What became of a case; see the docstring of this module."""

    REFUSED = "refused"
    FLAGGED = "flagged"
    WITHIN = "within"
    SILENT = "silent"
    CRASHED = "crashed"


@dataclass(frozen=True, kw_only=True)
class Case:
    """A run, its corruption and the seed of noise and initial values."""

    run: str
    corruption: str
    seed: int
    duration: float
    """Of everyday driving, s."""


@dataclass(frozen=True, kw_only=True)
class Wrong:
    """One estimate that is wrong by more than `LIMIT` sigma."""

    name: str
    error: float
    """As a fraction of the true value."""
    sigma: float
    """As a fraction of the true value."""
    z: float
    verdict: str


@dataclass(frozen=True, kw_only=True)
class Judgement:
    """The outcome of a case, and its reasons."""

    case: Case
    outcome: Outcome
    wrong: tuple[Wrong, ...] = ()
    messages: tuple[str, ...] = ()
    """Those that do not appear without the corruption; the error of a case that was refused or crashed."""
    seconds: float = 0.0
    """CPU time."""

    @property
    def corruption(self) -> Corruption:
        return CORRUPTIONS[self.case.corruption]


# Identification and judgement


def logs(case: Case, runs: Sequence[Changes]) -> list[Record]:
    """The uncorrupted logs of a case, one for each run."""
    return [
        driven(case.run, case.seed, case.duration, changes).record(article_sensors(TRUCK), seed=case.seed + 1000 * i)
        for i, changes in enumerate(runs)
    ]


@dataclass(frozen=True, kw_only=True)
class Result:
    """An identification and what the command line needs for its messages."""

    identification: Identification
    records: tuple[Record, ...]
    states: tuple[States, ...]

    @property
    def messages(self) -> tuple[str, ...]:
        conclusion = conclude_identification(self.identification, self.records, None, self.states)
        return (*conclusion.cautions, *conclusion.notes)

    @property
    def cautions(self) -> list[Caution]:
        runs = summarise_runs(self.identification, self.records)
        return identification_cautions(self.identification, runs, self.states)


def result_of(case: Case, corruption: Corruption | None) -> Result:
    """Identify the truck, and estimate the states of every log, as `fifthwheel identify` does."""
    records, vehicle = logs(case, corruption.runs if corruption else ((),)), TRUCK
    if corruption:
        records, vehicle = [corruption.record(record) for record in records], corruption.vehicle(vehicle)
    named = [Record(time=r.time, signals=r.signals, name=f"log {i}", notes=r.notes) for i, r in enumerate(records, 1)]
    result = identify(named, initial_guess(vehicle, case.seed))
    states = tuple(
        Observer(result.vehicle, r.signals, result.observer_settings(r.name)).batch(r, result.uncertainty(r.name))
        for r in named
    )
    return Result(identification=result, records=tuple(named), states=states)


def wrong_estimates(result: Identification, ranges: Mapping[str, Range]) -> Iterator[Wrong]:
    """The estimates that are wrong, parameters first, then derived quantities."""
    for estimate in (*result.parameters, *result.derived):
        if not estimate.sigma or estimate.name not in ranges:  # such as the friction, which few of these logs use
            continue
        nearest = float(np.clip(estimate.value, *ranges[estimate.name]))
        z = (estimate.value - nearest) / estimate.sigma
        if not abs(z) <= LIMIT:
            yield Wrong(
                name=estimate.name,
                error=estimate.value / nearest - 1,
                sigma=estimate.sigma / nearest,
                z=z,
                verdict=str(estimate.verdict),
            )


def without_numbers(message: str) -> str:
    return re.sub(r"\d[\d.]*", "#", message)


@cache
def usual_messages(case: Case) -> frozenset[str]:
    """Messages on the uncorrupted log, without numbers."""
    return frozenset(map(without_numbers, result_of(case, None).messages))


def judge(case: Case) -> Judgement:
    """Corrupt, identify, judge."""
    corruption, start = CORRUPTIONS[case.corruption], time.process_time()
    wrong: tuple[Wrong, ...] = ()
    usual = usual_messages(Case(run=case.run, corruption="", seed=case.seed, duration=case.duration))
    try:
        result = result_of(case, corruption)
        messages = tuple(m for m in result.messages if without_numbers(m) not in usual)
    except FifthwheelError as error:
        outcome, messages = Outcome.REFUSED, (str(error),)
    except Exception as error:
        outcome, messages = Outcome.CRASHED, (f"{type(error).__name__}: {error}",)
    else:
        wrong = tuple(wrong_estimates(result.identification, true_ranges(corruption.runs)))
        outcome = outcome_of(corruption, wrong, messages)
    seconds = time.process_time() - start
    return Judgement(case=case, outcome=outcome, wrong=wrong, messages=messages, seconds=seconds)


def outcome_of(corruption: Corruption, wrong: Sequence[Wrong], messages: Sequence[str]) -> Outcome:
    """WITHIN, FLAGGED or SILENT."""
    if not wrong:
        return Outcome.WITHIN
    named = any(word.lower() in message.lower() for word in corruption.words for message in messages)
    return Outcome.FLAGGED if named or all(w.verdict != "converged" for w in wrong) else Outcome.SILENT


@dataclass(frozen=True, kw_only=True)
class Alarm:
    """What an uncorrupted log gives."""

    case: Case
    doubtful: tuple[str, ...]
    """Parameters with the verdict `doubtful`."""
    errors: tuple[str, ...]
    """Cautions of severity error."""
    cautions: tuple[str, ...]
    """All cautions."""
    wrong: tuple[Wrong, ...]


def alarm(case: Case) -> Alarm:
    """Identify the truck from an uncorrupted log."""
    result = result_of(case, None)
    estimates = (*result.identification.parameters, *result.identification.derived)
    return Alarm(
        case=case,
        doubtful=tuple(e.name for e in estimates if e.verdict == "doubtful"),
        errors=tuple(str(c) for c in result.cautions if c.severity == "error"),
        cautions=tuple(map(str, result.cautions)),
        wrong=tuple(wrong_estimates(result.identification, true_ranges(((),)))),
    )


# Tables


def summary(judgements: Sequence[Judgement]) -> list[str]:
    """Outcomes by category, as lines of Markdown."""
    counts: dict[str, Counter[str]] = {}
    for judgement in judgements:
        counter = counts.setdefault(judgement.corruption.category, Counter())
        counter[judgement.outcome] += 1
        counter[MUTE] += judgement.outcome is Outcome.SILENT and not judgement.messages
    log = [counter for category, counter in counts.items() if not category.startswith("file")]
    files = [counter for category, counter in counts.items() if category.startswith("file")]
    totals = {"**all corruptions of logs**": log, "**all wrong vehicle files**": files}
    counts |= {name: sum(parts, Counter()) for name, parts in totals.items() if parts}
    columns = (*Outcome, MUTE)
    rows = [
        (name, sum(counter[outcome] for outcome in Outcome), *(counter[column] for column in columns))
        for name, counter in counts.items()
    ]
    return table(("category", "cases", *columns), rows)


def silent_cases(judgements: Sequence[Judgement]) -> list[str]:
    """Every wrong estimate of the silent cases and the messages, as lines of Markdown."""
    rows = [
        (*place(j), w.name, percent(w.error), percent(w.sigma), f"{w.z:+.1f}", said(j))
        for j in judgements
        if j.outcome is Outcome.SILENT
        for w in j.wrong
        if w.verdict == "converged"
    ]
    return table((*PLACE, "estimate", "error, %", "sigma, %", "z", "messages"), rows)


def flagged_cases(judgements: Sequence[Judgement]) -> list[str]:
    """The largest |z| of the flagged cases and their messages, as lines of Markdown."""
    rows = [(*place(j), *largest(j.wrong), said(j)) for j in judgements if j.outcome is Outcome.FLAGGED]
    return table((*PLACE, "largest", "z", "verdict", "messages"), rows)


PLACE = ("category", "corruption", "seed")


def place(judgement: Judgement) -> tuple[str, str, int]:
    return judgement.corruption.category, judgement.case.corruption, judgement.case.seed


def said(judgement: Judgement) -> str:
    """The beginning of each message."""
    return " / ".join(message[:100] for message in judgement.messages)


def largest(wrong: Sequence[Wrong]) -> tuple[str, str, str]:
    worst = max(wrong, key=lambda w: abs(w.z))
    return worst.name, f"{worst.z:+.1f}", worst.verdict


def percent(fraction: float) -> str:
    return f"{100 * fraction:+.1f}"


def section(title: str, judgements: Sequence[Judgement]) -> list[str]:
    """The tables of one run."""
    crashed = [
        (j.case.corruption, j.case.seed, j.messages[0][:200]) for j in judgements if j.outcome is Outcome.CRASHED
    ]
    lines = [f"## {title}", "", *summary(judgements), ""]
    lines += [f"### {title}: silent cases", "", *silent_cases(judgements), ""]
    lines += [f"### {title}: flagged cases", "", *flagged_cases(judgements), ""]
    if crashed:
        lines += [f"### {title}: crashed", "", *table((*PLACE, "exception"), crashed), ""]
    return lines


def alarm_section(title: str, alarms: Sequence[Alarm]) -> list[str]:
    """False alarms of one run."""
    n = len(alarms)
    count = table(
        ("uncorrupted logs", "with a doubtful estimate", "with an error", "with a caution", "with |z| > 3"),
        [(n, *(sum(bool(getattr(a, key)) for a in alarms) for key in ("doubtful", "errors", "cautions", "wrong")))],
    )
    rows = [
        (a.case.seed, ", ".join(a.doubtful), " / ".join(a.cautions), ", ".join(f"{w.name} {w.z:+.1f}" for w in a.wrong))
        for a in alarms
        if a.doubtful or a.cautions or a.wrong
    ]
    return [f"## {title}: false alarms", "", *count, "", *table(("seed", "doubtful", "cautions", "wrong, z"), rows), ""]


def corruption_counts() -> list[str]:
    """The number of corruptions by category, as lines of Markdown, after a check of each.

    Raises:
        ValueError: a corruption changes nothing, more than one input, the number of samples, or gives another log each
            time; or no message could name it.
    """
    record = simulate(TRUCK, count=1)
    signals = {name: 4 * values for name, values in record.signals.items()}  # so large that each corruption acts
    record = record.with_signals(signals | {"speed": 20 + np.sin(record.time)})
    for corruption in CORRUPTIONS.values():
        log, vehicle = corruption.record(record), corruption.vehicle(TRUCK)
        runs = [with_changes(Properties(), dict(changes)) for changes in corruption.runs]
        changed = [log != record, vehicle != TRUCK, runs != [Properties()]]
        if changed.count(True) != 1 or changed[1] != corruption.category.startswith("file"):
            raise ValueError(f"{corruption.name}: expected a change of the log, the file or the truck, got {changed}")
        if len(log) != len(record) or log != corruption.record(record):
            raise ValueError(f"{corruption.name}: expected the same log each time, with as many samples as before")
        if not corruption.words:
            raise ValueError(f"{corruption.name}: expected words of a message that names it, got none")
    return table(("category", "corruptions"), Counter(c.category for c in CORRUPTIONS.values()).items())


# Command line


def judged(cases: Sequence[Case], jobs: int) -> list[Judgement]:
    """The judgements of all cases, with progress."""
    judgements = []
    with multiprocessing.Pool(jobs) as pool:
        for i, judgement in enumerate(pool.imap(judge, cases), 1):
            wrong = ", ".join(f"{w.name} {w.z:+.1f}" for w in judgement.wrong)
            name = f"{judgement.case.run}, {judgement.corruption.category}, {judgement.case.corruption}"
            print(f"[{i}/{len(cases)}] {name}: {judgement.outcome} {wrong} ({judgement.seconds:.1f} s)", flush=True)
            judgements.append(judgement)
    print(f"{sum(j.seconds for j in judgements) / max(len(cases), 1):.1f} s of CPU time per case", flush=True)
    return judgements


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", nargs="+", choices=RUNS, default=["one", "five"])
    categories = sorted({corruption.category for corruption in CORRUPTIONS.values()})
    parser.add_argument("--only", nargs="+", choices=categories, metavar="CATEGORY", help=", ".join(categories))
    parser.add_argument("--cases", nargs="+", choices=CORRUPTIONS, metavar="CORRUPTION", help="single corruptions")
    parser.add_argument("--every", type=int, default=1, help="take one of so many corruptions of each category")
    parser.add_argument("--quick", action="store_true", help=f"--runs one --every {QUICK_STEP}, below a minute")
    parser.add_argument("--check", action="store_true", help="of the corruptions, without an identification")
    parser.add_argument("--false-alarms", action="store_true", help="uncorrupted logs only")
    parser.add_argument("--coverage", action="store_true", help="coverage of the intervals with random errors only")
    parser.add_argument("--seeds", type=int, help="default 1; 20 for false alarms and coverage")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--duration", type=float, default=300.0, help="of everyday driving, s")
    parser.add_argument("--output", type=Path, help="file for the tables; default: trust.md for a full run")
    return parser.parse_args()


def selected(categories: Sequence[str] | None, step: int) -> list[str]:
    """Names of corruptions: of each category (None: of all) every one in `step`, from the middle of the first step."""
    names: dict[str, list[str]] = {}
    for name, corruption in CORRUPTIONS.items():
        if not categories or corruption.category in categories:
            names.setdefault(corruption.category, []).append(name)
    return [name for group in names.values() for name in group[min(step // 2, len(group) - 1) :: step]]


def tables(options: argparse.Namespace) -> list[str]:
    """All tables that the options demand, as lines of Markdown."""
    if options.check:
        return corruption_counts()
    repeated = options.coverage or options.false_alarms
    seeds = range(options.seeds or (20 if repeated else 1))
    if options.coverage:
        return coverage_tables(options.runs, seeds, options.jobs, options.duration)
    lines: list[str] = []
    for run in ["one"] if options.quick else options.runs:
        if options.false_alarms:
            clean = [Case(run=run, corruption="", seed=seed, duration=options.duration) for seed in seeds]
            with multiprocessing.Pool(options.jobs) as pool:
                lines += alarm_section(RUNS[run], pool.map(alarm, clean))
            continue
        names = options.cases or selected(options.only, QUICK_STEP if options.quick else options.every)
        cases = [Case(run=run, corruption=n, seed=s, duration=options.duration) for s, n in product(seeds, names)]
        lines += section(RUNS[run], judged(cases, options.jobs))
    return lines


def main() -> None:
    """Run the cases, print the tables and write them."""
    options = arguments()
    warnings.simplefilter("ignore", RuntimeWarning)
    lines = ["# Trust", "", "Written by `python benchmarks/trust.py`; its docstring explains the outcomes.", ""]
    lines += tables(options)
    print("\n".join(lines))
    partial = options.quick or options.only or options.cases or options.every > 1
    complete = not (partial or options.check or options.coverage or options.false_alarms)
    file = options.output or (Path(__file__).with_suffix(".md") if complete else None)
    if file:
        file.write_text("\n".join(lines), encoding="utf-8")


if __name__ == "__main__":
    main()
