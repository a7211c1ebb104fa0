"""The unknowns of a model, and its dual filter over segments of logs: what stages and posterior have in common."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from fifthwheel import dynamics
from fifthwheel._types import Array
from fifthwheel.channels import is_sensor_error
from fifthwheel.cheng_cebon_2011.dual import DualCoupling, DualFiltered, DualState, run_dual
from fifthwheel.cheng_cebon_2011.settings import TwoStage
from fifthwheel.dynamics import ChainModel
from fifthwheel.filters import Noise, variances
from fifthwheel.filters.initial_state import initial_state, steady_initial_state
from fifthwheel.filters.scaling import Scaling
from fifthwheel.filters.step_rows import StepRows, step_rows
from fifthwheel.identify.dataset import LogData
from fifthwheel.identify.unknowns.parameters import known_of, sensor_error_unknowns
from fifthwheel.identify.unknowns.unknown import Unknown, linear_unknown, logarithmic_unknown, scaling
from fifthwheel.names import ends_with
from fifthwheel.record import Record
from fifthwheel.vehicle import Vehicle


def parameter_unknowns(vehicle: Vehicle, names: Sequence[str], settings: TwoStage) -> list[Unknown]:
    """The unknowns for those of the named parameters that are not exact; the vehicle has the prior means."""
    values = vehicle.parameters()
    return [
        _unknown(name, values[name], settings)
        for name in names
        if not known_of(name, values[name], settings, reported=True).exact
    ]


def sensor_unknowns(vehicle: Vehicle, outputs: Sequence[str], settings: TwoStage) -> list[Unknown]:
    """The unknown sensor errors."""
    return [u for u in sensor_error_unknowns(vehicle, outputs, settings) if settings.uses(u.name)]


def _unknown(name: str, value: float, settings: TwoStage) -> Unknown:
    if ends_with(name, "payload.height"):
        initial = settings.initial_payload_height
        return linear_unknown(name, value if initial is None else initial, settings.height_prior)
    unknown = logarithmic_unknown(name, value, settings.prior)
    return unknown if settings.logarithmic else replace(unknown, logarithmic=False, scale=settings.prior * value)


@dataclass(frozen=True, kw_only=True)
class DualProblem:
    """A model with n states and m channels in which n_p unknowns are free."""

    vehicle: Vehicle  # with the axles locked whose steer angle is not logged
    outputs: tuple[str, ...]
    roll: bool
    unknowns: tuple[Unknown, ...]
    settings: TwoStage

    @cached_property
    def model(self) -> ChainModel:
        """In which all unknowns are free."""
        return dynamics.model(self.vehicle, self.outputs, roll=self.roll, free=self.names)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Of the unknowns."""
        return tuple(u.name for u in self.unknowns)

    @cached_property
    def scaling(self) -> Scaling:
        """The transformation between z and the values of the unknowns."""
        return scaling(self.unknowns)

    def values(self, shared: Mapping[str, float], log: LogData) -> dict[str, float]:
        """Values of the unknowns in a log, SI; prior means where nothing is estimated yet."""
        return {**{u.name: u.centre for u in self.unknowns}, **shared, **log.errors}

    def z(self, values: Mapping[str, float]) -> Array:
        """z (n_p,) of values of the unknowns, SI."""
        return self.scaling.to_z(np.array([values[name] for name in self.names]))

    def rows(self, segment: Record, values: Mapping[str, float]) -> StepRows:
        """The rows of a segment, to whose inputs the delays among the values are applied."""
        return step_rows(self.model, self.vehicle, segment, errors=values)

    def run(
        self,
        log: LogData,
        rows: StepRows,
        values: Mapping[str, float],
        *,
        z: Array,
        Pz: Array,
        walk: float = 1.0,
        coupling: DualCoupling | None = None,
    ) -> DualFiltered:
        """The dual filter over a segment of a log, from z (n_p,) and its covariance (n_p, n_p) before it.

        `values` are those of `rows`; `walk` is the factor that forgetting has left of the random walk.
        """
        x0, P0, sensitivity = self.initial_state(z, rows)
        return run_dual(
            self.model,
            rows[:],
            c=self.model.known_values(dynamics.all_parameters(self.vehicle, self.model.outputs)),
            noise=self._noise(log),
            scaling=self.shifted_scaling(values),
            start=DualState(x=x0, P=P0, z=z, Pz=Pz, sensitivity=sensitivity, walk=walk),
            coupling=coupling,
        )

    def initial_state(self, z: Array, rows: StepRows) -> tuple[Array, Array, Array]:
        """Initial state (n,), its covariance (n, n), and its derivative dx/dz (n, n_p) by forward differences."""

        def values(z: Array) -> dict[str, float]:
            return dict(zip(self.names, self.scaling.to_p(z).tolist(), strict=True))

        vehicle, first, step = self.vehicle, rows.first, 1e-5
        x0, P0 = initial_state(vehicle, first, values(z), roll=self.roll, steer_sigma=rows.steer_sigma)
        shifted = [
            steady_initial_state(vehicle, first, values(z + step * row), roll=self.roll)[0] for row in np.eye(len(z))
        ]
        return x0, P0, (np.column_stack(shifted) - x0[:, None]) / step

    def shifted_scaling(self, values: Mapping[str, float]) -> Scaling:
        """The scaling for rows to which the delays in `values` have been applied: the model has the remainder."""
        applied = [values.get(name, 0.0) if is_sensor_error(name, "delay") else 0.0 for name in self.names]
        return replace(self.scaling, centre=self.scaling.centre - np.array(applied))

    def _noise(self, log: LogData) -> Noise:
        """Process noise, and the effective noise variance of each channel of a log."""
        # at least 1e-9 of the default: a covariance that decays to denormal numbers is slow to compute
        factor = max(self.settings.process_noise, 1e-9)
        return Noise(
            process=variances.process_covariance(self.model.states, variances.PROCESS_VARIANCE, factor),
            measurement=np.array([log.effective_variance(name) for name in self.model.outputs]),
            gate=self.settings.gate,
        )
