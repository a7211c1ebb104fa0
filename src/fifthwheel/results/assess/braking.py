"""The friction that braking needs, with the axle loads of `Vehicle.axle_loads`.

Braking efficiency: a group with the braking force F_x needs the friction -F_x / N, and the efficiency is the
deceleration z over the largest of them: the fraction of the friction that a stop without locked wheels can use. The
brakes are those that are stated, else F_x = -z N_0, in proportion to the static loads. R. D. Ervin and Y. Guy, The
influence of weights and dimensions on the stability and control of heavy-duty trucks in Canada, UMTRI-86-35 (1986).
"""

from fifthwheel.results.assess.truck import Truck, Values

DECELERATION = 0.4
"""Of the stop, g."""


def measure(truck: Truck) -> Values:
    """The braking efficiency; 0 if an axle group lifts."""
    static = truck.vehicle.axle_loads()
    shares = static
    if stated := truck.body.brakes:
        per_fraction = sum(static.values()) / sum(stated.values())
        shares = {path: fraction * per_fraction for path, fraction in stated.items() if fraction}
    braked = truck.vehicle.axle_loads(-DECELERATION, {path: -DECELERATION * share for path, share in shares.items()})
    return {"braking_efficiency": max(0.0, min(braked[path] / share for path, share in shares.items()))}
