"""Equations (8) and (9) against integrals, for floats, arrays and symbols."""

import casadi
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fifthwheel.truck import Laden, catalogue, laden

ARTICLE = catalogue.get("cheng_cebon_2011")
LENGTH = st.floats(0.1, 3.0)


def laden_with(shape: str, *, body: float, axis: float, **payload: float) -> Laden:
    """The semitrailer with a body of this mass and height 1 m, without a roll inertia of its own."""
    unit = ARTICLE.unit("semitrailer")
    assert unit.payload is not None
    unit = unit.model_copy(update={"payload": unit.payload.model_copy(update={"shape": shape})})
    own = {"sprung.mass": body, "sprung.cog_height": 1.0, "sprung.roll_inertia": 0.0, "roll_axis_height": axis}
    numbers = own | {f"payload.{key}": value for key, value in payload.items()}
    return laden({f"semitrailer.{key}": value for key, value in numbers.items()}, unit)


@settings(max_examples=20)
@given(mass=st.floats(1e2, 1e5), height=LENGTH, width=LENGTH, floor=LENGTH, axis=LENGTH)
def test_inertia_of_a_uniform_block_is_the_sum_over_its_elements(
    mass: float, height: float, width: float, floor: float, axis: float
) -> None:
    n = 200
    y = (np.arange(n) + 0.5) / n * width - width / 2
    z = (np.arange(n) + 0.5) / n * height + floor
    elements = mass / n**2 * (y[:, None] ** 2 + (z[None, :] - axis) ** 2)
    block = laden_with("uniform", body=0.0, axis=axis, mass=mass, height=height, width=width, floor_height=floor)
    assert block.roll_inertia == pytest.approx(elements.sum(), rel=1e-4)


def test_point_payload_has_no_inertia_of_its_own() -> None:
    """And the CoG height is the mean weighted by the masses."""
    body = laden_with("uniform", body=1.0, axis=0.5, mass=3.0, height=2.0, width=2.0, floor_height=1.0)
    assert body.cog_height == 1.75
    numbers = {"body": 0.0, "axis": 2.0, "mass": 2.0, "height": 2.0, "width": 3.0, "floor_height": 1.0}
    assert laden_with("point", **numbers).roll_inertia == 0.0
    assert laden_with("uniform", **numbers).roll_inertia == pytest.approx(2 * (9 + 4) / 12, rel=1e-15)


@pytest.mark.parametrize("name", ["cheng_cebon_2011", "a_double"])
def test_symbols(name: str) -> None:
    vehicle = catalogue.get(name)
    p = vehicle.parameters()
    symbols = {path: casadi.SX.sym(path) for path in p}
    for unit in vehicle.units:
        evaluate = casadi.Function("laden", list(symbols.values()), list(laden(symbols, unit)))
        assert [float(value) for value in evaluate(*p.values())] == pytest.approx(list(laden(p, unit)), rel=1e-14)
