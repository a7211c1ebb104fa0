"""What logs tell before an estimation: which parameters are identifiable, what would help; the run to drive."""

from collections.abc import Iterator, Sequence

import numpy as np

from fifthwheel.base import pages
from fifthwheel.base.formatting import approximate, enumerated, fixed, percent, relative, with_sigma
from fifthwheel.base.spelling import setting
from fifthwheel.data.channels import SignalName, si_unit
from fifthwheel.estimate.design import ExperimentDesign, ProposedRun, UnmetTarget
from fifthwheel.estimate.design.assess import InformationAssessment, ParameterAssessment
from fifthwheel.estimate.design.remedies import Remedy
from fifthwheel.estimate.identify import Verdict
from fifthwheel.model.manoeuvres.candidates import KINDS
from fifthwheel.results.diagnose.information_summary import describe_remedy
from fifthwheel.results.diagnose.thresholds import WIDE_SIGMA
from fifthwheel.results.report.conclusion import spoken_verdict
from fifthwheel.truck.quantities import quantity_of, size_of
from fifthwheel.truck.spoken_names import named, spoken

PREDICTION_NOTE = (
    "The prediction uses the values of the vehicle file, the sensor noise and the uncertain parameters. It does not "
    "include model errors."
)
HEADS = (
    *("Parameter|name", "Value>|wide", "Prior\nsigma>|wide", "Predicted\nsigma>", "Prior and predicted sigma"),
    "Verdict",
)
ROAD_NOTE = "It includes the noise of an uneven road."
"""Follows the note on the prediction."""


def information_document(outlook: InformationAssessment) -> pages.Document:
    """Predicted sigma and verdict of each parameter, what would help, and what is wrong with the logs."""
    errors = [f"{log}: {f.message}" for log, f in outlook.findings if f.severity == "error"]
    others = [f"{log}: {f.message}" for log, f in outlook.findings if f.severity != "error"]
    unknown = [p for p in outlook.parameters if p.verdict is not Verdict.STATED]
    identifiable = [p for p in unknown if p.verdict is Verdict.CONVERGED]
    correlated = [p for p in outlook.parameters if p.correlated_with and p.remedies]
    complete = len(identifiable) == len(unknown) and not errors
    blocks: list[pages.Block] = [
        pages.Headline(_information_headline(outlook, identifiable, len(unknown), bool(errors)), complete),
        pages.Items(errors, "Errors in the logs"),
        pages.Table(HEADS, list(map(_information_row, outlook.parameters)), label="Predicted sigma"),
        pages.Items([_improvement(p) for p in outlook.parameters if p.remedies], "What would help"),
        *_sensors(outlook),
        pages.Items(list(map(_correlation, correlated)), "Strongly correlated"),
        pages.Items([*outlook.cautions, *others], "Cautions"),
        pages.Items([*outlook.notes, *_notes(outlook)], "Notes"),
    ]
    return pages.Document("Information in the logs", blocks)


def _has_sigma(p: ParameterAssessment) -> bool:
    """Whether the predicted sigma means something: of an estimate, or of what a user stated."""
    return p.verdict in (Verdict.CONVERGED, Verdict.STATED)


def _information_row(p: ParameterAssessment) -> tuple[pages.Cell, ...]:
    return (
        pages.Hinted(spoken(p.name), p.name),
        with_sigma(p.value, None, p.unit),
        f"±{_spread(p, p.prior)}",
        f"±{_spread(p, p.sigma)}" if _has_sigma(p) else "–",
        _bar(p),
        pages.Mark(spoken_verdict(p.verdict, predicted=True), p.verdict),
    )


def _spread(p: ParameterAssessment, sigma: float) -> str:
    """A sigma as a fraction of the value, or in the unit of a number that may be 0."""
    return relative(p.value, sigma) if p.value and not quantity_of(p.name).signed else approximate(sigma, p.unit)


def _bar(p: ParameterAssessment) -> pages.Markup:
    """Prior and predicted sigma as bars of up to 100 % of the value."""
    prior, predicted = (min(sigma / size_of(p.name, p.value, p.prior), 1.0) for sigma in (p.prior, p.sigma))
    return pages.Markup(
        f'<div class="fw-bar" aria-hidden="true"><span class="prior" style="width: {100 * prior:.1f}%"></span>'
        f'<span class="predicted" style="width: {100 * predicted if _has_sigma(p) else 0:.1f}%"></span></div>'
    )


def explain_known(remedies: Sequence[Remedy]) -> Iterator[str]:
    """What "known" means, if a remedy uses it, and how a number is stated."""
    known = {name: describe_remedy(Remedy(known=(name,))) for remedy in remedies for name in remedy.known}
    if fixed := [name for name, text in known.items() if "measured and fixed" in text]:
        settings = setting("statements", *(f"{name}=VALUE exact" for name in fixed))
        yield f"To fix a number that you have measured, add {settings}."
    if any("known exactly" in text for text in known.values()):
        yield 'Known exactly: measure it, and state it as exact in the vehicle file, such as mass = "8630 kg exact".'


