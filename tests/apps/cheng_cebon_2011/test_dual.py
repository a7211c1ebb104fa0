"""The dual filter against the joint filter (consistent and coupled) and against that of Wan and Nelson."""

from collections.abc import Mapping
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from hypothesis import example as instance
from hypothesis import given, settings
from hypothesis import strategies as st

from fifthwheel.apps.cheng_cebon_2011 import dual
from fifthwheel.apps.cheng_cebon_2011.dual import DualCoupling, DualFiltered, DualState, Scaling
from fifthwheel.estimate.filters import Model, Noise, sample_rows
from fifthwheel.model import dynamics
from tests.estimate.filters.examples import (
    Array,
    Article,
    Example,
    Linear,
    Numbers,
    example,
    linear,
    max_difference,
    run_kalman,
    without,
)

NOTHING = np.empty(0)
WIDE = 1e9


def plain(centre: Array, scale: Array) -> Scaling:
    """p = centre + scale z, with bounds that have no effect."""
    n = len(centre)
    return Scaling(
        logarithmic=(False,) * n, centre=centre, scale=scale, lower=np.full(n, -WIDE), upper=np.full(n, WIDE)
    )


def row_by_row(
    model: Model, rows: Array, start: DualState, **arguments: object
) -> tuple[list[DualState], list[DualFiltered]]:
    """State of both filters after every row, from one run for each row."""
    states, results = [], []
    for k in range(len(rows)):
        results.append(dual.run_dual(model, rows[k : k + 1], start=start, **arguments))
        start = results[-1].end
        states.append(start)
    return states, results


# A model that is linear in state and parameters: offsets in the transition and in the outputs.

BIASED = example(
    lambda x, dt, d, p, c: ca.vertcat(
        x[0] + dt * (x[1] + p[0]), x[1] + dt * (d[0] - 2 * x[0] - c[0] * x[1]), x[2] * ca.exp(-dt) + dt * d[0] * p[1]
    ),
    lambda x, d, p, c: ca.vertcat(x[0] + p[1], x[1] - x[2] + d[0] * p[0], x[2] + c[1]),
    x=3,
    d=1,
    p=2,
    c=2,
)
C = np.array([0.4, 0.7])
R = np.array([0.2, 0.1, 0.3])
Q = np.array([[0.3, 0.1, 0.0], [0.1, 0.2, 0.0], [0.0, 0.0, 0.1]])
CENTRE, SCALE = np.array([0.5, -0.3]), np.array([0.8, 0.4])
START = DualState(
    x=np.array([1.0, -0.5, 0.2]),
    P=np.array([[0.5, 0.1, 0.0], [0.1, 0.4, -0.1], [0.0, -0.1, 0.3]]),
    z=np.array([0.3, -0.2]),
    Pz=np.array([[1.0, 0.2], [0.2, 0.7]]),
    sensitivity=np.array([[0.1, -0.3], [0.2, 0.0], [0.5, 0.4]]),
)


def biased_rows(N: int = 80, seed: int = 0, *, gaps: bool = True) -> Array:
    rng = np.random.default_rng(seed)
    measured = rng.normal(size=(N, 3))
    if gaps:
        measured[rng.random((N, 3)) < 0.25] = np.nan
        measured[20:24] = np.nan
    return sample_rows(rng.uniform(0.01, 0.3, N), rng.normal(size=(N, 1)), measured)


def augmented() -> Example:
    """The model of the augmented state (x, z) with five elements; p = centre + scale z."""

    def p(x: ca.SX) -> ca.SX:
        return CENTRE + SCALE * x[3:]

    return example(
        lambda x, dt, d, _, c: ca.vertcat(BIASED.transition(x[:3], dt, d, p(x), c), x[3:]),
        lambda x, d, _, c: BIASED.observation(x[:3], d, p(x), c),
        x=5,
        d=1,
        c=2,
    )


def joint_covariance(state: DualState) -> Array:
    """Covariance of (x, z): that of the state and the contribution of z along the sensitivity."""
    V, Pz = state.sensitivity, state.Pz
    return np.block([[state.P + V @ Pz @ V.T, V @ Pz], [Pz @ V.T, Pz]])


@pytest.mark.parametrize("gate", [np.inf, 1.5], ids=["open", "gated"])
def test_joint_filter(gate: float) -> None:
    """A consistent and coupled filter equals the Kalman filter of (x, z) to rounding (Friedland): x, z, covariances,
    innovations and gate."""
    rows = biased_rows()
    noise = Noise(process=Q, measurement=R, gate=gate)
    states, results = row_by_row(BIASED, rows, START, c=C, noise=noise, scaling=plain(CENTRE, SCALE))
    process = np.zeros((5, 5))
    process[:3, :3] = Q
    expected = run_kalman(
        augmented(),
        rows,
        p=NOTHING,
        c=C,
        noise=Noise(process=process, measurement=R, gate=gate),
        x0=np.concatenate([START.x, START.z]),
        P0=joint_covariance(START),
    )
    assert np.array([np.concatenate([s.x, s.z]) for s in states]) == pytest.approx(expected.state, abs=1e-11)
    assert max_difference(np.array([joint_covariance(s) for s in states]), expected.covariance) <= 1e-11
    assert np.vstack([r.innovation for r in results]) == pytest.approx(expected.innovation, abs=1e-11)
    variances = np.vstack([r.innovation_variance for r in results])
    assert variances == pytest.approx(expected.innovation_variance, rel=1e-11)
    assert np.array_equal(np.vstack([r.accepted for r in results]), expected.accepted)
    rejected = ((expected.accepted == 0) & (rows[:, 5:] > 0)).mean()
    assert rejected == 0 if gate == np.inf else 0.02 < rejected < 0.5


