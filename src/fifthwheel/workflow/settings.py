"""Settings of the one-stage method from the choices that a user makes parameter by parameter."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import Any

from fifthwheel.errors import SignalError
from fifthwheel.identify import OneStage
from fifthwheel.identify.parameters import estimated_parameters
from fifthwheel.vehicle import Vehicle

SENSOR_PRIORS: Mapping[str, str] = MappingProxyType(
    {
        "steer_offset": "rad",
        "steer_gain": "1",
        "steer_delay": "s",
        "steer_play": "rad",
        "rate_offset": "rad/s",
        "rate_gain": "1",
        "misalignment": "rad",
        "time_base_delay": "s",
        "articulation_offset": "rad",
        "acceleration_offset": "m/s^2",
        "acceleration_gain": "1",
        "acceleration_delay": "s",
        "accelerometer_position": "m",
        "accelerometer_height": "m",
        "bank": "rad",
    }
)
"""Sensor errors, and the bank of the road, whose prior sigma can be chosen, with the SI unit."""

_NONE: Mapping[str, float] = MappingProxyType({})


def one_stage_settings(
    vehicle: Vehicle,
    *,
    fix: Sequence[str] = (),
    free: Sequence[str] = (),
    prior: Mapping[str, float] = _NONE,
    consider: Mapping[str, float] = _NONE,
    any_load: bool = False,
    sensors: Mapping[str, float] = _NONE,
    base: OneStage | None = None,
) -> OneStage:
    """Settings of the one-stage method; a choice for a name replaces the default for the same name.

    Args:
        vehicle: the vehicle to identify.
        fix: parameters that keep their value and count as exact.
        free: parameters to estimate in addition to the usual ones.
        prior: prior sigma as a fraction of the value, for parameters to estimate in addition; 0 for exact.
        consider: the same for parameters to consider.
        any_load: estimate CoG height and roll inertia of the laden body separately.
        sensors: prior sigma in SI by the names of `SENSOR_PRIORS`.
        base: settings to start from, by default `OneStage()`.

    Raises:
        SignalError: a sensor prior of another name, or one that is not above 0.
        VehicleError: a parameter that does not exist.
    """
    base = base or OneStage()
    for name, sigma in sensors.items():
        if name not in SENSOR_PRIORS:
            raise SignalError(f"{name}: not a sensor error with a prior; expected one of {', '.join(SENSOR_PRIORS)}")
        if not 0 < sigma < math.inf:
            raise SignalError(f"{name}: expected a prior sigma above 0, got {sigma:g} {SENSOR_PRIORS[name]}")
    sensor_priors: dict[str, Any] = {f"{name}_prior": sigma for name, sigma in sensors.items()}
    uniform = base.uniform_payload and not any_load
    chosen = replace(base, fixed=(*base.fixed, *fix), uniform_payload=uniform, **sensor_priors)
    usual = estimated_parameters(vehicle.lumped() if any_load else vehicle, chosen)
    priors = {name: sigma for name, sigma in {**base.priors, **prior}.items() if name not in consider}
    considered = {name: sigma for name, sigma in base.consider.items() if name not in prior} | dict(consider)
    return replace(
        chosen,
        free=(*usual, *free) if free else base.free,
        priors={name: sigma for name, sigma in priors.items() if sigma},
        consider={name: sigma for name, sigma in considered.items() if sigma},
    )
