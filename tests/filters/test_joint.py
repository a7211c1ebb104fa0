"""The joint filter against the Kalman filter of the augmented state [x, z]."""

import casadi as ca
import numpy as np
import pytest

from fifthwheel._types import Array
from fifthwheel.filters import Noise, joint
from fifthwheel.filters.dual import Scaling
from fifthwheel.filters.model import pack_array, unpack_array
from tests.filters.examples import example

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


def run(rows: Array, free: Array, base: Array) -> tuple[Array, Array]:
    """Carries (N, n_carry, LANES) and outputs after every row, from x = 0, z = 0 with covariance 1."""
    layout = joint.Layout(3, 2)
    scan = joint.joint_step(MODEL, SCALING.logarithmic)
    carry = np.concatenate([np.zeros(3), pack_array(np.eye(3)), np.zeros(2), pack_array(np.eye(2)), np.zeros(6)])
    carry = np.column_stack([carry, carry])
    assert len(carry) == layout.size
    constant = joint.constants(C, NOISE, SCALING, free)
    samples = np.repeat(np.column_stack([rows, np.tile(base, (len(rows), 1))])[:, :, None], 2, axis=2).copy()
    carries, outputs = [], []
    for sample in samples:
        output = np.empty((scan.n_output, 2))
        scan.vector(1, 1, *[a.ctypes.data for a in (carry, sample, constant, output)])
        carries.append(carry.copy())
        outputs.append(output)
    return np.array(carries), np.array(outputs)


def augmented(carry: Array) -> tuple[Array, Array]:
    """Mean and covariance of [x, z]."""
    layout = joint.Layout(3, 2)
    V = carry[layout.V].reshape(3, 2, order="F")
    Pz = unpack_array(carry[layout.Pz], 2)
    P = unpack_array(carry[layout.P], 3) + V @ Pz @ V.T
    return np.concatenate([carry[layout.x], carry[layout.z]]), np.block([[P, V @ Pz], [Pz @ V.T, Pz]])


def test_equals_the_kalman_filter_of_the_augmented_state_with_optional_learning(rows: Array) -> None:
    mean, P = np.zeros(5), np.eye(5)
    Q = np.zeros((5, 5))
    Q[:3, :3] = NOISE.process
    carries, _ = run(rows, np.ones(2), np.zeros(2))
    for row, carry in zip(rows, carries, strict=True):
        F, b, H, e = linear(row[0], row[1])
        mean, P = F @ mean + b, F @ P @ F.T + Q * row[0]
        for i in range(2):
            if row[4 + i]:
                h, r = H[i], NOISE.measurement[i]
                gain = P @ h / (h @ P @ h + r)
                gain[3:] *= row[6]
                mean = mean + gain * (row[2 + i] - h @ mean - e[i])
                left = np.eye(5) - np.outer(gain, h)
                P = left @ P @ left.T + r * np.outer(gain, gain)
        actual, covariance = augmented(carry[:, 0])
        np.testing.assert_allclose(actual, mean, atol=1e-12)
        np.testing.assert_allclose(covariance, P, atol=1e-12)


def test_linearisation_point_has_no_effect_on_a_linear_model(rows: Array) -> None:
    carries, outputs = run(rows, np.ones(2), np.array([1.7, -0.6]))
    np.testing.assert_allclose(carries[:, :, 1], carries[:, :, 0], atol=1e-12)
    np.testing.assert_allclose(outputs[..., 1], outputs[..., 0], atol=1e-12)


def test_considered_parameter_keeps_its_value_and_its_variance(rows: Array) -> None:
    rows[:, 6] = 1.0
    carries, _ = run(rows, np.array([1.0, 0.0]), np.zeros(2))
    layout = joint.Layout(3, 2)
    mean, covariance = augmented(carries[-1, :, 0])
    assert mean[4] == 0.0
    assert covariance[4, 4] == 1.0
    without_parameters = unpack_array(carries[-1, layout.P, 0], 3)
    assert (np.diag(covariance)[:3] > np.diag(without_parameters)).all()
    assert (np.linalg.eigvalsh(covariance) > 0).all()


@pytest.mark.parametrize("bad", [np.nan, np.inf, 1e200])
def test_diverged_state_is_reported_and_changes_no_parameter(rows: Array, bad: float) -> None:
    rows[:, 4:] = 1.0
    layout = joint.Layout(3, 2)
    scan = joint.joint_step(MODEL, SCALING.logarithmic)
    carry = run(rows, np.ones(2), np.zeros(2))[0][-1].copy()
    z, Pz = carry[layout.z].copy(), carry[layout.Pz].copy()
    carry[0] = bad
    sample = np.repeat(np.concatenate([rows[0], np.zeros(2)])[:, None], 2, axis=1).copy()
    constant, output = joint.constants(C, NOISE, SCALING, np.ones(2)), np.empty((scan.n_output, 2))
    scan.vector(1, 1, *[a.ctypes.data for a in (carry, sample, constant, output)])
    assert (output[-1] == 1.0).all()
    assert np.isfinite(carry).all()
    np.testing.assert_array_equal(carry[layout.z], z)
    np.testing.assert_array_equal(carry[layout.Pz], Pz)
