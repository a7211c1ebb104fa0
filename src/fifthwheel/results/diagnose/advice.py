"""What to do next after an identification, the most useful step first."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from fifthwheel.base.formatting import enumerated, percent, relative
from fifthwheel.base.names import PAYLOAD_HEIGHT, ParameterPath, ends_with
from fifthwheel.base.spelling import setting
from fifthwheel.data.channels import ROLL_RATE, SignalName, names_of
from fifthwheel.estimate.design.assess import InformationAssessment
from fifthwheel.estimate.identify import Estimate, Identification, Verdict
from fifthwheel.estimate.identify.verdict import STRAIGHT
from fifthwheel.results.diagnose.cautions import has_wide_sigma
from fifthwheel.results.diagnose.information_summary import describe_remedy, dominant_terms
from fifthwheel.results.diagnose.residuals import predicted_logs
from fifthwheel.results.diagnose.summaries import RunSummary
from fifthwheel.truck.quantities import FRICTION, quantity_of
from fifthwheel.truck.spoken_names import named, named_unit

LANE_CHANGE = "1.5 m lateral offset within 60 m at 80 to 90 km/h, about 1.5 m/s²"
ROLL = "roll"
EXCITATION = {
    "cornering_stiffness": f"add a log with a lane change ({LANE_CHANGE}), or with bends at another speed. With "
    "one speed only, the stiffness of the axles and the steering ratio cannot be distinguished.",
    "yaw_inertia": "add fast lane changes or a slalom (0.3 to 0.5 Hz). Slow bends hardly depend on yaw inertia.",
    ROLL: f"add lane changes with more roll ({LANE_CHANGE}).",
}
"""Quantity of a parameter, or roll -> the excitation that it needs."""
VERDICTS = {
    Verdict.AT_BOUND: (
        "A parameter at its bound usually indicates an error in the vehicle file or a log. Check masses, axle "
        "positions and the CoG; then check sign, unit and ratio of the steer angle and the gyros.",
        "",
    ),
    Verdict.DOUBTFUL: ("Check what the cautions name, correct what is wrong, and identify again.", ""),
    Verdict.NOT_CONVERGED: (
        "The search had not ended. Identify parts of the log, or state a parameter that is known from another source.",
        "NAME=VALUE +- SIGMA",
    ),
}
"""Verdict -> what to do, and what to state for it."""


@dataclass(frozen=True)
class Advice:
    """One step that improves an identification."""

    message: str  # in words, without options
    option: str = ""  # setting, or the key of a file, that does it; of several each on a line
    parameters: tuple[str, ...] = ()  # that it improves
    signals: tuple[str, ...] = ()  # to log
    logs: tuple[str, ...] = ()  # to use for the identification


def next_steps(
    identification: Identification, runs: Sequence[RunSummary] = (), outlook: InformationAssessment | None = None
) -> list[Advice]:
    """What to do next, the most useful step first.

    Args:
        runs: how the logs were driven.
        outlook: information at the identified truck, for the effect of a change.
    """
    poor = tuple(p.log for p in predicted_logs(identification) if p.poor)
    steps = []
    if poor:
        reason = f"{'it is' if len(poor) == 1 else 'they are'} predicted poorly"
        steps = [Advice(f"Use {enumerated(poor)} for the identification too, because {reason}.", logs=poor)]
    steps += [*_more_excitation(identification, runs), *_roll_rates(identification)]
    steps += [*_predicted_improvements(identification, outlook)] if outlook else []
    steps += [*_separation(identification), *_dominant_uncertainties(identification), *_friction(identification)]
    for verdict, (message, statement) in VERDICTS.items():
        option = setting("statements", statement) if statement else ""
        names = tuple(e.name for e in identification.parameters if e.verdict == verdict)
        steps += [Advice(message, option, parameters=names)] if names else []
    converged = any(e.verdict is Verdict.CONVERGED for e in identification.parameters)
    if converged and all(fit.identified_on for fit in identification.fits):
        steps.append(
            Advice(
                "Validate the result with a log that is not used for the identification.", setting("validate", "LOG")
            )
        )
    return steps


def _more_excitation(identification: Identification, runs: Sequence[RunSummary]) -> Iterator[Advice]:
    elsewhere = dominant_terms(identification)  # another run would not help
    missing = tuple(
        e.name
        for e in identification.parameters
        if (has_wide_sigma(e) and e.name not in elsewhere)
        or (e.verdict is Verdict.NOT_EXCITED and e.sigma is not None)
        or (_has_no_information(e) and has_roll_rate(identification, e.name))
    )
    used = {log.name for log in identification.logs}
    accelerations = [run.acceleration for run in runs if run.name in used and np.isfinite(run.acceleration)]
    if missing and accelerations and max(accelerations) < STRAIGHT:
        yield Advice(
            f"Drive two or more lane changes ({LANE_CHANGE}) and add that log. The present logs reach a lateral "
            f"acceleration of only {max(accelerations):.2f} m/s²: this is almost straight running.",
            parameters=missing,
        )
        return
    for needed, excitation in EXCITATION.items():
        names = tuple(name for name in missing if needed == _excited_by(name))
        if names:
            yield Advice(f"To improve {_listed(names)}, {excitation}", parameters=names)


def _excited_by(name: str) -> str:
    """The key of the excitation that a parameter needs."""
    return ROLL if quantity_of(name).of_roll else ParameterPath.of(name).quantity


def _is_of_suspension(name: str) -> bool:
    """Whether a number acts on the roll rate as a payload height does, and stays with another payload."""
    row = quantity_of(name)
    return row.of_roll and row.scope != "load"


def _has_no_information(e: Estimate) -> bool:
    """Whether the logs do not determine a parameter, although it is not correlated with others; not the friction."""
    unidentifiable = e.verdict is Verdict.NOT_IDENTIFIABLE and not e.correlated_with
    return e.name != FRICTION and (unidentifiable or (e.verdict is Verdict.NOT_EXCITED and e.sigma is None))


def has_roll_rate(identification: Identification, parameter: str) -> bool:
    """Whether the roll rate of the unit of a parameter is logged."""
    unit = ParameterPath.of(parameter).unit
    return any(SignalName.of(name).unit == unit for name in names_of(ROLL_RATE, identification.signals))


def _roll_rates(identification: Identification) -> Iterator[Advice]:
    missing: dict[str, list[str]] = {}
    for e in identification.parameters:
        if _has_no_information(e) and not has_roll_rate(identification, e.name):
            missing.setdefault(e.path.unit, []).append(e.name)
    for unit, names in missing.items():
        yield Advice(
            f"Log the roll rate of the {named_unit(unit)} and identify again. Without it, the logs do not determine "
            f"{_listed(names)}, nor the CoG height and the roll inertia.",
            f"roll_rate.{unit}",
            parameters=tuple(names),
            signals=(f"roll_rate.{unit}",),
        )


def is_unused_friction(estimate: Estimate) -> bool:
    """Whether it is the friction of a road of which the logs use little; it keeps its prior, which is no fault."""
    return estimate.name == FRICTION and estimate.verdict in (Verdict.NOT_EXCITED, Verdict.NOT_IDENTIFIABLE)


def _friction(identification: Identification) -> Iterator[Advice]:
    for e in identification.parameters:
        if is_unused_friction(e):
            yield Advice(
                "The logs use little of the friction of the road, so that it keeps its prior. To estimate it, add a "
                "run with a larger lateral acceleration, 2 m/s² or more on a dry road, 1 m/s² on snow.",
                parameters=(FRICTION,),
            )


def _predicted_improvements(identification: Identification, outlook: InformationAssessment) -> Iterator[Advice]:
    """The sigma after another run or with another channel, for parameters that the logs do not determine."""
    # not of converged ones: the prediction rests on the sensor noise, which is not what limits their sigma
    missing = {
        e.name for e in identification.parameters if e.verdict in (Verdict.NOT_EXCITED, Verdict.NOT_IDENTIFIABLE)
    }
    lane_change = f"one more lane change (SAE J2179) at {3.6 * outlook.speed:.0f} km/h"
    effects: dict[str, dict[str, str]] = {}
    for assessment in outlook.parameters:
        for remedy in assessment.remedies:
            if assessment.name in missing and not remedy.known:
                effect = f"{relative(assessment.value, remedy.sigma)} for {named(assessment.name)}"
                effects.setdefault(describe_remedy(remedy, lane_change, named), {})[assessment.name] = effect
    for change, sigmas in effects.items():
        message = f"Predicted sigma {change}, at best: {enumerated(list(sigmas.values()))}."
        yield Advice(message, parameters=tuple(sigmas))


def _separation(identification: Identification) -> Iterator[Advice]:
    for e in identification.parameters:
        if e.verdict is Verdict.NOT_IDENTIFIABLE and e.correlated_with and e.name != FRICTION:
            other, option = e.correlated_with[0], ""
            cure = f"determine {named(other)} by calibration, or add a run with another manoeuvre."
            if other in identification.initial_vehicle.parameters():
                cure = f"state {named(other)} with its uncertainty from another source."
                option = setting("statements", f"{other}=VALUE +- SIGMA")
            yield Advice(f"To identify {named(e.name)}, {cure}", option, parameters=(e.name,))


def _dominant_uncertainties(identification: Identification) -> Iterator[Advice]:
    """One step for each parameter whose sigma comes from a few uncertain numbers: which ones to measure."""
    stated = {e.name for e in identification.uncertain}
    for name, terms in dominant_terms(identification).items():
        subject = f"of the variance of {named(name)}"
        softening = [term for term in terms if ParameterPath.of(term.source).quantity == "softening"]
        for term in softening:
            yield Advice(
                f"Drive with less lateral acceleration: {percent(term.fraction)} {subject} comes from "
                f"{named(term.source)} with the slip angle.",
                setting("tyres", "saturating"),
                parameters=(name,),
            )
        sources = [term.source for term in terms if term not in softening]
        if not sources:
            continue
        fraction = percent(sum(term.fraction for term in terms if term.source in sources))
        them = "it" if len(sources) == 1 else "them"
        message = f"Measure {_listed(sources)}: about {fraction} {subject} comes from {them}."
        options = [
            setting("statements", f"{source}=+- 5 %") if source in stated else f"{source} in the vehicle file"
            for source in sources
        ]
        if ends_with(name, PAYLOAD_HEIGHT) and any(map(_is_of_suspension, sources)):
            message += " Or calibrate the suspension: by a log with a known payload, or by a static test."
            options += [f"{setting('knowledge', 'RESULT')} {setting('load', 'NAME')}", "fifthwheel roll-test"]
        yield Advice(message, "\n".join(options), parameters=(name,))


def _listed(names: Sequence[str]) -> str:
    return enumerated(list(map(named, names)))
