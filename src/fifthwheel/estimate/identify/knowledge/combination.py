"""The logs of one truck combined: its unknowns over all its trailers and loads, changes, and histories.

Which logs share an unknown is stated in the row of the number (`truck.quantities.SCOPES`).
"""

import datetime
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np

from fifthwheel.base.names import ParameterPath
from fifthwheel.base.types import Array, selected
from fifthwheel.data.channels import SensorErrorName
from fifthwheel.estimate.filters.scaling import Scaling
from fifthwheel.estimate.identify.knowledge.changes import Kind, TripChange, TruckTrips, find_changes
from fifthwheel.estimate.identify.knowledge.information import OUTLIER, LogKnowledge, Owned
from fifthwheel.estimate.identify.knowledge.states import Observation, State, Walk, filtered, smoothed, together
from fifthwheel.estimate.identify.one_stage.posterior import model_error_factors
from fifthwheel.estimate.identify.one_stage.prior import JointPrior
from fifthwheel.estimate.identify.unknowns.unknown import Unknown, scaling
from fifthwheel.truck.quantities import TIME_BASE

DAY = 86_400.0
"""Seconds."""


@dataclass(frozen=True, kw_only=True)
class UnknownLayout:
    """The unknowns of a truck, with the priors of their first trip."""

    unknowns: Mapping[Owned, int]
    scaling: Scaling  # the lower bound of an unknown that is not negative is its centre
    estimated: frozenset[Owned]  # parameters that a trip estimates; the others are uncertain, or sensor errors


@dataclass(frozen=True, kw_only=True)
class Combined:
    """The logs of one truck together."""

    logs: Sequence[LogKnowledge]  # in the order of time
    layout: UnknownLayout
    observations: Sequence[Observation]
    z: Sequence[Array]  # (n,) at each trip, from all trips
    variance: Sequence[Array]  # (n,) of z, without model error
    widening: Array
    changes: Sequence[TripChange]
    p_values: Sequence[float]  # of each trip by its innovation
    last: State  # after the last trip
    walk: Walk  # with the resets of all changes

    def estimate(self, k: int, unknown: Owned) -> tuple[float, float]:
        """Value and sigma of an unknown at trip k, SI."""
        return self._value(k, self.z[k], self.variance[k], unknown)

    def sigma(self, k: int, state: State, unknown: Owned) -> float:
        """Sigma of an unknown at trip k in a state, SI."""
        return self._value(k, state.z, np.diag(state.P), unknown)[1]

    def _value(self, k: int, z: Array, variance: Array, unknown: Owned) -> tuple[float, float]:
        """Value and sigma of an unknown at trip k, SI, from all unknowns and their variances."""
        i, factor = self.layout.unknowns[unknown], self.logs[k].information.factors.get(unknown.name, 1.0)
        sigma = float(np.sqrt(variance[i]) * self.widening[i])
        with np.errstate(over="ignore"):
            values = self.layout.scaling.to_p(z)
        return factor * float(values[i]), factor * sigma * float(self.layout.scaling.slope(values)[i])

    def prior(
        self, unknowns: Mapping[Owned, Unknown], date: datetime.datetime, factors: Mapping[str, float]
    ) -> JointPrior | None:
        """The information of the logs on some unknowns, at a later date; None if nothing.

        `factors` are the values of unknowns over the shared ones, by name (`load_factors`).
        """
        known = {owned: u for owned, u in unknowns.items() if owned in self.layout.unknowns}
        if not known:
            return None
        places = np.array([self.layout.unknowns[owned] for owned in known], dtype=np.int64)
        days = max(date.timestamp() / DAY - self.observations[-1].time, 0.0)
        state, own, new = self.last.later(self.walk.rate * days), self.layout.scaling, scaling(list(known.values()))
        shared = own.to_p(state.z)
        factor = np.array([factors.get(u.name, 1.0) for u in known.values()])
        values = factor * shared[places]
        slope = factor * own.slope(shared)[places] / new.slope(values)
        return JointPrior(
            names=tuple(u.name for u in known.values()),
            mean=new.to_z(values),
            covariance=state.among(places).P * np.outer(slope, slope),
            widening=self.widening[places],
        )

    def parameters(self, k: int) -> list[Owned]:
        """The estimated parameters at trip k."""
        places = set(self.observations[k].places.tolist())
        return [u for u, i in self.layout.unknowns.items() if i in places and u in self.layout.estimated]

    @property
    def trips_with(self) -> dict[Owned, list[int]]:
        """The trips with each estimated parameter."""
        of_trips = [self.parameters(k) for k in range(len(self.logs))]
        return {u: [k for k, own in enumerate(of_trips) if u in own] for u in dict.fromkeys(chain(*of_trips))}


