"""The Kalman filter against statsmodels and NumPy, the smoother against dense Gaussian conditioning."""

import casadi as ca
import numpy as np
import pytest
from scipy.stats import chi2
from statsmodels.tsa.statespace.kalman_smoother import KalmanSmoother

from fifthwheel.estimate.filters import Noise, kalman, sample_rows
from fifthwheel.estimate.filters.model import pack_array, unpack_array
from tests.estimate.filters.examples import (
    Array,
    Article,
    Filtered,
    Linear,
    Numbers,
    example,
    joint_update,
    linear,
    max_difference,
    run_kalman,
    run_smoother,
    simulate_model,
    without,
)

NOTHING = np.empty(0)


def some_missing(rows: Array, seed: int = 3) -> np.ndarray:
    """A quarter of all values, and all channels of 40 samples."""
    missing = np.random.default_rng(seed).random((len(rows), 4)) < 0.25
    missing[100:140] = True
    return missing


@pytest.mark.slow
def test_statsmodels(article: Article) -> None:
    """Filtered, predicted and smoothed states and covariances, with gaps; statsmodels predicts after the update."""
    missing, system, N = some_missing(article.rows), article.linear, len(article.rows)
    later = np.r_[1:N, N - 1]
    other = KalmanSmoother(k_endog=4, k_states=8, k_posdef=8)
    other.bind(np.where(missing, np.nan, article.measured))
    other["design"], other["obs_intercept"] = np.moveaxis(system.H, 0, -1), system.b.T
    other["obs_cov"], other["selection"] = np.diag(article.noise.measurement), np.eye(8)
    other["transition"], other["state_intercept"] = np.moveaxis(system.F[later], 0, -1), system.g[later].T
    other["state_cov"] = article.noise.process[:, :, None] * article.rows[later, 0]
    F, Q = system.F[0], article.noise.process * article.rows[0, 0]
    other.initialize_known(F @ article.x0 + system.g[0], F @ article.P0 @ F.T + Q)
    other.tolerance = 0  # no steady state
    expected = other.smooth()
    rows = without(article.rows, missing, 4)
    filtered, smoothed = (f(article.model, rows, **article.arguments()) for f in (run_kalman, run_smoother))
    assert max_difference(filtered.state, expected.filtered_state.T) <= 1e-9
    assert max_difference(filtered.covariance, np.moveaxis(expected.filtered_state_cov, -1, 0)) <= 1e-9
    assert max_difference(filtered.predicted_state, expected.predicted_state.T[:N]) <= 1e-9
    assert max_difference(filtered.predicted_covariance, np.moveaxis(expected.predicted_state_cov, -1, 0)[:N]) <= 1e-9
    assert max_difference(smoothed.state, expected.smoothed_state.T) <= 1e-8
    assert max_difference(smoothed.covariance, np.moveaxis(expected.smoothed_state_cov, -1, 0)) <= 1e-8


@pytest.mark.slow
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
    for R in (1e-8, 1e2):
        for P0 in (1e-12, 1e4):
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


# The smoother

SPRING = example(
    lambda x, dt, d, p, c: ca.vertcat(
        x[0] + dt * x[1], x[1] + dt * (d[0] - p[0] * x[0] - c[0] * x[1]), x[2] * ca.exp(-dt)
    ),
    lambda x, d, p, c: ca.vertcat(x[0] + x[2] + c[1], d[0] * x[1] - 2 * x[0]),
    x=3,
    d=1,
    p=1,
    c=2,
)
P, C = np.array([2.0]), np.array([0.3, 0.5])
X0 = np.array([1.0, -0.5, 0.2])
P0 = np.array([[0.5, 0.1, 0.0], [0.1, 0.4, -0.1], [0.0, -0.1, 0.3]])
R = np.array([0.2, 0.1])
PROCESS = {
    "process noise": np.array([[0.3, 0.1, 0.0], [0.1, 0.2, 0.0], [0.0, 0.0, 0.1]]),
    "noise of one state": np.diag([0.0, 0.4, 0.0]),
    "no process noise": np.zeros((3, 3)),
}


def spring_rows(N: int = 25, *, gaps: bool) -> Array:
    """Irregular sampling, dt = 0 in the first row; with gaps also a row without any measurement."""
    rng = np.random.default_rng(N)
    dt, d, measured = rng.uniform(0.02, 0.3, N), rng.normal(size=(N, 1)), rng.normal(size=(N, 2))
    dt[0] = 0.0
    if gaps:
        measured[rng.random((N, 2)) < 0.3] = np.nan
        measured[10] = np.nan
    return sample_rows(dt, d, measured)


