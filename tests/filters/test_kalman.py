"""The filter against two others, against plain numpy, and against itself with less to go on."""

import casadi as ca
import numpy as np
import pytest
from filterpy.kalman import KalmanFilter as FilterPy
from statsmodels.tsa.statespace.kalman_filter import KalmanFilter as StatsModels

from fifthwheel.filters import Filtered, Noise, consistency, kalman, sample_rows

from .examples import Array, Article, Numbers, apart, example, joint_update, linear, moved, without

NOTHING = np.empty(0)


def some_missing(rows: Array, seed: int = 3) -> np.ndarray:
    """A quarter of all values, and everything for a while."""
    missing = np.random.default_rng(seed).random((len(rows), 4)) < 0.25
    missing[100:140] = True
    return missing


def by_statsmodels(article: Article, measured: Array) -> tuple[Array, Array, Array, Array]:
    """Filtered and predicted states and covariances; theirs predicts after the update, ours before it."""
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
    found = other.filter()
    states = found.filtered_state.T, np.moveaxis(found.filtered_state_cov, -1, 0)
    return *states, found.predicted_state.T[:N], np.moveaxis(found.predicted_state_cov, -1, 0)[:N]


@pytest.mark.parametrize("missing", [False, True], ids=["whole", "with gaps"])
def test_statsmodels(article: Article, missing: bool) -> None:
    rows, measured = article.rows, article.measured
    if missing:
        gone = some_missing(rows)
        rows, measured = without(rows, gone, 4), np.where(gone, np.nan, measured)
    found = kalman.run(article.model, rows, **article.arguments())
    x, P, before, P_before = by_statsmodels(article, measured)
    assert apart(found.state, x) <= 1e-9
    assert apart(found.covariance, P) <= 1e-9
    assert apart(found.predicted_state, before) <= 1e-9
    assert apart(found.predicted_covariance, P_before) <= 1e-9


@pytest.mark.parametrize("missing", [False, True], ids=["whole", "with gaps"])
def test_filterpy(article: Article, missing: bool) -> None:
    rows, system = article.rows, article.linear
    gone = some_missing(rows) if missing else np.zeros((len(rows), 4), dtype=bool)
    found = kalman.run(article.model, without(rows, gone, 4), **article.arguments())
    other = FilterPy(dim_x=8, dim_z=4, dim_u=8)
    other.x, other.P, other.B = article.x0[:, None].copy(), article.P0.copy(), np.eye(8)
    states, covariances = [], []
    for k, row in enumerate(rows):
        other.predict(u=system.g[k][:, None], F=system.F[k], Q=article.noise.process * row[0])
        there = ~gone[k]
        if there.any():
            R = np.diag(article.noise.measurement[there])
            other.update((article.measured[k] - system.b[k])[there, None], R=R, H=system.H[k][there])
        states.append(other.x[:, 0].copy())
        covariances.append(other.P.copy())
    assert apart(found.state, np.array(states)) <= 1e-9
    assert apart(found.covariance, np.array(covariances)) <= 1e-9


def test_compiled_step_is_the_symbolic_one(article: Article) -> None:
    step = kalman.step(article.model)
    carry = np.concatenate([article.x0, kalman.pack_array(article.P0)])
    constant = np.concatenate([article.c, article.noise.vector()])
    rows = without(article.rows, some_missing(article.rows), 4)[90:110]
    _, out = step(carry, rows, constant)
    for row, found in zip(rows, out, strict=True):
        later, expected = (np.array(value).ravel() for value in step.step(carry, row, constant))
        scale = np.repeat([0.1, 1e-3, 1.0, 0.1, 1e-3], [8, 36, 12, 8, 36])
        assert np.abs((found - expected) / scale).max() <= 1e-12
        carry = later


