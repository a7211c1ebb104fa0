"""Tracking ability on a straight path: width of the path that a truck sweeps on a straight road with a crossfall.

On a constant crossfall the front axle follows a straight line. All yaw rates are 0; the linear model with the bank of
the road as an input gives sideslip, articulation angles, roll angles and the steer angle. The units run askew:

    swept width = largest less smallest lateral position of any corner.

The Australian standard measures it on a rough road over 1000 m. Without a road profile the width here is a lower bound.
"""

import numpy as np

from fifthwheel._types import Array
from fifthwheel.assess.truck import Truck, Values
from fifthwheel.channels import ARTICULATION, ROLL, ROLL_RATE, YAW_RATE, is_of
from fifthwheel.dynamics import matrices
from fifthwheel.dynamics.chain import BANK

CROSSFALL = 0.03
"""Of the road, rad."""


def measure(truck: Truck) -> Values:
    """The swept width on a road with `CROSSFALL`, m.

    Raises:
        VehicleError: the truck is unstable at this speed.
    """
    truck.require_stable()
    y = lateral_positions(truck)
    return {"straight_path_width": float(np.ptp(y)) + truck.body.width}


def lateral_positions(truck: Truck) -> Array:
    """Lateral position, m, of the front and rear end of the centre line of every unit, (2 n,)."""
    vehicle, body = truck.vehicle, truck.body
    m = matrices(vehicle, truck.speed, roll=True, bank=True)
    moving = [i for i, name in enumerate(m.states) if not is_of(name, YAW_RATE, ROLL_RATE)]
    unknown = [i for i in moving if m.states[i] != BANK]
    rates = [i for i, name in enumerate(m.states) if not is_of(name, ARTICULATION, ROLL) and name != BANK]
    left = np.column_stack([m.A[np.ix_(rates, unknown)], m.B[rates, 0]])
    solution = np.linalg.solve(left, -m.A[rates, m.states.index(BANK)] * CROSSFALL)
    values = dict(zip((m.states[i] for i in unknown), solution, strict=False))
    heading = -values[f"lateral_velocity.{vehicle.units[0].name}"] / truck.speed
    origin, ends = -truck.front_axle.position * heading, []
    for i, unit in enumerate(vehicle.units):
        front = truck.front_axle.position + body.front_overhang
        if i:
            coupling = vehicle.couplings[i - 1]
            joint = origin + coupling.leading_position * heading
            heading += values[f"articulation.{unit.name}"]
            origin = joint - coupling.trailing_position * heading
            front = coupling.trailing_position
        overhang = (body.rear_overhang or 0.0) if i == len(vehicle.units) - 1 else 0.0
        ends += [origin + front * heading, origin + (min(a.position for a in unit.axles) - overhang) * heading]
    return np.array(ends)
