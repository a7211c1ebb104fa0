"""The unknowns of a model, and its dual filter over segments of logs: what stages and posterior have in common."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from fifthwheel.apps.cheng_cebon_2011.dual import DualCoupling, DualFiltered, DualState, run_dual
from fifthwheel.apps.cheng_cebon_2011.settings import TwoStage
from fifthwheel.base.names import PAYLOAD_HEIGHT, ends_with
from fifthwheel.base.types import Array
from fifthwheel.data.channels import is_sensor_error
from fifthwheel.data.record import Record
from fifthwheel.estimate.filters import Noise, variances
from fifthwheel.estimate.filters.initial_state import initial_state, steady_initial_state
from fifthwheel.estimate.filters.scaling import Scaling
from fifthwheel.estimate.filters.step_rows import StepRows, step_rows
from fifthwheel.estimate.identify.dataset import LogData
from fifthwheel.estimate.identify.statement import Stated, Statement, applies
from fifthwheel.estimate.identify.unknowns.parameters import known_of, sensor_error_unknowns
from fifthwheel.estimate.identify.unknowns.unknown import Unknown, linear_unknown, logarithmic_unknown, scaling
from fifthwheel.model import dynamics
from fifthwheel.model.dynamics import ChainModel
from fifthwheel.truck import Vehicle

PRIOR = 0.3
"""Prior standard deviation of a stiffness or inertia of which nothing is stated, as a fraction of its value."""
HEIGHT_PRIOR = 0.1, 1.0
"""Prior mean and standard deviation of a payload height of which nothing is stated, m; section 3.3 starts there."""


def parameter_unknowns(vehicle: Vehicle, names: Sequence[str], settings: TwoStage) -> list[Unknown]:
    """The unknowns for those of the named parameters that are not exact; the vehicle has the prior means."""
    values = vehicle.parameters()
    known = [known_of(name, values[name], settings, reported=True) for name in names]
    return [_unknown(each, settings) for each in known if not each.exact]


def sensor_unknowns(vehicle: Vehicle, outputs: Sequence[str], settings: TwoStage) -> list[Unknown]:
    """The unknown sensor errors."""
    return [u for u in sensor_error_unknowns(vehicle, outputs, settings) if settings.uses(u.name)]


def _unknown(known: Stated, settings: TwoStage) -> Unknown:
    name, value, sigma = known.name, known.value, known.sigma
    if ends_with(name, PAYLOAD_HEIGHT):
        return linear_unknown(name, *((value, sigma) if sigma else HEIGHT_PRIOR))
    prior = sigma / value if sigma else PRIOR
    unknown = logarithmic_unknown(name, value, prior)
    return unknown if settings.logarithmic else replace(unknown, logarithmic=False, scale=prior * value)


def sample_period(rows: StepRows) -> float:
    """Usual time between two samples, s."""
    return float(np.median(np.diff(rows.time[rows.sample_indices])))


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
            noise=self._noise(log, rows),
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

    def _noise(self, log: LogData, rows: StepRows) -> Noise:
        """Process noise per second, and the effective noise variance of each channel of a log."""
        process = variances.process_covariance(self.model.states, variances.PROCESS_VARIANCE)
        stated = {Statement(name=pattern): variance for pattern, variance in self.settings.Q_x.items()}
        for i, name in enumerate(self.model.states):
            if found := [each for each in stated if applies(each, name)]:
                own = stated[max(found, key=lambda each: each.rank)] / sample_period(rows)
                # at least 1e-9 of the default: a covariance that decays to denormal numbers is slow to compute
                process[i, i] = max(own, 1e-9 * process[i, i])
        return Noise(
            process=process,
            measurement=np.array([log.effective_variance(name) for name in self.model.outputs]),
            gate=self.settings.gate,
        )
