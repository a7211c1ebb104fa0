"""The conclusion of an identification or of a state estimation: result, cautions and next steps in sentences.

Verdicts, statuses and counts have the same words on the page and on a terminal.
"""

from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from fifthwheel.base import pages
from fifthwheel.base.formatting import approximate, digits, enumerated, percent, relative, value_and_sigma, with_sigma
from fifthwheel.data.channels import ROLL_RATE, WEIGHTS, YAW_RATE, is_input, is_of, missing_for_mass, si_unit
from fifthwheel.data.record import Record
from fifthwheel.estimate.design.assess import InformationAssessment
from fifthwheel.estimate.identify import Estimate, Identification, Verdict
from fifthwheel.estimate.identify.doubts import DoubtKind
from fifthwheel.estimate.observe import States, Status
from fifthwheel.results.diagnose.advice import Advice, has_roll_rate, is_unused_friction, next_steps
from fifthwheel.results.diagnose.cautions import has_wide_sigma, identification_cautions, is_repaired, state_cautions
from fifthwheel.results.diagnose.doubt_cautions import describe_cause
from fifthwheel.results.diagnose.messages import CautionKind, ranked
from fifthwheel.results.diagnose.residuals import PredictedLog, predicted_logs
from fifthwheel.results.diagnose.summaries import StateSummary, summarise_runs, summarise_states, valid_fraction
from fifthwheel.results.diagnose.thresholds import RELIABLE, SIGNIFICANT, USABLE, WIDE_SIGMA
from fifthwheel.truck.quantities import FRICTION, quantity_of
from fifthwheel.truck.spoken_names import named, named_unit, spoken

MARKS = {
    Verdict.CONVERGED: "✓",
    Verdict.DOUBTFUL: "‽",
    Verdict.NOT_CONVERGED: "…",
    Verdict.NOT_EXCITED: "?",
    Verdict.NOT_IDENTIFIABLE: "∥",
    Verdict.AT_BOUND: "!",
    Verdict.STATED: "=",
    Verdict.FIXED: "=",
}
"""Verdict -> mark."""
WIDE_MARK = "≈"
"""Mark of a converged estimate with a wide sigma."""
STATUSES = {
    "OK": "measured",
    "COASTING": "coasting (no recent measurement)",
    "TOO_SLOW": "too slow for the model",
    "INPUT_MISSING": "speed or steer angle missing",
    "INCONSISTENT": "inconsistent (the measurements contradict the vehicle, the speed or the steer angle)",
    "SETTLING": "settling (too few samples since the start of the filter)",
}
"""Status of a sample of states -> words."""
CONSEQUENCES = "Probably explained by the cautions"
HEAVIER = 0.1
"""Error of a mass whose effect is shown."""
SIGNIFICANT_CHANGE = 0.015
"""Smaller effects of it are not listed."""
SHOWN = 3
"""Steps and cautions that are not folded away."""


def mark(estimate: Estimate) -> str:
    """The mark of an estimate's verdict."""
    return WIDE_MARK if has_wide_sigma(estimate) else MARKS[estimate.verdict]


def spoken_verdict(verdict: Verdict, *, predicted: bool = False) -> str:
    """A verdict in words, such as "not excited"; a predicted "converged" is "identifiable"."""
    return "identifiable" if predicted and verdict is Verdict.CONVERGED else verdict.replace("_", " ")


def counted(count: int, noun: str) -> str:
    """A number with its noun: "1 log", "2 logs"."""
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def sentence(text: str) -> str:
    """A text with a capital letter and a full stop."""
    return text[0].upper() + text[1:] + "."