@pytest.mark.parametrize("channel", range(4))
def test_missing_channel_is_a_model_without_it(article: Article, channel: int) -> None:
    """Throughout, and at some samples: there the same as with the smaller model for those samples only."""
    from fifthwheel import dynamics

    kept = [i for i in range(4) if i != channel]
    fewer = dynamics.model(article.vehicle, tuple(article.model.outputs[i] for i in kept), roll=True)
    values = dict(zip(article.model.known, article.c, strict=True))
    c = fewer.known_values(values)
    noise = Noise(process=article.noise.process, measurement=article.noise.measurement[kept])
    rows = article.rows[:200]
    small = np.hstack([rows[:, :5], rows[:, 5:9][:, kept], rows[:, 9:][:, kept]])

    gone = np.zeros((200, 4), dtype=bool)
    gone[:, channel] = True
    found = kalman.run(article.model, without(rows, gone, 4), **article.arguments())
    expected = kalman.run(fewer, small, **article.arguments() | {"c": c, "noise": noise})
    assert apart(found.state, expected.state) <= 1e-12
    assert apart(found.covariance, expected.covariance) <= 1e-12
    assert (found.accepted[:, channel] == 0).all()
    assert (found.innovation[:, channel] == 0).all()

    gone[:, channel] = np.random.default_rng(channel).random(200) < 0.4
    found = kalman.run(article.model, without(rows, gone, 4), **article.arguments())
    state, states, covariances = {"x0": article.x0, "P0": article.P0}, [], []
    for k in range(200):
        less = gone[k, channel]
        one = kalman.run(
            fewer if less else article.model,
            (small if less else rows)[k : k + 1],
            **article.arguments() | ({"c": c, "noise": noise} if less else {}) | state,
        )
        state = {"x0": one.state[0], "P0": one.covariance[0]}
        states.append(one.state[0]), covariances.append(one.covariance[0])
    assert apart(found.state, np.array(states)) <= 1e-12
    assert apart(found.covariance, np.array(covariances)) <= 1e-12


def test_missing_values_by_their_rows(article: Article) -> None:
    """NaN and infinities are missing, and what stands in their place does not matter."""
    gone = some_missing(article.rows)
    rows = sample_rows(article.rows[:, 0], article.rows[:, 1:5], np.where(gone, np.nan, article.measured))
    assert np.array_equal(rows, without(article.rows, gone, 4))
    infinite = sample_rows(article.rows[:, 0], article.rows[:, 1:5], np.where(gone, -np.inf, article.measured))
    assert np.array_equal(rows, infinite)
    other = rows.copy()
    other[:, 5:9][gone] = 1e6
    first, second = (kalman.run(article.model, r, **article.arguments()) for r in (rows, other))
    assert np.array_equal(first.state, second.state)
    assert np.array_equal(first.covariance, second.covariance)


def test_all_missing_is_prediction(article: Article) -> None:
    rows, system = without(article.rows, np.ones((len(article.rows), 4), dtype=bool), 4), article.linear
    found = kalman.run(article.model, rows, **article.arguments())
    x, P, states, covariances = article.x0, article.P0, [], []
    for k, row in enumerate(rows):
        x, P = system.F[k] @ x + system.g[k], system.F[k] @ P @ system.F[k].T + article.noise.process * row[0]
        states.append(x), covariances.append(P)
    assert apart(found.state, np.array(states)) <= 1e-12
    assert apart(found.covariance, np.array(covariances)) <= 1e-12
    assert np.array_equal(found.state, found.predicted_state)
    assert np.array_equal(found.covariance, found.predicted_covariance)
    assert not found.accepted.any()
    assert not found.innovation.any()


WALK = example(lambda x, dt, d, p, c: x, lambda x, d, p, c: ca.vertcat(x, x), x=1)


def walk(measured: list[list[float]], gate: float = np.inf) -> Filtered:
    """A random walk seen by two sensors of variance 1 and 2, from 0 with variance 3, a second a row, Q = 1."""
    rows = sample_rows(np.ones(len(measured)), np.empty((len(measured), 0)), np.array(measured))
    noise = Noise(process=np.eye(1), measurement=np.array([1.0, 2.0]), gate=gate)
    return kalman.run(WALK, rows, p=NOTHING, c=NOTHING, noise=noise, x0=np.zeros(1), P0=np.full((1, 1), 3.0))


def test_one_of_two_by_hand() -> None:
    """y = [NaN, 1]: P- = 4, S = 6, K = 2/3."""
    found = walk([[np.nan, 1.0]])
    assert found.state.item() == pytest.approx(2 / 3, rel=1e-15)
    assert found.covariance.item() == pytest.approx(4 / 3, rel=1e-15)
    assert found.innovation.tolist() == [[0, 1]]
    assert found.innovation_variance.tolist() == [[5, 6]]
    assert found.accepted.tolist() == [[0, 1]]


