"""The compiled derivatives of small steps, by the forward and the reverse mode, against CasADi's interpreter."""

import copy
import pickle

import casadi as ca
import numpy as np
import pytest

from fifthwheel.base.native import AdjointScan, DirectionScan, GradientScan


def with_directions() -> ca.Function:
    """A pendulum whose derivatives are sums, differences, products, quotients and functions."""
    x, u, k = ca.SX.sym("x", 2), ca.SX.sym("u", 2), ca.SX.sym("k", 3)
    x_dot, k_dot = ca.SX.sym("x_dot", 2), ca.SX.sym("k_dot", 2)
    force = k[0] * ca.sin(x[0]) + k[1] * x[1] / (1 + u[0] ** 2) - ca.exp(-k[2]) * u[0] + x[0] / k[0]
    later = ca.vertcat(x[0] + u[1] * x[1], x[1] - u[1] * force)
    output = ca.vertcat(later[0] * k[1], ca.fmax(x[0], k[0]), 2 - later[1])
    results = ca.vertcat(later, output[:2])
    dots = ca.jtimes(results, ca.vertcat(x, k[:2]), ca.vertcat(x_dot, k_dot))
    arguments = [x, u, k, x_dot, k_dot]
    return ca.Function("pendulum", arguments, [ca.densify(r) for r in (later, output, dots[:2], dots[2:])])


@pytest.mark.slow
@pytest.mark.parametrize(("samples", "directions", "threads"), [(0, 8, 1), (1, 0, 1), (150, 1, 3), (50, 19, 3)])
def test_agrees_with_the_interpreter(
    samples: int, directions: int, threads: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("fifthwheel.base.native.directions.BUFFER", 1000)  # several passes
    rng, step = np.random.default_rng(samples + directions), with_directions()
    carry, constant = rng.normal(size=2), np.array([1.5, 0.3, 0.7])
    sample = np.column_stack([rng.normal(size=samples), np.full(samples, 0.01)])
    carry_dot, constant_dot = rng.normal(size=(directions, 2)), rng.normal(size=(directions, 2))
    scan = DirectionScan(step, lanes=4)
    actual = scan(carry, sample, constant, carry_dot, constant_dot, threads=threads)
    assert actual.output.shape == (samples, 3)
    assert actual.output_dot.shape == (samples, 2, directions)
    for row in range(samples):
        dots = []
        for j in range(directions):
            *_, later_dot, output_dot = step(carry, sample[row], constant, carry_dot[j], constant_dot[j])
            dots.append(np.array(later_dot).ravel())
            np.testing.assert_allclose(actual.output_dot[row, :, j], np.array(output_dot).ravel(), rtol=1e-9, atol=1e-9)
        later, output, *_ = step(carry, sample[row], constant, np.zeros(2), np.zeros(2))
        np.testing.assert_allclose(actual.output[row], np.array(output).ravel(), rtol=1e-9, atol=1e-9)
        carry, carry_dot = np.array(later).ravel(), np.array(dots).reshape(directions, 2)
    np.testing.assert_allclose(actual.carry, carry, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(actual.carry_dot, carry_dot, rtol=1e-9, atol=1e-9)


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


@pytest.mark.parametrize(("samples", "directions", "threads"), [(0, 19, 1), (1, 0, 1), (150, 1, 3), (150, 19, 3)])
def test_the_reverse_mode_agrees_with_the_interpreter(samples: int, directions: int, threads: int) -> None:
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


def weighed() -> ca.Function:
    """The gradient of a function of the errors of the pendulum by [position, speed, discrepancies, constants]."""
    carry, sample, k = symbols()
    later, _, discrepancy, error = plain(carry, sample, k)
    gradient, seed, moving = ca.SX.sym("gradient", 6), ca.SX.sym("seed", 2), ca.vertcat(later, discrepancy)
    before = ca.jtimes(ca.vertcat(moving, error), ca.vertcat(carry[:4], k[:2]), ca.vertcat(gradient[:4], seed), True)
    arguments = [carry, ca.vertcat(sample, seed), k, gradient, ca.SX.sym("nothing", 0)]
    results = [ca.vertcat(moving, carry[4] + 1), error, before + ca.vertcat(ca.SX(4, 1), gradient[4:]), ca.SX(0, 1)]
    return ca.Function("pendulum", arguments, [ca.densify(result) for result in results])


@pytest.mark.slow
@pytest.mark.parametrize("samples", [0, 1, 70])
def test_a_gradient_is_that_of_the_whole_record(samples: int) -> None:
    carry, sample, constant, *_ = random_arguments(samples, 0)
    start, _, k = symbols()
    state, total = start, ca.SX(0)
    for row in sample:
        later, _, discrepancy, error = plain(state, ca.SX(row), k)
        state, total = ca.vertcat(later, discrepancy, state[4]), total + ca.sum1(ca.sin(error))
    expected = ca.Function("total", [start, k], [ca.gradient(total, ca.vertcat(start[:4], k[:2]))])(carry, constant)
    before = carry.copy(), sample.copy()
    scan = GradientScan(weighed())
    for each in (scan, pickle.loads(pickle.dumps(scan))):
        actual = each(carry, sample, constant, np.cos)
        np.testing.assert_allclose(actual, np.array(expected).ravel(), rtol=1e-9, atol=1e-9)
    for array, same in zip((carry, sample), before, strict=True):
        np.testing.assert_array_equal(array, same)
    with pytest.raises(TypeError, match="pendulum: expected an array of shape"):
        scan(carry[:1], sample, constant, np.cos)


ONES = (np.ones(2), np.ones((5, 2)), np.ones(3), *np.ones((2, 3, 2)))
SCANS = [(DirectionScan, with_directions, ONES), (AdjointScan, pendulum, random_arguments(40, 3))]


@pytest.mark.parametrize(("kind", "step", "arguments"), SCANS)
def test_copies_compute_the_same_and_arguments_stay_as_they_are(kind, step, arguments) -> None:
    scan, before = kind(step()), copy.deepcopy(arguments)
    expected = scan(*arguments)
    for other in (copy.copy(scan), copy.deepcopy(scan), pickle.loads(pickle.dumps(scan))):
        for actual, values in zip(other(*arguments), expected, strict=True):
            np.testing.assert_array_equal(actual, values)
    for array, same in zip(arguments, before, strict=True):
        np.testing.assert_array_equal(array, same)


@pytest.mark.parametrize(("kind", "step", "arguments"), SCANS)
def test_other_shapes_and_steps_are_refused(kind, step, arguments) -> None:
    carry, *others = arguments
    with pytest.raises(TypeError, match=rf"pendulum: expected an array of shape \({len(carry)},\), got \(1,\)"):
        kind(step())(carry[:1], *others)
    x = ca.SX.sym("x")
    with pytest.raises(TypeError, match="expected a step from"):
        kind(ca.Function("plain", [x], [x]))