def _information_headline(
    outlook: InformationAssessment, identifiable: Sequence[ParameterAssessment], count: int, has_errors: bool
) -> str:
    logs = outlook.logs[0] if len(outlook.logs) == 1 else f"{len(outlook.logs)} logs"
    if not identifiable:
        unexcited = all(p.verdict in (Verdict.NOT_EXCITED, Verdict.STATED) for p in outlook.parameters)
        text = f"{logs}: no parameter is identifiable" + (", the excitation is too small." if unexcited else ".")
    else:
        wide = [named(p.name) for p in identifiable if p.relative_sigma > WIDE_SIGMA]
        sigma = f"; rough, with a sigma above {percent(WIDE_SIGMA)}: {enumerated(wide)}" if wide else ""
        text = f"{logs}: {len(identifiable)} of {count} parameters are identifiable{sigma}."
    if has_errors:
        text += " The logs have errors: correct them first. The predictions below use the logs as they are."
    return text


def _improvement(p: ParameterAssessment) -> str:
    """As "Trailer, yaw inertia: 20 % -> 12 % if the roll axis height of the trailer is calibrated"."""
    start = _spread(p, p.sigma) if _has_sigma(p) else spoken_verdict(p.verdict)
    changes = [f"-> {_spread(p, remedy.sigma)} {describe_remedy(remedy, naming=named)}" for remedy in p.remedies]
    return f"{spoken(p.name)}: {start} {', '.join(changes)}"


def _sensors(outlook: InformationAssessment) -> Iterator[pages.Block]:
    """Predicted sigma of each parameter with one more signal, for the most useful one of each quantity."""
    best: dict[str, str] = {}
    for signal in outlook.sensors:
        best.setdefault(SignalName.of(signal).quantity, signal)
    signals = list(best.values())
    if not signals:
        return
    heads = [spoken(signal).replace(", ", "\n") for signal in signals]
    yield pages.Table(
        ("With one more sensor|name", "Now>", *[f"{head}>" for head in heads]),
        [
            (
                spoken(p.name),
                f"±{_spread(p, p.sigma)}" if _has_sigma(p) else "–",
                *[f"±{_spread(p, s)}" if (s := outlook.sensors[c][p.name]) < p.prior else "–" for c in signals],
            )
            for p in outlook.parameters
            if all(p.name in outlook.sensors[c] for c in signals)
        ],
        label="Predicted sigma with one more sensor",
    )


def _correlation(p: ParameterAssessment) -> str:
    return f"{spoken(p.name)}, with {enumerated(list(map(named, p.correlated_with)))}"


def _notes(outlook: InformationAssessment) -> Iterator[str]:
    remedies = [remedy for p in outlook.parameters for remedy in p.remedies]
    if any(remedy.drive == "lane_change" for remedy in remedies):
        speed = f"{3.6 * outlook.speed:.0f} km/h"
        yield f"One more lane change: SAE J2179, 1.5 m lateral offset within 61 m, at {speed}."
    if outlook.sensors:
        yield (
            "One more sensor: the best of each quantity, in the order of the mean reduction of sigma, of its logarithm "
            "over all parameters."
        )
    yield from explain_known(remedies)
    variances: dict[str, list[float]] = {}
    for noise in outlook.noise.values():
        for name, variance in noise.items():
            variances.setdefault(name, []).append(variance)
    sigmas = [f"{name} {approximate(float(np.sqrt(np.mean(v))), si_unit(name))}" for name, v in variances.items()]
    yield f"Noise of one sample (one sigma): {', '.join(sigmas)}."
    yield PREDICTION_NOTE


def design_document(plan: ExperimentDesign) -> pages.Document:
    """The proposed run, its predicted sigma of each parameter, alternatives, and missed targets."""
    remedies = [remedy for target in plan.unmet for remedy in target.remedies]
    channels = f"Logged channels: {', '.join(plan.channels)} at {plan.rate:.0f} Hz."
    blocks: list[pages.Block] = [
        pages.Headline(_design_headline(plan), plan.met),
        pages.Items(list(_instructions(plan.best)), "Run"),
        pages.Table(
            ("Parameter", "Target>", "Predicted>", "Verdict"), [_design_row(plan, name) for name in plan.best.sigma]
        ),
        pages.Items([_missed(target) for target in plan.unmet], "Missed targets"),
        pages.Items([f"{_summary(run)}: {_worst(plan, run)}" for run in plan.alternatives], "Alternatives"),
        pages.Items([*plan.notes, *explain_known(remedies), channels, PREDICTION_NOTE, ROAD_NOTE], "Notes"),
    ]
    return pages.Document("Design of a test run", blocks)


def _design_headline(plan: ExperimentDesign) -> str:
    if plan.met:
        return f"A run of {fixed(plan.best.duration, 0)} s reaches all targets."
    return f"No run reaches all targets: {len(plan.unmet)} of {len(plan.targets)} missed by the best run, shown here."


def _design_row(plan: ExperimentDesign, name: str) -> tuple[pages.Cell, ...]:
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
