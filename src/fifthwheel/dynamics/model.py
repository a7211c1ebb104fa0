"""The chain as a discrete-time model for filters: x+ = f(x, dt, d, p, c), y = h(x, d, p, c).

Within a step the speed is its mean and the steer angles go linearly from the sample before to this one. The step is
the Taylor series of the exact solution, with an error under 1e-6 as long as dt stays below `steps.longest`.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from fifthwheel.dynamics import chain, sensors
from fifthwheel.errors import SignalError
from fifthwheel.vehicle import Vehicle

Array = NDArray[np.float64]
ORDER = {(False, False): 5, (True, False): 6, (False, True): 9, (True, True): 9}
"""Of the Taylor series, by (with roll, side forces with a lag): a step a sample of 100 Hz up to motorway speeds."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ChainModel:
    """A chain of units for the filters; built by `model`.

    d = [speed and steer angles at the sample before, speed and steer angles at this one]; steer angles as measured.
    """

    vehicle: Vehicle  # its topology; the numbers come through p and c
    roll: bool
    bank: bool  # whether the road's lean is a state
    states: tuple[str, ...]
    inputs: tuple[str, ...]  # speed and steer signals
    outputs: tuple[str, ...]  # measured signals
    free: tuple[str, ...]  # names of p
    known: tuple[str, ...]  # names of c
    transition: ca.Function
    observation: ca.Function
    state_jacobian: ca.Function  # (x, dt, d, p, c) -> dx+/dx, the state transition matrix
    rates: ca.Function  # (x, x+, dt, d, p, c) -> x' where a step begins and where it ends

    def known_values(self, values: Mapping[str, float]) -> Array:
        """c from values by name."""
        return np.array([values[name] for name in self.known], dtype=np.float64)

    def free_values(self, values: Mapping[str, float]) -> Array:
        """p from values by name."""
        return np.array([values[name] for name in self.free], dtype=np.float64)


def steer_parameters(vehicle: Vehicle) -> dict[str, float]:
    """What a steer sensor may do wrong, with defaults: angle = gain (shown - offset), shown late by `delay` seconds.

    The model takes a delay out to first order, which is meant for the small rest that rows already moved by most of it
    leave; outputs that see the steer angle directly (an accelerometer, the coupling force) do not take it out at all.
    """
    own: dict[str, float] = {}
    for name in vehicle.steer_signals():
        own |= {f"{name}.gain": 1.0, f"{name}.offset": 0.0, f"{name}.delay": 0.0}
    return own


def all_parameters(vehicle: Vehicle, outputs: Sequence[str]) -> dict[str, float]:
    """Every parameter that a model of these outputs has, vehicle and sensors, with its value."""
    values = vehicle.parameters() | steer_parameters(vehicle)
    for name in outputs:
        values |= sensors.sensor_parameters(vehicle, name)
    return values


def topology(vehicle: Vehicle) -> tuple[object, ...]:
    """What makes two vehicles share one model: all but the numbers."""
    payloads = tuple(unit.payload.shape if unit.payload else None for unit in vehicle.units)
    return (tuple(vehicle.parameters()), vehicle.steer_signals(), payloads, chain.lagging_groups(vehicle))


_models: dict[tuple[object, ...], ChainModel] = {}


def model(
    vehicle: Vehicle, outputs: Sequence[str], *, roll: bool, free: Sequence[str] = (), bank: bool = False
) -> ChainModel:
    """The model of a vehicle whose sensors show `outputs`; the same one for every vehicle of the same make-up.

    Args:
        vehicle: units, axles, couplings.
        outputs: signals such as "yaw_rate.tractor"; also "bank.road" where that is a state.
        roll: yaw and roll, or yaw only.
        free: parameters for p, by the names in `all_parameters`; all others go to c.
        bank: the road's lean is a state.

    Raises:
        SignalError: an output that the vehicle or the yaw-only model does not have.
        KeyError: a free parameter that does not exist.
    """
    for name in outputs:
        if name == chain.BANK and bank:
            continue
        sensors.unit_index(vehicle, name)
        if not roll and name.partition(".")[0] in sensors.NEEDS_ROLL:
            raise SignalError(f"{name}: the yaw-only model has no roll; use the yaw-roll model or leave the signal out")
    key = (topology(vehicle), tuple(outputs), roll, tuple(free), bank)
    if key not in _models:
        _models[key] = _build(vehicle, tuple(outputs), roll, tuple(free), bank)
    return _models[key]


