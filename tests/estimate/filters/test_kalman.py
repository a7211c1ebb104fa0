"""The Kalman filter against statsmodels and NumPy, the smoother against dense Gaussian conditioning."""

import casadi as ca
import numpy as np
import pytest
from statsmodels.tsa.statespace.kalman_smoother import KalmanSmoother

from fifthwheel.estimate.filters import Noise, sample_rows
from tests.estimate.filters.examples import (
    Array,
    Article,
    Filtered,
    Linear,
    example,
    joint_update,
    linear,
    max_difference,
    run_kalman,
    run_smoother,
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
    assert np.ptp(system.F[10:], axis=0).max() > 0.01  # the matrices change from row to row
    assert np.ptp(article.rows[1:, 0]) > 0.005
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


WALK = example(lambda x, dt, d, p, c: x, lambda x, d, p, c: ca.vertcat(x, x), x=1)


def walk(measured: list[list[float]], gate: float = np.inf) -> Filtered:
    """A random walk with two sensors of variance 1 and 2, from 0 with variance 3, Q = 1, one row per second."""
    rows = sample_rows(np.ones(len(measured)), np.empty((len(measured), 0)), np.array(measured))
    noise = Noise(process=np.eye(1), measurement=np.array([1.0, 2.0]), gate=gate)
    return run_kalman(WALK, rows, p=NOTHING, c=NOTHING, noise=noise, x0=np.zeros(1), P0=np.full((1, 1), 3.0))


def test_channels_and_the_gate_in_numbers() -> None:
    """y = [NaN, 1]: P- = 4, S = 6, K = 2/3. The variance of the first channel is 5; 3 sigma is 6.708."""
    actual = walk([[np.nan, 1.0]])
    assert actual.state.item() == pytest.approx(2 / 3, rel=1e-15)
    assert actual.covariance.item() == pytest.approx(4 / 3, rel=1e-15)
    assert actual.innovation.tolist() == [[0, 1]]
    assert actual.innovation_variance.tolist() == [[5, 6]]
    assert actual.accepted.tolist() == [[0, 1]]
    inside, outside = walk([[6.708, np.nan]], gate=3.0), walk([[6.709, 1.0]], gate=3.0)
    assert inside.accepted.tolist() == [[1, 0]]
    assert outside.accepted.tolist() == [[0, 1]]
    assert outside.innovation.tolist() == [[6.709, 1.0]]
    assert np.array_equal(outside.state, actual.state)


def test_missing_and_rejected_values_have_no_effect(article: Article) -> None:
    """NaN and infinities are missing, as are values outside the gate and the numbers in their place."""
    lost = some_missing(article.rows)
    rows = without(article.rows, lost, 4)
    for value in (np.nan, -np.inf):
        measured = np.where(lost, value, article.measured)
        assert np.array_equal(rows, sample_rows(article.rows[:, 0], article.rows[:, 1:5], measured))
    other, spiked = rows.copy(), article.rows.copy()
    other[:, 5:9][lost] = 1e6
    spiked[:, 5:9][lost] += 40 * np.sqrt(10 * np.broadcast_to(article.noise.measurement, lost.shape)[lost]) + 1
    noise = {"process": article.noise.process, "measurement": 10 * article.noise.measurement}
    gated = article.arguments() | {"noise": Noise(**noise, gate=6.0)}
    expected, by_number, actual = (run_kalman(article.model, r, **gated) for r in (rows, other, spiked))
    assert np.array_equal(actual.accepted == 0, lost)
    for name in ("state", "covariance", "predicted_state", "predicted_covariance", "innovation_variance"):
        assert np.array_equal(getattr(by_number, name), getattr(expected, name)), name
        assert np.array_equal(getattr(actual, name), getattr(expected, name)), name
    assert np.array_equal(actual.innovation[~lost], expected.innovation[~lost])
    assert (actual.innovation[lost] > 6 * np.sqrt(actual.innovation_variance[lost])).all()
    open_gate = run_kalman(article.model, spiked, **article.arguments() | {"noise": Noise(**noise)})
    assert (open_gate.accepted == 1).all()
    assert max_difference(open_gate.state, expected.state) > 0.1


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
    # P0 / R = 1e20: the result is R, not rounding error
    precise = sample_rows(np.zeros(3), np.empty((3, 0)), np.array([[1.0, np.nan], [1.0, np.nan], [np.nan, 1.0]]))
    noise = Noise(process=np.zeros((1, 1)), measurement=np.array([1e-10, 2e-10]))
    actual = run_kalman(WALK, precise, p=NOTHING, c=NOTHING, noise=noise, x0=np.zeros(1), P0=np.full((1, 1), 1e10))
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
    """A pendulum with irregular sampling and gaps: states, covariances and NIS of the update with all channels
    together."""
    rng = np.random.default_rng(2)
    N, p, c = 300, np.array([9.0]), np.array([0.4, 0.1])
    dt, d = rng.uniform(0.005, 0.05, N), rng.normal(size=(N, 1))
    measured, present = rng.normal(size=(N, 2)), rng.random((N, 2)) < 0.8
    Q, R = np.array([[0.2, 0.05], [0.05, 0.4]]), np.array([0.3, 0.8])
    rows = sample_rows(dt, d, np.where(present, measured, np.nan))
    x0, P0 = np.array([0.5, -0.2]), np.array([[0.3, 0.1], [0.1, 0.2]])
    actual = run_kalman(PENDULUM, rows, p=p, c=c, noise=Noise(process=Q, measurement=R), x0=x0, P0=P0)
    x, P, states, covariances, sums = x0, P0, [], [], []
    for k in range(N):
        F = np.array([[1, dt[k]], [-dt[k] * 9 * np.cos(x[0]), 1 - dt[k] * 0.4]])
        x = np.array([x[0] + dt[k] * x[1], x[1] + dt[k] * (d[k, 0] - 9 * np.sin(x[0]) - 0.4 * x[1])])
        P = F @ P @ F.T + Q * dt[k]
        H = np.array([[np.cos(x[0]), 0], [x[1], x[0]]])
        innovation, used = measured[k] - [np.sin(x[0]) + 0.1, x[0] * x[1]], present[k]
        x, P, nis = joint_update(x, P, innovation[used], H[used], R[used])
        states.append(x), covariances.append(P), sums.append(nis)
    assert max_difference(actual.state, np.array(states)) <= 1e-10
    assert max_difference(actual.covariance, np.array(covariances)) <= 1e-10
    nis = (actual.accepted * actual.innovation**2 / actual.innovation_variance).sum(axis=1)
    assert nis == pytest.approx(np.array(sums), rel=1e-8, abs=1e-10)


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
    """With gaps, and with rejected samples in their place."""
    rows, given = spring_rows(gaps=True), PROCESS[process]
    spiked = rows.copy()
    spikes = rows[:, 4:] == 0
    spiked[:, 4:][spikes], spiked[:, 2:4][spikes] = 1.0, 1e3
    actual, rejected = (
        run_smoother(SPRING, rows, **arguments(given)),
        run_smoother(SPRING, spiked, **arguments(given, gate=20.0)),
    )
    state, covariance = dense_solution(linear(SPRING, rows, P, C), rows, given)
    for smoothed in (actual, rejected):
        assert np.abs(smoothed.state - state).max() <= 1e-10
        assert max_difference(smoothed.covariance, covariance) <= 1e-10


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
