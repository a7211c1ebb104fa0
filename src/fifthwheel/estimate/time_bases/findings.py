"""All findings on a record: those of `checks`, and time offsets, clocks and exchanged gyros by the model.

Rates of clocks show as a channel whose offset grows over the log, or as a time base that contradicts the kinematics.
With a clock that runs fast by rho, a timestamp is t' = t + offset + rho (t - t0). The lag of the channel behind its
prediction grows with slope rho. If all channels share the clock, only a relation that contains time shows it: the
articulation changes by the integral of the difference of the yaw rates,

    articulation(t') - articulation(t' - T) = g times the integral of (r2 - r1) over T,    g = 1 / (1 + rho).
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, pairwise

import numpy as np

from fifthwheel.base.arguments import expect, expect_optional
from fifthwheel.base.types import Array
from fifthwheel.data.channels import WHEEL_SPEED, YAW_RATE, SignalName, channel_of, is_input, is_of, names_of
from fifthwheel.data.checks import Fault, Finding, check
from fifthwheel.data.checks.findings import error, remedy_text, uncertain_delay, warning
from fifthwheel.data.checks.samples import without_spikes
from fifthwheel.data.record import Record
from fifthwheel.estimate.time_bases.offsets import TimeOffset, common_offsets, offsets_of
from fifthwheel.estimate.time_bases.predictions import MAX_LAG, RATE, LagCurve, Prediction, lag_curve, predict_channels
from fifthwheel.truck import Vehicle

MIN_RATE = 0.005
"""Smaller deviations of a channel's clock are not reported; good clocks deviate by less than 1e-4."""
MIN_COMMON_RATE = 0.03
"""Smaller deviations of the articulation rate are not reported; gains of sensors are wrong by 1 to 2 %."""
_MAX_RATE = 0.08
_RATE_STEP = 0.002
"""Largest rate that is searched, and the step of the search."""
_WINDOW = 4.0
"""s; within it the drift of a clock is neglected."""
_MAX_DURATION = 120.0
"""s from the first usable sample that are used."""
_MIN_DURATION = 30.0
"""s; a shorter log shows no drift."""
_ROUNDING = 1e-12
"""Product of the relative variances of two signals, below which one of them is constant."""
_GAIN = 0.5
"""A drift must reduce the residual variance of a constant offset to this fraction."""
_MIN_EXPLAINED = 0.5
"""Least fraction of the variance that is explained with the drift."""
_MAX_SIGMA = 0.015
"""Of the rate of a common clock; beyond it the articulation changes too little."""
_INTERVAL = 2.0
"""s, T above."""
_MIN_RELATION = 0.9
"""Least fraction of the change of articulation that the yaw rates explain."""
_BY_TIME = (Fault.SWAPPED_SIGN, Fault.WRONG_COLUMN, Fault.EXCHANGED)
"""Faults that a time offset or an exchange of channels can be taken for."""
_WELL_EXPLAINED = 0.8
"""Fraction of the variance from which a channel with a corrected offset is neither wrong nor inverted."""
_COMMON_LAG = 0.12
"""s; lag of all channels behind a steer angle that is not quite on time."""


@dataclass(frozen=True, kw_only=True)
class ClockRate:
    """A deviation of the rate of a clock."""

    signals: tuple[str, ...]
    """The channels with this clock; empty if all channels share it."""
    rate: float
    """Relative; 0.05 for timestamps that count 1.05 s in a second."""
    sigma: float


def channel_rates(prediction: Prediction) -> Iterator[ClockRate]:
    """Channels whose clock does not have the rate of the steer angle's clock."""
    usable = np.flatnonzero(np.isfinite(prediction.predicted[0, :, 0]))
    if usable.size < _MIN_DURATION * RATE:
        return
    rows = slice(int(usable[0]), int(usable[0]) + round(_MAX_DURATION * RATE))
    explained = [sum(0.0 if c is None else float(c.explained.max()) for c in row) for row in prediction.curves]
    predicted = prediction.predicted[int(np.argmax(explained)), rows]  # of the variant that explains all channels best
    for name, measured, response in zip(prediction.names, prediction.measured[rows].T, predicted.T, strict=True):
        channel = channel_of(name)
        drift = _drift(measured, response) if channel and channel.shows_clock else None
        if drift is not None:
            rate, sigma = drift[0] / (1 - drift[0]), drift[1]
            if abs(rate) > max(MIN_RATE, 3 * sigma):
                yield ClockRate(signals=(name,), rate=rate, sigma=sigma)


