"""Steer angles of wheels from measured ones: errors of the sensors, and own equations of the steering.

The errors are those in `true_value` of the channel, which is their only source, for symbols and for numbers.

Own equations (`truck.steering`) are expressions of the model's state. With the state x (n,), which has the own states,
and the measured steer angles d (k,), corrected by the errors of their sensors, the wheels of m axles have the angles
w(x, d), and x' gains r(x, d), which is 0 but in the own states. Without own equations w = d and r = 0.
"""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from fifthwheel.base.native import Scan, compiled
from fifthwheel.base.types import Array
from fifthwheel.data.channels import STEER
from fifthwheel.model.dynamics.symbolic import Expressions
from fifthwheel.truck import Vehicle
from fifthwheel.truck.steering import STEERING, motion_signals

PLAY = "play"
"""The error that needs an input of its own, see `model.contact_input`."""
ITERATIONS = 5
"""Of Newton's method for a measured angle; one is enough for errors that are linear in it."""


def steer_parameters(vehicle: Vehicle) -> dict[str, float]:
    """Errors of the steer sensors, with their defaults: angle(t) = true_value(measured(t + delay)).

    The transition corrects a delay to first order, which suits the small remainder after the rows are shifted by most
    of the delay. Outputs that depend directly on the steer angle (accelerometer, coupling force) do not correct it.
    """
    kinds = [error for error in STEER.errors if error.kind != PLAY]
    return {f"{name}.{error.kind}": error.ideal for name in vehicle.steer_signals() for error in kinds}


def true_angles(names: Sequence[str], measured: ca.SX, values: Mapping[str, Any]) -> ca.SX:
    """The angles (m,) of the wheels, rad, from the measured ones; `values` has the errors of their sensors by name."""
    angles = [ca.SX(0, 1)]
    for name, angle in zip(names, ca.vertsplit(measured) if names else (), strict=True):
        angles.append(STEER.true_value(angle, {e.kind: values.get(f"{name}.{e.kind}", e.ideal) for e in STEER.errors}))
    return ca.vertcat(*angles)


class SteerAngle(NamedTuple):
    """Angles of steered wheels."""

    angle: Array  # rad
    slope: Array  # their derivatives with respect to the measured angles


def steer_angle(name: str, measured: Array | float, errors: Mapping[str, float]) -> SteerAngle:
    """The angles of the wheels from measured ones, rad, of any shape; else as `true_angles`.

    >>> steer_angle("steer.tractor.front", 0.03, {"steer.tractor.front.offset": 0.01})
    SteerAngle(angle=array(0.02), slope=array(1.))
    """
    values = [errors.get(f"{name}.{error.kind}", error.ideal) for error in STEER.errors]
    _, found = _angle_and_slope()(np.zeros(0), np.reshape(measured, (-1, 1)), np.array(values))
    return SteerAngle(*[column.reshape(np.shape(measured)) for column in found.T])


def measured_angle(name: str, angle: Array, errors: Mapping[str, float]) -> Array:
    """The angles (N,), rad, that a sensor with errors measures: the inverse of `steer_angle`."""
    measured = angle
    for _ in range(ITERATIONS):
        found = steer_angle(name, measured, errors)
        measured = measured - (found.angle - angle) / found.slope
    return measured


@compiled(Scan)
def _angle_and_slope() -> ca.Function:
    """sample = measured angle; constant = errors; output = [true angle, its derivative]. There is no carry."""
    kinds = [error.kind for error in STEER.errors]
    nothing, measured, errors = ca.SX.sym("nothing", 0), ca.SX.sym("measured"), ca.SX.sym("errors", len(kinds))
    angle = STEER.true_value(measured, dict(zip(kinds, ca.vertsplit(errors), strict=True)))
    output = ca.vertcat(angle, ca.jacobian(angle, measured))
    return ca.Function("steer_angle", [nothing, measured, errors], [nothing, ca.densify(output)])


class Wheels(NamedTuple):
    """Steer angles of wheels, and what they depend on."""

    angles: dict[str, ca.SX]  # of each axle that is steered, by its signal, rad
    rates: ca.SX  # r (n,)

    @property
    def stacked(self) -> ca.SX:
        """The angles (m,)."""
        return ca.vertcat(ca.SX(0, 1), *self.angles.values())


class SteeringSlopes(NamedTuple):
    """Derivatives of w and r."""

    wheels_by_state: ca.SX  # (m, n)
    wheels_by_steer: ca.SX  # (m, k)
    rates_by_state: ca.SX  # (n, n)
    rates_by_steer: ca.SX  # (n, k)

    def applied(self, A: ca.SX, B: ca.SX) -> tuple[ca.SX, ca.SX]:
        """A (n, n) and B (n, k) of measured angles, from those of the wheels, B (n, m)."""
        return (
            A + B @ self.wheels_by_state + self.rates_by_state,
            B @ self.wheels_by_steer + self.rates_by_steer,
        )


def wheel_signals(vehicle: Vehicle) -> tuple[str, ...]:
    """Signals (m,) of the axles that are steered: as measured, then others by own equations."""
    measured = vehicle.steer_signals()
    own = vehicle.steering.trace.wheels if vehicle.steering else ()
    return (*measured, *[name for name in own if name not in measured])


def own_states(vehicle: Vehicle) -> tuple[str, ...]:
    """Names of the own states."""
    return tuple(vehicle.steering.states) if vehicle.steering else ()


def wheels(p: Expressions, vehicle: Vehicle, states: Mapping[str, ca.SX], speed: ca.SX, steer: ca.SX) -> Wheels:
    """The wheels where the states have these values, by name in the order of x, from angles (k,)."""
    measured = dict(zip(vehicle.steer_signals(), ca.vertsplit(steer) if steer.numel() else (), strict=True))
    own = vehicle.steering
    if own is None:
        return Wheels(measured, ca.SX(len(states), 1))
    motion = {"speed": speed} | {
        name: states.get(name, ca.SX(0)) for name in motion_signals([unit.name for unit in vehicle.units])[1:]
    }
    parameters = {name: p[f"{STEERING}.{name}"] for name in own.parameters}
    angles, rates = own.equations(measured, {name: states[name] for name in own.states}, motion, parameters)
    given = measured | {name: ca.SX(angle) for name, angle in angles.items()}
    return Wheels(
        {name: given[name] for name in wheel_signals(vehicle)},
        ca.vertcat(*[ca.SX(rates[name]) if name in own.states else ca.SX(1, 1) for name in states]),
    )


def slopes(p: Expressions, vehicle: Vehicle, states: Mapping[str, ca.SX], speed: ca.SX, steer: ca.SX) -> SteeringSlopes:
    """Derivatives of `wheels` by the states, which are symbols, and by `steer`, symbols (k,)."""
    found, x = wheels(p, vehicle, states, speed, steer), ca.vertcat(*states.values())
    w = found.stacked
    return SteeringSlopes(*[ca.jacobian(of, by) for of in (w, found.rates) for by in (x, steer)])


def linear_slopes(p: Expressions, vehicle: Vehicle, names: tuple[str, ...], speed: ca.SX) -> SteeringSlopes:
    """`slopes` where the states with these names (n,) and the measured angles are 0."""
    states, k = {name: ca.SX.sym(name) for name in names}, len(vehicle.steer_signals())
    steer = ca.SX.sym("steer", k)
    at = ca.vertcat(*states.values(), steer)
    parts = slopes(p, vehicle, states, speed, steer)
    return SteeringSlopes(*[ca.sparsify(ca.substitute(part, at, ca.DM.zeros(*at.shape))) for part in parts])
