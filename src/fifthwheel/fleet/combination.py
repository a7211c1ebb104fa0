"""The trips of one truck combined: its unknowns over all its trailers and loads, changes, and histories.

Which trips share an unknown follows from its unit. Unknowns of the first unit, with its sensors, belong to the truck.
Those of the units behind it belong to the trailer, and those that depend on the payload to the load of this trailer.
An error of a weighbridge, `mass_scale`, belongs to the truck.
"""

import datetime
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fifthwheel._types import Array
from fifthwheel.channels import SensorErrorName
from fifthwheel.filters.scaling import Scaling
from fifthwheel.fleet.changes import OUTLIER, Kind, TripChange, TruckTrips, find_changes
from fifthwheel.fleet.states import Indices, Observation, State, Walk, filtered, smoothed
from fifthwheel.identify.one_stage.posterior import model_error_factors
from fifthwheel.identify.unknowns.parameters import unit_of_unknown
from fifthwheel.names import ParameterPath
from fifthwheel.options import FleetSettings

DAY = 86_400.0
"""Seconds."""
OF_LOAD = ("mass", "cog", "yaw_inertia")
"""Quantities of a unit behind the first that depend on its load, besides those of its payload and body."""
LOADED = ("payload", "sprung")
"""Components of a unit behind the first that depend on its load."""


@dataclass(frozen=True)
class Owned:
    """An unknown, and the trailer and the load that it belongs to; None for one of the truck, or of every load."""

    name: str
    trailer: str | None = None
    load: str | None = None


@dataclass(frozen=True, kw_only=True)
class UnknownLayout:
    """The unknowns of a truck, with the priors of their first trip."""

    unknowns: Mapping[Owned, int]
    considered: Mapping[Owned, int]
    scaling: Scaling  # the lower bound of an unknown that is not negative is its centre


@dataclass(frozen=True, kw_only=True)
class Combined:
    """The result for one truck."""

    truck: str
    rows: Sequence[Mapping[str, Any]]  # of its trips, in the order of time
    layout: UnknownLayout
    observations: Sequence[Observation]
    states: Sequence[State]  # at each trip, from all trips
    widening: Array
    changes: Sequence[TripChange]
    p_values: Sequence[float]  # of each trip by its innovation

    def estimate(self, k: int, unknown: Owned) -> tuple[float, float]:
        """Value and sigma of an unknown at trip k, SI."""
        i, state = self.layout.unknowns[unknown], self.states[k]
        sigma = float(np.sqrt(state.P[i, i] * self.widening[i] ** 2 + state.B[i] @ state.B[i]))
        with np.errstate(over="ignore"):
            values = self.layout.scaling.to_p(state.z)
        return float(values[i]), sigma * float(self.layout.scaling.slope(values)[i])

    def parameters(self, k: int) -> list[Owned]:
        """The parameters of the vehicle at trip k."""
        places = set(self.observations[k].places.tolist())
        return [u for u, i in self.layout.unknowns.items() if i in places and is_parameter(u.name)]


def is_parameter(name: str) -> bool:
    """Whether an unknown is a parameter of the vehicle, and not a sensor error."""
    return SensorErrorName.of(name) is None


def owner(name: str, tractor: str, trailer: str, load: str) -> Owned:
    """An unknown of a trip with the trailer and the load that it belongs to."""
    unit = unit_of_unknown(name)
    if unit in (tractor, ""):
        return Owned(name)
    path = ParameterPath.of(name)
    of_load = path.component in LOADED or (not path.component and path.quantity in OF_LOAD)
    return Owned(name, trailer, load if of_load and is_parameter(name) else None)


