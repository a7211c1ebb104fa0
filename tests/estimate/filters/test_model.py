"""Layout of the vectors of a compiled step."""

import casadi as ca
import numpy as np
import pytest

from fifthwheel.estimate.filters import Noise, model, sample_rows
from tests.estimate.filters.examples import example


@pytest.mark.parametrize("n", [1, 2, 5])
def test_packed_matrices(n: int) -> None:
    """Arrays and symbols have the same order, and unpacking inverts packing."""
    half = np.random.default_rng(n).normal(size=(3, n, n))
    matrix = half + np.swapaxes(half, 1, 2)
    packed = model.pack_array(matrix)
    assert packed.shape == (3, model.packed_size(n))
    assert np.array_equal(model.unpack_array(packed, n), matrix)
    symbol = ca.SX.sym("m", n, n)
    by_symbol = ca.Function("pack", [symbol], [model.pack(symbol)])
    vector = ca.SX.sym("v", model.packed_size(n))
    back = ca.Function("unpack", [vector], [model.unpack(vector, n)])
    for k in range(3):
        assert np.array_equal(np.array(by_symbol(matrix[k])).ravel(), packed[k])
        assert np.array_equal(np.array(back(packed[k])), matrix[k])


def test_lower_triangle_is_packed() -> None:
    assert model.pack_array(np.array([[1, 9, 9], [2, 4, 9], [3, 5, 6]])).tolist() == [1, 2, 3, 4, 5, 6]


def test_split() -> None:
    pieces = model.split(ca.SX.sym("v", 6), [1, 0, 3, 2])
    assert [piece.numel() for piece in pieces] == [1, 0, 3, 2]
    assert str(pieces[2]) == "[v_1, v_2, v_3]"


def test_sizes() -> None:
    some = example(lambda x, dt, d, p, c: x, lambda x, d, p, c: ca.vertcat(x, d), x=3, d=4, p=2, c=1)
    assert model.sizes(some) == (3, 4, 2, 1, 7)


def test_sample_rows() -> None:
    rows = sample_rows(np.array([0.0, 0.1]), np.array([[1.0], [2.0]]), np.array([[np.nan, 5.0], [np.inf, -np.inf]]))
    assert rows.tolist() == [[0.0, 1, 0, 5, 0, 1], [0.1, 2, 0, 0, 0, 0]]


def test_noise() -> None:
    process = np.array([[1.0, 2.0], [2.0, 5.0]])
    noise = Noise(process=process, measurement=np.array([7.0]), gate=3.0)
    assert noise.vector().tolist() == [1, 2, 5, 7, 9]
    assert np.isfinite(Noise(process=process, measurement=np.array([7.0])).vector()).all()