@dataclass(frozen=True, kw_only=True)
class Conclusion:
    """The conclusion of a report, one sentence or more in each item."""

    good: bool  # whether every parameter is identified, or all states are reliable
    headline: str
    results: tuple[str, ...] = ()
    not_identified: tuple[str, ...] = ()
    cautions: tuple[str, ...] = ()
    consequences: tuple[str, ...] = ()
    """Cautions that those above probably explain."""
    unchecked: str = ""
    """What the logs cannot check, and what follows from an error of it."""
    steps: tuple[Advice, ...] = ()
    """What to do next, the most useful step first."""
    notes: tuple[str, ...] = ()

    @property
    def next_steps(self) -> tuple[str, ...]:
        """The steps in words, without their options."""
        return tuple(step.message for step in self.steps)

    def as_dict(self) -> dict[str, Any]:
        return asdict(self) | {"next_steps": list(self.next_steps)}

    def box(self, first: Sequence[pages.Block] = ()) -> pages.Headline:
        """The headline with what to rely on and what to do, at the top of a page; `first` comes before the lists."""
        cautions: list[pages.Block] = [pages.Items(self.cautions[:SHOWN], "Cautions")]
        if more := self.cautions[SHOWN:]:
            cautions.append(pages.Folded(f"{len(more)} more cautions", [pages.Items(more)]))
        if self.consequences:
            cautions.append(pages.Folded(CONSEQUENCES, [pages.Items(self.consequences)]))
        missing = (pages.Items(self.not_identified, "Not identified"),)
        return pages.Headline(
            self.headline, self.good, ([*first, *self._unchecked()], cautions, missing, tuple(self._steps()))
        )

    def _unchecked(self) -> list[pages.Block]:
        return [pages.Paragraph(self.unchecked)] if self.unchecked else []

    def _steps(self) -> Iterator[pages.Block]:
        """The first steps in words; behind them the options of all, and the other steps."""
        yield pages.Items(self.next_steps[:SHOWN], "Next steps", ordered=True)
        more = self.steps[SHOWN:]
        rows = [(str(k), pages.Code(step.option)) for k, step in enumerate(self.steps, 1) if step.option]
        if rows or more:
            title = "Options of these steps" + (f", and {counted(len(more), 'other step')}" if more else "")
            others = [f"Step {k}: {step.message}" for k, step in enumerate(more, SHOWN + 1)]
            table = [pages.Table(("Step|w|Step ", "Option|name"), rows)] if rows else []
            yield pages.Folded(title, [pages.Items(others), *table])

    def advice(self) -> tuple[pages.Block, ...]:
        """The lists at the end of an output on a terminal."""
        more = len(self.steps) - SHOWN
        where = f"{f'{more} more and the' if more > 0 else 'The'} options for them: report.html, Next steps."
        return (
            *self._unchecked(),
            pages.Items(self.cautions, "Cautions"),
            pages.Items(self.consequences, CONSEQUENCES),
            pages.Items(self.next_steps[:SHOWN], "Next steps"),
            *([pages.Paragraph(where)] if more > 0 or any(step.option for step in self.steps) else []),
            pages.Items(self.notes, "Notes"),
        )


