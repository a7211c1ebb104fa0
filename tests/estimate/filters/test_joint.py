"""The joint filter against the Kalman filter of the augmented state [x, z]."""

import casadi as ca
import numpy as np
import pytest

from fifthwheel.base.types import Array
from fifthwheel.estimate.filters import Noise, joint
from fifthwheel.estimate.filters.joint import JointLayout
from fifthwheel.estimate.filters.model import pack_array, unpack_array
from fifthwheel.estimate.filters.scaling import Scaling
from tests.estimate.filters.examples import example

MODEL = example(
    lambda x, dt, d, p, c: ca.vertcat(
        x[0] + dt * (x[1] + p[0]), x[1] + dt * (d[0] - 2 * x[0] - c[0] * x[1]), x[2] * ca.exp(-dt) + dt * d[0] * p[1]
    ),
    lambda x, d, p, c: ca.vertcat(x[0] + p[1], x[1] - x[2] + d[0] * p[0]),
    x=3,
    d=1,
    p=2,
    c=1,
)
C = np.array([0.4])
NOISE = Noise(process=np.diag([0.3, 0.2, 0.1]), measurement=np.array([0.2, 0.1]))
SCALING = Scaling(
    logarithmic=(False, False),
    centre=np.array([0.5, -0.3]),
    scale=np.array([0.8, 0.4]),
    lower=np.full(2, -1e9),
    upper=np.full(2, 1e9),
)


def linear(dt: float, d: float) -> tuple[Array, Array, Array, Array]:
    """F, b, H, e of v+ = F v + b and y = H v + e for v = [x, z], in which the model is linear."""

    def later(v: Array) -> Array:
        return np.concatenate([np.array(MODEL.transition(v[:3], dt, d, SCALING.to_p(v[3:]), C)).ravel(), v[3:]])

    def observed(v: Array) -> Array:
        return np.array(MODEL.observation(v[:3], d, SCALING.to_p(v[3:]), C)).ravel()

    b, e = later(np.zeros(5)), observed(np.zeros(5))
    return (
        np.column_stack([later(row) - b for row in np.eye(5)]),
        b,
        np.column_stack([observed(row) - e for row in np.eye(5)]),
        e,
    )


@pytest.fixture
def rows() -> Array:
    """dt, d, y, weight, learn."""
    rng = np.random.default_rng(3)
    n = 40
    return np.column_stack(
        [rng.uniform(0.01, 0.2, n), rng.normal(size=(n, 3)), rng.random((n, 2)) < 0.8, rng.random(n) < 0.6]
    )


def run(rows: Array, base: Array, n_z: int = 2) -> tuple[Array, Array]:
    """Carries (N, 2, n_carry) of both filters and outputs after every row, from x = 0, z = 0 with covariance 1."""
    layout = JointLayout(3, n_z, 2 - n_z)
    scan = joint.joint_step(MODEL, SCALING.logarithmic, n_z)
    carry = np.zeros((2, layout.size))
    carry[:, layout.P], carry[:, layout.Pz] = pack_array(np.eye(3)), pack_array(np.eye(n_z))
    constant = joint.constants(C, NOISE, SCALING, np.zeros(n_z))
    samples = np.repeat(np.column_stack([rows, np.tile(base, (len(rows), 1))])[:, None, :], 2, axis=1)
    carries, outputs = [], []
    for sample in samples:
        output = np.empty((2, scan.n_output))
        scan.single(1, 2, *[a.ctypes.data for a in (carry, sample, constant, output)])
        carries.append(carry.copy())
        outputs.append(output)
    return np.array(carries), np.array(outputs)


def augmented(carry: Array, n_z: int = 2) -> tuple[Array, Array]:
    """Mean and covariance of [x, z], with considered parameters last."""
    layout = JointLayout(3, n_z, 2 - n_z)
    V, B = carry[layout.V].reshape(3, 2, order="F"), carry[layout.B].reshape(n_z, 2 - n_z, order="F")
    Pz = np.block([[unpack_array(carry[layout.Pz], n_z) + B @ B.T, B], [B.T, np.eye(2 - n_z)]])
    P = unpack_array(carry[layout.P], 3) + V @ Pz @ V.T
    z = np.append(carry[layout.z], np.zeros(2 - n_z))
    return np.concatenate([carry[layout.x], z]), np.block([[P, V @ Pz], [Pz @ V.T, Pz]])


