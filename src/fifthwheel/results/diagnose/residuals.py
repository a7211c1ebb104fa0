"""Residuals: how well an identified truck predicts each channel, and whether what remains is white noise."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from fifthwheel.base.formatting import digits, percent
from fifthwheel.base.types import Array
from fifthwheel.estimate.identify import Fit, Identification
from fifthwheel.results.diagnose import thresholds
from fifthwheel.results.diagnose.thresholds import (
    EXCITED_CHANNEL,
    HIDING_NOISE,
    NOISE_LIMIT,
    POOR_FIT,
    UNRELATED_CHANNEL,
)


@dataclass(frozen=True, kw_only=True)
class FitQuality:
    """The residual of a channel and the noise of its sensor, SI."""

    explained: float  # fraction of the channel's variance that the prediction explains
    rms: float
    noise: float  # standard deviation of the noise; NaN for a short channel without a stated one
    motion: float  # standard deviation of the prediction

    @property
    def noise_limited(self) -> bool:
        """Whether the residual is hardly larger than the sensor noise, so that no more can be explained."""
        return bool(np.isfinite(self.noise) and self.rms <= NOISE_LIMIT * self.noise)

    @property
    def good(self) -> bool:
        """Whether the prediction explains most of the channel, or all that its noise allows."""
        return self.explained >= POOR_FIT or self.noise_limited

    @property
    def unrelated(self) -> bool:
        """Whether the prediction explains almost nothing, although noise would allow more."""
        hidden = self.noise_limited and self.noise > HIDING_NOISE * self.motion
        return self.explained < UNRELATED_CHANNEL and not hidden


def fit_quality(fit: Fit, stated: Mapping[str, float]) -> FitQuality:
    """Residual and sensor noise of a fit.

    Args:
        stated: noise variance of sensors by signal, SI squared. That of the fit's signal counts if it is larger than
            the white noise of the channel, which a filter in the sensor makes too small.
    """
    noise = float(np.fmax(white_noise_sigma(fit.measured), np.sqrt(stated.get(fit.signal, np.nan))))
    with np.errstate(over="ignore", invalid="ignore"):  # a prediction may diverge
        motion = float(np.std(fit.predicted)) if fit.predicted.size else np.nan  # a loaded result may have no series
    return FitQuality(explained=fit.explained, rms=fit.rms, noise=noise, motion=motion)


def white_noise_sigma(values: Array) -> float:
    """Standard deviation of the white noise of a channel (N,), from its second differences; NaN for a short channel.

    Motion slower than a few samples is left out. The result is too large for a coarsely sampled channel and too small
    for a filtered one.
    """
    finite = values[np.isfinite(values)]
    if finite.size < 10:
        return float("nan")
    return float(np.sqrt(np.mean(np.diff(finite, 2) ** 2) / 6))


@dataclass(frozen=True, kw_only=True)
class PredictedLog:
    """A log that was only predicted."""

    log: str
    excited: bool  # whether the truck turns, so that most of at least one channel is explained
    explained: float | None  # lowest explained fraction of the channels that noise does not limit; None without one
    poor: bool  # whether a channel is predicted poorly


def predicted_logs(identification: Identification) -> list[PredictedLog]:
    """The logs of an identification that were only predicted."""
    logs: dict[str, list[FitQuality]] = {}
    for fit in identification.fits:
        if not fit.identified_on:
            logs.setdefault(fit.log, []).append(fit_quality(fit, identification.settings.stated_noise))
    return [
        PredictedLog(
            log=log,
            excited=max(c.explained for c in channels) >= EXCITED_CHANNEL,
            explained=min((c.explained for c in channels if not c.noise_limited), default=None),
            poor=not all(c.good for c in channels),
        )
        for log, channels in logs.items()
    ]


@dataclass(frozen=True, kw_only=True)
class Autocorrelation:
    """Autocorrelation of a residual, for L lags."""

    lag: Array  # (L,) s, from the first lag on
    value: Array  # (L,)
    limit: float  # 95 % of the autocorrelations of white noise lie within ± this limit
    time: float | None  # lag at which the autocorrelation first falls within the limit, s; None for white noise


def autocorrelation(time: Array, residual: Array) -> Autocorrelation | None:
    """Autocorrelation of a residual (N,) on its own median step; pairs with a missing sample are left out.

    None for fewer than `MIN_SAMPLES` samples or a constant.
    """
    finite = np.isfinite(residual)
    count = int(finite.sum())
    if count < thresholds.MIN_SAMPLES or not np.ptp(residual[finite]) > 0:
        return None
    step = float(np.median(np.diff(time[finite])))
    index = np.round((time[finite] - time[finite][0]) / step).astype(np.int64)
    if index[-1] > 20 * count:  # mostly gaps: take the samples as equally spaced
        index = np.arange(count)
    lags = min(max(round(thresholds.MAX_LAG / step), 20), thresholds.MAX_LAGS, count // 3)
    size = 1 << int(np.ceil(np.log2(index[-1] + 1 + lags)))
    values, present = np.zeros(size), np.zeros(size)
    values[index] = residual[finite] - residual[finite].mean()
    present[index] = 1.0
    products, pairs = (np.fft.irfft(np.abs(np.fft.rfft(x)) ** 2, size)[: lags + 1] for x in (values, present))
    with np.errstate(divide="ignore", invalid="ignore"):
        value = products / np.where(pairs > 0.5, pairs, np.nan)
    value = value[1:] / value[0]
    limit = 1.96 / float(np.sqrt(count))
    lag = step * np.arange(1.0, lags + 1.0, dtype=np.float64)
    decay = None
    if np.abs(value[: max(lags // 4, 5)]).max(initial=0.0) > max(thresholds.RELEVANT_CORRELATION, 1.5 * limit):
        inside = np.flatnonzero(np.abs(value) < max(limit, thresholds.RELEVANT_CORRELATION / 2))
        decay = float(lag[inside[0]] if inside.size and inside[0] else lag[0] if inside.size else lag[-1])
    return Autocorrelation(lag=lag, value=value, limit=limit, time=decay)


def outlier_fraction(values: Array) -> float:
    """Fraction of the values (N,) beyond `OUTLIER` of their own standard deviations; NaN for too few."""
    finite = values[np.isfinite(values)]
    if finite.size < thresholds.MIN_SAMPLES:
        return float("nan")
    return float(np.mean(np.abs(finite - finite.mean()) > thresholds.OUTLIER * finite.std()))


def rms_limits(count: int) -> tuple[float, float]:
    """Limits within which the rms of `count` normalised white innovations lies in 95 % of the cases.

    Square root of a chi-squared quantile by E. B. Wilson and M. M. Hilferty, The distribution of chi-square, 1931.
    """
    low, high = (max(1 - 2 / (9 * count) + z * np.sqrt(2 / (9 * count)), 0.0) ** 1.5 for z in (-1.96, 1.96))
    return float(low), float(high)


@dataclass(frozen=True, kw_only=True)
class SegmentRms:
    """Rms of normalised innovations by segment, for K segments."""

    time: Array  # (K,) s, the middle of each segment
    rms: Array
    low: Array  # (K,) lower 95 % limit
    high: Array

    @property
    def fraction_within_limits(self) -> float:
        """Fraction of the segments within the limits."""
        return float(np.mean((self.rms >= self.low) & (self.rms <= self.high)))


def segment_rms(time: Array, normalised: Array) -> SegmentRms | None:
    """Rms of normalised innovations (N,) by segments of equally many samples; None for too few samples."""
    finite = np.isfinite(normalised)
    count = int(finite.sum())
    if count < thresholds.MIN_SAMPLES:
        return None
    segments = np.array_split(
        np.flatnonzero(finite), int(np.clip(count // thresholds.MIN_SAMPLES, 1, thresholds.SEGMENTS))
    )
    low, high = np.array([rms_limits(len(rows)) for rows in segments]).T
    return SegmentRms(
        time=np.array([time[rows].mean() for rows in segments]),
        rms=np.array([np.sqrt(np.mean(normalised[rows] ** 2)) for rows in segments]),
        low=low,
        high=high,
    )


def describe_whiteness(
    correlation: Autocorrelation | None, outliers: float, *, free_run: bool, in_sigma: bool = False
) -> str:
    """What the autocorrelation and the fraction of outliers mean, of the residual of a free run or of an innovation of
    a state filter; `in_sigma`: the sigma of the parameters includes the effect of the autocorrelation."""
    name = "residual" if free_run else "innovation"
    if correlation is None:
        return f"The {name} has too few samples for a test."
    text = f"The {name} is white noise: no model error is visible."
    if correlation.time is not None:
        longer = " or more" if correlation.time >= correlation.lag[-1] else ""
        cause = "model, the road or a sensor" if free_run else "vehicle file or of the assumed noise"
        text = f"The {name} is autocorrelated over about {digits(correlation.time, 1)} s{longer}"
        text += f", which indicates an error of the {cause}."
        text += " The sigma of the parameters includes its effect." if in_sigma else ""
    if outliers > thresholds.MANY_OUTLIERS * thresholds.NORMAL_OUTLIERS:
        beyond = f"{percent(outliers)} of the samples lie beyond {thresholds.OUTLIER:g} sigma"
        text += f" There are outliers: {beyond} ({percent(thresholds.NORMAL_OUTLIERS)} in a normal distribution)."
    return text


def describe_innovation_rms(rms: float, count: int) -> str:
    """What the rms of `count` normalised innovations means."""
    if count < thresholds.MIN_SAMPLES or not np.isfinite(rms):
        return "The state filter has too few innovations for a test."
    low, high = rms_limits(count)
    text = f"The innovations of the state filter have an rms of {rms:.2f}; {low:.2f} to {high:.2f} is expected"
    if rms > thresholds.LARGE_INNOVATION:
        return f"{text}. They are much too large: the bands of the states are too narrow."
    if rms < thresholds.SMALL_INNOVATION:
        return f"{text}. They are much too small: the bands of the states are wider than necessary."
    if low <= rms <= high:
        return f"{text}."
    return f"{text}. The difference has no practical effect."
