"""Outputs of sensors as expressions of the chain's state.

A sensor is named quantity.unit[.part]; `channels` has what each quantity is. Its errors are parameters: its output is
<sensor>.gain times the quantity plus <sensor>.offset. A quantity that depends on the sensor's place has two more
parameters: <sensor>.position, x on the unit in m, and <sensor>.height above the ground in m. No sensor measures the
load transfer ratio of an axle group, so it has no errors. It and differences of wheel speeds have the parameter
`HALF_TRACK`.
"""

from collections.abc import Callable, Iterable, Mapping
from typing import NamedTuple

import casadi as ca

from fifthwheel.base.errors import SignalError, VehicleError, suggestion
from fifthwheel.base.units import STANDARD_GRAVITY as GRAVITY
from fifthwheel.data.channels import LATERAL_ACCELERATION, MODELLED, SignalName, channel_of, is_of
from fifthwheel.data.channels.channel import SensorModel
from fifthwheel.data.record import Record
from fifthwheel.data.record.derived import all_pairs, with_differences
from fifthwheel.model.dynamics import chain
from fifthwheel.model.dynamics.chain import Equations
from fifthwheel.model.dynamics.steering import own_states
from fifthwheel.model.dynamics.symbolic import Stages
from fifthwheel.model.dynamics.tyres import Contact, axle_forces, linear
from fifthwheel.model.dynamics.unit_equations import (
    BANK,
    Motion,
    load_transfer_moment,
    mass_matrix,
    side_force_height,
    slip_angles,
)
from fifthwheel.truck import AxleGroup, Vehicle
from fifthwheel.truck.loads import axle_loads
from fifthwheel.truck.quantities import HALF_TRACK, TYRES
from fifthwheel.truck.unit import Accelerometer

CONSTANT_STEERING = ca.SX(0, 1), ca.SX(0, 1)


class SensorInputs(NamedTuple):
    """The quantities from which sensor outputs are computed: the `Instant` of `channels`."""

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
    ahead: Callable[[ca.SX, float], ca.SX]  # value of an expression after a horizon, s; see `Stages.ahead`
    states: Mapping[str, ca.SX]  # by name

    @property
    def half_track(self) -> ca.SX:
        """Half the distance of the tyres of both sides, m."""
        return self.p[HALF_TRACK]

    def own_state(self, name: str) -> ca.SX:
        """An own state of the steering; a SignalError where the vehicle has no such state."""
        known = own_states(self.vehicle)
        if name not in known:
            raise SignalError(f"{name}: {self.vehicle.name} has no such own state; {suggestion(name, known)}")
        return self.states[name]

    def coupling_force(self, i: int) -> ca.SX:
        """Side force of the coupling on unit i, N: inertia forces less tyre forces of this unit and all behind it."""
        total, motion = ca.SX(0), self.motion
        for k, unit in enumerate(self.vehicle.units[i:], i):
            row = mass_matrix(self.p, unit, roll=self.roll)[0, :]
            inertia = row @ self.acceleration[k] + row[0] * GRAVITY * motion.bank
            total += inertia - sum(self.side_force[unit.group_path(group)] for group in unit.axle_groups)
        return total

    def load_transfer(self, name: str) -> ca.SX:
        """Load transfer ratio of the axle group of a signal; beyond 1 or -1 the wheels of a side have lifted."""
        i, group = axle_group(self.vehicle, name)
        p, vehicle, unit, motion = self.p, self.vehicle, self.vehicle.units[i], self.motion
        path = unit.group_path(group)
        load: ca.SX = axle_loads(p, vehicle.units, vehicle.couplings)[path]
        height = side_force_height(p, unit, group, load)
        moment = load_transfer_moment(p, path, motion.roll[i], motion.roll_rate[i], self.side_force[path], height)
        ratio: ca.SX = moment / ((load + self.load_change.get(path, 0)) * self.half_track)
        return ratio

    def load_transfer_of_axle(self, i: int, name: str) -> ca.SX:
        """That of the group of the axle of a signal; of the last group of unit i where the signal names no axle."""
        unit, axle = self.vehicle.units[i], SignalName.of(name).part
        groups = [group for group in unit.axle_groups if axle in [each.name for each in group.axles]]
        group = groups[0] if groups else unit.axle_groups[-1]
        return self.load_transfer(f"load_transfer.{unit.group_path(group)}")

    def wheel_speed_difference(self, i: int, name: str) -> ca.SX:
        """2 b r cos(delta)^2 / u with the half track b, yaw rate r and speed u of unit i, and the steer angle delta.

        The centres of the wheels differ by 2 b r in forward velocity, thus by 2 b r cos(delta) in the plane of steered
        wheels, whose mean speed is u / cos(delta). A SignalError for an axle of the first unit that is not steered.
        """
        steer = self.steer.get(f"steer.{SignalName.of(name).place}")
        if i == 0 and steer is None:
            raise SignalError(
                f"{name}: expected a steered axle of the {self.vehicle.units[0].name}, because driven wheels have "
                "slip; use the wheel speeds of its front axle, or leave this signal out"
            )
        ratio: ca.SX = 2 * self.half_track * self.motion.r[i] / self.motion.u[i]
        return ratio if steer is None else ratio * ca.cos(steer) ** 2