def test_gate_by_hand() -> None:
    """P- = 4: the first channel's variance is 5; 3 sigma is 6.708."""
    inside, outside = walk([[6.708, np.nan]], gate=3.0), walk([[6.709, 1.0]], gate=3.0)
    assert inside.accepted.tolist() == [[1, 0]]
    assert outside.accepted.tolist() == [[0, 1]]
    assert outside.innovation.tolist() == [[6.709, 1.0]]
    assert np.array_equal(outside.state, walk([[np.nan, 1.0]]).state)


def test_gate_rejects_as_if_missing(article: Article) -> None:
    rng = np.random.default_rng(5)
    spikes = rng.random((len(article.rows), 4)) < 0.03
    rows = article.rows.copy()
    rows[:, 5:9][spikes] += 40 * np.sqrt(10 * np.broadcast_to(article.noise.measurement, spikes.shape)[spikes]) + 1
    gated = Noise(process=article.noise.process, measurement=10 * article.noise.measurement, gate=6.0)
    arguments = article.arguments() | {"noise": gated}
    found = kalman.run(article.model, rows, **arguments)
    expected = kalman.run(article.model, without(article.rows, spikes, 4), **arguments)
    assert np.array_equal(found.accepted == 0, spikes)
    for name in ("state", "covariance", "predicted_state", "predicted_covariance", "accepted", "innovation_variance"):
        assert np.array_equal(getattr(found, name), getattr(expected, name)), name
    assert np.array_equal(found.innovation[~spikes], expected.innovation[~spikes])
    assert (found.innovation[spikes] > 6 * np.sqrt(found.innovation_variance[spikes])).all()
    open_gate = Noise(process=gated.process, measurement=gated.measurement)
    swayed = kalman.run(article.model, rows, **arguments | {"noise": open_gate})
    assert (swayed.accepted == 1).all()
    assert apart(swayed.state, expected.state) > 0.1


def test_channel_by_channel_is_all_at_once(article: Article) -> None:
    """States, covariances and the sum of the squared innovations over their variances."""
    rows, system = article.rows, article.linear
    gone = some_missing(rows)
    found = kalman.run(article.model, without(rows, gone, 4), **article.arguments())
    x, P, states, covariances, sums = article.x0, article.P0, [], [], []
    for k, row in enumerate(rows):
        x, P = system.F[k] @ x + system.g[k], system.F[k] @ P @ system.F[k].T + article.noise.process * row[0]
        there = ~gone[k]
        innovation = (article.measured[k] - system.b[k] - system.H[k] @ x)[there]
        x, P, nis = joint_update(x, P, innovation, system.H[k][there], article.noise.measurement[there])
        states.append(x), covariances.append(P), sums.append(nis)
    assert apart(found.state, np.array(states)) <= 1e-11
    assert apart(found.covariance, np.array(covariances)) <= 1e-11
    nis, degrees = consistency.nis(found.innovation, found.innovation_variance, found.accepted)
    assert nis == pytest.approx(np.array(sums), rel=1e-8, abs=1e-10)
    assert np.array_equal(degrees, (~gone).sum(axis=1))


def test_covariances_stay_positive(article: Article) -> None:
    """Whatever R and P0, with process noise and without; symmetric to the bit."""
    rows = without(article.rows, some_missing(article.rows), 4)
    for R in (1e-8, 1e-5, 1e-2, 1e2):
        for P0 in (1e-12, 1e-6, 1.0, 1e4):
            for Q in (0.0, 1e-6):
                noise = Noise(process=Q * np.eye(8), measurement=np.full(4, R))
                arguments = article.arguments() | {"noise": noise, "P0": P0 * np.eye(8)}
                found = kalman.run(article.model, rows, **arguments)
                for P in (found.covariance, found.predicted_covariance):
                    assert np.array_equal(P, np.swapaxes(P, 1, 2))
                    values = np.linalg.eigvalsh(P)
                    assert (values[:, 0] >= -1e-12 * values[:, -1]).all(), (R, P0, Q)
                assert np.isfinite(found.state).all()


def test_covariance_of_a_precise_sensor_after_a_vague_start() -> None:
    """P0 / R = 1e20: what is left is R, not rounding."""
    rows = sample_rows(np.zeros(3), np.empty((3, 0)), np.array([[1.0, np.nan], [1.0, np.nan], [np.nan, 1.0]]))
    noise = Noise(process=np.zeros((1, 1)), measurement=np.array([1e-10, 2e-10]))
    found = kalman.run(WALK, rows, p=NOTHING, c=NOTHING, noise=noise, x0=np.zeros(1), P0=np.full((1, 1), 1e10))
    assert found.covariance[:, 0, 0] == pytest.approx([1e-10, 0.5e-10, 0.4e-10], rel=1e-5)


