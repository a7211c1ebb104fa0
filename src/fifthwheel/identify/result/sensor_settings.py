"""What an observer takes from an identification: sensor errors, noise, and friction and bank of the road."""

import math
from typing import Any

from fifthwheel.channels import LATERAL_ACCELERATION, STEER, Channel, is_of, is_sensor_error
from fifthwheel.filters.initial_state import INITIAL_SIGMA
from fifthwheel.identify.result.parts import IdentificationData
from fifthwheel.identify.settings import OneStage
from fifthwheel.identify.unknowns.parameters import TIME_BASE
from fifthwheel.observe import ObserverSettings
from fifthwheel.options import FRICTION_RANGE
from fifthwheel.vehicle.parameters import FRICTION


def sensor_settings(identification: IdentificationData, log: str | None) -> dict[str, Any]:
    """`Identification.sensor_settings`."""
    sensors = [error for error in identification.sensors if not error.name.startswith(f"{TIME_BASE}.")]
    errors = {error.name: error.value for error in sensors if error.log in (None, log)}
    noise = next(
        (summary.noise for summary in identification.logs if summary.name == log), identification.logs[0].noise
    )
    return {"sensor_errors": errors, "noise": noise, "friction": friction(identification)} | _uncertainties(
        identification, log
    )


def friction(identification: IdentificationData) -> float | None:
    """Peak friction of the road; None with linear tyres.

    Logs that use little of the friction do not limit it upwards. An observer gets the nearest friction that a road has.
    """
    settings = identification.settings
    if not isinstance(settings, OneStage) or settings.tyre_law == "linear":
        return None
    estimated = next((e.value for e in identification.parameters if e.name == FRICTION), settings.friction)
    return min(max(estimated, FRICTION_RANGE[0]), FRICTION_RANGE[1])


def _uncertainties(identification: IdentificationData, log: str | None) -> dict[str, float]:
    """Mean and sigma of the bank, and sigmas of the offsets, as arguments of `ObserverSettings`.

    If there is a joint covariance, it contains the offsets of a log, so that they are exact for the observer of that
    log.
    """
    settings = identification.settings
    if not settings.nuisances:
        return {"bank": 0.0, "steer_offset": 0.0, "acceleration_offset": 0.0}
    prior = getattr(settings, "bank_prior", INITIAL_SIGMA["bank"])
    estimates = [each.bank for each in identification.logs if each.name == log and each.bank]
    variation = getattr(settings, "consider", {}).get("bank_variation", 0.0)
    mean, bank = (estimates[0][0], math.hypot(estimates[0][1], variation)) if estimates else (0.0, prior)
    own = [error for error in identification.sensors if error.log is not None and error.log == log]

    def offset(channel: Channel, prior: float) -> float:
        offsets = [error for error in own if is_sensor_error(error.name, "offset")]
        sigmas = [error.sigma for error in offsets if is_of(error.name, channel)]
        known = identification.covariance is not None and sigmas
        return 0.0 if known else max(sigmas, default=prior)

    acceleration = getattr(settings, "acceleration_offset_prior", ObserverSettings.acceleration_offset)
    return {
        "bank_mean": mean,
        "bank": bank,
        "steer_offset": offset(STEER, settings.steer_offset_prior),
        "acceleration_offset": offset(LATERAL_ACCELERATION, acceleration),
    }
