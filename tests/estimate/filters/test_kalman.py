"""The Kalman filter against filterpy, statsmodels and NumPy, with missing channels and with a gate."""

import casadi as ca
import numpy as np
import pytest
from filterpy.kalman import KalmanFilter as FilterPy
from scipy.stats import chi2
from statsmodels.tsa.statespace.kalman_filter import KalmanFilter as StatsModels

from fifthwheel.estimate.filters import Noise, kalman, sample_rows
from fifthwheel.estimate.filters.model import pack_array, unpack_array
from tests.estimate.filters.examples import (
    Array,
    Article,
    Filtered,
    Numbers,
    example,
    joint_update,
    linear,
    max_difference,
    run_kalman,
    simulate_model,
    without,
)

NOTHING = np.empty(0)


def some_missing(rows: Array, seed: int = 3) -> np.ndarray:
    """A quarter of all values, and all channels of 40 samples."""
    missing = np.random.default_rng(seed).random((len(rows), 4)) < 0.25
    missing[100:140] = True
    return missing


def by_statsmodels(article: Article, measured: Array) -> tuple[Array, Array, Array, Array]:
    """Filtered and predicted states and covariances; statsmodels predicts after the update."""
    system, N = article.linear, len(article.rows)
    other = StatsModels(k_endog=4, k_states=8, k_posdef=8)
    other.bind(np.array(measured))
    other["design"] = np.moveaxis(system.H, 0, -1)
    other["obs_intercept"] = system.b.T
    other["obs_cov"] = np.diag(article.noise.measurement)
    other["transition"] = np.moveaxis(system.F[np.r_[1:N, N - 1]], 0, -1)
    other["state_intercept"] = system.g[np.r_[1:N, N - 1]].T
    other["selection"] = np.eye(8)
    other["state_cov"] = article.noise.process[:, :, None] * article.rows[np.r_[1:N, N - 1], 0]
    F, Q = system.F[0], article.noise.process * article.rows[0, 0]
    other.initialize_known(F @ article.x0 + system.g[0], F @ article.P0 @ F.T + Q)
    other.tolerance = 0  # no steady state
    actual = other.filter()
    states = actual.filtered_state.T, np.moveaxis(actual.filtered_state_cov, -1, 0)
    return *states, actual.predicted_state.T[:N], np.moveaxis(actual.predicted_state_cov, -1, 0)[:N]


@pytest.mark.parametrize("missing", [False, True], ids=["complete", "with gaps"])
def test_statsmodels(article: Article, missing: bool) -> None:
    rows, measured = article.rows, article.measured
    if missing:
        missing_channels = some_missing(rows)
        rows, measured = without(rows, missing_channels, 4), np.where(missing_channels, np.nan, measured)
    actual = run_kalman(article.model, rows, **article.arguments())
    x, P, before, P_before = by_statsmodels(article, measured)
    assert max_difference(actual.state, x) <= 1e-9
    assert max_difference(actual.covariance, P) <= 1e-9
    assert max_difference(actual.predicted_state, before) <= 1e-9
    assert max_difference(actual.predicted_covariance, P_before) <= 1e-9


@pytest.mark.parametrize("missing", [False, True], ids=["complete", "with gaps"])
def test_filterpy(article: Article, missing: bool) -> None:
    rows, system = article.rows, article.linear
    missing_channels = some_missing(rows) if missing else np.zeros((len(rows), 4), dtype=bool)
    actual = run_kalman(article.model, without(rows, missing_channels, 4), **article.arguments())
    other = FilterPy(dim_x=8, dim_z=4, dim_u=8)
    other.x, other.P, other.B = article.x0[:, None].copy(), article.P0.copy(), np.eye(8)
    states, covariances = [], []
    for k, row in enumerate(rows):
        other.predict(u=system.g[k][:, None], F=system.F[k], Q=article.noise.process * row[0])
        present = ~missing_channels[k]
        if present.any():
            R = np.diag(article.noise.measurement[present])
            other.update((article.measured[k] - system.b[k])[present, None], R=R, H=system.H[k][present])
        states.append(other.x[:, 0].copy())
        covariances.append(other.P.copy())
    assert max_difference(actual.state, np.array(states)) <= 1e-9
    assert max_difference(actual.covariance, np.array(covariances)) <= 1e-9


