import numpy as np
import pint
import pytest

from fifthwheel.errors import SignalError
from fifthwheel.logs.names import QUANTITIES, header, si_unit, split_header
from fifthwheel.logs.units import _TABLE, factor, quantity


@pytest.mark.parametrize(
    ("si", "unit"),
    [(si, unit) for si in _TABLE for unit in _TABLE[si] if unit not in ("g", "mg", "%", "kg", "t", "daN")],
)
def test_the_table_agrees_with_pint(si, unit):
    assert factor(unit, si) == pytest.approx(
        pint.application_registry.Quantity(1.0, unit).to("" if si == "1" else si).magnitude
    )


@pytest.mark.parametrize(
    ("unit", "si", "expected"),
    [
        ("°/s", "rad/s", np.pi / 180),
        ("deg/sec", "rad/s", np.pi / 180),
        ("m/s²", "m/s^2", 1),
        ("m/s2", "m/s^2", 1),
        ("m/s**2", "m/s^2", 1),
        ("g", "m/s^2", 9.80665),
        ("knot", "m/s", 1852 / 3600),
        ("gradian", "rad", np.pi / 200),
        ("%", "1", 0.01),
        ("kg", "N", 9.80665),
        ("t", "N", 9806.65),
        ("daN", "N", 10),
    ],
)
def test_other_spellings_and_rarer_units(unit, si, expected):
    assert factor(unit, si) == pytest.approx(expected)


@pytest.mark.parametrize(
    ("unit", "si"), [("deg", "m/s"), ("kg", "s"), ("furlongs of rope", "m"), ("((", "m"), ("", "rad/s")]
)
def test_units_that_do_not_fit(unit, si):
    with pytest.raises(SignalError, match="expected one of"):
        factor(unit, si)


def test_quantities_in_words():
    assert quantity("200 ms", "s") == pytest.approx(0.2)
    assert quantity("-1e-1deg", "rad") == pytest.approx(-np.pi / 1800)
    assert quantity("3", "s") == quantity(3, "s") == 3.0
    with pytest.raises(SignalError, match=r"something like '0\.2 s'"):
        quantity("soon", "s")


def test_every_quantity_has_a_unit_of_the_table():
    assert set(QUANTITIES.values()) <= set(_TABLE)
    assert header("reference.roll.tractor") == "reference.roll.tractor [rad]"
    assert split_header(" yaw_rate.tractor [deg/s] ") == ("yaw_rate.tractor", "deg/s")
    assert split_header("a [b] c") == ("a [b] c", None)
    assert si_unit("yaw_rate") is None
