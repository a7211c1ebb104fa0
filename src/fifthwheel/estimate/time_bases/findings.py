"""All findings on a record: those of `checks`, and time offsets, clocks and exchanged gyros by the model."""

from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations

import numpy as np

from fifthwheel.base.arguments import expect, expect_optional
from fifthwheel.base.types import Array
from fifthwheel.data.channels import WHEEL_SPEED, YAW_RATE, channel_of, is_input, is_of, names_of
from fifthwheel.data.checks import Fault, Finding, check
from fifthwheel.data.checks.findings import error, remedy_text, warning
from fifthwheel.data.checks.samples import without_spikes
from fifthwheel.data.record import Record
from fifthwheel.estimate.time_bases.lags import RATE, LagCurve, lag_curve
from fifthwheel.estimate.time_bases.offsets import TimeOffset, common_offsets, offsets_of
from fifthwheel.estimate.time_bases.predictions import Prediction, predict_channels
from fifthwheel.estimate.time_bases.rates import ClockRate, channel_rates, common_rates
from fifthwheel.truck import Vehicle

_BY_TIME = (Fault.SWAPPED_SIGN, Fault.WRONG_COLUMN, Fault.EXCHANGED)
"""Faults that a time offset or an exchange of channels can be taken for."""
_WELL_EXPLAINED = 0.8
"""Fraction of the variance from which a channel with a corrected offset is neither wrong nor inverted."""

_COMMON_LAG = 0.12
"""s; lag of all channels behind a steer angle that is not quite on time."""


def check_signals(record: Record, vehicle: Vehicle | None = None) -> tuple[Finding, ...]:
    """Every fault of a record, errors first; with the vehicle also signals that it does not have.

    Time offsets, clock rates and exchanged gyros are looked for if no other error explains the signals. What they
    explain is not reported as a wrong column or sign.

    Example:
        >>> import fifthwheel as fw
        >>> truck = fw.vehicle("cheng_cebon_2011")
        >>> record = fw.simulate(truck, count=1)
        >>> inverted = record.with_signals({"yaw_rate.tractor": -record.signals["yaw_rate.tractor"]})
        >>> [finding.signal for finding in fw.check_signals(inverted, truck)]
        ['yaw_rate.tractor']
    """
    expect("record", record, Record)
    expect_optional("vehicle", vehicle, Vehicle)
    if vehicle is None:
        findings = check(record)
    else:
        units = [unit.name for unit in vehicle.units]
        findings = check(record, wheelbase=vehicle.wheelbase, units=units, steered=vehicle.steer_signals())
    if any(finding.severity == "error" and finding.fault not in _BY_TIME for finding in findings):
        return findings
    record = without_spikes(record)
    prediction = predict_channels(record, vehicle)
    if prediction is None:
        return findings
    offsets = offsets_of(record, prediction)
    found = list(time_base_findings(record, prediction, offsets))
    explained = {name for finding in found for name in (finding.signal, *finding.others)}
    if prediction.leading in explained:  # with which wheel speeds are compared
        explained.update(names_of(WHEEL_SPEED, record.signals))
    well = {o.name for o in offsets if o.explained > _WELL_EXPLAINED}
    if found and well:  # then speed and steer angle are right too, and so is the reference of the offsets
        explained |= well | {name for name in record.signals if is_input(name)} | {prediction.leading}
    kept = [finding for finding in findings if not (finding.fault in _BY_TIME and finding.signal in explained)]
    return tuple(sorted([*kept, *found], key=lambda finding: finding.severity))


def time_base_findings(record: Record, prediction: Prediction, offsets: Sequence[TimeOffset]) -> Iterator[Finding]:
    """Findings by a prediction of the channels: exchanged gyros, else clock rates and time offsets."""
    exchanged = list(exchanged_pairs(prediction))
    for front, rear in exchanged:
        finding = error if is_of(rear, YAW_RATE) else warning
        problem = f"follows the motion expected of {front}, and {front} that of {rear}"
        cure = "exchange the columns of both in signals.toml"
        yield finding(rear, Fault.EXCHANGED, f"{problem}; {cure}", others=(front,))
    if exchanged:
        return
    rates = list(channel_rates(prediction))
    drifting = {name for rate in rates for name in rate.signals}
    if rates:
        yield _drift_finding(rates)
    for rate in common_rates(prediction):
        if not drifting:
            yield _common_rate_finding(rate)
    for offset in common_offsets([o for o in offsets if not drifting & set(o.signals)]):
        yield _offset_finding(offset, record.time_bases)