def kalman(rows: Array, variance: Array) -> list[tuple[Array, Array]]:
    """Means and covariances of [x, z] by the Kalman filter.

    The gains are those for these variances (2,) of z at the start; the covariances have the variance 1.
    """
    mean, P, assumed, Q = np.zeros(5), np.eye(5), np.diag([1.0, 1.0, 1.0, *variance]), np.zeros((5, 5))
    Q[:3, :3] = NOISE.process
    results = []
    for row in rows:
        F, b, H, e = linear(row[0], row[1])
        mean = F @ mean + b
        P, assumed = (F @ covariance @ F.T + Q * row[0] for covariance in (P, assumed))
        for i in np.flatnonzero(row[4:6]):
            h, r = H[i], NOISE.measurement[i]
            gain = assumed @ h / (h @ assumed @ h + r)
            gain[3:] *= row[6]
            mean = mean + gain * (row[2 + i] - h @ mean - e[i])
            left = np.eye(5) - np.outer(gain, h)
            P, assumed = (left @ covariance @ left.T + r * np.outer(gain, gain) for covariance in (P, assumed))
        results.append((mean, P))
    return results


@pytest.mark.parametrize("n_z", [2, 1])
def test_equals_the_kalman_filter_of_the_augmented_state_with_optional_learning(rows: Array, n_z: int) -> None:
    """The gains ignore a considered parameter, and the covariance includes it."""
    carries, _ = run(rows, np.zeros(n_z), n_z)
    elsewhere, _ = run(rows, np.full(n_z, 1.7), n_z)  # the point of linearisation has no effect on a linear model
    np.testing.assert_allclose(elsewhere[:, 1], carries[:, 0], atol=1e-12)
    for carry, (mean, P) in zip(carries, kalman(rows, np.arange(2) < n_z), strict=True):
        actual, covariance = augmented(carry[0], n_z)
        np.testing.assert_allclose(actual, mean, atol=1e-12)
        np.testing.assert_allclose(covariance, P, atol=1e-12)


def test_score_is_that_of_all_innovations(rows: Array) -> None:
    """The log-likelihood of the filter without c, as a function of c, has this gradient and information."""
    rows[:, 6] = 1.0

    def loss(c: float) -> float:
        total, n = 0.0, MODEL.transition.numel_in(0)
        mean, P, Q = np.zeros(5), np.diag([1.0, 1.0, 1.0, 1.0, 0.0]), np.zeros((5, 5))
        mean[4], Q[:n, :n] = c, NOISE.process
        for row in rows:
            F, b, H, e = linear(row[0], row[1])
            mean, P = F @ mean + b, F @ P @ F.T + Q * row[0]
            for i in np.flatnonzero(row[4:6]):
                S = H[i] @ P @ H[i] + NOISE.measurement[i]
                innovation, gain = row[2 + i] - H[i] @ mean - e[i], P @ H[i] / S
                total += innovation**2 / S / 2
                mean, P = mean + gain * innovation, P - np.outer(gain, gain) * S
        return total

    layout, step = JointLayout(3, 1, 1), 0.1
    last = run(rows, np.zeros(1), 1)[0][-1, 0]
    lower, middle, upper = (loss(c) for c in (-step, 0.0, step))
    assert last[layout.gradient][0] == pytest.approx((upper - lower) / (2 * step))
    assert last[layout.information][0] == pytest.approx((upper - 2 * middle + lower) / step**2)


def test_variance_grows_towards_that_of_the_prior(rows: Array) -> None:
    layout = JointLayout(3, 2, 0)
    carry = run(rows, np.zeros(2))[0][-1].copy()
    scan, row = joint.joint_step(MODEL, SCALING.logarithmic, 2), np.zeros(rows.shape[1] + 2)
    row[0] = 0.01
    sample, output = np.tile(row, (2, 1)), np.empty((2, scan.n_output))
    constant = joint.constants(C, NOISE, SCALING, np.array([0.0, 3.0]))
    before = unpack_array(carry[0, layout.Pz], 2)
    scan.single(1, 2, *[a.ctypes.data for a in (carry, sample, constant, output)])
    growth = unpack_array(carry[0, layout.Pz], 2) - before
    np.testing.assert_allclose(growth, np.diag([0.0, 0.03 * (1 - before[1, 1])]), atol=1e-15)


