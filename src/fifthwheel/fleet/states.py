"""Estimates over days from the information of trips: a Kalman filter in time, and its smoother.

The state z (n,) holds the unknowns of a truck in units of their priors, z ~ N(0, I) at first. Tyre stiffnesses follow a
random walk over days, all others are constant until a change. A trip gives its information vector v, information H and
coupling G to m considered unknowns c, which keep their prior N(0, I) (Schmidt 1966):

    update       P+ = P - P H (I + P H)^-1 P,      d = v - H z,      z+ = z + P+ d,      B+ = B - P+ (H B + G),
    smoother     z_k|N = z_k + C (z_k+1|N - z_k+1|k),      C = P_k F' P_k+1|k^-1      (Rauch, Tung and Striebel 1965),

with the effect B (n, m) of c on the error of z, and F = I but for the unknowns that a change resets to their priors.
The covariance of z is D P D + B B'; D is the diagonal of factors by which model error widens P (`identify.one_stage`).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from fifthwheel._types import Array

Indices = NDArray[np.int64]


@dataclass(frozen=True, kw_only=True)
class Observation:
    """The information of one trip, and where its k unknowns and j considered unknowns are in the state."""

    time: float  # days
    places: Indices  # (k,) in the state
    considered: Indices  # (j,) among the considered unknowns
    vector: Array  # (k,)
    information: Array  # (k, k)
    coupling: Array  # (k, j)
    score_covariance: Array  # (k, k); see `SharedInformation`


@dataclass(frozen=True)
class State:
    """An estimate of n unknowns."""

    z: Array  # (n,)
    P: Array  # covariance (n, n), without model error and considered unknowns
    B: Array  # effect (n, m) of the considered unknowns on the error of z

    @classmethod
    def prior(cls, n: int, m: int) -> "State":
        """The prior of n unknowns with m considered ones."""
        return cls(np.zeros(n), np.eye(n), np.zeros((n, m)))

    def reset(self, members: Indices) -> "State":
        """The state with the prior of some unknowns."""
        z, P, B = self.z.copy(), self.P.copy(), self.B.copy()
        z[members], B[members] = 0.0, 0.0
        P[members], P[:, members] = 0.0, 0.0
        P[members, members] = 1.0
        return State(z, P, B)

    def later(self, variance: Array) -> "State":
        """The prediction for a later time, by which the random walk gains a variance (n,)."""
        P = self.P.copy()
        P[np.diag_indices_from(P)] += variance
        return State(self.z, P, self.B)

    def updated(self, trip: Observation) -> "State":
        """The state with the information of a trip."""
        i, H = trip.places, trip.information
        P_i = self.P[:, i]
        P = self.P - P_i @ np.linalg.solve(np.eye(len(i)) + H @ P_i[i], H) @ P_i.T
        P = (P + P.T) / 2
        effect = H @ self.B[i]
        effect[:, trip.considered] += trip.coupling
        return State(self.z + P[:, i] @ (trip.vector - H @ self.z[i]), P, self.B - P[:, i] @ effect)

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
    states, state = list[State](), start
    for k, trip in enumerate(trips):
        state = walk.predict(state, trips, k).updated(trip)
        states.append(state)
    return states


def smoothed(states: Sequence[State], trips: Sequence[Observation], walk: Walk) -> list[State]:
    """The state at each trip from all trips, by the states after each trip."""
    result = list(states)
    for k in range(len(states) - 2, -1, -1):
        now, after = states[k], result[k + 1]
        predicted = walk.predict(now, trips, k + 1)
        transition = np.ones(len(now.z))
        transition[walk.resets.get(k + 1, [])] = 0.0
        C = np.linalg.solve(predicted.P, (now.P * transition).T).T
        P = now.P + C @ (after.P - predicted.P) @ C.T
        result[k] = State(now.z + C @ (after.z - predicted.z), (P + P.T) / 2, now.B + C @ (after.B - predicted.B))
    return result
