"""Changes of a truck between two trips: found by the innovations of its filter, dated by the smallest posterior cost.

Test. The last m trips move the estimate of the tested unknowns by delta. Without a change delta is normal with the
covariance S = D (P - P+) D, by the states before and after these trips (`states`), so that the normalised innovation
squared delta' S^-1 delta is chi-square distributed (Bar-Shalom, Li and Kirubarajan 2001, 5.4). It is tested after every
trip for the last 1, 2, 4 and 8 trips. Each of the tests has the same fraction of the false-alarm probability of the
fleet (Bonferroni), which is therefore an upper bound.

Date. Each kind of change at each date near the alarm is a hypothesis: from this trip on, the unknowns of this kind have
their priors again. The hypothesis with the smallest cost, minus the logarithm of the likelihood of all trips about the
alarm, is reported, with its posterior probability. All hypotheses have the same prior probability.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fifthwheel.base.types import Array, Indices
from fifthwheel.estimate.identify.knowledge.information import OUTLIER
from fifthwheel.estimate.identify.knowledge.states import Observation, State, Walk, together

WINDOWS = (1, 2, 4, 8)
"""Numbers of trips that are tested together."""
LOOK_BACK, LOOK_AHEAD = 4, 8
"""Trips before the tested ones at which a change may be dated, and trips after the alarm that date it."""
INFORMED = 1e-3
"""An unknown is tested if the trips reduce its variance by this fraction."""
SINGULAR = 1e-9
"""Eigenvalue of the correlations of the tested unknowns below which trips do not move a combination of them."""


@dataclass(frozen=True, kw_only=True)
class Kind:
    """A kind of change: the unknowns that it alters."""

    name: str  # "tyres", "load", "sensor" or `OUTLIER`
    subject: str  # what has changed: an axle group, a trailer, a signal
    members: Indices  # in the state
    trips: frozenset[int]  # at which trips it may have happened


@dataclass(frozen=True, kw_only=True)
class TripChange:
    """A change before one trip; an outlier is that trip itself."""

    kind: Kind
    trip: int
    probability: float  # of this kind at this trip, among all kinds and dates
    statistic: float  # normalised innovation squared of the alarm
    threshold: float  # that it exceeds without a change by the false-alarm probability of one test


@dataclass(frozen=True, kw_only=True)
class TruckTrips:
    """The trips of one truck in the order of time, and what its unknowns are."""

    start: State
    trips: Sequence[Observation]
    walk: Walk
    tested: Indices  # unknowns in the state whose change matters: the estimated parameters
    kinds: Sequence[Kind]
    widening: Array  # factors (n,) of model error


def find_changes(truck: TruckTrips, false_alarm: float) -> tuple[list[TripChange], Walk, list[float]]:
    """The changes, the walk with their resets, and the normalised innovation squared of each trip as its p-value.

    `false_alarm` is the probability of a false alarm in one test.
    """
    from scipy.special import chdtrc, chdtri

    changes, walk, skipped = list[TripChange](), truck.walk, set[int]()
    states, p_values, last, n = {-1: truck.start}, list[float](), 0, 0  # states after each trip
    while n < len(truck.trips):
        last = n if n in walk.resets else last
        before = walk.predict(states[n - 1], truck.trips, n)
        states[n] = before if n in skipped else before.updated(truck.trips[n])
        del p_values[n:]
        p_values.append(1.0)
        alarm = None
        for size in WINDOWS:
            first = n - size + 1
            if first < last or n in skipped:
                continue
            statistic, degrees = _statistic(truck, states, walk, range(first, n + 1), skipped)
            if size == 1:
                p_values[n] = float(chdtrc(degrees, statistic)) if degrees else 1.0
            if degrees and statistic > chdtri(degrees, false_alarm):
                alarm = alarm or (statistic, float(chdtri(degrees, false_alarm)), first)
        found = alarm and _dated(truck, states, walk, skipped, (last, alarm[2], n))
        if alarm and found:
            kind, trip, probability = found
            changes.append(
                TripChange(kind=kind, trip=trip, probability=probability, statistic=alarm[0], threshold=alarm[1])
            )
            if kind.name == OUTLIER:
                skipped.add(trip)
            else:
                members = np.union1d(walk.resets.get(trip, np.zeros(0, dtype=np.int64)), kind.members)
                walk = replace(walk, resets={**walk.resets, trip: members.astype(np.int64)})
                last = trip
            n = trip
        else:
            n += 1
    return changes, walk, p_values


def _statistic(
    truck: TruckTrips, states: Mapping[int, State], walk: Walk, window: range, skipped: set[int]
) -> tuple[float, int]:
    """Normalised innovation squared of consecutive trips and its degrees of freedom."""
    first, last = window[0], window[-1]
    used = [truck.trips[k] for k in window if k not in skipped]
    if not used:
        return 0.0, 0
    trip = together(used)
    days = truck.trips[last].time - truck.trips[first].time
    # the walk within the window counts as before it, which enlarges S a little
    before = walk.predict(states[first - 1], truck.trips, first).later(walk.rate * days)
    i, H, P = trip.places, trip.information, before.P
    gain = np.linalg.solve(np.eye(len(i)) + H @ P[np.ix_(i, i)], H)  # P - P+ = P gain P
    tested = np.intersect1d(truck.tested, i)  # all others move with these
    of_tested = P[np.ix_(tested, i)]
    reduction = np.sum(of_tested @ gain * of_tested, axis=1) / np.diag(P)[tested]
    informed = reduction > INFORMED
    if not informed.any():
        return 0.0, 0
    rows, d = of_tested[informed], truck.widening[tested[informed]]
    S = rows @ gain @ rows.T * np.outer(d, d)
    innovation = trip.vector - H @ before.z[i]
    delta = rows @ (innovation - gain @ (P[np.ix_(i, i)] @ innovation))
    sigma = np.sqrt(np.diag(S))
    eigenvalues, axes = np.linalg.eigh(S / np.outer(sigma, sigma))
    kept = eigenvalues > SINGULAR
    return float(np.sum((axes.T @ (delta / sigma))[kept] ** 2 / eigenvalues[kept])), int(kept.sum())


def _dated(
    truck: TruckTrips, states: Mapping[int, State], walk: Walk, skipped: set[int], alarm: tuple[int, int, int]
) -> tuple[Kind, int, float] | None:
    """The most probable kind and trip of a change with its probability; None if none is more probable."""
    last, first, n = alarm  # the trip of the change before, and the first and last trip of the window
    begin, end = max(last, first - LOOK_BACK, 0), min(n + LOOK_AHEAD, len(truck.trips) - 1)
    trips = [k for k in range(begin, end + 1) if k not in skipped]
    places = together([truck.trips[k] for k in trips]).places  # all others are of no effect
    start, rate = states[begin - 1].among(places), walk.rate[places]
    local = {k: replace(truck.trips[k], places=np.searchsorted(places, truck.trips[k].places)) for k in trips}

    def among(members: Indices) -> Indices:
        return np.flatnonzero(np.isin(places, members))

    def cost(kind: Kind | None, trip: int) -> float:
        state, total, previous = start, 0.0, begin - 1
        for k in trips:
            days = truck.trips[k].time - truck.trips[previous].time if k else 0.0
            state, previous = state.later(rate * days), k
            if k in walk.resets:
                state = state.reset(among(walk.resets[k]))
            if kind and k == trip:
                fresh = state.reset(among(kind.members))
                total += fresh.cost(local[k])
                state = state if kind.name == OUTLIER else fresh.updated(local[k])
                continue
            total += state.cost(local[k])
            state = state.updated(local[k])
        return total

    none = cost(None, 0)
    hypotheses = [
        (cost(kind, k), kind, k)
        for kind in truck.kinds
        for k in trips
        if max(begin, last + 1, 1) <= k <= n and k in kind.trips and k not in walk.resets
    ]
    if not hypotheses:
        return None
    smallest, kind, trip = min(hypotheses, key=lambda item: item[0])
    if smallest >= none:
        return None
    return kind, trip, float(1 / sum(np.exp(np.minimum(smallest - other, 0.0)) for other, _, _ in hypotheses))
