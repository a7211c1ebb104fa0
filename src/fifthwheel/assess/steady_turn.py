"""High-speed steady off-tracking: how far the last axle runs outside the front axle's path in a steady turn.

The linear model gives the lateral velocity v of the first unit and the articulation angles in a steady turn at speed u
and yaw rate r. All points turn about one centre, at (x_cog - v / r, u / r) on the first unit:

    off-tracking = distance of the last axle from the centre - distance of the first axle from the centre,

positive outside. At low speed it is negative, -sum L^2 / (2 R). R. D. Ervin and Y. Guy, The influence of weights and
dimensions on the stability and control of heavy-duty trucks in Canada, UMTRI-86-35 (1986).
"""

import cmath

from fifthwheel.assess.truck import Truck, Values
from fifthwheel.dynamics import linear_system
from fifthwheel.units import STANDARD_GRAVITY

ACCELERATION = 0.2 * STANDARD_GRAVITY
"""Lateral acceleration of the turn, m/s^2."""


def measure(truck: Truck) -> Values:
    """The off-tracking at `ACCELERATION`, m.

    Raises:
        VehicleError: the truck is unstable at this speed.
    """
    truck.require_stable()
    return {"steady_off_tracking": off_tracking(truck, ACCELERATION / truck.speed)}


def off_tracking(truck: Truck, yaw_rate: float) -> float:
    """Off-tracking, m, in a steady turn with a yaw rate, rad/s, positive."""
    vehicle = truck.vehicle
    units = vehicle.units
    outputs = [
        f"lateral_velocity.{units[0].name}",
        f"yaw_rate.{units[0].name}",
        *[f"articulation.{unit.name}" for unit in units[1:]],
    ]
    steered = vehicle.with_logged_steering(vehicle.steer_signals()[:1], vehicle.name)
    gains = linear_system(steered, truck.speed, outputs).gain()[:, 0]
    v, _, *articulations = gains * (yaw_rate / gains[1])
    centre = units[0].cog - v / yaw_rate + 1j * truck.speed / yaw_rate
    origin, heading = 0j, 0.0  # of the unit, in the frame of the first
    for coupling, articulation in zip(vehicle.couplings, articulations, strict=True):
        joint = origin + coupling.leading_position * cmath.exp(1j * heading)
        heading += articulation
        origin = joint - coupling.trailing_position * cmath.exp(1j * heading)
    last = origin + truck.rear_axle.position * cmath.exp(1j * heading)
    return float(abs(last - centre) - abs(truck.front_axle.position - centre))
