"""How much information the logs contain on each parameter, what limits its sigma, and what would reduce it."""

import itertools
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from fifthwheel.base.formatting import approximate, digits, enumerated, percent, relative
from fifthwheel.base.names import ParameterPath, split_log
from fifthwheel.base.spelling import setting
from fifthwheel.data.channels import SensorErrorName
from fifthwheel.estimate.design.assess import InformationAssessment
from fifthwheel.estimate.design.remedies import TESTED_AXIS, TESTED_STIFFNESS, Remedy
from fifthwheel.estimate.identify import Estimate, Identification, Verdict
from fifthwheel.results.diagnose import thresholds
from fifthwheel.truck.quantities import MASS_SCALE, TIME_BASE, quantity_of
from fifthwheel.truck.spoken_names import named


class VarianceTerm(NamedTuple):
    """By how much an uncertain number limits a parameter."""

    source: str  # the uncertain number
    fraction: float  # by which the parameter's variance would fall if the source were exact


def variance_budget(identification: Identification, name: str, least: float = 0.0) -> list[VarianceTerm]:
    """The terms of a parameter's variance above a fraction, the largest first; empty for a method that does not compute
    them."""
    terms = itertools.starmap(VarianceTerm, identification.variance_budget.get(name, {}).items())
    return [term for term in terms if term.fraction > least]


def dominant_terms(identification: Identification) -> dict[str, list[VarianceTerm]]:
    """Of each converged parameter with a notable sigma, by its name, the fewest uncertain numbers, up to three, that
    limit it, if any do."""
    dominant = {}
    for e in identification.parameters:
        if e.verdict is Verdict.CONVERGED and e.relative_sigma >= thresholds.NOTABLE_SIGMA:
            largest = variance_budget(identification, e.name, thresholds.LARGE_FRACTION)
            for count in (1, 2, 3):
                if sum(term.fraction for term in largest[:count]) > thresholds.DOMINANT_FRACTION:
                    dominant[e.name] = largest[:count]
                    break
    return dominant


@dataclass(frozen=True, kw_only=True)
class ParameterInformation:
    """What the logs contribute to one parameter."""

    estimate: Estimate
    noise_sigma: float | None = None  # sigma from the sensor noise alone, where it is much smaller, SI
    correlation: tuple[str, float] | None = None  # the largest notable correlation of a separable estimate
    budget: tuple[VarianceTerm, ...] = ()  # the largest terms of its variance
    improvements: tuple[tuple[Remedy, float], ...] = ()  # each with the predicted sigma as a fraction of the value

    @property
    def remaining(self) -> float | None:
        """Fraction of the prior sigma that remains, 0 to 1; None without a prior."""
        e = self.estimate
        if not e.prior:
            return None
        if e.sigma is None:
            return 1.0
        scale = abs(e.initial / e.value) if e.value and quantity_of(e.name).is_relative else 1.0
        return min(scale * e.sigma / e.prior, 1.0)

    @property
    def change(self) -> str:
        """Prior and resulting sigma: "±30 % → ±4.4 %"; in its unit where a fraction means little."""
        e = self.estimate

        def shown(value: float, sigma: float | None) -> str:
            if sigma is None:
                return "–"
            return f"±{relative(value, sigma) if quantity_of(e.name).is_relative else approximate(sigma, e.unit)}"

        prior, result = shown(e.initial, e.prior), shown(e.value, e.sigma)
        return f"{prior} → {result}" if e.prior else result

    @property
    def messages(self) -> tuple[str, ...]:
        """What limits sigma and what would reduce it, a sentence each."""
        e, messages = self.estimate, []
        if e.correlated_with:
            precise = e.verdict is Verdict.CONVERGED and 0 < e.relative_sigma < thresholds.NOTABLE_SIGMA
            relation = "Accurate. Its error is correlated with the errors of" if precise else "Strongly correlated with"
            messages.append(f"{relation} {enumerated(list(map(named, e.correlated_with)))}.")
        elif self.correlation:
            messages.append(f"Correlated with {named(self.correlation[0])} ({self.correlation[1]:.2f}).")
        if self.budget:
            largest, *others = [(percent(term.fraction), named(term.source)) for term in self.budget[:2]]
            text = f"Its variance would be {largest[0]} smaller if {largest[1]} were exact"
            text += "".join(f", {fraction} if {source} were" for fraction, source in others)
            messages.append(f"{text}.")
        if self.noise_sigma and e.sigma:
            messages.append(
                f"Sigma is {digits(e.sigma / self.noise_sigma, 2)} times the sigma from sensor noise alone: the "
                "residuals are autocorrelated."
            )
        if self.improvements:
            changes = [f"{relative(1.0, sigma)} {describe_remedy(r, naming=named)}" for r, sigma in self.improvements]
            messages.append(f"Predicted sigma: {'; '.join(changes)}.")
        return tuple(messages)