def test_joint_filter_in_numpy() -> None:
    """The same against an independent joint filter with explicit matrices and all channels together."""
    rows = biased_rows(60, 1, gaps=False)
    noise = Noise(process=Q, measurement=R)
    actual = dual.run_dual(BIASED, rows, c=C, noise=noise, scaling=plain(CENTRE, SCALE), start=START)
    x, P = np.concatenate([START.x, START.z]), joint_covariance(START)
    for k, row in enumerate(rows):
        dt, d = row[:2]
        F, H, g = np.eye(5), np.zeros((3, 5)), np.zeros(5)
        F[0, 1], F[1, 0], F[1, 1], F[2, 2] = dt, -2 * dt, 1 - dt * C[0], np.exp(-dt)
        F[0, 3], F[2, 4] = dt * SCALE[0], dt * d * SCALE[1]
        g[:3] = dt * CENTRE[0], dt * d, dt * d * CENTRE[1]
        H[0, 0], H[1, 1], H[1, 2], H[2, 2] = 1, 1, -1, 1
        H[0, 4], H[1, 3] = SCALE[1], d * SCALE[0]
        b = np.array([CENTRE[1], d * CENTRE[0], C[1]])
        x, P = F @ x + g, F @ P @ F.T
        P[:3, :3] += Q * dt
        S = H @ P @ H.T + np.diag(R)
        K = P @ H.T @ np.linalg.inv(S)
        x, P = x + K @ (row[2:5] - H @ x - b), P - K @ S @ K.T
        assert actual.z[k] == pytest.approx(x[3:], abs=1e-11)
        assert actual.z_variance[k] == pytest.approx(np.diag(P)[3:], abs=1e-11)
    assert actual.end.x == pytest.approx(x[:3], abs=1e-11)
    assert joint_covariance(actual.end) == pytest.approx(P, abs=1e-11)


def test_record_in_two_segments() -> None:
    rows = biased_rows()
    arguments = {"c": C, "noise": Noise(process=Q, measurement=R), "scaling": plain(CENTRE, SCALE),
                 "coupling": DualCoupling(random_walk=0.1, forgetting=0.3)}  # fmt: skip
    complete = dual.run_dual(BIASED, rows, start=START, **arguments)
    first = dual.run_dual(BIASED, rows[:33], start=START, **arguments)
    second = dual.run_dual(BIASED, rows[33:], start=first.end, **arguments)
    assert np.array_equal(np.vstack([first.z, second.z]), complete.z)
    assert np.array_equal(second.end.vector(), complete.end.vector())


def test_state_as_a_vector() -> None:
    restored = DualState.from_vector(replace(START, walk=0.25).vector(), 3, 2)
    for name in ("x", "P", "z", "Pz", "sensitivity"):
        assert np.array_equal(getattr(restored, name), getattr(START, name)), name
    assert restored.walk == 0.25


# The dual filter of Wan and Nelson.


def reference_filter(
    model: Model,
    rows: Array,
    *,
    c: Array,
    Q: Array,
    R: Array,
    scaling: Scaling,
    start: DualState,
    consistent: bool = False,
    coupled: bool = False,
) -> tuple[Array, DualState]:
    """z after every row, and both filters after the last row (Wan and Nelson 2001, table 5.2, with the recurrent
    derivative dx/dz at a fixed gain), channel by channel."""
    numbers, m, n_d = Numbers(model), len(R), model.transition.numel_in(2)
    x, P, z, Pz, V = start.x, start.P, start.z, start.Pz, start.sensitivity
    history = []
    for row in rows:
        d, y = row[1 : 1 + n_d], row[1 + n_d : 1 + n_d + m]
        x, F, by_p = numbers.transition(x, row[0], d, scaling.to_p(z), c)
        slope = scaling.slope(scaling.to_p(z))
        P, V = F @ P @ F.T + Q * row[0], F @ V + by_p * slope
        predicted, H, by_p = numbers.observation(x, d, scaling.to_p(z), c)
        direct, before, z_before = by_p * slope, x, z
        for i in np.flatnonzero(row[1 + n_d + m :]):
            h = H[i]
            innovation = y[i] - predicted[i] - h @ (x - before) - coupled * direct[i] @ (z - z_before)
            psi = h @ V + direct[i]
            S = h @ P @ h + R[i]
            K = P @ h / S
            Kz = Pz @ psi / (psi @ Pz @ psi + (S if consistent else R[i]))
            V = V - np.outer(K, psi)
            P = P - np.outer(K, h @ P)
            Pz = Pz - np.outer(Kz, psi @ Pz)
            x, z = x + K * innovation + coupled * V @ (Kz * innovation), z + Kz * innovation
        history.append(z)
    return np.array(history), DualState(x=x, P=P, z=z, Pz=Pz, sensitivity=V)


