"""What the logs tell about the unknowns: Fisher information, and a covariance that survives coloured residuals."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from fifthwheel import dynamics
from fifthwheel.dynamics import ChainModel
from fifthwheel.filters import dual
from fifthwheel.filters.dual import DualState
from fifthwheel.identify.parameters import Unknown, scaling
from fifthwheel.identify.settings import TwoStage
from fifthwheel.identify.stage import Log, begin, channel_noise, long_run, shift_delays
from fifthwheel.logs import Record
from fifthwheel.observe import noise as variances
from fifthwheel.observe.prepare import in_time, prepare
from fifthwheel.simulate import response
from fifthwheel.vehicle import Vehicle

Array = NDArray[np.float64]


class Verdict(StrEnum):
    """What an estimate is worth."""

    CONVERGED = "converged"
    NOT_CONVERGED = "not_converged"
    NOT_EXCITED = "not_excited"
    NOT_IDENTIFIABLE = "not_identifiable"
    AT_BOUND = "at_bound"
    HELD = "held"


@dataclass(frozen=True, kw_only=True)
class Information:
    """All unknowns together, each log's own ones apart; in units of z, whose prior is N(0, 1)."""

    names: tuple[str, ...]  # a log's own unknowns carry its number: "...offset@0"
    covariance: Array  # inverse of information plus prior
    robust: Array  # the same by scores that may hang together (sandwich)
    bias: Array  # what leaving out roll moves each unknown by, zero where the model has roll
    runaway: bool  # the vehicle is unstable at these values; all else here is then the prior

    def excited(self, name: str, limit: float) -> bool:
        """Whether the logs bring an unknown's sigma below `limit` times its prior's, were the model right.

        True of an unknown that this information is not about, and of all where the vehicle runs away.
        """
        if self.runaway or name not in self.names:
            return True
        i = self.names.index(name)
        return bool(self.covariance[i, i] < limit**2)

    @property
    def sigma(self) -> Array:
        """Standard deviation of each z: the larger of both, and the bias."""
        return np.sqrt(np.maximum(np.diag(self.covariance), np.diag(self.robust)) + self.bias**2)


def evaluate(
    model: ChainModel,
    vehicle: Vehicle,
    logs: Sequence[Log],
    unknowns: Sequence[Unknown],
    *,
    values: Mapping[str, float],
    settings: TwoStage,
    gated: bool = True,
) -> Information:
    """Information of all logs at the estimate, all unknowns free together.

    Without `gated` every measurement counts, also those that are far from what the model predicts: before a fit, most
    may be.

    The filter runs once more with its parameters frozen; each channel leaves an innovation e, its variance s and its
    gradient g to z. Information is the sum of g g'/s plus the prior. The sandwich puts the scores' own long-run
    covariance (Newey and West 1987) in the middle: where innovations are what the filter thinks, both agree.
    """
    names = [u.name for u in unknowns]
    own = [u.each_log for u in unknowns]
    full = [name for name, flag in zip(names, own, strict=True) if not flag]
    full += [f"{name}@{i}" for i in range(len(logs)) for name, flag in zip(names, own, strict=True) if flag]
    size = len(full)
    information, middle, push = np.eye(size), np.eye(size), np.zeros(size)
    for i, log in enumerate(logs):
        places = [full.index(f"{name}@{i}" if flag else name) for name, flag in zip(names, own, strict=True)]
        for section in log.sections:
            frozen = _Frozen(model, vehicle, unknowns, values, log, settings)
            scores, gram = frozen.scores(section, gated=gated)
            lags = max(int(settings.correlation_time * section.rate), 1)
            information[np.ix_(places, places)] += gram
            middle[np.ix_(places, places)] += long_run(scores, lags)
            if not model.roll:
                push[places] += frozen.roll_left_out(section)
    runaway = not np.linalg.cond(information) < 1e14  # an unstable vehicle: its numbers tell nothing
    if runaway:
        information, middle, push = np.eye(size), np.eye(size), np.zeros(size)
    covariance = np.asarray(np.linalg.inv(information), dtype=np.float64)
    return Information(
        names=tuple(full),
        covariance=covariance,
        robust=covariance @ middle @ covariance,
        bias=covariance @ push,
        runaway=runaway,
    )


