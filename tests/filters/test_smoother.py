"""The smoother against all samples at once (dense Gaussian conditioning, least squares) and against another one."""

import casadi as ca
import numpy as np
import pytest
from statsmodels.tsa.statespace.kalman_smoother import KalmanSmoother

from fifthwheel.filters import Noise, kalman, sample_rows, smoother

from .examples import Array, Article, Linear, apart, example, linear, without

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
    """Irregular samples, the first of them without a step before it; with gaps also one where nothing is measured."""
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


def all_at_once(system: Linear, rows: Array, process: Array) -> tuple[Array, Array]:
    """States (N, 3) and covariances (N, 3, 3): the joint Gaussian of all states, conditioned on all measurements."""
    N, n = len(rows), 3
    mean, covariance = np.zeros(N * n), np.zeros((N * n, N * n))
    x, past = X0, np.zeros((n, 0))
    own = P0
    for k in range(N):
        F, at = system.F[k], slice(k * n, (k + 1) * n)
        x, own = F @ x + system.g[k], F @ own @ F.T + process * rows[k, 0]
        past = F @ past
        mean[at], covariance[at, at] = x, own
        covariance[at, : k * n], covariance[: k * n, at] = past, past.T
        past = np.hstack([past, own])
    k, i = np.nonzero(rows[:, 4:] > 0)
    H = np.zeros((len(k), N * n))
    for row, (sample, channel) in enumerate(zip(k, i, strict=True)):
        H[row, sample * n : (sample + 1) * n] = system.H[sample, channel]
    innovation = rows[k, 2 + i] - system.b[k, i] - H @ mean
    gain = np.linalg.solve(H @ covariance @ H.T + np.diag(R[i]), H @ covariance).T
    mean, covariance = mean + gain @ innovation, covariance - gain @ H @ covariance
    return mean.reshape(N, n), np.array([covariance[k * n : k * n + n, k * n : k * n + n] for k in range(N)])


@pytest.mark.parametrize("gaps", [False, True], ids=["whole", "with gaps"])
@pytest.mark.parametrize("process", PROCESS)
def test_all_samples_at_once(process: str, gaps: bool) -> None:
    rows = spring_rows(gaps=gaps)
    found = smoother.run(SPRING, rows, **arguments(PROCESS[process]))
    state, covariance = all_at_once(linear(SPRING, rows, P, C), rows, PROCESS[process])
    assert np.abs(found.state - state).max() <= 1e-10
    assert apart(found.covariance, covariance) <= 1e-10


def test_no_process_noise_is_least_squares() -> None:
    """One trajectory of the model, from the initial state that fits prior and record best."""
    rows = spring_rows(gaps=True)
    system = linear(SPRING, rows, P, C)
    by_start, offset, equations, wanted = np.eye(3), np.zeros(3), [], []
    prior = np.linalg.inv(np.linalg.cholesky(P0))
    equations.append(prior), wanted.append(prior @ X0)
    trajectory = []
    for k in range(len(rows)):
        by_start, offset = system.F[k] @ by_start, system.F[k] @ offset + system.g[k]
        trajectory.append((by_start, offset))
        for i in np.flatnonzero(rows[k, 4:]):
            h, sigma = system.H[k, i], np.sqrt(R[i])
            equations.append(h[None] @ by_start / sigma)
            wanted.append([(rows[k, 2 + i] - system.b[k, i] - h @ offset) / sigma])
    A = np.vstack(equations)
    start = np.linalg.lstsq(A, np.concatenate(wanted))[0]
    found = smoother.run(SPRING, rows, **arguments(PROCESS["no process noise"]))
    information = A.T @ A
    for k, (by_start, offset) in enumerate(trajectory):
        assert found.state[k] == pytest.approx(by_start @ start + offset, abs=1e-10)
        assert found.covariance[k] == pytest.approx(by_start @ np.linalg.inv(information) @ by_start.T, abs=1e-10)
    for k in range(1, len(rows)):
        assert found.state[k] == pytest.approx(system.F[k] @ found.state[k - 1] + system.g[k], abs=1e-12)


@pytest.mark.parametrize("process", ["process noise", "no process noise"])
def test_rauch_tung_striebel(process: str) -> None:
    """The textbook's backward pass over the filter's own results."""
    rows = spring_rows(gaps=True)
    given = arguments(PROCESS[process])
    filtered, system = kalman.run(SPRING, rows, **given), linear(SPRING, rows, P, C)
    x, own = filtered.state[-1], filtered.covariance[-1]
    states, covariances = [x], [own]
    for k in range(len(rows) - 2, -1, -1):
        before = filtered.predicted_covariance[k + 1]
        gain = np.linalg.solve(before, system.F[k + 1] @ filtered.covariance[k]).T
        x = filtered.state[k] + gain @ (x - filtered.predicted_state[k + 1])
        own = filtered.covariance[k] + gain @ (own - before) @ gain.T
        states.append(x), covariances.append(own)
    found = smoother.run(SPRING, rows, **given)
    assert np.abs(found.state - np.array(states[::-1])).max() <= 1e-8
    assert apart(found.covariance, np.array(covariances[::-1])) <= 1e-8


