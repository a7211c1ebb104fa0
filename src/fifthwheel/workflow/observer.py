"""The observer of a vehicle for a control unit, which has no log yet."""

from collections.abc import Sequence

from fifthwheel.identify.result import sensor_settings
from fifthwheel.observe import Observer, ObserverSettings
from fifthwheel.vehicle import Vehicle
from fifthwheel.workflow.stored_identification import StoredIdentification


def exported_observer(
    vehicle: Vehicle,
    signals: Sequence[str] | None = None,
    identification: StoredIdentification | None = None,
    *,
    min_speed: float = 5.0,
    bank: float | None = None,
) -> Observer:
    """The observer that `fifthwheel export` writes.

    Args:
        vehicle: with its numbers.
        signals: that the control unit has; by default the speed, every steer angle of the vehicle, and the yaw rate and
            the roll rate of every unit.
        identification: for the sensor errors that its logs share, and the noise. Offsets that belong to one log are
            not used.
        min_speed: see `ObserverSettings`.
        bank: see `ObserverSettings`.

    Raises:
        SignalError: the signals are not sufficient.
        VehicleError: no axle of the vehicle is steerable.
    """
    if not signals:
        rates = [f"{quantity}.{unit.name}" for quantity in ("yaw_rate", "roll_rate") for unit in vehicle.units]
        signals = ("speed", *vehicle.steer_signals(), *rates)
    sensors = {} if identification is None else sensor_settings(identification.contents, None)
    return Observer(vehicle, signals, ObserverSettings(**sensors, min_speed=min_speed, bank=bank))