def sensor_inputs(
    p: Mapping[str, ca.SX],
    vehicle: Vehicle,
    equations: Equations,
    x: ca.SX,
    speed: ca.SX,
    steer: ca.SX,
    *,
    roll: bool,
    stages: Stages,
    bank: bool = False,
    turning: tuple[ca.SX, ca.SX] = CONSTANT_STEERING,
    change: chain.SpeedChange | None = None,
) -> SensorInputs:
    """The quantities at one instant from state (n,), speed and measured steer angles without errors (k,); arguments as
    in `chain`. Own equations of the steering are linear, as `equations` has them.

    `change` is that of the speed, by default none. `turning` are symbols of the measured steer angles, rad, and their
    derivatives with respect to time, rad/s.
    """
    A, B = equations.state_space(speed, change)
    rate = A @ x + B @ steer
    states = chain.by_name(vehicle, x, roll=roll, bank=bank)
    motion = Motion.of(p, vehicle, states, speed)
    angles = chain.linear_wheels(p, vehicle, states, speed, steer)
    slip = slip_angles(p, vehicle, motion, angles)
    staged = equations.rates(speed, x, steer, rate, stages, change)
    velocities = list(equations.velocities)
    no_turn = [0] * (2 if roll else 1)
    along = ca.SX(0) if change is None else change.rate
    convective = [ca.vertcat(speed * motion.r[0] - along * heading, *no_turn) for heading in motion.heading]
    return SensorInputs(
        p=p,
        vehicle=vehicle,
        motion=motion,
        acceleration=tuple(
            ca.jacobian(velocity, x[velocities]) @ staged[velocities] + turn
            for velocity, turn in zip(motion.velocity, convective, strict=True)
        ),
        speed=speed,
        steer=angles,
        side_force={path: axle_forces(linear(p, path, Contact(alpha)), alpha)[0] for path, alpha in slip.items()},
        load_change={},
        roll=roll,
        states=states,
        rate_of=stages.rate(ca.vertcat(x, turning[0]), ca.vertcat(staged, turning[1])),
        ahead=stages.ahead(x, rate, staged),
    )


def axle_group(vehicle: Vehicle, name: str) -> tuple[int, AxleGroup]:
    """Index of the unit and axle group of a signal, such as load_transfer.tractor.drive; a SignalError where there is
    no such group."""
    groups = {unit.group_path(group): (i, group) for i, unit in enumerate(vehicle.units) for group in unit.axle_groups}
    place = SignalName.of(name).place
    if place not in groups:
        raise SignalError(f"{name}: {vehicle.name} has no axle group {place!r}; {suggestion(place, groups)}")
    return groups[place]


class Measurand(NamedTuple):
    """What a signal measures, and where."""

    model: SensorModel
    unit: int  # its index, front to rear
    of_group: bool  # whether it is that of an axle group: a load transfer ratio, which no sensor measures


def sensor_of(vehicle: Vehicle, name: str) -> Measurand:
    """What a signal measures; a SignalError where the model has no such quantity, or the vehicle no such place."""
    channel, signal, units = channel_of(name), SignalName.of(name), [u.name for u in vehicle.units]
    if channel is None or channel.model is None:
        known = [channel.quantity for channel in MODELLED]
        raise SignalError(f"{name}: no such quantity in the model; {suggestion(signal.quantity, known)}")
    if channel.of == "part":
        return Measurand(channel.model, axle_group(vehicle, name)[0], of_group=True)
    if signal.unit not in units:
        raise SignalError(f"{name}: {vehicle.name} has no unit {signal.unit!r}; {suggestion(signal.unit, units)}")
    return Measurand(channel.model, units.index(signal.unit), of_group=False)


