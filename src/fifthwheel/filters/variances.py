"""Default variances of process and measurement noise, by quantity, for any chain of units."""

from collections.abc import Mapping, Sequence

import numpy as np

from fifthwheel._types import Array
from fifthwheel.channels import CHANNELS, SignalName, channel_of
from fifthwheel.errors import SignalError
from fifthwheel.vehicle import Vehicle

PROCESS_VARIANCE = {quantity: channel.state.process for quantity, channel in CHANNELS.items() if channel.state}
"""Process noise of each state per second, SI squared, for the estimation of parameters."""
OBSERVER_PROCESS_VARIANCE = {q: channel.state.observer_process for q, channel in CHANNELS.items() if channel.state}
"""Process noise of each state per second, SI squared, for the observation of states."""


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
    """Q per second (n, n), diagonal: a factor times the variances per second of a table, by quantity."""
    return np.diag([factor * table[SignalName.of(name).quantity] for name in states])