def exchanged_pairs(prediction: Prediction) -> Iterator[tuple[str, str]]:
    """Pairs of yaw rates or roll rates that are better explained by the prediction of the other one.

    Exchanged channels have one common lag of up to 0.12 s. They must be explained better than by a free lag of each
    channel, so that a time offset is not taken for an exchange.
    """
    for first, second in combinations(range(len(prediction.names)), 2):
        channel = channel_of(prediction.names[first])
        exchange = channel.exchange if channel else None
        if exchange is None or channel_of(prediction.names[second]) is not channel:
            continue
        straight, crossed = np.inf, np.inf
        for predicted, curves in zip(prediction.predicted, prediction.curves, strict=True):
            own = [curves[first], curves[second]]
            other = [
                lag_curve(prediction.measured[:, measured], predicted[:, by])
                for measured, by in ((first, second), (second, first))
            ]
            if all(curve is not None for curve in (*own, *other)):
                straight = min(straight, sum(float(_residual(curve).min()) for curve in own if curve))
                both = np.array([_residual(curve) for curve in other if curve])
                middle, steps = both.shape[1] // 2, round(_COMMON_LAG * RATE)
                both = both[:, middle - steps : middle + steps + 1]
                both[:, both.max(axis=0) > np.log(1 - exchange.least_explained)] = np.inf
                crossed = min(crossed, float(both.sum(axis=0).min()))
        if crossed < straight - exchange.margin:
            yield prediction.names[first], prediction.names[second]


def _residual(curve: LagCurve) -> Array:
    """Logarithm of the unexplained fraction of the variance (k,) by lag."""
    return np.asarray(np.log(np.maximum(1 - curve.explained, 1e-4)))


def _offset_finding(offset: TimeOffset, time_bases: Mapping[str, str]) -> Finding:
    """One finding on all signals with a common offset."""
    signal, *others = offset.signals
    delay = round(offset.offset, 2)
    base = f" ({time_bases[signal]})" if len({time_bases.get(name) for name in offset.signals} - {None}) == 1 else ""
    late = f"{abs(delay):.2f} s {'late' if delay > 0 else 'early'}{base}, with a sigma of {offset.sigma:.2f} s"
    cure = remedy_text({"delay": delay})
    if others:
        late, cure = f"{late}, like {', '.join(others)}", f"{cure} for each of them"
    problem = f"{late}; {cure}, more if it has a delay already"
    return warning(signal, Fault.TIME_OFFSET, problem, remedy={"delay": delay}, others=tuple(others))


def _drift_finding(rates: Sequence[ClockRate]) -> Finding:
    """One finding on all channels whose clock drifts."""
    signal, *others = (name for rate in rates for name in rate.signals)
    mean = sum(rate.rate for rate in rates) / len(rates)
    like = f", like that of {', '.join(others)}" if others else ""
    problem = f"its clock runs {abs(mean):.1%} {'fast' if mean > 0 else 'slow'} against that of the steer angle{like}"
    cure = "correct the timestamps of this logger, no delay in signals.toml can"
    return warning(signal, Fault.CLOCK_RATE, f"{problem}; {cure}", others=tuple(others))


def _common_rate_finding(rate: ClockRate) -> Finding:
    change = f"{abs(rate.rate):.1%} {'more' if rate.rate > 0 else 'less'}"
    problem = f"{change} than yaw rates and articulation angle agree with, with a sigma of {rate.sigma:.1%}"
    cure = "correct the unit or the rate of the time, or the gain of a yaw rate, in signals.toml"
    return warning("time", Fault.CLOCK_RATE, f"{problem}; {cure}")
