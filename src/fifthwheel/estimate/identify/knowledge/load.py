"""The same truck with another load: its vehicle, and what of its tyres stays the same."""

import math
from typing import Any

from fifthwheel.base.arguments import expect, expect_number
from fifthwheel.base.errors import VehicleError
from fifthwheel.model.dynamics.tyres import stiffness_at_load
from fifthwheel.truck import Vehicle
from fifthwheel.truck.uncertainty import cog_sigma
from fifthwheel.truck.unit import Unit

OF_TYRE_LOAD = ("cornering_stiffness", "relaxation_length", "pneumatic_trail")
"""Quantities of an axle group that follow the load of its tyres as the cornering stiffness does
(`dynamics.tyres.stiffness_at_load`): the relaxation length is the cornering stiffness over the side stiffness of the
tyre, which hardly depends on the load, and the trail follows the length of the contact."""
LOAD_POSITION = 0.5
"""Standard deviation of the distance between the CoG of a load and that of its laden unit, m."""


def with_payload(vehicle: Vehicle, mass: float, *, cog: float | None = None, unit: str | None = None) -> Vehicle:
    """The vehicle with another payload in a unit with one.

    The unladen masses stay. The yaw inertia follows the mass of the unit, and `OF_TYRE_LOAD` the load of the tyres,
    whether measured, stated or assumed from a class: the tyres are the same. Their standard deviations keep their
    fraction of the value, and what is assumed stays assumed. Unless it is given, the CoG stays, with the uncertainty of
    a load whose CoG is `LOAD_POSITION` from that of the unit.

    Args:
        vehicle: with a payload.
        mass: of the other payload, kg; 0 for the unladen vehicle.
        cog: x of the CoG of the unit with it, m.
        unit: name of the unit; needed if several have a payload.

    Raises:
        VehicleError: the unit has no payload, or it is not named and not the only one with a payload.
        SignalError: the mass is negative or not finite.

    Example:
        >>> import fifthwheel as fw
        >>> empty = fw.with_payload(fw.vehicle("cheng_cebon_2011"), 0.0)
        >>> round(empty.parameters()["semitrailer.mass"])
        13328
    """
    expect("vehicle", vehicle, Vehicle)
    expect_number("payload", mass, ge=0, unit="kg")
    laden, before = laden_unit(vehicle, unit)
    cog = laden.cog if cog is None else cog
    if (mass, cog) == (before, laden.cog):
        return vehicle
    after = laden.mass - before + mass
    content = vehicle.model_dump(mode="json")
    (changed,) = [u for u in content["units"] if u["name"] == laden.name]
    changed |= {"mass": after, "cog": cog, "yaw_inertia": laden.yaw_inertia * after / laden.mass}
    changed["payload"] = changed["payload"] | {"mass": mass} if mass else None
    content["stated"] = _stated(vehicle, laden.name, abs(before - mass) / after, laden=mass > 0)
    other = Vehicle(**content)
    old, new, values = load_factors(vehicle), load_factors(other), vehicle.parameters()
    factors = {path: new[path] / old[path] for path in old if path in new and path in values}
    content = other.fields_with({path: values[path] * factor for path, factor in factors.items()})
    factors[f"{laden.name}.yaw_inertia"] = after / laden.mass
    content["stated"] = {path: sigma * factors.get(path, 1.0) for path, sigma in other.stated.items()}
    return Vehicle(**content)


def laden_unit(vehicle: Vehicle, name: str | None = None) -> tuple[Unit, float]:
    """The unit of this name, by default the only one, with a payload, and its payload, kg; a VehicleError if there is
    none, or several."""
    laden = [(unit, unit.payload.mass) for unit in vehicle.units if unit.payload and name in (None, unit.name)]
    if len(laden) != 1:
        of_name = f"{name} with a payload" if name else "one unit with a payload"
        raise VehicleError(f"{vehicle.name}: expected {of_name}, got {len(laden)}; give a vehicle file of this load")
    return laden[0]


def _stated(vehicle: Vehicle, unit: str, fraction: float, *, laden: bool) -> dict[str, Any]:
    """The stated uncertainty with that of the CoG; without that of the payload, which another statement determines."""
    cog, payload = f"{unit}.cog", f"{unit}.payload."
    stated = {path: sigma for path, sigma in vehicle.stated.items() if laden or not path.startswith(payload)}
    stated.pop(f"{payload}mass", None)
    own = stated.get(cog, cog_sigma(laden=bool(laden)))
    return stated | {cog: math.hypot(own, LOAD_POSITION * fraction)}


def load_factors(vehicle: Vehicle) -> dict[str, float]:
    """`OF_TYRE_LOAD` over the values at the nominal load of the tyres, by name; the latter are the same with any load.

    Empty where the static axle loads are not determined.
    """
    try:
        fractions = stiffness_at_load(vehicle)
    except VehicleError:
        return {}
    return {f"{path}.{quantity}": fraction for path, fraction in fractions.items() for quantity in OF_TYRE_LOAD}
