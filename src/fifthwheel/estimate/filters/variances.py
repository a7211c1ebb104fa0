"""Default variances of process and measurement noise, by quantity, for any chain of units."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Annotated

import numpy as np
from pydantic import AfterValidator

from fifthwheel.base.errors import SignalError, suggestion
from fifthwheel.base.settings import Cure, FinitePositive
from fifthwheel.base.types import Array
from fifthwheel.data.channels import CHANNELS, SignalName, channel_of, checked_name
from fifthwheel.truck import Vehicle

PROCESS_VARIANCE = {quantity: channel.state.process for quantity, channel in CHANNELS.items() if channel.state}
"""Process noise of each state per second, SI squared, for the estimation of parameters."""
PROCESS_VARIANCE["bank"] = 0.002**2  # what the bank of the road gains in one second
OBSERVER_PROCESS_VARIANCE = {q: channel.state.observer_process for q, channel in CHANNELS.items() if channel.state}
"""Process noise of each state per second, SI squared, for the observation of states."""


Variances = Annotated[
    Mapping[Annotated[str, AfterValidator(checked_name)], FinitePositive], Cure("give the noise variance in SI")
]
"""Noise variances by signal, SI squared; the type of a setting."""


def require_units(vehicle: Vehicle, noise: Iterable[str]) -> None:
    """Refuse noise of signals whose unit the vehicle does not have.

    Raises:
        SignalError: there is such a signal.
    """
    units = [unit.name for unit in vehicle.units]
    for name in noise:
        unit = SignalName.of(name).unit
        if unit and unit not in units:
            raise SignalError(f"noise, {name}: {vehicle.name} has no unit {unit!r}; {suggestion(unit, units)}")


def sensor_variance(vehicle: Vehicle, name: str, given: Mapping[str, float]) -> float:
    """Variance of a sensor's noise, SI squared: as given, by signal, else that of the article's gyros, else a default.

    The gyros of the first unit of a vehicle have other variances.
    """
    if name in given:
        return given[name]
    channel = channel_of(name)
    if channel is None or channel.noise is None:
        raise SignalError(f"{name}: no sensor measures it; give its noise variance")
    return channel.noise[0 if SignalName.of(name).unit == vehicle.units[0].name else 1]


def process_covariance(states: Sequence[str], table: Mapping[str, float], factor: float = 1.0) -> Array:
    """Q per second (n, n), diagonal: a factor times the variances per second of a table, by quantity.

    A user's own states, which no table has, follow their equations exactly.
    """
    return np.diag([factor * table.get(SignalName.of(name).quantity, 0.0) for name in states])
