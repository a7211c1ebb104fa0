"""Layout of the vectors of a compiled step."""

import casadi as ca
import numpy as np
import pytest

from fifthwheel.estimate.filters import model, sample_rows


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


def test_sample_rows() -> None:
    rows = sample_rows(np.array([0.0, 0.1]), np.array([[1.0], [2.0]]), np.array([[np.nan, 5.0], [np.inf, -np.inf]]))
    assert rows.tolist() == [[0.0, 1, 0, 5, 0, 1], [0.1, 2, 0, 0, 0, 0]]
