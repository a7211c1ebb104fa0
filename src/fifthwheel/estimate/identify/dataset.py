"""The data of an identification: checked logs, their usable segments, and the vehicle steered as logged."""

import itertools
import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from fifthwheel.base.errors import SignalError
from fifthwheel.base.formatting import enumerated
from fifthwheel.base.spelling import command
from fifthwheel.base.types import Array
from fifthwheel.data.channels import (
    ARTICULATION,
    IDENTIFIED,
    MOTION,
    ROLL_RATE,
    USUAL,
    WHEEL_SPEED_DIFFERENCE,
    YAW_RATE,
    SignalName,
    is_input,
    measured_signals,
    names_of,
)
from fifthwheel.data.channels.sensors import SensorPrior
from fifthwheel.data.checks import Finding, raise_errors
from fifthwheel.data.checks.samples import without_outliers, without_spikes
from fifthwheel.data.record import Record
from fifthwheel.data.record.derived import largest_lateral_acceleration
from fifthwheel.data.record.record import parts_where, segments_above
from fifthwheel.estimate.filters import variances
from fifthwheel.estimate.filters.noise_model import NoiseModel
from fifthwheel.estimate.filters.step_rows import SpeedCurve
from fifthwheel.estimate.grade import grade_notes, with_grade
from fifthwheel.estimate.identify.doubts import NONLINEAR_SPEED_RATE
from fifthwheel.estimate.identify.given import common_sensors
from fifthwheel.estimate.identify.mass import mass_findings
from fifthwheel.estimate.identify.settings import CommonSettings
from fifthwheel.estimate.identify.setup import simplified
from fifthwheel.estimate.identify.statement import statement
from fifthwheel.estimate.longitudinal import drive_axle_braking
from fifthwheel.estimate.time_bases import check_signals
from fifthwheel.model.dynamics.sensors import with_wheel_speed_differences
from fifthwheel.truck import Vehicle
from fifthwheel.truck.steering import require_roll

SHORTEST_PART = 2.0
"""Of a segment at a steady speed, s."""
FROM_LOGS = "identified from"
"""In the source of an identified vehicle, before the names of the logs."""
ROUNDING = 0.01
"""Of the number of samples in a row."""


@dataclass(frozen=True, kw_only=True)
class LogData:
    """The usable segments of one log, and the estimates of its sensors so far."""

    name: str
    segments: Sequence[Record]
    samples_per_row: int = 1  # whose means the segments have
    scatter: Mapping[str, float] = field(default_factory=dict)
    """Variance of the samples of each channel about these means without the motion, SI squared."""
    left_out: Mapping[str, float] = field(default_factory=dict)  # fraction of the samples of each channel, as outliers
    errors: Mapping[str, float] = field(default_factory=dict)  # sensor errors that belong to this log, by name, SI
    noise: Mapping[str, float] = field(default_factory=dict)  # variance of each channel's residuals, SI squared
    autocorrelation_factor: Mapping[str, float] = field(default_factory=dict)  # of each channel, see `noise_model`
    noise_models: Mapping[str, NoiseModel] = field(default_factory=dict)  # of each channel; white noise where missing
    drive_axle_braking: tuple[float, float] | None = None  # as `longitudinal.drive_axle_braking`

    def with_noise(self, vehicle: Vehicle, channels: Sequence[str], given: Mapping[str, float]) -> "LogData":
        """The log with the noise variance of every channel: its own, else the given one, else that of the table."""
        table = {n: variances.sensor_variance(vehicle, n, given) / self.samples_per_row for n in channels}
        return replace(self, noise={**table, **self.noise})

    def noise_model(self, channel: str) -> NoiseModel:
        """Noise model of a channel: its own, or white noise."""
        return self.noise_models.get(channel) or NoiseModel(white=self.noise[channel])

    def sample_variance(self, channel: str) -> float:
        """Noise variance of a sample of a channel: the mean of several has less white noise."""
        return self.noise[channel] + self.scatter.get(channel, 0.0)

    @property
    def speeds(self) -> tuple[float, float]:
        """Lowest and highest speed in the segments, m/s."""
        speed = np.concatenate([segment.input("speed") for segment in self.segments])
        return float(speed.min()), float(speed.max())

    def effective_variance(self, channel: str) -> float:
        """Noise variance of a channel times its autocorrelation factor."""
        return self.noise[channel] * self.autocorrelation_factor.get(channel, 1.0)