class _Frozen:
    """The dual filter at fixed parameters over one log's sections."""

    def __init__(
        self,
        model: ChainModel,
        vehicle: Vehicle,
        unknowns: Sequence[Unknown],
        values: Mapping[str, float],
        log: Log,
        settings: TwoStage,
    ) -> None:
        self.model, self.vehicle, self.settings, self.log = model, vehicle, settings, log
        self.values = {u.name: u.centre for u in unknowns} | dict(values) | log.errors
        self.names = [u.name for u in unknowns]
        self.own = scaling(unknowns)
        self.z = self.own.to_z(np.array([self.values[name] for name in self.names]))
        self.scaling = shift_delays(self.own, self.names, self.values)

    def run(self, section: Record) -> tuple[Array, Array, Array]:
        """Innovations, weights 1/variance (zero where not used) and gradients: (M, m), (M, m), (M, m, n)."""
        k = len(self.names)
        rows = prepare(self.model, self.vehicle, section, errors=self.values)
        x0, P0, sensitivity = begin(self.vehicle, self.names, self.own, self.z, rows, roll=self.model.roll)
        start = DualState(x=x0, P=P0, z=self.z, Pz=np.zeros((k, k)), sensitivity=sensitivity)
        found = dual.run(
            self.model,
            rows.rows,
            c=self.model.known_values(dynamics.all_parameters(self.vehicle, self.model.outputs)),
            noise=channel_noise(self.model, self.vehicle, self.log, self.settings),
            scaling=self.scaling,
            start=start,
        )
        return found.innovation, found.accepted / found.innovation_variance, found.sensitivity

    def scores(self, section: Record, *, gated: bool) -> tuple[Array, Array]:
        """Scores (N, n) of the samples and their information (n, n).

        The gradients are those of a vehicle that only its inputs move. Along the filtered states they would hold the
        sensors' noise, which looks like excitation: on a straight road it is all there is.
        """
        innovation, weight, _ = self.run(section)
        _, ungated, gradient = self.run(self.by_inputs(section, roll=self.model.roll))
        weight = weight if gated else ungated
        scores = np.einsum("km,kmn->kn", innovation * weight, gradient)
        rows = (np.sqrt(weight)[..., None] * gradient).reshape(-1, gradient.shape[-1])
        gram = rows.T @ rows
        return scores[(weight > 0).any(axis=1)], gram

    def roll_left_out(self, section: Record) -> Array:
        """Score (n,) that the yaw-only model gathers on a vehicle that rolls as the vehicle file says.

        Both vehicles have the estimated parameters and no noise, so that only the missing roll is left.
        """
        total = []
        for roll in (True, False):
            innovation, weight, gradient = self.run(self.by_inputs(section, roll=roll))
            total.append(np.einsum("km,kmn->n", innovation * weight, gradient))
        return np.asarray(total[0] - total[1])

    def by_inputs(self, section: Record, *, roll: bool) -> Record:
        """The section as the model at its estimate would have given it: no noise, the same samples missing."""
        own = set(self.vehicle.parameters())
        vehicle = self.vehicle.replace({name: value for name, value in self.values.items() if name in own})
        model = dynamics.model(vehicle, self.model.outputs, roll=roll)
        inputs = {name: section.input(name) for name in model.inputs}
        first = {name: float(v[0]) for name, v in inputs.items()}
        x0, _ = variances.steady(vehicle, first, self.values, roll=roll)
        values = dynamics.all_parameters(vehicle, model.outputs) | self.values
        moved = in_time(section, model.inputs, self.values)
        values |= {name: 0.0 for name in values if name.endswith(".delay")}
        _, shown = response(model, values, section.time, moved, x0)
        seen = {
            name: np.where(np.isfinite(section.signals[name]), shown[:, i], np.nan)
            for i, name in enumerate(model.outputs)
            if name in section.signals
        }
        return replace(section, signals=inputs | seen, reference={})