def conclude_identification(
    identification: Identification,
    records: Sequence[Record] = (),
    outlook: InformationAssessment | None = None,
    states: Sequence[States] = (),
    validated: Sequence[Identification] = (),
) -> Conclusion:
    """The conclusion of an identification.

    Args:
        records: the logs, for how they were driven.
        outlook: information at the identified truck, for the effect of a change.
        states: of the identified truck, for whether they fit the measurements.
        validated: validation logs, each identified with the knowledge of the identification.
    """
    given = (Verdict.FIXED, Verdict.STATED)
    estimated = [e for e in identification.parameters if e.verdict not in given and not is_unused_friction(e)]
    converged = [e for e in estimated if e.verdict is Verdict.CONVERGED]
    derived = [e for e in identification.derived if e.verdict is Verdict.CONVERGED]
    runs = summarise_runs(identification, records)
    found = identification_cautions(identification, runs, states, validated)
    cautions, consequences = ranked(found, identification.doubts)
    validation = {log.name for result in validated for log in result.logs}
    contradicted = {c.log for c in found if c.log in validation and c.kind is CautionKind.CONTRADICTION}
    poor = [p.log for p in predicted_logs(identification) if p.poor and p.log not in contradicted]
    first = cautions[0].kind if cautions else None
    headline = _headline(identification, converged, estimated, contradicted, first)
    if poor:
        headline += f" {enumerated(poor)} (validation) {'is' if len(poor) == 1 else 'are'} predicted poorly."
    repaired = [f for f in identification.findings if is_repaired(f)]
    unchecked = [_unchecked_mass(identification, converged, records), _unchecked_scale(records) if converged else ""]
    return Conclusion(
        good=len(converged) == len(estimated) and not contradicted and not poor,
        headline=" ".join((headline, *_changed_wheelbases(identification))),
        results=(
            *[_identified(identification, e) for e in converged],
            *[sentence(f"{spoken(e.name)}, derived: {with_sigma(e.value, e.sigma, e.unit)}") for e in derived],
            *map(_stated, identification.stated_numbers),
            *[_validated(p) for p in predicted_logs(identification) if not p.poor and p.log not in contradicted],
        ),
        not_identified=tuple(_not_identified(identification)),
        cautions=tuple(map(str, cautions)),
        consequences=tuple(map(str, consequences)),
        unchecked=" ".join(filter(None, unchecked)),
        steps=tuple(next_steps(identification, runs, outlook)),
        notes=(*identification.notes, *[f"{finding.log}: {finding.message}" for finding in repaired]),
    )


def _headline(
    identification: Identification,
    converged: Sequence[Estimate],
    estimated: Sequence[Estimate],
    contradicted: Collection[str],
    first: CautionKind | None,
) -> str:
    """The first line; `first` is the kind of the first caution."""
    logs = _logs(identification)
    unexplained = any(doubt.kind is DoubtKind.NOISE for doubt in identification.doubts)
    if unexplained and first is CautionKind.ASSUMPTION:
        return f"The vehicle file or the signal map does not fit: the model does not explain {logs}."
    if contradicted:
        verb = "contradicts" if len(contradicted) == 1 else "contradict"
        return f"{enumerated(sorted(contradicted))} (validation) {verb} the truck that is identified from {logs}."
    if not estimated:
        return "All parameters are fixed: nothing was estimated."
    identified = f"{len(converged)} of {len(estimated)} parameters {'is' if len(converged) == 1 else 'are'} identified"
    if doubtful := sum(e.verdict is Verdict.DOUBTFUL for e in estimated):
        doubts = f"{counted(doubtful, 'estimate')} {'is' if doubtful == 1 else 'are'} doubtful"
        return f"{identified} from {logs}; {doubts}." + (
            _likely_cause(identification) if first is CautionKind.ASSUMPTION else ""
        )
    if not converged:
        unexcited = all(e.verdict is Verdict.NOT_EXCITED for e in estimated)
        counts = Counter(spoken_verdict(e.verdict) for e in estimated)
        why = "the excitation is too small" if unexcited else enumerated([f"{n} {each}" for each, n in counts.items()])
        return f"{identified} from {logs}: {why}."
    wide = [named(e.name) for e in converged if has_wide_sigma(e)]
    sigma = ""
    if wide:
        which = enumerated(wide) if len(wide) <= SHOWN else f"{len(wide)} parameters"
        sigma = f" Rough, with a sigma above {percent(WIDE_SIGMA)}: {which}."
    if stated := [named(e.name) for e in identification.parameters if e.verdict is Verdict.STATED]:
        sigma += f" As stated, not from the logs: {enumerated(stated)}."
    if len(converged) == len(estimated):
        return f"All {len(estimated)} parameters are identified from {logs}.{sigma}"
    return f"{identified} from {logs}.{sigma}"


