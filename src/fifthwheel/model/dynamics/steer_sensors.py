"""Steer angles of the wheels from measured ones, and the reverse: by `true_value` of their channel, its only source."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from fifthwheel.base.native import Scan, compiled
from fifthwheel.base.types import Array
from fifthwheel.data.channels import STEER
from fifthwheel.truck import Vehicle

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
