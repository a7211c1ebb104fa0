"""Changes of a truck between two trips: found by the innovations of its filter, dated by the smallest posterior cost.

Test. The last m trips move the estimate of the tested unknowns by delta. Without a change delta is normal with the
covariance S = D (P - P+) D + (B+ - B)(B+ - B)', by the states before and after these trips (`states`), so that the
normalised innovation squared delta' S^-1 delta is chi-square distributed (Bar-Shalom, Li and Kirubarajan 2001, 5.4). It
is tested after every trip for the last 1, 2, 4 and 8 trips. Each of the tests has the same fraction of the false-alarm
probability of the fleet (Bonferroni), which is therefore an upper bound.

Date. Each kind of change at each date near the alarm is a hypothesis: from this trip on, the unknowns of this kind have
their priors again. The hypothesis with the smallest cost, minus the logarithm of the likelihood of all trips about the
alarm, is reported, with its posterior probability. All hypotheses have the same prior probability.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from fifthwheel._types import Array
from fifthwheel.fleet.states import Indices, Observation, State, Walk

WINDOWS = (1, 2, 4, 8)
"""Numbers of trips that are tested together."""
LOOK_BACK, LOOK_AHEAD = 4, 8
"""Trips before the tested ones at which a change may be dated, and trips after the alarm that date it."""
INFORMED = 1e-3
"""An unknown is tested if the trips reduce its variance by this fraction."""
OUTLIER = "outlier"
"""Kind of a trip that differs from those before and after it."""


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
    tested: Indices  # unknowns in the state whose change matters: the parameters of the vehicle
    kinds: Sequence[Kind]
    widening: Array  # factors (n,) of model error


def find_changes(truck: TruckTrips, false_alarm: float) -> tuple[list[TripChange], Walk, list[float]]:
    """The changes, the walk with their resets, and the normalised innovation squared of each trip as its p-value.

    `false_alarm` is the probability of a false alarm in one test.
    """
    from scipy.special import chdtrc, chdtri

    changes, walk, skipped = list[TripChange](), truck.walk, set[int]()
    states, p_values, last, n = list[State](), list[float](), 0, 0
    while n < len(truck.trips):
        before = walk.predict(states[n - 1] if n else truck.start, truck.trips, n)
        after = before if n in skipped else before.updated(truck.trips[n])
        del states[n:], p_values[n:]
        states.append(after)
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
                TripChange(
                    kind=kind,
                    trip=trip,
                    probability=probability,
                    statistic=alarm[0],
                    threshold=alarm[1],
                )
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
    truck: TruckTrips, states: Sequence[State], walk: Walk, window: range, skipped: set[int]
) -> tuple[float, int]:
    """Normalised innovation squared of consecutive trips and its degrees of freedom.

    The walk within the window counts as before it, which enlarges S a little.
    """
    first, last = window[0], window[-1]
    start = states[first - 1] if first else truck.start
    days = truck.trips[last].time - truck.trips[first].time
    before = walk.predict(start, truck.trips, first).later(walk.rate * days)
    after = before
    for k in window:
        if k not in skipped:
            after = after.updated(truck.trips[k])
    reduction = np.diag(before.P - after.P)[truck.tested] / np.diag(before.P)[truck.tested]
    tested = truck.tested[reduction > INFORMED]
    if not len(tested):
        return 0.0, 0
    part, d = np.ix_(tested, tested), truck.widening[tested]
    effect = (after.B - before.B)[tested]
    S = (before.P - after.P)[part] * np.outer(d, d) + effect @ effect.T
    delta = (after.z - before.z)[tested]
    return float(delta @ np.linalg.solve(S, delta)), len(tested)


def _dated(
    truck: TruckTrips, states: Sequence[State], walk: Walk, skipped: set[int], alarm: tuple[int, int, int]
) -> tuple[Kind, int, float] | None:
    """The most probable kind and trip of a change with its probability; None if no change is more probable than none.

    `alarm` has the trip of the change before, and the first and last trip of the window.
    """
    last, first, n = alarm
    begin, end = max(last, first - LOOK_BACK, 0), min(n + LOOK_AHEAD, len(truck.trips) - 1)
    start = states[begin - 1] if begin else truck.start
    trips = [k for k in range(begin, end + 1) if k not in skipped]

    def cost(kind: Kind | None, trip: int) -> float:
        state, total, previous = start, 0.0, begin - 1
        for k in trips:
            days = truck.trips[k].time - truck.trips[previous].time if k else 0.0
            state, previous = state.later(walk.rate * days), k
            if k in walk.resets:
                state = state.reset(walk.resets[k])
            if kind and k == trip:
                fresh = state.reset(kind.members)
                total += fresh.cost(truck.trips[k])
                state = state if kind.name == OUTLIER else fresh.updated(truck.trips[k])
                continue
            total += state.cost(truck.trips[k])
            state = state.updated(truck.trips[k])
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
