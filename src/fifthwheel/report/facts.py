"""What a reader asks of a log before believing anything: how fast, how hard, how noisy."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from fifthwheel.identify import Fit, Identification
    from fifthwheel.logs import Record
    from fifthwheel.observe import States

Array = NDArray[np.float64]

GRAVITY = 9.81


@dataclass(frozen=True, kw_only=True)
class Drive:
    """How a log was driven."""

    name: str
    speed: tuple[float, float]
    """Lowest and highest where the model holds, m/s; NaN when never."""
    acceleration: float
    """Speed times yaw rate of the first unit, held for half a second, at its greatest, m/s^2; NaN without yaw rate."""


def drives(records: "Sequence[Record]", first: str | None, zeros: Mapping[str, float], min_speed: float) -> list[Drive]:
    """How each log was driven.

    Args:
        first: name of the first unit; by default the first one with a yaw rate.
        zeros: by log, the zero of that yaw rate, rad/s.
    """
    return [_drive(record, first, zeros.get(record.name, 0.0), min_speed) for record in records]


def _drive(record: "Record", first: str | None, zero: float, min_speed: float) -> Drive:
    nothing = float("nan")
    speed = record.signals.get("speed", np.full(len(record), np.nan))
    with np.errstate(invalid="ignore"):
        fast = speed >= min_speed
    if not fast.any():
        return Drive(name=record.name, speed=(nothing, nothing), acceleration=nothing)
    low, high = float(speed[fast].min()), float(speed[fast].max())
    rates = [name for name in record.signals if name.startswith("yaw_rate.")]
    name = f"yaw_rate.{first}" if first else next(iter(rates), "")
    peak = nothing
    if name in record.signals:
        lateral = speed * (record.signals[name] - zero)
        good = fast & np.isfinite(lateral)
        peak = _held(lateral[good], round(record.rate / 2 * good.mean()))
    return Drive(name=record.name, speed=(low, high), acceleration=peak)


def _held(values: Array, width: int) -> float:
    """The greatest size of the mean of so many values in a row; NaN of none."""
    if not values.size:
        return float("nan")
    width = min(max(width, 1), values.size)
    total = np.concatenate([[0.0], np.cumsum(values)])
    return float(np.abs((total[width:] - total[:-width]) / width).max())


def driven(identification: "Identification", records: "Sequence[Record]") -> list[Drive]:
    """How each log was driven, the sensors' zeros taken out as found.

    Of a log without its record there is only its greatest speed beside the yaw rate, and so an upper bound.
    """
    first = identification.vehicle.units[0].name
    zeros = {e.log: e.value for e in identification.sensors if e.log and e.name == f"yaw_rate.{first}.offset"}
    found = drives(records, first, zeros, identification.settings.min_speed)
    there = {drive.name for drive in found}
    for log in identification.logs:
        if log.name in there:
            continue
        own = [fit for fit in identification.fits if fit.log == log.name and fit.signal == f"yaw_rate.{first}"]
        rate = own[0].measured - zeros.get(log.name, 0.0) if own else np.zeros(0)
        step = float(np.median(np.diff(own[0].time))) if own else 1.0
        peak = log.speed[1] * _held(rate[np.isfinite(rate)], round(0.5 / step))
        found.append(Drive(name=log.name, speed=log.speed, acceleration=peak))
    return found


def white_noise(values: Array) -> float:
    """Standard deviation of the noise that changes from sample to sample, by second differences; NaN if too short.

    What is slower than a few samples counts as signal, so a coarse log gives too much and a filtered one too little.
    """
    seen = values[np.isfinite(values)]
    if seen.size < 10:
        return float("nan")
    return float(np.sqrt(np.mean(np.diff(seen, 2) ** 2) / 6))


@dataclass(frozen=True, kw_only=True)
class Share:
    """A residual beside what the sensor's own noise makes unavoidable, SI."""

    explained: float
    rms: float
    noise: float

    @property
    def by_noise(self) -> bool:
        """Whether the residual is hardly more than the sensor's noise."""
        return bool(np.isfinite(self.noise) and self.rms <= 1.25 * self.noise)


def share(fit: "Fit") -> Share:
    """Residual and noise of a fit."""
    return Share(explained=fit.explained, rms=fit.rms, noise=white_noise(fit.measured))


def normalised(states: "States", name: str) -> Array:
    """Innovation of a channel in units of what the filter expects, (N,)."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(states.innovation[name] / states.innovation_sigma[name], dtype=np.float64)


def rejected(states: "States", name: str) -> NDArray[np.bool_]:
    """Samples of a channel that were measured and not used, (N,)."""
    return np.asarray(np.isfinite(states.innovation[name]) & ~states.accepted[name], dtype=np.bool_)


def reference_rms(states: "States", record: "Record | None", name: str) -> float | None:
    """Root mean square of state less reference where both are; None without a reference."""
    if record is None or name not in record.reference:
        return None
    difference = states.values[name] - on_time(record, record.reference[name], states.time)
    seen = np.isfinite(difference)
    return float(np.sqrt(np.mean(difference[seen] ** 2))) if seen.any() else None


def on_time(record: "Record", values: Array, time: Array) -> Array:
    """A record's channel at other times; itself where they are the same."""
    if len(time) == len(record.time) and np.array_equal(time, record.time):
        return values
    return np.interp(time, record.time, values, left=np.nan, right=np.nan)


def median_band(states: "States", name: str) -> float | None:
    """Half the width of a state's usual band of two sigma; None when the state is never known."""
    sigma = states.sigma[name]
    seen = sigma[np.isfinite(sigma)]
    return float(2 * np.median(seen)) if seen.size else None


def record_of(states: "States", records: "Sequence[Record]") -> "Record | None":
    """The record that the states are of, by name."""
    return next((record for record in records if record.name == states.name), None)


def unit_of(signal: str) -> str:
    """SI unit of a signal."""
    from fifthwheel.logs.names import si_unit

    return si_unit(signal) or ""


def status_shares(states: "States") -> dict[str, float]:
    """Part of the samples in every status that occurs, in words."""
    from fifthwheel.observe import Status

    found = {WORDS.get(status.name, status.name.lower()): float((states.status == status).mean()) for status in Status}
    return {word: part for word, part in found.items() if part > 0}


WORDS = {
    "OK": "measured",
    "COASTING": "coasting: no measurement for a while",
    "TOO_SLOW": "too slow for the model",
    "INPUT_MISSING": "speed or steer angle missing",
}
"""Status in words."""
