"""The unknowns of the dual filter."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

from fifthwheel.cheng_cebon_2011.settings import TwoStage
from fifthwheel.errors import VehicleError
from fifthwheel.identify.settings import CommonSettings
from fifthwheel.identify.unknowns.parameters import sensor_error_unknowns, stage_1_names, stage_2_names
from fifthwheel.identify.unknowns.unknown import BOUND_FACTOR, Unknown, UnknownKind, height_unknown
from fifthwheel.names import ParameterPath
from fifthwheel.vehicle import Vehicle


@dataclass(frozen=True, kw_only=True)
class DualUnknown(Unknown):
    """An unknown with its standard deviations in the dual filter."""

    start: float = 1.0  # of z at the start of the filter
    walk: float = 0.0  # that z gains per sample

    @classmethod
    def of(cls, unknown: Unknown, *, start: float = 1.0, walk: float = 0.0) -> Self:
        """The same unknown."""
        return cls(**vars(unknown), start=start, walk=walk)


def parameter_unknowns(vehicle: Vehicle, names: Sequence[str], settings: TwoStage) -> list[DualUnknown]:
    """The unknowns for those of the named parameters that are not fixed.

    Args:
        vehicle: its values are the prior means.
        names: among those of `stage_1_names` and `stage_2_names`.
        settings: of the identification.

    Raises:
        VehicleError: the settings fix a parameter that no stage estimates.
    """
    values = vehicle.parameters()
    possible = stage_1_names(vehicle) + stage_2_names(vehicle)
    for name in settings.fixed:
        if name not in possible:
            raise VehicleError(
                f"{name}: cannot be fixed, because two stages do not estimate it; they estimate {', '.join(possible)}"
            )
    return [_unknown(name, values[name], settings) for name in names if name not in settings.fixed]


def _unknown(name: str, value: float, settings: TwoStage) -> DualUnknown:
    if ParameterPath.of(name).is_payload_height:
        return DualUnknown.of(
            height_unknown(name, value, settings),
            start=(settings.initial_height_sigma or settings.height_prior) / settings.height_prior,
            walk=settings.height_walk / settings.height_prior,
        )
    return DualUnknown(
        name=name,
        centre=value,
        scale=settings.prior if settings.logarithmic else settings.prior * value,
        lower=value / BOUND_FACTOR,
        upper=value * BOUND_FACTOR,
        kind=UnknownKind.PARAMETER,
        logarithmic=settings.logarithmic,
        start=(settings.initial_sigma or settings.prior) / settings.prior,
        walk=settings.random_walk / settings.prior,
    )


def sensor_unknowns(vehicle: Vehicle, outputs: Sequence[str], settings: CommonSettings) -> list[DualUnknown]:
    """The errors of the sensors; arguments as in `sensor_error_unknowns`."""
    return [DualUnknown.of(unknown) for unknown in sensor_error_unknowns(vehicle, outputs, settings)]
