"""The smoother against dense Gaussian conditioning, least squares, Rauch-Tung-Striebel and statsmodels."""

import casadi as ca
import numpy as np
import pytest
from statsmodels.tsa.statespace.kalman_smoother import KalmanSmoother

from fifthwheel.estimate.filters import Noise, sample_rows
from tests.estimate.filters.examples import (
    Array,
    Article,
    Linear,
    example,
    linear,
    max_difference,
    run_kalman,
    run_smoother,
    without,
)

NOTHING = np.empty(0)
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


@pytest.mark.parametrize("gaps", [False, True], ids=["complete", "with gaps"])
@pytest.mark.parametrize("process", PROCESS)
def test_equals_the_dense_solution(process: str, gaps: bool) -> None:
    rows = spring_rows(gaps=gaps)
    actual = run_smoother(SPRING, rows, **arguments(PROCESS[process]))
    state, covariance = dense_solution(linear(SPRING, rows, P, C), rows, PROCESS[process])
    assert np.abs(actual.state - state).max() <= 1e-10
    assert max_difference(actual.covariance, covariance) <= 1e-10


def test_without_process_noise_it_is_least_squares() -> None:
    """Without process noise it is one trajectory from the initial state with the best fit to prior and record."""
    rows = spring_rows(gaps=True)
    system = linear(SPRING, rows, P, C)
    by_start, offset, equations, targets = np.eye(3), np.zeros(3), [], []
    prior = np.linalg.inv(np.linalg.cholesky(P0))
    equations.append(prior), targets.append(prior @ X0)
    trajectory = []
    for k in range(len(rows)):
        by_start, offset = system.F[k] @ by_start, system.F[k] @ offset + system.g[k]
        trajectory.append((by_start, offset))
        for i in np.flatnonzero(rows[k, 4:]):
            h, sigma = system.H[k, i], np.sqrt(R[i])
            equations.append(h[None] @ by_start / sigma)
            targets.append([(rows[k, 2 + i] - system.b[k, i] - h @ offset) / sigma])
    A = np.vstack(equations)
    start = np.linalg.lstsq(A, np.concatenate(targets))[0]
    actual = run_smoother(SPRING, rows, **arguments(PROCESS["no process noise"]))
    information = A.T @ A
    for k, (by_start, offset) in enumerate(trajectory):
        assert actual.state[k] == pytest.approx(by_start @ start + offset, abs=1e-10)
        assert actual.covariance[k] == pytest.approx(by_start @ np.linalg.inv(information) @ by_start.T, abs=1e-10)
    for k in range(1, len(rows)):
        assert actual.state[k] == pytest.approx(system.F[k] @ actual.state[k - 1] + system.g[k], abs=1e-12)


@pytest.mark.parametrize("process", ["process noise", "no process noise"])
def test_rauch_tung_striebel(process: str) -> None:
    """The textbook's backward pass over the results of the filter."""
    rows = spring_rows(gaps=True)
    given = arguments(PROCESS[process])
    filtered, system = run_kalman(SPRING, rows, **given), linear(SPRING, rows, P, C)
    x, P_k = filtered.state[-1], filtered.covariance[-1]
    states, covariances = [x], [P_k]
    for k in range(len(rows) - 2, -1, -1):
        before = filtered.predicted_covariance[k + 1]
        gain = np.linalg.solve(before, system.F[k + 1] @ filtered.covariance[k]).T
        x = filtered.state[k] + gain @ (x - filtered.predicted_state[k + 1])
        P_k = filtered.covariance[k] + gain @ (P_k - before) @ gain.T
        states.append(x), covariances.append(P_k)
    actual = run_smoother(SPRING, rows, **given)
    assert np.abs(actual.state - np.array(states[::-1])).max() <= 1e-8
    assert max_difference(actual.covariance, np.array(covariances[::-1])) <= 1e-8


def test_rejected_sample_equals_a_missing_sample() -> None:
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


@pytest.mark.parametrize("noisy", [True, False], ids=["process noise", "no process noise"])
def test_article(article: Article, noisy: bool) -> None:
    """The last sample equals that of the filter, and no variance in any direction exceeds that of the filter."""
    missing = np.random.default_rng(1).random((len(article.rows), 4)) < 0.3
    missing[300:400] = True
    rows = without(article.rows, missing, 4)
    process = article.noise.process * (1.0 if noisy else 0.0)
    given = article.arguments() | {"noise": Noise(process=process, measurement=article.noise.measurement)}
    filtered, actual = (f(article.model, rows, **given) for f in (run_kalman, run_smoother))
    assert max_difference(actual.state[-1:], filtered.state[-1:]) <= 1e-12
    assert max_difference(actual.covariance[-1:], filtered.covariance[-1:]) <= 1e-12
    scale = np.sqrt(np.einsum("kii->ki", filtered.covariance))
    scale = scale[:, :, None] * scale[:, None, :]
    reduction = np.linalg.eigvalsh((filtered.covariance - actual.covariance) / scale)
    assert reduction.min() >= -1e-9
    assert reduction[0].max() > 0.5
    assert np.linalg.eigvalsh(actual.covariance / scale).min() >= -1e-9


def test_statsmodels(article: Article) -> None:
    missing = np.random.default_rng(2).random((len(article.rows), 4)) < 0.2
    missing[300:400] = True
    actual = run_smoother(article.model, without(article.rows, missing, 4), **article.arguments())
    system, N = article.linear, len(article.rows)
    later = np.r_[1:N, N - 1]
    other = KalmanSmoother(k_endog=4, k_states=8, k_posdef=8)
    other.bind(np.where(missing, np.nan, article.measured))
    other["design"], other["obs_intercept"] = np.moveaxis(system.H, 0, -1), system.b.T
    other["obs_cov"], other["selection"] = np.diag(article.noise.measurement), np.eye(8)
    other["transition"], other["state_intercept"] = np.moveaxis(system.F[later], 0, -1), system.g[later].T
    other["state_cov"] = article.noise.process[:, :, None] * article.rows[later, 0]
    F = system.F[0]
    Q = article.noise.process * article.rows[0, 0]
    other.initialize_known(F @ article.x0 + system.g[0], F @ article.P0 @ F.T + Q)
    other.tolerance = 0
    expected = other.smooth()
    assert max_difference(actual.state, expected.smoothed_state.T) <= 1e-8
    assert max_difference(actual.covariance, np.moveaxis(expected.smoothed_state_cov, -1, 0)) <= 1e-8


def test_smoothing_reduces_all_variances(article: Article) -> None:
    """The variance of every state decreases, except at the end of the record."""
    actual, filtered = (f(article.model, article.rows, **article.arguments()) for f in (run_smoother, run_kalman))
    variances = [np.einsum("kii->ki", f.covariance)[:-20] for f in (actual, filtered)]
    assert (variances[0] < variances[1]).all()
    assert np.abs(actual.state[:100] - filtered.state[:100]).max() > 1e-4


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