def test_gated_samples_are_missing_samples() -> None:
    rows = spring_rows(gaps=True)
    spoiled, spikes = rows.copy(), np.zeros((len(rows), 2), dtype=bool)
    spikes[[3, 3, 8, 20], [0, 1, 1, 0]] = True
    assert rows[:, 4:][spikes].sum() >= 2
    spoiled[:, 2:4][spikes] += 1e3
    process = PROCESS["process noise"]
    expected = smoother.run(SPRING, without(rows, spikes, 1), **arguments(process, gate=20.0))
    found = smoother.run(SPRING, spoiled, **arguments(process, gate=20.0))
    assert np.array_equal(found.state, expected.state)
    assert np.array_equal(found.covariance, expected.covariance)
    state, covariance = all_at_once(linear(SPRING, rows, P, C), without(rows, spikes, 1), process)
    assert np.abs(found.state - state).max() <= 1e-10
    assert apart(found.covariance, covariance) <= 1e-10


def test_one_sample() -> None:
    rows = spring_rows(gaps=False)[:1]
    filtered, found = (f(SPRING, rows, **arguments(np.eye(3))) for f in (kalman.run, smoother.run))
    assert apart(found.state, filtered.state) <= 1e-12
    assert apart(found.covariance, filtered.covariance) <= 1e-12


@pytest.mark.parametrize("noisy", [True, False], ids=["process noise", "no process noise"])
def test_article(article: Article, noisy: bool) -> None:
    """Eight states: the last sample is the filter's, and no variance in any direction exceeds the filter's."""
    missing = np.random.default_rng(1).random((len(article.rows), 4)) < 0.3
    missing[300:400] = True
    rows = without(article.rows, missing, 4)
    process = article.noise.process * (1.0 if noisy else 0.0)
    given = article.arguments() | {"noise": Noise(process=process, measurement=article.noise.measurement)}
    filtered, found = (f(article.model, rows, **given) for f in (kalman.run, smoother.run))
    assert apart(found.state[-1:], filtered.state[-1:]) <= 1e-12
    assert apart(found.covariance[-1:], filtered.covariance[-1:]) <= 1e-12
    scale = np.sqrt(np.einsum("kii->ki", filtered.covariance))
    scale = scale[:, :, None] * scale[:, None, :]
    gained = np.linalg.eigvalsh((filtered.covariance - found.covariance) / scale)
    assert gained.min() >= -1e-9
    assert gained[0].max() > 0.5
    assert np.linalg.eigvalsh(found.covariance / scale).min() >= -1e-9


def test_statsmodels(article: Article) -> None:
    missing = np.random.default_rng(2).random((len(article.rows), 4)) < 0.2
    missing[300:400] = True
    found = smoother.run(article.model, without(article.rows, missing, 4), **article.arguments())
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
    assert apart(found.state, expected.smoothed_state.T) <= 1e-8
    assert apart(found.covariance, np.moveaxis(expected.smoothed_state_cov, -1, 0)) <= 1e-8


def test_smoothing_narrows(article: Article) -> None:
    """Every state's variance, but at the end of the record."""
    found, filtered = (f(article.model, article.rows, **article.arguments()) for f in (smoother.run, kalman.run))
    variances = [np.einsum("kii->ki", f.covariance)[:-20] for f in (found, filtered)]
    assert (variances[0] < variances[1]).all()
    assert np.abs(found.state[:100] - filtered.state[:100]).max() > 1e-4


def test_state_without_effect() -> None:
    """Neither the next sample nor a sensor knows of x1: zeros by structure in everything that comes from behind."""
    model = example(
        lambda x, dt, d, p, c: ca.vertcat(x[0] * ca.exp(-dt), d[0], x[2] * 0.9),
        lambda x, d, p, c: ca.vertcat(x[0], x[2]),
        x=3,
        d=1,
    )
    rows = spring_rows(gaps=False)
    given = arguments(PROCESS["process noise"]) | {"p": NOTHING, "c": NOTHING}
    found = smoother.run(model, rows, **given)
    state, covariance = all_at_once(linear(model, rows, NOTHING, NOTHING), rows, PROCESS["process noise"])
    assert np.abs(found.state - state).max() <= 1e-10
    assert np.abs(found.covariance - covariance).max() <= 1e-10
