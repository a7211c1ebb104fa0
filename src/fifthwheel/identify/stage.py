"""One stage of an identification: the dual filter, several times through all logs."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fifthwheel import dynamics
from fifthwheel.dynamics import ChainModel
from fifthwheel.filters import Noise, dual
from fifthwheel.filters.dual import Coupling, DualState, Scaling
from fifthwheel.identify.parameters import Unknown, scaling
from fifthwheel.identify.settings import TwoStage
from fifthwheel.logs import Record
from fifthwheel.observe import noise as variances
from fifthwheel.observe.prepare import Rows, prepare
from fifthwheel.vehicle import Vehicle

Array = NDArray[np.float64]
Progress = Callable[[str, int, int], None]


@dataclass(kw_only=True)
class Log:
    """One log on its way through the stages: its usable sections, and what is known of its sensors so far."""

    name: str
    sections: list[Record]
    errors: dict[str, float] = field(default_factory=dict)  # this log's own nuisances by name
    noise: dict[str, float] = field(default_factory=dict)  # variance of each channel
    colour: dict[str, float] = field(default_factory=dict)  # how many of its samples are worth one, see `colour`


@dataclass(frozen=True, kw_only=True)
class Trace:
    """How the parameters went: a row a sample, all passes one behind the other."""

    names: tuple[str, ...]
    time: Array  # (N,) s, running on over logs and passes
    values: Array  # (N, n)
    sigma: Array  # (N, n) as the filter has it
    starts: tuple[int, ...]  # the row at which each pass begins

    @property
    def passes(self) -> int:
        return len(self.starts)

    def then(self, later: "Trace") -> "Trace":
        """This trace and a later one of the same parameters, as one."""
        return Trace(
            names=self.names,
            time=np.concatenate([self.time, self.time[-1] + later.time]),
            values=np.concatenate([self.values, later.values]),
            sigma=np.concatenate([self.sigma, later.sigma]),
            starts=(*self.starts, *[len(self.time) + start for start in later.starts]),
        )


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What a stage found."""

    values: dict[str, float]  # the truck's own unknowns; each log's are in the logs
    trace: Trace
    settled: bool  # whether the last pass moved nothing
    accepted: list[Array]  # each log's (N, m)


def build(vehicle: Vehicle, outputs: Sequence[str], unknowns: Sequence[Unknown], *, roll: bool) -> ChainModel:
    """The model in which all unknowns are free."""
    return dynamics.model(vehicle, outputs, roll=roll, free=[u.name for u in unknowns])


def run(
    model: ChainModel,
    vehicle: Vehicle,
    logs: Sequence[Log],
    unknowns: Sequence[Unknown],
    *,
    active: Sequence[str],
    start: Mapping[str, float],
    settings: TwoStage,
    passes: int,
    progress: Progress = lambda *_: None,
    title: str = "",
) -> Outcome:
    """Estimate the `active` unknowns; the others keep their values. Changes the logs' nuisances and noise.

    Args:
        start: values of the unknowns that all logs share.
        passes: at most so many times through the logs.
    """
    working = _Working(model, vehicle, logs, unknowns, active, dict(start), settings)
    for number in range(passes):
        progress(title, number, passes)
        working.once_through()
        if working.settled():
            break
    progress(title, passes, passes)
    return working.outcome()


def shift_delays(scaling: Scaling, names: Sequence[str], errors: Mapping[str, float]) -> Scaling:
    """The scaling for rows that `prepare` moved by the delays in `errors`: only the rest is left to the model."""
    centre = scaling.centre.copy()
    for i, name in enumerate(names):
        if name.endswith(".delay"):
            centre[i] -= errors.get(name, 0.0)
    return replace(scaling, centre=centre)


def begin(
    vehicle: Vehicle, names: Sequence[str], scaling: Scaling, z: Array, rows: Rows, *, roll: bool
) -> tuple[Array, Array, Array]:
    """State (n,) at the start of a section, its covariance (n, n), and its derivative dx/dz (n, n_p).

    The start is the steady state of the first inputs, and so depends on the parameters: without that derivative a
    filter takes the way from a wrong start to the right one for news of the parameters.
    """

    def values(z: Array) -> dict[str, float]:
        return dict(zip(names, scaling.to_p(z).tolist(), strict=True))

    x0, P0 = variances.initial(vehicle, rows.first, values(z), roll=roll, swing=rows.swing)
    step = 1e-5
    moved = [variances.steady(vehicle, rows.first, values(z + step * row), roll=roll)[0] for row in np.eye(len(z))]
    return x0, P0, (np.column_stack(moved) - x0[:, None]) / step