def combine(logs: Sequence[LogKnowledge], *, tyre_walk: float, false_alarm: float) -> Combined:
    """Combine the logs of a truck.

    `tyre_walk` is the standard deviation that the stiffness of tyres gains in a day, as a fraction, `false_alarm` the
    probability of a false alarm in one test.
    """
    logs = sorted(logs, key=lambda log: (log.date, log.name))
    layout = _layout(logs)
    observations = _without_zeros([_observation(log, layout) for log in logs], layout)
    widening = _widening(observations, len(layout.unknowns))
    start = State.prior(len(layout.unknowns))
    walks = [tyre_walk if ParameterPath.of(u.name).quantity == "cornering_stiffness" else 0.0 for u in layout.unknowns]
    known = {k: [layout.unknowns[u] for u in log.unknowns if u.name in log.changed] for k, log in enumerate(logs)}
    resets = {k: np.array(members, dtype=np.int64) for k, members in known.items() if members and k}
    walk = Walk(rate=(np.array(walks) / layout.scaling.scale) ** 2, resets=resets)
    data = TruckTrips(
        start=start,
        trips=observations,
        walk=walk,
        tested=np.array([i for u, i in layout.unknowns.items() if u in layout.estimated], dtype=np.int64),
        kinds=_kinds(layout, observations),
        widening=widening,
    )
    changes, walk, p_values = find_changes(data, false_alarm)
    outliers = {change.trip for change in changes if change.kind.name == OUTLIER}
    used = [
        replace(o, vector=np.zeros_like(o.vector), information=np.zeros_like(o.information)) if k in outliers else o
        for k, o in enumerate(observations)
    ]
    forwards = filtered(start, used, walk)
    backwards = [(state.z, np.diag(state.P).copy()) for state in smoothed(forwards, used, walk)]
    return Combined(
        logs=logs,
        layout=layout,
        observations=observations,
        z=[z for z, _ in reversed(backwards)],
        variance=[variance for _, variance in reversed(backwards)],
        widening=widening,
        changes=changes,
        p_values=p_values,
        last=forwards[-1],
        walk=walk,
    )


def _layout(logs: Sequence[LogKnowledge]) -> UnknownLayout:
    first: dict[Owned, tuple[LogKnowledge, int]] = {}
    for log in logs:
        for k, unknown in enumerate(log.unknowns):
            first.setdefault(unknown, (log, k))

    def column(name: str) -> Array:
        return np.array([getattr(log.information, name)[k] for log, k in first.values()])

    centre = np.array([_shared_centres(log)[k] for log, k in first.values()])
    scaling = Scaling(
        logarithmic=tuple(column("logarithmic").tolist()),
        centre=centre,
        scale=column("scale"),
        lower=np.where(column("non_negative"), centre, -np.inf),
        upper=np.full_like(centre, np.inf),
    )
    estimated = {unknown for log in logs for unknown in log.unknowns if unknown.name in log.estimated}
    places = {unknown: i for i, unknown in enumerate(first)}
    return UnknownLayout(unknowns=places, scaling=scaling, estimated=frozenset(estimated))


def _shared_centres(log: LogKnowledge) -> Array:
    """Prior means (n,) of the shared values."""
    factors = [log.information.factors.get(name, 1.0) for name in log.information.names]
    return np.asarray(log.information.centre / np.array(factors))


