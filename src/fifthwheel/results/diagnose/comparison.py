"""Estimates of several identifications side by side, and their differences in units of sigma.

The difference of two estimates a and b of a parameter has the standard deviation

    sigma^2 = n_a^2 + n_b^2 + sum_i (s_ai - s_bi)^2,    n_a^2 = sigma_a^2 - sum_i s_ai^2,

with s_ai = |P_ai| dp_a/dz_a, the shift of estimate a if the prior mean of the uncertain number i is off by one standard
deviation (covariance P of the unknowns in units of their priors). The squared correlation fraction_i of the variance
budget and the standard deviation r_i of number i after the logs, in units of its prior, give s_ai = sqrt(fraction_i)
sigma_a r_i. The sum is over the numbers that are uncertain in both identifications, with the same value in both vehicle
files: the errors of their priors are the same, and shift both estimates to the same side. All else counts as
independent. CoG heights and the rollover threshold follow from the parameters and have no variance budget: sigma of
their differences is an upper limit.
"""

import csv
import io
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from statistics import NormalDist
from typing import Any

from fifthwheel.base.arguments import expect
from fifthwheel.base.errors import FifthwheelError, SignalError
from fifthwheel.base.formatting import enumerated, percent, shown, with_sigma
from fifthwheel.base.plots import Axis, Guide, Item, Panel, Plot, Points
from fifthwheel.estimate.identify import Estimate, Identification, Verdict
from fifthwheel.results.assess.assessment import rollover_threshold
from fifthwheel.truck import Vehicle, unit_of
from fifthwheel.truck.spoken_names import spoken

FALSE_ALARM = 0.05
"""Probability that a difference of equal trucks counts as one beyond chance."""
PRIOR_FRACTION = 0.1
"""An estimate that takes a larger fraction of its information from the prior is noted."""
SAME_NUMBER, LISTED_NUMBERS, TINY = 1e-3, 3, 1e-9
"""Numbers of two vehicle files are the same up to this relative difference; of the others so many are listed. Numbers
of both that are smaller than the last are 0."""


@dataclass(frozen=True, kw_only=True)
class Difference:
    """The difference of an estimate from that of the reference, SI."""

    value: float
    sigma: float | None
    """Standard deviation; None if one of the estimates has none."""
    at_least: bool
    """sigma is an upper limit: the identifications share logs, whose noise is common, or the quantity is derived."""

    @property
    def sigmas(self) -> float | None:
        """The difference in units of its sigma, with sign; None without a sigma."""
        return self.value / self.sigma if self.sigma else None