def combine(truck: str, rows: Sequence[Mapping[str, Any]], settings: FleetSettings, false_alarm: float) -> Combined:
    """Combine the trips of a truck, rows of the table of trips without errors.

    `false_alarm` is the probability of a false alarm in one test.
    """
    rows = sorted(rows, key=lambda row: (row["date"], row["log"]))
    layout = _layout(rows)
    observations = _without_zeros([_observation(row, layout) for row in rows], layout)
    widening = _widening(observations, len(layout.unknowns))
    start = State.prior(len(layout.unknowns), len(layout.considered))
    walk = Walk(rate=_rate(layout, settings.tyre_walk))
    data = TruckTrips(
        start=start,
        trips=observations,
        walk=walk,
        tested=np.array([i for u, i in layout.unknowns.items() if is_parameter(u.name)], dtype=np.int64),
        kinds=_kinds(layout, observations),
        widening=widening,
    )
    changes, walk, p_values = find_changes(data, false_alarm)
    outliers = {change.trip for change in changes if change.kind.name == OUTLIER}
    used = [_without_information(o) if k in outliers else o for k, o in enumerate(observations)]
    states = smoothed(filtered(start, used, walk), used, walk)
    return Combined(
        truck=truck,
        rows=rows,
        layout=layout,
        observations=observations,
        states=states,
        widening=widening,
        changes=changes,
        p_values=p_values,
    )


def _layout(rows: Sequence[Mapping[str, Any]]) -> UnknownLayout:
    unknowns, considered = dict[Owned, int](), dict[Owned, int]()
    priors: list[Mapping[str, Any]] = []
    for row in rows:
        for unknown in row["unknowns"]:
            key = _owner(unknown["name"], row)
            if key not in unknowns:
                unknowns[key] = len(unknowns)
                priors.append(unknown)
        for name in row["considered"]:
            considered.setdefault(_owner(name, row), len(considered))
    centre, scale = (np.array([prior[field] for prior in priors]) for field in ("centre", "scale"))
    scaling = Scaling(
        logarithmic=tuple(prior["logarithmic"] for prior in priors),
        centre=centre,
        scale=scale,
        lower=np.where([prior["non_negative"] for prior in priors], centre, -np.inf),
        upper=np.full_like(centre, np.inf),
    )
    return UnknownLayout(unknowns=unknowns, considered=considered, scaling=scaling)


def _owner(name: str, row: Mapping[str, Any]) -> Owned:
    return owner(name, row["tractor"], row["trailer"], row["load"])


def _observation(row: Mapping[str, Any], layout: UnknownLayout) -> Observation:
    """The information of a trip for the priors of the layout: z of the trip = a z of the layout + b."""
    places = np.array([layout.unknowns[_owner(u["name"], row)] for u in row["unknowns"]], dtype=np.int64)
    considered = [layout.considered[_owner(name, row)] for name in row["considered"]]
    k = len(places)
    centre, scale = (np.array([u[field] for u in row["unknowns"]]) for field in ("centre", "scale"))
    prior, logarithmic = layout.scaling, np.array(layout.scaling.logarithmic)[places]
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(logarithmic, np.log(prior.centre[places] / centre), prior.centre[places] - centre)
    a, b = prior.scale[places] / scale, ratio / scale
    information = np.array(row["information"]).reshape(k, k)
    return Observation(
        time=row["date"].timestamp() / DAY,
        places=places,
        considered=np.array(considered, dtype=np.int64),
        vector=a * (np.array(row["vector"]) - information @ b),
        information=information * np.outer(a, a),
        coupling=a[:, None] * np.array(row["coupling"]).reshape(k, len(considered)),
        score_covariance=np.array(row["score_covariance"]).reshape(k, k) * np.outer(a, a),
    )


def _without_zeros(trips: Sequence[Observation], layout: UnknownLayout) -> list[Observation]:
    """The trips without the non-negative unknowns that all trips together determine as 0."""
    n, zeros = len(layout.unknowns), np.zeros(0, dtype=np.int64)
    bounded = np.flatnonzero(layout.scaling.lower == layout.scaling.centre)
    while True:
        trips = [_reduced(trip, zeros) for trip in trips]
        H, v = np.eye(n), np.zeros(n)
        for trip in trips:
            H[np.ix_(trip.places, trip.places)] += trip.information
            v[trip.places] += trip.vector
        z = np.linalg.solve(H, v)
        zeros = bounded[z[bounded] < 0]
        if not len(zeros):
            return trips