@pytest.mark.parametrize("bad", [np.nan, np.inf, 1e200])
def test_diverged_state_is_reported_and_changes_no_parameter(rows: Array, bad: float) -> None:
    rows[:, 4:] = 1.0
    layout = JointLayout(3, 2, 0)
    scan = joint.joint_step(MODEL, SCALING.logarithmic, 2)
    carry = run(rows, np.zeros(2))[0][-1].copy()
    z, Pz = carry[:, layout.z].copy(), carry[:, layout.Pz].copy()
    carry[:, 0] = bad
    sample = np.tile(np.concatenate([rows[0], np.zeros(2)]), (2, 1))
    constant, output = joint.constants(C, NOISE, SCALING, np.zeros(2)), np.empty((2, scan.n_output))
    scan.single(1, 2, *[a.ctypes.data for a in (carry, sample, constant, output)])
    assert (output[:, -1] == 1.0).all()
    assert np.isfinite(carry).all()
    np.testing.assert_array_equal(carry[:, layout.z], z)
    np.testing.assert_array_equal(carry[:, layout.Pz], Pz)


def test_an_estimate_that_is_not_a_number_is_not_taken_over(rows: Array) -> None:
    """A step of NaN seconds makes the state NaN; the estimate stays, and the output says so."""
    layout = JointLayout(3, 1, 1)
    before = run(rows, np.zeros(1), 1)[0][-1]
    broken = rows[:1].copy()
    broken[0, 0] = np.nan
    carries, outputs = run(np.vstack([rows, broken]), np.zeros(1), 1)
    np.testing.assert_array_equal(carries[-1][:, layout.estimate], before[:, layout.estimate])
    assert (outputs[-1, :, -1] == 1.0).all()


REPORT = example(
    lambda x, dt, d, p, c: x,
    lambda x, d, p, c: ca.vertcat(p[0] * x[0] * x[1] + c[0] * p[1] ** 2, d[0] * x[1], p[0] * p[1] * x[0]),
    x=2,
    d=1,
    p=2,
    c=1,
)


def test_sigma_of_reported_signals_contains_all_unknowns() -> None:
    """Of the first states, with P, Pz and B of a joint covariance of [x, z, c] that is built from them.

    One unknown is estimated, the other is considered and stays at 0.
    """
    rng, scaling = np.random.default_rng(8), Scaling(**(vars(SCALING) | {"logarithmic": (True, False)}))
    layout, step = JointLayout(3, 1, 1), joint.state_view(MODEL, REPORT, scaling.logarithmic, 1)
    x, z, d = rng.normal(size=3), rng.normal(size=1), rng.normal(size=1)
    root, V, B, Pz = rng.normal(size=(3, 3)), rng.normal(size=(3, 2)), rng.normal(size=(1, 1)), np.array([[0.7]])
    carry = np.zeros(layout.size)
    parts = {"x": x, "P": pack_array(root @ root.T), "V": V.ravel(order="F"), "z": z, "Pz": pack_array(Pz), "B": B[0]}
    for name, values in parts.items():
        carry[getattr(layout, name)] = values
    _, (output,) = step(carry, d[None], np.concatenate([C, scaling.centre, scaling.scale, [4.0]]))

    def reported(v: Array) -> Array:
        return np.array(REPORT.observation(v[:2], d, scaling.to_p(v[3:]), C)).ravel()

    at = np.concatenate([x, z, [0.0]])
    slopes = np.column_stack([(reported(at + h) - reported(at - h)) / 2e-5 for h in 1e-5 * np.eye(5)])
    errors = np.block(  # of x, z and c by independent errors of the state, of z and of c
        [
            [np.eye(3), V[:, :1], V[:, :1] @ B + V[:, 1:]],
            [np.zeros((1, 3)), np.eye(1), B],
            [np.zeros((1, 4)), np.eye(1)],
        ]
    )
    independent = np.block(
        [[root @ root.T, np.zeros((3, 2))], [np.zeros((1, 3)), Pz, np.zeros((1, 1))], [np.zeros((1, 4)), np.eye(1)]]
    )
    expected = slopes @ errors @ independent @ errors.T @ slopes.T
    np.testing.assert_allclose(output[::2], reported(at), rtol=1e-12)
    np.testing.assert_allclose(output[1::2], 2 * np.sqrt(np.diag(expected)), rtol=1e-6)
