"""Validation of a model: the results of a simulation against the log of the same test.

Both records are evaluated by one test method. A difference d of a measure, or at a point of a curve, with the sigma s
of both records and the tolerance T is

    inside if |d| + 2 s <= T,    outside if |d| - 2 s > T,    else undecided.

A curve is inside if `ENOUGH` of its points are, and outside if more than the rest are outside, with `MARGIN` in place
of 2, since it has many points.
"""

from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from fifthwheel.base import pages
from fifthwheel.base.arguments import expect, expect_optional
from fifthwheel.base.errors import SignalError
from fifthwheel.base.formatting import approximate, enumerated, percent, with_sigma
from fifthwheel.base.pages.html import Displayed
from fifthwheel.base.plots import Plot
from fifthwheel.base.types import Array
from fifthwheel.data.channels import ARTICULATION, LATERAL_ACCELERATION, ROLL, YAW_RATE, SignalName, is_of, names_of
from fifthwheel.data.checks import Fault
from fifthwheel.data.checks.kinematics import at_common_time, common_time, correlation
from fifthwheel.data.record import Record
from fifthwheel.results.evaluate.curves import ComparedCurve, Judgement, compared_curves, curve_names, judged
from fifthwheel.results.evaluate.evaluate import SPEED, method_of, with_references, without_sigma
from fifthwheel.results.evaluate.evaluation import Evaluation
from fifthwheel.results.evaluate.tolerances import Tolerance, require_used, tolerance_of
from fifthwheel.truck import Vehicle

WRONG = (Fault.DEGREES, Fault.UNIT, Fault.STEERING_WHEEL, Fault.OUT_OF_RANGE, Fault.SWAPPED_SIGN)
"""Faults of a signal that are refused: they are of the signal map, not of the model."""

CORRELATED, STEP, DELAYS = 0.5, 0.05, range(-20, 21, 2)
"""For the sign of an angle to be clear: its least correlation with the yaw rate, at the delay, in steps of so many s,
at which that of the log is largest."""


@dataclass(frozen=True, kw_only=True)
class ComparedMeasure:
    """A measure of the results beside that of the log, SI."""

    name: str
    title: str
    unit: str
    log: float
    results: float
    sigma: float | None
    """Of the difference, by both records, on which the verdict depends: of a reference signal by the scatter alone,
    which no table shows; None where one of them has none."""
    tolerance: Tolerance

    @property
    def limit(self) -> float:
        """Largest magnitude of a difference inside of the tolerance."""
        return self.tolerance.relative * abs(self.log) + self.tolerance.absolute

    @property
    def verdict(self) -> Judgement:
        """Whether the difference is within the tolerance, with two sigma."""
        difference, margin = abs(self.results - self.log), np.inf if self.sigma is None else 2 * self.sigma
        return judged(difference + margin <= self.limit, difference - margin > self.limit)


@dataclass(frozen=True, kw_only=True)
class Validation(Displayed):
    """A simulation's results compared with the log of the same test.

    Example:
        >>> import fifthwheel as fw
        >>> truck = fw.vehicle("cheng_cebon_2011")
        >>> log = fw.simulate(truck, manoeuvre="lane_changes", count=2, seed=1)
        >>> validation = fw.validate(log, log, "lane_change", vehicle=truck)
        >>> [(measure.verdict, measure.results - measure.log) for measure in validation.measures]
        [('inside', 0.0)]
        >>> [curve.name for curve in validation.curves]
        ['steer.tractor.front', 'yaw_rate.tractor', 'yaw_rate.semitrailer']
    """

    results: Evaluation
    log: Evaluation
    measures: tuple[ComparedMeasure, ...]
    curves: tuple[ComparedCurve, ...]
    notes: tuple[str, ...] = ()

    @property
    def verdict(self) -> Judgement:
        """Inside if every measure and every curve is, outside if one is outside."""
        verdicts = {m.verdict for m in self.measures} | {c.verdict for c in self.curves}
        return judged(verdicts == {"inside"}, "outside" in verdicts)

    def as_dict(self) -> dict[str, Any]:
        """The content of validation.json, SI: also both evaluations."""
        curves = [
            {n: v.tolist() if isinstance(v, np.ndarray) else v for n, v in asdict(c).items() if n != "sigma"}
            | {"title": c.title, "inside": c.inside, "exceedance": c.exceedance, "verdict": c.verdict}
            for c in self.curves
        ]
        return {
            "verdict": self.verdict,
            "measures": [asdict(m) | {"limit": m.limit, "verdict": m.verdict} for m in self.measures],
            "curves": curves,
            "notes": list(self.notes),
            "results": self.results.as_dict(),
            "log": self.log.as_dict(),
        }

    def plots(self) -> dict[str, Plot]:
        """Each curve with its band, by its title."""
        return {curve.title: curve.plot() for curve in self.curves}

    def table(self) -> pages.Table:
        """The measures."""
        heads = ("Measure|name", "Log>", "Results>", "Difference ± sigma>", "Tolerance", "Verdict")
        rows = [
            (
                m.title,
                with_sigma(m.log, self.log[m.name].sigma, m.unit),
                with_sigma(m.results, self.results[m.name].sigma, m.unit),
                with_sigma(m.results - m.log, m.sigma if self._has_sigma(m.name) else None, m.unit),
                _band(m.limit, m.unit, m.tolerance),
                mark(m.verdict),
            )
            for m in self.measures
        ]
        return pages.Table(heads, rows, label="Measures")

    def _has_sigma(self, name: str) -> bool:
        """Whether a measure is of sensors in both records."""
        return None not in (self.log[name].sigma, self.results[name].sigma)

    def curve_table(self) -> pages.Table:
        """The curves."""
        heads = ("Curve|name", "Inside>", "Largest exceedance>", "Tolerance", "Covered>", "Verdict")
        rows = [
            (
                c.title,
                percent(c.inside, round_down=True),
                approximate(c.exceedance, c.unit),
                _band(float(c.limit.max(initial=0.0)), c.unit, c.tolerance),
                percent(c.covered, round_down=True),
                mark(c.verdict),
            )
            for c in self.curves
        ]
        return pages.Table(heads, rows, label="Curves")

    def __repr__(self) -> str:
        return f"Validation({self.log.test}, {self.results.log} against {self.log.log}: {self.verdict})"

    def _document(self) -> pages.Document:
        blocks: list[pages.Block] = [self.table(), self.curve_table(), pages.Items(self.notes)]
        return pages.Document(f"{self.log.title}, {self.results.log} against {self.log.log}: {self.verdict}", blocks)