SPRING = example(
    lambda x, dt, d, p, c: ca.vertcat(x[0] + dt * x[1], x[1] + dt * (d[0] - p[0] * ca.sin(x[0]) - p[1] * x[1])),
    lambda x, d, p, c: ca.vertcat(x[0] + c[0], x[1] * (1 + 0.1 * x[0]) + c[1] * p[0] * x[0]),
    x=2,
    d=1,
    p=2,
    c=2,
)
SPRING_R, SPRING_Q = np.array([0.02, 0.05]), np.diag([0.01, 0.2])
SPRING_SCALING = Scaling(
    logarithmic=(True, False),
    centre=np.array([3.0, 0.4]),
    scale=np.array([0.4, 0.3]),
    lower=np.array([0.1, -5.0]),
    upper=np.array([90.0, 5.0]),
)
SPRING_START = DualState(
    x=np.array([0.4, 0.1]),
    P=np.array([[0.2, 0.05], [0.05, 0.3]]),
    z=np.array([0.5, -0.4]),
    Pz=np.array([[1.0, 0.1], [0.1, 0.8]]),
    sensitivity=np.array([[0.0, 0.1], [-0.2, 0.0]]),
)
COUPLINGS = {
    "Wan and Nelson": DualCoupling(consistent=False, coupled=False),
    "consistent": DualCoupling(consistent=True, coupled=False),
    "coupled": DualCoupling(consistent=False, coupled=True),
    "Friedland": DualCoupling(),
}


def spring_rows(N: int = 150, seed: int = 5) -> Array:
    """A record of an oscillating spring with p = (2.2, 0.6)."""
    rng = np.random.default_rng(seed)
    x, measured = np.array([0.3, 0.0]), []
    dt, d = rng.uniform(0.02, 0.1, N), 2 * np.sin(np.arange(N) / 6)
    for k in range(N):
        x = np.array([x[0] + dt[k] * x[1], x[1] + dt[k] * (d[k] - 2.2 * np.sin(x[0]) - 0.6 * x[1])])
        measured.append([x[0] + 0.1, x[1] * (1 + 0.1 * x[0])] + rng.normal(size=2) * np.sqrt(SPRING_R))
    with_gaps = np.where(rng.random((N, 2)) < 0.15, np.nan, np.array(measured))
    return sample_rows(dt, d[:, None], with_gaps)


@pytest.mark.parametrize("direct", [0.0, 0.2], ids=["indirect", "direct"])
@pytest.mark.parametrize("name", COUPLINGS)
def test_equals_the_reference_filter(name: str, direct: float) -> None:
    """A nonlinear model with parameters in the transition and, if direct, in an output; some values are missing."""
    coupling, c = COUPLINGS[name], np.array([0.1, direct])
    noise = Noise(process=SPRING_Q, measurement=SPRING_R)
    given = {"c": c, "scaling": SPRING_SCALING, "start": SPRING_START}
    actual = dual.run_dual(SPRING, spring_rows(), noise=noise, coupling=coupling, **given)
    switches = {"consistent": coupling.consistent, "coupled": coupling.coupled}
    history, end = reference_filter(SPRING, spring_rows(), Q=SPRING_Q, R=SPRING_R, **given, **switches)
    assert actual.z == pytest.approx(history, abs=1e-10)
    for field in ("x", "P", "z", "Pz", "sensitivity"):
        assert getattr(actual.end, field) == pytest.approx(getattr(end, field), abs=1e-10), field


def test_one_channel_equals_the_textbook_filter() -> None:
    """The matrices of Wan and Nelson with one channel, so that there is no sequential update."""
    model = example(
        lambda x, dt, d, p, c: SPRING.transition(x, dt, d, p, ca.SX.zeros(2)),
        lambda x, d, p, c: ca.sin(x[0]) + 0.1 * p[1] * x[1],
        x=2,
        d=1,
        p=2,
    )
    rows = spring_rows()
    rows = sample_rows(rows[:, 0], rows[:, 1:2], rows[:, 2:3])
    r = np.array([0.03])
    actual = dual.run_dual(
        model,
        rows,
        c=NOTHING,
        noise=Noise(process=SPRING_Q, measurement=r),
        scaling=SPRING_SCALING,
        start=SPRING_START,
        coupling=COUPLINGS["Wan and Nelson"],
    )
    s, numbers = SPRING_START, Numbers(model)
    x, P, w, Pw, V = s.x[:, None], s.P, s.z[:, None], s.Pz, s.sensitivity
    for k, row in enumerate(rows):
        p = SPRING_SCALING.to_p(w[:, 0])
        slope = np.diag(SPRING_SCALING.slope(p))
        forward, A, by_p = numbers.transition(x[:, 0], row[0], row[1:2], p, NOTHING)
        x, P, V = forward[:, None], A @ P @ A.T + SPRING_Q * row[0], A @ V + by_p @ slope
        predicted, H, by_p = numbers.observation(x[:, 0], row[1:2], p, NOTHING)
        error, by_w = row[2:3, None] - predicted[:, None], H @ V + by_p @ slope
        K = P @ H.T @ np.linalg.inv(H @ P @ H.T + r)
        Kw = Pw @ by_w.T @ np.linalg.inv(by_w @ Pw @ by_w.T + r)
        x, P, V = x + K @ error, (np.eye(2) - K @ H) @ P, V - K @ by_w
        w, Pw = w + Kw @ error, (np.eye(2) - Kw @ by_w) @ Pw
        assert actual.z[k] == pytest.approx(w[:, 0], abs=1e-10)
        assert actual.z_variance[k] == pytest.approx(np.diag(Pw), abs=1e-10)
    assert actual.end.x == pytest.approx(x[:, 0], abs=1e-10)
    assert pytest.approx(P, abs=1e-10) == actual.end.P
    assert actual.end.sensitivity == pytest.approx(V, abs=1e-10)