@dataclass(frozen=True, kw_only=True)
class ComparedParameter:
    """One parameter or derived quantity in all runs; None where a run did not estimate it."""

    name: str
    unit: str
    estimates: tuple[Estimate | None, ...]
    differences: tuple[Difference | None, ...]
    """From the reference; None for the reference itself."""
    derived: bool = False
    """Whether it follows from the parameters: CoG height or rollover threshold. The headline does not count it."""

    def sigmas(self, k: int) -> float:
        """The difference of run k in units of its sigma; 0 without one."""
        difference = self.differences[k]
        return (difference.sigmas if difference else None) or 0.0

    def in_unit(self, k: int) -> str:
        """The difference of run k: "−190 ± 50 kN/rad"."""
        return self._in(k, 1.0, self.unit)

    def in_percent(self, k: int) -> str:
        """The difference of run k in per cent of the reference: "−15.1 ± 4.0 %"."""
        reference = self.estimates[0]
        return self._in(k, 100 / abs(reference.value), "%") if reference and reference.value else ""

    def in_sigmas(self, k: int) -> str:
        """The difference of run k in words, such as "+2.1 sigma" or "at least +2.1 sigma"; "" without a sigma."""
        difference = self.differences[k]
        if difference is None or difference.sigmas is None:
            return ""
        rounded = round(difference.sigmas, 1)
        if not rounded:
            return "0.0 sigma"
        number = f"{rounded:+.1f} sigma".replace("-", "−")
        return f"at least {number}" if difference.at_least else number

    def _in(self, k: int, factor: float, unit: str) -> str:
        difference = self.differences[k]
        if difference is None:
            return ""
        sigma = None if difference.sigma is None else difference.sigma * factor
        return "+" * (difference.value > 0) + with_sigma(difference.value * factor, sigma, unit)


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """Several identifications side by side; `compare` makes it."""

    runs: tuple[str, ...]
    """Names; the first is the reference."""
    parameters: tuple[ComparedParameter, ...]
    notes: tuple[str, ...]
    share_logs: bool = False
    """Whether each run has a log of the first, so that a difference is no test of the truck."""

    def rows(self) -> list[tuple[str, ...]]:
        """Parameter, run, estimate, difference with sigma in its unit, in per cent and in sigmas, for each parameter
        and run."""
        return [
            (p.name, run, _estimate(p.estimates[k]), p.in_unit(k), p.in_percent(k), p.in_sigmas(k))
            for p in self.parameters
            for k, run in enumerate(self.runs)
        ]

    def largest_difference(self) -> tuple[ComparedParameter, int] | None:
        """The parameter and the number of the run with the most significant difference; None if none has a sigma."""
        return next(iter(self._known()), None)

    def beyond_chance(self) -> list[tuple[ComparedParameter, int]]:
        """The parameters and runs with differences that chance alone would hardly give, the most significant first.

        If nothing differs, one of all differences is larger than the limit with a probability of at most
        `FALSE_ALARM` (Bonferroni).
        """
        known = self._known()
        limit = NormalDist().inv_cdf(1 - FALSE_ALARM / 2 / len(known)) if known else math.inf
        return [(parameter, k) for parameter, k in known if abs(parameter.sigmas(k)) > limit]

    def _known(self) -> list[tuple[ComparedParameter, int]]:
        """The differences that have a sigma, of parameters that both runs identify, the most significant first; derived
        quantities repeat them."""
        known = [
            (p, k)
            for p in self.parameters
            for k in range(len(self.runs))
            if p.in_sigmas(k)
            and not p.derived
            and not any(e and e.verdict is Verdict.NOT_IDENTIFIABLE for e in (p.estimates[0], p.estimates[k]))
        ]
        return sorted(known, key=lambda found: -abs(found[0].sigmas(found[1])))

    def as_dict(self) -> dict[str, Any]:
        """The content for JSON."""
        parameters = [
            {
                "name": p.name,
                "unit": p.unit,
                "derived": p.derived,
                "estimates": [
                    None if e is None else {"value": e.value, "sigma": e.sigma, "verdict": e.verdict.value}
                    for e in p.estimates
                ],
                "differences": [None if d is None else asdict(d) | {"sigmas": d.sigmas} for d in p.differences],
            }
            for p in self.parameters
        ]
        return {"runs": list(self.runs), "parameters": parameters, "notes": list(self.notes)}

    def to_csv(self) -> str:
        """A row for each parameter and run, SI."""
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        head = ("parameter", "run", "value", "sigma", "unit", "verdict")
        writer.writerow([*head, "difference", "difference_sigma", "difference_in_sigmas", "at_least"])
        for p in self.parameters:
            for run, e, d in zip(self.runs, p.estimates, p.differences, strict=True):
                if e is not None:
                    difference = ["", "", "", ""] if d is None else [d.value, d.sigma, d.sigmas, d.at_least]
                    writer.writerow([p.name, _safe(run), e.value, e.sigma, e.unit, e.verdict.value, *difference])
        return text.getvalue()

    def plots(self) -> dict[str, Plot]:
        """Of each parameter by its name: every estimate with its sigma."""
        return {p.name: _plot(p, self.runs) for p in self.parameters}


def compare(runs: Mapping[str, Identification]) -> Comparison:
    """The estimates of several identifications, with the differences from the first; then CoG heights and rollover
    thresholds, which follow from them.

    Args:
        runs: by name; the first is the reference.

    Raises:
        FifthwheelError: not identifications by name.
        SignalError: fewer than two identifications.

    Example:
        >>> import fifthwheel as fw
        >>> truck = fw.vehicle("cheng_cebon_2011")
        >>> settings = fw.OneStage(given={"*": "exact", "tractor.front.cornering_stiffness": "free"}, tyres="linear")
        >>> records = {f"seed {seed}": fw.simulate(truck, count=1, seed=seed) for seed in (0, 1)}
        >>> runs = {name: fw.identify([record], truck, settings) for name, record in records.items()}
        >>> fw.compare(runs).parameters[0].name
        'tractor.front.cornering_stiffness'
    """
    expect("runs", runs, Mapping)
    for name, run in runs.items():
        expect(f"runs, {name}", run, Identification)
    if len(runs) < 2:
        raise SignalError(f"runs: expected at least two identifications, got {len(runs)}; give another one")
    compared, derived = list(runs.values()), [_derived(run) for run in runs.values()]
    return Comparison(
        runs=tuple(runs),
        parameters=(
            *_compared(compared, [run.parameters for run in compared]),
            *_compared(compared, derived, derived=True),
        ),
        notes=tuple(_notes(runs)),
        share_logs=all(_shared_logs(compared[0], run) for run in compared[1:]),
    )


