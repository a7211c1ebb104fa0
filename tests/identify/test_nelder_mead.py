"""The simplex search, compared with SciPy."""

from collections.abc import Callable

import numpy as np
import pytest
from scipy.optimize import minimize, rosen

from fifthwheel._types import Array
from fifthwheel.identify.nelder_mead import nelder_mead


def kinked(x: Array) -> float:
    """With minima at which the simplex shrinks."""
    return float(np.abs(x - np.array([0.3, -1.0, 2.0])).sum() + np.floor(4 * x[0]))


@pytest.mark.parametrize("function", [rosen, kinked])
@pytest.mark.parametrize("iterations", [3, 400])
def test_every_step_is_that_of_scipy(function: Callable[[Array], float], iterations: int) -> None:
    simplex = np.array([-1.2, 1.0, 0.7]) + 0.5 * np.eye(4, 3)
    options = {"xatol": 1e-2, "fatol": 1e-2, "maxiter": iterations, "initial_simplex": simplex}
    expected = minimize(function, simplex[0], method="Nelder-Mead", options=options)
    best = nelder_mead(function, simplex, tolerance=1e-2, iterations=iterations)
    assert best.x.tolist() == expected.x.tolist()
    assert best.value == expected.fun
