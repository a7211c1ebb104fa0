"""The evaluation of a log by a test method of ISO, and the general conditions of a test that the log shows.

Conditions after ISO 15037-2:2002: the standard gives a frequency range of 0 to 2 Hz and a bandwidth of the measuring
system of at least 5 Hz. The limits of speed, yaw rate and steer angle below are ours. A log does not show track, wind,
load and tyres.
"""

from collections.abc import Callable, Collection, Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from fifthwheel.base.arguments import expect, expect_optional
from fifthwheel.base.errors import SignalError, suggestion
from fifthwheel.base.formatting import approximate
from fifthwheel.data.channels import STEER, is_of
from fifthwheel.data.checks import Fault, raise_errors
from fifthwheel.data.record import Record
from fifthwheel.estimate.time_bases import check_signals
from fifthwheel.results.evaluate import frequency_response, manoeuvres, steady_state
from fifthwheel.results.evaluate.evaluation import Condition, Evaluation, MethodResult
from fifthwheel.results.evaluate.motion import MeasuredMotion, motion
from fifthwheel.results.evaluate.repetitions import ENTRY, smoothed
from fifthwheel.truck import Vehicle

SAMPLING = 20.0
"""Sampling rate, Hz: four times the bandwidth of 5 Hz."""
SPEED = 2 / 3.6
"""Largest deviation of the speed from its mean, m/s."""
STRAIGHT = float(np.radians(0.5))
"""Largest mean and standard deviation of the yaw rate before the first steering, rad/s; and mean steer angle, rad."""


def conditions(motion: MeasuredMotion, findings: MethodResult) -> tuple[Condition, ...]:
    """The conditions, met or not."""
    deviation = float(np.abs(motion.speed - motion.speed.mean()).max())
    constant = findings.has_constant_speed
    needed, found = f"at least {SAMPLING:g} Hz", f"{motion.rate:.3g} Hz"
    result = [Condition("sampling rate", needed, found, motion.rate >= 0.99 * SAMPLING)]
    needed = f"within {3.6 * SPEED:g} km/h of its mean" if constant else "not in this test"
    found = f"{3.6 * motion.speed.mean():.1f} km/h, within {3.6 * deviation:.1f} km/h"
    result.append(Condition("steady speed", needed, found, deviation <= SPEED if constant else None))
    for values in list(motion.outputs("yaw_rate").values())[:1]:
        largest = float(np.abs(motion.speed * smoothed(values, motion.rate)).max())
        found = f"up to {approximate(largest, 'm/s^2')}, speed × yaw rate of the first unit"
        result.append(Condition("lateral acceleration", "to be reported", found, None))
    return (*result, *_entry(motion, findings.start))


def _entry(motion: MeasuredMotion, start: float | None) -> list[Condition]:
    """Straight entry and offsets before the first steering."""
    rates = motion.outputs("yaw_rate")
    needed = f"{ENTRY:g} s, yaw rate of {approximate(STRAIGHT, 'rad/s')} at most"
    offset = f"steer angle and yaw rate of {approximate(STRAIGHT, 'rad')} and {approximate(STRAIGHT, 'rad/s')} at most"
    if start is None or not rates:
        return [Condition("straight entry", "not in this test", "–", None)]
    before = (motion.time >= start - ENTRY) & (motion.time < start)
    duration = start - motion.time[0]
    if before.sum() < 3:
        return [Condition("straight entry", needed, "no samples before the steering", False)]
    rate = smoothed(next(iter(rates.values())), motion.rate)[before]
    mean, spread, steer = float(rate.mean()), float(rate.std()), round(float(motion.steer[before].mean()), 6)
    found = f"{min(duration, ENTRY):.1f} s, {approximate(spread, 'rad/s')} rms about its mean"
    offsets = f"{approximate(steer, 'rad')} and {approximate(mean, 'rad/s')}"
    return [
        Condition("straight entry", needed, found, bool(duration >= 0.95 * ENTRY) and spread <= STRAIGHT),
        Condition("offsets before the test", offset, offsets, max(abs(mean), abs(steer)) <= STRAIGHT),
    ]


class Method(NamedTuple):
    """A test method."""

    title: str
    standard: str
    shortest: float
    """Least duration of a log, s; in 30 s a frequency response is no parabola within the 12 nearest frequencies."""
    evaluate: Callable[[MeasuredMotion], MethodResult]


METHODS: Mapping[str, Method] = {
    "steady_state": Method("Steady-state circular test", "ISO 14792:2011", 15.0, steady_state.evaluate),
    "frequency_response": Method(
        "Frequency response", "ISO 14793:2011 and ISO 14791:2000", 50.0, frequency_response.evaluate
    ),
    "step": Method("Step input", "ISO 14793:2011", 5.0, manoeuvres.step),
    "lane_change": Method("Single lane change", "ISO 14791:2000", 5.0, manoeuvres.lane_change),
    "pulse": Method("Pulse input", "ISO 14791:2000", 5.0, manoeuvres.pulse),
    "sine_with_dwell": Method("Sine with dwell", "ISO 18375:2016", 6.0, manoeuvres.sine_with_dwell),
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
