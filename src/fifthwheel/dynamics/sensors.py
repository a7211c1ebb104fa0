"""Outputs of sensors as expressions of the chain's state.

A sensor is named quantity.unit. Its errors are parameters: its output is <sensor>.gain times the quantity plus
<sensor>.offset. A quantity that depends on the sensor's position has two more parameters: <sensor>.position, x on the
unit in m, and <sensor>.height above the ground in m.

The load transfer ratio of an axle group, load_transfer.<group>, is the load of its right wheels less that of its left
wheels, divided by their sum. No sensor measures it or `PREDICTED_LOAD_TRANSFER`, so they have no errors; their
parameter is `HALF_TRACK`.
"""

from collections.abc import Callable, Mapping
from typing import NamedTuple

import casadi as ca

from fifthwheel.dynamics import chain
from fifthwheel.dynamics.chain import BANK, Equations, Motion
from fifthwheel.dynamics.saturation import DEFAULTS, HALF_TRACK
from fifthwheel.dynamics.symbolic import Stages
from fifthwheel.dynamics.tyres import Contact, axle_forces, linear
from fifthwheel.dynamics.unit_equations import load_transfer_moment, mass_matrix, side_force_height
from fifthwheel.errors import SignalError, suggestion
from fifthwheel.names import ACCELEROMETER, SignalName
from fifthwheel.units import STANDARD_GRAVITY as GRAVITY
from fifthwheel.vehicle import AxleGroup, Vehicle
from fifthwheel.vehicle.axle_loads import axle_loads

LOAD_TRANSFER = "load_transfer"
"""Quantity of the load transfer ratio of an axle group."""
PREDICTED_LOAD_TRANSFER = "predicted_load_transfer"
"""Quantity of the load transfer ratio of an axle group after `HORIZON`, at its present rate: the predictive load
transfer ratio (C. Larish et al., A new predictive lateral load transfer ratio for rollover prevention systems, IEEE
Transactions on Vehicular Technology 62, 2013)."""
HORIZON = 0.2
"""s."""


class SensorInputs(NamedTuple):
    """The quantities from which sensor outputs are computed."""

    p: Mapping[str, ca.SX]  # parameters of the vehicle and of the sensors, by name
    vehicle: Vehicle
    motion: Motion
    acceleration: tuple[ca.SX, ...]  # of each unit: (a, r'[, p']), a = v' + u r, m/s^2 and rad/s^2
    speed: ca.SX  # m/s
    steer: Mapping[str, ca.SX]  # steer angle of each steered axle by its signal, rad
    side_force: Mapping[str, ca.SX]  # of the tyres of each axle group by its path, N
    load_change: Mapping[str, ca.SX]  # of axle groups whose load is not the static one, by their path, N
    roll: bool  # whether the model has roll
    rate_of: Callable[[ca.SX], ca.SX]  # derivative of an expression with respect to time


CONSTANT_STEERING = ca.SX(0, 1), ca.SX(0, 1)
"""No steer angles that change with time."""


def sensor_inputs(
    p: Mapping[str, ca.SX],
    vehicle: Vehicle,
    equations: Equations,
    x: ca.SX,
    speed: ca.SX,
    steer: ca.SX,
    *,
    roll: bool,
    bank: bool = False,
    turning: tuple[ca.SX, ca.SX] = CONSTANT_STEERING,
) -> SensorInputs:
    """The quantities at one instant from state, speed and steer angles.

    Args:
        p: parameters of the vehicle and of the sensors, by name.
        vehicle: units, axles and couplings; its numbers are not used.
        equations: of motion.
        x: state (n,).
        speed: m/s.
        steer: true angle of each steered axle (k,), rad.
        roll, bank: as in `chain.state_names`.
        turning: symbols of the measured steer angles, rad, and their derivatives with respect to time, rad/s.
    """
    A, B = equations.state_space(speed)
    rate, names = A @ x + B @ steer, vehicle.steer_signals()
    motion = chain.motion(p, vehicle, x, speed, roll=roll, bank=bank)
    angles = dict(zip(names, ca.vertsplit(steer), strict=True)) if names else {}
    slip = chain.slip_angles(p, vehicle, x, speed, angles, roll=roll)
    velocity_rates = rate[list(equations.velocities)]
    centripetal = ca.vertcat(speed * motion.r[0], *([0] * (2 if roll else 1)))
    return SensorInputs(
        p=p,
        vehicle=vehicle,
        motion=motion,
        acceleration=tuple(J @ velocity_rates + centripetal for J in motion.jacobian),
        speed=speed,
        steer=angles,
        side_force={path: axle_forces(linear(p, path, Contact(alpha)), alpha)[0] for path, alpha in slip.items()},
        load_change={},
        roll=roll,
        rate_of=Stages().rate(ca.vertcat(x, turning[0]), ca.vertcat(rate, turning[1])),
    )


