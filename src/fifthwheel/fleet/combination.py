"""The trips of one truck combined: its unknowns over all its trailers and loads, changes, and histories.

Which trips share an unknown follows from its unit. Unknowns of the first unit, with its sensors, belong to the truck.
Those of the units behind it belong to the trailer, and those that depend on the payload to the load of this trailer; so
do the axle loads of all units. An error of a weighbridge, `mass_scale`, and the rate of the logger's time base belong
to the truck. Numbers of all units together, such as those of the law of the tyres and the drag area, belong to the
trailer: another trailer has other tyres.
"""

import datetime
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fifthwheel._types import Array
from fifthwheel.channels import SensorErrorName
from fifthwheel.errors import FifthwheelError
from fifthwheel.filters.scaling import Scaling
from fifthwheel.fleet.changes import OUTLIER, Kind, TripChange, TruckTrips, find_changes
from fifthwheel.fleet.states import Indices, Observation, State, Walk, filtered, smoothed
from fifthwheel.identify.one_stage.posterior import model_error_factors
from fifthwheel.identify.unknowns.parameters import TIME_BASE, unit_of_unknown
from fifthwheel.names import ParameterPath
from fifthwheel.options import FleetSettings
from fifthwheel.vehicle.uncertainty import MASS_SCALE

DAY = 86_400.0
"""Seconds."""
OF_LOAD = ("mass", "cog", "yaw_inertia")
"""Quantities of a unit behind the first that depend on its load, besides those of its payload and body."""
OF_AXLE_LOADS = ("static_load", "braking_load", "braked_mass")
"""Quantities of an axle group of any unit that depend on the load."""
OF_TRUCK = (MASS_SCALE, TIME_BASE)
"""Unknowns of no unit that belong to the truck."""
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
    scaling: Scaling  # the lower bound of an unknown that is not negative is its centre
    estimated: frozenset[Owned]  # parameters that a trip estimates; the others are uncertain, or sensor errors


@dataclass(frozen=True, kw_only=True)
class Combined:
    """The result for one truck."""

    truck: str
    rows: Sequence[Mapping[str, Any]]  # of its trips, in the order of time
    layout: UnknownLayout
    observations: Sequence[Observation]
    z: Sequence[Array]  # (n,) at each trip, from all trips
    variance: Sequence[Array]  # (n,) of z, without model error
    widening: Array
    changes: Sequence[TripChange]
    p_values: Sequence[float]  # of each trip by its innovation

    def estimate(self, k: int, unknown: Owned) -> tuple[float, float]:
        """Value and sigma of an unknown at trip k, SI."""
        i = self.layout.unknowns[unknown]
        sigma = float(np.sqrt(self.variance[k][i]) * self.widening[i])
        with np.errstate(over="ignore"):
            values = self.layout.scaling.to_p(self.z[k])
        return float(values[i]), sigma * float(self.layout.scaling.slope(values)[i])

    def parameters(self, k: int) -> list[Owned]:
        """The estimated parameters at trip k."""
        places = set(self.observations[k].places.tolist())
        return [u for u, i in self.layout.unknowns.items() if i in places and u in self.layout.estimated]


def of_vehicle(name: str) -> bool:
    """Whether an unknown is one of the vehicle, and not of a sensor or of a time base."""
    return name != TIME_BASE and SensorErrorName.of(name) is None


def owner(name: str, tractor: str, trailer: str, load: str) -> Owned:
    """An unknown of a trip with the trailer and the load that it belongs to."""
    path = ParameterPath.of(name)
    if path.quantity in OF_AXLE_LOADS:
        return Owned(name, trailer, load)
    if name in OF_TRUCK or unit_of_unknown(name) == tractor:
        return Owned(name)
    of_load = path.component in LOADED or (not path.component and path.quantity in OF_LOAD)
    return Owned(name, trailer, load if of_load and of_vehicle(name) else None)


