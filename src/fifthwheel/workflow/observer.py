"""The observer of a vehicle for a control unit, which has no log yet."""

from collections.abc import Sequence
from typing import Any

from fifthwheel.errors import SignalError, VehicleError, suggestion
from fifthwheel.identify import Identification
from fifthwheel.observe import Observer, ObserverSettings
from fifthwheel.vehicle import Vehicle


def exported_observer(
    vehicle: Vehicle,
    signals: Sequence[str] | None = None,
    identification: Identification | None = None,
    *,
    min_speed: float = 5.0,
    estimate_bank: bool = False,
) -> Observer:
    """The observer that `fifthwheel export` writes.

    Args:
        vehicle: with its numbers.
        signals: that the control unit has; by default those of the identification, without one the speed, every steer
            angle of the vehicle, and the yaw rate and the roll rate of every unit.
        identification: for the sensor errors that its logs share, and the noise. Offsets that belong to one log are
            not used.
        min_speed: see `ObserverSettings`.
        estimate_bank: see `ObserverSettings`.

    Raises:
        SignalError: the signals are not sufficient, or an observer of the vehicle does not use one of them.
        VehicleError: no axle of the vehicle is steerable, or the identification is of another vehicle.
    """
    if identification is not None and identification.vehicle.parameters().keys() != vehicle.parameters().keys():
        raise VehicleError(
            f"{vehicle.name}: its units or axles are not those of the identification, which is of "
            f"{identification.vehicle.name}; give the vehicle.toml of the same result"
        )
    changes: dict[str, Any] = {"min_speed": min_speed, "estimate_bank": estimate_bank}
    if identification is not None:
        observer = Observer(vehicle, signals or identification.signals, identification.observer_settings(**changes))
    else:
        rates = [f"{quantity}.{unit.name}" for quantity in ("yaw_rate", "roll_rate") for unit in vehicle.units]
        signals = signals or ("speed", *vehicle.steer_signals(), *rates)
        observer = Observer(vehicle, signals, ObserverSettings(**changes))
    known = {*observer.inputs, *observer.outputs}
    for name in signals or ():
        if name not in known:
            raise SignalError(f"{name}: no signal that an observer of {vehicle.name} uses; {suggestion(name, known)}")
    return observer
