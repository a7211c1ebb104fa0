"""What an identification with one load contains on the suspension, for the same truck with another load.

A log contains information on the product of payload height and compliance in roll. A log with a known payload therefore
determines the compliance, and a log with an unknown payload then determines its height. Errors of the roll stiffnesses,
the roll axes and the unladen bodies are correlated after the first log, so they are passed on as independent changes:
with the covariance C = D R D (standard deviations D, correlations R), the columns of D R^(1/2).
"""

from dataclasses import replace

import numpy as np

from fifthwheel.errors import SignalError, VehicleError
from fifthwheel.identify.result import Identification
from fifthwheel.identify.settings import OneStage
from fifthwheel.identify.verdict import Verdict
from fifthwheel.names import ends_with
from fifthwheel.vehicle import Vehicle
from fifthwheel.vehicle.uncertainty import Change

INDEPENDENT_OF_LOAD = (
    "roll_stiffness",
    "tyre_roll_stiffness",
    "roll_damping",
    "roll_axis_height",
    "sprung.cog_height",
    "sprung.roll_inertia",
)
"""Ends of the paths of parameters that stay the same with another payload."""


def independent_of_load(path: str) -> bool:
    """Whether a parameter stays the same with another payload."""
    return any(ends_with(path, end) for end in INDEPENDENT_OF_LOAD)


def with_suspension(vehicle: Vehicle, settings: OneStage, reference: Identification) -> tuple[Vehicle, OneStage]:
    """A vehicle with the suspension of an identification, and settings with its joint uncertainty.

    Args:
        vehicle: the same truck with another payload.
        settings: of the next identification.
        reference: by one stage, of a log with a known payload.

    Raises:
        SignalError: the identification has no joint covariance, lumps the payload into the body, or did not converge.
        VehicleError: the vehicle has other units or axle groups.
    """
    if reference.covariance is None:
        raise SignalError("suspension: the identification has no joint covariance; identify it in one stage")
    if not (settings.uniform_payload and getattr(reference.settings, "uniform_payload", True)):
        raise SignalError("suspension: expected a payload height in both identifications; leave out --any-load")
    if any(estimate.verdict is Verdict.NOT_CONVERGED for estimate in reference.parameters):
        raise SignalError("suspension: the identification with the known payload did not converge; see its report")
    values = reference.vehicle.parameters()
    carried = [path for path in values if independent_of_load(path)]
    if missing := [path for path in carried if path not in vehicle.parameters()]:
        raise VehicleError(
            f"{missing[0]}: not in {vehicle.name}, but in the identification of {reference.vehicle.name}; use the same"
            " names of units and axle groups in both vehicle files"
        )
    joint = reference.covariance.among(carried)
    sigma = np.sqrt(np.diag(joint.covariance))
    eigenvalues, axes = np.linalg.eigh(joint.covariance / np.outer(sigma, sigma))
    columns = sigma[:, None] * (axes * np.sqrt(np.maximum(eigenvalues, 0.0))) @ axes.T
    changes = tuple(
        Change(name=name, slopes=dict(zip(joint.names, column.tolist(), strict=True)))
        for name, column in zip(joint.names, columns.T, strict=True)
    )
    return vehicle.replace({path: values[path] for path in carried}), replace(settings, changes=changes)
