"""The uncertainty of an assessed truck: of an identification, or of a vehicle file.

An identification brings the joint covariance of estimated and considered parameters. A vehicle file brings what it
states, and the defaults of masses and lengths (`truck.uncertainty`). On any other number it states nothing; such a
number gets the prior that an identification would give it (`ASSUMED`). Parameters of a file that is exact are exact.
"""

from collections.abc import Collection, Mapping

import numpy as np

from fifthwheel.base.names import PAYLOAD_HEIGHT, ends_with
from fifthwheel.estimate.identify import Identification
from fifthwheel.estimate.observe import Uncertainty
from fifthwheel.results.assess.truck import HALF_TRACK, Body
from fifthwheel.truck import Vehicle, changes
from fifthwheel.truck.quantities import quantity_of

ASSUMED: Mapping[str, float] = {
    "cornering_stiffness": quantity_of("cornering_stiffness").guess,
    PAYLOAD_HEIGHT: 0.1,
    "payload.floor_height": 0.05,
}
"""Sigma of parameters on which a vehicle file states nothing, as a fraction of the value, by the end of their path: as
a guess, or that of the height of a load that somebody measured."""


def assumed(vehicle: Vehicle) -> dict[str, float]:
    """Sigma, SI, of the parameters on which the vehicle file states nothing."""
    sigmas = {}
    for path, value in vehicle.parameters().items():
        row = quantity_of(path)
        own = row.sigma_of(value) if row.is_uncertain and value else 0.0
        sigma = next((fraction * abs(value) for end, fraction in ASSUMED.items() if ends_with(path, end)), own)
        if sigma and path not in vehicle.stated:
            sigmas[path] = sigma
    moved = {path for change in changes(vehicle) for path in change.slopes}
    return {path: sigma for path, sigma in sigmas.items() if path not in moved or "yaw_inertia" in path}


def of_vehicle(vehicle: Vehicle) -> Uncertainty:
    """The uncertainty of a vehicle file."""
    columns: list[Mapping[str, float]] = [change.slopes for change in changes(vehicle)]
    columns += [{path: sigma} for path, sigma in assumed(vehicle).items()]
    names = tuple(path for path in vehicle.parameters() if any(path in column for column in columns))
    S = np.array([[column.get(name, 0.0) for column in columns] for name in names]).reshape(len(names), len(columns))
    return Uncertainty(names=names, covariance=S @ S.T)


def of_identification(identification: Identification) -> Uncertainty:
    """The joint uncertainty of the parameters of an identified vehicle.

    Two stages have no joint covariance: their estimates then count as independent, and everything else as in the
    vehicle file.
    """
    vehicle = identification.vehicle
    if identification.covariance is not None:
        return identification.covariance.among(vehicle.parameters().keys())
    own = vehicle.parameters()
    sigmas = {e.name: e.sigma for e in identification.parameters if e.sigma is not None and e.name in own}
    return of_vehicle(vehicle.with_stated(sigmas))


def complete(
    uncertainty: Uncertainty, body: Body, *, replaced: Collection[str] = (), stated: Mapping[str, float]
) -> Uncertainty:
    """The uncertainty with that of the half track, and with the stated sigma, SI, of replaced parameters; without one
    these are exact."""
    kept = uncertainty.among([name for name in uncertainty.names if name not in replaced])
    sigmas = {name: stated[name] for name in replaced if stated.get(name)} | {HALF_TRACK: body.half_track_sigma}
    for name, sigma in sigmas.items():
        kept = kept.with_independent(name, sigma) if sigma else kept
    return kept
