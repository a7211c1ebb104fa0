"""The observer of a vehicle for a control unit, which has no log yet."""

from collections.abc import Sequence
from typing import Any

from fifthwheel.identify import Identification
from fifthwheel.observe import Observer, ObserverSettings
from fifthwheel.vehicle import Vehicle


def exported_observer(
    vehicle: Vehicle,
    signals: Sequence[str] | None = None,
    identification: Identification | None = None,
    *,
    min_speed: float = 5.0,
    bank: float | None = None,
) -> Observer:
    """The observer that `fifthwheel export` writes.

    Args:
        vehicle: with its numbers.
        signals: that the control unit has; by default those of the identification, without one the speed, every steer
            angle of the vehicle, and the yaw rate and the roll rate of every unit.
        identification: for the sensor errors that its logs share, and the noise. Offsets that belong to one log are
            not used.
        min_speed: see `ObserverSettings`.
        bank: see `ObserverSettings`.

    Raises:
        SignalError: the signals are not sufficient.
        VehicleError: no axle of the vehicle is steerable.
    """
    changes: dict[str, Any] = {"min_speed": min_speed, "bank": bank}
    if identification is not None:
        return Observer(vehicle, signals or identification.signals, identification.observer_settings(**changes))
    rates = [f"{quantity}.{unit.name}" for quantity in ("yaw_rate", "roll_rate") for unit in vehicle.units]
    return Observer(vehicle, signals or ("speed", *vehicle.steer_signals(), *rates), ObserverSettings(**changes))
