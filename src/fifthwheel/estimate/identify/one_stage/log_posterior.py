"""The posterior density of one stage as a function, for samplers and optimisers, and its profile along one unknown."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from threadpoolctl import threadpool_limits

from fifthwheel.base.arguments import expect, expect_each, expect_optional
from fifthwheel.base.errors import SignalError, suggestion
from fifthwheel.base.formatting import shown
from fifthwheel.base.names import NumberedName
from fifthwheel.base.plots import Axis, Guide, Item, Line, Panel, Plot
from fifthwheel.base.plots.items import BLUE, GREY
from fifthwheel.base.types import Array, Indices
from fifthwheel.data.record import Record
from fifthwheel.estimate.identify.estimates import sensor_error_unit
from fifthwheel.estimate.identify.given import applied
from fifthwheel.estimate.identify.one_stage.estimator import TOLERANCE, solve_one_stage
from fifthwheel.estimate.identify.one_stage.gauss_newton import minimise
from fifthwheel.estimate.identify.one_stage.problem import Problem
from fifthwheel.estimate.identify.one_stage.solution import Solution
from fifthwheel.estimate.identify.result.posterior import normal_quantile
from fifthwheel.estimate.identify.settings import OneStage, Progress
from fifthwheel.estimate.identify.setup import with_tyre_law
from fifthwheel.estimate.identify.unknowns.unknown import Unknown, scaling
from fifthwheel.truck import Vehicle, unit_of


@dataclass(frozen=True, kw_only=True, eq=False)
class Profile:
    """The density of the posterior at n values of one unknown, maximised over all others.

    Where the density is normal, its logarithm is the parabola `normal`. Another shape shows that sigma alone does not
    describe what the logs say (W. Q. Meeker and L. A. Escobar, Teaching about approximate confidence regions based on
    maximum likelihood estimation, The American Statistician 1995).

    Example:
        >>> import numpy as np
        >>> import fifthwheel as fw
        >>> s = np.linspace(-3, 3, 7)
        >>> log = -(s**2) / 2
        >>> profile = fw.Profile(
        ...     name="road.friction", unit="1", values=0.7 + 0.1 * s, log_density=log, normal=log, best=0.7
        ... )
        >>> profile.interval(0.95).round(2)
        array([0.5, 0.9])
    """

    name: str
    unit: str
    """SI unit of the values; empty for a change of several numbers."""
    values: Array
    """(n,) increasing, SI."""
    log_density: Array
    """(n,) logarithm of the density less that at the maximum; -inf where the vehicle is unstable."""
    normal: Array
    """(n,) the same of the normal approximation, in the coordinates of the estimator."""
    best: float
    """Value at the maximum, SI."""

    def interval(self, level: float = 0.95) -> Array:
        """Lower and upper end (2,) of the interval by the likelihood ratio, SI; infinite where the profile does not
        reach it.

        Raises:
            FifthwheelError: the level is not between 0 and 1.
        """
        quantile, root = normal_quantile(level), np.sqrt(np.maximum(-2 * self.log_density, 0.0))  # about linear
        ends = []
        for sign, side in ((-1, self.values < self.best), (1, self.values > self.best)):
            rows = np.flatnonzero(side & np.isfinite(root))[::sign]
            reached, values = np.append(0.0, root[rows]), np.append(self.best, self.values[rows])
            ends.append(np.interp(quantile, reached, values, right=sign * np.inf))
        return np.array(ends)

    def plot(self) -> Plot:
        """Both densities relative to their maximum, over the values."""
        unit = shown(self.unit)
        values, best = self.values * unit.factor, self.best * unit.factor
        items: list[Item] = [
            Line(values, np.exp(self.normal), name="normal approximation", colour=GREY, dash="dash"),
            Line(values, np.exp(self.log_density), name="profile", colour=BLUE),
            Guide(x=best, text="maximum"),
        ]
        x = Axis(label=self.name, unit=unit.name)
        return Plot(title=f"Posterior of {self.name}", panels=[Panel(items=items, x=x, y=Axis(label="density"))])


def log_posterior(
    records: Sequence[Record],
    vehicle: Vehicle,
    settings: OneStage | None = None,
    *,
    progress: Progress = lambda *_: None,
) -> "LogPosterior":
    """The logarithm of the posterior density that `identify` maximises with the same arguments, as a function.

    It runs the search of `identify`, which estimates the noise of the residuals too; the density is that for this
    noise. Arguments and errors are those of `identify`.

    Raises:
        SignalError: the settings are not those of one stage, or a log cannot be used.
        VehicleError: a statement of the settings cannot be used.

    Example:
        >>> import fifthwheel as fw
        >>> truck = fw.vehicle("cheng_cebon_2011")
        >>> settings = fw.OneStage(given={"*": "exact", "tractor.front.cornering_stiffness": "free"}, tyres="linear")
        >>> density = fw.log_posterior([fw.simulate(truck, count=1)], truck, settings)
        >>> density(density.mean) > density({"tractor.front.cornering_stiffness": 4e5})
        True
        >>> density.gradient(density.mean).shape == density.mean.shape
        True
    """
    expect_each("records", records, Record)
    expect("vehicle", vehicle, Vehicle)
    expect_optional("settings", settings, OneStage)
    vehicle, settings = applied(vehicle, settings or OneStage())
    settings, _ = with_tyre_law(vehicle, settings)
    with threadpool_limits(limits=1, user_api="blas"):
        return LogPosterior(solution=solve_one_stage(records, vehicle, settings, progress=progress))


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class LogPosterior:
    """The logarithm of the posterior density of k unknowns, up to a constant; `log_posterior` makes it.

    A point x (k,) is in the coordinates of the estimator, in which every prior is about N(0, 1): an unknown is
    p = p_0 exp(s x) if it is positive, else p = p_0 + s x, with the prior mean p_0 and the prior standard deviation s.
    The density is that of x, so it has no Jacobian. `values` gives p in SI. Initial states, "<state>@<log>.<segment>",
    are deviations from the steady state, and have no values. One unknown may move several numbers of the vehicle file,
    such as "semitrailer.axle_positions"; samples of `Identification.posterior`, by number, are no points of this one.

    `density(x)` is the logarithm of the density at x (k,), or at values in SI by name: `density({"mass_scale": 1.0})`.
    Unknowns without a value then keep that of the maximum, so that a chain of some of them has their conditional
    sigmas, which are smaller. It is -inf beyond the bounds of the unknowns and where the vehicle is unstable.

    Example:
        >>> import fifthwheel as fw
        >>> truck = fw.vehicle("cheng_cebon_2011")
        >>> settings = fw.OneStage(given={"*": "exact", "tractor.front.cornering_stiffness": "free"}, tyres="linear")
        >>> density = fw.log_posterior([fw.simulate(truck, count=1)], truck, settings)
        >>> density.names[0]
        'tractor.front.cornering_stiffness'
        >>> density.values(density.mean)["tractor.front.cornering_stiffness"].round(-5).item()
        500000.0
    """

    solution: Solution
    """Of the search."""

    @property
    def problem(self) -> Problem:
        """With the noise of the solution."""
        return self.solution.problem

    @cached_property
    def names(self) -> tuple[str, ...]:
        """(k,) of the unknowns; those of one log are "<name>@<log>"."""
        return tuple(self._public(self.problem.names[i]) for i in self._indices)

    @property
    def mean(self) -> Array:
        """x (k,) at the maximum, where chains may start; the search ends within 0.07 sigma of it."""
        return self.solution.minimum.z[self._indices]

    @cached_property
    def covariance(self) -> Array:
        """Inverse of the Hessian (k, k) at the maximum, without an allowance for model error."""
        hessian = self.solution.minimum.model.hessian
        return np.asarray(np.linalg.inv(hessian[np.ix_(self._indices, self._indices)]))

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Lower and upper bounds of x (k,)."""
        lower, upper = self.problem.bounds
        return lower[self._indices], upper[self._indices]

    def __call__(self, x: ArrayLike | Mapping[str, float]) -> float:
        """The logarithm of the density at x (k,), or at values in SI by name; `profile` maximises over the others.

        Raises:
            SignalError: another number of elements than k, or an unknown name.
        """
        z, (lower, upper) = self._z(x), self.problem.bounds
        return -self.problem.cost(z) if ((z >= lower) & (z <= upper)).all() else -np.inf

    def gradient(self, x: ArrayLike | Mapping[str, float]) -> Array:
        """Derivatives (k,) of the logarithm of the density by x; arguments and errors as of `density(x)`. They are
        exact but for rounding."""
        return -self.problem.gradient(self._finite(x))[self._indices]

    def fisher_information(self, x: ArrayLike | Mapping[str, float]) -> Array:
        """Information (k, k) of the logs on x; the prior adds its precision, which is about the identity."""
        z = self._finite(x)
        information: Array = self.problem.expand(z).hessian - self.problem.prior.expand(z).hessian
        return information[np.ix_(self._indices, self._indices)]

    def log_likelihood(self, x: ArrayLike | Mapping[str, float]) -> float:
        """The logarithm of the density of the logs at x, with its constant."""
        return self.problem.log_likelihood(self._z(x))

    def values(self, x: ArrayLike) -> dict[str, Array]:
        """Values (...) in SI of points or samples x (..., k), by name; without the initial states."""
        points = np.asarray(x, dtype=np.float64)
        if not points.ndim or points.shape[-1] != len(self.names):
            raise SignalError(f"x: expected {len(self.names)} numbers a point, got the shape {points.shape}; see names")
        places = [self.names.index(name) for name in self._unknowns]
        p = scaling(list(self._unknowns.values())).to_p(points[..., places])
        return {name: p[..., i] for i, name in enumerate(self._unknowns)}

    def profile(self, name: str, *, sigmas: float = 3.0, points: int = 13) -> Profile:
        """The density along one unknown, maximised over all others, beside its normal approximation.

        Args:
            name: of the unknown.
            sigmas: how far from the maximum, in standard deviations of `covariance`.
            points: number of points, at each of which the others are estimated again.

        Raises:
            SignalError: an unknown name, or one of an initial state.
        """
        (unknown,) = [self._unknowns[n] for n in self._checked([name])]
        k, (lower, upper) = self.names.index(name), self.problem.bounds
        i, mean = self._indices[k], self.mean
        sigma = float(np.sqrt(self.covariance[k, k]))
        lowest, highest = np.clip(mean[k] + sigmas * sigma * np.array([-1.0, 1.0]), lower[i], upper[i])
        x, density = np.linspace(lowest, highest, points), np.empty(points)
        for side in (np.flatnonzero(x >= mean[k]), np.flatnonzero(x < mean[k])[::-1]):
            at = mean.copy()
            for j in side:  # outwards, each from the solution of the point before
                at += self.covariance[k] / self.covariance[k, k] * (x[j] - at[k])
                density[j], at = self._maximum(at, i, x[j])
        scale = scaling([unknown])
        return Profile(
            name=name,
            unit=_unit(unknown),
            values=scale.to_p(x[:, None])[:, 0],
            log_density=density - max(density.max(), self(mean)),
            normal=-(((x - mean[k]) / sigma) ** 2) / 2,
            best=float(scale.to_p(mean[k : k + 1])[0]),
        )

    def _maximum(self, x: Array, i: int, value: float) -> tuple[float, Array]:
        """The largest logarithm of the density with z_i at a value, from x (k,), and where it is."""
        lower, upper = (bound.copy() for bound in self.problem.bounds)
        lower[i] = upper[i] = value
        z = np.clip(self._z(x), lower, upper)
        if not np.isfinite(self.problem.cost(z)):
            return -np.inf, x
        iterations = self.problem.settings.iterations
        minimum = minimise(self.problem, z, lower=lower, upper=upper, iterations=iterations, tolerance=TOLERANCE)
        return -minimum.model.cost, minimum.z[self._indices]

    @cached_property
    def _indices(self) -> Indices:
        """(k,) of the estimated unknowns among all."""
        lower, upper = self.problem.bounds
        return np.flatnonzero(lower < upper)

    @cached_property
    def _unknowns(self) -> dict[str, Unknown]:
        """By name, without the initial states."""
        by_name = self.problem.unknowns_by_name
        internal = [self.problem.names[i] for i in self._indices]
        return {self._public(name): by_name[name] for name in internal if name in by_name}

    def _public(self, name: str) -> str:
        """The name of an unknown with that of its log in place of its number."""
        parsed = NumberedName.of(name)
        return name if parsed.log is None else parsed.of_log(self.problem.logs[parsed.log].name)

    def _checked(self, names: Sequence[str]) -> Sequence[str]:
        """The names, if each is that of an unknown with a value in SI."""
        for name in names:
            if name not in self._unknowns:
                raise SignalError(f"{name}: not an estimated unknown; {suggestion(name, self._unknowns)}")
        return names

    def _z(self, x: ArrayLike | Mapping[str, float]) -> Array:
        """All unknowns of the problem, from x (k,) or values in SI."""
        z = self.solution.minimum.z.copy()
        if isinstance(x, Mapping):
            names = self._checked(list(x))
            places = self._indices[[self.names.index(name) for name in names]]
            with np.errstate(invalid="ignore", divide="ignore"):  # below 0: NaN, which is beyond the bounds
                z[places] = scaling([self._unknowns[n] for n in names]).to_z(np.array([float(x[n]) for n in names]))
            return z
        point = np.asarray(x, dtype=np.float64)
        if point.shape != self._indices.shape:
            raise SignalError(f"x: expected {len(self._indices)} numbers, as in names, got shape {point.shape}")
        z[self._indices] = point
        return z

    def _finite(self, x: ArrayLike | Mapping[str, float]) -> Array:
        z = self._z(x)
        for name, value in zip(self.names, z[self._indices], strict=True):
            if not np.isfinite(value):
                raise SignalError(
                    f"x, {name}: expected a finite number, got {value}; the density has no derivative there"
                )
        return z

    def __repr__(self) -> str:
        logs = ", ".join(log.name for log in self.problem.logs)
        return f"LogPosterior({len(self.names)} unknowns, from {logs})"


def _unit(unknown: Unknown) -> str:
    """SI unit; empty for a change of several numbers."""
    if unknown.is_sensor_error:
        return sensor_error_unit(unknown.name)
    return "" if unknown.moves else unit_of(unknown.name)
