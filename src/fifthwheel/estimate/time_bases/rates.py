"""Rates of clocks: a channel whose offset grows over the log, and a time base that contradicts the kinematics.

With a clock that runs fast by rho, a timestamp is t' = t + offset + rho (t - t0). The lag of the channel behind its
prediction grows with slope rho. If all channels share the clock, only a relation that contains time shows it: the
articulation changes by the integral of the difference of the yaw rates,

    articulation(t') - articulation(t' - T) = g times the integral of (r2 - r1) over T,    g = 1 / (1 + rho).
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from fifthwheel.base.types import Array
from fifthwheel.data.channels import YAW_RATE, SignalName, channel_of, names_of
from fifthwheel.estimate.time_bases.lags import MAX_LAG, RATE, lag_curve
from fifthwheel.estimate.time_bases.predictions import Prediction

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