def _band(limit: float, unit: str, tolerance: Tolerance) -> str:
    """Half of the width of a band and what was stated, which a narrow column breaks between the numbers."""
    stated = tolerance.text.replace(" ", "\u00a0").replace("+\u00a0", "+ ")
    return f"±\u00a0{approximate(limit, unit)} ({stated})"


def mark(verdict: Judgement) -> pages.Mark:
    """A judgement with its colour."""
    return pages.Mark(verdict, {"inside": "converged", "outside": "not_converged", "undecided": "doubtful"}[verdict])


def validate(
    results: Record,
    log: Record,
    test: str,
    *,
    tolerances: Mapping[str, str] | None = None,
    vehicle: Vehicle | None = None,
) -> Validation:
    """Compare a simulation's results with the log of the same test: measures and curves, each with a verdict.

    docs/evaluate.md defines the comparison. The vehicle is that of both records, so its uncertainty is not in sigma.

    Args:
        results: of the simulation, with the signals that the test method needs.
        log: the measured one.
        test: one of `METHODS`.
        tolerances: by measure or curve, or the beginning of its name, such as {"understeer_gradient": "5 %",
            "yaw_rate.tractor": "5 % + 0.2 deg/s"}. Default: `results.evaluate.tolerances.DEFAULTS`, which are ours.
        vehicle: as of `evaluate`.

    Raises:
        SignalError: a record is not one of this test, a signal has another unit or sign, nothing can be compared, or a
            tolerance belongs to nothing or has a wrong unit.
        VehicleError: `vehicle` is not one.

    Example:
        >>> import fifthwheel as fw
        >>> truck = fw.vehicle("cheng_cebon_2011")
        >>> log, results = (fw.simulate(truck, manoeuvre="lane_changes", count=2, seed=seed) for seed in (1, 2))
        >>> fw.validate(results, log, "lane_change", vehicle=truck)
        Validation(lane_change, simulated against simulated: inside)
    """
    expect_optional("tolerances", tolerances, Mapping)
    expect_optional("vehicle", vehicle, Vehicle)
    method_of(test)
    stated = dict(tolerances or {})
    if vehicle is not None:
        vehicle = vehicle.with_stated(dict.fromkeys(vehicle.parameters(), 0.0))
    expect("results", results, Record)
    expect("log", log, Record)
    results, log = _without_lone_roll(results, log), _without_lone_roll(log, results)
    evaluated = [_evaluated(*pair, test, vehicle) for pair in (("results", results), ("log", log))]
    of_results, of_log = (evaluation for evaluation, _ in evaluated)
    _require_signs(results, log)
    measures = tuple(_measures(of_results, of_log, stated))
    curves = tuple(compared_curves(of_results, of_log, stated))
    names = [*(m.name for m in measures), *(c.name for c in curves)]
    require_used(stated, names)
    if not measures:
        raise SignalError(
            f"results: no measure of {of_log.title} in common with the log, which has "
            f"{enumerated([m.name for m in of_log])}; map the same signals in both records"
        )
    notes = [*_of_inputs(results, log, curves), *_of_evaluations(of_results, of_log, names)]
    of_results, of_log = (without_sigma(*pair) for pair in evaluated)
    return Validation(results=of_results, log=of_log, measures=measures, curves=curves, notes=tuple(notes))


