"""Numerical matrices of the equations of motion at one speed."""

from collections.abc import Mapping
from dataclasses import dataclass

import casadi as ca
import numpy as np

from fifthwheel._types import Array
from fifthwheel.dynamics import chain
from fifthwheel.dynamics.model import topology
from fifthwheel.errors import VehicleError
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


_functions: dict[tuple[object, ...], ca.Function] = {}


def _function(vehicle: Vehicle, roll: bool) -> ca.Function:
    """(parameters, speed) -> (E, F, G, A, B), one function for all vehicles of equal topology."""
    key = (topology(vehicle), roll)
    if key not in _functions:
        names = tuple(vehicle.parameters())
        p, u = ca.SX.sym("p", len(names)), ca.SX.sym("u")
        equations = chain.equations(dict(zip(names, ca.vertsplit(p), strict=True)), vehicle, roll=roll)
        A, B = equations.state_space(u)
        F = equations.A0 + equations.A1 / u + equations.A2 * u
        outputs = [ca.densify(m) for m in (equations.E(), F, equations.B0 + equations.B2 * u, A, B)]
        _functions[key] = ca.Function("matrices", [p, u], outputs)
    return _functions[key]


def matrices(vehicle: Vehicle, speed: float, *, roll: bool, changed: Mapping[str, float] | None = None) -> Matrices:
    """Matrices of the equations of motion at one speed.

    Args:
        vehicle: with its numbers.
        speed: m/s.
        roll: yaw and roll, or yaw only.
        changed: values of parameters, by path, that replace those of the vehicle. They are not validated.

    Raises:
        VehicleError: the speed is not positive.
    """
    if not speed > 0:
        raise VehicleError(f"speed: expected above 0 m/s, got {speed:g}; the slip angle needs a rolling wheel")
    values = vehicle.parameters() | dict(changed or {})
    E, F, G, A, B = (np.array(m) for m in _function(vehicle, roll)(list(values.values()), speed))
    return Matrices(states=chain.state_names(vehicle, roll=roll), E=E, F=F, G=G, A=A, B=B)