def combine(truck: str, rows: Sequence[Mapping[str, Any]], settings: FleetSettings, false_alarm: float) -> Combined:
    """Combine the trips of a truck, rows of the table of trips without errors.

    `false_alarm` is the probability of a false alarm in one test. A FifthwheelError: a row is of a version that did not
    estimate the uncertain numbers of the vehicle file; its information does not contain them.
    """
    if old := [row for row in rows if row.get("considered")]:
        raise FifthwheelError(
            f"{len(old)} of {len(rows)} trips, such as {old[0]['log']}, were processed by a version that did not "
            "estimate the uncertain numbers of the vehicle file; list them in the manifest and run again, or write to "
            "another data set"
        )
    rows = sorted(rows, key=lambda row: (row["date"], row["log"]))
    layout = _layout(rows)
    observations = _without_zeros([_observation(row, layout) for row in rows], layout)
    widening = _widening(observations, len(layout.unknowns))
    start = State.prior(len(layout.unknowns))
    walk = Walk(rate=_rate(layout, settings.tyre_walk))
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
    used = [_without_information(o) if k in outliers else o for k, o in enumerate(observations)]
    backwards = [(state.z, np.diag(state.P).copy()) for state in smoothed(filtered(start, used, walk), used, walk)]
    return Combined(
        truck=truck,
        rows=rows,
        layout=layout,
        observations=observations,
        z=[z for z, _ in reversed(backwards)],
        variance=[variance for _, variance in reversed(backwards)],
        widening=widening,
        changes=changes,
        p_values=p_values,
    )


def _layout(rows: Sequence[Mapping[str, Any]]) -> UnknownLayout:
    unknowns, priors = dict[Owned, int](), list[Mapping[str, Any]]()
    for row in rows:
        for unknown in row["unknowns"]:
            key = _owner(unknown["name"], row)
            if key not in unknowns:
                unknowns[key] = len(unknowns)
                priors.append(unknown)
    centre, scale = (np.array([prior[field] for prior in priors]) for field in ("centre", "scale"))
    scaling = Scaling(
        logarithmic=tuple(prior["logarithmic"] for prior in priors),
        centre=centre,
        scale=scale,
        lower=np.where([prior["non_negative"] for prior in priors], centre, -np.inf),
        upper=np.full_like(centre, np.inf),
    )
    estimated = frozenset(_owner(estimate["name"], row) for row in rows for estimate in row["estimates"])
    return UnknownLayout(unknowns=unknowns, scaling=scaling, estimated=estimated & unknowns.keys())


def _owner(name: str, row: Mapping[str, Any]) -> Owned:
    return owner(name, row["tractor"], row["trailer"], row["load"])


def _observation(row: Mapping[str, Any], layout: UnknownLayout) -> Observation:
    """The information of a trip for the priors of the layout: z of the trip = a z of the layout + b."""
    places = np.array([layout.unknowns[_owner(u["name"], row)] for u in row["unknowns"]], dtype=np.int64)
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
        vector=a * (np.array(row["vector"]) - information @ b),
        information=information * np.outer(a, a),
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
        score_covariance=trip.score_covariance[part],
    )


def _widening(trips: Sequence[Observation], n: int) -> Array:
    """Factors (n,) of model error from the scores of all trips together."""
    H, M = np.zeros((n, n)), np.zeros((n, n))
    for trip in trips:
        part = np.ix_(trip.places, trip.places)
        H[part] += trip.information
        M[part] += trip.score_covariance
    return model_error_factors(np.asarray(np.linalg.inv(np.eye(n) + H)), np.eye(n), M)


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
    parameters = {u: i for u, i in layout.unknowns.items() if of_vehicle(u.name)}

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
    return replace(trip, vector=np.zeros_like(trip.vector), information=np.zeros_like(trip.information))


def date_of(trip: Observation) -> datetime.datetime:
    """The date of a trip."""
    return datetime.datetime.fromtimestamp(trip.time * DAY, datetime.UTC)
