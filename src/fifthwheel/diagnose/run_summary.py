"""How each log was driven: its speeds and its lateral acceleration."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fifthwheel.channels import YAW_RATE, SignalName, names_of
from fifthwheel.diagnose.thresholds import MIN_SPEED
from fifthwheel.identify import Identification
from fifthwheel.record import Record
from fifthwheel.record.lateral_acceleration import largest_lateral_acceleration, largest_mean


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
        fits = [fit for fit in identification.fits if fit.log == log.name and fit.signal == f"yaw_rate.{first}"]
        rate = fits[0].measured - offsets.get(log.name, 0.0) if fits else np.zeros(0)
        step = float(np.median(np.diff(fits[0].time))) if fits else 1.0
        acceleration = log.speed[1] * largest_mean(rate[np.isfinite(rate)], round(0.5 / step))
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
