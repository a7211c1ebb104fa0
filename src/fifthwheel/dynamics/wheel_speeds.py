"""Wheel speed differences, which estimators use in place of the wheel speeds of an axle."""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from fifthwheel._types import Array
from fifthwheel.channels import WHEEL_SPEED, WHEEL_SPEED_DIFFERENCE, SignalName, names_of
from fifthwheel.errors import VehicleError
from fifthwheel.record import Record
from fifthwheel.vehicle import Vehicle

LOWEST_SPEED = 1.0
"""m/s; below it a wheel speed sensor has too few pulses."""


def all_pairs(names: Iterable[str]) -> dict[str, tuple[str, str]]:
    """The wheel speed difference of each axle of which both wheel speeds, left and right, are among the names.

    >>> list(all_pairs(["wheel_speed.dolly.left", "wheel_speed.dolly.right", "wheel_speed.tractor.front.left"]))
    ['wheel_speed_difference.dolly']
    """
    wheels = set(names_of(WHEEL_SPEED, names))
    axles = [name.removesuffix(".left") for name in sorted(wheels) if name.endswith(".left")]
    pairs = {axle.replace(WHEEL_SPEED.quantity, WHEEL_SPEED_DIFFERENCE.quantity, 1): axle for axle in axles}
    return {name: (f"{axle}.left", f"{axle}.right") for name, axle in pairs.items() if f"{axle}.right" in wheels}


def wheel_pairs(vehicle: Vehicle, names: Iterable[str]) -> dict[str, tuple[str, str]]:
    """Those of `all_pairs` that the model of a vehicle has.

    Of the first unit only steered axles count: driven wheels have slip, which a locked differential makes different on
    both sides. None counts where the static axle loads, which the load transfer needs, are not determined.

    >>> from fifthwheel.vehicle import get
    >>> sides = [f"{axle}.{side}" for axle in ("tractor.drive", "semitrailer") for side in ("left", "right")]
    >>> wheel_pairs(get("cheng_cebon_2011"), [f"wheel_speed.{side}" for side in sides])
    {'wheel_speed_difference.semitrailer': ('wheel_speed.semitrailer.left', 'wheel_speed.semitrailer.right')}
    """
    pairs, leading, steered = all_pairs(names), vehicle.units[0].name, vehicle.steer_signals()
    signals = {name: SignalName.of(name) for name in pairs}
    driven = {n for n, signal in signals.items() if signal.unit == leading and f"steer.{signal.place}" not in steered}
    pairs = {name: pair for name, pair in pairs.items() if name not in driven}
    try:
        return pairs if pairs and vehicle.axle_loads() else {}
    except VehicleError:
        return {}


def wheel_speed_difference(left: ArrayLike, right: ArrayLike) -> Array:
    """Right less left wheel speed over their mean, of arrays (N,), m/s; NaN where the wheels hardly turn.

    >>> wheel_speed_difference([20.0, 0.1], [20.2, 0.1]).round(4)
    array([0.01,  nan])
    """
    left, right = np.asarray(left, dtype=np.float64), np.asarray(right, dtype=np.float64)
    mean = (left + right) / 2
    return np.asarray((right - left) / np.where(mean > LOWEST_SPEED, mean, np.nan))


def with_wheel_speed_differences(record: Record, vehicle: Vehicle) -> Record:
    """The record with the differences of `wheel_pairs` that it does not have."""
    wheels = wheel_pairs(vehicle, record.signals)
    pairs = {name: pair for name, pair in wheels.items() if name not in record.signals}
    signals = {name: wheel_speed_difference(*(record.signals[side] for side in pair)) for name, pair in pairs.items()}
    bases = {name: record.time_bases[left] for name, (left, _) in pairs.items() if left in record.time_bases}
    return replace(record.with_signals(signals), time_bases={**record.time_bases, **bases}) if pairs else record