def test_compiled_step_equals_the_symbolic_one(article: Article) -> None:
    step = kalman.kalman_step(article.model)
    carry = np.concatenate([article.x0, pack_array(article.P0)])
    constant = np.concatenate([article.c, article.noise.vector()])
    rows = without(article.rows, some_missing(article.rows), 4)[90:110]
    _, out = step(carry, rows, constant)
    for row, actual in zip(rows, out, strict=True):
        later, expected = (np.array(value).ravel() for value in step.step(carry, row, constant))
        scale = np.repeat([0.1, 1e-3, 1.0, 0.1, 1e-3], [8, 36, 12, 8, 36])
        assert np.abs((actual - expected) / scale).max() <= 1e-12
        carry = later


@pytest.mark.parametrize("channel", range(4))
def test_missing_channel_equals_a_model_without_it(article: Article, channel: int) -> None:
    """A channel that is always missing, and one that is sometimes missing: the smaller model gives the same result."""
    from fifthwheel.model import dynamics

    remaining = [i for i in range(4) if i != channel]
    fewer = dynamics.model(article.vehicle, tuple(article.model.outputs[i] for i in remaining), roll=True)
    values = dict(zip(article.model.known, article.c, strict=True))
    c = fewer.known_values(values)
    noise = Noise(process=article.noise.process, measurement=article.noise.measurement[remaining])
    rows = article.rows[:200]
    small = np.hstack([rows[:, :5], rows[:, 5:9][:, remaining], rows[:, 9:][:, remaining]])

    missing_channels = np.zeros((200, 4), dtype=bool)
    missing_channels[:, channel] = True
    actual = run_kalman(article.model, without(rows, missing_channels, 4), **article.arguments())
    expected = run_kalman(fewer, small, **article.arguments() | {"c": c, "noise": noise})
    assert max_difference(actual.state, expected.state) <= 1e-12
    assert max_difference(actual.covariance, expected.covariance) <= 1e-12
    assert (actual.accepted[:, channel] == 0).all()
    assert (actual.innovation[:, channel] == 0).all()

    missing_channels[:, channel] = np.random.default_rng(channel).random(200) < 0.4
    actual = run_kalman(article.model, without(rows, missing_channels, 4), **article.arguments())
    state, states, covariances = {"x0": article.x0, "P0": article.P0}, [], []
    for k in range(200):
        is_missing = missing_channels[k, channel]
        step = run_kalman(
            fewer if is_missing else article.model,
            (small if is_missing else rows)[k : k + 1],
            **article.arguments() | ({"c": c, "noise": noise} if is_missing else {}) | state,
        )
        state = {"x0": step.state[0], "P0": step.covariance[0]}
        states.append(step.state[0]), covariances.append(step.covariance[0])
    assert max_difference(actual.state, np.array(states)) <= 1e-12
    assert max_difference(actual.covariance, np.array(covariances)) <= 1e-12


def test_missing_values_in_rows(article: Article) -> None:
    """NaN and infinities are missing, and the number in their place has no effect."""
    missing_channels = some_missing(article.rows)
    rows = sample_rows(article.rows[:, 0], article.rows[:, 1:5], np.where(missing_channels, np.nan, article.measured))
    assert np.array_equal(rows, without(article.rows, missing_channels, 4))
    infinite = sample_rows(
        article.rows[:, 0], article.rows[:, 1:5], np.where(missing_channels, -np.inf, article.measured)
    )
    assert np.array_equal(rows, infinite)
    other = rows.copy()
    other[:, 5:9][missing_channels] = 1e6
    first, second = (run_kalman(article.model, r, **article.arguments()) for r in (rows, other))
    assert np.array_equal(first.state, second.state)
    assert np.array_equal(first.covariance, second.covariance)