@dataclass(frozen=True, kw_only=True)
class Dataset:
    """What `prepare_dataset` makes of logs and vehicle."""

    records: tuple[Record, ...]  # the given records without their empty channels, one for each of `logs`
    logs: tuple[LogData, ...]  # to identify the vehicle on
    validation: tuple[LogData, ...]  # only predicted
    initial_vehicle: Vehicle  # the given vehicle, simplified as the settings demand
    vehicle: Vehicle  # the same with the axles locked whose steer angle is not in the logs
    yaw: tuple[str, ...]  # measured yaw rates and articulation angles
    roll: tuple[str, ...]  # measured roll rates
    others: tuple[str, ...]
    """Measured signals that are not `USUAL`, such as lateral accelerations; two stages do not use them."""
    sensors: Mapping[str, SensorPrior]  # what the logs state of their sensors, by signal
    findings: tuple[Finding, ...]  # what is implausible in the signals of all logs
    notes: tuple[str, ...]  # for the user

    @property
    def outputs(self) -> tuple[str, ...]:
        """Measured signals that one stage compares with the model."""
        return (*self.yaw, *self.roll, *self.others)

    @property
    def speeds(self) -> tuple[float, float]:
        """Lowest and highest speed of the logs that the vehicle is identified on, m/s."""
        return speed_range(self.logs)

    def lateral_accelerations(self, min_speed: float, offsets: Sequence[Mapping[str, float]] = ()) -> list[float]:
        """Largest lateral acceleration of the first unit that has a yaw rate in each log, above a speed, m/s^2 and m/s;
        NaN if none has. `offsets` of the yaw rates of each log by the name of the sensor error, rad/s."""
        units, largest = [unit.name for unit in self.vehicle.units], []
        for record, errors in zip(self.records, offsets or [{}] * len(self.records), strict=True):
            unit = next((unit for unit in units if f"yaw_rate.{unit}" in record.signals), units[0])
            offset = errors.get(f"yaw_rate.{unit}.offset", 0.0)
            largest.append(largest_lateral_acceleration(record, unit, offset=offset, min_speed=min_speed))
        return largest

    def identified_vehicle(self, values: Mapping[str, float]) -> Vehicle:
        """The initial vehicle with estimated values, each within the range of a vehicle file; its source names the logs
        and their speeds."""
        (low, high), initial = self.speeds, self.initial_vehicle
        ranges, given = initial.parameter_ranges(), initial.parameters()
        values = {
            path: min(max(v, min(ranges[path][0], given[path])), max(ranges[path][1], given[path]))
            for path, v in values.items()
        }
        names = ", ".join(log.name for log in self.logs)
        source = f"{initial.source}; {FROM_LOGS} {names} at {low:.1f} to {high:.1f} m/s"
        return initial.replace(values).model_copy(update={"source": source.removeprefix("; ")})


def _identified_from(vehicle: Vehicle) -> set[str]:
    """The names of the logs of which `Dataset.identified_vehicle` made a vehicle."""
    found = re.findall(rf"{FROM_LOGS} (.*?) at [\d.]+ to [\d.]+ m/s", vehicle.source)
    return {name for names in found for name in names.split(", ")}


