"""Builders of the parts of a result: estimates of parameters and derived quantities, sensor errors, log summaries, and
what a user states with a standard deviation, under the names that he wrote.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fifthwheel.base.errors import SignalError, VehicleError
from fifthwheel.base.names import PAYLOAD_HEIGHT, NumberedName, ParameterPath, ends_with, split_log
from fifthwheel.base.types import Array
from fifthwheel.data.channels import PLACE_KINDS, SensorErrorName, is_sensor_error
from fifthwheel.data.channels.sensors import SensorPrior
from fifthwheel.data.record import Record
from fifthwheel.estimate.identify.dataset import LogData, measured_columns
from fifthwheel.estimate.identify.given import with_sensors
from fifthwheel.estimate.identify.one_stage.posterior import ScaledPosterior
from fifthwheel.estimate.identify.result.parts import Estimate, LogSummary, SensorError
from fifthwheel.estimate.identify.settings import OneStage
from fifthwheel.estimate.identify.setup import Setup
from fifthwheel.estimate.identify.statement import prior_of, states_sigma
from fifthwheel.estimate.identify.unknowns.parameters import path_of_place
from fifthwheel.estimate.identify.unknowns.unknown import Unknown, linear_unknown
from fifthwheel.estimate.identify.verdict import Verdict
from fifthwheel.estimate.observe.uncertainty import Uncertainty
from fifthwheel.model.dynamics.unit_equations import BANK
from fifthwheel.truck import Vehicle, changes, unit_of
from fifthwheel.truck.quantities import BANK_VARIATION, DISCREPANCY, ROAD_BANK, TIME_BASE, quantity_of

DERIVED_UNITS = {"cog_height": "m", "roll_inertia": "kg m^2"}
"""SI unit of each derived quantity of a laden body, equations (8) and (9) of the article."""
DETERMINED = 0.5
"""A length is a result where the logs leave at most this fraction of its prior standard deviation."""


def parameter_estimate(unknown: Unknown, value: float, sigma_z: float, verdict: Verdict, **others: Any) -> Estimate:
    """The estimate of an unknown parameter: value in SI, sigma_z in units of the prior.

    `others` are further fields of `Estimate`; by default the initial value is the prior mean and the stage is 1.
    """
    return Estimate(
        name=unknown.name,
        value=value,
        sigma=unknown.sigma(value, sigma_z),
        unit=unit_of(unknown.name),
        verdict=verdict,
        prior=unknown.prior_sigma,
        **{"initial": unknown.centre, "stage": 1, **others},
    )


def fixed_estimate(name: str, value: float, verdict: Verdict = Verdict.FIXED, *, stage: int = 1) -> Estimate:
    """The estimate of a parameter that keeps the value of the vehicle file and has no sigma."""
    return Estimate(name=name, value=value, sigma=None, unit=unit_of(name), initial=value, verdict=verdict, stage=stage)


def derived_from_payload_height(vehicle: Vehicle, estimates: Sequence[Estimate]) -> list[Estimate]:
    """Laden CoG height (8) and roll inertia (9) of every unit with an estimated payload height.

    Each sigma is that of the payload height times the derivative, by forward differences.
    """
    derived, step = [], 1e-4
    for height in (e for e in estimates if ends_with(e.name, PAYLOAD_HEIGHT)):
        initial, higher = (vehicle.replace({height.name: v}) for v in (height.initial, height.value + step))
        for quantity in DERIVED_UNITS:
            name = f"{height.path.unit}.{quantity}"
            slope = (higher.derived()[name] - vehicle.derived()[name]) / step
            sigma = None if height.sigma is None else abs(slope) * height.sigma
            estimate = _derived(name, initial, vehicle, sigma, height.verdict)
            derived.append(replace(estimate, settling_time=height.settling_time))
    return derived


def _derived(
    name: str, initial_vehicle: Vehicle, vehicle: Vehicle, sigma: float | None, verdict: Verdict, *, stage: int = 2
) -> Estimate:
    """The estimate of a quantity that follows from the parameters."""
    return Estimate(
        name=name,
        value=vehicle.derived()[name],
        sigma=sigma,
        unit=DERIVED_UNITS.get(ParameterPath.of(name).quantity, "m"),
        initial=initial_vehicle.derived()[name],
        verdict=verdict,
        stage=stage,
    )


def derived_from_covariance(
    initial_vehicle: Vehicle, vehicle: Vehicle, estimates: Sequence[Estimate], uncertainty: Uncertainty
) -> list[Estimate]:
    """Laden CoG height (8) and roll inertia (9) of every unit of which a body parameter is estimated.

    Each sigma is sqrt(g P g'), with P the joint covariance and g the derivative with respect to all its parameters. The
    verdict is the worst of the parameters on which the quantity depends.
    """
    slopes, derived = _derived_slopes(vehicle, uncertainty.names), []
    for unit in vehicle.units:
        body = [e for e in estimates if e.name in uncertainty.names and _is_body_parameter(e.name, unit.name)]
        if not body:
            continue
        for quantity in DERIVED_UNITS:
            name = f"{unit.name}.{quantity}"
            row = np.array([slopes[n].get(name, 0.0) if n in slopes else 0.0 for n in uncertainty.names])
            relevant = [e for e in body if row[uncertainty.names.index(e.name)]]
            worst = max(relevant, key=lambda e: e.verdict != Verdict.CONVERGED, default=None)
            sigma = float(np.sqrt(row @ uncertainty.covariance @ row)) if row.any() else None
            derived.append(_derived(name, initial_vehicle, vehicle, sigma, worst.verdict if worst else Verdict.FIXED))
    return derived


def parts_of(vehicle: Vehicle, name: str) -> dict[str, float]:
    """The parameters of the model, with factors, whose sum is a number of the vehicle file or a wheelbase."""
    for unit, coupling in zip(vehicle.units[1:], vehicle.couplings, strict=True):
        if name == f"{unit.name}.wheelbase":
            axles = {f"{unit.name}.{axle.name}.position": -1 / len(unit.on_road) for axle in unit.on_road}
            return {f"{coupling.name}.trailing_position": 1.0} | axles
    return {name: 1.0}


def wheelbases(
    initial_vehicle: Vehicle, vehicle: Vehicle, uncertainty: Uncertainty, remaining: Mapping[str, float]
) -> list[Estimate]:
    """Distance from the front coupling to the mean axle of every unit whose axle positions the logs determine.

    `remaining` are the fractions of prior standard deviations that remain, by unknown; at most `DETERMINED`.
    """
    derived = []
    for unit in vehicle.units[1:]:
        if remaining.get(f"{unit.name}.axle_positions", 1.0) > DETERMINED:
            continue
        slopes = parts_of(vehicle, name := f"{unit.name}.wheelbase")
        row = np.array([slopes.get(n, 0.0) for n in uncertainty.names])
        sigma = float(np.sqrt(row @ uncertainty.covariance @ row))
        derived.append(_derived(name, initial_vehicle, vehicle, sigma, Verdict.CONVERGED, stage=1))
    return derived


def _is_body_parameter(name: str, unit: str) -> bool:
    path = ParameterPath.of(name)
    return path.unit == unit and (
        ends_with(name, PAYLOAD_HEIGHT) or (path.component == "sprung" and path.quantity in DERIVED_UNITS)
    )


def _derived_slopes(vehicle: Vehicle, names: Sequence[str]) -> dict[str, dict[str, float]]:
    """Derivatives of all derived quantities with respect to each named parameter above 0, by central differences, or
    one-sided ones at the limit of what is possible, such as a payload that is as heavy as its unit allows."""
    values = vehicle.parameters()
    slopes = {}
    for name in names:
        if name in values and values[name] > 0:
            (high, higher), (low, lower) = (
                _derived_at(vehicle, name, factor * values[name]) for factor in (1e-4, -1e-4)
            )
            slopes[name] = {key: (higher[key] - lower[key]) / (high - low) for key in higher} if high > low else {}
    return slopes


def _derived_at(vehicle: Vehicle, name: str, step: float) -> tuple[float, dict[str, float]]:
    """Value of a parameter after a step, and the derived quantities there; without the step if it is impossible."""
    value = vehicle.parameters()[name]
    try:
        return value + step, vehicle.replace({name: value + step}).derived()
    except VehicleError:
        return value, vehicle.derived()


def sensor_error_estimates(
    unknowns: Sequence[Unknown], logs: Sequence[LogData], shared: Mapping[str, float], sigma_z: Mapping[str, float]
) -> list[SensorError]:
    """The sensor errors among the unknowns, in their order; those that belong to a log once for each log.

    `shared` are the values of those that all logs share, SI; `sigma_z` is in units of the prior, of log i by "name@i".
    """
    errors = []
    for u in unknowns:
        if not u.is_sensor_error:
            continue
        of_logs = [(log.name, log.errors.get(u.name, u.centre), f"{u.name}@{i}") for i, log in enumerate(logs)]
        for log, value, key in of_logs if u.per_log else [(None, shared[u.name], u.name)]:
            sigma = sigma_z[key] * u.scale
            errors.append(SensorError(name=u.name, value=value, sigma=sigma, unit=sensor_error_unit(u.name), log=log))
    return errors


def sensor_error_unit(name: str) -> str:
    """SI unit of a sensor error."""
    error = SensorErrorName.of(name)
    unit = error.unit if error else None
    if unit is None:
        raise SignalError(f"{name}: expected the name of a sensor error, such as yaw_rate.tractor.offset")
    return unit


def log_summary(record: Record, log: LogData, outputs: Sequence[str], accepted: Array) -> LogSummary:
    """What was used of a record: `accepted` (N, m) is 1 where a sample of a channel was used."""
    present = np.concatenate([np.isfinite(measured_columns(segment, outputs)) for segment in log.segments])
    rejected = 1 - accepted.sum(axis=0) / np.maximum(present.sum(axis=0), 1)
    measured = [name for name in outputs if name in record.signals]
    return LogSummary(
        name=record.name,
        span=record.span,
        samples=len(record),
        averaged=log.samples_per_row,
        used=sum(s.span[1] - s.span[0] for s in log.segments),
        speed=log.speeds,
        rejected={
            n: float(r) + log.left_out.get(n, 0.0) for n, r in zip(outputs, rejected, strict=True) if n in measured
        },
        noise={name: log.sample_variance(name) for name in measured},
        notes=record.notes,
    )


def used_signals(vehicle: Vehicle, logs: Sequence[LogSummary]) -> tuple[str, ...]:
    """Inputs of the vehicle, steered as logged, and measured signals of the logs."""
    return ("speed", *vehicle.steer_signals(), *dict.fromkeys(name for log in logs for name in log.noise))


@dataclass(frozen=True, kw_only=True)
class _Number:
    """A number that is stated."""

    mean: float
    sigma: float
    slopes: tuple[tuple[Unknown, int, float], ...] = ()
    """The unknowns that change it, their places in z, and its derivatives with respect to their values."""

    def row(self, z: Array) -> Array:
        """Its derivative (k,) with respect to z."""
        row = np.zeros(len(z))
        for u, i, slope in self.slopes:
            row[i] = slope * u.slope(u.centre + u.change(z[i]))
        return row

    def value(self, z: Array) -> float:
        return self.mean + float(sum(slope * u.change(z[i]) for u, i, slope in self.slopes))


def stated_estimates(
    setup: Setup, posterior: ScaledPosterior, z: Array, logs: Sequence[str], sensors: Mapping[str, SensorPrior]
) -> Iterator[Estimate]:
    """What vehicle file and settings state with a standard deviation, by its name, without the estimated parameters.

    z (k,) are the unknowns of the posterior, in units of the prior. What the logs do not determine is STATED; what no
    unknown changes keeps its prior. What the logs state of their `sensors` is not listed.
    """
    for name, number in _numbers(setup, posterior.names, logs, sensors).items():
        base, _ = split_log(name)
        if base in setup.estimated or not number.sigma:
            continue
        row = number.row(z)
        sigma = float(np.sqrt(row @ posterior.covariance @ row)) if row.any() else number.sigma
        yield Estimate(
            name=name,
            value=number.value(z),
            sigma=sigma,
            unit=sensor_error_unit(base) if is_sensor_error(base) else quantity_of(base).unit,
            initial=number.mean,
            verdict=Verdict.CONVERGED if sigma < setup.settings.excited * number.sigma else Verdict.STATED,
            stage=1,
            prior=number.sigma,
        )


def _numbers(
    setup: Setup, names: Sequence[str], logs: Sequence[str], sensors: Mapping[str, SensorPrior]
) -> dict[str, _Number]:
    """The stated numbers by name."""
    vehicle, of_sensors = setup.vehicle, with_sensors(setup.vehicle, OneStage(), sensors).given
    given = {name: text for name, text in setup.settings.given.items() if of_sensors.get(name) != text}
    unknowns = {u.name: u for u in setup.unknowns} | {BANK: linear_unknown(ROAD_BANK, 0.0, setup.bank_sigma)}
    found = [(i, n, unknowns[n.base]) for i, n in enumerate(map(NumberedName.of, names)) if n.base in unknowns]
    numbers = _of_vehicle(setup, given, [(i, u) for i, n, u in found if n.log is None])
    of_changes = {change.name for change in changes(vehicle)}
    for i, numbered, u in found:
        error = SensorErrorName.of(u.name)
        path = path_of_place(vehicle, error) if error and error.kind in PLACE_KINDS else ""
        log = numbered.log if len(logs) > 1 else None
        name = u.name if log is None else f"{u.name}@{logs[log]}"
        if path in numbers or (name not in numbers and name not in of_changes and states_sigma(given, u.name)):
            numbers[path or name] = _Number(mean=u.centre, sigma=u.prior_sigma, slopes=((u, i, 1.0),))
    for name in (ROAD_BANK, BANK_VARIATION, DISCREPANCY, *[n for n in given if n.startswith(f"{TIME_BASE}.")]):
        if name not in numbers and states_sigma(given, name):
            mean, sigma = prior_of(given, name)
            numbers[name] = _Number(mean=mean, sigma=sigma)
    return numbers


def _of_vehicle(
    setup: Setup, given: Mapping[str, str | float], unknowns: Sequence[tuple[int, Unknown]]
) -> dict[str, _Number]:
    """Those of the vehicle file, and stated wheelbases."""
    vehicle, numbers = setup.vehicle, {}
    lengths = [name for name in vehicle.moved_by_wheelbase() if states_sigma(given, name)]
    in_file = [path for path, sigma in vehicle.stated.items() if sigma and path not in vehicle.assumed]
    values = vehicle.derived() | vehicle.parameters()
    for name in (*lengths, *in_file):
        parts = parts_of(vehicle, name).items()
        slopes = [(u, i, sum(c * u.slopes.get(path, 0.0) for path, c in parts)) for i, u in unknowns]
        sigma = vehicle.stated.get(name) or math.hypot(*(slope * u.prior_sigma for u, _, slope in slopes))
        numbers[name] = _Number(mean=values[name], sigma=sigma, slopes=tuple(slopes))
    return numbers
