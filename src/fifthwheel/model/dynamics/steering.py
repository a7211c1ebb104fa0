"""Own equations of the steering (`truck.steering`) as expressions of the model's state.

With the state x (n,), which has the own states, and the measured steer angles d (k,), corrected by the errors of their
sensors, the wheels of m axles have the angles w(x, d), and x' gains r(x, d), which is 0 but in the own states. Without
own equations w = d and r = 0.
"""

from collections.abc import Mapping
from typing import NamedTuple

import casadi as ca

from fifthwheel.model.dynamics.symbolic import Expressions
from fifthwheel.truck import Vehicle
from fifthwheel.truck.steering import STEERING, motion_signals


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
