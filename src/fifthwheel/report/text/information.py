"""The words of the information in logs: which parameters are identifiable, and what would help."""

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from fifthwheel.diagnose.advice import describe_remedy
from fifthwheel.diagnose.thresholds import WIDE_SIGMA
from fifthwheel.formatting import approximate, percent, relative
from fifthwheel.identify import Verdict
from fifthwheel.record.signal_names import si_unit
from fifthwheel.report.text.words import spoken_verdict

if TYPE_CHECKING:
    from fifthwheel.identify.design.assess import InformationAssessment, ParameterAssessment
    from fifthwheel.identify.design.remedies import Remedy

PREDICTION_NOTE = (
    "The prediction uses the values of the vehicle file, the sensor noise and the uncertain parameters. It does not "
    "include model errors."
)


def is_identifiable(assessment: "ParameterAssessment") -> bool:
    """Whether an identification would estimate it."""
    return assessment.verdict is Verdict.CONVERGED


def errors(outlook: "InformationAssessment") -> list[str]:
    """What is wrong with the logs."""
    return [f"{log}: {f.message}" for log, f in outlook.findings if f.severity == "error"]


def warnings(outlook: "InformationAssessment") -> list[str]:
    """Cautions of the assessment, and what is unusual in the logs."""
    return [*outlook.cautions, *[f"{log}: {f.message}" for log, f in outlook.findings if f.severity != "error"]]


def separation(outlook: "InformationAssessment") -> list[str]:
    """Parameters that are strongly correlated with others."""
    return [
        f"{p.name} with {', '.join(p.correlated_with)}" for p in outlook.parameters if p.correlated_with and p.remedies
    ]


def improvements(outlook: "InformationAssessment") -> list[str]:
    """What would help, a sentence for each parameter with a remedy."""
    return [improvement(p) for p in outlook.parameters if p.remedies]


def explain_known(remedies: "Sequence[Remedy]") -> Iterator[str]:
    """What "known" means, if a remedy uses it."""
    texts = " ".join(map(describe_remedy, remedies))
    if "--fix" in texts:
        yield "Measured and fixed (--fix): measure it, write it into the vehicle file, and give --fix NAME."
    if "known exactly" in texts:
        yield 'Known exactly: measure it, and state it as exact in the vehicle file, such as mass = "7449 kg exact".'


def headline(outlook: "InformationAssessment") -> str:
    """How many parameters are identifiable, and whether the logs have errors."""
    identifiable = [p for p in outlook.parameters if is_identifiable(p)]
    logs = outlook.logs[0] if len(outlook.logs) == 1 else f"{len(outlook.logs)} logs"
    if not identifiable:
        unexcited = all(p.verdict is Verdict.NOT_EXCITED for p in outlook.parameters)
        text = f"{logs}: no parameter is identifiable" + (", the excitation is too small." if unexcited else ".")
    else:
        wide = sum(p.sigma / abs(p.value) > WIDE_SIGMA for p in identifiable)
        sigma = f", {wide} with a sigma above {percent(WIDE_SIGMA)}" if wide else ""
        text = f"{logs}: {len(identifiable)} of {len(outlook.parameters)} parameters are identifiable{sigma}."
    if errors(outlook):
        text += " The logs have errors: correct them first. The predictions below use the logs as they are."
    return text


def improvement(p: "ParameterAssessment") -> str:
    """ "name: 20 % -> 12 % if semitrailer.roll_axis_height is calibrated, -> 9 % if one more lane change is driven"."""
    start = relative(p.value, p.sigma) if is_identifiable(p) else spoken_verdict(p.verdict)
    changes = [f"-> {relative(p.value, remedy.sigma)} {describe_remedy(remedy)}" for remedy in p.remedies]
    return f"{p.name}: {start} {', '.join(changes)}"


def notes(outlook: "InformationAssessment") -> Iterator[str]:
    """What the words and numbers mean, and the assumed noise."""
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
    yield PREDICTION_NOTE
