"""The filter and the smoother over days, against one large least-squares problem."""

from dataclasses import replace

import numpy as np

from fifthwheel.estimate.identify.knowledge.states import Observation, State, Walk, filtered, smoothed, together

RATE = np.array([0.02, 0.0])


def trips(rng, count=6):
    """Trips of two unknowns."""
    for k in range(count):
        root = rng.standard_normal((3, 2))
        yield Observation(
            time=2.0 * k,
            places=np.array([0, 1]),
            vector=rng.standard_normal(2),
            information=root.T @ root,
            score_covariance=root.T @ root,
        )


def batch(observations, reset):
    """All states together: mean (N, 2) and covariance (2N, 2N)."""
    n = 2 * len(observations)
    H, v = np.zeros((n, n)), np.zeros(n)
    H[:2, :2] = np.eye(2)
    for k, trip in enumerate(observations):
        own = slice(2 * k, 2 * k + 2)
        H[own, own] += trip.information
        v[own] += trip.vector
        for i in range(2) if k else ():
            a, b = 2 * k + i, 2 * k - 2 + i
            if k == reset and i == 0:
                H[a, a] += 1.0
                continue
            precision = 1 / (2 * RATE[i]) if RATE[i] else 1e9
            H[a, a] += precision
            H[b, b] += precision
            H[a, b] -= precision
            H[b, a] -= precision
    P = np.linalg.inv(H)
    return (P @ v).reshape(-1, 2), P


def test_smoothed_states_are_those_of_one_least_squares_problem() -> None:
    observations = list(trips(np.random.default_rng(1)))
    walk = Walk(rate=RATE, resets={3: np.array([0])})
    backwards = smoothed(filtered(State.prior(2), observations, walk), observations, walk)
    mean, P = batch(observations, reset=3)
    for k, state in enumerate(reversed(list(backwards))):
        own = slice(2 * k, 2 * k + 2)
        np.testing.assert_allclose(state.z, mean[k], rtol=1e-5, atol=1e-6)
        np.testing.assert_allclose(state.P, P[own, own], rtol=1e-5, atol=1e-6)


def test_several_trips_as_one() -> None:
    """Without a walk, one update with their sums equals one update for each; trips may have different unknowns."""
    first, second = trips(np.random.default_rng(3), 2)
    second = replace(second, places=np.array([1, 2]))
    expected = State.prior(3).updated(first).updated(second)
    found = State.prior(3).updated(together([first, second]))
    np.testing.assert_allclose(found.z, expected.z, rtol=1e-12)
    np.testing.assert_allclose(found.P, expected.P, rtol=1e-12, atol=1e-15)


def test_cost_is_minus_the_logarithm_of_the_likelihood() -> None:
    """Against the density of the innovation d ~ N(0, H + H P H), less the constant of the trip."""
    (trip,) = trips(np.random.default_rng(2), 1)
    H, v = trip.information, trip.vector
    constants = []
    for z in (np.zeros(2), np.array([1.0, -0.5])):
        state = State(z, np.diag([0.5, 2.0]))
        S, d = H + H @ state.P @ H, v - H @ z
        density = d @ np.linalg.solve(S, d) / 2 + np.linalg.slogdet(S)[1] / 2
        constants.append(state.cost(trip) - density)
    assert constants[0] == np.float64(constants[0])
    np.testing.assert_allclose(constants[0], constants[1], rtol=1e-9)
