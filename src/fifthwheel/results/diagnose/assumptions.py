"""The numbers that a vehicle file does not have, and how much they matter."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from fifthwheel.base.errors import VehicleError
from fifthwheel.base.types import Array
from fifthwheel.data.record import Record
from fifthwheel.model import dynamics
from fifthwheel.model.dynamics.simulation import free_response
from fifthwheel.model.simulate import simulate
from fifthwheel.truck import Vehicle, changes


@dataclass(frozen=True, kw_only=True)
class AssumedNumber:
    """A number of a vehicle that its file does not have."""

    path: str
    value: float
    """SI."""
    sigma: float | None
    """Standard deviation, SI; None where it follows from other numbers."""
    source: str
    yaw: float | None
    """Largest change of a unit's yaw rate in a lane change by one sigma, as a fraction of its rms value; None where the
    vehicle has no such run, or the number no sigma."""
    roll: float | None
    """The same for the roll rates."""


def assumed_numbers(vehicle: Vehicle, speed: float = 80 / 3.6) -> tuple[AssumedNumber, ...]:
    """The assumed numbers of a vehicle, those with the largest effect on a lane change at `speed`, m/s, first.

    The steer angles are those of the vehicle as it is, so a change shows what a log would show.
    """
    values = vehicle.parameters()
    effects = _effects(vehicle, speed)
    numbers = [
        AssumedNumber(
            path=path,
            value=values[path],
            sigma=vehicle.stated.get(path),
            source=source,
            yaw=effects.get(path, {}).get("yaw_rate"),
            roll=effects.get(path, {}).get("roll_rate"),
        )
        for path, source in vehicle.assumed.items()
    ]
    return tuple(sorted(numbers, key=lambda number: -max(number.yaw or 0.0, number.roll or 0.0)))


def _effects(vehicle: Vehicle, speed: float) -> dict[str, dict[str, float]]:
    """Relative change of each quantity by one sigma of each assumed number."""
    try:
        record = simulate(vehicle, count=1, speed=speed)
    except VehicleError:  # unstable at this speed
        return {}
    base = _response(vehicle, record)
    effects = {}
    for change in changes(vehicle):
        if change.name in vehicle.assumed:
            values = vehicle.parameters()
            changed = {path: values[path] + slope for path, slope in change.slopes.items()}
            try:
                response = _response(vehicle.replace(changed), record)
            except VehicleError:  # such as a CoG behind the axles
                continue
            ratios = {name: _rms(response[name] - y) / _rms(y) for name, y in base.items()}
            effects[change.name] = {
                quantity: max(ratio for name, ratio in ratios.items() if name.startswith(quantity))
                for quantity in ("yaw_rate", "roll_rate")
            }
    return effects


def _response(vehicle: Vehicle, record: Record) -> Mapping[str, Array]:
    outputs = [f"{quantity}.{unit.name}" for unit in vehicle.units for quantity in ("yaw_rate", "roll_rate")]
    steered = vehicle.with_logged_steering(record.signals, record.name)
    model = dynamics.model(steered, outputs, roll=True)
    _, y = free_response(model, dynamics.all_parameters(steered, outputs), record.time, record.signals)
    return dict(zip(outputs, y.T, strict=True))


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))
