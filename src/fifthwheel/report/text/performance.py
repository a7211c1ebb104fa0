"""An assessment in words."""

from fifthwheel.assess import Assessment, MeasureResult
from fifthwheel.assess.measures import SCHEME
from fifthwheel.formatting import enumerated, with_sigma

LIKELY = 0.95
"""Probability from which a threshold counts as met without doubt."""


def failed(assessment: Assessment) -> list[MeasureResult]:
    """Measures that meet no level of their thresholds."""
    return [m for m in assessment if (t := m.best_threshold()) is not None and not m.meets(t)]


def doubtful(assessment: Assessment) -> list[MeasureResult]:
    """Measures that meet a threshold with a probability below `LIKELY`."""
    return [
        m
        for m in assessment
        if (t := m.best_threshold()) is not None and m.meets(t) and t.probability is not None and t.probability < LIKELY
    ]


def is_good(assessment: Assessment) -> bool:
    """Whether every threshold is met without doubt."""
    return not failed(assessment) and not doubtful(assessment)


def headline(assessment: Assessment) -> str:
    """The result in one sentence."""
    if missed := failed(assessment):
        return f"{assessment.title}: misses {enumerated([m.title for m in missed])}."
    if uncertain := doubtful(assessment):
        names = enumerated([m.title for m in uncertain])
        return f"{assessment.title}: meets all thresholds, but with its uncertainty not surely those of {names}."
    return f"{assessment.title}: meets all thresholds that are assessed."


def explain_assessment(assessment: Assessment) -> list[str]:
    """What sigma, thresholds and assumed dimensions mean."""
    body = assessment.body
    sigma = body.half_track_sigma or None
    overhang = "rear overhang unknown" if body.rear_overhang is None else f"rear overhang {body.rear_overhang:g} m"
    notes = [
        *assessment.notes,
        f"Sigma: from {assessment.origin}.",
        f"Body: half track {with_sigma(body.half_track, sigma, 'm')}, width {body.width:g} m, front overhang "
        f"{body.front_overhang:g} m, {overhang}. A vehicle file does not have these numbers: give them by --body.",
        f"{SCHEME}: thresholds of the Australian performance-based standards (2008), strictest level that is met. "
        "The linear model decides; probability: that the truck meets it, given the sigma.",
    ]
    if sampled := [m.title for m in assessment if m.order == "sampled"]:
        notes.append(f"Sampled, because not linear in the parameters: {enumerated(sampled)}.")
    if unknown := [m.title for m in assessment if m.sigma is None]:
        notes.append(f"Without sigma, because a truck within the uncertainty is unstable: {enumerated(unknown)}.")
    return notes
