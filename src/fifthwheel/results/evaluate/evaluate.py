"""The evaluation of a log by a test method of ISO."""

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, replace
from types import ModuleType

import numpy as np

from fifthwheel.base.arguments import expect, expect_optional
from fifthwheel.base.errors import SignalError, suggestion
from fifthwheel.data.channels import STEER, is_of
from fifthwheel.data.checks import Fault, raise_errors
from fifthwheel.data.record import Record
from fifthwheel.estimate.time_bases import check_signals
from fifthwheel.results.evaluate import (
    frequency_response,
    lane_change,
    pulse,
    sine_with_dwell,
    steady_state,
    step_input,
)
from fifthwheel.results.evaluate.conditions import conditions
from fifthwheel.results.evaluate.evaluation import Evaluation, MethodResult
from fifthwheel.results.evaluate.motion import MeasuredMotion, motion
from fifthwheel.truck import Vehicle


@dataclass(frozen=True, kw_only=True)
class Method:
    """A test method."""

    title: str
    standard: str
    shortest: float
    """Least duration of a log, s."""
    evaluate: Callable[[MeasuredMotion], MethodResult]


def _method(title: str, standard: str, module: ModuleType) -> Method:
    return Method(title=title, standard=standard, shortest=module.SHORTEST, evaluate=module.evaluate)


METHODS: Mapping[str, Method] = {
    "steady_state": _method("Steady-state circular test", "ISO 14792:2011", steady_state),
    "frequency_response": _method("Frequency response", "ISO 14793:2011 and ISO 14791:2000", frequency_response),
    "step": _method("Step input", "ISO 14793:2011", step_input),
    "lane_change": _method("Single lane change", "ISO 14791:2000", lane_change),
    "pulse": _method("Pulse input", "ISO 14791:2000", pulse),
    "sine_with_dwell": _method("Sine with dwell", "ISO 18375:2016", sine_with_dwell),
}
"""Test methods by name."""


def method_of(test: str) -> Method:
    """The test method of a name; a SignalError if there is none."""
    if test not in METHODS:
        raise SignalError(f"test: {test!r} is not known; {suggestion(str(test), METHODS)}")
    return METHODS[test]


def evaluate(record: Record, test: str, *, vehicle: Vehicle | None = None, check: bool = True) -> Evaluation:
    """Evaluate the log of a test by a method of ISO: measures with sigma, test conditions, arrays of the diagrams.

    docs/evaluate.md defines the measures.

    Args:
        record: one run with speed and the steer angle of the first steered axle, and the outputs that the method needs.
        test: one of `METHODS`.
        vehicle: names the units in their order; "steady_state" takes the wheelbase from it.
        check: refuse implausible signals, the errors of `check_signals`.

    Raises:
        SignalError: the test is unknown, a signal is missing or implausible, the log is too short, sampled too slowly,
            or does not contain the manoeuvre.
        VehicleError: `vehicle` is not one, or has no steered axle.

    Example:
        >>> import fifthwheel as fw
        >>> truck = fw.vehicle("cheng_cebon_2011")
        >>> log = fw.simulate(truck, manoeuvre="slowly_increasing_steer", seed=1)
        >>> gradient = fw.evaluate(log, "steady_state", vehicle=truck)["understeer_gradient"]
        >>> abs(gradient.value - fw.summarize(truck).understeer_gradient) < 3 * gradient.sigma
        True
    """
    expect("record", record, Record)
    expect_optional("vehicle", vehicle, Vehicle)
    return without_sigma(*with_references(record, test, vehicle, refused=tuple(Fault) if check else ()))


def with_references(
    record: Record, test: str, vehicle: Vehicle | None, *, refused: Collection[Fault]
) -> tuple[Evaluation, frozenset[str]]:
    """The evaluation with a sigma by the scatter of reference signals too, and their names; arguments as `evaluate`,
    and the faults whose errors are refused."""
    method = method_of(test)
    driven = motion(record, vehicle, shortest=method.shortest)
    findings = check_signals(record, vehicle)
    # a step, and a pulse by a machine, have a constant steer angle
    suspicions = [f for f in findings if not (f.fault is Fault.STUCK and is_of(f.signal, STEER))]
    raise_errors(suspicion for suspicion in suspicions if suspicion.fault in refused)
    found = method.evaluate(driven)
    notes = (*found.notes, *driven.notes, *(suspicion.message for suspicion in suspicions))
    evaluation = Evaluation(
        **vars(replace(found, notes=notes)),
        log=record.name,
        test=test,
        title=method.title,
        standard=method.standard,
        conditions=conditions(driven, found),
    )
    return evaluation, frozenset(driven.references)


def without_sigma(found: Evaluation, references: frozenset[str]) -> Evaluation:
    """The evaluation without a sigma of reference signals, whose noise is not that of a sensor."""
    unknown = {f"gain_sigma.{name}" for name in references}
    reason = "no sigma: from a reference signal"
    return replace(
        found,
        measures=tuple(
            replace(m, sigma=None, reason=reason) if references & set(m.signals) else m for m in found.measures
        ),
        arrays={n: np.full_like(v, np.nan) if n in unknown else v for n, v in found.arrays.items()},
    )
