"""Axle loads under longitudinal forces, and the friction that braking needs.

The units are in equilibrium in pitch at a longitudinal acceleration of z g; a grade acts like one. From the last unit
to the first, the coupling pulls the units behind it with

    F_c = sum (z m g - F_x)        over these units,

and z m g at the height of the CoG and F_c at the heights of the couplings turn each unit. That is as if its CoG were
displaced by their moment over its weight.

Braking efficiency: a group with the braking force F_x needs the friction -F_x / N, and the efficiency is the
deceleration z over the largest of them: the fraction of the friction that a stop without locked wheels can use. The
brakes are those that are stated, else F_x = -z N_0, in proportion to the static loads. R. D. Ervin and Y. Guy, The
influence of weights and dimensions on the stability and control of heavy-duty trucks in Canada, UMTRI-86-35 (1986).
"""

from collections.abc import Mapping

from fifthwheel.assess.truck import Truck, Values
from fifthwheel.units import STANDARD_GRAVITY as GRAVITY
from fifthwheel.vehicle import Vehicle
from fifthwheel.vehicle.axle_loads import axle_loads
from fifthwheel.vehicle.payload import unit_cog_height

DECELERATION = 0.4
"""Of the stop, g."""


def measure(truck: Truck) -> Values:
    """The braking efficiency; 0 if an axle group lifts."""
    static = truck.vehicle.axle_loads()
    shares = static
    if stated := truck.body.brakes:
        per_fraction = sum(static.values()) / sum(stated.values())
        shares = {path: fraction * per_fraction for path, fraction in stated.items() if fraction}
    braked = loads_under(truck.vehicle, -DECELERATION, {path: -DECELERATION * share for path, share in shares.items()})
    return {"braking_efficiency": max(0.0, min(braked[path] / share for path, share in shares.items()))}


def loads_under(vehicle: Vehicle, acceleration: float, forces: Mapping[str, float]) -> dict[str, float]:
    """Vertical load of each axle group by path, N, at an acceleration to the front, g, or on a rise over run.

    Args:
        forces: longitudinal force of axle groups by path, N, positive to the front; in sum the weight times the
            acceleration.

    Raises:
        VehicleError: the axle loads are not determined.
    """
    p, pull = vehicle.parameters(), 0.0  # pull: force of the coupling on the units behind it, N
    displaced = dict(p)
    for i in reversed(range(len(vehicle.units))):
        unit = vehicle.units[i]
        weight = unit.mass * GRAVITY
        moment = -acceleration * weight * unit_cog_height(p, unit)
        if i < len(vehicle.couplings):
            moment -= pull * vehicle.couplings[i].height
        pull += acceleration * weight - sum(forces.get(unit.group_path(group), 0.0) for group in unit.axle_groups)
        if i:
            moment += pull * vehicle.couplings[i - 1].height
        displaced[f"{unit.name}.cog"] += moment / weight
    return axle_loads(displaced, vehicle.units, vehicle.couplings)
