"""The simplex search, compared with SciPy."""

from collections.abc import Callable

import numpy as np
import pytest
from scipy.optimize import minimize, rosen

from fifthwheel.base.types import Array
from fifthwheel.estimate.filters.noise_model import nelder_mead


def rippled(x: Array) -> float:
    """With so many minima that the simplex shrinks several times."""
    return float(np.sum(x**2) + 3 * np.sin(25 * x).sum())


@pytest.mark.parametrize("function", [rosen, rippled])
@pytest.mark.parametrize("iterations", [3, 400])
def test_every_step_is_that_of_scipy(function: Callable[[Array], float], iterations: int) -> None:
    simplex = np.array([-1.2, 1.0, 0.7]) + 0.5 * np.eye(4, 3)
    options = {"xatol": 1e-2, "fatol": 1e-2, "maxiter": iterations, "initial_simplex": simplex}
    expected = minimize(function, simplex[0], method="Nelder-Mead", options=options)
    best = nelder_mead(function, simplex, tolerance=1e-2, iterations=iterations)
    assert best.x.tolist() == expected.x.tolist()
    assert best.value == expected.fun