def test_without_measurements_it_is_prediction(article: Article) -> None:
    rows, system = without(article.rows, np.ones((len(article.rows), 4), dtype=bool), 4), article.linear
    actual = run_kalman(article.model, rows, **article.arguments())
    x, P, states, covariances = article.x0, article.P0, [], []
    for k, row in enumerate(rows):
        x, P = system.F[k] @ x + system.g[k], system.F[k] @ P @ system.F[k].T + article.noise.process * row[0]
        states.append(x), covariances.append(P)
    assert max_difference(actual.state, np.array(states)) <= 1e-12
    assert max_difference(actual.covariance, np.array(covariances)) <= 1e-12
    assert np.array_equal(actual.state, actual.predicted_state)
    assert np.array_equal(actual.covariance, actual.predicted_covariance)
    assert not actual.accepted.any()
    assert not actual.innovation.any()


WALK = example(lambda x, dt, d, p, c: x, lambda x, d, p, c: ca.vertcat(x, x), x=1)


def walk(measured: list[list[float]], gate: float = np.inf) -> Filtered:
    """A random walk with two sensors of variance 1 and 2, from 0 with variance 3, Q = 1, one row per second."""
    rows = sample_rows(np.ones(len(measured)), np.empty((len(measured), 0)), np.array(measured))
    noise = Noise(process=np.eye(1), measurement=np.array([1.0, 2.0]), gate=gate)
    return run_kalman(WALK, rows, p=NOTHING, c=NOTHING, noise=noise, x0=np.zeros(1), P0=np.full((1, 1), 3.0))


def test_one_of_two_channels_in_numbers() -> None:
    """y = [NaN, 1]: P- = 4, S = 6, K = 2/3."""
    actual = walk([[np.nan, 1.0]])
    assert actual.state.item() == pytest.approx(2 / 3, rel=1e-15)
    assert actual.covariance.item() == pytest.approx(4 / 3, rel=1e-15)
    assert actual.innovation.tolist() == [[0, 1]]
    assert actual.innovation_variance.tolist() == [[5, 6]]
    assert actual.accepted.tolist() == [[0, 1]]


def test_gate_in_numbers() -> None:
    """P- = 4: the first channel's variance is 5; 3 sigma is 6.708."""
    inside, outside = walk([[6.708, np.nan]], gate=3.0), walk([[6.709, 1.0]], gate=3.0)
    assert inside.accepted.tolist() == [[1, 0]]
    assert outside.accepted.tolist() == [[0, 1]]
    assert outside.innovation.tolist() == [[6.709, 1.0]]
    assert np.array_equal(outside.state, walk([[np.nan, 1.0]]).state)


def test_rejected_sample_equals_a_missing_sample(article: Article) -> None:
    rng = np.random.default_rng(5)
    spikes = rng.random((len(article.rows), 4)) < 0.03
    rows = article.rows.copy()
    rows[:, 5:9][spikes] += 40 * np.sqrt(10 * np.broadcast_to(article.noise.measurement, spikes.shape)[spikes]) + 1
    gated = Noise(process=article.noise.process, measurement=10 * article.noise.measurement, gate=6.0)
    arguments = article.arguments() | {"noise": gated}
    actual = run_kalman(article.model, rows, **arguments)
    expected = run_kalman(article.model, without(article.rows, spikes, 4), **arguments)
    assert np.array_equal(actual.accepted == 0, spikes)
    for name in ("state", "covariance", "predicted_state", "predicted_covariance", "accepted", "innovation_variance"):
        assert np.array_equal(getattr(actual, name), getattr(expected, name)), name
    assert np.array_equal(actual.innovation[~spikes], expected.innovation[~spikes])
    assert (actual.innovation[spikes] > 6 * np.sqrt(actual.innovation_variance[spikes])).all()
    open_gate = Noise(process=gated.process, measurement=gated.measurement)
    without_gate = run_kalman(article.model, rows, **arguments | {"noise": open_gate})
    assert (without_gate.accepted == 1).all()
    assert max_difference(without_gate.state, expected.state) > 0.1