def arguments(process: Array, gate: float = np.inf) -> dict[str, object]:
    noise = Noise(process=process, measurement=R, gate=gate)
    return {"p": P, "c": C, "noise": noise, "x0": X0, "P0": P0}


def dense_solution(system: Linear, rows: Array, process: Array) -> tuple[Array, Array]:
    """States (N, 3) and covariances (N, 3, 3) of the joint Gaussian of all states, given all measurements."""
    N, n = len(rows), 3
    mean, covariance = np.zeros(N * n), np.zeros((N * n, N * n))
    x, past = X0, np.zeros((n, 0))
    P_k = P0
    for k in range(N):
        F, block = system.F[k], slice(k * n, (k + 1) * n)
        x, P_k = F @ x + system.g[k], F @ P_k @ F.T + process * rows[k, 0]
        past = F @ past
        mean[block], covariance[block, block] = x, P_k
        covariance[block, : k * n], covariance[: k * n, block] = past, past.T
        past = np.hstack([past, P_k])
    k, i = np.nonzero(rows[:, 4:] > 0)
    H = np.zeros((len(k), N * n))
    for row, (sample, channel) in enumerate(zip(k, i, strict=True)):
        H[row, sample * n : (sample + 1) * n] = system.H[sample, channel]
    innovation = rows[k, 2 + i] - system.b[k, i] - H @ mean
    gain = np.linalg.solve(H @ covariance @ H.T + np.diag(R[i]), H @ covariance).T
    mean, covariance = mean + gain @ innovation, covariance - gain @ H @ covariance
    return mean.reshape(N, n), np.array([covariance[k * n : k * n + n, k * n : k * n + n] for k in range(N)])


@pytest.mark.parametrize("process", PROCESS)
def test_smoother_equals_the_dense_solution(process: str) -> None:
    rows = spring_rows(gaps=True)
    actual = run_smoother(SPRING, rows, **arguments(PROCESS[process]))
    state, covariance = dense_solution(linear(SPRING, rows, P, C), rows, PROCESS[process])
    assert np.abs(actual.state - state).max() <= 1e-10
    assert max_difference(actual.covariance, covariance) <= 1e-10


def test_smoothing_with_a_rejected_sample_equals_that_with_a_missing_sample() -> None:
    rows = spring_rows(gaps=True)
    with_spikes, spikes = rows.copy(), np.zeros((len(rows), 2), dtype=bool)
    spikes[[3, 3, 8, 20], [0, 1, 1, 0]] = True
    assert rows[:, 4:][spikes].sum() >= 2
    with_spikes[:, 2:4][spikes] += 1e3
    process = PROCESS["process noise"]
    expected = run_smoother(SPRING, without(rows, spikes, 1), **arguments(process, gate=20.0))
    actual = run_smoother(SPRING, with_spikes, **arguments(process, gate=20.0))
    assert np.array_equal(actual.state, expected.state)
    assert np.array_equal(actual.covariance, expected.covariance)
    state, covariance = dense_solution(linear(SPRING, rows, P, C), without(rows, spikes, 1), process)
    assert np.abs(actual.state - state).max() <= 1e-10
    assert max_difference(actual.covariance, covariance) <= 1e-10


def test_one_sample() -> None:
    rows = spring_rows(gaps=False)[:1]
    filtered, actual = (f(SPRING, rows, **arguments(np.eye(3))) for f in (run_kalman, run_smoother))
    assert max_difference(actual.state, filtered.state) <= 1e-12
    assert max_difference(actual.covariance, filtered.covariance) <= 1e-12


def test_state_without_effect() -> None:
    """Neither the next sample nor a sensor depends on x1, so the adjoint has structural zeros."""
    model = example(
        lambda x, dt, d, p, c: ca.vertcat(x[0] * ca.exp(-dt), d[0], x[2] * 0.9),
        lambda x, d, p, c: ca.vertcat(x[0], x[2]),
        x=3,
        d=1,
    )
    rows = spring_rows(gaps=False)
    given = arguments(PROCESS["process noise"]) | {"p": NOTHING, "c": NOTHING}
    actual = run_smoother(model, rows, **given)
    state, covariance = dense_solution(linear(model, rows, NOTHING, NOTHING), rows, PROCESS["process noise"])
    assert np.abs(actual.state - state).max() <= 1e-10
    assert np.abs(actual.covariance - covariance).max() <= 1e-10