def prepare_dataset(
    records: Sequence[Record],
    vehicle: Vehicle,
    settings: CommonSettings,
    validate: Sequence[Record] = (),
    *,
    findings: bool = True,
) -> Dataset:
    """Check the logs, cut them into usable segments, and lock the axles of the vehicle that they do not steer.

    A measured channel without any sample, which the check refuses, counts as absent. Logs to `validate` are only
    predicted. `findings`: whether the signals are checked for plausibility. A SignalError names the signal that makes a
    log unusable, and the remedy.
    """
    everything = (*records, *validate)
    _require_distinct_names(records, everything)
    given, vehicle = vehicle, simplified(vehicle, settings)
    logged = {name for record in records for name in record.signals}
    steered = vehicle.with_logged_steering(logged, records[0].name if len(records) == 1 else "the logs")
    notes, found = list[str](), list[Finding]()
    for record in everything:
        record.segments()  # an error names a wrong unit of time, which no check of a signal would
        _require_steering(record, steered)
        notes += [f"{record.name}: {note}" for note in _without_empty_channels(record).notes]
        if findings:
            found += _findings(record, vehicle, settings)
    if findings:
        found += mass_findings(records, given)
    if locked := sorted(set(vehicle.steer_signals()) - set(steered.steer_signals())):
        notes.append(
            f"{', '.join(locked)}: steerable in the vehicle file, but the steer angle is not in the logs. It is "
            "assumed to be 0."
        )
    if again := _identified_from(vehicle) & {record.name for record in records}:
        notes.append(
            f"{enumerated(sorted(again))}: the vehicle file is identified from a log of this name; if it is the same, "
            "it counts twice: begin with the file before, or with other logs."
        )
    if any(a == b for a, b in itertools.combinations(everything, 2)):
        raise SignalError("logs: two logs contain the same samples; give every log once")
    exact = [name for name, text in settings.given.items() if statement(name, text).kind == "exact"]
    notes += [f"{name}: given as exact, so no sigma includes its uncertainty." for name in exact]
    notes += _lone_axles(vehicle)
    if vehicle.assumed:
        notes.append(
            f"{len(vehicle.assumed)} numbers are not in the vehicle file and are assumed: {command('vehicle show')} "
            "gives each with its uncertainty, source and effect."
        )
    inputs = ("speed", *steered.steer_signals())

    def cleaned(record: Record) -> Record:
        whole = _without_empty_channels(with_wheel_speed_differences(without_spikes(record), steered))
        return with_grade(whole, steered) if settings.brakes else whole

    def log_data(record: Record) -> LogData:
        braking = drive_axle_braking(record) if settings.brakes else None
        segments = segments_above(record, settings.min_speed, inputs)
        log = LogData(name=record.name, segments=segments, drive_axle_braking=braking)
        return _averaged(log, int(record.rate / settings.row_rate + ROUNDING), settings.gate)

    records, validate = (tuple(map(cleaned, group)) for group in (records, validate))
    logs, validation = (tuple(map(log_data, group)) for group in (records, validate))
    if settings.tyre_law == "linear":
        logs, steady = zip(*map(_at_steady_speed, logs), strict=True)
        notes += filter(None, steady)
    logged, units = {name for record in records for name in record.signals}, [unit.name for unit in steered.units]
    yaw = measured_signals(logged, units, (YAW_RATE, ARTICULATION))
    unused = [c for c in IDENTIFIED if c.of_roll and not settings.roll]
    require_roll(steered.steering, not unused)
    roll = measured_signals(logged, units, [c for c in (ROLL_RATE,) if c not in unused])
    others = measured_signals(logged, units, [c for c in IDENTIFIED if c not in (*USUAL, *unused)])
    notes += [f"{name} is not used, because roll=False." for name in measured_signals(logged, units, unused)]
    if not measured_signals(logged, units, [c for c in MOTION if c not in unused]):
        raise SignalError(f"yaw_rate.{units[0]}: in none of the logs; map the yaw rate gyro of the {units[0]} to it")
    unmeasured = unmeasured_units((*yaw, *names_of(WHEEL_SPEED_DIFFERENCE, others)), steered)
    notes += [
        f"yaw_rate.{unit} and articulation.{unit}: in none of the logs. The parameters of the {unit} are estimated "
        "from its effect on the other units."
        for unit in unmeasured
    ]
    if settings.brakes and units[-1] in unmeasured:
        notes = [*grade_notes(records, units[-1]), *notes]
    return Dataset(
        records=records,
        logs=logs,
        validation=validation,
        initial_vehicle=vehicle,
        vehicle=steered,
        yaw=yaw,
        roll=roll,
        others=others,
        sensors=common_sensors((*records, *validate)),
        findings=tuple(found),
        notes=tuple(notes),
    )


def _at_steady_speed(log: LogData) -> tuple[LogData, str]:
    """The log without acceleration and braking beyond `NONLINEAR_SPEED_RATE`, and a note if there is any; the whole log
    if nothing else is left."""
    parts = list[Record]()
    for segment in log.segments:
        slow = np.abs(SpeedCurve(segment.time, segment.input("speed"))(segment.time)[2]) <= NONLINEAR_SPEED_RATE
        parts += [segment] if slow.all() else parts_where(segment, slow, SHORTEST_PART)
    whole, left = (sum(float(np.ptp(part.time)) for part in each) for each in (log.segments, parts))
    problem = f"linear tyres lack the loads that acceleration and braking beyond {NONLINEAR_SPEED_RATE:g} m/s^2 move"
    cure = "tyres that saturate have them, if the vehicle file determines the static axle loads"
    if not parts:
        return log, f"{log.name}: {problem}, which is everywhere in this log: all estimates are approximate; {cure}."
    left_out = f"{log.name}: {whole - left:.0f} s are left out: {problem}; {cure}."
    return replace(log, segments=parts), left_out if whole - left > 0.5 else ""


