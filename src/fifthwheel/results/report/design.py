"""A designed experiment: the run to drive, its predicted sigmas, alternatives, missed targets."""

from collections.abc import Iterator

import numpy as np

from fifthwheel.base import pages
from fifthwheel.base.formatting import approximate, fixed, percent
from fifthwheel.estimate.design import ExperimentDesign, ProposedRun, UnmetTarget
from fifthwheel.estimate.identify import Verdict
from fifthwheel.model.manoeuvres.candidates import KINDS
from fifthwheel.results.diagnose.information_summary import describe_remedy
from fifthwheel.results.report.information import PREDICTION_NOTE, explain_known
from fifthwheel.results.report.words import spoken_verdict

ROAD_NOTE = "It includes the noise of an uneven road."
"""Follows the note on the prediction."""


def design_document(plan: ExperimentDesign) -> pages.Document:
    """The proposed run, its predicted sigma of each parameter, alternatives, and missed targets."""
    remedies = [remedy for target in plan.unmet for remedy in target.remedies]
    channels = f"Logged channels: {', '.join(plan.channels)} at {plan.rate:.0f} Hz."
    blocks: list[pages.Block] = [
        pages.Headline(_headline(plan), plan.met),
        pages.Items(list(_instructions(plan.best)), "Run"),
        pages.Table(("Parameter", "Target>", "Predicted>", "Verdict"), [_row(plan, name) for name in plan.best.sigma]),
        pages.Items([_missed(target) for target in plan.unmet], "Missed targets"),
        pages.Items([f"{_summary(run)}: {_worst(plan, run)}" for run in plan.alternatives], "Alternatives"),
        pages.Items([*plan.notes, *explain_known(remedies), channels, PREDICTION_NOTE, ROAD_NOTE], "Notes"),
    ]
    return pages.Document("Design of a test run", blocks)


def _headline(plan: ExperimentDesign) -> str:
    if plan.met:
        return f"A run of {fixed(plan.best.duration, 0)} s reaches all targets."
    return f"No run reaches all targets: {len(plan.unmet)} of {len(plan.targets)} missed by the best run, shown here."


def _row(plan: ExperimentDesign, name: str) -> tuple[pages.Cell, ...]:
    target = f"±{percent(plan.targets[name])}" if name in plan.targets else ""
    predicted = f"±{percent(plan.best.sigma[name])}" if plan.best.verdicts[name] is Verdict.CONVERGED else "–"
    verdict = plan.best.verdicts[name]
    return name, target, predicted, pages.Mark(spoken_verdict(verdict, predicted=True), verdict)


def _summary(run: ProposedRun) -> str:
    """ "4 x lane change of 0.4 Hz at 88 km/h, 1.5 m/s², 32 s"."""
    kind, acceleration = _of_frequency(KINDS[run.kind].partition(",")[0], run), approximate(run.acceleration, "m/s^2")
    return f"{run.repetitions} x {kind} at {3.6 * run.speed:.0f} km/h, {acceleration}, {fixed(run.duration, 0)} s"


def _of_frequency(kind: str, run: ProposedRun) -> str:
    return kind + (f" of {run.frequency:g} Hz" if run.frequency else "")


def _instructions(run: ProposedRun) -> Iterator[str]:
    repeated = ""
    if run.repetitions > 1:
        repeated = f", alternately left and right, one every {fixed(run.duration / run.repetitions, 1)} s"
    kind = _of_frequency(KINDS[run.kind], run)
    yield f"{run.repetitions} x {kind}{repeated}, at a constant {3.6 * run.speed:.0f} km/h."
    if run.offset and run.frequency:
        length, time = run.speed / run.frequency, 1 / run.frequency
        yield f"Lateral offset {run.offset:.1f} m within {fixed(length, 0)} m and {fixed(time, 1)} s."
    if run.kind == "bend":
        yield f"Radius of the bend {fixed(run.speed**2 / run.leading, -1)} m."
    degrees = np.degrees(np.abs(run.steer).max())
    yield (
        f"Lateral acceleration of each unit up to {approximate(run.acceleration, 'm/s^2')}, road-wheel angle up to "
        f"{degrees:.1f} deg. Start and end straight."
    )


def _worst(plan: ExperimentDesign, run: ProposedRun) -> str:
    """ "semitrailer.yaw_inertia 1.9 %": the largest predicted sigma in units of its target."""
    name = max(plan.targets, key=lambda target: run.sigma[target] / plan.targets[target])
    return f"{name} {percent(run.sigma[name])}"


def _missed(target: UnmetTarget) -> str:
    start = percent(target.sigma) if target.verdict is Verdict.CONVERGED else spoken_verdict(target.verdict)
    text = f"{target.name}: {start}, target {percent(target.wanted)}"
    if not target.remedies:
        return f"{text}; no single change reduces it by 10 % or more"
    changes = ", ".join(f"-> {percent(remedy.sigma)} {describe_remedy(remedy)}" for remedy in target.remedies)
    return f"{text}; {changes}"
