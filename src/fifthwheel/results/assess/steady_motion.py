"""Steady motion of the linear model: off-tracking in a turn, and the path that is swept on a straight road.

High-speed steady off-tracking: how far the last axle runs outside the front axle's path in a steady turn. The model
gives the lateral velocity v of the first unit and the articulation angles at speed u and yaw rate r. All points turn
about one centre, at (x_cog - v / r, u / r) on the first unit:

    off-tracking = distance of the last axle from the centre - distance of the first axle from the centre,

positive outside. At low speed it is negative, -sum L^2 / (2 R). R. D. Ervin and Y. Guy, The influence of weights and
dimensions on the stability and control of heavy-duty trucks in Canada, UMTRI-86-35 (1986).

Tracking ability on a straight path: width of the path that a truck sweeps on a straight road with a crossfall. The
front axle follows a straight line. All yaw rates are 0; the model with the bank of the road as an input gives sideslip,
articulation angles, roll angles and the steer angle. The units run askew, at every speed alike:

    swept width = largest less smallest lateral position of any corner.

The Australian standard measures it on a rough road. The linear model has no roughness and no brakes; the nonlinear
truck gives what they add, see nonlinear.py.
"""

import cmath

import numpy as np

from fifthwheel.base.types import Array
from fifthwheel.base.units import STANDARD_GRAVITY
from fifthwheel.data.channels import ARTICULATION, ROLL, ROLL_RATE, YAW_RATE, is_of
from fifthwheel.model.dynamics import linear_system, matrices, understeer_gradient
from fifthwheel.model.dynamics.unit_equations import BANK
from fifthwheel.results.assess.measures import STRAIGHT
from fifthwheel.results.assess.truck import Truck, Values

ACCELERATION = 0.2 * STANDARD_GRAVITY
"""Lateral acceleration of the turn, m/s^2."""
CROSSFALL = 0.03
"""Of the straight road, rad."""


def measure_turn(truck: Truck) -> Values:
    """The off-tracking at `ACCELERATION`, m."""
    truck.require_stable()
    return {"steady_off_tracking": off_tracking(truck, ACCELERATION / truck.speed)}


def measure_understeer(truck: Truck) -> Values:
    """The understeer gradient of the first unit, rad s^2/m."""
    return {"understeer_gradient": understeer_gradient(truck.vehicle)}


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


def measure_straight_path(truck: Truck) -> Values:
    """The swept width on a road with `CROSSFALL`, m."""
    truck.require_stable()
    y = lateral_positions(truck)
    return {STRAIGHT: float(np.ptp(y)) + truck.body.width}


def lateral_positions(truck: Truck) -> Array:
    """Lateral position, m, of the front and rear end of the centre line of every unit, (2 n,)."""
    vehicle = truck.vehicle
    m = matrices(vehicle, truck.speed, roll=True, bank=True)
    moving = [i for i, name in enumerate(m.states) if not is_of(name, YAW_RATE, ROLL_RATE)]
    unknown = [i for i in moving if m.states[i] != BANK]
    rates = [i for i, name in enumerate(m.states) if not is_of(name, ARTICULATION, ROLL) and name != BANK]
    left = np.column_stack([m.A[np.ix_(rates, unknown)], m.B[rates, 0]])
    solution = np.linalg.solve(left, -m.A[rates, m.states.index(BANK)] * CROSSFALL)
    values = dict(zip((m.states[i] for i in unknown), solution, strict=False))
    heading = -values[f"lateral_velocity.{vehicle.units[0].name}"] / truck.speed
    origin, ends = -truck.front_axle.position * heading, []
    for i, (unit, (rear, front)) in enumerate(zip(vehicle.units, truck.ends(), strict=True)):
        if i:
            coupling = vehicle.couplings[i - 1]
            joint = origin + coupling.leading_position * heading
            heading += values[f"articulation.{unit.name}"]
            origin = joint - coupling.trailing_position * heading
        ends += [origin + front * heading, origin + rear * heading]
    return np.array(ends)
