"""Repeated segments: no effect on a linear model, and the most probable parameters of a nonlinear one."""

import copy

import casadi as ca
import numpy as np
import pytest
from scipy.optimize import least_squares

from fifthwheel.base.types import Array
from fifthwheel.estimate.filters import Noise
from fifthwheel.estimate.filters.relinearised import JointEstimate, RelinearisationSettings, RelinearisedFilter
from fifthwheel.estimate.filters.scaling import Scaling
from tests.estimate.filters.examples import example
from tests.estimate.filters.test_joint import MODEL, NOISE, SCALING, C, kalman


def rows_of(count: int, seed: int = 3) -> Array:
    """dt, d, y, weight, learn."""
    rng = np.random.default_rng(seed)
    columns = [rng.uniform(0.01, 0.2, count), rng.normal(size=(count, 3)), rng.random((count, 2)) < 0.8]
    return np.column_stack([*columns, rng.random(count) < 0.6])


def linear_filter(**settings: float) -> RelinearisedFilter:
    made = RelinearisedFilter(
        MODEL,
        c=C,
        noise=NOISE,
        scaling=SCALING,
        walk=np.zeros(2),
        correlation=np.zeros((0, 0)),
        settings=RelinearisationSettings(**settings),
    )
    made.start(np.zeros(3), np.eye(3), np.zeros((3, 2)), np.zeros(1))
    return made


def advance(made: RelinearisedFilter, row: Array, in_segment: bool) -> tuple[bool, bool]:
    made.sample[0, : len(row) - 1] = row[:-1]
    return made.advance(in_segment, bool(row[-1]))


