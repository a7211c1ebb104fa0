"""What a learner estimates: the unknowns, the signals that it uses, and the model."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

from fifthwheel import dynamics
from fifthwheel.channels import SignalName
from fifthwheel.dynamics.saturation import TyreLaw
from fifthwheel.errors import SignalError
from fifthwheel.filters.scaling import Scaling
from fifthwheel.identify.online.online_model import OnlineModel, chain_parameters, online_model
from fifthwheel.identify.settings import OneStage
from fifthwheel.identify.setup import simplified
from fifthwheel.identify.unknowns.parameters import (
    estimated_parameters,
    given_parameters,
    lacks_roll_rate,
    model_parameters,
    one_stage_unknowns,
)
from fifthwheel.identify.unknowns.unknown import Unknown, UnknownKind, scaling
from fifthwheel.vehicle import Vehicle


@dataclass(frozen=True, kw_only=True, eq=False)
class OnlineProblem:
    """Unknowns, signals and model of a learner; made by `of`."""

    vehicle_file: Vehicle
    """The vehicle as given."""
    vehicle: Vehicle
    """The vehicle with the measured steer angles, and simplified as the settings say."""
    signals: frozenset[str]
    """Names of all measured signals."""
    settings: OneStage
    outputs: tuple[str, ...]
    """The measured signals that the filter compares with the model."""
    unknowns: tuple[Unknown, ...]
    """The estimated ones first."""
    not_identifiable: frozenset[str]
    """Estimated parameters of roll without a roll rate of their unit; they are considered at the value of the file."""
    model: OnlineModel
    """With the road's bank and the discrepancies as states if sensor errors are estimated."""
    scaling: Scaling
    """From z to the unknowns."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the unknowns."""
        return tuple(u.name for u in self.unknowns)

    @property
    def inputs(self) -> tuple[str, ...]:
        """The measured signals that drive the model: the speed and the steer angles."""
        return ("speed", *self.vehicle.steer_signals())

    @property
    def estimated(self) -> tuple[Unknown, ...]:
        """The unknowns that are not considered."""
        return tuple(u for u in self.unknowns if u.is_estimated)

    @property
    def considered(self) -> tuple[Unknown, ...]:
        """The unknowns that keep their prior mean."""
        return tuple(u for u in self.unknowns if not u.is_estimated)

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the estimated parameters, without sensor errors."""
        return tuple(u.name for u in self.estimated if not u.is_sensor_error)

    def given(self, outputs: Sequence[str]) -> dict[str, float]:
        """Every parameter of a model with these outputs, at the values of the vehicle, SI."""
        return model_parameters(self.vehicle, outputs, self.settings)

    def __reduce__(self) -> tuple[Any, ...]:
        """Compiled code is not copied: models of one structure are shared."""
        return OnlineProblem.of, (self.vehicle_file, self.signals, self.settings)

    @classmethod
    def of(cls, vehicle: Vehicle, signals: Iterable[str], settings: OneStage) -> "OnlineProblem":
        """Set up the problem; arguments and errors are those of `Learner`."""
        if settings.tyres == "auto":  # at small slip angles tyres that saturate are linear
            settings = replace(settings, tyres="saturating")
        vehicle_file, signals = vehicle, frozenset(signals)
        vehicle = simplified(vehicle, settings)
        if "speed" not in signals:
            raise SignalError("speed: not among the signals; the model needs the forward speed, add it in m/s")
        vehicle = vehicle.with_logged_steering(signals, "the signals")
        units = [unit.name for unit in vehicle.units]
        usable = [f"yaw_rate.{u}" for u in units] + [f"articulation.{u}" for u in units[1:]]
        usable += [f"roll_rate.{u}" for u in units]
        outputs = tuple(name for name in usable if name in signals)
        if not any(SignalName.of(name).quantity == "yaw_rate" for name in outputs):
            raise SignalError(
                f"yaw_rate.{units[0]}: not among the signals; a learner needs at least one yaw rate, add it"
            )
        estimated = estimated_parameters(vehicle, settings)
        not_identifiable = frozenset(name for name in estimated if lacks_roll_rate(name, outputs))
        values = given_parameters(vehicle, settings)
        unknowns = [
            replace(u, centre=values[u.name], kind=UnknownKind.CONSIDERED) if u.name in not_identifiable else u
            for u in one_stage_unknowns(vehicle, outputs, settings)
        ]
        unknowns.sort(key=lambda u: not u.is_estimated)
        if all(not u.is_estimated for u in unknowns):
            raise SignalError("fixed: no unknown is left to estimate; fix fewer parameters, or use an Observer")
        return cls(
            vehicle_file=vehicle_file,
            vehicle=vehicle,
            signals=signals,
            settings=settings,
            outputs=outputs,
            unknowns=tuple(unknowns),
            not_identifiable=not_identifiable,
            model=model_of(
                vehicle,
                outputs,
                unknowns,
                bank=settings.nuisances,
                discrepancies=settings.nuisances,
                tyres=settings.tyre_law,
            ),
            scaling=scaling(unknowns),
        )


def model_of(
    vehicle: Vehicle,
    outputs: Sequence[str],
    unknowns: Sequence[Unknown],
    *,
    bank: bool,
    discrepancies: bool,
    tyres: TyreLaw = "linear",
) -> OnlineModel:
    """The extended yaw-roll model of a vehicle with these outputs and unknowns."""
    free = chain_parameters(unknowns, tuple(dynamics.all_parameters(vehicle, outputs, extended=True, tyres=tyres)))
    chain = dynamics.model(vehicle, outputs, roll=True, bank=bank, extended=True, free=free, tyres=tyres)
    return online_model(chain, unknowns, discrepancies=discrepancies)
