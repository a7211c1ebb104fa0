"""What an estimation knows before it sees a sample: `identify`, the `Learner` and predictions begin with a `Setup`."""

from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from types import MappingProxyType
from typing import Any

import numpy as np

from fifthwheel.base.errors import VehicleError
from fifthwheel.base.types import Array
from fifthwheel.data.channels import is_sensor_error
from fifthwheel.estimate.filters.scaling import Scaling
from fifthwheel.estimate.filters.variances import require_units
from fifthwheel.estimate.identify.settings import CommonSettings, OneStage
from fifthwheel.estimate.identify.statement import prior_of
from fifthwheel.estimate.identify.unknowns.parameters import (
    estimated_parameters,
    given_parameters,
    known_of,
    lacks_roll_rate,
    one_stage_unknowns,
    reported_parameters,
    time_base_delays,
    with_stated_values,
)
from fifthwheel.estimate.identify.unknowns.unknown import Unknown, scaling
from fifthwheel.model import dynamics
from fifthwheel.model.dynamics import ChainModel
from fifthwheel.model.dynamics.state_space import slowest_decay
from fifthwheel.truck import Vehicle
from fifthwheel.truck.quantities import DISCREPANCY, ROAD_BANK

STIFFENING = 0.5
"""Step by which an unstable vehicle is stiffened, in units of z."""


def simplified(vehicle: Vehicle, settings: CommonSettings) -> Vehicle:
    """The vehicle as the settings demand: without relaxation lengths, with the payload as part of the body; a
    SignalError if they state noise of a signal whose unit it does not have."""
    require_units(vehicle, settings.stated_noise)
    if not settings.relaxation:
        vehicle = vehicle.replace({f"{path}.relaxation_length": 0.0 for path in vehicle.group_paths()})
    return vehicle if settings.uniform_payload else vehicle.lumped()


def with_tyre_law(vehicle: Vehicle, settings: OneStage) -> tuple[OneStage, str]:
    """The settings with one law in place of "auto", and a note for the user if the law is not the saturating one.

    Tyres that saturate need the static axle loads. Without them the tyres are linear, with an unknown softening.
    """
    if settings.tyres != "auto":
        return settings, ""
    try:
        vehicle.axle_loads()
    except VehicleError as error:
        return replace(settings, tyres="linear"), f"tyres: linear, because the axle loads are unknown. {error}"
    return replace(settings, tyres="saturating"), ""


