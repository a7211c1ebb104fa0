"""What is unknown: the parameters that are sought, what is known only roughly, and the sensors' errors beside them,
each with prior and bounds."""

from collections.abc import Container, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fifthwheel.errors import VehicleError
from fifthwheel.filters.dual import Scaling
from fifthwheel.identify.settings import ROUGHLY_KNOWN, Common, OneStage, TwoStage
from fifthwheel.vehicle import Vehicle
from fifthwheel.vehicle.part import suggestion


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
    rough: bool = False  # known roughly by the vehicle file, and estimated beside what is sought
    considered: bool = False  # never learned, but counted in every sigma
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


def sought(vehicle: Vehicle, names: Sequence[str], settings: TwoStage) -> list[Unknown]:
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


def one_stage_sought(vehicle: Vehicle, settings: OneStage) -> list[str]:
    """Paths of what the one-stage estimator seeks.

    Raises:
        VehicleError: a name that is no parameter, nor the end of one.
    """
    if settings.free is not None:
        names = expanded(vehicle, settings.free)
    else:
        heights = stage_2_names(vehicle)
        apart = [f"{unit.name}.sprung.{word}" for unit in vehicle.units[1:] for word in ("cog_height", "roll_inertia")]
        names = [*stage_1_names(vehicle), *(heights if settings.uniform_payload else apart)]
    held = expanded(vehicle, settings.held)
    return [name for name in names if name not in held]


ROLLING = ("payload.height", "sprung.cog_height", "sprung.roll_inertia")
"""Of a unit: what only its own roll rate tells."""


def unseen(name: str, channels: Container[str]) -> bool:
    """Whether a parameter of roll has no roll rate of its own unit among the channels: yaw rates tell of it at second
    hand only, by less than what any linear model errs."""
    unit, _, rest = name.partition(".")
    return rest in ROLLING and f"roll_rate.{unit}" not in channels


def expanded(vehicle: Vehicle, names: Iterable[str]) -> list[str]:
    """Paths from paths and ends of paths, each once.

    Raises:
        VehicleError: one that is neither.
    """
    known, found = vehicle.parameters(), []
    for name in names:
        fitting = [path for path in known if longest_ending(path, {name: 0.0})]
        if not fitting:
            raise VehicleError(f"{name}: no such parameter in {vehicle.name}; {suggestion(name, known)}")
        found += fitting
    return list(dict.fromkeys(found))


def one_stage_unknowns(vehicle: Vehicle, outputs: Sequence[str], settings: OneStage) -> list[Unknown]:
    """Everything but the initial states: what is sought, what is known roughly, what is considered, the sensors."""
    sought = one_stage_sought(vehicle, settings)
    values = vehicle.parameters()
    found = []
    for name in sought:
        if name.endswith(".payload.height"):
            start = settings.initial_payload_height
            centre = values[name] if start is None else start
            found.append(Unknown(name=name, centre=centre, scale=settings.height_prior, lower=0.01, upper=3.5))
        else:
            usual = settings.roll_inertia_prior if name.endswith(".sprung.roll_inertia") else settings.prior
            found.append(_logarithmic(name, values[name], settings.priors.get(name, usual)))
    taken = {*sought, *expanded(vehicle, settings.held)}
    for name in {*settings.priors, *settings.consider} - {*ROUGHLY_KNOWN}:
        if all(path in sought for path in expanded(vehicle, [name])) and name in settings.consider:
            raise VehicleError(f"{name}: is sought, so it cannot only be considered; hold it, or leave that out")
    loads = tuple(
        f"{name.removesuffix('payload.height')}sprung." for name in sought if name.endswith(".payload.height")
    )
    for table, considered in ((settings.priors, False), (settings.consider, True)):
        for name, value in values.items():
            key = longest_ending(name, table)
            # under a load whose height is sought, the body's own height would only be the same unknown twice
            vague = key != name and (value <= 0 or name.startswith(loads))
            if key is None or name in taken or vague:
                continue
            taken.add(name)
            found.append(_logarithmic(name, value, table[key], rough=not considered, considered=considered))
    sensors = nuisances(vehicle, outputs, settings)
    if settings.nuisances:
        sensors += [
            _error(f"{name}.gain", settings.rate_gain_prior, centre=1.0)
            for name in outputs
            if name.split(".")[0] in ("yaw_rate", "roll_rate")
        ]
    return found + sensors


def longest_ending(path: str, table: Mapping[str, float]) -> str | None:
    """The longest key of a table that is a path or the end of it, whole words only."""
    fitting = [key for key in table if path == key or path.endswith(f".{key}")]
    return max(fitting, key=len, default=None)


def _logarithmic(name: str, value: float, sigma: float, *, rough: bool = False, considered: bool = False) -> Unknown:
    if value <= 0:
        raise VehicleError(f"{name}: expected above 0 to be estimated, got {value:g}; hold it, or give it a value")
    return Unknown(
        name=name,
        centre=value,
        scale=sigma,
        lower=value / 8,
        upper=value * 8,
        logarithmic=True,
        rough=rough,
        considered=considered,
    )


def nuisances(vehicle: Vehicle, outputs: Sequence[str], settings: Common) -> list[Unknown]:
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
