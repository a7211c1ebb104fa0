"""Estimates over days from the information of trips: a Kalman filter in time, and its smoother.

The state z (n,) holds the unknowns of a truck in units of their priors, z ~ N(0, I) at first. Tyre stiffnesses follow a
random walk over days, all others are constant until a change. A trip gives its information vector v and information H:

    update       P+ = P - P H (I + P H)^-1 P,      z+ = z + P+ (v - H z)
    smoother     z_k|N = z_k + C (z_k+1|N - z_k+1|k),      C = P_k F' P_k+1|k^-1      (Rauch, Tung and Striebel 1965),

with F = I but for the unknowns that a change resets to their priors. The covariance of z is D P D; D is the diagonal of
factors by which model error widens P (`estimate.identify.one_stage`).

Few unknowns of many walk. Between two trips without a change P_k+1|k = P_k + Q, so that C = I - Q P_k+1|k^-1 differs
from I only in the rows of those that walk.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from fifthwheel.base.types import Array, Indices


@dataclass(frozen=True, kw_only=True)
class Observation:
    """The information of one trip, and where its k unknowns are in the state."""

    time: float  # days
    places: Indices  # (k,) in the state
    vector: Array  # (k,)
    information: Array  # (k, k)
    score_covariance: Array  # (k, k); see `SharedInformation`


@dataclass(frozen=True)
class State:
    """An estimate of n unknowns."""

    z: Array  # (n,)
    P: Array  # covariance (n, n), without model error

    @classmethod
    def prior(cls, n: int) -> "State":
        """The prior of n unknowns."""
        return cls(np.zeros(n), np.eye(n))

    def reset(self, members: Indices) -> "State":
        """The state with the prior of some unknowns."""
        z, P = self.z.copy(), self.P.copy()
        z[members] = 0.0
        P[members], P[:, members] = 0.0, 0.0
        P[members, members] = 1.0
        return State(z, P)

    def later(self, variance: Array) -> "State":
        """The prediction for a later time, by which the random walk gains a variance (n,)."""
        P = self.P.copy()
        P[np.diag_indices_from(P)] += variance
        return State(self.z, P)

    def updated(self, trip: Observation) -> "State":
        """The state with the information of a trip."""
        i, H = trip.places, trip.information
        P_i = self.P[:, i]
        P = self.P - P_i @ np.linalg.solve(np.eye(len(i)) + H @ P_i[i], H) @ P_i.T
        P = (P + P.T) / 2
        return State(self.z + P[:, i] @ (trip.vector - H @ self.z[i]), P)

    def among(self, places: Indices) -> "State":
        """The state of some unknowns."""
        return State(self.z[places], self.P[np.ix_(places, places)])

    def cost(self, trip: Observation) -> float:
        """Minus the logarithm of the likelihood of a trip at this prediction, less a constant of the trip."""
        i, H = trip.places, trip.information
        z, P = self.z[i], self.P[np.ix_(i, i)]
        d = trip.vector - H @ z
        _, logarithm = np.linalg.slogdet(np.eye(len(i)) + H @ P)
        gain = P @ np.linalg.solve(np.eye(len(i)) + H @ P, d)
        return float(z @ H @ z / 2 - trip.vector @ z + logarithm / 2 - d @ gain / 2)


@dataclass(frozen=True, kw_only=True)
class Walk:
    """How the unknowns change over days."""

    rate: Array  # variance that each unknown gains in a day (n,)
    resets: Mapping[int, Indices] = field(default_factory=dict)
    """Before the trip of this number: the unknowns that take their priors again."""

    def predict(self, state: State, trips: Sequence[Observation], k: int) -> State:
        """The state before trip k from that after the trip before."""
        days = trips[k].time - trips[k - 1].time if k else 0.0
        state = state.later(self.rate * days)
        return state.reset(self.resets[k]) if k in self.resets else state


def filtered(start: State, trips: Sequence[Observation], walk: Walk) -> list[State]:
    """The state after each trip."""
    states = [start]
    for k, trip in enumerate(trips):
        states.append(walk.predict(states[-1], trips, k).updated(trip))
    return states[1:]


def smoothed(states: Sequence[State], trips: Sequence[Observation], walk: Walk) -> Iterator[State]:
    """The state at each trip from all trips, the last trip first, by the states after each trip."""
    after = states[-1]
    yield after
    for k in range(len(states) - 2, -1, -1):
        now, predicted = states[k], walk.predict(states[k], trips, k + 1)
        if k + 1 in walk.resets:
            transition = np.ones(len(now.z))
            transition[walk.resets[k + 1]] = 0.0
            C = np.linalg.solve(predicted.P, (now.P * transition).T).T
            z, P = now.z + C @ (after.z - predicted.z), now.P + C @ (after.P - predicted.P) @ C.T
        else:
            z, P = _smoothed_walk(now, predicted, after)
        after = State(z, (P + P.T) / 2)
        yield after


def _smoothed_walk(now: State, predicted: State, after: State) -> tuple[Array, Array]:
    """z and P of the smoother between two trips without a change."""
    variance = np.diag(predicted.P) - np.diag(now.P)
    walking = np.flatnonzero(variance)
    difference, d = after.P - predicted.P, after.z - now.z
    if not len(walking):
        return now.z + d, now.P + difference
    gain = variance[walking, None] * np.linalg.solve(predicted.P, np.eye(len(now.z))[:, walking]).T  # rows of I - C
    z = now.z + d
    z[walking] -= gain @ d
    P = difference
    P[walking] -= gain @ P
    P[:, walking] -= P @ gain.T
    return z, now.P + P


def together(trips: Sequence[Observation]) -> Observation:
    """Several trips between which nothing walks as one."""
    places = np.unique(np.concatenate([trip.places for trip in trips]))
    k = len(places)
    vector, information, scores = np.zeros(k), np.zeros((k, k)), np.zeros((k, k))
    for trip in trips:
        own = np.searchsorted(places, trip.places)
        vector[own] += trip.vector
        information[np.ix_(own, own)] += trip.information
        scores[np.ix_(own, own)] += trip.score_covariance
    return replace(trips[-1], places=places, vector=vector, information=information, score_covariance=scores)
