"""How well an identified truck predicts each channel, compared with the noise of the sensor."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from fifthwheel.base.types import Array
from fifthwheel.estimate.identify import Fit, Identification
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