@dataclass(frozen=True, kw_only=True, eq=False)
class Setup:
    """Vehicle, measured signals, unknowns and model of an estimation; made by `of`."""

    vehicle: Vehicle
    """Simplified as the settings demand, with the axles locked whose steer angle is not measured. Optional numbers that
    are unknowns, such as the self-steering of an axle, are 0 where the vehicle file does not give them."""
    settings: OneStage
    outputs: tuple[str, ...]
    """Measured signals that are compared with the model."""
    estimated: tuple[str, ...]
    """Paths of the parameters that the settings estimate."""
    unknowns: tuple[Unknown, ...]
    """All but the initial states; `Learner` has the estimated ones first."""

    def __getstate__(self) -> dict[str, Any]:
        """The fields; what is derived from them is computed again."""
        return {field.name: getattr(self, field.name) for field in fields(self)}

    @classmethod
    def of(cls, vehicle: Vehicle, outputs: Sequence[str], settings: OneStage) -> "Setup":
        """The setup of a vehicle that is simplified and steered as measured; a VehicleError if a name in the settings
        is unknown, or a parameter cannot be estimated."""
        unknowns, own = one_stage_unknowns(vehicle, outputs, settings), vehicle.parameters()
        added = {u.name: 0.0 for u in unknowns if u.name in vehicle.locations() and u.name not in own}
        return cls(
            vehicle=vehicle.replace(added) if added else vehicle,
            settings=settings,
            outputs=tuple(outputs),
            estimated=tuple(estimated_parameters(vehicle, settings)),
            unknowns=tuple(unknowns),
        )

    def with_time_bases(self, time_bases: Mapping[str, str]) -> "Setup":
        """The setup with the delay of each further time base.

        Signals that `time_bases` does not list are on the main one.
        """
        main = time_bases.get(self.vehicle.steer_signals()[0], "")
        more = time_base_delays(time_bases, main, self.outputs, self.settings)
        return replace(self, unknowns=(*self.unknowns, *more))

    def considering(self, names: Container[str]) -> "Setup":
        """The setup in which some unknowns are considered: parameters at the values of the vehicle, changes at 0."""

        def considered(u: Unknown) -> Unknown:
            centre = u.centre if u.moves else self.given.get(u.name, u.centre)
            return replace(u, centre=centre, estimated=False)

        return replace(self, unknowns=tuple(considered(u) if u.name in names else u for u in self.unknowns))

    def with_unknown(self, unknown: Unknown) -> "Setup":
        """The setup with another unknown of the same name."""
        return replace(self, unknowns=tuple(unknown if u.name == unknown.name else u for u in self.unknowns))

    @cached_property
    def fixed(self) -> tuple[str, ...]:
        """Paths of the parameters that would be estimated, if the settings did not state that they are exact."""
        reported = reported_parameters(self.vehicle, self.settings)
        return tuple(n for n in reported if known_of(n, self.given[n], self.settings, reported=True).exact)

    @cached_property
    def bank_sigma(self) -> float:
        """Prior standard deviation of the mean bank of a segment, rad; 0 if the road is level."""
        return prior_of(self.settings.given, ROAD_BANK)[1]

    @cached_property
    def has_discrepancies(self) -> bool:
        """Whether the model of a learner has a discrepancy: that it has none is stated."""
        return prior_of(self.settings.given, DISCREPANCY)[1] > 0

    @cached_property
    def without_roll_rate(self) -> frozenset[str]:
        """Estimated parameters that are identifiable only from a roll rate that is not measured."""
        return frozenset(name for name in self.estimated if lacks_roll_rate(name, self.outputs))

    @property
    def inputs(self) -> tuple[str, ...]:
        """The measured signals that drive the model: the speed and the steer angles."""
        return ("speed", *self.vehicle.steer_signals())

    @cached_property
    def estimated_unknowns(self) -> tuple[Unknown, ...]:
        """The unknowns that the logs change."""
        return tuple(u for u in self.unknowns if u.estimated)

    @cached_property
    def considered_unknowns(self) -> tuple[Unknown, ...]:
        """The unknowns that keep their prior mean."""
        return tuple(u for u in self.unknowns if not u.estimated)

    @cached_property
    def given(self) -> dict[str, float]:
        """Every parameter of vehicle and tyres before the estimation, by path, SI."""
        return given_parameters(self.vehicle, self.settings)

    @cached_property
    def model(self) -> ChainModel:
        """The extended model with every parameter free."""
        return dynamics.model(
            self.vehicle,
            self.outputs,
            roll=self.settings.roll,
            bank=self.bank_sigma > 0,
            free=tuple(self._parameters),
            extended=True,
            tyres=self.settings.tyre_law,
            braking=True,
            long_steps=self.settings.form == "output_error",
        )

    @cached_property
    def scaling(self) -> Scaling:
        """The transformation between z and the values of the unknowns of one log."""
        return scaling(self.unknowns)

    def values(self, z: Array) -> dict[str, float]:
        """Values of the unknowns of one log by name, SI; z in the order of the unknowns."""
        p = np.clip(self.scaling.to_p(z), self.scaling.lower, self.scaling.upper)
        return {u.name: float(value) for u, value in zip(self.unknowns, p, strict=True)}

    def model_values(self, z: Array) -> dict[str, float]:
        """Every parameter of the model by name, SI; z in the order of the unknowns."""
        return self.changed_model(self.values(z))

    def changed_model(self, values: Mapping[str, float]) -> dict[str, float]:
        """The same with values of all unknowns by name, SI."""
        parameters = dict(self._parameters)
        parameters |= {u.name: values[u.name] for u in self.unknowns if not u.moves}
        for u in self.unknowns:
            for name, factor in u.moves.items():
                parameters[name] += factor * values[u.name]
        return parameters

    def slowest_decay(self, z: Array, speeds: Sequence[float]) -> float:
        """Rate at which the slowest mode decays at any of the speeds, m/s, in 1/s; z in the order of the unknowns."""
        own, values = self.vehicle.parameters(), self.model_values(z)
        changed = {name: values[name] for name in own}
        self.vehicle.replace(changed)  # only to check it: such a vehicle may be impossible
        return slowest_decay(self.vehicle, *speeds, roll=self.settings.roll, changed=changed)

    def stiffened(self, z: Array, speeds: Sequence[float], least: float = 0.0) -> Array:
        """z with stiffer tyres behind the first group, until the slowest mode decays faster than at the rate `least`,
        1/s, at all speeds, m/s."""
        _, *behind_first = [f"{path}.cornering_stiffness" for path in self.vehicle.group_paths()]
        places = [i for i, u in enumerate(self.unknowns) if u.name in behind_first and u.estimated]
        limits = self.scaling.to_z(self.scaling.upper)
        z = z.copy()
        while self.slowest_decay(z, speeds) <= least and places and z[places[0]] < limits[places[0]]:
            z[places] += STIFFENING
        return z

    def given_to_model(self, outputs: Sequence[str]) -> dict[str, float]:
        """Every parameter of an extended model with these outputs before the estimation, by name, SI."""
        values = dynamics.all_parameters(self.vehicle, outputs, extended=True, tyres=self.settings.tyre_law)
        others = (*self.given, dynamics.TIME_SCALE)
        beyond = {n: value for n, value in values.items() if n not in others and not is_sensor_error(n)}
        return values | with_stated_values(beyond, self.settings) | self.given

    @cached_property
    def _parameters(self) -> Mapping[str, float]:
        """Every parameter of the own model before the estimation, by name, SI."""
        return MappingProxyType(self.given_to_model(self.outputs))