def _averaged(log: LogData, count: int, gate: float) -> LogData:
    """The log of the means of `count` samples each, without outliers beyond `gate` sigmas."""
    channels = [name for name in log.segments[0].signals if not is_input(name)]
    if count <= 1 or not channels:
        return log
    kept = [without_outliers(segment, channels, gate) for segment in log.segments]
    rows = [segment.averaged(count) for segment in kept]
    lengths = list(map(len, kept))

    def present(segments: Sequence[Record], name: str) -> int:
        return sum(int(np.isfinite(segment.signals[name]).sum()) for segment in segments)

    return replace(
        log,
        segments=rows,
        samples_per_row=count,
        scatter={
            n: float(np.average(list(map(_scatter, kept, rows, itertools.repeat(n))), weights=lengths))
            for n in channels
        },
        left_out={n: 1 - present(kept, n) / max(present(log.segments, n), 1) for n in channels},
    )


def _scatter(samples: Record, rows: Record, name: str) -> float:
    """Variance of the samples of a channel about the means of a record, without the motion between these."""
    nearest, means = np.searchsorted((rows.time[1:] + rows.time[:-1]) / 2, samples.time), rows.signals[name]
    motion = np.gradient(means, rows.time)[nearest] * (samples.time - rows.time[nearest])
    off = samples.signals[name] - means[nearest] - motion
    return float(np.mean(off[np.isfinite(off)] ** 2)) if np.isfinite(off).any() else 0.0


def _lone_axles(vehicle: Vehicle) -> list[str]:
    """A note on each axle group of which the vehicle file states the positions of some axles only."""
    notes = []
    for unit in vehicle.units:
        for group in unit.axle_groups:
            paths = [f"{unit.name}.{axle.name}.position" for axle in group.axles]
            stated = [path for path in paths if path in vehicle.stated]
            if stated and len(stated) < len(paths):
                others = ", ".join(path for path in paths if path not in stated)
                notes.append(
                    f"{', '.join(stated)}: stated with a standard deviation, {others} not, so these axles do not move "
                    "together. If the whole group is uncertain, state all of them."
                )
    return notes


def unmeasured_units(channels: Sequence[str], vehicle: Vehicle) -> tuple[str, ...]:
    """Units with neither a yaw rate nor an articulation angle among the channels, such as a dolly, front to rear."""
    measured = {SignalName.of(name).unit for name in channels}
    return tuple(unit.name for unit in vehicle.units if unit.name not in measured)


def measured_columns(segment: Record, channels: Iterable[str]) -> Array:
    """Channels (N, m) of a segment; NaN where one is missing."""
    missing = np.full(len(segment), np.nan)
    return np.column_stack([segment.signals.get(name, missing) for name in channels])


def speed_range(logs: Sequence[LogData]) -> tuple[float, float]:
    """Lowest and highest speed of logs, m/s."""
    lowest, highest = zip(*[log.speeds for log in logs], strict=True)
    return min(lowest), max(highest)


def _require_distinct_names(records: Sequence[Record], everything: Sequence[Record]) -> None:
    if not records:
        raise SignalError("logs: none given; identification needs at least one log")
    counts = Counter(record.name for record in everything)
    if repeated := sorted(name for name, count in counts.items() if count > 1):
        raise SignalError(f"logs: {', '.join(repeated)} given more than once; give every log once, with its own name")


def _require_steering(record: Record, vehicle: Vehicle) -> None:
    for name in vehicle.steer_signals():
        if name not in record.signals:
            raise SignalError(f"{name}: not in {record.name}, but in another log; map it in all logs or in none")


def _findings(record: Record, vehicle: Vehicle, settings: CommonSettings) -> list[Finding]:
    """What is implausible in the signals; a SignalError if one is an error and the settings demand the check."""
    findings = check_signals(record, vehicle)
    if settings.check:
        raise_errors(findings)
    return [replace(finding, log=record.name) for finding in findings]


def _without_empty_channels(record: Record) -> Record:
    """The record without the measured channels that have no sample, with a note on each; inputs are checked later."""
    empty = [n for n, values in record.signals.items() if not is_input(n) and not np.isfinite(values).any()]
    if not empty:
        return record
    signals = {name: values for name, values in record.signals.items() if name not in empty}
    notes = [f"{name}: no samples; it counts as absent. Map another column." for name in empty]
    return replace(record, signals=signals, notes=(*record.notes, *notes))