def test_update_by_channel_equals_the_joint_update(article: Article) -> None:
    """States, covariances and NIS are equal."""
    rows, system = article.rows, article.linear
    missing_channels = some_missing(rows)
    actual = run_kalman(article.model, without(rows, missing_channels, 4), **article.arguments())
    x, P, states, covariances, sums = article.x0, article.P0, [], [], []
    for k, row in enumerate(rows):
        x, P = system.F[k] @ x + system.g[k], system.F[k] @ P @ system.F[k].T + article.noise.process * row[0]
        present = ~missing_channels[k]
        innovation = (article.measured[k] - system.b[k] - system.H[k] @ x)[present]
        x, P, nis = joint_update(x, P, innovation, system.H[k][present], article.noise.measurement[present])
        states.append(x), covariances.append(P), sums.append(nis)
    assert max_difference(actual.state, np.array(states)) <= 1e-11
    assert max_difference(actual.covariance, np.array(covariances)) <= 1e-11
    nis = (actual.accepted * actual.innovation**2 / actual.innovation_variance).sum(axis=1)
    assert nis == pytest.approx(np.array(sums), rel=1e-8, abs=1e-10)
    assert np.array_equal(actual.accepted.sum(axis=1), (~missing_channels).sum(axis=1))


def test_covariances_are_positive(article: Article) -> None:
    """For all R and P0, with and without process noise; they are exactly symmetric."""
    rows = without(article.rows, some_missing(article.rows), 4)
    for R in (1e-8, 1e-5, 1e-2, 1e2):
        for P0 in (1e-12, 1e-6, 1.0, 1e4):
            for Q in (0.0, 1e-6):
                noise = Noise(process=Q * np.eye(8), measurement=np.full(4, R))
                arguments = article.arguments() | {"noise": noise, "P0": P0 * np.eye(8)}
                actual = run_kalman(article.model, rows, **arguments)
                for P in (actual.covariance, actual.predicted_covariance):
                    assert np.array_equal(P, np.swapaxes(P, 1, 2))
                    values = np.linalg.eigvalsh(P)
                    assert (values[:, 0] >= -1e-12 * values[:, -1]).all(), (R, P0, Q)
                assert np.isfinite(actual.state).all()


def test_covariance_of_a_precise_sensor_with_a_wide_prior() -> None:
    """P0 / R = 1e20: the result is R, not rounding error."""
    rows = sample_rows(np.zeros(3), np.empty((3, 0)), np.array([[1.0, np.nan], [1.0, np.nan], [np.nan, 1.0]]))
    noise = Noise(process=np.zeros((1, 1)), measurement=np.array([1e-10, 2e-10]))
    actual = run_kalman(WALK, rows, p=NOTHING, c=NOTHING, noise=noise, x0=np.zeros(1), P0=np.full((1, 1), 1e10))
    assert actual.covariance[:, 0, 0] == pytest.approx([1e-10, 0.5e-10, 0.4e-10], rel=1e-5)


PENDULUM = example(
    lambda x, dt, d, p, c: ca.vertcat(x[0] + dt * x[1], x[1] + dt * (d[0] - p[0] * ca.sin(x[0]) - c[0] * x[1])),
    lambda x, d, p, c: ca.vertcat(ca.sin(x[0]) + c[1], x[0] * x[1]),
    x=2,
    d=1,
    p=1,
    c=2,
)


