"""Logs and estimated states in a few numbers.

Of a log: its speeds and its lateral acceleration. Of states: status, width of the bands, difference from references,
size of innovations.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fifthwheel.base.types import Array
from fifthwheel.data.channels import PREDICTED_LOAD_TRANSFER, YAW_RATE, SignalName, names_of
from fifthwheel.data.record import Record
from fifthwheel.data.record.derived import largest_lateral_acceleration, largest_mean
from fifthwheel.estimate.identify import Identification
from fifthwheel.estimate.observe import States, Status
from fifthwheel.results.diagnose.thresholds import MIN_SPEED


@dataclass(frozen=True, kw_only=True)
class RunSummary:
    """How a log was driven."""

    name: str
    speed: tuple[float, float]  # lowest and highest speed where the model holds, m/s; NaN where it never holds
    acceleration: float
    """Largest magnitude of speed times yaw rate of the first unit, averaged over 0.5 s, m/s²; NaN without yaw rate."""


def summarise_runs(identification: Identification, records: Sequence[Record]) -> list[RunSummary]:
    """Summaries of the records and of all logs of an identification, with the estimated gyro offsets removed.

    Without its record, a log has only its highest speed and its yaw rate, which give an upper bound.
    """
    first = identification.vehicle.units[0].name
    offsets = {e.log: e.value for e in identification.sensors if e.log and e.name == f"yaw_rate.{first}.offset"}
    summaries = summarise_records(records, first, offsets, identification.settings.min_speed)
    present = {summary.name for summary in summaries}
    for log in identification.logs:
        if log.name in present:
            continue
        fit = next((f for f in identification.fits if f.log == log.name and f.signal == f"yaw_rate.{first}"), None)
        acceleration = np.nan
        if fit is not None and fit.time.size > 1:  # a loaded result may have no series
            rate = fit.measured - offsets.get(log.name, 0.0)
            window = round(0.5 / float(np.median(np.diff(fit.time))))
            acceleration = log.speed[1] * largest_mean(rate[np.isfinite(rate)], window)
        summaries.append(RunSummary(name=log.name, speed=log.speed, acceleration=acceleration))
    return summaries


def summarise_records(
    records: Sequence[Record],
    unit: str | None = None,
    offsets: Mapping[str, float] | None = None,
    min_speed: float = MIN_SPEED,
) -> list[RunSummary]:
    """Summaries of records.

    Args:
        unit: the first unit; by default the unit of the first yaw rate.
        offsets: offset of that unit's yaw rate by record, rad/s.
        min_speed: slower samples are left out, m/s.
    """
    return [_summary(record, unit, (offsets or {}).get(record.name, 0.0), min_speed) for record in records]


def _summary(record: Record, unit: str | None, offset: float, min_speed: float) -> RunSummary:
    speed = record.signals.get("speed", np.full(len(record), np.nan))
    with np.errstate(invalid="ignore"):
        fast = speed >= min_speed
    if not fast.any():
        return RunSummary(name=record.name, speed=(np.nan, np.nan), acceleration=np.nan)
    low, high = float(speed[fast].min()), float(speed[fast].max())
    rates = names_of(YAW_RATE, record.signals)
    name = f"yaw_rate.{unit}" if unit else next(iter(rates), "")
    acceleration = np.nan
    if name in record.signals:
        first = SignalName.of(name).unit
        acceleration = largest_lateral_acceleration(record, first, offset=offset, min_speed=min_speed)
    return RunSummary(name=record.name, speed=(low, high), acceleration=acceleration)


class InnovationSize(NamedTuple):
    """How large the innovations of a channel are."""

    rms: float  # of the accepted normalised innovations, 1 is expected; NaN where none was accepted
    rejected: float  # fraction of the measured samples outside the gate


@dataclass(frozen=True, kw_only=True)
class StateSummary:
    """The states of one record in a few numbers, SI."""

    name: str
    status: Mapping[str, float]  # fraction of the samples by name of `observe.Status`, where it is above 0
    band: Mapping[str, float | None]  # median of two sigma by state; None for a state that is never known
    reference_rms: Mapping[str, float | None]  # rms difference from the reference by state; None without a reference
    innovations: Mapping[str, InnovationSize]  # by measured channel
    lift_warning: str  # the first warning that a wheel is about to lift; empty without one

    @property
    def valid(self) -> float:
        """Fraction of the samples with all inputs and with recent measurements that agree with them."""
        return self.status.get("OK", 0.0)


def summarise_states(states: States, records: Sequence[Record] = ()) -> StateSummary:
    """Summary of the states of a record; its references are taken from the record of the same name."""
    record = record_of(states, records)
    status = {s.name: float((states.status == s).mean()) for s in Status}
    return StateSummary(
        name=states.name,
        status={name: fraction for name, fraction in status.items() if fraction > 0},
        band={name: _median_band(sigma) for name, sigma in states.sigma.items()},
        reference_rms={name: _reference_rms(states, record, name) for name in states.values},
        innovations={name: innovation_size(states, name) for name in states.innovation},
        lift_warning=_first_lift_warning(states),
    )


def _first_lift_warning(states: States) -> str:
    """The time, and the axle group with the largest predicted load transfer ratio."""
    if not states.lift_warning.any():
        return ""
    first = int(states.lift_warning.argmax())
    predicted = names_of(PREDICTED_LOAD_TRANSFER, states.values)
    largest = max(predicted, key=lambda name: abs(states.values[name][first]))
    return f"a wheel of {SignalName.of(largest).place} is about to lift at {states.time[first]:.1f} s"


def record_of(states: States, records: Sequence[Record]) -> Record | None:
    """The record with the name of the states."""
    return next((record for record in records if record.name == states.name), None)


def normalised_innovation(states: States, name: str) -> Array:
    """Innovation of a channel divided by its expected standard deviation, (N,)."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(states.innovation[name] / states.innovation_sigma[name], dtype=np.float64)