PENDULUM = example(
    lambda x, dt, d, p, c: ca.vertcat(x[0] + dt * x[1], x[1] + dt * (d[0] - p[0] * ca.sin(x[0]) - c[0] * x[1])),
    lambda x, d, p, c: ca.vertcat(ca.sin(x[0]) + c[1], x[0] * x[1]),
    x=2,
    d=1,
    p=1,
    c=2,
)


def test_nonlinear_model_is_the_textbooks() -> None:
    """A pendulum, irregular samples; both channels linearised at the prediction."""
    rng = np.random.default_rng(2)
    N, p, c = 300, np.array([9.0]), np.array([0.4, 0.1])
    dt, d = rng.uniform(0.005, 0.05, N), rng.normal(size=(N, 1))
    measured = rng.normal(size=(N, 2))
    Q, R = np.array([[0.2, 0.05], [0.05, 0.4]]), np.array([0.3, 0.8])
    rows = sample_rows(dt, d, measured)
    x0, P0 = np.array([0.5, -0.2]), np.array([[0.3, 0.1], [0.1, 0.2]])
    found = kalman.run(PENDULUM, rows, p=p, c=c, noise=Noise(process=Q, measurement=R), x0=x0, P0=P0)
    x, P, states, covariances = x0, P0, [], []
    for k in range(N):
        F = np.array([[1, dt[k]], [-dt[k] * 9 * np.cos(x[0]), 1 - dt[k] * 0.4]])
        x = np.array([x[0] + dt[k] * x[1], x[1] + dt[k] * (d[k, 0] - 9 * np.sin(x[0]) - 0.4 * x[1])])
        P = F @ P @ F.T + Q * dt[k]
        H = np.array([[np.cos(x[0]), 0], [x[1], x[0]]])
        x, P, _ = joint_update(x, P, measured[k] - [np.sin(x[0]) + 0.1, x[0] * x[1]], H, R)
        states.append(x), covariances.append(P)
    assert apart(found.state, np.array(states)) <= 1e-10
    assert apart(found.covariance, np.array(covariances)) <= 1e-10


def test_scalar_nonlinear_model_is_the_textbooks() -> None:
    """x' = -x^3 + d, y = x + x^2 / 5, one channel, some missing, steps from 1 ms to 0.3 s."""
    model = example(lambda x, dt, d, p, c: x + dt * (d - x**3), lambda x, d, p, c: x + x**2 / 5, x=1, d=1)
    rng = np.random.default_rng(4)
    N, q, r = 400, 0.3, 0.05
    dt, d = rng.choice([0.001, 0.02, 0.05, 0.3], N), np.sin(np.arange(N) / 9)
    measured = np.where(rng.random(N) < 0.3, np.nan, 0.6 * np.sin(np.arange(N) / 9) + 0.2 * rng.normal(size=N))
    noise = Noise(process=np.full((1, 1), q), measurement=np.array([r]))
    rows = sample_rows(dt, d[:, None], measured[:, None])
    found = kalman.run(model, rows, p=NOTHING, c=NOTHING, noise=noise, x0=np.array([0.4]), P0=np.full((1, 1), 0.5))
    x, P, states, variances, innovations = 0.4, 0.5, [], [], []
    for k in range(N):
        F = 1 - 3 * dt[k] * x**2
        x, P = x + dt[k] * (d[k] - x**3), F * P * F + q * dt[k]
        H, innovation = 1 + 2 * x / 5, measured[k] - (x + x**2 / 5)
        if np.isfinite(innovation):
            K = P * H / (H * P * H + r)
            x, P = x + K * innovation, (1 - K * H) * P
        states.append(x), variances.append(P), innovations.append(innovation)
    assert found.state[:, 0] == pytest.approx(np.array(states), abs=1e-12)
    assert found.covariance[:, 0, 0] == pytest.approx(np.array(variances), rel=1e-11)
    assert found.innovation[:, 0] == pytest.approx(np.nan_to_num(innovations), abs=1e-12)


