"""From the uncertainty of a truck to that of its measures, and the probability that a threshold is met.

An identification brings the joint covariance of estimated and considered parameters. A vehicle file brings what it
states, and the defaults of masses and lengths (`truck.uncertainty`). On any other number it states nothing; such a
number gets the prior that an identification would give it (`ASSUMED`). Parameters of a file that is exact are exact.

Linear: a family of measures f is evaluated at the truck and at pairs of trucks on either side of it, one pair for each
column of a square root of the covariance (`Uncertainty.pairs`). With f+ and f- of a pair i

    slope_i = (f+ - f-) / 2,         curvature_i = f+ + f- - 2 f,

the mean is f and the variance sum slope_i^2.

Sampled: where the curvatures shift the mean of a measure, sum curvature_i / 2, by more than `NONLINEAR` of sigma, or
where a truck of a pair does not have the measure, the family is evaluated at `DRAWS` random trucks instead. A truck
that does not have a measure, because it is unstable, does not meet a threshold; one that is not a valid vehicle, such
as a dolly with its CoG behind its axle, does not count.
"""

import math
from collections.abc import Callable, Collection, Container, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from fifthwheel.base.errors import FifthwheelError
from fifthwheel.base.lazy import lazy
from fifthwheel.base.names import PAYLOAD_HEIGHT, ends_with
from fifthwheel.base.types import Array
from fifthwheel.estimate.identify import Identification
from fifthwheel.estimate.observe.uncertainty import Uncertainty, displaced, positive_parameters
from fifthwheel.results.assess.truck import HALF_TRACK, Body, Truck, Values
from fifthwheel.truck import Vehicle, changes
from fifthwheel.truck.quantities import quantity_of

ASSUMED: Mapping[str, float] = {
    "cornering_stiffness": quantity_of("cornering_stiffness").guess,
    PAYLOAD_HEIGHT: 0.1,
    "payload.floor_height": 0.05,
}
"""Sigma of parameters on which a vehicle file states nothing, as a fraction of the value, by the end of their path: as
a guess, or that of the height of a load that somebody measured."""
NONLINEAR = 0.3
"""Shift of the mean, in standard deviations, from which a family is sampled."""
DRAWS = 200
"""Random trucks; half of them are the mirror images of the others."""
QUANTILE = 1.6448536269514722
"""Of the normal distribution, for an interval of 90 %."""
Order = Literal["linear", "sampled"]
Family = Callable[[Truck], Values]
"""Measures of a truck that are computed together; a FifthwheelError where the truck, such as an unstable one, does not
have them."""


def assumed(vehicle: Vehicle) -> dict[str, float]:
    """Sigma, SI, of the parameters on which the vehicle file states nothing."""
    sigmas = {}
    for path, value in vehicle.parameters().items():
        row = quantity_of(path)
        own = row.sigma_of(value) if row.is_uncertain and value else 0.0
        sigma = next((fraction * abs(value) for end, fraction in ASSUMED.items() if ends_with(path, end)), own)
        if sigma and path not in vehicle.stated:
            sigmas[path] = sigma
    moved = {path for change in changes(vehicle) for path in change.slopes}
    return {path: sigma for path, sigma in sigmas.items() if path not in moved or "yaw_inertia" in path}


def of_vehicle(vehicle: Vehicle) -> Uncertainty:
    """The uncertainty of a vehicle file."""
    columns: list[Mapping[str, float]] = [change.slopes for change in changes(vehicle)]
    columns += [{path: sigma} for path, sigma in assumed(vehicle).items()]
    names = tuple(path for path in vehicle.parameters() if any(path in column for column in columns))
    S = np.array([[column.get(name, 0.0) for column in columns] for name in names]).reshape(len(names), len(columns))
    return Uncertainty(names=names, covariance=S @ S.T)


def of_identification(identification: Identification) -> Uncertainty:
    """The joint uncertainty of the parameters of an identified vehicle.

    Two stages have no joint covariance: their estimates then count as independent, and everything else as in the
    vehicle file.
    """
    vehicle = identification.vehicle
    if identification.covariance is not None:
        return identification.covariance.among(vehicle.parameters().keys())
    own = vehicle.parameters()
    sigmas = {e.name: e.sigma for e in identification.parameters if e.sigma is not None and e.name in own}
    return of_vehicle(vehicle.with_stated(sigmas))


def complete(
    uncertainty: Uncertainty, body: Body, *, replaced: Collection[str] = (), stated: Mapping[str, float]
) -> Uncertainty:
    """The uncertainty with that of the half track, and with the stated sigma, SI, of replaced parameters; without one
    these are exact."""
    kept = uncertainty.among([name for name in uncertainty.names if name not in replaced])
    sigmas = {name: stated[name] for name in replaced if stated.get(name)} | {HALF_TRACK: body.half_track_sigma}
    for name, sigma in sigmas.items():
        kept = kept.with_independent(name, sigma) if sigma else kept
    return kept


@dataclass(frozen=True, kw_only=True)
class Spread:
    """Distribution of a quantity; None where not all trucks within the uncertainty have it."""

    sigma: float | None = None
    interval: tuple[float, float] | None = None
    """That contains 90 %."""
    order: Order | None = None


