"""The dual filter against the joint filter (consistent and coupled) and against that of Wan and Nelson in NumPy."""

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
    Numbers,
    example,
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


def test_record_in_two_segments() -> None:
    rows = biased_rows()
    arguments = {"c": C, "noise": Noise(process=Q, measurement=R), "scaling": plain(CENTRE, SCALE),
                 "coupling": DualCoupling(random_walk=0.1, forgetting=0.3)}  # fmt: skip
    complete = dual.run_dual(BIASED, rows, start=START, **arguments)
    first = dual.run_dual(BIASED, rows[:33], start=START, **arguments)
    second = dual.run_dual(BIASED, rows[33:], start=first.end, **arguments)
    assert np.array_equal(np.vstack([first.z, second.z]), complete.z)
    assert np.array_equal(second.end.vector(), complete.end.vector())


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
BOTH = ("Wan and Nelson", "Friedland")
"""The couplings of the article and of the default settings."""


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


# Sensitivities.


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
@pytest.mark.parametrize("name", BOTH)
def test_any_start_and_any_noise(article: Article, name: str) -> None:
    """Parameters are within their bounds, stiffnesses positive, covariances symmetric and positive, all finite."""
    model, c, scaling = free_article(article)

    corner = {"height": 0.0, "R": 1e-7, "P0": 1.0, "Q": 0.0, "prior": 1.0, "size": 1e4, "gate": np.inf}

    @settings(max_examples=10, deadline=None)
    @instance(relative=(0.8, 0.8), seed=2, **corner)
    @instance(relative=(1.0, 0.6), seed=33679, **corner)
    @given(**STARTS)
    def check(relative: tuple[float, float], height: float, R: float, P0: float, Q: float, prior: float, size: float,
              gate: float, seed: int) -> None:  # fmt: skip
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


# Missing values, gate, batches.


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