def _build(vehicle: Vehicle, outputs: tuple[str, ...], roll: bool, free: tuple[str, ...], bank: bool) -> ChainModel:
    names = tuple(all_parameters(vehicle, outputs))
    unknown = set(free) - set(names)
    if unknown:
        raise KeyError(f"no such parameters: {sorted(unknown)}")
    known = tuple(name for name in names if name not in free)
    p, c = ca.SX.sym("p", len(free)), ca.SX.sym("c", len(known))
    value = dict(zip(free, ca.vertsplit(p), strict=True)) if free else {}
    value |= dict(zip(known, ca.vertsplit(c), strict=True))
    states, steers = chain.state_names(vehicle, roll=roll, bank=bank), vehicle.steer_signals()
    n, k = len(states), 1 + len(steers)
    x, dt, d = ca.SX.sym("x", n), ca.SX.sym("dt"), ca.SX.sym("d", 2 * k)
    shown, shown_after = d[1:k], d[k + 1 :]
    sensor = {word: ca.vertcat(*[value[f"{name}.{word}"] for name in steers]) for word in ("gain", "offset", "delay")}
    late = sensor["delay"] * (shown_after - shown) / ca.fmax(dt, 1e-3)
    before, after = (sensor["gain"] * (angle - sensor["offset"]) for angle in (shown, shown_after))
    equations = chain.equations(value, vehicle, roll=roll, bank=bank)
    A, B = equations.state_space((d[0] + d[k]) / 2)
    advance = sensor["gain"] * late
    order = ORDER[roll, bool(chain.lagging_groups(vehicle))]
    transition = taylor(A, B, x, before + advance, after + advance, dt, order)
    later = ca.SX.sym("later", n)
    ends = (A @ x + B @ (before + advance), A @ later + B @ (after + advance))
    matrix = transition_matrix(A, dt, order)

    speed = d[k]
    A, B = equations.state_space(speed)
    rates = A @ x + B @ after
    moving = chain.motion(value, vehicle, x, speed, roll=roll, bank=bank)
    w_rates = rates[list(equations.velocities)]
    turning = ca.vertcat(speed * moving.r[0], *([0] * (2 if roll else 1)))
    view = sensors.View(
        p=value,
        vehicle=vehicle,
        motion=moving,
        acceleration=tuple(J @ w_rates + turning for J in moving.jacobian),
        speed=speed,
        steer=dict(zip(steers, ca.vertsplit(after), strict=True)) if steers else {},
        roll=roll,
    )
    y = ca.vertcat(*[sensors.reading(view, name) for name in outputs]) if outputs else ca.SX(0, 1)
    return ChainModel(
        vehicle=vehicle,
        roll=roll,
        bank=bank,
        states=states,
        inputs=("speed", *steers),
        outputs=outputs,
        free=free,
        known=known,
        transition=ca.Function("transition", [x, dt, d, p, c], [transition]),
        observation=ca.Function("observation", [x, d, p, c], [ca.densify(y)]),
        state_jacobian=ca.Function("state_jacobian", [x, dt, d, p, c], [matrix]),
        rates=ca.Function("rates", [x, later, dt, d, p, c], [ca.densify(rate) for rate in ends]),
    )


def taylor(A: ca.SX, B: ca.SX, x: ca.SX, before: ca.SX, after: ca.SX, dt: ca.SX, order: int) -> ca.SX:
    """x after dt seconds of x' = A x + B d, d going linearly from `before` to `after`; its Taylor series."""
    drive, change = B @ before, B @ (after - before)
    term = dt * (A @ x + drive)
    total = x + term
    for k in range(2, order + 1):
        term = dt * (A @ term + (change if k == 2 else 0)) / k
        total = total + term
    return ca.densify(total)


def transition_matrix(A: ca.SX, dt: ca.SX, order: int) -> ca.SX:
    """The Taylor series of exp(A dt), of which `taylor` is the product with x, with far fewer products of matrices.

    Paterson and Stockmeyer (1973): I + M + M^2/2 + M^3 (I/3! + M/4! + M^2/5! + M^3 (I/6! + ...)).
    """
    n = A.shape[0]
    M = A * dt
    powers = [ca.SX.eye(n), M, M @ M]
    cube = powers[2] @ M
    total = ca.SX(n, n)
    for first in reversed(range(0, order + 1, 3)):
        last = min(first + 2, order)
        part = sum((powers[k - first] / math.factorial(k) for k in range(first, last + 1)), ca.SX(n, n))
        total = part + (cube @ total if last < order else 0)
    return ca.densify(total)