def _derived(run: Identification) -> list[Estimate]:
    """CoG heights and wheelbases, and the rollover threshold where the truck has one."""
    lengths = [e for e in run.derived if e.path.quantity in ("cog_height", "wheelbase")]
    try:
        return [*lengths, rollover_threshold(run)]
    except FifthwheelError:
        return lengths


def _compared(
    runs: Sequence[Identification], found: Sequence[Sequence[Estimate]], *, derived: bool = False
) -> Iterator[ComparedParameter]:
    by_name = [{e.name: e for e in estimates} for estimates in found]
    for name in dict.fromkeys(name for own in by_name for name in own):
        estimates = tuple(own.get(name) for own in by_name)
        first, *others = zip(runs, estimates, strict=True)
        yield ComparedParameter(
            name=name,
            unit=next(e.unit for e in estimates if e is not None),
            estimates=estimates,
            differences=(None, *(_difference(first, other, derived) for other in others)),
            derived=derived,
        )


def _difference(
    a: tuple[Identification, Estimate | None], b: tuple[Identification, Estimate | None], derived: bool
) -> Difference | None:
    """From the estimate of a to that of b; None if one of the runs did not estimate it."""
    (reference, first), (run, e) = a, b
    if first is None or e is None:
        return None
    shared = Verdict.FIXED not in (first.verdict, e.verdict) and bool(_shared_logs(reference, run))
    sigma = _sigma_of_difference((reference, first), (run, e))
    return Difference(value=e.value - first.value, sigma=sigma, at_least=shared or derived)


def _sigma_of_difference(a: tuple[Identification, Estimate], b: tuple[Identification, Estimate]) -> float | None:
    """By the equation of this module; a fixed parameter counts as exact."""
    if any(e.sigma is None and e.verdict is not Verdict.FIXED for _, e in (a, b)):
        return None
    parts = [_parts(run, e) for run, e in (a, b)]
    common = sorted(_common_sources(a[0], b[0]) & parts[0].keys() & parts[1].keys())
    independent = [
        (e.sigma or 0.0) ** 2 - sum(part[source] ** 2 for source in common)
        for (_, e), part in zip((a, b), parts, strict=True)
    ]
    shared = sum((parts[0][source] - parts[1][source]) ** 2 for source in common)
    return math.sqrt(sum(max(variance, 0.0) for variance in independent) + shared)


def _parts(run: Identification, e: Estimate) -> dict[str, float]:
    """The part of sigma that comes from the prior of each uncertain number, SI."""
    budget, remaining = run.variance_budget.get(e.name, {}), run.remaining_uncertainty
    return {s: math.sqrt(fraction) * (e.sigma or 0.0) * remaining.get(s, 1.0) for s, fraction in budget.items()}


def _common_sources(a: Identification, b: Identification) -> set[str]:
    """Uncertain numbers whose prior has the same error in both: of the model, and equal ones of the vehicle files."""
    values = [run.initial_vehicle.parameters() for run in (a, b)]
    sources = [{source for terms in run.variance_budget.values() for source in terms} for run in (a, b)]
    return {source for source in sources[0] & sources[1] if values[0].get(source) == values[1].get(source)}


def _shared_logs(a: Identification, b: Identification) -> list[str]:
    """Names of the logs that both were identified on, or began with."""
    logs = [{(log.name, log.samples, log.span) for log in run.logs} for run in (a, b)]
    known = [{log.digest: log.name for log in run.knowledge.used} if run.knowledge else {} for run in (a, b)]
    return sorted(
        {name for name, _, _ in logs[0] & logs[1]} | {known[0][digest] for digest in known[0].keys() & known[1]}
    )


