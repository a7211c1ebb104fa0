"""The information in logs: which parameters are identifiable, what would help, and errors in the logs."""

from collections.abc import Iterator, Sequence

import numpy as np

from fifthwheel.base import pages
from fifthwheel.base.formatting import approximate, enumerated, percent, relative, with_sigma
from fifthwheel.base.spelling import setting
from fifthwheel.data.channels import SignalName, si_unit
from fifthwheel.estimate.identify import Verdict
from fifthwheel.estimate.identify.design.assess import InformationAssessment, ParameterAssessment
from fifthwheel.estimate.identify.design.remedies import Remedy
from fifthwheel.results.diagnose.information_summary import describe_remedy
from fifthwheel.results.diagnose.thresholds import WIDE_SIGMA
from fifthwheel.results.report.words import spoken_verdict
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


def information_document(outlook: InformationAssessment) -> pages.Document:
    """Predicted sigma and verdict of each parameter, what would help, and what is wrong with the logs."""
    errors = [f"{log}: {f.message}" for log, f in outlook.findings if f.severity == "error"]
    others = [f"{log}: {f.message}" for log, f in outlook.findings if f.severity != "error"]
    unknown = [p for p in outlook.parameters if p.verdict is not Verdict.STATED]
    identifiable = [p for p in unknown if p.verdict is Verdict.CONVERGED]
    correlated = [p for p in outlook.parameters if p.correlated_with and p.remedies]
    complete = len(identifiable) == len(unknown) and not errors
    blocks: list[pages.Block] = [
        pages.Headline(_headline(outlook, identifiable, len(unknown), bool(errors)), complete),
        pages.Items(errors, "Errors in the logs"),
        pages.Table(HEADS, list(map(_row, outlook.parameters)), label="Predicted sigma"),
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


def _row(p: ParameterAssessment) -> tuple[pages.Cell, ...]:
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
        yield 'Known exactly: measure it, and state it as exact in the vehicle file, such as mass = "7449 kg exact".'


def _headline(
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