def rejected_samples(states: States, name: str) -> NDArray[np.bool_]:
    """Samples of a channel that were measured and rejected by the gate, (N,)."""
    return np.asarray(np.isfinite(states.innovation[name]) & ~states.accepted[name], dtype=np.bool_)


def innovation_size(states: States, name: str) -> InnovationSize:
    """Rms of the accepted normalised innovations of a channel, and the fraction of rejected samples."""
    values, rejected = normalised_innovation(states, name), rejected_samples(states, name)
    finite = np.isfinite(values)
    accepted = finite & ~rejected
    rms = float(np.sqrt(np.mean(values[accepted] ** 2))) if accepted.any() else float("nan")
    return InnovationSize(rms, float(rejected.sum() / max(finite.sum(), 1)))


def valid_fraction(states: Sequence[States]) -> float:
    """Fraction of the samples of all records with all inputs and with recent measurements that agree with them; up to a
    tenth of the samples, in which the filter settles, do not count."""
    if not states:
        return 0.0
    status = np.concatenate([np.asarray(s.status) for s in states])
    settling = float(np.mean(status == Status.SETTLING))
    return float(np.mean(status == Status.OK)) / max(1.0 - settling, 0.9)


def _median_band(sigma: Array) -> float | None:
    finite = sigma[np.isfinite(sigma)]
    return float(2 * np.median(finite)) if finite.size else None


def _reference_rms(states: States, record: Record | None, name: str) -> float | None:
    if record is None or name not in record.reference:
        return None
    difference = states.values[name] - _at_times(record, record.reference[name], states.time)
    finite = np.isfinite(difference)
    return float(np.sqrt(np.mean(difference[finite] ** 2))) if finite.any() else None


def _at_times(record: Record, values: Array, time: Array) -> Array:
    if len(time) == len(record.time) and np.array_equal(time, record.time):
        return values
    return np.interp(time, record.time, values, left=np.nan, right=np.nan)