def test_linear_model_needs_no_linearisation_point(article: Article) -> None:
    """The transition's derivative is the same at any state: the extended filter is the Kalman filter."""
    numbers = Numbers(article.model)
    rng = np.random.default_rng(6)
    for k in (0, 50, 200):
        d = article.rows[k, 1:5]
        F = numbers.transition(rng.normal(size=8), article.rows[k, 0], d, NOTHING, article.c)[1]
        H = numbers.observation(rng.normal(size=8), d, NOTHING, article.c)[1]
        assert pytest.approx(article.linear.F[k], abs=1e-13) == F
        assert pytest.approx(article.linear.H[k], abs=1e-13) == H
    far = {"x0": article.x0 + 1e3}
    near, shifted = (kalman.run(article.model, article.rows, **article.arguments() | x) for x in ({}, far))
    assert np.array_equal(near.covariance, shifted.covariance)


def test_batch_is_a_loop(article: Article) -> None:
    """Vehicles with their own parameters, noise, start and measurements; five of them in lanes of four."""
    rng = np.random.default_rng(8)
    step, vehicles = kalman.step(article.model), 5
    carry = np.array(
        [
            np.concatenate([rng.normal(size=8) * 0.01, kalman.pack_array(article.P0 * rng.uniform(0.5, 2))])
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
        one_after, one = step(carry[i], rows[i], constant[i])
        scale = np.abs(one).max(axis=0) + 1e-12
        assert (np.abs(out[i] - one) / scale).max() <= 1e-12
        assert (np.abs(after[i] - one_after) / (np.abs(one).max(axis=0)[:44] + 1e-12)).max() <= 1e-12


def test_matched_model_is_consistent(article: Article) -> None:
    """Fifty runs of the model itself, driven by noise of exactly Q dt and R from a start drawn from P0: the mean NEES
    and NIS of the runs lie where chi-squares do, and with Q a tenth of what it is they do not."""
    rng = np.random.default_rng(2024)
    runs, rows, system = 50, article.rows[:250], article.linear
    N, R = len(rows), article.noise.measurement
    x = article.x0 + rng.normal(size=(runs, 8)) * np.sqrt(np.diag(article.P0))
    later = Numbers(article.model).transition(x[0], rows[0, 0], rows[0, 1:5], NOTHING, article.c)[0]
    assert system.F[0] @ x[0] + system.g[0] == pytest.approx(later, abs=1e-14)
    truth, measured = moved(system, rows, article.noise, x, rng)
    samples = np.tile(rows, (runs, 1, 1))
    samples[:, :, 5:9] = measured

    def tested(noise: Noise) -> tuple[Array, Array]:
        carry = np.tile(np.concatenate([article.x0, kalman.pack_array(article.P0)]), (runs, 1))
        constant = np.tile(np.concatenate([article.c, noise.vector()]), (runs, 1))
        _, out = kalman.step(article.model).batch(carry, samples, constant)
        covariance = kalman.unpack_array(out[..., 8:44], 8)
        error = consistency.nees(out[..., :8] - truth, covariance).mean(axis=0)
        nis = (out[..., 44:48] ** 2 / out[..., 48:52]).sum(axis=-1).mean(axis=0)
        return error, nis

    times = [0, 20, 60, 120, 180, 249]
    error, nis = tested(article.noise)
    for found, degrees in ((error, 8), (nis, 4)):
        low, high = consistency.chi_square_band(degrees, runs)
        assert ((low < found[times]) & (found[times] < high)).all(), (low, found[times], high)
        assert 0.85 < ((low < found) & (found < high)).mean() <= 1.0
    low, high = consistency.chi_square_band(4, runs * N, 0.99)  # innovations are white: all times are one sample
    assert low < nis.mean() < high
    wrong = Noise(process=article.noise.process / 10, measurement=R)
    assert tested(wrong)[0][times[2:]].min() > consistency.chi_square_band(8, runs)[1]


def test_linear_matrices_are_those_of_the_model(article: Article) -> None:
    """The reference filters above differ from row to row, or they would prove little."""
    system = linear(article.model, article.rows[:3], NOTHING, article.c)
    assert np.array_equal(system.F, article.linear.F[:3])
    assert np.ptp(article.linear.F[10:], axis=0).max() > 0.01
    assert np.abs(article.linear.g[10:]).max() > 1e-4
    assert np.abs(article.linear.b).max() == pytest.approx(0.002)
    assert np.ptp(article.rows[1:, 0]) > 0.005