def information_summary(
    identification: Identification, outlook: InformationAssessment | None = None
) -> tuple[ParameterInformation, ...]:
    """Information on every estimated parameter.

    Args:
        outlook: information at the identified truck, for the sigma from noise alone and for improvements.
    """
    return tuple(
        _information(identification, e, outlook) for e in identification.parameters if e.verdict is not Verdict.FIXED
    )


def _information(
    identification: Identification, e: Estimate, outlook: InformationAssessment | None
) -> ParameterInformation:
    assessment = next((p for p in outlook.parameters if p.name == e.name), None) if outlook else None
    noise_sigma, improvements = None, list[tuple[Remedy, float]]()
    if assessment is not None:
        estimated = e.verdict in (Verdict.CONVERGED, Verdict.NOT_CONVERGED) and assessment.verdict is Verdict.CONVERGED
        if estimated and e.sigma is not None and e.sigma > thresholds.AUTOCORRELATION_EFFECT * assessment.sigma:
            noise_sigma = assessment.sigma
        else:
            improvements = [
                (remedy, remedy.sigma / abs(assessment.value))
                for remedy in assessment.remedies
                if e.sigma is None or remedy.sigma < thresholds.USEFUL_REDUCTION * e.sigma
            ]
    return ParameterInformation(
        estimate=e,
        noise_sigma=noise_sigma,
        correlation=None if e.correlated_with else _largest_correlation(identification, e),
        budget=tuple(variance_budget(identification, e.name, thresholds.LISTED_FRACTION)),
        improvements=tuple(improvements),
    )


def _largest_correlation(identification: Identification, e: Estimate) -> tuple[str, float] | None:
    """The largest correlation of a converged estimate with another estimated unknown, if it is notable."""
    covariance = identification.covariance
    if covariance is None or e.name not in covariance.names or e.verdict is not Verdict.CONVERGED:
        return None
    i, P = covariance.names.index(e.name), covariance.covariance
    scale = np.sqrt(np.diag(P))
    with np.errstate(divide="ignore", invalid="ignore"):
        magnitude = np.nan_to_num(np.abs(P[i]) / (scale[i] * scale))
    of_vehicle = [*identification.parameters, *identification.uncertain]
    estimated = {o.name for o in of_vehicle if o.verdict is not Verdict.FIXED}
    estimated |= {o.name for o in identification.sensors}
    for j, name in enumerate(covariance.names):
        base, log = split_log(name)
        if j == i or base not in estimated or log == "":
            magnitude[j] = 0.0
    j = int(np.argmax(magnitude))
    notable = magnitude[j] > thresholds.NOTABLE_CORRELATION
    return (covariance.names[j], float(magnitude[j])) if notable else None


def describe_remedy(
    remedy: Remedy, lane_change: str = "one more lane change", naming: Callable[[str], str] = str
) -> str:
    """A change as the end of a sentence: "if x is measured and fixed (given)", "if roll_rate.x is logged".

    Args:
        naming: the words for a channel, such as `spoken_names.named`; by default its name.
    """
    if remedy.known:
        manners: dict[str, list[str]] = {}
        for name in remedy.known:
            subject, manner = _how_to_know(name, naming)
            manners.setdefault(manner, []).append(subject)
        clauses = []
        for manner, subjects in manners.items():
            plural = len(subjects) > 1 or subjects[0].startswith(("all masses", "the axle positions"))
            clauses.append(f"{' and '.join(subjects)} {'are' if plural else 'is'} {manner}")
        return f"if {' and '.join(clauses)}"
    if remedy.roll_test:
        gives = f"its roll stiffness to {percent(TESTED_STIFFNESS)} and its roll axis to {100 * TESTED_AXIS:g} cm"
        return f"if a static test of the {remedy.roll_test} (fifthwheel roll-test) gives {gives}"
    changes = [f"{naming(remedy.channel)} is logged"] if remedy.channel else []
    if remedy.drive:
        changes.append("the same run is repeated" if remedy.drive == "again" else f"{lane_change} is driven")
    return f"if {' and '.join(changes)}"


def _how_to_know(name: str, naming: Callable[[str], str]) -> tuple[str, str]:
    """A number in words, and how it becomes known: ("all masses", "known exactly (state it in the vehicle file)")."""
    error, path = SensorErrorName.of(name), ParameterPath.of(name)
    if error:
        direct = error.kind in ("offset", "gain")
        return f"the {error.kind} of {error.signal}", "calibrated" if direct else "measured"
    together = {
        "axle_positions": f"the axle positions of the {path.unit}",
        "coupling": f"the position of the coupling on the {path.unit}",
        "mass": f"the {path.component} mass of the {path.unit}".replace("  ", " "),
    }
    if name == MASS_SCALE or path.quantity in together:
        return together.get(path.quantity, "all masses"), "known exactly (state it in the vehicle file)"
    if name == TIME_BASE:
        return "the rate of the time base", f"checked ({setting('statements', 'time_base=exact')})"
    return naming(name), f"measured and fixed ({setting('statements')})"