@pytest.mark.slow
@pytest.mark.parametrize("max_passes", [0, 3])
@pytest.mark.parametrize(("lag", "samples"), [(4, 50), (50, 9), (2, 1)])
def test_repetition_has_no_effect_on_a_linear_model(max_passes: int, lag: int, samples: int) -> None:
    """After every sample the estimate is that of the Kalman filter of [x, z], whatever is repeated."""
    rows, in_segment = rows_of(60), (np.arange(60) // 13) % 2 == 1
    rows[~in_segment, -1] = 0.0  # nothing is learned outside of segments
    made = linear_filter(max_passes=max_passes, lag=lag, samples=samples, first_pass_limit=0.0, pass_limit=1e-9)
    copied = None
    for k, (row, inside, (mean, P)) in enumerate(zip(rows, in_segment, kalman(rows, np.ones(2)), strict=True)):
        used, _ = advance(made, row, bool(inside))
        assert used == (row[4:6].any())
        estimate = made.estimate()
        np.testing.assert_allclose(estimate.z, mean[3:], atol=1e-10)
        np.testing.assert_allclose(estimate.Pz, P[3:, 3:], atol=1e-10)
        if k == 20:
            copied = copy.deepcopy(made.memory())
    other = linear_filter(max_passes=max_passes, lag=lag, samples=samples, first_pass_limit=0.0, pass_limit=1e-9)
    other.restore(copied)
    for row, inside in zip(rows[21:], in_segment[21:], strict=True):
        advance(other, row, bool(inside))
    np.testing.assert_array_equal(other.estimate().z, made.estimate().z)
    np.testing.assert_array_equal(other.carry, made.carry)


LOGARITHMIC = example(
    lambda x, dt, d, p, c: x[0] * ca.exp(-dt), lambda x, d, p, c: x[0] + p[0] * d[0] + p[1] ** 2, x=1, d=1, p=2
)
LOG_SCALING = Scaling(
    logarithmic=(True, False),
    centre=np.array([1.0, 0.5]),
    scale=np.array([0.6, 1.0]),
    lower=np.array([1e-3, -9.0]),
    upper=np.array([1e3, 9.0]),
)


def logarithmic_filter(V: Array | None = None, **settings: float) -> RelinearisedFilter:
    noise = Noise(process=np.zeros((1, 1)), measurement=np.array([0.05]))
    made = RelinearisedFilter(
        LOGARITHMIC,
        c=np.zeros(0),
        noise=noise,
        scaling=LOG_SCALING,
        walk=np.zeros(2),
        correlation=np.zeros((0, 0)),
        settings=RelinearisationSettings(**settings),
    )
    made.start(np.zeros(1), np.full((1, 1), 1e-12), np.zeros((1, 2)) if V is None else V, np.zeros(1))
    return made


def learn(made: RelinearisedFilter, rows: Array) -> bool:
    """Give a filter rows [d, y] of one segment; whether the state must be started again."""
    restart = False
    for d, y in rows:
        made.sample[0, :4] = 0.0, d, y, 1.0
        restart |= made.advance(True, True)[1]
    return restart


def pause(made: RelinearisedFilter, count: int) -> bool:
    """Samples outside of a segment, without measurements."""
    restart = False
    for _ in range(count):
        made.sample[0, :4] = 0.0
        restart |= made.advance(False, False)[1]
    return restart


def nonlinear(inputs: Array, y: Array, **settings: float) -> JointEstimate:
    """The estimate after one segment of a model that is nonlinear in its parameters, whose state is known."""
    made = logarithmic_filter(**settings)
    learn(made, np.column_stack([inputs, y]))
    made.end_segment()
    assert made._count == 0  # the segment is done
    return made.estimate()


def test_repetition_reaches_the_most_probable_parameters() -> None:
    """Against a search of the maximum by SciPy; without repetition the filter stays away from it."""
    rng = np.random.default_rng(5)
    inputs = rng.normal(size=30)
    y = 2.5 * inputs + 1.2**2 + np.sqrt(0.05) * rng.normal(size=30)

    def residual(z: Array) -> Array:
        p = LOG_SCALING.to_p(z)
        return np.concatenate([z, (y - p[0] * inputs - p[1] ** 2) / np.sqrt(0.05)])

    expected = least_squares(residual, np.zeros(2), xtol=1e-14, ftol=1e-14, gtol=1e-14)
    sigma = np.sqrt(np.diag(np.linalg.inv(expected.jac.T @ expected.jac)))
    for lag in (3, 100):
        repeated = nonlinear(inputs, y, max_passes=30, first_pass_limit=1e-6, pass_limit=1e-6, lag=lag)
        assert np.abs((repeated.z - expected.x) / sigma).max() < 1e-3
        np.testing.assert_allclose(np.sqrt(np.diag(repeated.Pz)), sigma, rtol=1e-3)
    once = nonlinear(inputs, y, max_passes=0)
    assert np.abs((once.z - expected.x) / sigma).max() > 0.1
    # a limit far above the change ends the repetition with the first pass
    first = nonlinear(inputs, y, max_passes=30, first_pass_limit=1e9, pass_limit=1e-6, lag=100)
    assert np.abs((first.z - expected.x) / sigma).max() > 10 * np.abs((repeated.z - expected.x) / sigma).max()
    one = nonlinear(inputs, y, lag=100, max_passes=1, first_pass_limit=1e-6, pass_limit=1e-6)
    assert one.z == pytest.approx(first.z, abs=1e-9)


def test_inflation_of_the_variance() -> None:
    """At most to the variance of the prior; correlations stay, and the scores contain so much less information."""
    Pz = np.array([[0.1, 0.12], [0.12, 0.4]])
    estimate = JointEstimate(
        z=np.ones(2),
        Pz=Pz,
        B=np.ones((2, 1)),
        gradient=np.array([6.0]),
        information=np.array([8.0]),
        correlation=np.eye(1),
    )
    wider = estimate.with_variance_inflation(4.0)
    assert np.diag(wider.Pz) == pytest.approx([0.4, 1.0])
    assert wider.Pz[0, 1] / np.sqrt(0.4) == pytest.approx(0.12 / np.sqrt(0.1 * 0.4))
    assert (wider.gradient, wider.information) == (1.5, 2.0)
    np.testing.assert_array_equal(wider.z, estimate.z)
    np.testing.assert_allclose(estimate.covariance(), [[1.1, 1.12, 1], [1.12, 1.4, 1], [1, 1, 1]])


def passed_over(z: Array, P: Array, rows: Array, points: Array) -> tuple[Array, Array]:
    """z and its covariance after rows [d, y], each linearised at a point of its own."""
    for (d, y), point in zip(rows, points, strict=True):
        p = LOG_SCALING.to_p(point)
        gradient = np.array([0.6 * p[0] * d, 2 * p[1]])
        variance = gradient @ P @ gradient + 0.05
        gain = P @ gradient / variance
        z = z + gain * (y - p[0] * d - p[1] ** 2 - gradient @ (z - point))
        P = P - np.outer(gain, gain) * variance
    return z, P


def iterated(
    z: Array, P: Array, base: Array | None, rows: Array, settings: RelinearisationSettings
) -> tuple[Array, Array, Array]:
    """z, its covariance and the point of linearisation after one segment, by the description of the module."""
    path, covariance = [z], P
    for row in rows:
        following, covariance = passed_over(path[-1], covariance, row[None], path[-1:])
        path.append(following)
    if base is None:
        first = [path[min(j + settings.lag, len(rows))] for j in range(len(rows))]
        point, limit = path[-1], settings.first_pass_limit
    else:
        first, point, limit = [base] * len(rows), base, settings.pass_limit
    for number in range(1, 99):
        result, variance = passed_over(z, P, rows, np.array(first))
        if number >= settings.max_passes or (np.abs(result - point) <= limit * np.sqrt(np.diag(variance))).all():
            break
        base = point = result
        first, limit = [result] * len(rows), settings.pass_limit
    return result, variance, result if base is None else base


def data(count: int, seed: int) -> Array:
    """Rows [d, y] of the logarithmic model."""
    rng = np.random.default_rng(seed)
    d = rng.normal(size=count)
    return np.column_stack([d, 2.5 * d + 1.2**2 + np.sqrt(0.05) * rng.normal(size=count)])


@pytest.mark.parametrize("lag", [0, 4, 99])
@pytest.mark.parametrize("passes", [1, 9])
@pytest.mark.parametrize(
    ("first_limit", "limit", "pauses"),
    [(0.5, 2.0, (70, 70)), (0.0, 0.5, (70, 70)), (1e-3, 1e-3, (70, 70)), (9.0, 0.1, (70, 70)), (0.0, 9.0, (2, 1))],
)
def test_three_segments_as_iterated_filters(
    lag: int, passes: int, first_limit: float, limit: float, pauses: tuple[int, int]
) -> None:
    """The second and third segments begin at the result of the one before, and keep its point of linearisation.

    After short pauses the passes are finished at the next sample. Whether the estimate is read has no effect.
    """
    settings = {"lag": lag, "max_passes": passes, "first_pass_limit": first_limit, "pass_limit": limit}
    made = logarithmic_filter(**settings)
    z, P, base = np.zeros(2), np.eye(2), None
    for seed, length, idle in ((1, 5, pauses[0]), (2, 4, pauses[1]), (3, 6, 0)):
        rows = data(length, seed)
        for k in range(length):
            assert not learn(made, rows[k : k + 1])
            expected = iterated(z, P, base, rows[: k + 1], made.settings)
            np.testing.assert_allclose(made.estimate().z, expected[0], rtol=1e-9, atol=1e-10)
            np.testing.assert_allclose(made.estimate().Pz, expected[1], rtol=1e-9, atol=1e-10)
        z, P, base = expected
        pause(made, idle)
        if idle == 70:
            assert made._count == 0
            np.testing.assert_array_equal(made.carry[0, made.layout.estimate], made.estimate().vector())
    made.end_segment()
    np.testing.assert_allclose(made.estimate().z, z, rtol=1e-9, atol=1e-10)
    np.testing.assert_array_equal(made.carry[0, made.layout.z], made.estimate().z)


def test_a_segment_of_the_largest_length_is_followed_by_another() -> None:
    """Unless the state must be started again: then the sample belongs to no segment."""
    made = logarithmic_filter(samples=4, first_pass_limit=0.0, pass_limit=9.0, lag=2)
    rows = data(11, seed=4)
    assert not learn(made, rows)
    z, P, base = np.zeros(2), np.eye(2), None
    for part in (rows[:4], rows[4:8], rows[8:]):
        z, P, base = iterated(z, P, base, part, made.settings)
    np.testing.assert_allclose(made.estimate().z, z, rtol=1e-9)
    made = logarithmic_filter(samples=4, first_pass_limit=0.0, pass_limit=0.1, lag=2)
    assert not learn(made, rows[:4])
    assert learn(made, rows[4:5])
    assert made._count == 0


def test_a_new_start_of_the_state_ends_the_segment() -> None:
    """The estimate stays, and the second filter does not continue with samples from before."""
    made = logarithmic_filter(first_pass_limit=0.0, pass_limit=0.1)
    learn(made, data(6, seed=5))
    expected = made.estimate()
    assert expected.z != pytest.approx(made.carry[0, made.layout.z], abs=1e-3)
    made.start(np.ones(1), np.full((1, 1), 1e-12), np.zeros((1, 2)), np.zeros(1))
    np.testing.assert_array_equal(made.estimate().z, expected.z)
    np.testing.assert_array_equal(made.carry[0, made.layout.z], expected.z)
    pause(made, 9)
    np.testing.assert_array_equal(made.estimate().z, expected.z)
    np.testing.assert_array_equal(made.carry[0, made.layout.x], 1.0)


@pytest.mark.parametrize("stepwise", [True, False])
def test_the_state_changes_with_the_estimate(stepwise: bool) -> None:
    """To first order, and its variance grows by the square; it starts again if the estimate moves by `pass_limit`."""
    V = np.array([[0.3, -0.2]])
    settings = {"max_passes": 1, "lag": 99}
    moved = 0.0
    for pass_limit in (None, *np.array([1 + 1e-6, 1 - 1e-6])):
        limit = 9.0 if pass_limit is None else pass_limit * moved
        made = logarithmic_filter(V, pass_limit=limit, **settings)
        assert not learn(made, data(3, seed=6))
        layout = made.layout
        before, slope = made.carry[0].copy(), made.carry[0, layout.V][:2]
        restart = pause(made, 4) if stepwise else made.end_segment()
        after, estimate = made.carry[0], made.estimate()
        change = estimate.z - before[layout.z]
        moved = float((np.abs(change) / np.sqrt(np.diag(estimate.Pz))).max())
        assert after[layout.x] - before[layout.x] == pytest.approx(slope @ change, rel=1e-9)
        assert after[layout.P] - before[layout.P] == pytest.approx((slope @ change) ** 2, rel=1e-6)
        assert abs(slope @ change) > 1e-3
        assert restart == (limit < moved)