def _likely_cause(identification: Identification) -> str:
    causes = [c for doubt in identification.doubts if doubt.kind is DoubtKind.ASSUMPTION for c in doubt.causes]
    if len(causes) != 1:
        return " The logs contradict the vehicle file or an assumption on a sensor: see the first caution."
    logs = [log.name for log in identification.logs]
    return f" The logs imply that {describe_cause(causes[0], identification.initial_vehicle, logs)}."


def _changed_wheelbases(identification: Identification) -> Iterator[str]:
    """Wheelbases that differ significantly from the vehicle file, which the stiffness of the tyres depends on."""
    for e in (*identification.derived, *identification.uncertain):
        change = e.value - e.initial
        if e.path.quantity == "wheelbase" and e.sigma and abs(change) > SIGNIFICANT * e.sigma:
            size, _ = value_and_sigma(abs(change), e.sigma)
            times = digits(abs(change) / e.sigma, 2)
            side = "longer" if change > 0 else "shorter"
            yield sentence(f"{named(e.name)} is {size} {e.unit} {side} than in the vehicle file ({times} sigma)")


def _unchecked_scale(records: Sequence[Record]) -> str:
    """What logs without an acceleration or an angle of motion cannot show."""
    measured = {name for record in records for name in record.signals if not is_input(name)}
    if not measured or not all(is_of(name, YAW_RATE, ROLL_RATE) for name in measured):
        return ""
    return (
        "The logs cannot check a factor that the steer angle and the rates have in common, such as a wrong unit of "
        "both: compare the yaw rate with speed and radius in a bend."
    )


def _unchecked_mass(identification: Identification, converged: Sequence[Estimate], records: Sequence[Record]) -> str:
    """By how much the estimates change with the mass of the last unit, by their covariance; empty where a signal shows
    the mass, which `mass_findings` then compares with that of the vehicle file."""
    unit, covariance = identification.vehicle.units[-1].name, identification.covariance
    path = f"{unit}.mass"
    signals = {name for record in records for name in record.signals}
    shown = signals and (not missing_for_mass(signals) or any(is_of(name, *WEIGHTS) for name in signals))
    if shown or covariance is None or path not in covariance.names:
        return ""
    place, P = covariance.names.index(path), covariance.covariance
    per_mass = P[:, place] / P[place, place] * HEAVIER * identification.vehicle.parameters()[path]
    shared = [e for e in converged if e.name != FRICTION and e.name in covariance.names]
    changes = [(e, per_mass[covariance.names.index(e.name)] / e.value) for e in shared]
    listed = [f"{named(e.name)} {100 * change:+.0f} %" for e, change in changes if abs(change) > SIGNIFICANT_CHANGE]
    if not listed:
        return ""
    heavier = f"If the {named_unit(unit)} is {percent(HEAVIER)} heavier than in the vehicle file"
    return f"The logs cannot check the masses. {heavier}: {enumerated(listed)}."


def _logs(identification: Identification) -> str:
    """ "2 logs and 1 earlier one"."""
    own, names = counted(len(identification.logs), "log"), {log.name for log in identification.logs}
    known = identification.knowledge.logs if identification.knowledge else ()
    if any(log.set_aside for log in known if log.name in names):
        return own
    earlier = sum(log.name not in names and not log.set_aside for log in known)
    return f"{own} and {counted(earlier, 'earlier one')}" if earlier else own


def _identified(identification: Identification, e: Estimate) -> str:
    text = f"{spoken(e.name)}: {with_sigma(e.value, e.sigma, e.unit)}"
    if e.sigma is not None and e.value:
        text += f" (±{relative(e.value, e.sigma)})"
    given = identification.initial_vehicle.parameters().get(e.name)
    if given:
        change = e.value / given - 1
        above = f"{percent(abs(change))} {'above' if change > 0 else 'below'}"
        text += f", {above if abs(change) >= 5e-4 else 'equal to'} the vehicle file"
    return sentence(text)