def _lateral_velocity(inputs: SensorInputs, i: int, name: str) -> ca.SX:
    """v + (x - x_cog) r - (h - h_r) p at the sensor's position."""
    unit = inputs.vehicle.units[i].name
    arm = inputs.p[f"{name}.position"] - inputs.p[f"{unit}.cog"]
    above = inputs.p[f"{name}.height"] - inputs.p[f"{unit}.roll_axis_height"]
    return inputs.motion.v[i] + arm * inputs.motion.r[i] - above * inputs.motion.roll_rate[i]


def _sideslip(inputs: SensorInputs, i: int, name: str) -> ca.SX:
    return _lateral_velocity(inputs, i, name) / inputs.motion.u[i]


def _lateral_acceleration(inputs: SensorInputs, i: int, name: str) -> ca.SX:
    """Output of an accelerometer on the sprung body, which contains g times the roll angle and the bank."""
    unit = inputs.vehicle.units[i].name
    arm = inputs.p[f"{name}.position"] - inputs.p[f"{unit}.cog"]
    above = inputs.p[f"{name}.height"] - inputs.p[f"{unit}.roll_axis_height"]
    a = inputs.acceleration[i]
    planar = a[0] + arm * a[1] + GRAVITY * inputs.motion.bank
    return planar - above * a[2] + GRAVITY * inputs.motion.roll[i] if inputs.roll else planar


def _articulation(inputs: SensorInputs, i: int, name: str) -> ca.SX:
    return inputs.motion.heading[i] - inputs.motion.heading[i - 1]


def _coupling_force(inputs: SensorInputs, i: int, name: str) -> ca.SX:
    """Side force of the coupling on the unit behind it, N: inertia forces less tyre forces of all units behind it."""
    total = ca.SX(0)
    for k in range(i, len(inputs.vehicle.units)):
        unit, motion = inputs.vehicle.units[k], inputs.motion
        row = mass_matrix(inputs.p, unit, roll=inputs.roll)[0, :]
        inertia = row @ inputs.acceleration[k] + row[0] * GRAVITY * motion.bank
        total += inertia - sum(inputs.side_force[unit.group_path(group)] for group in unit.axle_groups)
    return total


class Quantity(NamedTuple):
    """A quantity that a sensor on a unit can measure."""

    unit: str
    """SI unit."""
    has_position: bool
    """Whether it depends on the sensor's position on the unit."""
    expression: Callable[[SensorInputs, int, str], ca.SX]
    """Its value from the inputs, the index of the unit and the sensor's name."""


QUANTITIES: dict[str, Quantity] = {
    "yaw_rate": Quantity("rad/s", False, lambda inputs, i, _: inputs.motion.r[i]),
    "roll_rate": Quantity("rad/s", False, lambda inputs, i, _: inputs.motion.roll_rate[i]),
    "roll": Quantity("rad", False, lambda inputs, i, _: inputs.motion.roll[i]),
    "articulation": Quantity("rad", False, _articulation),
    "sideslip": Quantity("rad", True, _sideslip),
    "lateral_velocity": Quantity("m/s", True, _lateral_velocity),
    ACCELEROMETER: Quantity("m/s^2", True, _lateral_acceleration),
    "coupling_force": Quantity("N", False, _coupling_force),
}
"""Quantities of a unit, by the first word of a signal's name."""

RATES = frozenset({"yaw_rate", "roll_rate"})
"""Quantities that a gyro measures."""

NEEDS_COUPLING = frozenset({"articulation", "coupling_force"})
"""Quantities that only a unit behind a coupling has."""

LOAD_TRANSFERS = frozenset({LOAD_TRANSFER, PREDICTED_LOAD_TRANSFER})
"""Quantities of an axle group, which no sensor measures."""

NEEDS_ROLL = frozenset({"roll_rate", "roll"}) | LOAD_TRANSFERS
"""Quantities that only the yaw-roll model has."""


def axle_group(vehicle: Vehicle, name: str) -> tuple[int, AxleGroup]:
    """Index of the unit and axle group of a signal, such as load_transfer.tractor.drive.

    Raises:
        SignalError: the vehicle has no such axle group.
    """
    groups = {unit.group_path(group): (i, group) for i, unit in enumerate(vehicle.units) for group in unit.axle_groups}
    place = SignalName.of(name).place
    if place not in groups:
        raise SignalError(f"{name}: {vehicle.name} has no axle group {place!r}; {suggestion(place, groups)}")
    return groups[place]


def unit_index(vehicle: Vehicle, name: str) -> int:
    """Index of the unit of a signal, front to rear.

    Raises:
        SignalError: the vehicle has no such unit, or the model has no such quantity.
    """
    signal, units = SignalName.of(name), [u.name for u in vehicle.units]
    if signal.quantity not in QUANTITIES:
        raise SignalError(f"{name}: no such quantity in the model; {suggestion(signal.quantity, QUANTITIES)}")
    if signal.unit not in units:
        raise SignalError(f"{name}: {vehicle.name} has no unit {signal.unit!r}; {suggestion(signal.unit, units)}")
    return units.index(signal.unit)