def _changed_numbers(a: Vehicle, b: Vehicle) -> list[str]:
    """What differs in two vehicle files, as "Trailer, mass 33 t instead of 32 t"; the largest relative change first."""
    before, after = a.parameters(), b.parameters()
    sizes = dict[str, float]()
    for path in before.keys() & after.keys() - (a.assumed.keys() & b.assumed.keys()):
        sigmas = [vehicle.stated.get(path, 0.0) for vehicle in (a, b)]
        change = max(abs(after[path] - before[path]), abs(sigmas[1] - sigmas[0]))
        sizes[path] = change / max(abs(after[path]), abs(before[path]), *sigmas, TINY)
    return [
        f"{spoken(path)} {with_sigma(after[path], b.stated.get(path), unit_of(path))} "
        f"instead of {with_sigma(before[path], a.stated.get(path), unit_of(path))}"
        for path in sorted(sizes, key=lambda path: (-sizes[path], path))
        if sizes[path] > SAME_NUMBER
    ]


def _changed_settings(a: Any, b: Any) -> list[str]:
    """Names of the settings that differ, those of a mapping by its keys; the method, if that is another."""
    if type(a) is not type(b):
        return ["method"]
    before, after = asdict(a), asdict(b)
    names = []
    for name in before | after:
        one, other = before.get(name), after.get(name)
        if isinstance(one, Mapping) and isinstance(other, Mapping):
            names += [str(key) for key in {**one, **other} if one.get(key) != other.get(key)]
        elif one != other:
            names.append(name)
    return names


def _notes(runs: Mapping[str, Identification]) -> list[str]:
    first, *others = runs
    notes = []
    for other in others:
        changed = _changed_numbers(runs[first].initial_vehicle, runs[other].initial_vehicle)
        if changed:
            more = f", and {len(changed) - LISTED_NUMBERS} more" if len(changed) > LISTED_NUMBERS else ""
            some = "; ".join(changed[:LISTED_NUMBERS])
            notes.append(f"The vehicle file of {other} differs from that of {first}: {some}{more}.")
        if shared := _shared_logs(runs[first], runs[other]):
            settings = _changed_settings(runs[first].settings, runs[other].settings)
            causes = ["the vehicle files"] if changed else []
            causes += [f"the settings ({', '.join(settings)})"] if settings else []
            effect = (
                f"It shows the effect of {enumerated(causes)}" if causes else "Vehicle files and settings are equal"
            )
            notes.append(
                f"{first} and {other} share {enumerated(shared)}, so that the noise is the same and the difference is "
                f"no test of the truck. {effect}."
            )
        if not _common_sources(runs[first], runs[other]):
            notes.append(f"{first} and {other} have no uncertain number in common: their sigmas count as independent.")
    for name, run in runs.items():
        informed = {
            e.name: fraction
            for e in run.parameters
            if e.sigma and e.prior and e.verdict is not Verdict.FIXED
            if (fraction := min((e.sigma / e.prior) ** 2, 1.0)) > PRIOR_FRACTION
        }
        if informed:
            listed = [f"{spoken(parameter)} {percent(fraction)}" for parameter, fraction in informed.items()]
            notes.append(
                f"{name}: fraction of the information that comes from the prior: {enumerated(listed)}. A common prior "
                "makes a difference smaller than the logs alone show."
            )
    return notes


def _plot(parameter: ComparedParameter, runs: Sequence[str]) -> Plot:
    unit, items = shown(parameter.unit), list[Item]()
    for k, (run, e) in enumerate(zip(runs, parameter.estimates, strict=True)):
        if e is not None:
            sigma = None if e.sigma is None else [e.sigma * unit.factor]
            texts = (f"{run}: {with_sigma(e.value, e.sigma, e.unit)}, {e.verdict.replace('_', ' ')}",)
            items.append(Points([e.value * unit.factor], [-k], x_sigma=sigma, texts=texts))
    if (first := parameter.estimates[0]) is not None:
        items.append(Guide(x=first.value * unit.factor))
    ticks = {float(-k): run for k, run in enumerate(runs)}
    rows = Axis(ticks=ticks, range=(0.5 - len(runs), 0.5))
    return Plot(panels=[Panel(items=items, title=spoken(parameter.name), x=Axis(unit=unit.name), y=rows)])


def _estimate(estimate: Estimate | None) -> str:
    if estimate is None:
        return "–"
    text = with_sigma(estimate.value, estimate.sigma, estimate.unit)
    return text if estimate.verdict is Verdict.CONVERGED else f"{text}, {estimate.verdict.replace('_', ' ')}"


def _safe(text: str) -> str:
    """A text that no spreadsheet takes as a formula."""
    return f"'{text}" if text[:1] in "=+-@\t\r" else text
