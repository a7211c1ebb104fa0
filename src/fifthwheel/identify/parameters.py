"""What is unknown: the parameters that are sought and the sensors' errors beside them, each with prior and bounds."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fifthwheel.errors import VehicleError
from fifthwheel.filters.dual import Scaling
from fifthwheel.identify.settings import Settings
from fifthwheel.vehicle import Vehicle


@dataclass(frozen=True, kw_only=True)
class Unknown:
    """One unknown: p = centre exp(scale z) or centre + scale z with z ~ N(0, 1), inside its bounds."""

    name: str
    centre: float
    scale: float
    lower: float
    upper: float
    logarithmic: bool = False
    nuisance: bool = False  # has a known prior mean, to which every pass returns
    each_log: bool = False  # another one in every log
    start: float = 1.0  # standard deviation of z at the start of the filter
    walk: float = 0.0  # standard deviation of z gained per sample


def scaling(unknowns: Sequence[Unknown]) -> Scaling:
    """All of them for the filter."""
    return Scaling(
        logarithmic=tuple(u.logarithmic for u in unknowns),
        **{field: np.array([getattr(u, field) for u in unknowns]) for field in ("centre", "scale", "lower", "upper")},
    )


def group_paths(vehicle: Vehicle) -> list[str]:
    """Of every axle group, front to rear."""
    return [unit.group_path(group) for unit in vehicle.units for group in unit.axle_groups]


def stage_1_names(vehicle: Vehicle) -> tuple[str, ...]:
    """Cornering stiffness of every axle group, yaw inertia of every unit behind the first."""
    groups = [f"{path}.cornering_stiffness" for path in group_paths(vehicle)]
    return (*groups, *[f"{unit.name}.yaw_inertia" for unit in vehicle.units[1:]])


def stage_2_names(vehicle: Vehicle) -> tuple[str, ...]:
    """Payload height of every unit that carries one."""
    return tuple(f"{unit.name}.payload.height" for unit in vehicle.units if unit.payload is not None)


def sought(vehicle: Vehicle, names: Sequence[str], settings: Settings) -> list[Unknown]:
    """The parameters to be estimated, those held left out; around the values of `vehicle`.

    Raises:
        VehicleError: a parameter to be held is none of those that the stages seek.
    """
    values, found = vehicle.parameters(), []
    everything = stage_1_names(vehicle) + stage_2_names(vehicle)
    for name in settings.held:
        if name not in everything:
            raise VehicleError(f"{name}: cannot be held, it is not estimated; estimated are {', '.join(everything)}")
    for name in names:
        if name in settings.held:
            continue
        value = values[name]
        if name.endswith(".payload.height"):
            start = settings.initial_payload_height
            found.append(
                Unknown(
                    name=name,
                    centre=value if start is None else start,
                    scale=settings.height_prior,
                    lower=0.01,
                    upper=3.5,
                    start=(settings.initial_height_sigma or settings.height_prior) / settings.height_prior,
                    walk=settings.height_walk / settings.height_prior,
                )
            )
        else:
            found.append(
                Unknown(
                    name=name,
                    centre=value,
                    scale=settings.prior if settings.logarithmic else settings.prior * value,
                    lower=value / 8,
                    upper=value * 8,
                    logarithmic=settings.logarithmic,
                    start=(settings.initial_sigma or settings.prior) / settings.prior,
                    walk=settings.random_walk / settings.prior,
                )
            )
    return found


def nuisances(vehicle: Vehicle, outputs: Sequence[str], settings: Settings) -> list[Unknown]:
    """Errors of the steered axles' and the outputs' sensors."""
    if not settings.nuisances:
        return []
    found = []
    for name in vehicle.steer_signals():
        found += [
            _error(f"{name}.offset", settings.steer_offset_prior, each_log=True),
            _error(f"{name}.gain", settings.steer_gain_prior, centre=1.0),
            _error(f"{name}.delay", settings.steer_delay_prior),
        ]
    priors = {"yaw_rate": settings.rate_offset_prior, "roll_rate": settings.rate_offset_prior}
    priors["articulation"] = settings.articulation_offset_prior
    for name in outputs:
        found.append(_error(f"{name}.offset", priors[name.split(".")[0]], each_log=True))
    return found


def _error(name: str, prior: float, *, centre: float = 0.0, each_log: bool = False) -> Unknown:
    return Unknown(
        name=name,
        centre=centre,
        scale=prior,
        lower=centre - 8 * prior,
        upper=centre + 8 * prior,
        nuisance=True,
        each_log=each_log,
    )
