"""The compiled derivatives of small steps against CasADi's interpreter."""

import copy
import pickle

import casadi as ca
import numpy as np
import pytest

from fifthwheel.base.native import DirectionScan


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


@pytest.mark.parametrize("threads", [1, 3])
@pytest.mark.parametrize("directions", [0, 1, 8, 19])
@pytest.mark.parametrize("samples", [0, 1, 150])
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


def test_arguments_stay_as_they_are() -> None:
    carry, dots = np.ones(2), np.ones((3, 2))
    DirectionScan(with_directions())(carry, np.ones((5, 2)), np.ones(3), dots, dots)
    assert (carry == 1).all()
    assert (dots == 1).all()


def test_other_shapes_and_steps_are_refused() -> None:
    scan = DirectionScan(with_directions())
    with pytest.raises(TypeError, match=r"pendulum: expected an array of shape \(2,\), got \(3,\)"):
        scan(np.ones(3), np.ones((5, 2)), np.ones(3), np.ones((1, 2)), np.ones((1, 2)))
    x = ca.SX.sym("x")
    with pytest.raises(TypeError, match="expected a step from"):
        DirectionScan(ca.Function("plain", [x], [x]))


def test_copies_compute_the_same() -> None:
    scan, arguments = DirectionScan(with_directions()), (np.ones(2), np.ones((5, 2)), np.ones(3), *np.ones((2, 3, 2)))
    expected = scan(*arguments)
    for other in (copy.copy(scan), copy.deepcopy(scan), pickle.loads(pickle.dumps(scan))):
        for actual, values in zip(other(*arguments), expected, strict=True):
            np.testing.assert_array_equal(actual, values)