def channel_noise(model: ChainModel, vehicle: Vehicle, log: Log, settings: TwoStage) -> Noise:
    """Process noise, and each channel's variance as far as this log has told it."""
    for name in model.outputs:
        log.noise.setdefault(name, variances.sensor(vehicle, name, settings.noise))
    return Noise(
        # never quite zero: a covariance that dies away would end in denormal numbers, which are slow
        process=variances.process(model.states, variances.PROCESS, max(settings.process_noise, 1e-9)),
        measurement=np.array([log.noise[name] * log.colour.get(name, 1.0) for name in model.outputs]),
        gate=settings.gate,
    )


def colour(innovation: Array, lags: int) -> float:
    """How many innovations (N,) are worth one of white noise: their long-run variance over their variance, at least 1.

    Residuals of a model that leaves something out hang together; a filter that takes each for news believes them too
    much and its priors too little. Of N samples no more than a twentieth are looked at as one.
    """
    own = float(np.mean(innovation**2))
    together = long_run(innovation[:, None], max(min(lags, len(innovation) // 20), 1))[0, 0] / len(innovation)
    return max(1.0, float(together) / own)


def long_run(scores: Array, lags: int) -> Array:
    """Covariance of the sum of scores (N, n) that hang together up to `lags` samples, (n, n), never indefinite.

    Newey and West's (1987) estimate with Bartlett weights, written as the sums over all windows of `lags` samples.
    """
    edge = np.zeros((lags, scores.shape[1]))
    total = np.cumsum(np.vstack([edge, scores, edge]), axis=0)
    windows = total[lags:] - total[:-lags]
    return np.asarray(np.einsum("ki,kj->ij", windows, windows) / lags)


def moved(change: ArrayLike, value: ArrayLike, sigma: ArrayLike, settings: TwoStage) -> bool:
    """Whether a parameter's change is more than a tenth of its sigma and of the tolerance."""
    allowed = 0.1 * np.maximum(sigma, settings.tolerance * np.abs(value))
    return bool((np.abs(change) > allowed).any())


class _Working:
    def __init__(
        self,
        model: ChainModel,
        vehicle: Vehicle,
        logs: Sequence[Log],
        unknowns: Sequence[Unknown],
        active: Sequence[str],
        values: dict[str, float],
        settings: TwoStage,
    ) -> None:
        self.model, self.vehicle, self.logs, self.settings = model, vehicle, logs, settings
        self.unknowns = tuple(unknowns)
        self.names = [u.name for u in unknowns]
        self.scaling = scaling(unknowns)
        self.constants = dynamics.all_parameters(vehicle, model.outputs)
        self.active = np.array([u.name in active for u in unknowns])
        self.own = np.array([u.each_log for u in unknowns])
        self.sought = self.active & ~np.array([u.nuisance for u in unknowns])
        self.values = values
        self.z = self._z(logs[0])
        self.Pz = self._prior()
        self.walk = 1.0
        self.history: list[tuple[Array, Array, Array]] = []
        self.elapsed = 0.0
        self.before = self.z
        self.step = np.zeros(len(self.z))  # where the last pass would have gone
        self.part = 1.0  # and how much of it is gone
        self.starts: list[int] = []

    def _prior(self) -> Array:
        return np.diag([u.start**2 if flag else 0.0 for u, flag in zip(self.unknowns, self.active, strict=True)])

    def _z(self, log: Log) -> Array:
        """Where the unknowns stand, for this log."""
        merged = {**{u.name: u.centre for u in self.unknowns}, **self.values, **log.errors}
        return self.scaling.to_z(np.array([merged[name] for name in self.names]))

    def once_through(self) -> None:
        """All logs once, in order.

        A pass begins where the last one ended, for the sake of its linearisation, with the prior's covariance. That
        centres the prior on the last estimate; at the end its mean is put back to where it belongs, z = 0, by taking
        its information out of the result. So no sample and no prior is counted twice, however many the passes.
        """
        self.before = self.z
        self.starts.append(sum(len(time) for time, _, _ in self.history))
        if self.settings.restart:
            self.Pz = self._prior()
        self.accepted: list[Array] = []
        shared = dict(self.values)
        shifted = shift_delays(self.scaling, self.names, shared)
        for log in self.logs:
            own = self.own & self.active
            self.Pz[own, :] = self.Pz[:, own] = 0.0
            self.Pz[own, own] = 1.0
            self.z = np.where(self.own, self._z(log), self.z)
            begun = np.where(own, self.z, 0.0)
            self.residual: list[tuple[Array, Array]] = []
            for section in log.sections:
                self._section(log, prepare(self.model, self.vehicle, section, errors=shared | log.errors), shifted)
            self.z = self.z - self.Pz @ begun
            self._leave(log)
        if self.settings.restart:
            self.z = self.z - self.Pz @ np.where(self.active & ~self.own, self.before, 0.0)
            step = np.where(self.own, 0.0, self.z - self.before)
            if step @ self.step < 0:  # back where the last pass came from: go less far from now on
                self.part /= 2
            self.step = step
            self.z = np.where(self.own, self.z, self.before + self.part * step)
        self._store(self.active & ~self.own, self.values)
        self._remember(np.array([self.elapsed]), self.z[None], np.diag(self.Pz)[None])

    def _section(self, log: Log, rows: Rows, shifted: Scaling) -> None:
        x0, P0, sensitivity = begin(self.vehicle, self.names, self.scaling, self.z, rows, roll=self.model.roll)
        start = DualState(x=x0, P=P0, z=self.z, Pz=self.Pz, sensitivity=sensitivity, walk=self.walk)
        found = dual.run(
            self.model,
            rows.rows,
            c=self.model.known_values(self.constants),
            noise=channel_noise(self.model, self.vehicle, log, self.settings),
            scaling=shifted,
            start=start,
            coupling=self._coupling(rows),
        )
        self.z, self.Pz, self.walk = found.end.z, found.end.Pz, found.end.walk
        time = rows.time[rows.places] - rows.time[0] + self.elapsed
        self.elapsed = float(time[-1])
        self._remember(time, found.z[rows.places], found.z_variance[rows.places])
        normalised = found.innovation[rows.places] / np.sqrt(found.innovation_variance[rows.places])
        self.residual.append((normalised, found.accepted[rows.places]))

    def _remember(self, time: Array, z: Array, variance: Array) -> None:
        self.history.append((time, z[:, self.sought], variance[:, self.sought]))

    def _leave(self, log: Log) -> None:
        innovation, accepted = (np.concatenate(arrays) for arrays in zip(*self.residual, strict=True))
        self.accepted.append(accepted)
        self._store(self.own & self.active, log.errors)
        if self.settings.adapt_noise:
            rate = 1 / np.median(np.diff(log.sections[0].time))
            for i, name in enumerate(self.model.outputs):
                seen = innovation[accepted[:, i] > 0, i]
                if len(seen) > 20:
                    used = log.noise[name] * log.colour.get(name, 1.0)
                    log.noise[name] = used * float(np.clip(np.mean(seen**2), 1e-3, 1e3))
                    log.colour[name] = colour(seen, int(self.settings.correlation_time * rate))

    def _store(self, which: NDArray[np.bool_], into: dict[str, float]) -> None:
        """Write z's parameters, inside their bounds, where they belong; z follows."""
        p = np.clip(self.scaling.to_p(self.z), self.scaling.lower, self.scaling.upper)
        self.z = np.where(which, self.scaling.to_z(p), self.z)
        into |= {name: float(value) for name, value, flag in zip(self.names, p, which, strict=True) if flag}

    def _coupling(self, rows: Rows) -> Coupling:
        """Walk and forgetting are published per sample, the filter has them per second."""
        step = float(np.median(np.diff(rows.time[rows.places])))
        walk = np.array([u.walk**2 if flag else 0.0 for u, flag in zip(self.unknowns, self.active, strict=True)])
        return Coupling(
            consistent=self.settings.consistent,
            coupled=self.settings.coupled,
            random_walk=walk / step,
            forgetting=-np.log(self.settings.forgetting) / step,
        )

    def settled(self) -> bool:
        """Whether the last pass moved nothing."""
        if not self.settings.restart:
            return False
        if not self.sought.any():
            return len(self.starts) > 1
        p, p_before = self.scaling.to_p(self.before + self.step), self.scaling.to_p(self.before)
        sigma = np.sqrt(np.diag(self.Pz)) * np.abs(self.scaling.slope(p))
        return not moved((p - p_before)[self.sought], p[self.sought], sigma[self.sought], self.settings)

    def outcome(self) -> Outcome:
        time, z, variance = (np.concatenate(arrays) for arrays in zip(*self.history, strict=True))
        sought = [u for u, flag in zip(self.unknowns, self.sought, strict=True) if flag]
        own = scaling(sought)
        p = own.to_p(z)
        trace = Trace(
            names=tuple(u.name for u in sought),
            time=time,
            values=p,
            sigma=np.sqrt(variance) * np.abs(own.slope(p)),
            starts=tuple(self.starts),
        )
        return Outcome(
            values=self.values,
            trace=trace,
            settled=self.settled(),
            accepted=self.accepted,
        )