def test_nonlinear_model_equals_the_textbook_filter() -> None:
    """A pendulum with irregular sampling; both channels are linearised at the prediction."""
    rng = np.random.default_rng(2)
    N, p, c = 300, np.array([9.0]), np.array([0.4, 0.1])
    dt, d = rng.uniform(0.005, 0.05, N), rng.normal(size=(N, 1))
    measured = rng.normal(size=(N, 2))
    Q, R = np.array([[0.2, 0.05], [0.05, 0.4]]), np.array([0.3, 0.8])
    rows = sample_rows(dt, d, measured)
    x0, P0 = np.array([0.5, -0.2]), np.array([[0.3, 0.1], [0.1, 0.2]])
    actual = run_kalman(PENDULUM, rows, p=p, c=c, noise=Noise(process=Q, measurement=R), x0=x0, P0=P0)
    x, P, states, covariances = x0, P0, [], []
    for k in range(N):
        F = np.array([[1, dt[k]], [-dt[k] * 9 * np.cos(x[0]), 1 - dt[k] * 0.4]])
        x = np.array([x[0] + dt[k] * x[1], x[1] + dt[k] * (d[k, 0] - 9 * np.sin(x[0]) - 0.4 * x[1])])
        P = F @ P @ F.T + Q * dt[k]
        H = np.array([[np.cos(x[0]), 0], [x[1], x[0]]])
        x, P, _ = joint_update(x, P, measured[k] - [np.sin(x[0]) + 0.1, x[0] * x[1]], H, R)
        states.append(x), covariances.append(P)
    assert max_difference(actual.state, np.array(states)) <= 1e-10
    assert max_difference(actual.covariance, np.array(covariances)) <= 1e-10


def test_scalar_nonlinear_model_equals_the_textbook_filter() -> None:
    """x' = -x^3 + d, y = x + x^2 / 5, one channel, some missing, steps from 1 ms to 0.3 s."""
    model = example(lambda x, dt, d, p, c: x + dt * (d - x**3), lambda x, d, p, c: x + x**2 / 5, x=1, d=1)
    rng = np.random.default_rng(4)
    N, q, r = 400, 0.3, 0.05
    dt, d = rng.choice([0.001, 0.02, 0.05, 0.3], N), np.sin(np.arange(N) / 9)
    measured = np.where(rng.random(N) < 0.3, np.nan, 0.6 * np.sin(np.arange(N) / 9) + 0.2 * rng.normal(size=N))
    noise = Noise(process=np.full((1, 1), q), measurement=np.array([r]))
    rows = sample_rows(dt, d[:, None], measured[:, None])
    actual = run_kalman(model, rows, p=NOTHING, c=NOTHING, noise=noise, x0=np.array([0.4]), P0=np.full((1, 1), 0.5))
    x, P, states, variances, innovations = 0.4, 0.5, [], [], []
    for k in range(N):
        F = 1 - 3 * dt[k] * x**2
        x, P = x + dt[k] * (d[k] - x**3), F * P * F + q * dt[k]
        H, innovation = 1 + 2 * x / 5, measured[k] - (x + x**2 / 5)
        if np.isfinite(innovation):
            K = P * H / (H * P * H + r)
            x, P = x + K * innovation, (1 - K * H) * P
        states.append(x), variances.append(P), innovations.append(innovation)
    assert actual.state[:, 0] == pytest.approx(np.array(states), abs=1e-12)
    assert actual.covariance[:, 0, 0] == pytest.approx(np.array(variances), rel=1e-11)
    assert actual.innovation[:, 0] == pytest.approx(np.nan_to_num(innovations), abs=1e-12)


def test_covariance_of_a_linear_model_does_not_depend_on_the_state(article: Article) -> None:
    """The derivatives of the model are constant, so the extended filter is the Kalman filter."""
    numbers = Numbers(article.model)
    rng = np.random.default_rng(6)
    for k in (0, 50, 200):
        d = article.rows[k, 1:5]
        F = numbers.transition(rng.normal(size=8), article.rows[k, 0], d, NOTHING, article.c)[1]
        H = numbers.observation(rng.normal(size=8), d, NOTHING, article.c)[1]
        assert pytest.approx(article.linear.F[k], abs=1e-13) == F
        assert pytest.approx(article.linear.H[k], abs=1e-13) == H
    shifted_start = {"x0": article.x0 + 1e3}
    nominal, shifted = (run_kalman(article.model, article.rows, **article.arguments() | x) for x in ({}, shifted_start))
    assert np.array_equal(nominal.covariance, shifted.covariance)


