"""When a history has settled, against a direct search."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fifthwheel.estimate.identify.result.parts import ParameterHistory, settled_since


@given(st.integers(2, 60), st.integers(0, 10**6), st.sampled_from([0.001, 0.01, 0.1]))
def test_settled_since(length: int, seed: int, tolerance: float) -> None:
    rng = np.random.default_rng(seed)
    values = 5 + 3 * np.exp(-np.arange(length) / 8) + 0.05 * rng.normal(size=length)
    rows = [
        k
        for k in range(length)
        if np.abs(values[k:] - values[k:].mean()).max() <= tolerance * abs(values[k:].mean()) * (1 + 1e-12)
    ]
    assert settled_since(values, tolerance) == rows[0]


def history(values: list[float]) -> ParameterHistory:
    return ParameterHistory(
        names=("a",),
        time=np.arange(1.0, len(values) + 1),
        values=np.array(values)[:, None],
        sigma=np.full((len(values), 1), 0.1),
        starts=(0,),
    )


@pytest.mark.parametrize(
    ("values", "row"),
    [([3.0, 2.0] + 18 * [1.0], 2), (18 * [2.0] + [1.0, 1.0], 18), (19 * [2.0] + [1.0], None)],
)
def test_a_value_that_settles_in_the_last_tenth_has_not_settled(values: list[float], row: int | None) -> None:
    assert history(values).settled_row("a", 0.01) == row
    assert history([9.0, 9.0, *values]).settled_row("a", 0.01, first=2) == row
