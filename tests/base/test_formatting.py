"""Rounding to the uncertainty, in display units."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fifthwheel.base.formatting import (
    approximate,
    digits,
    percent,
    plain_ascii,
    relative,
    seconds,
    value_and_sigma,
    with_sigma,
)


@pytest.mark.parametrize(
    ("value", "sigma", "expected"),
    [
        (475.31, 4.34, ("475.3", "4.3")),
        (413412.0, 2368.0, ("413\u202f400", "2\u202f400")),
        (1.2248, 0.0086, ("1.2248", "0.0086")),
        (1.0, 0.0996, ("1.00", "0.10")),
        (-0.02501, 0.0221, ("−0.025", "0.022")),
        (-0.0001, 0.1, ("0.00", "0.10")),
        (600.0, None, ("600", None)),
        (2.0, math.inf, ("2", None)),
    ],
)
def test_value_is_rounded_to_two_digits_of_its_sigma(value, sigma, expected):
    assert value_and_sigma(value, sigma) == expected


@given(st.floats(-1e8, 1e8), st.floats(1e-5, 1e8))
def test_rounding_moves_less_than_a_twentieth_of_sigma(value, sigma):
    shown, spread = value_and_sigma(value, sigma)
    read = [float(plain_ascii(text)) for text in (shown, spread)]
    assert abs(read[0] - value) <= 0.0501 * sigma + 1e-9 * abs(value)
    assert read[1] == pytest.approx(sigma, rel=0.051)


@pytest.mark.parametrize(
    ("value", "sigma", "unit", "expected"),
    [
        (475300.0, 4300.0, "N/rad", "475.3 ± 4.3 kN/rad"),
        (math.radians(1.05), math.radians(0.21), "rad/s", "1.05 ± 0.21 deg/s"),
        (0.049, 0.062, "s", "49 ± 62 ms"),
        (1.215, 0.064, "1", "1.215 ± 0.064"),
        (1.2, None, "m", "1.2 m"),
    ],
)
def test_display_units(value, sigma, unit, expected):
    assert with_sigma(value, sigma, unit) == expected
    assert plain_ascii(with_sigma(-413412.0, 2368.0, "kg m^2")) == "-413400 +- 2400 kg m^2"


def test_percent_and_missing_values():
    assert [percent(p) for p in (0.0043, 0.5, 1.0, 0.0)] == ["0.43 %", "50 %", "100 %", "0 %"]
    assert percent(0.9999, round_down=True) == "99.9 %"
    assert percent(math.nan) == digits(math.inf) == relative(1.0, None) == seconds(None) == "–"
    assert relative(0.1, 1.0) == "> 100 %"
    assert relative(-2.0, 0.1) == "5 %"
    assert approximate(math.radians(0.2), "rad") == "0.20 deg"
    assert digits(3e-12) == "3.000e-12"
