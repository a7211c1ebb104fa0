"""The tyre model against another implementation, its coefficient file, and general properties of tyres."""

import math
import os
import re
from dataclasses import fields
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from fifthwheel.model.plant import MagicFormula

DATA = Path(os.environ.get("FIFTHWHEEL_DATA", Path(__file__).resolve().parents[4] / "shared" / "data")) / "tyres"
TYRE = MagicFormula()
LOADS = np.array([10, 20, 30, 35, 40, 50]) * 1e3
SLIP = np.linspace(-0.3, 0.3, 61)


def numbers(values: object) -> np.ndarray:
    return np.array(ca.DM(values)).ravel()


def read_coefficients(text: str) -> dict[str, float]:
    """Coefficients of a tyre file by name."""
    return {name: float(value) for name, value in re.findall(r"^(\w+)\s*=\s*([-+.\deE]+)", text, re.MULTILINE)}


def test_cornering_stiffness_and_relaxation_length_equal_those_of_another_implementation():
    """Results of an independent PAC2002 with the same coefficients, N/rad and m, at 10 to 50 kN."""
    stiffness = np.array([61.3, 119.9, 173.7, 198.2, 220.9, 260.7]) * 1e3
    relaxation = np.array([0.148, 0.286, 0.403, 0.454, 0.497, 0.567])
    np.testing.assert_allclose(TYRE.cornering_stiffness(LOADS), stiffness, rtol=1e-3)
    np.testing.assert_allclose(TYRE.relaxation_length(LOADS), relaxation, atol=6e-4)


@pytest.mark.skipif(not DATA.is_dir(), reason="the tyre files are not available")
def test_coefficients_equal_those_of_the_file():
    text = (DATA / "CityBus_Pac02Tire.tir").read_text(encoding="latin-1")
    coefficients = read_coefficients(text)
    coefficients["R0"] = coefficients["UNLOADED_RADIUS"]
    for field in fields(TYRE):
        assert getattr(TYRE, field.name) == coefficients[field.name], field.name


@pytest.mark.skipif(not DATA.is_dir(), reason="the tyre files are not available")
def test_cornering_stiffness_of_a_second_tyre():
    """A 335/65 R 22.5, from its file: 76, 145, 200, 240, 266 kN/rad at 10 to 50 kN."""
    text = (DATA / "335_65R22_5_G275MSA_95psi.tir").read_text(encoding="latin-1")
    coefficients = read_coefficients(text)
    second = MagicFormula(**{name: coefficients[name] for name in ("FNOMIN", "PKY1", "PKY2")})
    expected = np.array([76, 145, 200, 240, 266]) * 1e3
    np.testing.assert_allclose(second.cornering_stiffness(np.array([10, 20, 30, 40, 50]) * 1e3), expected, rtol=0.05)


@pytest.mark.parametrize("load", LOADS)
def test_side_force(load: float):
    force = numbers(TYRE.side_force(ca.DM(SLIP), load))
    np.testing.assert_allclose(force, -force[::-1], atol=1e-9 * load)  # no shifts
    slope = float(TYRE.side_force(1e-6, load)) / 1e-6
    assert slope == pytest.approx(TYRE.cornering_stiffness(load), rel=1e-5)
    assert np.abs(force).max() <= (TYRE.PDY1 + TYRE.PDY2 * (load / TYRE.FNOMIN - 1)) * load * (1 + 1e-12)


def test_factors_combined_slip_and_trail():
    soft, slippery = TYRE.side_force(1e-6, 3e4, stiffness=1.3), TYRE.side_force(0.3, 3e4, friction=0.5)
    assert float(soft) == pytest.approx(1.3 * float(TYRE.side_force(1e-6, 3e4)), rel=1e-5)
    assert float(slippery) == pytest.approx(0.5 * float(TYRE.side_force(0.3, 3e4)), rel=0.05)
    assert float(TYRE.side_force(0.05, 3e4, longitudinal=0.1)) < float(TYRE.side_force(0.05, 3e4))
    alone = float(TYRE.longitudinal_force(0.05, 3e4))
    assert 0 < float(TYRE.longitudinal_force(0.05, 3e4, lateral=0.1)) < alone
    stiffness = TYRE.PKX1 + TYRE.PKX2 * (3e4 / TYRE.FNOMIN - 1)
    stiffness *= 3e4 * math.exp(TYRE.PKX3 * (3e4 / TYRE.FNOMIN - 1))
    assert float(TYRE.longitudinal_force(1e-7, 3e4)) / 1e-7 == pytest.approx(stiffness, rel=1e-4)
    assert 0.03 < float(TYRE.pneumatic_trail(0.0, 3.5e4)) < 0.06
    assert float(TYRE.pneumatic_trail(0.2, 3.5e4)) < 0.015
