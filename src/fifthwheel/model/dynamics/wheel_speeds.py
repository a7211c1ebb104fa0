"""The wheel speed differences that the model of a vehicle has."""

from collections.abc import Iterable

from fifthwheel.base.errors import VehicleError
from fifthwheel.data.channels import SignalName
from fifthwheel.data.record import Record
from fifthwheel.data.record.derived import all_pairs, with_differences
from fifthwheel.truck import Vehicle


def wheel_pairs(vehicle: Vehicle, names: Iterable[str]) -> tuple[str, ...]:
    """Those of `all_pairs` that the model of a vehicle has.

    Of the first unit only steered axles count: driven wheels have slip, which a locked differential makes different on
    both sides. None counts where the static axle loads, which the load transfer needs, are not determined.

    >>> from fifthwheel.truck import get
    >>> sides = [f"{axle}.{side}" for axle in ("tractor.drive", "semitrailer") for side in ("left", "right")]
    >>> wheel_pairs(get("cheng_cebon_2011"), [f"wheel_speed.{side}" for side in sides])
    ('wheel_speed_difference.semitrailer',)
    """
    leading, steered = vehicle.units[0].name, vehicle.steer_signals()
    signals = {name: SignalName.of(name) for name in all_pairs(names)}
    pairs = tuple(n for n, each in signals.items() if each.unit != leading or f"steer.{each.place}" in steered)
    try:
        return pairs if pairs and vehicle.axle_loads() else ()
    except VehicleError:
        return ()


def with_wheel_speed_differences(record: Record, vehicle: Vehicle) -> Record:
    """The record with the differences of `wheel_pairs` that it does not have."""
    return with_differences(record, wheel_pairs(vehicle, record.signals))