# Sensitivities.


@pytest.mark.parametrize("name", COUPLINGS)
def test_sensitivities_of_a_filter_whose_gain_does_not_depend_on_p(name: str) -> None:
    """Against differences of runs with fixed z on either side; the input depends nonlinearly on p."""
    model = example(
        lambda x, dt, d, p, c: ca.vertcat(x[0] + dt * x[1], 0.9 * x[1] - dt * (x[0] - ca.exp(p[0]) * d - p[1] ** 3)),
        lambda x, d, p, c: ca.vertcat(x[0], x[1] + ca.sin(p[1]) * d),
        x=2,
        d=1,
        p=2,
    )
    rows, z = spring_rows(60), np.array([0.2, -0.6])
    scaling = plain(np.array([0.3, 0.5]), np.array([0.7, 0.2]))
    start = replace(SPRING_START, Pz=np.zeros((2, 2)), sensitivity=np.zeros((2, 2)))
    noise = Noise(process=SPRING_Q, measurement=SPRING_R)

    def run(z: Array) -> DualFiltered:
        start_at_z = replace(start, z=z)
        return dual.run_dual(
            model, rows, c=NOTHING, noise=noise, scaling=scaling, start=start_at_z, coupling=COUPLINGS[name]
        )

    actual, h = run(z), 1e-4
    assert np.array_equal(actual.z, np.tile(z, (60, 1)))  # fixed
    assert not actual.z_variance.any()
    for j in range(2):
        plus, minus = run(z + h * np.eye(2)[j]), run(z - h * np.eye(2)[j])
        assert actual.end.sensitivity[:, j] == pytest.approx((plus.end.x - minus.end.x) / (2 * h), abs=1e-8)
        by_difference = -(plus.innovation - minus.innovation) / (2 * h)
        assert actual.sensitivity[:, :, j][rows[:, 4:] > 0] == pytest.approx(by_difference[rows[:, 4:] > 0], abs=1e-8)


FREE = (
    "tractor.drive.cornering_stiffness",
    "semitrailer.cornering_stiffness",
    "semitrailer.payload.height",
    "steer.tractor.front.offset",
    "yaw_rate.tractor.offset",
)
LOGARITHMIC = (True, True, False, False, False)


def free_article(article: Article) -> tuple[dynamics.ChainModel, Array, Scaling]:
    """The article's vehicle with five free parameters, its other parameters, and the usual priors and bounds."""
    model = dynamics.model(article.vehicle, article.model.outputs, roll=True, free=FREE)
    values = dict(zip(article.model.known, article.c, strict=True))
    nominal = model.free_values(values)
    centre = np.concatenate([nominal[:3], np.zeros(2)])
    scaling = Scaling(
        logarithmic=LOGARITHMIC,
        centre=centre,
        scale=np.array([0.3, 0.3, 1.0, 0.01, 0.004]),
        lower=np.array([centre[0] / 8, centre[1] / 8, 0.0, -0.08, -0.032]),
        upper=np.array([centre[0] * 8, centre[1] * 8, 3.5, 0.08, 0.032]),
    )
    return model, model.known_values(values), scaling


@pytest.mark.slow
def test_sensitivities_of_the_article(article: Article) -> None:
    """Against differences of the filter with fixed gains: stiffnesses, payload height and offsets, 150 samples."""
    model, c, scaling = free_article(article)
    rows = without(article.rows[:150], np.random.default_rng(0).random((150, 4)) < 0.2, 4)
    z = np.array([0.3, -0.5, 0.2, -0.1, 0.5])
    start = DualState(x=article.x0, P=article.P0, z=z, Pz=np.zeros((5, 5)), sensitivity=np.zeros((8, 5)))
    actual = dual.run_dual(model, rows, c=c, noise=article.noise, scaling=scaling, start=start)

    def matrices(z: Array) -> Linear:
        return linear(model, rows, scaling.to_p(z), c)

    nominal, P, gains = matrices(z), article.P0, []
    for k, row in enumerate(rows):
        P = nominal.F[k] @ P @ nominal.F[k].T + article.noise.process * row[0]
        present, K = row[9:] > 0, np.zeros((8, 4))
        H = nominal.H[k][present]
        K[:, present] = P @ H.T @ np.linalg.inv(H @ P @ H.T + np.diag(article.noise.measurement[present]))
        P = P - K[:, present] @ H @ P
        gains.append(K)

    def end(z: Array) -> Array:
        system, x = matrices(z), article.x0
        for k, row in enumerate(rows):
            x = system.F[k] @ x + system.g[k]
            x = x + gains[k] @ (row[5:9] - system.b[k] - system.H[k] @ x)
        return x

    assert actual.end.x == pytest.approx(end(z), abs=1e-11)
    assert max_difference(actual.end.P[None], P[None]) <= 1e-9
    for j, h in enumerate(1e-3 * np.eye(5)):
        expected = (8 * (end(z + h) - end(z - h)) - (end(z + 2 * h) - end(z - 2 * h))) / 12e-3
        assert np.abs(actual.end.sensitivity[:, j] - expected).max() <= 1e-7 * np.abs(expected).max(), FREE[j]