def _reduced(trip: Observation, zeros: Indices) -> Observation:
    """The trip if some unknowns are 0."""
    kept = np.flatnonzero(~np.isin(trip.places, zeros))
    part = np.ix_(kept, kept)
    return replace(
        trip,
        places=trip.places[kept],
        vector=trip.vector[kept],
        information=trip.information[part],
        coupling=trip.coupling[kept],
        score_covariance=trip.score_covariance[part],
    )


def _widening(trips: Sequence[Observation], n: int) -> Array:
    """Factors (n,) of model error from the scores of all trips together."""
    H, M = np.zeros((n, n)), np.zeros((n, n))
    for trip in trips:
        part = np.ix_(trip.places, trip.places)
        H[part] += trip.information
        M[part] += trip.score_covariance
    return model_error_factors(np.asarray(np.linalg.inv(np.eye(n) + H)), M)


def _rate(layout: UnknownLayout, tyre_walk: float) -> Array:
    """Variance of z that each unknown gains in a day."""
    rate = np.zeros(len(layout.unknowns))
    for unknown, i in layout.unknowns.items():
        if _is_stiffness(unknown.name):
            rate[i] = (tyre_walk / layout.scaling.scale[i]) ** 2
    return rate


def _is_stiffness(name: str) -> bool:
    return ParameterPath.of(name).quantity == "cornering_stiffness"


def _kinds(layout: UnknownLayout, trips: Sequence[Observation]) -> list[Kind]:
    """What may change: the tyres of an axle group, the load of a trailer, a sensor; or one trip is an outlier."""
    parameters = {u: i for u, i in layout.unknowns.items() if is_parameter(u.name)}

    def kind(name: str, subject: str, members: Sequence[int], decisive: Sequence[int] = ()) -> Kind:
        """A change of some unknowns, which may happen at each trip with one of the decisive ones, by default of all."""
        at = frozenset(k for k, trip in enumerate(trips) if np.isin(decisive or members, trip.places).any())
        return Kind(name=name, subject=subject, members=np.array(members, dtype=np.int64), trips=at)

    kinds = [
        kind("tyres", f"{u.name.removesuffix('.cornering_stiffness')}{_of_trailer(u.trailer)}", [i])
        for u, i in parameters.items()
        if _is_stiffness(u.name)
    ]
    for trailer, load in dict.fromkeys((u.trailer, u.load) for u in parameters if u.load is not None):
        own = [i for u, i in parameters.items() if (u.trailer, u.load) == (trailer, load)]
        shared = [i for u, i in parameters.items() if (u.trailer, u.load) == (trailer, None)]
        kinds.append(kind("load", trailer or "trailer", [*own, *shared], own))
    signals: dict[str, list[int]] = {}
    for u, i in layout.unknowns.items():
        if error := SensorErrorName.of(u.name):
            signals.setdefault(f"{error.signal}{_of_trailer(u.trailer)}", []).append(i)
    kinds += [kind("sensor", signal, members) for signal, members in signals.items()]
    return [*kinds, kind(OUTLIER, "trip", list(parameters.values()))]


def _of_trailer(trailer: str | None) -> str:
    return f" of {trailer}" if trailer else ""


def _without_information(trip: Observation) -> Observation:
    return replace(
        trip,
        vector=np.zeros_like(trip.vector),
        information=np.zeros_like(trip.information),
        coupling=np.zeros_like(trip.coupling),
    )


def date_of(trip: Observation) -> datetime.datetime:
    """The date of a trip."""
    return datetime.datetime.fromtimestamp(trip.time * DAY, datetime.UTC)