def _stated(e: Estimate) -> str:
    prior = f", stated ±{approximate(e.prior, e.unit)}" if e.prior else ""
    return sentence(f"{spoken(e.name)}: {with_sigma(e.value, e.sigma, e.unit)}{prior}")


def _validated(predicted: PredictedLog) -> str:
    """The result of a log that was only predicted, and not poorly."""
    if predicted.explained is not None:
        explained = percent(predicted.explained, round_down=True)
        result = (
            f"the model explains at least {explained} of the variance of each channel whose residual is larger than "
            "the sensor noise"
        )
    elif predicted.excited:
        result = "no residual is larger than the sensor noise"
    else:
        result = "it does not validate the result, because the truck hardly turns in it"
    return f"{predicted.log} (validation log): {result}."


def _not_identified(identification: Identification) -> list[str]:
    """Parameters without an estimate and the reason, those with the same reason together."""
    names: dict[str, list[str]] = {}
    for e in identification.parameters:
        if e.verdict is not Verdict.CONVERGED:
            names.setdefault(f"({spoken_verdict(e.verdict)}): {_reason(identification, e)}", []).append(spoken(e.name))
    return [sentence(f"{'; '.join(same)} {reason}") for reason, same in names.items()]


def _reason(identification: Identification, e: Estimate) -> str:
    """Why there is no estimate of a parameter, and what its value is."""
    value, unit = with_sigma(e.value, None, e.unit), e.path.unit
    estimate = with_sigma(e.value, e.sigma, e.unit)
    reasons = {
        Verdict.FIXED: f"{value}, as requested",
        Verdict.STATED: f"{estimate}; the logs add little to what you stated",
        Verdict.AT_BOUND: f"{value} is the limit of the permitted range and not an estimate",
        Verdict.DOUBTFUL: f"{estimate} depends on an assumption that the logs contradict; see the cautions",
        Verdict.NOT_CONVERGED: f"the next iteration would change {estimate} by half a sigma or more; do not use it",
    }
    if e.verdict in reasons:
        return reasons[e.verdict]
    origin = _origin(identification, e)
    if e.verdict is Verdict.NOT_IDENTIFIABLE:
        if e.correlated_with:
            others = " and ".join(named(name) for name in e.correlated_with)
            return f"strongly correlated with {others}; {origin}"
        if e.name == FRICTION:
            return f"the logs use too little of it; {origin}"
        if has_roll_rate(identification, e.name):
            return f"the logs contain too little information on it alone, for example too little roll; {origin}"
        return f"the roll rate of the {named_unit(unit)} is not logged; {origin}"
    if e.sigma is None:
        logged = has_roll_rate(identification, e.name)
        why = "the logs excite it too little" if logged else f"no roll rate of the {named_unit(unit)} was logged"
        return f"it was not estimated, because {why}; {origin}"
    prior = e.prior if e.prior is not None else e.sigma
    limit = identification.settings.excited * prior

    def magnitude(sigma: float) -> str:
        return f"±{percent(sigma / abs(e.initial)) if quantity_of(e.name).is_relative else approximate(sigma, e.unit)}"

    return (
        f"the logs reduce sigma too little: {magnitude(limit)} or less is required, the prior sigma is "
        f"{magnitude(prior)}; {origin}"
    )


def _origin(identification: Identification, e: Estimate) -> str:
    """Where the value of a parameter comes from that is not identified."""
    if identification.method == "one-stage" and e.prior is not None:
        return f"the value shown comes mostly from the prior, {with_sigma(e.initial, e.prior, e.unit)}"
    given = identification.initial_vehicle.parameters().get(e.name)
    if given is not None and not np.isclose(given, e.value, rtol=1e-6):
        initial, file = (with_sigma(value, None, e.unit) for value in (e.value, given))
        return f"the value shown, {initial}, is the initial value, the vehicle file has {file}"
    if given is None:
        return "the value shown is the initial value"
    return "the value shown is that of the vehicle file"


