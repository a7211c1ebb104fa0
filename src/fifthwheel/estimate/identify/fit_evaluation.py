"""How well the identified vehicle explains each log, and whether that supports the estimates."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fifthwheel.base.types import Array
from fifthwheel.data.channels import CHANNELS, SignalName
from fifthwheel.data.record.sensor_noise import estimate_noise_variance
from fifthwheel.estimate.filters import variances
from fifthwheel.estimate.identify.dataset import Dataset, LogData
from fifthwheel.estimate.identify.result.parts import Fit
from fifthwheel.estimate.identify.settings import CommonSettings
from fifthwheel.truck import Vehicle

FitsOf = Callable[[LogData, bool], list[Fit]]
"""Fits of every channel of a log, and whether the vehicle was identified on it."""
LEAST_EXPLAINED = 0.5
"""A clear signal of which less than this fraction is explained makes the estimates untrustworthy."""
CLEAR_SIGNAL, CLEAR_ROLL = 4.0, 20.0
"""A signal is clear if its variance exceeds that of its noise by this factor. The factor is larger for a roll rate and
a lateral acceleration, because the road rolls a vehicle that drives straight."""
SPEED_MARGIN = 0.1
"""A predicted log may leave the speeds of the identification by this fraction without a note."""


@dataclass(frozen=True, kw_only=True)
class FitEvaluation:
    """Fits of all logs."""

    fits: tuple[Fit, ...]
    notes: tuple[str, ...]
    trusted: bool  # False if the vehicle does not explain a clear signal of a log that was used for the identification


def evaluate_fits(
    dataset: Dataset, logs: Sequence[LogData], fits_of: FitsOf, settings: CommonSettings
) -> FitEvaluation:
    """Fits of all logs of a dataset, and whether they support the estimates.

    `logs` are those that the vehicle was identified on, with their estimated noise; predicted logs get that of the
    first.
    """
    fits = [fit for log in logs for fit in fits_of(log, True)]
    unexplained = [fit for fit in fits if _is_unexplained(fit, dataset.vehicle, settings)]
    notes = [
        f"{fit.signal}: the model explains {max(fit.explained, 0):.0%} of its variance in {fit.log}. Check the signal, "
        "the vehicle file and the initial values."
        for fit in unexplained
    ]
    for log in dataset.validation:
        log = replace(log, noise=logs[0].noise)
        fits += fits_of(log, False)
        notes += _speed_notes(log, dataset.speeds)
    return FitEvaluation(fits=tuple(fits), notes=tuple(notes), trusted=not unexplained)


def _is_unexplained(fit: Fit, vehicle: Vehicle, settings: CommonSettings) -> bool:
    """Whether the model explains too little of a clear signal."""
    noise = variances.sensor_variance(vehicle, fit.signal, settings.stated_noise)
    channel = CHANNELS[SignalName.of(fit.signal).quantity]
    if channel.large_offset:  # its noise is different on every truck
        noise = max(noise, estimate_noise_variance(fit.time, fit.measured) or 0.0)
    ratio = float(np.nanvar(fit.measured)) / noise
    if channel.of_roll:
        return ratio > CLEAR_ROLL and not fit.explained > LEAST_EXPLAINED
    return ratio > CLEAR_SIGNAL and not fit.explained > LEAST_EXPLAINED * (1 - 1 / ratio)


def _speed_notes(log: LogData, speeds: tuple[float, float]) -> list[str]:
    """A note if a log leaves the range of speeds (m/s) by more than the margin."""
    (low, high), (slow, fast) = speeds, log.speeds
    if slow >= (1 - SPEED_MARGIN) * low and fast <= (1 + SPEED_MARGIN) * high:
        return []
    return [
        f"{log.name}: speed from {3.6 * slow:.0f} to {3.6 * fast:.0f} km/h, identified at {3.6 * low:.0f} to "
        f"{3.6 * high:.0f} km/h; the understeer may differ there."
    ]


def channel_fits(
    log: str, channels: Sequence[str], time: Array, measured: Array, predicted: Array, *, identified_on: bool
) -> list[Fit]:
    """Fit of every channel; a channel without variance or with fewer than three samples has none.

    `time` (N,) is in s, `measured` and `predicted` are (N, m).
    """
    fits = []
    for name, y, y_hat in zip(channels, measured.T.copy(), predicted.T.copy(), strict=True):
        present = np.isfinite(y)
        if present.sum() < 3 or np.var(y[present]) == 0:
            continue
        residual = (y - y_hat)[present]
        fits.append(
            Fit(
                log=log,
                signal=name,
                explained=float(1 - np.var(residual) / np.var(y[present])),
                rms=float(np.sqrt(np.mean(residual**2))),
                time=time,
                measured=y,
                predicted=y_hat,
                identified_on=identified_on,
            )
        )
    return fits
