"""Equations (8) and (9) against integrals, for floats, arrays and symbols."""

from typing import Any

import casadi
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fifthwheel.vehicle import Vehicle, catalogue, laden, laden_cog_height, laden_roll_inertia

ARTICLE = catalogue.get("cheng_cebon_2011")
LENGTH = st.floats(0.1, 3.0)


@given(mass=st.floats(1e2, 1e5), height=LENGTH, width=LENGTH, floor=LENGTH, axis=LENGTH)
def test_inertia_of_a_uniform_block_is_the_sum_over_its_elements(
    mass: float, height: float, width: float, floor: float, axis: float
) -> None:
    n = 200
    y = (np.arange(n) + 0.5) / n * width - width / 2
    z = (np.arange(n) + 0.5) / n * height + floor
    elements = mass / n**2 * (y[:, None] ** 2 + (z[None, :] - axis) ** 2)
    block = laden_roll_inertia(
        roll_inertia=0.0,
        payload_mass=mass,
        payload_height=height,
        payload_width=width,
        floor_height=floor,
        roll_axis_height=axis,
    )
    assert block == pytest.approx(elements.sum(), rel=1e-4)


def test_point_payload_has_no_inertia_of_its_own() -> None:
    values: dict[str, Any] = {
        "roll_inertia": 0.0,
        "payload_mass": 2.0,
        "payload_height": 2.0,
        "payload_width": 3.0,
        "floor_height": 1.0,
    }
    assert laden_roll_inertia(**values, roll_axis_height=2.0, uniform=False) == 0.0
    assert laden_roll_inertia(**values, roll_axis_height=2.0) == pytest.approx(2 * (9 + 4) / 12, rel=1e-15)


def test_cog_height_is_the_mass_weighted_mean() -> None:
    assert laden_cog_height(mass=1.0, cog_height=1.0, payload_mass=3.0, payload_height=2.0, floor_height=1.0) == 1.75


def test_arrays() -> None:
    heights = np.linspace(0.1, 2, 5)
    p = {path: np.full(5, value) for path, value in ARTICLE.parameters().items()} | {
        "semitrailer.payload.height": heights
    }
    body = laden(p, ARTICLE.unit("semitrailer"))
    for i, height in enumerate(heights):
        derived = ARTICLE.replace({"semitrailer.payload.height": height}).derived()
        assert body.cog_height[i] == pytest.approx(derived["semitrailer.cog_height"], rel=1e-14)
        assert body.roll_inertia[i] == pytest.approx(derived["semitrailer.roll_inertia"], rel=1e-14)


@pytest.mark.parametrize("vehicle", [catalogue.get(name) for name in catalogue.names()], ids=catalogue.names())
def test_symbols(vehicle: Vehicle) -> None:
    p = vehicle.parameters()
    symbols = {path: casadi.SX.sym(path) for path in p}
    for unit in vehicle.units:
        evaluate = casadi.Function("laden", list(symbols.values()), list(laden(symbols, unit)))
        assert [float(value) for value in evaluate(*p.values())] == pytest.approx(list(laden(p, unit)), rel=1e-14)