def conclude_states(
    states: Sequence[States], records: Sequence[Record], identification: Identification | None = None
) -> Conclusion:
    """The conclusion of a state estimation with a given vehicle file, and with the identification that it is from."""
    summaries = [summarise_states(s, records) for s in states]
    cautions = [caution for s in states for caution in state_cautions(s, "vehicle file")]
    unsure = _why_unsure(identification) if identification else ""
    found = identification_cautions(identification) if identification and unsure else []
    reasons, _ = ranked(found, identification.doubts if identification else ())
    lifting = [c.log for c in cautions if c.log and c.kind is CautionKind.WHEEL_LIFT]
    doubtful = list(dict.fromkeys(c.log for c in cautions if c.log and c.log not in lifting))  # a lift is the cause
    valid = valid_fraction(states)
    return Conclusion(
        good=valid > RELIABLE and not cautions and not unsure,
        headline=unsure or _states_headline(valid, summaries, doubtful, lifting),
        results=tuple(line for summary in summaries for line in _states_result(summary, summary.name in doubtful)),
        cautions=(*[f"Identification: {caution}" for caution in reasons], *map(str, cautions)),
        steps=tuple(
            Advice(f"Cut {s.name} to the part in which the truck drives, or map the missing channels.")
            for s in summaries
            if s.valid < USABLE
        ),
        notes=tuple(dict.fromkeys(f"{r.name}: {note}" for r in records for note in r.notes)),
    )


def _why_unsure(identification: Identification) -> str:
    """Why states of an identified truck are not reliable; empty if they may be."""
    verdicts = [e.verdict for e in identification.parameters if e.verdict is not Verdict.FIXED]
    unsure = (Verdict.DOUBTFUL, Verdict.NOT_CONVERGED, Verdict.AT_BOUND)
    if found := [verdict for verdict in unsure if verdict in verdicts]:
        words = enumerated([spoken_verdict(verdict) for verdict in found])
        return f"The identification has estimates that are {words}: do not rely on these states."
    if verdicts and Verdict.CONVERGED not in verdicts:
        return "The identification determined no parameter: these states are those of the vehicle file."
    return ""


def _states_headline(
    valid: float, summaries: Sequence[StateSummary], doubtful: Sequence[str], lifting: Sequence[str]
) -> str:
    def where(names: Sequence[str]) -> str:
        return "" if len(summaries) == 1 else f" in {', '.join(names)}"

    if doubtful:
        return f"The vehicle file does not fit the measurements{where(doubtful)}: do not rely on these states."
    if lifting:
        return f"A wheel lifts{where(lifting)}: do not rely on the states from there on."
    settled = " in which the filter has settled" if any(Status.SETTLING.name in s.status for s in summaries) else ""
    return f"The states are reliable in {_of_samples(valid)} of {counted(len(summaries), 'log')}{settled}."


def _states_result(summary: StateSummary, doubtful: bool) -> list[str]:
    rest = "; ".join(f"{percent(fraction)} {STATUSES[s]}" for s, fraction in summary.status.items() if s != "OK")
    doubt = ", but they do not fit the vehicle file" if doubtful else ""
    samples = f"{_of_samples(summary.valid)}{f' ({rest})' if rest else ''}"
    lines = [f"{summary.name}: inputs and measurements are present and consistent in {samples}{doubt}."]
    if summary.lift_warning:
        lines.append(f"{summary.name}: {summary.lift_warning}.")
    differences = [f"{n} {approximate(rms, si_unit(n))}" for n, rms in summary.reference_rms.items() if rms is not None]
    if differences:
        lines.append(f"{summary.name}: rms difference from the reference: {', '.join(differences)}.")
    return lines


def _of_samples(fraction: float) -> str:
    return "all samples" if fraction == 1 else f"{percent(fraction, round_down=True)} of the samples"
