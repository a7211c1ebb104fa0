"""Numerical matrices of the equations of motion at one speed."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import casadi as ca
import numpy as np

from fifthwheel._types import Array
from fifthwheel.dynamics import chain
from fifthwheel.dynamics.model import topology
from fifthwheel.errors import VehicleError
from fifthwheel.native import Scan, compiled
from fifthwheel.vehicle import Vehicle


@dataclass(frozen=True, kw_only=True)
class Matrices:
    """E x' = F x + G d and x' = A x + B d at one speed, for n states and k steered axles, SI."""

    states: tuple[str, ...]  # (n,) names of x
    E: Array  # (n, n) symmetric positive definite
    F: Array  # (n, n)
    G: Array  # (n, k)
    A: Array  # (n, n)
    B: Array  # (n, k)


@dataclass(frozen=True)
class _Structure:
    """The structure of a vehicle; equal for vehicles of equal topology."""

    vehicle: Vehicle = field(compare=False)
    identity: tuple[object, ...]


@compiled(Scan)
def _function(structure: _Structure, roll: bool, bank: bool) -> ca.Function:
    """sample = speed; constant = parameters; output = [E, F, G, A, B], by columns. There is no carry."""
    vehicle = structure.vehicle
    names = tuple(vehicle.parameters())
    nothing, u, p = ca.SX.sym("nothing", 0), ca.SX.sym("u"), ca.SX.sym("p", len(names))
    equations = chain.equations(dict(zip(names, ca.vertsplit(p), strict=True)), vehicle, roll=roll, bank=bank)
    A, B = equations.state_space(u)
    F = equations.A0 + equations.A1 / u + equations.A2 * u
    outputs = [ca.vec(ca.densify(m)) for m in (equations.E(), F, equations.B0 + equations.B2 * u, A, B)]
    return ca.Function("matrices", [nothing, u, p], [nothing, ca.vertcat(*outputs)])


def matrices(
    vehicle: Vehicle, speed: float, *, roll: bool, bank: bool = False, changed: Mapping[str, float] | None = None
) -> Matrices:
    """Matrices of the equations of motion at one speed.

    Args:
        vehicle: with its numbers.
        speed: m/s.
        roll: yaw and roll, or yaw only.
        bank: whether the bank of the road is a state, the last one.
        changed: values of parameters, by path, that replace those of the vehicle. They are not validated.

    Raises:
        VehicleError: the speed is not positive.
    """
    if not speed > 0:
        raise VehicleError(f"speed: expected above 0 m/s, got {speed:g}; the slip angle needs a rolling wheel")
    values = vehicle.parameters() | dict(changed or {})
    states, k = chain.state_names(vehicle, roll=roll, bank=bank), len(vehicle.steer_signals())
    n = len(states)
    scan = _function(_Structure(vehicle, topology(vehicle)), roll, bank)
    _, output = scan(np.zeros(0), np.array([[speed]]), np.array(list(values.values())))
    E, F, G, A, B = np.split(output[0], np.cumsum([n * n, n * n, n * k, n * n]))
    E, F, G, A, B = (matrix.reshape(n, -1, order="F") for matrix in (E, F, G, A, B))
    return Matrices(states=states, E=E, F=F, G=G, A=A, B=B)