def _drift(measured: Array, predicted: Array) -> tuple[float, float] | None:
    """Seconds of lag in a second of the log, and their sigma, by the best straight line through the lags of windows of
    4 s; None where a line explains the channel too little, or hardly better than a constant offset."""
    if np.isfinite(measured + predicted).sum() < _MIN_DURATION * RATE / 2:
        return None
    window = round(_WINDOW * RATE)
    count = measured.size // window
    reach = round((MAX_LAG + _MAX_RATE * measured.size / RATE / 2) * RATE)
    padded = np.pad(predicted[: count * window], reach, constant_values=np.nan)
    measured = measured[: count * window] - np.nanmean(measured)
    padded = padded - np.nanmean(padded)
    lags = np.arange(-reach, reach + 1)
    sums = np.empty((lags.size, 6, count))  # n, m, p, mm, pp, mp of every window at every lag
    for row, lag in zip(sums, lags, strict=True):
        p = padded[reach - lag : reach - lag + measured.size]
        both = np.isfinite(measured) & np.isfinite(p)
        m, p = np.where(both, measured, 0.0), np.where(both, p, 0.0)
        row[:] = [x.reshape(count, window).sum(axis=1) for x in (both, m, p, m * m, p * p, m * p)]
    centre = (np.arange(count) - (count - 1) / 2) * window
    offsets = np.arange(-round(MAX_LAG * RATE), round(MAX_LAG * RATE) + 1, 2)
    every = np.arange(-round(_MAX_RATE / _RATE_STEP), round(_MAX_RATE / _RATE_STEP) + 1) * _RATE_STEP
    residual = np.ones((every.size, offsets.size))
    for row, rate in zip(residual, every, strict=True):
        at = reach + offsets[:, None] + np.rint(rate * centre).astype(int)  # (offsets, windows)
        n, m, p, mm, pp, mp = (sums[at, k, np.arange(count)].sum(axis=1) for k in range(6))
        enough = n > 0.6 * np.isfinite(measured).sum()
        with np.errstate(divide="ignore", invalid="ignore"):
            covariance, vm, vp = mp - m * p / n, mm - m * m / n, pp - p * p / n
            varies = vm * vp > _ROUNDING * mm * pp
            row[:] = np.where(enough & varies & (covariance > 0), 1 - covariance**2 / (vm * vp), 1.0)
    profile = residual.min(axis=1)
    best = int(profile.argmin())
    explains = profile[best] < min(_GAIN * profile[every.size // 2], 1 - _MIN_EXPLAINED)
    if best in (0, every.size - 1) or not explains:
        return None
    curvature = (profile[best - 1] - 2 * profile[best] + profile[best + 1]) / _RATE_STEP**2
    variance = 2 * profile[best] / max(max(count - 3, 1) * curvature, 1e-9)
    return float(every[best]), float(np.hypot(_RATE_STEP, np.sqrt(variance)))


def common_rates(prediction: Prediction) -> Iterator[ClockRate]:
    """The rate of the common clock, by each articulation angle with the yaw rates on both sides of the coupling."""
    names = prediction.names
    yaw_rates = names_of(YAW_RATE, names)
    interval = round(_INTERVAL * RATE)
    for front, rear in pairwise(yaw_rates):
        unit = SignalName.of(rear).unit
        angle = f"articulation.{unit}"
        if unit == SignalName.of(front).unit or angle not in names or len(prediction.time) <= 2 * interval:
            continue
        r1, r2, measured = (prediction.measured[:, names.index(name)] for name in (front, rear, angle))
        present = np.isfinite(r2 - r1)
        if not present.any():
            continue
        turned = np.cumsum(np.interp(prediction.time, prediction.time[present], (r2 - r1)[present])) / RATE
        outside = np.cumsum(np.isnan(prediction.predicted[0, :, 0]))
        change = np.where(outside[interval:] > outside[:-interval], np.nan, turned[interval:] - turned[:-interval])
        curve = lag_curve(measured[interval:] - measured[:-interval], change)
        found = None if curve is None else curve.gain()
        if found is not None and found[2] > _MIN_RELATION:
            rate, sigma = 1 / found[0] - 1, found[1] / found[0] ** 2
            if sigma < _MAX_SIGMA and abs(rate) > max(3 * sigma, MIN_COMMON_RATE):
                yield ClockRate(signals=(), rate=rate, sigma=sigma)


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
        cure = "exchange the columns of both in signals.toml, and those of other sensors in the same two devices"
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
    channel, so that a time offset is not taken for an exchange: a late and an early gyro explain exchanged ones nearly
    as well in slow driving.
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
    delay, sigma = round(offset.offset, 2), max(offset.sigma, 0.005)
    base = f" ({time_bases[signal]})" if len({time_bases.get(name) for name in offset.signals} - {None}) == 1 else ""
    late = f"{abs(delay):.2f} s {'late' if delay > 0 else 'early'}{base}, with a sigma of {offset.sigma:.2f} s"
    cure = remedy_text({"delay": uncertain_delay(delay, sigma)})
    if others:
        late, cure = f"{late}, like {', '.join(others)}", f"{cure} for each of them"
    problem = f"{late}; {cure}, added to a delay that it has"
    return warning(signal, Fault.TIME_OFFSET, problem, remedy={"delay": delay}, sigma=sigma, others=tuple(others))


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
