"""Wheel speed differences, which estimators and checks use in place of the wheel speeds of an axle."""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from fifthwheel.base.types import Array
from fifthwheel.data.channels import WHEEL_SPEED, WHEEL_SPEED_DIFFERENCE, names_of
from fifthwheel.data.record.record import Record

LOWEST_SPEED = 1.0
"""m/s; below it a wheel speed sensor has too few pulses."""


def sides_of(difference: str) -> tuple[str, str]:
    """The wheel speeds, left and right, of a wheel speed difference.

    >>> sides_of("wheel_speed_difference.dolly")
    ('wheel_speed.dolly.left', 'wheel_speed.dolly.right')
    """
    axle = difference.replace(WHEEL_SPEED_DIFFERENCE.quantity, WHEEL_SPEED.quantity, 1)
    return f"{axle}.left", f"{axle}.right"


def all_pairs(names: Iterable[str]) -> tuple[str, ...]:
    """The wheel speed difference of each axle of which both wheel speeds, left and right, are among the names.

    >>> all_pairs(["wheel_speed.dolly.left", "wheel_speed.dolly.right", "wheel_speed.tractor.front.left"])
    ('wheel_speed_difference.dolly',)
    """
    wheels = set(names_of(WHEEL_SPEED, names))
    axles = [name.removesuffix(".left") for name in sorted(wheels) if name.endswith(".left")]
    differences = [axle.replace(WHEEL_SPEED.quantity, WHEEL_SPEED_DIFFERENCE.quantity, 1) for axle in axles]
    return tuple(name for name in differences if wheels.issuperset(sides_of(name)))


def wheel_speed_difference(left: ArrayLike, right: ArrayLike) -> Array:
    """Right less left wheel speed over their mean, of arrays (N,), m/s; NaN where the wheels hardly turn.

    >>> wheel_speed_difference([20.0, 0.1], [20.2, 0.1]).round(4)
    array([0.01,  nan])
    """
    left, right = np.asarray(left, dtype=np.float64), np.asarray(right, dtype=np.float64)
    mean = (left + right) / 2
    return np.asarray((right - left) / np.where(mean > LOWEST_SPEED, mean, np.nan))


def with_differences(record: Record, names: Iterable[str]) -> Record:
    """The record with those of these wheel speed differences that it does not have."""
    pairs = {name: sides_of(name) for name in names if name not in record.signals}
    signals = {name: wheel_speed_difference(*(record.signals[side] for side in pair)) for name, pair in pairs.items()}
    bases = {name: record.time_bases[left] for name, (left, _) in pairs.items() if left in record.time_bases}
    return replace(record.with_signals(signals), time_bases={**record.time_bases, **bases}) if pairs else record


def sample_with_differences(sample: Mapping[str, float | None], names: Collection[str]) -> Mapping[str, float | None]:
    """A sample, "time" and signals by name, with those of these wheel speed differences that it does not have."""
    differences: dict[str, float | None] = {}
    for name in names:
        if name not in sample:
            left, right = (np.nan if value is None else value for value in map(sample.get, sides_of(name)))
            differences[name] = float(wheel_speed_difference(left, right))
    return {**sample, **differences} if differences else sample
