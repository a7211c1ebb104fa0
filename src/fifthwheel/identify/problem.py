"""The one-stage problem: what all unknowns together make of all logs, and the exact derivatives of it.

z holds every unknown in units of its prior, z ~ N(0, 1): those of the truck once, those of a log once for each log and,
in the output-error form, the initial state of each section. The cost is minus the logarithm of the posterior,

    z' z / 2 + sum over samples and channels of rho(e / s) [+ log(s)],

rho being Huber's (1964). Output-error form (Ljung 1999, section 7.3): e is the log less the model that runs free from
the section's start. Prediction-error form: e is the innovation of a Kalman filter, s its own standard deviation.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from fifthwheel import dynamics
from fifthwheel.dynamics import ChainModel
from fifthwheel.filters import Noise, tangent
from fifthwheel.identify import likelihood
from fifthwheel.identify.gauss_newton import Quadratic
from fifthwheel.identify.likelihood import Part
from fifthwheel.identify.parameters import Unknown, scaling
from fifthwheel.identify.settings import OneStage
from fifthwheel.identify.stage import Log, colour
from fifthwheel.logs import Record
from fifthwheel.observe import noise as variances
from fifthwheel.observe.prepare import Rows, prepare, swing
from fifthwheel.vehicle import Vehicle

Array = NDArray[np.float64]
Directions = Literal["none", "learned", "all"]


@dataclass(frozen=True, kw_only=True)
class _Run:
    """What one run through a section needs; k directions, n states."""

    rows: Rows
    p: Array  # the model's parameters
    along: Array  # their derivatives (k, n_p)
    x0: Array  # (n,)
    starts: Array  # its derivatives (k, n)
    P0: Array  # (n, n), where a filter begins
    places: NDArray[np.int64]  # of the unknowns that the directions are, none if there is one direction that is none


class Problem:
    """All logs of one truck.

    Args:
        model: with every parameter free, in the order of `dynamics.all_parameters`.
        vehicle: whose values the unknowns replace.
        logs: their `noise` holds each channel's variance; it is changed by `adapt`.
        unknowns: all but the initial states.
    """

    def __init__(
        self, model: ChainModel, vehicle: Vehicle, logs: Sequence[Log], unknowns: Sequence[Unknown], settings: OneStage
    ) -> None:
        self.model, self.vehicle, self.logs, self.settings = model, vehicle, logs, settings
        self.unknowns = tuple(unknowns)
        self.scaling = scaling(unknowns)
        self.given = dynamics.all_parameters(vehicle, model.outputs)
        self.free_run = settings.form == "output_error"
        own = [u.each_log for u in unknowns]
        names = [u.name for u in unknowns if not u.each_log]
        shared = {name: i for i, name in enumerate(names)}
        self.places: list[NDArray[np.int64]] = []  # of the unknowns, as log i sees them
        for i in range(len(logs)):
            places = [shared.get(u.name, -1) for u in unknowns]
            for j, flag in enumerate(own):
                if flag:
                    places[j] = len(names)
                    names.append(f"{unknowns[j].name}@{i}")
            self.places.append(np.array(places))
        self.starts: list[list[NDArray[np.int64]]] = []  # of each section's initial state
        for i, log in enumerate(logs):
            self.starts.append([])
            for j in range(len(log.sections)):
                count = len(model.states) if self.free_run else 0
                self.starts[i].append(np.arange(len(names), len(names) + count))
                names += [f"{state}@{i}.{j}" for state in model.states[:count]]
        self.names = tuple(names)
        self.spread = [[self._start_covariance(section) for section in log.sections] for log in logs]
        self._rows: dict[tuple[float, ...], Rows] = {}
        for log in logs:
            for name in model.outputs:
                log.noise.setdefault(name, variances.sensor(vehicle, name, settings.noise))
        self.colour = [dict.fromkeys(model.outputs, 1.0) for _ in logs]

    @property
    def nuisances(self) -> tuple[int, ...]:
        """Places of the sensors' errors and the initial states."""
        parameters = {u.name for u in self.unknowns if not u.nuisance}
        return tuple(i for i, name in enumerate(self.names) if name not in parameters)

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Of z, (k,) each; what is only considered keeps its prior mean."""
        lower, upper = np.full(len(self.names), -8.0), np.full(len(self.names), 8.0)
        for places in self.places:
            lower[places] = self.scaling.to_z(self.scaling.lower)
            upper[places] = self.scaling.to_z(self.scaling.upper)
            kept = places[[u.considered for u in self.unknowns]]
            lower[kept] = upper[kept] = 0.0
        return lower, upper

    def values(self, z: Array, log: int) -> dict[str, float]:
        """The unknowns' values as one log sees them."""
        p = np.clip(self.scaling.to_p(z[self.places[log]]), self.scaling.lower, self.scaling.upper)
        return {u.name: float(value) for u, value in zip(self.unknowns, p, strict=True)}

    def _start_covariance(self, section: Record) -> Array:
        """Cholesky factor of the initial state's prior covariance, at the vehicle file's values."""
        inputs = {name: section.input(name) for name in self.model.inputs}
        first = {name: float(v[0]) for name, v in inputs.items()}
        bank = self.settings.bank_prior if self.model.bank else None
        _, P0 = variances.initial(self.vehicle, first, {}, roll=self.model.roll, swing=swing(inputs), bank=bank)
        return np.asarray(np.linalg.cholesky(P0))

    def _prepared(self, i: int, j: int, values: Mapping[str, float]) -> Rows:
        late = tuple(value for name, value in values.items() if name.endswith(".delay"))
        key = (i, j, *late)
        if key not in self._rows:
            self._rows = {k: rows for k, rows in self._rows.items() if k[:2] != (i, j)}
            self._rows[key] = prepare(self.model, self.vehicle, self.logs[i].sections[j], errors=values)
        return self._rows[key]

    def parts(self, z: Array, i: int, j: int, *, directions: Directions = "all") -> Iterator[Part]:
        """Section j of log i at z, piece by piece; its derivatives by no unknown, by those that are learned, or by all,
        what is only considered too."""
        values = self.values(z, i)
        rows = self._prepared(i, j, values)
        # rows are moved by the delays, and only what is left of them is the model's
        p = self.model.free_values(self.given | values | {name: 0.0 for name in values if name.endswith(".delay")})
        factor, own = self.spread[i][j], self.starts[i][j]
        x0 = self._steady(rows.first, values)
        if self.free_run:
            x0 = x0 + factor @ z[own]
        if directions == "none":
            along, starts, places = np.zeros((1, len(p))), np.zeros((1, len(x0))), np.zeros(0, dtype=np.int64)
        else:
            which = [a for a, u in enumerate(self.unknowns) if directions == "all" or not u.considered]
            some = [self.unknowns[a] for a in which]
            slope = self.scaling.slope(np.array([values[u.name] for u in self.unknowns]))[which]
            along = np.zeros((len(some) + len(own), len(p)))
            along[np.arange(len(some)), [self.model.free.index(u.name) for u in some]] = slope
            starts = np.vstack([self._steady_slopes(some, rows.first, values) * slope[:, None], factor.T[: len(own)]])
            places = np.concatenate([self.places[i][which], own])
        run = _Run(rows=rows, p=p, along=along, x0=x0, starts=starts, P0=factor @ factor.T, places=places)
        return (self._free if self.free_run else self._filtered)(run, self.variance(i))

    def part(self, z: Array, i: int, j: int) -> Part:
        """Section j of log i at z as one piece."""
        first, *others = self.parts(z, i, j)
        if not others:
            return first
        pieces = [first, *others]
        slopes = [p.variance_jacobian for p in pieces if p.variance_jacobian is not None]
        return Part(
            time=np.concatenate([p.time for p in pieces]),
            error=np.concatenate([p.error for p in pieces]),
            variance=np.concatenate([p.variance for p in pieces]),
            jacobian=np.concatenate([p.jacobian for p in pieces], axis=1),
            variance_jacobian=np.concatenate(slopes, axis=1) if slopes else None,
            places=first.places,
        )

    def variance(self, log: int) -> Array:
        """Of every channel's noise, as it counts (m,)."""
        return np.array([self.logs[log].noise[name] * self.colour[log][name] for name in self.model.outputs])

    def _steady(self, first: Mapping[str, float], values: Mapping[str, float]) -> Array:
        x0, _ = variances.steady(self.vehicle, first, values, roll=self.model.roll)
        return np.append(x0, 0.0) if self.model.bank else x0

    def _steady_slopes(
        self, unknowns: Sequence[Unknown], first: Mapping[str, float], values: Mapping[str, float]
    ) -> Array:
        """Derivative of the steady state by some unknowns (k, n); central differences of a closed form."""
        slopes = np.zeros((len(unknowns), len(self.model.states)))
        moving = {*self.vehicle.parameters(), *dynamics.steer_parameters(self.vehicle)}
        for row, unknown in zip(slopes, unknowns, strict=True):
            if unknown.name in moving and not unknown.name.endswith(".delay"):
                step = 1e-4 * (unknown.centre * unknown.scale if unknown.logarithmic else unknown.scale)
                higher, lower = (
                    self._steady(first, {**values, unknown.name: values[unknown.name] + s}) for s in (step, -step)
                )
                row[:] = (higher - lower) / (2 * step)
        return slopes

    def _free(self, run: "_Run", variance: Array) -> Iterator[Part]:
        """The model from its start on, and what the log differs by."""
        m, k, rows = len(self.model.outputs), len(run.places), run.rows
        wide = 1 + 2 * len(self.model.inputs)
        chunks = tangent.in_chunks(
            tangent.simulation(self.model),
            rows.rows[:, :wide],
            start=run.x0,
            start_directions=run.starts,
            p=run.p,
            directions=run.along,
            others=np.zeros(0),
        )
        for chunk in chunks:
            here, sampled = _samples(rows, chunk.rows)
            row = rows.rows[sampled]
            measured = np.where(row[:, wide + m :] > 0, row[:, wide : wide + m], np.nan)
            yield Part(
                time=rows.time[sampled],
                error=measured - chunk.values[here],
                variance=np.broadcast_to(variance, measured.shape),
                jacobian=-chunk.slopes[:k, here],
                variance_jacobian=None,
                places=run.places,
            )

    def _filtered(self, run: "_Run", variance: Array) -> Iterator[Part]:
        """The filter's innovations and their variance."""
        m, k, rows = len(self.model.outputs), len(run.places), run.rows
        table = variances.PROCESS | {"bank": self.settings.bank_walk**2}
        process = variances.process(self.model.states, table, max(self.settings.process_noise, 1e-9))
        noise = Noise(process=process, measurement=variance, gate=self.settings.gate)
        start, start_directions = tangent.start_of_filter(run.x0, run.P0, run.starts)
        chunks = tangent.in_chunks(
            tangent.innovations(self.model),
            rows.rows,
            start=start,
            start_directions=start_directions,
            p=run.p,
            directions=run.along,
            others=noise.vector(),
        )
        for chunk in chunks:
            here, sampled = _samples(rows, chunk.rows)
            found, slopes = chunk.values[here], chunk.slopes[:k, here]
            yield Part(
                time=rows.time[sampled],
                error=np.where(found[:, 2 * m :] > 0, found[:, :m], np.nan),
                variance=found[:, m : 2 * m],
                jacobian=slopes[..., :m],
                variance_jacobian=slopes[..., m : 2 * m],
                places=run.places,
            )

    def cost(self, z: Array) -> float:
        """Minus the logarithm of the posterior, but for a constant; infinite where the truck runs away."""
        total, limit = float(z @ z) / 2, self.settings.outlier
        with np.errstate(over="ignore", invalid="ignore"):
            for i, j in self.sections():
                total += sum(likelihood.loss(part, limit) for part in self.parts(z, i, j, directions="none"))
        return total if np.isfinite(total) else np.inf

    def unstable(self, z: Array) -> bool:
        """Whether the truck would run away in one of the logs."""
        vehicle = self.vehicle.replace({n: v for n, v in self.values(z, 0).items() if n in self.vehicle.parameters()})
        speeds = [section.input("speed") for log in self.logs for section in log.sections]
        ends = np.unique([edge for speed in speeds for edge in (speed.min(), speed.max())])
        return any(
            np.linalg.eigvals(dynamics.matrices(vehicle, float(u), roll=self.model.roll).A).real.max() >= 0
            for u in ends
        )

    def sections(self) -> list[tuple[int, int]]:
        """Number of log and of section, of all sections in order."""
        return [(i, j) for i, log in enumerate(self.logs) for j in range(len(log.sections))]

    def expand(self, z: Array, *, directions: Directions = "learned") -> Quadratic:
        """The cost about z: its gradient is exact, its Hessian Gauss and Newton's (Fisher's) with the prior."""
        cost, gradient, hessian = float(z @ z) / 2, z.copy(), np.eye(len(z))
        limit = self.settings.outlier
        with np.errstate(over="ignore", invalid="ignore"):
            for i, j in self.sections():
                for part in self.parts(z, i, j, directions=directions):
                    own, gram = likelihood.information(part, limit)
                    cost += likelihood.loss(part, limit)
                    gradient[part.places] += own
                    hessian[np.ix_(part.places, part.places)] += gram
        return Quadratic(cost, gradient, hessian)

    def adapt(self, z: Array, *, coloured: bool) -> None:
        """Set each channel's noise in the logs to the residuals at z.

        What lies beyond the limit for outliers counts as lying on it. With `coloured`, residuals that hang together
        count for as many as they are worth.
        """
        for i, log in enumerate(self.logs):
            parts = [part for j in range(len(log.sections)) for part in self.parts(z, i, j, directions="none")]
            for c, name in enumerate(self.model.outputs):
                error = np.concatenate([part.error[:, c] for part in parts])
                size = error / np.sqrt(np.concatenate([part.variance[:, c] for part in parts]))
                size = np.clip(size[np.isfinite(size)], -self.settings.outlier, self.settings.outlier)
                if len(size) < 20:
                    continue
                factor = float(np.clip(np.mean(size**2), 1e-3, 1e3))
                log.noise[name] *= self.colour[i][name] * factor
                if coloured:
                    rate = log.sections[0].rate
                    self.colour[i][name] = colour(size, int(self.settings.correlation_time * rate))


def _samples(rows: Rows, chunk: slice) -> tuple[slice | NDArray[np.int64], slice | NDArray[np.int64]]:
    """Which rows of a chunk are samples, counted from its own begin and from the record's."""
    if len(rows.places) == len(rows.rows):  # all of them, which is cheaper to say by a slice
        return slice(None), chunk
    first, last = np.searchsorted(rows.places, (chunk.start, chunk.stop))
    here = rows.places[first:last]
    return here - chunk.start, here
