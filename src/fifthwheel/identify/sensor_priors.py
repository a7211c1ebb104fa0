"""Priors of sensor errors that the signal map states, as settings of an identification."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

from fifthwheel.channels import SignalName, error_kinds
from fifthwheel.channels.sensors import SensorPrior
from fifthwheel.errors import SignalError
from fifthwheel.identify.settings import OneStage
from fifthwheel.identify.unknowns.parameters import default_prior
from fifthwheel.record import Record
from fifthwheel.vehicle import Vehicle


def common_sensors(records: Sequence[Record]) -> dict[str, SensorPrior]:
    """What the records state of the sensors of a vehicle, by signal.

    Raises:
        SignalError: two records with the same signal state different things of its sensor.
    """
    found: dict[str, tuple[str, SensorPrior]] = {}
    for record in records:
        for signal in record.signals:
            sensor = record.sensors.get(signal, SensorPrior())
            other, first = found.setdefault(signal, (record.name, sensor))
            if sensor != first:
                raise SignalError(
                    f"{signal}: expected one sensor in all logs, got {first} in {other}, and {sensor} in "
                    f"{record.name}; read the logs with the same signals.toml"
                )
    return {signal: sensor for signal, (_, sensor) in found.items() if sensor != SensorPrior()}


def with_sensors(vehicle: Vehicle, settings: OneStage, sensors: Mapping[str, SensorPrior]) -> OneStage:
    """The settings with the priors and the noise of sensors.

    What the settings state of a single error comes first, then what is stated of the sensor, then its class, then the
    prior of all sensors of a kind. A class does not replace such a prior that the settings have changed.
    """
    priors: dict[str, tuple[float, float]] = {}
    noise: dict[str, float] = {}
    units, defaults = {unit.name for unit in vehicle.units}, OneStage()
    for signal, sensor in sensors.items():
        if not SignalName.of(signal).fits(units):  # no model has it; it is refused later
            continue
        for kind in error_kinds(signal):
            name = f"{signal}.{kind}"
            default = default_prior(vehicle, name, settings) or (0.0, 0.0)
            usual = sensor.usual_sigma(signal, kind) if default == default_prior(vehicle, name, defaults) else None
            if usual is not None or kind in sensor.errors:
                mean, sigma = sensor.errors.get(kind, (default[0], None))
                usual = default[1] if usual is None else usual
                priors[name] = mean, usual if sigma is None else sigma
        if deviation := sensor.noise or sensor.usual_sigma(signal, "noise"):
            noise[signal] = deviation**2
    return replace(settings, stated_priors={**priors, **settings.stated_priors}, noise={**noise, **settings.noise})
