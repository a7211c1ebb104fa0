"""The compiled derivatives by the reverse mode, in single precision, against CasADi's interpreter."""

import copy
import pickle

import casadi as ca
import numpy as np
import pytest

from fifthwheel.base.native import AdjointScan


def symbols() -> tuple[ca.SX, ca.SX, ca.SX]:
    """Carry [position, speed, discrepancies (2), a counter], sample, and constants, of which two are differentiated."""
    return ca.SX.sym("carry", 5), ca.SX.sym("sample", 3), ca.SX.sym("constant", 4)


def plain(carry: ca.SX, sample: ca.SX, k: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX, ca.SX]:
    """Later state, error at a constant discrepancy, later discrepancy, and error, of a pendulum."""
    x, d = carry[:2], carry[2:4]
    force = k[0] * ca.sin(x[0]) + k[1] * x[1] / (1 + sample[0] ** 2)
    later = ca.vertcat(x[0] + 0.05 * x[1], x[1] - 0.05 * force)
    seen = sample[1:] - ca.vertcat(later[0] * k[1], ca.fmax(x[0], k[0]))
    error = seen - k[2] * d
    return later, seen, k[2] * d + k[3] * error, error


def pendulum() -> ca.Function:
    carry, sample, k = symbols()
    later, seen, discrepancy, error = plain(carry, sample, k)
    seed, both = ca.SX.sym("seed", 4), ca.vertcat(carry[:2], k[:2])
    adjoint = ca.jtimes(ca.vertcat(later, seen), both, seed, True)
    ones = ca.SX.ones(2)
    results = [
        ca.vertcat(later, discrepancy, carry[4] + 1),
        ca.vertcat(error, carry[4], k[2] * ones, k[2] * ones, k[3] * ones),
        ca.SX(0, 1),
        adjoint,
    ]
    arguments = [carry, sample, k, ca.SX.sym("nothing", 0), seed]
    return ca.Function("pendulum", arguments, [ca.densify(result) for result in results])


def random_arguments(samples: int, directions: int) -> list[np.ndarray]:
    rng = np.random.default_rng(samples + directions)
    sparse = rng.normal(size=(directions, 2)) * (rng.random((directions, 2)) < 0.7)
    constant = np.array([1.5, 0.3, 0.7, 0.2])
    return [rng.normal(size=5), rng.normal(size=(samples, 3)), constant, rng.normal(size=(directions, 4)), sparse]


@pytest.mark.parametrize("threads", [1, 3])
@pytest.mark.parametrize("directions", [0, 1, 19])
@pytest.mark.parametrize("samples", [0, 1, 150])
def test_agrees_with_the_interpreter(samples: int, directions: int, threads: int) -> None:
    carry, sample, k = symbols()
    later, _, discrepancy, error = plain(carry, sample, k)
    moving = ca.vertcat(later, discrepancy)
    by = ca.vertcat(carry[:4], k[:2])
    step = ca.Function("plain", [carry, sample, k], [moving, error, ca.jacobian(moving, by), ca.jacobian(error, by)])
    arguments = random_arguments(samples, directions)
    actual = AdjointScan(pendulum())(*arguments, threads=threads)
    state, rows, constant, slopes, constant_dot = arguments
    assert actual.output.shape == (samples, 3)
    assert actual.output_dot.shape == (samples, 2, directions)
    for row in range(samples):
        later, error, of_later, of_error = (np.array(part) for part in step(state, rows[row], constant))
        both = np.hstack([slopes, constant_dot]).T
        np.testing.assert_allclose(actual.output_dot[row], of_error @ both, rtol=1e-6, atol=1e-6)
        np.testing.assert_allclose(actual.output[row], [*error.ravel(), state[4]], rtol=1e-9, atol=1e-9)
        state, slopes = np.append(later.ravel(), state[4] + 1), (of_later @ both).T
    np.testing.assert_allclose(actual.carry, state, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(actual.carry_dot, slopes, rtol=1e-6, atol=1e-6)


def test_arguments_stay_as_they_are() -> None:
    arguments = random_arguments(40, 3)
    before = copy.deepcopy(arguments)
    AdjointScan(pendulum())(*arguments)
    for array, same in zip(arguments, before, strict=True):
        np.testing.assert_array_equal(array, same)


def test_other_shapes_and_steps_are_refused() -> None:
    carry, sample, *others = random_arguments(5, 2)
    with pytest.raises(TypeError, match=r"pendulum: expected an array of shape \(5,\), got \(4,\)"):
        AdjointScan(pendulum())(carry[:4], sample, *others)
    x = ca.SX.sym("x")
    with pytest.raises(TypeError, match="expected a step from"):
        AdjointScan(ca.Function("plain", [x], [x]))


def test_copies_compute_the_same() -> None:
    scan, arguments = AdjointScan(pendulum()), random_arguments(40, 3)
    expected = scan(*arguments)
    for other in (copy.copy(scan), copy.deepcopy(scan), pickle.loads(pickle.dumps(scan))):
        for actual, values in zip(other(*arguments), expected, strict=True):
            np.testing.assert_array_equal(actual, values)
