"""What a user states with a standard deviation, as estimates under the names that he wrote."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fifthwheel.base.names import NumberedName, split_log
from fifthwheel.base.types import Array
from fifthwheel.data.channels import PLACE_KINDS, SensorErrorName, is_sensor_error
from fifthwheel.data.channels.sensors import SensorPrior
from fifthwheel.estimate.identify.estimates import parts_of, sensor_error_unit
from fifthwheel.estimate.identify.given import with_sensors
from fifthwheel.estimate.identify.one_stage.posterior import ScaledPosterior
from fifthwheel.estimate.identify.result.parts import Estimate
from fifthwheel.estimate.identify.settings import OneStage
from fifthwheel.estimate.identify.setup import Setup
from fifthwheel.estimate.identify.statement import prior_of, states_sigma
from fifthwheel.estimate.identify.unknowns.parameters import path_of_place
from fifthwheel.estimate.identify.unknowns.unknown import Unknown, linear_unknown
from fifthwheel.estimate.identify.verdict import Verdict
from fifthwheel.model.dynamics.unit_equations import BANK
from fifthwheel.truck import changes
from fifthwheel.truck.quantities import BANK_VARIATION, DISCREPANCY, ROAD_BANK, TIME_BASE, quantity_of


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
