"""The information in logs on a terminal: which parameters are identifiable, what would help, errors in the logs."""

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from fifthwheel.diagnose.advice import describe_remedy
from fifthwheel.diagnose.thresholds import WIDE_SIGMA
from fifthwheel.formatting import approximate, percent, relative, with_sigma
from fifthwheel.identify import Verdict
from fifthwheel.record.signal_names import si_unit
from fifthwheel.report.terminal.page import COLOURS, TerminalPage
from fifthwheel.report.text.words import spoken_verdict

if TYPE_CHECKING:
    from rich.console import Console

    from fifthwheel.identify.design.assess import InformationAssessment, ParameterAssessment
    from fifthwheel.identify.design.remedies import Remedy

PREDICTION_NOTE = (
    "The prediction uses the values of the vehicle file, the sensor noise and the uncertain parameters. It does not "
    "include model errors."
)


def show_assessment(outlook: "InformationAssessment", console: "Console | None" = None) -> None:
    """Print the predicted sigma and verdict of each parameter, what would help, and what is wrong with the logs."""
    page = TerminalPage(console)
    errors = [f"{log}: {f.message}" for log, f in outlook.findings if f.severity == "error"]
    warnings = [f"{log}: {f.message}" for log, f in outlook.findings if f.severity != "error"]
    identifiable = [p for p in outlook.parameters if is_identifiable(p)]
    complete = len(identifiable) == len(outlook.parameters) and not errors
    page.headline(_headline(outlook, identifiable, has_errors=bool(errors)), good=complete)
    page.lists(("Errors in the logs", errors))
    page.table(
        ("Parameter", "Value>", "Prior\nsigma>", "Predicted\nsigma>", "Verdict"),
        map(_row, outlook.parameters),
        [COLOURS[p.verdict] for p in outlook.parameters],
    )
    separation = [
        f"{p.name} with {', '.join(p.correlated_with)}" for p in outlook.parameters if p.correlated_with and p.remedies
    ]
    page.lists(
        ("What would help", [_improvement(p) for p in outlook.parameters if p.remedies]),
        ("Strongly correlated", separation),
        ("Cautions", [*outlook.cautions, *warnings]),
        ("Notes", [*outlook.notes, *_notes(outlook), PREDICTION_NOTE]),
    )


def is_identifiable(assessment: "ParameterAssessment") -> bool:
    """Whether an identification would estimate it."""
    return assessment.verdict is Verdict.CONVERGED


def explain_known(remedies: "Sequence[Remedy]") -> Iterator[str]:
    """What "known" means, if a remedy uses it."""
    texts = " ".join(map(describe_remedy, remedies))
    if "--fix" in texts:
        yield "Measured and fixed (--fix): measure it, write it into the vehicle file, and give --fix NAME."
    if "known exactly" in texts:
        yield 'Known exactly: measure it, and state it as exact in the vehicle file, such as mass = "7449 kg exact".'


def _headline(
    outlook: "InformationAssessment", identifiable: "Sequence[ParameterAssessment]", *, has_errors: bool
) -> str:
    logs = outlook.logs[0] if len(outlook.logs) == 1 else f"{len(outlook.logs)} logs"
    if not identifiable:
        unexcited = all(p.verdict is Verdict.NOT_EXCITED for p in outlook.parameters)
        text = f"{logs}: no parameter is identifiable" + (", the excitation is too small." if unexcited else ".")
    else:
        wide = sum(p.sigma / abs(p.value) > WIDE_SIGMA for p in identifiable)
        sigma = f", {wide} with a sigma above {percent(WIDE_SIGMA)}" if wide else ""
        text = f"{logs}: {len(identifiable)} of {len(outlook.parameters)} parameters are identifiable{sigma}."
    if has_errors:
        text += " The logs have errors: correct them first. The predictions below use the logs as they are."
    return text


def _row(p: "ParameterAssessment") -> tuple[str, ...]:
    sigma = f"±{relative(p.value, p.sigma)}" if is_identifiable(p) else "–"
    return (
        p.name,
        with_sigma(p.value, None, p.unit),
        f"±{relative(p.value, p.prior)}",
        sigma,
        spoken_verdict(p.verdict, predicted=True),
    )


def _improvement(p: "ParameterAssessment") -> str:
    """ "name: 20 % -> 12 % if semitrailer.roll_axis_height is calibrated, -> 9 % if one more lane change is driven"."""
    start = relative(p.value, p.sigma) if is_identifiable(p) else spoken_verdict(p.verdict)
    changes = [f"-> {relative(p.value, remedy.sigma)} {describe_remedy(remedy)}" for remedy in p.remedies]
    return f"{p.name}: {start} {', '.join(changes)}"


def _notes(outlook: "InformationAssessment") -> Iterator[str]:
    """What the words and numbers of the page mean."""
    remedies = [remedy for p in outlook.parameters for remedy in p.remedies]
    if any(remedy.drive == "lane_change" for remedy in remedies):
        speed = f"{3.6 * outlook.speed:.0f} km/h"
        yield f"One more lane change: SAE J2179, 1.5 m lateral offset within 61 m, at {speed}."
    yield from explain_known(remedies)
    variances: dict[str, list[float]] = {}
    for noise in outlook.noise.values():
        for name, variance in noise.items():
            variances.setdefault(name, []).append(variance)
    sigmas = [f"{name} {approximate(float(np.sqrt(np.mean(v))), si_unit(name))}" for name, v in variances.items()]
    yield f"Noise of one sample (one sigma): {', '.join(sigmas)}."