def test_batch_equals_a_loop_over_vehicles(article: Article) -> None:
    """Five vehicles with different parameters, starts and measurements in lanes of four."""
    rng = np.random.default_rng(8)
    step, vehicles = kalman.kalman_step(article.model), 5
    carry = np.array(
        [
            np.concatenate([rng.normal(size=8) * 0.01, pack_array(article.P0 * rng.uniform(0.5, 2))])
            for _ in range(vehicles)
        ]
    )
    constant = np.array(
        [
            np.concatenate([article.c * rng.uniform(0.98, 1.02, len(article.c)), article.noise.vector()])
            for _ in range(vehicles)
        ]
    )
    rows = np.array([without(article.rows, some_missing(article.rows, seed), 4)[:200] for seed in range(vehicles)])
    after, out = step.batch(carry, rows, constant)
    for i in range(vehicles):
        after_one, out_one = step(carry[i], rows[i], constant[i])
        scale = np.abs(out_one).max(axis=0) + 1e-12
        assert (np.abs(out[i] - out_one) / scale).max() <= 1e-12
        assert (np.abs(after[i] - after_one) / (np.abs(out_one).max(axis=0)[:44] + 1e-12)).max() <= 1e-12


def test_matched_model_is_consistent(article: Article) -> None:
    """Fifty simulations with noise of variance Q dt and R from random starts with covariance P0: mean NEES and NIS are
    within the chi-square intervals, and with a tenth of Q they are not."""
    rng = np.random.default_rng(2024)
    runs, rows, system = 50, article.rows[:250], article.linear
    N, R = len(rows), article.noise.measurement
    x = article.x0 + rng.normal(size=(runs, 8)) * np.sqrt(np.diag(article.P0))
    later = Numbers(article.model).transition(x[0], rows[0, 0], rows[0, 1:5], NOTHING, article.c)[0]
    assert system.F[0] @ x[0] + system.g[0] == pytest.approx(later, abs=1e-14)
    truth, measured = simulate_model(system, rows, article.noise, x, rng)
    samples = np.tile(rows, (runs, 1, 1))
    samples[:, :, 5:9] = measured

    def mean_nees_and_nis(noise: Noise) -> tuple[Array, Array]:
        carry = np.tile(np.concatenate([article.x0, pack_array(article.P0)]), (runs, 1))
        constant = np.tile(np.concatenate([article.c, noise.vector()]), (runs, 1))
        _, out = kalman.kalman_step(article.model).batch(carry, samples, constant)
        covariance = unpack_array(out[..., 8:44], 8)
        difference = out[..., :8] - truth
        error = np.einsum("...i,...i", difference, np.linalg.solve(covariance, difference[..., None])[..., 0])
        nis = (out[..., 44:48] ** 2 / out[..., 48:52]).sum(axis=-1).mean(axis=0)
        return error.mean(axis=0), nis

    def interval(degrees: int, count: int, probability: float = 0.95) -> tuple[float, float]:
        """Limits of the mean of `count` independent chi-squares (Bar-Shalom, Li and Kirubarajan 2001, 5.4)."""
        low, high = chi2.interval(probability, degrees * count)
        return low / count, high / count

    times = [0, 20, 60, 120, 180, 249]
    error, nis = mean_nees_and_nis(article.noise)
    for actual, degrees in ((error, 8), (nis, 4)):
        low, high = interval(degrees, runs)
        assert ((low < actual[times]) & (actual[times] < high)).all(), (low, actual[times], high)
        assert 0.85 < ((low < actual) & (actual < high)).mean() <= 1.0
    low, high = interval(4, runs * N, 0.99)  # innovations are white: the mean over all times
    assert low < nis.mean() < high
    wrong = Noise(process=article.noise.process / 10, measurement=R)
    assert mean_nees_and_nis(wrong)[0][times[2:]].min() > interval(8, runs)[1]


def test_reference_matrices_change_from_row_to_row(article: Article) -> None:
    """The reference filters above are only a test of the time-varying filter if their matrices change."""
    system = linear(article.model, article.rows[:3], NOTHING, article.c)
    assert np.array_equal(system.F, article.linear.F[:3])
    assert np.ptp(article.linear.F[10:], axis=0).max() > 0.01
    assert np.abs(article.linear.g[10:]).max() > 1e-4
    assert np.abs(article.linear.b).max() == pytest.approx(0.002)
    assert np.ptp(article.rows[1:, 0]) > 0.005