def require_available(vehicle: Vehicle, name: str, *, roll: bool) -> None:
    """Raise a SignalError where the vehicle, or the model without roll, does not have a signal."""
    quantity = SignalName.of(name).quantity
    unit = axle_group(vehicle, name)[0] if quantity in LOAD_TRANSFERS else unit_index(vehicle, name)
    if unit == 0 and quantity in NEEDS_COUPLING:
        raise SignalError(f"{name}: the first unit has no coupling in front of it; name a unit behind a coupling")
    if not roll and quantity in NEEDS_ROLL:
        raise SignalError(f"{name}: the yaw-only model has no roll; use the yaw-roll model or omit the signal")


def sensor_parameters(vehicle: Vehicle, name: str) -> dict[str, float]:
    """Parameters of a sensor with their defaults: gain 1, offset 0, position under the CoG on the roll axis.

    An accelerometer is where the vehicle file says, if it does. A gyro also has a misalignment, rad: that fraction of
    the other rate of its unit is part of its output.

    Raises:
        SignalError: as in `unit_index`.
    """
    if name == BANK:
        return {}
    if SignalName.of(name).quantity in LOAD_TRANSFERS:
        return {HALF_TRACK: DEFAULTS[HALF_TRACK]}
    unit = vehicle.units[unit_index(vehicle, name)]
    parameters = {f"{name}.gain": 1.0, f"{name}.offset": 0.0}
    if SignalName.of(name).quantity in RATES:
        parameters[f"{name}.misalignment"] = 0.0
    if QUANTITIES[SignalName.of(name).quantity].has_position:
        position, height = unit.cog, unit.roll_axis_height
        if SignalName.of(name).quantity == ACCELEROMETER:
            position, height = unit.accelerometer_place.position, unit.accelerometer_place.height
        parameters |= {f"{name}.position": position, f"{name}.height": height}
    return parameters


def extension_parameters(name: str) -> dict[str, float]:
    """Further parameters of a sensor in an extended model: the delay of a gyro, accelerometer or articulation sensor,
    s."""
    return {f"{name}.delay": 0.0} if SignalName.of(name).quantity in (*RATES, "articulation", ACCELEROMETER) else {}


def sensor_output(inputs: SensorInputs, name: str) -> ca.SX:
    """Output of a sensor with its errors; the bank of the road and load transfer ratios have no sensor."""
    if name == BANK:
        return inputs.motion.bank
    if SignalName.of(name).quantity in LOAD_TRANSFERS:
        ratio = _load_transfer(inputs, *axle_group(inputs.vehicle, name))
        predicted = SignalName.of(name).quantity == PREDICTED_LOAD_TRANSFER
        return ratio + HORIZON * inputs.rate_of(ratio) if predicted else ratio
    i, quantity = unit_index(inputs.vehicle, name), QUANTITIES[SignalName.of(name).quantity]
    value, p = quantity.expression(inputs, i, name), inputs.p
    if f"{name}.delay" in p:
        value -= p[f"{name}.delay"] * _derivative(inputs, i, SignalName.of(name).quantity, value)
    if f"{name}.misalignment" in p:
        yaw = SignalName.of(name).quantity == "yaw_rate"
        other = inputs.motion.roll_rate[i] if yaw else inputs.motion.r[i]
        value += p[f"{name}.misalignment"] * other
    return value * p[f"{name}.gain"] + p[f"{name}.offset"]


def _load_transfer(inputs: SensorInputs, i: int, group: AxleGroup) -> ca.SX:
    """Load transfer ratio of an axle group of unit i; beyond 1 or -1 the wheels of a side have lifted."""
    p, vehicle, unit, motion = inputs.p, inputs.vehicle, inputs.vehicle.units[i], inputs.motion
    path = unit.group_path(group)
    load: ca.SX = axle_loads(p, vehicle.units, vehicle.couplings)[path]
    height = side_force_height(p, unit, group, load)
    moment = load_transfer_moment(p, path, motion.roll[i], motion.roll_rate[i], inputs.side_force[path], height)
    ratio: ca.SX = moment / ((load + inputs.load_change.get(path, 0)) * p[HALF_TRACK])
    return ratio


def _derivative(inputs: SensorInputs, i: int, quantity: str, value: ca.SX) -> ca.SX:
    """Derivative of the value of a quantity of unit i with respect to time, at constant speed."""
    if quantity == ACCELEROMETER:
        return inputs.rate_of(value)
    if quantity == "articulation":
        return inputs.motion.r[i] - inputs.motion.r[i - 1]
    return inputs.acceleration[i][1 if quantity == "yaw_rate" else 2]