def _without_lone_roll(record: Record, other: Record) -> Record:
    """Without the roll angles that the other record lacks: g times them stays in the lateral accelerations of both."""
    own, others = ({**each.signals, **each.reference} for each in (record, other))
    units = [SignalName.of(name).unit for name in own if is_of(name, LATERAL_ACCELERATION) and name in others]
    lone = {f"{ROLL.quantity}.{unit}" for unit in units} - others.keys()

    def rest(signals: Mapping[str, Array]) -> dict[str, Array]:
        return {name: values for name, values in signals.items() if name not in lone}

    return replace(record, signals=rest(record.signals), reference=rest(record.reference)) if lone else record


def _evaluated(role: str, record: Record, test: str, vehicle: Vehicle | None) -> tuple[Evaluation, frozenset[str]]:
    """The evaluation of a record, without faults of its signal map, and its reference signals."""
    try:
        return with_references(record, test, vehicle, refused=WRONG)
    except SignalError as error:
        raise SignalError(f"{role}, {error}") from None


def _require_signs(results: Record, log: Record) -> None:
    """Refuse roll and articulation angles that follow the yaw rate with another sign in the results than in the log."""
    found, inverted = [_with_yaw_rate(record) for record in (results, log)], []
    for name in found[0].keys() & found[1].keys():
        of_results, of_log = (correlations[name] for correlations in found)
        k = int(np.abs(of_log).argmax())
        if of_results[k] * np.sign(of_log[k]) < -CORRELATED < CORRELATED < abs(of_log[k]):
            inverted.append(name)
    if inverted:
        raise SignalError(
            f"{enumerated(sorted(inverted))} of the results: opposite sign of the log; in a left turn roll is positive "
            "and articulation negative; invert the wrong one: sign = -1 in its signals.toml (no sign if it has one), "
            "or in the FMU"
        )


def _with_yaw_rate(record: Record) -> dict[str, Array]:
    """Correlation of each angle with the first yaw rate of `DELAYS` steps before, (n,)."""
    record = replace(record, signals={**record.reference, **record.signals})
    rates = names_of(YAW_RATE, record.signals)
    if not rates:
        return {}
    time = common_time(record, STEP)
    rate, has_rate = at_common_time(record, rates[0], time)
    found = {}
    for name in names_of(ROLL, record.signals) + names_of(ARTICULATION, record.signals):
        angle, has_angle = at_common_time(record, name, time)
        found[name] = np.array([correlation(rate, angle, has_rate & has_angle, shift) for shift in DELAYS])
    return found


def _measures(results: Evaluation, log: Evaluation, stated: Mapping[str, str]) -> Iterator[ComparedMeasure]:
    found = {measure.name: measure for measure in results}
    for measure in log:
        if (other := found.get(measure.name)) is not None:
            known = measure.sigma is not None and other.sigma is not None
            yield ComparedMeasure(
                name=measure.name,
                title=measure.title,
                unit=measure.unit,
                log=measure.value,
                results=other.value,
                sigma=float(np.hypot(measure.sigma or 0.0, other.sigma or 0.0)) if known else None,
                tolerance=tolerance_of(measure.name, measure.unit, stated),
            )


def _of_inputs(results: Record, log: Record, curves: tuple[ComparedCurve, ...]) -> Iterator[str]:
    speeds = [float(np.nanmean(record.signals["speed"])) for record in (results, log)]
    if abs(speeds[0] - speeds[1]) > SPEED:
        yield f"Mean speeds differ: results {3.6 * speeds[0]:.1f} km/h, log {3.6 * speeds[1]:.1f} km/h."
    if not all(curve.same_input for curve in curves):
        yield "The steer angles differ, so other histories are undecided; simulate with the steer angle of the log."


def _of_evaluations(results: Evaluation, log: Evaluation, compared: list[str]) -> Iterator[str]:
    """What was not compared or is of another frequency, and what the evaluations note."""
    for role, evaluation in (("results", results), ("log", log)):
        names = [*(measure.name for measure in evaluation), *curve_names(evaluation)]
        if missing := [name for name in names if name not in compared]:
            yield f"Not compared, only in the {role}: {enumerated(missing)}."
        if missed := [c.name for c in evaluation.conditions if c.met is False]:
            yield f"Conditions not met, {role}: {enumerated(missed)}."
        yield from (f"{role.capitalize()}: {note}" for note in evaluation.notes)
    titles = {measure.name: measure.title for measure in log}
    yield from (
        f"{titles[m.name].capitalize()}: in the results it is the {m.title}."
        for m in results
        if m.name in titles and m.title != titles[m.name]
    )