def require_available(vehicle: Vehicle, name: str, *, roll: bool) -> None:
    """Raise a SignalError where the vehicle, or the model without roll, does not have a signal."""
    model, unit, _ = sensor_of(vehicle, name)
    if unit == 0 and model.behind_coupling:
        raise SignalError(f"{name}: the first unit has no coupling in front of it; name a unit behind a coupling")
    if not roll and model.needs_roll:
        raise SignalError(f"{name}: the yaw-only model has no roll; use the yaw-roll model or omit the signal")


def sensor_parameters(vehicle: Vehicle, name: str) -> dict[str, float]:
    """Parameters of a sensor with their defaults: gain 1, offset 0, position under the CoG on the roll axis.

    An accelerometer is where the vehicle file says, if it does. The sensitivities are 0: the misalignment of a gyro,
    rad, is the fraction of the other rate of its unit in its output.
    """
    if name == BANK:
        return {}
    model, i, of_group = sensor_of(vehicle, name)
    unit = vehicle.units[i]
    parameters = {HALF_TRACK: TYRES[HALF_TRACK].default} if model.needs_track else {}
    if of_group:
        return parameters
    parameters |= {f"{name}.gain": 1.0, f"{name}.offset": 0.0} | {f"{name}.{kind}": 0.0 for kind in model.sensitivities}
    if model.has_place:
        place = Accelerometer(position=unit.cog, height=unit.roll_axis_height)
        if is_of(name, LATERAL_ACCELERATION):
            place = unit.place_of_accelerometer(SignalName.of(name).part)
        parameters |= {f"{name}.position": place.position, f"{name}.height": place.height}
    return parameters


def sensor_output(inputs: SensorInputs, name: str) -> ca.SX:
    """Output of a sensor with its errors; the bank of the road and load transfer ratios have no sensor."""
    if name == BANK:
        return inputs.motion.bank
    (model, i, of_group), p = sensor_of(inputs.vehicle, name), inputs.p
    value: ca.SX = model.value(inputs, i, name)
    if not isinstance(value, ca.SX) or not value.is_scalar() or value.is_constant():
        raise SignalError(
            f"{name}: expected one expression of CasADi from the value of its channel, got {value}; return one, with "
            "functions of casadi in place of those of math"
        )
    if of_group:
        return value
    if model.rate and f"{name}.delay" in p:
        value -= p[f"{name}.delay"] * model.rate(inputs, i, value)
    for kind, quantity in model.sensitivities.items():
        if f"{name}.{kind}" in p:
            value += p[f"{name}.{kind}"] * quantity(inputs, i, name)
    return value * p[f"{name}.gain"] + p[f"{name}.offset"]


def wheel_pairs(vehicle: Vehicle, names: Iterable[str]) -> tuple[str, ...]:
    """Those of `all_pairs` that the model of a vehicle has.

    Of the first unit only steered axles count, and no driven ones: their wheels have slip, which a locked differential
    makes different on both sides. None counts where the static axle loads, which the load transfer needs, are not
    determined.

    >>> from fifthwheel.truck import get
    >>> sides = [f"{axle}.{side}" for axle in ("tractor.drive", "semitrailer") for side in ("left", "right")]
    >>> wheel_pairs(get("cheng_cebon_2011"), [f"wheel_speed.{side}" for side in sides])
    ('wheel_speed_difference.semitrailer',)
    """
    leading, steered = vehicle.units[0].name, vehicle.steer_signals()
    signals = {name: SignalName.of(name) for name in all_pairs(names)}
    powered = [(unit, group) for unit in vehicle.units for group in unit.axle_groups if group.driven]
    driven = {f"{unit.name}.{axle.name}" for unit, group in powered for axle in group.axles}
    driven |= {unit.group_path(group) for unit, group in powered}
    used = {n: each for n, each in signals.items() if each.place not in driven}
    pairs = tuple(n for n, each in used.items() if each.unit != leading or f"steer.{each.place}" in steered)
    try:
        return pairs if pairs and vehicle.axle_loads() else ()
    except VehicleError:
        return ()


def with_wheel_speed_differences(record: Record, vehicle: Vehicle) -> Record:
    """The record with the differences of `wheel_pairs` that it does not have."""
    return with_differences(record, wheel_pairs(vehicle, record.signals))