@dataclass(frozen=True, kw_only=True)
class MeasureSamples:
    """Measures of a truck, and of the trucks around it."""

    centre: Values
    pairs: tuple[tuple[Values, Values, float], ...]
    """Measures of both trucks of a pair and their distance in standard deviations."""
    draws: tuple[Values, ...] = ()
    """Measures of random trucks; empty where the pairs suffice."""

    def spread(self, quantity: Callable[[Values], float]) -> Spread:
        """Distribution of a quantity that follows from the measures."""
        f = quantity(self.centre)
        if self.draws:
            values = _values(quantity, self.draws)
            if np.isnan(values).any():
                return Spread()
            low, high = np.quantile(values, [0.05, 0.95])
            return Spread(sigma=float(np.std(values)), interval=(float(low), float(high)), order="sampled")
        slope, _ = self._derivatives(quantity)
        sigma = float(np.sqrt(np.sum(slope**2)))
        if math.isnan(sigma):
            return Spread()
        return Spread(sigma=sigma, interval=(f - QUANTILE * sigma, f + QUANTILE * sigma), order="linear")

    def probability(self, margin: Callable[[Values], float]) -> float | None:
        """Probability that a margin is 0 or more; None if it cannot be computed by the pairs."""
        if self.draws:
            return float(np.mean(_values(margin, self.draws) >= 0))
        f, slope = margin(self.centre), self._derivatives(margin)[0]
        sigma = float(np.sqrt(np.sum(slope**2)))
        if math.isnan(sigma):
            return None
        return float(f >= 0) if sigma == 0 else 0.5 * math.erfc(-f / sigma / math.sqrt(2))

    def widened(self, name: str, new: str, added: float) -> "MeasureSamples":
        """The samples of one measure, to which a number is added, under another name."""

        def of(values: Values) -> Values:
            return {new: values[name] + added} if name in values else {}

        pairs = tuple((of(plus), of(minus), step) for plus, minus, step in self.pairs)
        return MeasureSamples(centre=of(self.centre), pairs=pairs, draws=tuple(map(of, self.draws)))

    def is_linear(self) -> bool:
        """Whether the pairs suffice for every measure."""
        for name in self.centre:
            slope, curvature = self._derivatives(lambda values, name=name: values[name])  # type: ignore[misc]
            shift = abs(float(np.sum(curvature))) / 2
            if not shift <= NONLINEAR * float(np.sqrt(np.sum(slope**2))) + 1e-9:
                return False
        return True

    def _derivatives(self, quantity: Callable[[Values], float]) -> tuple[Array, Array]:
        """Slope and curvature of each pair, (c,); NaN where a truck does not have the quantity."""
        plus = _values(quantity, [pair[0] for pair in self.pairs])
        minus = _values(quantity, [pair[1] for pair in self.pairs])
        step = np.array([distance for *_, distance in self.pairs])
        return (plus - minus) / (2 * step), (plus + minus - 2 * quantity(self.centre)) / step**2


def _values(quantity: Callable[[Values], float], trucks: Sequence[Values]) -> Array:
    """A quantity of each truck, (n,); NaN for those that do not have it."""

    def of(values: Values) -> float:
        try:
            return quantity(values)
        except KeyError:
            return math.nan

    return np.array([of(values) for values in trucks])


class Neighbourhood:
    """The trucks at which measures are evaluated; all families share them."""

    def __init__(self, truck: Truck, uncertainty: Uncertainty) -> None:
        self.truck, self.uncertainty = truck, uncertainty
        self.given = truck.vehicle.parameters() | {HALF_TRACK: truck.body.half_track}
        self.positive = positive_parameters(self.given)

    @lazy
    def pairs(self) -> list[tuple[Truck | None, Truck | None, float]]:
        """Both trucks of each pair, None if it is not valid, and their distance in standard deviations."""
        pairs = self.uncertainty.pairs(self.given, self.positive)
        return [(self._changed(pair.plus), self._changed(pair.minus), pair.step) for pair in pairs]

    @lazy
    def draws(self) -> list[Truck]:
        """Random trucks, without those that are not valid."""
        drawn = random_parameters(self.uncertainty, self.given, self.positive)
        return [truck for values in drawn if (truck := self._changed(values)) is not None]

    def _changed(self, values: Values) -> Truck | None:
        try:
            return self.truck.changed(values)
        except FifthwheelError:  # such as a CoG behind the axles
            return None


def samples(trucks: Neighbourhood, family: Family, *, sampled: bool = True) -> MeasureSamples:
    """Measures of a truck and of the trucks around it; if `sampled`, of random trucks where the pairs do not suffice.

    Raises:
        FifthwheelError: the truck does not have these measures.
    """
    centre = family(trucks.truck)
    pairs = tuple((_measured(plus, family), _measured(minus, family), step) for plus, minus, step in trucks.pairs)
    result = MeasureSamples(centre=centre, pairs=pairs)
    if not sampled or result.is_linear():
        return result
    return replace(result, draws=tuple(_measured(truck, family) for truck in trucks.draws))


def random_parameters(uncertainty: Uncertainty, given: Values, positive: Container[str]) -> list[Values]:
    """Parameters of `DRAWS` random trucks by name; positive ones have a logarithmic normal distribution."""
    S = uncertainty.columns()
    half = np.random.default_rng(0).normal(size=(DRAWS // 2, S.shape[1])) @ S.T
    centre = np.array([given[name] for name in uncertainty.names])
    values = displaced(uncertainty.names, centre, np.concatenate([half, -half]), positive)
    return [dict(zip(uncertainty.names, row.tolist(), strict=True)) for row in values]


def _measured(truck: Truck | None, family: Family) -> Values:
    """Measures of a truck within the uncertainty; none if it does not have them, because it is unstable."""
    try:
        return {} if truck is None else family(truck)
    except FifthwheelError:
        return {}
