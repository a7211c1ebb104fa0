"""Steps of matrices against CasADi, which evaluates the same step."""

import copy
from collections.abc import Callable

import casadi as ca
import numpy as np
import pytest

from fifthwheel.base.native import Scan
from tests.base.native.conftest import Array

SIZES = (1, 8, 37)


def compare(results: Callable[..., list[ca.MX]], *sizes: int, samples: int = 3) -> None:
    """A scan of a step (carry, sample, constant) of these sizes to results, the first of them the next carry."""
    arguments = [ca.MX.sym(name, size) for name, size in zip(("carry", "sample", "constant"), sizes, strict=True)]
    carry, *outputs = results(*arguments)
    step = ca.Function("step", arguments, [ca.densify(carry), ca.densify(ca.vertcat(*map(ca.vec, outputs)))])
    rng = np.random.default_rng(5)
    values, rows, constant = rng.normal(size=sizes[0]), rng.normal(size=(samples, sizes[1])), rng.normal(size=sizes[2])
    last, found = Scan(step, matrices=True)(values, rows, constant)
    expected: ca.DM = ca.DM(values)
    for row, output in zip(rows, found, strict=True):
        expected, of_row = step(expected, row, constant)
        np.testing.assert_allclose(output, np.array(of_row).ravel(), rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(last, np.array(expected).ravel(), rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("rows", SIZES)
@pytest.mark.parametrize(("terms", "columns"), [(1, 1), (26, 3)])
def test_products(rows: int, terms: int, columns: int) -> None:
    def results(carry: ca.MX, sample: ca.MX, constant: ca.MX) -> list[ca.MX]:
        x, y = ca.reshape(carry, rows, terms), ca.reshape(sample, terms, columns)
        z = ca.reshape(constant, rows, columns)
        return [carry / 2, x @ y, z - x @ y, ca.mac(x, y, z), (x @ y).T @ z]

    compare(results, rows * terms, terms * columns, rows * columns)


@pytest.mark.parametrize("size", SIZES)
def test_elements_and_sums(size: int) -> None:
    def results(carry: ca.MX, sample: ca.MX, constant: ca.MX) -> list[ca.MX]:
        first, large = sample[0], ca.sumsqr(carry) > 1e6
        return [
            ca.if_else(large, 0, 0.9 * carry + ca.fmin(ca.fmax(sample, -1), constant) / (1 + first**2)),
            ca.sqrt(sample**2) - ca.exp(-ca.fabs(carry)) / constant,
            ca.mmin(constant),
            ca.dot(sample, constant),
            ca.logic_or(large, ca.logic_not(first < 0)),
            ca.sum1(sample),
        ]

    compare(results, size, size, size)


def test_places_of_elements() -> None:
    """Transposed, sliced, sparse and stacked matrices, and constants."""
    lower, numbers = ca.Sparsity.lower(6), ca.DM(np.arange(36.0).reshape(6, 6))

    def results(carry: ca.MX, sample: ca.MX, constant: ca.MX) -> list[ca.MX]:
        matrix = ca.reshape(carry, 6, 6)
        return [
            ca.vec(matrix.T),
            matrix[1:4, 2:5],
            matrix[:, ::2],
            ca.diag(matrix),
            ca.densify(ca.diag(sample)) @ numbers,
            ca.densify(ca.MX(lower, constant)),
            ca.densify(ca.diagcat(matrix, 2 * ca.MX.eye(3))),
            ca.horzcat(sample, matrix, ca.MX.ones(6)),
        ]

    compare(results, 36, 6, 21)


def test_parts_of_the_carry_that_change_places() -> None:
    """The last carry is read before any part of the next one is written, and a product overwrites no factor."""

    def squares(carry: ca.MX, sample: ca.MX, _: ca.MX) -> list[ca.MX]:
        square = 0.5 * ca.reshape(carry, 5, 5)
        return [ca.vec(ca.mac(square, square, square)) / 4, sample]

    compare(squares, 25, 1, 1)
    compare(lambda carry, *_: [ca.vertcat(carry[20:], carry[:10], carry[10:20] * carry[20:]), carry[0]], 30, 1, 1)


def test_functions_of_single_elements() -> None:
    x, y = ca.SX.sym("x", 3), ca.SX.sym("y", 2)
    f = ca.Function("f", [x, y], [ca.vertcat(ca.sin(x[0]) * y[0], x[2] / y[1]), ca.jacobian(x**2 * y[0], x)])

    same_name = ca.Function("f", [y], [2 * y])

    def results(carry: ca.MX, sample: ca.MX, constant: ca.MX) -> list[ca.MX]:
        (value, slope), (again, _) = f(carry[1:], sample), f(ca.MX.ones(3), constant)
        return [carry / 3, value, ca.densify(slope), again, same_name(sample), f(carry[:3], sample)[0]]

    compare(results, 4, 2, 2)


def test_matrices_without_elements() -> None:
    x, y = ca.SX.sym("x", 3), ca.SX.sym("y", 0)
    f = ca.Function("f", [x, y], [2 * x, y])

    def results(carry: ca.MX, sample: ca.MX, constant: ca.MX) -> list[ca.MX]:
        empty = ca.reshape(constant, 3, 0)
        value, nothing = f(carry, constant)
        return [carry / 2, value, nothing, sample.T @ empty, ca.sumsqr(empty) + sample]

    compare(results, 3, 3, 0)


def test_groups_are_independent_and_a_copy_is_compiled_again() -> None:
    carry, sample, constant = ca.MX.sym("carry", 9), ca.MX.sym("sample", 3), ca.MX.sym("constant", 3)
    matrix = ca.reshape(carry, 3, 3)
    step = ca.Function("step", [carry, sample, constant], [carry / 2, matrix @ sample + constant])
    scan, rng = Scan(step, matrices=True), np.random.default_rng(1)
    carries, rows, constants = rng.normal(size=(2, 9)), rng.normal(size=(2, 4, 3)), rng.normal(size=(2, 3))
    last, found = copy.deepcopy(scan).batch(carries, rows, constants)
    for i in range(2):
        alone: tuple[Array, Array] = scan(carries[i], rows[i], constants[i])
        np.testing.assert_array_equal(last[i], alone[0])
        np.testing.assert_array_equal(found[i], alone[1])


def test_what_cannot_be_compiled_is_refused() -> None:
    carry, none = ca.MX.sym("carry", 9), ca.MX.sym("none", 0)
    matrix = ca.reshape(carry, 3, 3)
    for result in (ca.solve(matrix, carry[:3]), ca.MX(ca.Sparsity.lower(3), carry[:6]) @ carry[:3]):
        step = ca.Function("step", [carry, none, none], [carry, ca.densify(result)])
        with pytest.raises(NotImplementedError, match="step: "):
            Scan(step, matrices=True)(np.ones(9), np.empty((1, 0)), np.empty(0))
