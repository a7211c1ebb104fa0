"""The method of one stage: its solution, and whether the logs contradict earlier ones."""

from collections.abc import Callable, Container, Iterator, Sequence
from dataclasses import replace
from functools import partial

from fifthwheel.base.names import ParameterPath, split_log
from fifthwheel.base.spelling import setting
from fifthwheel.data.record import Record
from fifthwheel.estimate.identify.doubts import UNUSUAL_ESTIMATE, DoubtKind
from fifthwheel.estimate.identify.given import applied
from fifthwheel.estimate.identify.knowledge.information import OUTLIER, LogKnowledge, Occasion
from fifthwheel.estimate.identify.knowledge.knowledge import OUTLYING, UNSURE, Knowledge, LogChange, tyre_change
from fifthwheel.estimate.identify.one_stage.causes import likely_causes
from fifthwheel.estimate.identify.one_stage.doubts import quick_doubts
from fifthwheel.estimate.identify.one_stage.estimator import solve_one_stage
from fifthwheel.estimate.identify.one_stage.identification import build_identification
from fifthwheel.estimate.identify.one_stage.prior import JointPrior
from fifthwheel.estimate.identify.one_stage.shared_information import log_knowledge, with_doubts
from fifthwheel.estimate.identify.one_stage.solution import Solution
from fifthwheel.estimate.identify.result.identification import Identification
from fifthwheel.estimate.identify.settings import OneStage, Progress
from fifthwheel.estimate.identify.setup import Setup, with_tyre_law
from fifthwheel.estimate.identify.unknowns.parameters import VARIATION
from fifthwheel.estimate.identify.verdict import Verdict
from fifthwheel.truck import Vehicle

UNEXPLAINED = "contradicts the earlier logs, and no single change of tyres, load or sensor explains it"
"""Why a log is set aside."""


def identify_one_stage(
    records: Sequence[Record],
    vehicle: Vehicle,
    settings: OneStage,
    *,
    knowledge: Knowledge | None = None,
    occasion: Occasion | None = None,
    validate: Sequence[Record] = (),
    progress: Progress = lambda *_: None,
) -> Identification:
    """Identify a vehicle in one stage; arguments and errors as in `identify`."""
    vehicle, settings = applied(vehicle, settings)
    settings, note = with_tyre_law(vehicle, settings)
    occasion, before = occasion or Occasion(), (knowledge or Knowledge()).without_records(records)
    occasion = replace(occasion, date=occasion.date_of(records))
    before.require_same_truck(vehicle, occasion)
    before.require_same_load(vehicle, occasion)
    solve = partial(solve_one_stage, records, vehicle, settings, validate=validate, progress=progress)
    solution = solve(earlier=partial(before.prior, occasion=occasion) if before.used else None)
    notes = [note]
    if solution.settings.form != settings.form:
        notes.append(
            "The truck is unstable, or nearly, at the speed of the logs, so that no free-running model follows them: "
            f"the parameters are estimated from prediction errors ({setting('form', 'prediction-error')})."
        )
    logs = log_knowledge(solution, occasion)
    if before.used:
        before, solution, logs, found = _reconciled(solve, before, occasion, solution, logs)
        notes += found
        if not logs[0].set_aside:
            last = max(before.used, key=lambda log: log.date)
            notes.append(
                f"Begins with the information of earlier logs ({len(before.used)}, the last of them {last.name})."
            )
            notes.append(_doubtful(before.used))
    causes = likely_causes(solution, solution.linearisation.tests, progress)
    result = build_identification(solution, causes, " ".join(filter(None, notes)))
    unexplained = any(doubt.kind is DoubtKind.NOISE for doubt in result.doubts)
    if unexplained or any(estimate.verdict is Verdict.NOT_CONVERGED for estimate in result.parameters):
        logs = [replace(log, set_aside=log.set_aside or UNSURE) for log in logs]
    return replace(result, knowledge=before.with_logs(with_doubts(logs, result.doubts)))


def _reconciled(
    solve: Callable[..., Solution], before: Knowledge, occasion: Occasion, solution: Solution, logs: list[LogKnowledge]
) -> tuple[Knowledge, Solution, list[LogKnowledge], list[str]]:
    """The knowledge of earlier logs, the solution and the information of its logs where both contradict each other, and
    sentences on the earlier logs."""
    notes = list[str]()
    for _ in before.used:
        earlier = before.earlier_changes_by(logs)
        if not earlier:
            break
        before = before.with_changes(earlier)
        notes += dict.fromkeys(change.text for change in earlier)
        solution = solve(earlier=partial(before.prior, occasion=occasion))
        logs = log_knowledge(solution, occasion)
    if changes := before.changes_by(logs) or tuple(_changed_tyres(solution)):
        solution, logs = _without_what_changed(solve, before, occasion, solution, changes)
        if logs[0].set_aside and (other := before.majority([replace(log, set_aside="") for log in logs])):
            notes.append(f"{', '.join(log.name for log in before.used)}: {OUTLYING}, and is set aside.")
            before = other
            solution = solve(earlier=partial(before.prior, occasion=occasion))
            logs = log_knowledge(solution, occasion)
    return before, solution, logs, notes


def _doubtful(logs: Sequence[LogKnowledge]) -> str:
    """A sentence on the logs with doubts; empty without."""
    doubtful = [log for log in logs if log.doubts]
    if not doubtful:
        return ""
    first, *others = doubtful
    more = f"; also doubtful: {', '.join(log.name for log in others)}" if others else ""
    return (
        f"Of these, {first.name} is doubtful ({first.doubts[0]}){more}. Remove the cause and identify it again, or "
        "leave it out with `fifthwheel knowledge forget`."
    )


def _without_what_changed(
    solve: Callable[..., Solution],
    before: Knowledge,
    occasion: Occasion,
    solution: Solution,
    changes: Sequence[LogChange],
) -> tuple[Solution, list[LogKnowledge]]:
    """The solution where logs contradict earlier ones, and the information of the logs."""
    members = frozenset(name for change in changes for name in change.unknowns)

    def unchanged(setup: Setup) -> JointPrior | None:
        prior = before.prior(setup, occasion)
        return prior and prior.among(frozenset(prior.names) - members)

    if not any(change.kind == OUTLIER for change in changes):
        solution = solve(earlier=unchanged)
        if not _is_contradicted(solution, before.prior(solution.problem.setup, occasion), members):
            first, *others = log_knowledge(solution, occasion)
            return solution, [replace(first, changed=tuple(sorted(members))), *others]
    alone = solve()
    return alone, [replace(log, set_aside=UNEXPLAINED) for log in log_knowledge(alone, occasion)]


def _is_contradicted(solution: Solution, before: JointPrior | None, members: Container[str]) -> bool:
    """Whether a log contradicts earlier ones although some unknowns changed, or these changed implausibly."""
    # an estimate that was unusual before is a wrong guess, and no contradiction
    means = dict(zip(before.names, before.mean.tolist(), strict=True)) if before else {}
    for doubt in quick_doubts(solution):
        changed = [c for c in doubt.causes if c.name in members and abs(means.get(c.name, 0.0)) < UNUSUAL_ESTIMATE]
        if doubt.kind is DoubtKind.ASSUMPTION or changed:
            return True
    return False


def _changed_tyres(solution: Solution) -> Iterator[LogChange]:
    """The tyres of which a log contradicts the variation that is usual from log to log."""
    for doubt in quick_doubts(solution):
        for cause in doubt.causes[:1]:
            path = ParameterPath.of(split_log(cause.name)[0])
            if path.quantity == VARIATION:
                yield tyre_change(path.owner, solution.dataset.records[0].name)