# Bounds, signs and finite numbers.


def powers_of_ten(low: float, high: float) -> st.SearchStrategy[float]:
    return st.floats(low, high).map(lambda exponent: 10.0**exponent)


STARTS = {
    "relative": st.tuples(*[st.floats(0.6, 1.4) | st.sampled_from([1 / 8, 8.0])] * 2),
    "height": st.floats(0.1, 1.8) | st.sampled_from([0.0, 3.5]),
    "R": powers_of_ten(-8, 2),
    "P0": powers_of_ten(-12, 4),
    "Q": st.just(0.0) | powers_of_ten(-10, -2),
    "prior": powers_of_ten(-3, 1),
    "size": st.sampled_from([0.0, 1e-3, 0.1, 10.0, 1e4]),
    "gate": st.sampled_from([3.0, 6.0, np.inf]),
    "seed": st.integers(0, 2**32 - 1),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", COUPLINGS)
def test_any_start_and_any_noise(article: Article, name: str) -> None:
    """Parameters are within their bounds, stiffnesses positive, covariances symmetric and positive, all finite."""
    model, c, scaling = free_article(article)

    corner = {"height": 0.0, "R": 1e-7, "P0": 1.0, "Q": 0.0, "prior": 1.0, "size": 1e4, "gate": np.inf}

    @settings(max_examples=30, deadline=None)
    @instance(relative=(0.8, 0.8), seed=2, **corner)
    @instance(relative=(1.0, 0.6), seed=33679, **corner)
    @given(**STARTS)
    def check(
        relative: tuple[float, float],
        height: float,
        R: float,
        P0: float,
        Q: float,
        prior: float,
        size: float,
        gate: float,
        seed: int,
    ) -> None:
        rng = np.random.default_rng(seed)
        rows = article.rows.copy()
        rows[:, 5:9] += size * rng.standard_t(2, size=(len(rows), 4))
        rows = without(rows, rng.random((len(rows), 4)) < 0.2, 4)
        z = scaling.to_z(np.array([*(scaling.centre[:2] * relative), height, 0.0, 0.0]))
        start = DualState(x=article.x0, P=P0 * np.eye(8), z=z, Pz=prior * np.eye(5), sensitivity=np.zeros((8, 5)))
        noise = Noise(process=Q * np.eye(8), measurement=np.full(4, R), gate=gate)
        actual = dual.run_dual(model, rows, c=c, noise=noise, scaling=scaling, start=start, coupling=COUPLINGS[name])
        for field in ("z", "z_variance", "innovation", "innovation_variance", "sensitivity"):
            assert np.isfinite(getattr(actual, field)).all(), field
        assert np.isfinite(actual.end.vector()).all()
        p = scaling.to_p(actual.z)
        rounding = 1e-14 * (scaling.upper - scaling.lower)
        assert (p >= scaling.lower - rounding).all()
        assert (p <= scaling.upper + rounding).all()
        assert (p[:, :2] > 0).all()
        for covariance in (actual.end.P, actual.end.Pz):
            assert np.array_equal(covariance, covariance.T)
        if min(relative) < 0.6:  # an unstable vehicle, whose sensitivities grow without bound
            return
        largest = max(P0, actual.innovation_variance.max())  # during the run
        for covariance, initial in ((actual.end.P, largest), (actual.end.Pz, prior)):
            values = np.linalg.eigvalsh(covariance)
            assert values[0] >= -1e-12 * max(values[-1], initial)
        assert (actual.z_variance >= -1e-12 * prior).all()

    check()


def test_parameter_stays_at_its_bound() -> None:
    """An offset of five with a bound of two; the correction of the state belongs to the bounded parameter."""
    model = example(lambda x, dt, d, p, c: x * ca.exp(-dt), lambda x, d, p, c: x + p, x=1, p=1)
    rows = sample_rows(np.full(200, 0.1), np.empty((200, 0)), np.full((200, 1), 5.0))
    scaling = Scaling(
        logarithmic=(False,), centre=np.zeros(1), scale=np.ones(1), lower=np.array([-1.0]), upper=np.array([2.0])
    )
    start = DualState(x=np.zeros(1), P=np.full((1, 1), 0.01), z=np.zeros(1), Pz=np.eye(1), sensitivity=np.zeros((1, 1)))
    noise = Noise(process=np.zeros((1, 1)), measurement=np.ones(1))
    actual = dual.run_dual(model, rows, c=NOTHING, noise=noise, scaling=scaling, start=start)
    assert actual.z.max() == 2.0
    assert actual.z[-1] == 2.0
    assert abs(actual.end.x.item()) < 0.1
    beyond = replace(start, z=np.array([9.0]))
    outside = dual.run_dual(model, rows[:1], c=NOTHING, noise=noise, scaling=scaling, start=beyond)
    assert outside.z.item() == 2.0


def test_correction_of_the_state_belongs_to_the_bounded_parameter() -> None:
    """P = 3, r = 1 and V = -1/2 give K = 3/4, psi = 1/2 and V+ = -7/8; z is bounded to 1/10."""
    model = example(lambda x, dt, d, p, c: x, lambda x, d, p, c: x + p, x=1, p=1)
    scaling = Scaling(
        logarithmic=(False,), centre=np.zeros(1), scale=np.ones(1), lower=np.array([-0.1]), upper=np.array([0.1])
    )
    start = DualState(
        x=np.zeros(1), P=np.full((1, 1), 3.0), z=np.zeros(1), Pz=np.eye(1), sensitivity=np.full((1, 1), -0.5)
    )
    noise, row = Noise(process=np.zeros((1, 1)), measurement=np.ones(1)), np.array([[0.0, 2.0, 1.0]])
    actual = dual.run_dual(model, row, c=NOTHING, noise=noise, scaling=scaling, start=start)
    assert actual.z.item() == 0.1
    assert actual.end.sensitivity.item() == pytest.approx(-7 / 8, rel=1e-14)
    assert actual.end.x.item() == pytest.approx(3 / 4 * 2.0 - 7 / 8 * 0.1, rel=1e-14)


def test_scaling() -> None:
    scaling = SPRING_SCALING
    z = np.random.default_rng(0).normal(size=(20, 2))
    p = scaling.to_p(z)
    assert p[:, 0] == pytest.approx(3.0 * np.exp(0.4 * z[:, 0]))
    assert p[:, 1] == pytest.approx(0.4 + 0.3 * z[:, 1])
    assert scaling.to_z(p) == pytest.approx(z)
    for j, h in enumerate(1e-6 * np.eye(2)):
        expected = (scaling.to_p(z + h) - scaling.to_p(z - h))[:, j] / 2e-6
        assert scaling.slope(p)[:, j] == pytest.approx(expected, rel=1e-8)
    zero = replace(scaling, centre=np.array([3.0, 0.0]))  # no logarithm of a centre of zero
    assert zero.to_z(zero.to_p(z)) == pytest.approx(z)


# The random walk.


def test_random_walk_and_forgetting() -> None:
    """Without measurements Pz increases by walk * dt, times the factor of forgetting; each z has its own walk."""
    rows = without(biased_rows(40, gaps=False), np.ones((40, 3), dtype=bool), 1)
    arguments = {"c": C, "noise": Noise(process=Q, measurement=R), "scaling": plain(CENTRE, SCALE), "start": START}
    time = np.cumsum(rows[:, 0])
    walk = np.array([0.3, 0.02])
    for forgetting in (0.0, 0.4, 5.0):
        coupling = DualCoupling(random_walk=walk, forgetting=forgetting)
        actual = dual.run_dual(BIASED, rows, coupling=coupling, **arguments)
        increase = np.cumsum(rows[:, 0] * np.exp(-forgetting * time))
        assert actual.z_variance == pytest.approx(np.diag(START.Pz) + increase[:, None] * walk, rel=1e-12)
        assert actual.end.Pz[0, 1] == START.Pz[0, 1]
        assert actual.end.walk == pytest.approx(np.exp(-forgetting * time[-1]), rel=1e-12)
        assert np.array_equal(actual.z, np.tile(START.z, (40, 1)))
    same = dual.run_dual(BIASED, rows, coupling=DualCoupling(random_walk=0.3), **arguments)
    each = dual.run_dual(BIASED, rows, coupling=DualCoupling(random_walk=np.full(2, 0.3)), **arguments)
    assert np.array_equal(same.z_variance, each.z_variance)


def test_random_walk_limits_the_decrease_of_the_variance() -> None:
    """Without it the variance of z decreases; with it, it is stationary; with forgetting, it decreases again."""
    rows = biased_rows(1500, gaps=False)
    arguments = {"c": C, "noise": Noise(process=Q, measurement=R), "scaling": plain(CENTRE, SCALE), "start": START}

    def middle_and_end(coupling: DualCoupling) -> tuple[float, float]:
        variance = dual.run_dual(BIASED, rows, coupling=coupling, **arguments).z_variance[:, 0]
        return variance[700:750].mean(), variance[-50:].mean()

    without_walk, with_walk = middle_and_end(DualCoupling()), middle_and_end(DualCoupling(random_walk=0.01))
    with_forgetting = middle_and_end(DualCoupling(random_walk=0.01, forgetting=0.1))
    assert without_walk[1] < 0.6 * without_walk[0]
    assert with_walk[1] == pytest.approx(with_walk[0], rel=0.1)
    assert without_walk[1] < with_forgetting[1] < 0.3 * with_walk[1]


# Missing values, gate, batches.


@pytest.mark.parametrize("name", COUPLINGS)
@pytest.mark.parametrize("channel", range(3))
def test_missing_channel_equals_a_model_without_it(channel: int, name: str) -> None:
    """A channel that is sometimes missing: there the smaller model gives the same result."""
    remaining = [i for i in range(3) if i != channel]
    fewer = example(lambda *a: BIASED.transition(*a), lambda *a: BIASED.observation(*a)[remaining], x=3, d=1, p=2, c=2)
    rows = biased_rows(60, channel)
    missing_channels = np.zeros((60, 3), dtype=bool)
    missing_channels[:, channel] = np.random.default_rng(channel).random(60) < 0.5
    small = np.hstack([rows[:, :2], rows[:, 2:5][:, remaining], rows[:, 5:][:, remaining]])
    arguments = {"c": C, "scaling": plain(CENTRE, SCALE), "coupling": COUPLINGS[name]}
    noise, noise_of_fewer = (Noise(process=Q, measurement=r) for r in (R, R[remaining]))
    actual = dual.run_dual(BIASED, without(rows, missing_channels, 1), noise=noise, start=START, **arguments)
    state = START
    for k in range(60):
        if missing_channels[k, channel]:
            step = dual.run_dual(fewer, small[k : k + 1], noise=noise_of_fewer, start=state, **arguments)
        else:
            step = dual.run_dual(BIASED, rows[k : k + 1], noise=noise, start=state, **arguments)
        state = step.end
        assert actual.z[k] == pytest.approx(state.z, rel=1e-12, abs=1e-12)
        assert actual.z_variance[k] == pytest.approx(np.diag(state.Pz), rel=1e-12)
    assert actual.end.vector() == pytest.approx(state.vector(), rel=1e-12, abs=1e-12)
    assert not actual.innovation[missing_channels].any()
    assert not actual.accepted[missing_channels].any()


@pytest.mark.parametrize("name", COUPLINGS)
def test_without_measurements_it_is_prediction(name: str) -> None:
    """Parameters are constant; state, covariance and sensitivity follow the model."""
    rows = without(biased_rows(30), np.ones((30, 3), dtype=bool), 1)
    scaling, noise = plain(CENTRE, SCALE), Noise(process=Q, measurement=R)
    actual = dual.run_dual(BIASED, rows, c=C, noise=noise, scaling=scaling, start=START, coupling=COUPLINGS[name])
    p = scaling.to_p(START.z)
    x, P, V, numbers = START.x, START.P, START.sensitivity, Numbers(BIASED)
    for row in rows:
        x, F, by_p = numbers.transition(x, row[0], row[1:2], p, C)
        P, V = F @ P @ F.T + Q * row[0], F @ V + by_p * SCALE
    assert np.array_equal(actual.z, np.tile(START.z, (30, 1)))
    assert np.array_equal(actual.end.Pz, START.Pz)
    assert actual.end.x == pytest.approx(x, abs=1e-13)
    assert pytest.approx(P, abs=1e-13) == actual.end.P
    assert actual.end.sensitivity == pytest.approx(V, abs=1e-13)
    assert not actual.innovation.any()


def test_one_of_two_channels_in_numbers() -> None:
    """y = [NaN, 1] of x + z and x - z, variances 1: P = 4 and Pz = 2, so S = 7."""
    model = example(lambda x, dt, d, p, c: x, lambda x, d, p, c: ca.vertcat(x + p, x - p), x=1, p=1)
    rows = sample_rows(np.zeros(1), np.empty((1, 0)), np.array([[np.nan, 1.0]]))
    actual = dual.run_dual(
        model,
        rows,
        c=NOTHING,
        noise=Noise(process=np.zeros((1, 1)), measurement=np.ones(2)),
        scaling=plain(np.zeros(1), np.ones(1)),
        start=DualState(
            x=np.zeros(1), P=np.full((1, 1), 4.0), z=np.zeros(1), Pz=np.full((1, 1), 2.0), sensitivity=np.zeros((1, 1))
        ),
    )
    assert actual.z.item() == pytest.approx(-2 / 7, rel=1e-14)
    assert actual.z_variance.item() == pytest.approx(2 - 4 / 7, rel=1e-14)
    assert actual.end.x.item() == pytest.approx(4 / 7, rel=1e-14)
    assert actual.innovation.tolist() == [[0, 1]]
    assert actual.innovation_variance.tolist() == [[7, 7]]
    assert actual.accepted.tolist() == [[0, 1]]


@pytest.mark.parametrize("name", COUPLINGS)
def test_rejected_sample_equals_a_missing_sample(name: str) -> None:
    rows, rng = biased_rows(80), np.random.default_rng(1)
    spikes = (rng.random((80, 3)) < 0.05) & (rows[:, 5:] > 0)
    assert spikes.sum() > 5
    with_spikes = rows.copy()
    with_spikes[:, 2:5][spikes] += 1e3
    given = {"c": C, "noise": Noise(process=Q, measurement=R, gate=30.0), "scaling": plain(CENTRE, SCALE)}
    given |= {"start": START, "coupling": COUPLINGS[name]}
    actual = dual.run_dual(BIASED, with_spikes, **given)
    expected = dual.run_dual(BIASED, without(rows, spikes, 1), **given)
    assert np.array_equal(actual.accepted, expected.accepted)
    assert np.array_equal(actual.z, expected.z)
    assert np.array_equal(actual.z_variance, expected.z_variance)
    assert np.array_equal(actual.end.vector(), expected.end.vector())
    assert (actual.innovation[spikes] > 900).all()
    assert np.array_equal(actual.innovation[~spikes], expected.innovation[~spikes])


def test_fixed_parameters_give_the_kalman_filter(article: Article) -> None:
    """With Pz = 0 it is the Kalman filter of the state at these parameters."""
    model, c, scaling = free_article(article)
    z = np.array([0.2, 0.1, -0.3, 0.4, -0.5])
    start = DualState(x=article.x0, P=article.P0, z=z, Pz=np.zeros((5, 5)), sensitivity=np.zeros((8, 5)))
    actual = dual.run_dual(model, article.rows, c=c, noise=article.noise, scaling=scaling, start=start)
    values: Mapping[str, float] = dict(zip(article.model.known, article.c, strict=True)) | dict(
        zip(FREE, scaling.to_p(z), strict=True)
    )
    arguments = article.arguments() | {"c": article.model.known_values(values)}
    expected = run_kalman(article.model, article.rows, **arguments)
    assert actual.end.x == pytest.approx(expected.state[-1], abs=1e-11)
    assert max_difference(actual.end.P[None], expected.covariance[-1:]) <= 1e-11
    assert actual.innovation == pytest.approx(expected.innovation, abs=1e-11)
    assert actual.innovation_variance == pytest.approx(expected.innovation_variance, rel=1e-11)


def test_batch_equals_a_loop_over_vehicles() -> None:
    """Six vehicles with different starts, constants and records in lanes of four."""
    rng = np.random.default_rng(9)
    step, vehicles = dual.dual_step(SPRING, SPRING_SCALING.logarithmic), 6
    start = replace(SPRING_START, walk=0.7).vector()
    constant = np.concatenate(
        [[0.1, 0.2], Noise(process=SPRING_Q, measurement=SPRING_R, gate=4.0).vector(), SPRING_SCALING.vector(),
         [0.01, 0.02, 0.3, 1.0, 1.0]]
    )  # fmt: skip
    starts, constants = start * rng.uniform(0.9, 1.1, (vehicles, 1)), np.tile(constant, (vehicles, 1))
    constants[:, :2] *= rng.uniform(0.8, 1.2, (vehicles, 2))
    rows = np.array([spring_rows(seed=seed) for seed in range(vehicles)])
    after, out = step.batch(starts, rows, constants)
    for i in range(vehicles):
        after_one, out_one = step(starts[i], rows[i], constants[i])
        assert out[i] == pytest.approx(out_one, rel=1e-12, abs=1e-12)
        assert after[i] == pytest.approx(after_one, rel=1e-12, abs=1e-12)


def test_parameters_converge() -> None:
    """After 8000 samples of a spring the errors of the estimates are below three sigma."""
    rows = spring_rows(8000, 3)
    actual = dual.run_dual(
        SPRING,
        rows,
        c=np.array([0.1, 0.0]),
        noise=Noise(process=SPRING_Q * 0.01, measurement=SPRING_R),
        scaling=SPRING_SCALING,
        start=replace(SPRING_START, z=np.zeros(2), Pz=np.eye(2), sensitivity=np.zeros((2, 2))),
    )
    sigma = np.sqrt(actual.z_variance[-1])
    assert (np.abs(actual.z[-1] - SPRING_SCALING.to_z(np.array([2.2, 0.6]))) < 3 * sigma).all()
    assert (sigma < 0.1).all()


def test_channel_that_depends_only_on_a_parameter() -> None:
    model = example(lambda x, dt, d, p, c: x * ca.exp(-dt) + p[0], lambda x, d, p, c: ca.vertcat(p[1], x), x=1, p=2)
    rows = sample_rows(np.full(20, 0.1), np.empty((20, 0)), np.random.default_rng(0).normal(size=(20, 2)))
    given = {"c": NOTHING, "scaling": plain(np.zeros(2), np.ones(2))}
    start = DualState(x=np.zeros(1), P=np.eye(1), z=np.zeros(2), Pz=np.eye(2), sensitivity=np.zeros((1, 2)))
    noise = Noise(process=np.eye(1), measurement=np.ones(2))
    actual = dual.run_dual(model, rows, noise=noise, start=start, **given)
    history, _ = reference_filter(
        model, rows, Q=np.eye(1), R=np.ones(2), start=start, consistent=True, coupled=True, **given
    )
    assert actual.z == pytest.approx(history, abs=1e-12)
    assert actual.sensitivity[:, 0] == pytest.approx(np.tile([0.0, 1.0], (20, 1)))
    assert np.isfinite(actual.sensitivity).all()