def _observation(log: LogKnowledge, layout: UnknownLayout) -> Observation:
    """The information of a log for the priors of the layout: z of the log = a z of the layout + b."""
    own, centre = log.information, _shared_centres(log)
    places = np.array([layout.unknowns[unknown] for unknown in log.unknowns], dtype=np.int64)
    prior, logarithmic = layout.scaling, np.array(layout.scaling.logarithmic)[places]
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(logarithmic, np.log(prior.centre[places] / centre), prior.centre[places] - centre)
    a, b = prior.scale[places] / own.scale, ratio / own.scale
    return Observation(
        time=log.date.timestamp() / DAY,
        places=places,
        vector=a * (own.vector - own.information @ b),
        information=own.information * np.outer(a, a),
        score_covariance=own.score_covariance * np.outer(a, a),
    )


def _without_zeros(trips: Sequence[Observation], layout: UnknownLayout) -> list[Observation]:
    """The trips without the non-negative unknowns that all trips together determine as 0."""
    bounded = np.flatnonzero(layout.scaling.lower == layout.scaling.centre)
    while True:
        total = together(trips)
        z = np.linalg.solve(np.eye(len(total.places)) + total.information, total.vector)
        zeros = np.intersect1d(bounded, total.places[z < 0])
        if not len(zeros):
            return list(trips)
        trips = [selected(trip, np.flatnonzero(~np.isin(trip.places, zeros))) for trip in trips]


def _widening(trips: Sequence[Observation], n: int) -> Array:
    """Factors (n,) of model error from the scores of all trips together; 1 for an unknown of none."""
    total, widening = together(trips), np.ones(n)
    W = np.eye(len(total.places))
    widening[total.places] = model_error_factors(
        np.asarray(np.linalg.inv(W + total.information)), W, total.score_covariance
    )
    return widening


def _kinds(layout: UnknownLayout, trips: Sequence[Observation]) -> list[Kind]:
    """What may change: the tyres of an axle group, the load of a trailer, a sensor; or one trip is an outlier."""
    sensors = {u: error.signal for u in layout.unknowns if (error := SensorErrorName.of(u.name))}
    parameters = {u: i for u, i in layout.unknowns.items() if u not in sensors and u.name != TIME_BASE}

    def kind(name: str, subject: str, members: Sequence[int], decisive: Sequence[int] = ()) -> Kind:
        """A change of some unknowns, which may happen at each trip with one of the decisive ones, by default of all."""
        at = frozenset(k for k, trip in enumerate(trips) if np.isin(decisive or members, trip.places).any())
        return Kind(name=name, subject=subject, members=np.array(members, dtype=np.int64), trips=at)

    kinds = [
        kind("tyres", f"{path.owner}{_of_trailer(u)}", [i])
        for u, i in parameters.items()
        if (path := ParameterPath.of(u.name)).quantity == "cornering_stiffness"
    ]
    for owner, trailer in {u.owner: u.of("trailer") for u in parameters if u.of("load") is not None}.items():
        own = [i for u, i in parameters.items() if u.owner == owner]
        shared = [i for u, i in parameters.items() if u.owner == owner[:-1]]
        kinds.append(kind("load", trailer or "trailer", [*own, *shared], own))
    signals: dict[Owned, list[int]] = {}
    for u, signal in sensors.items():
        signals.setdefault(replace(u, name=signal), []).append(layout.unknowns[u])
    kinds += [kind("sensor", f"{u.name}{_of_trailer(u)}", members) for u, members in signals.items()]
    return [*kinds, kind(OUTLIER, "trip", list(parameters.values()))]


def _of_trailer(unknown: Owned) -> str:
    return f" of {trailer}" if (trailer := unknown.of("trailer")) else ""


def date_of(trip: Observation) -> datetime.datetime:
    """The date of a trip."""
    return datetime.datetime.fromtimestamp(trip.time * DAY, datetime.UTC)
