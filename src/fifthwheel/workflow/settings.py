"""Settings of an identification from the choices that a user makes."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import Any

from fifthwheel.channels import sensor_error_settings
from fifthwheel.cheng_cebon_2011 import TwoStage, article
from fifthwheel.errors import FifthwheelError, SignalError, VehicleError
from fifthwheel.identify import CommonSettings, Identification, OneStage
from fifthwheel.identify.settings import MODEL_ERRORS
from fifthwheel.identify.suspension import with_suspension
from fifthwheel.identify.unknowns.parameters import estimated_parameters, expand_names
from fifthwheel.options import IdentifyOptions
from fifthwheel.settings import options_of
from fifthwheel.units import quantity
from fifthwheel.vehicle import Vehicle

SENSOR_PRIORS: Mapping[str, str] = sensor_error_settings() | {"time_base_delay": "s", "bank": "rad"}
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
        VehicleError: a parameter that does not exist, or an estimated one that is considered with a sigma of 0.
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
    identified = vehicle.lumped() if any_load else vehicle
    usual = estimated_parameters(identified, chosen)
    for name in (name for name, sigma in consider.items() if not sigma and name not in base.consider):
        paths = expand_names(identified, [name], chosen)
        if paths and all(path in usual for path in paths):
            raise VehicleError(f"{name}: is estimated; if it is exactly known, fix it (--fix {name})")
    priors = {name: sigma for name, sigma in {**base.priors, **prior}.items() if name not in consider}
    considered = {name: sigma for name, sigma in base.consider.items() if name not in prior} | dict(consider)
    return replace(
        chosen,
        free=(*usual, *free) if free else base.free,
        priors={name: sigma for name, sigma in priors.items() if sigma},
        consider={name: sigma for name, sigma in considered.items() if sigma},
    )


def identification_settings(
    vehicle: Vehicle, chosen: IdentifyOptions, suspension: Identification | None = None
) -> tuple[Vehicle, CommonSettings]:
    """Vehicle and settings of an identification.

    Args:
        chosen: what a user chooses.
        suspension: identification of the same truck whose suspension the vehicle gets; default: that of the options.

    Raises:
        FifthwheelError: a text that is not NAME=FRACTION or NAME=SIGMA, or an option of another method.
        SignalError: `suspension` is not an identification in one stage.
        VehicleError: a parameter that does not exist, or `suspension` is of another vehicle.
    """
    one_stage = chosen.method == "one-stage"
    for name in ("passes",) if one_stage else _ONE_STAGE:
        if getattr(chosen, name) != getattr(IdentifyOptions, name):
            option = options_of(IdentifyOptions)[name].flags_of(name)[0]
            other = "two-stage" if one_stage else "one-stage"
            raise FifthwheelError(f"{option}: needs --method {other}; remove {option}, or choose that method")
    if one_stage:
        return chosen_one_stage(vehicle, chosen, suspension)
    preset = article() if chosen.method == "article" else TwoStage()
    return vehicle, replace(preset, fixed=chosen.fix, check=chosen.check, passes=chosen.passes or preset.passes)


def chosen_one_stage(
    vehicle: Vehicle, chosen: IdentifyOptions, suspension: Identification | None = None
) -> tuple[Vehicle, OneStage]:
    """The same for one stage, whatever the method."""
    form: Any = chosen.form.replace("-", "_")
    if chosen.friction is not None and chosen.tyres == "linear":
        raise FifthwheelError("--friction: linear tyres have none; add --tyres saturating, or remove --friction")
    friction = chosen.friction or OneStage.friction
    settings = one_stage_settings(
        vehicle,
        fix=chosen.fix,
        free=chosen.free,
        prior=fractions("--prior", chosen.prior),
        consider=considered_sigmas(chosen.consider),
        any_load=chosen.any_load,
        sensors=sensor_sigmas(chosen.sensor),
        base=OneStage(check=chosen.check, form=form, tyres=chosen.tyres, friction=friction),
    )
    if suspension is None and chosen.suspension_from is not None:
        suspension = Identification.load(chosen.suspension_from)
    return with_suspension(vehicle, settings, suspension) if suspension else (vehicle, settings)


_ONE_STAGE = ("free", "prior", "consider", "sensor", "any_load", "suspension_from", "form", "tyres", "friction")
"""Options that belong to one stage."""


def named_values(
    option: str, texts: Iterable[str], expected: str, convert: Callable[[str, str], float]
) -> dict[str, float]:
    """ "NAME=VALUE" as name: value.

    `expected` is the form of a text, for the message of the error; a ValueError of `convert` without a message stands
    for another form.
    """
    values = {}
    for text in texts:
        name, _, value = text.partition("=")
        try:
            values[name] = convert(name, value)
        except FifthwheelError as error:
            raise FifthwheelError(f"{option} {text}: {error}") from None
        except ValueError:
            raise FifthwheelError(f"{option} {text}: expected {expected}") from None
    return values


def fractions(option: str, texts: Iterable[str]) -> dict[str, float]:
    """ "name=fraction" as name: fraction, from 0 to below 1; it may be in per cent."""
    return named_values(option, texts, _FRACTION, lambda _, text: _fraction(text, 1))


def considered_sigmas(texts: Iterable[str]) -> dict[str, float]:
    """ "name=fraction" as name: fraction; for model errors a factor, or a latency in s."""

    def sigma(name: str, text: str) -> float:
        return quantity(text, "s") if name == "gyro_delay" else _fraction(text, 100 if name in MODEL_ERRORS else 1)

    return named_values("--consider", texts, _FRACTION, sigma)


def sensor_sigmas(texts: Iterable[str]) -> dict[str, float]:
    """ "name=sigma" as name: sigma in SI."""

    def sigma(name: str, text: str) -> float:
        if name not in SENSOR_PRIORS:
            raise ValueError
        return quantity(text, SENSOR_PRIORS[name])

    return named_values("--sensor", texts, f"NAME=SIGMA, where NAME is {', '.join(SENSOR_PRIORS)}", sigma)


_FRACTION = "NAME=FRACTION, such as roll_stiffness=10%"


def _fraction(text: str, below: float) -> float:
    value = float(text.removesuffix("%")) / (100 if text.endswith("%") else 1)
    if not 0 <= value < below:
        raise FifthwheelError(f"expected a fraction from 0 to below 1; {text} is {100 * value:g} %")
    return value
