"""Units, against pint."""

import pint
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fifthwheel.base.errors import UnitError
from fifthwheel.base.units import _SYMBOLS, base_units, factor, is_unit, quantity, uncertain_quantity
from fifthwheel.data.channels import CHANNELS, header, si_unit, split_header

DIFFERENT = {"g", "-", "%", "degC", "C", "kn", "gon", "rev", "bit"} | {
    f"{p}g" for p in ("M", "k", "da", "c", "m", "u", "µ", "μ", "n")
}
"""Symbols that mean another thing in pint, or have another name there."""

BASE = {
    "time": "s",
    "length": "m",
    "mass": "kg",
    "angle": "rad",
    "cycle": "",
    "voltage": "V",
    "current": "A",
    "temperature": "K",
}


def test_symbols_agree_with_pint() -> None:
    registry = pint.application_registry
    for symbol in sorted(set(_SYMBOLS) - DIFFERENT):
        size, powers = _SYMBOLS[symbol]
        unit = " * ".join(f"{BASE[name]}**{power}" for name, power in powers.items() if BASE[name]) or "dimensionless"
        unit = "Hz" if "Hz" in symbol else "V" if unit == "V**1" else unit
        assert size == pytest.approx(registry.Quantity(1.0, symbol).to(unit).magnitude, rel=1e-12), symbol


def test_products_agree_with_pint() -> None:
    registry = pint.application_registry
    for unit, si in (
        ("km/h", "m/s"),
        ("deg/s**2", "rad/s^2"),
        ("kN*m*s/rad", "N m s/rad"),
        ("kN*m/(rad/s)", "N m s/rad"),
        ("1/km", "1/m"),
        ("m/s/min", "m/s^2"),
        ("kN/(deg/(m/s))/m", "N/rad/s"),
    ):
        expected = registry.Quantity(1.0, unit).to(si.replace(" ", " * ")).magnitude
        assert factor(unit, si) == pytest.approx(expected, rel=1e-12)


def test_other_spellings() -> None:
    spellings = {
        "rad/s": {"deg/s": ["°/s", "deg/sec", "Grad/s"]},
        "m/s^2": {"m/s^2": ["m/s²", "m/s2"], "g": ["G"]},
        "kg m^2": {"kg m^2": ["kg·m²"]},
        "N m/rad": {"kN m/rad": ["kNm/rad"], "N m/rad": ["N/rad m"]},
        "m/s": {"km/h": ["kph", "Km/h", " km / h "], "kn": ["knot", "kts"], "mph": ["Mph"]},
    }
    for si, units in spellings.items():
        for unit, others in units.items():
            for other in others:
                assert factor(other, si) == factor(unit, si), other


def test_symbols_of_vehicle_logs() -> None:
    """A mass is a weight where a force is expected; an angle may be left out unless strict."""
    sizes = {("g", "m/s^2"): 9.80665, ("mg", "m/s^2"): 9.80665e-3, ("%", "1"): 0.01, ("-", "1"): 1.0}
    sizes |= {("kg", "N"): 9.80665, ("t", "N"): 9806.65, ("daN", "N"): 10.0, ("1/s", "rad/s"): 1.0}
    assert {pair: factor(*pair) for pair in sizes} == pytest.approx(sizes, rel=1e-15)
    with pytest.raises(UnitError, match=r"expected rad/s or .*, got '1/s'"):
        factor("1/s", "rad/s", strict=True)


def test_a_unit_of_another_dimension_is_refused() -> None:
    for unit, si in (("deg", "m/s"), ("kg", "s"), ("Hz", "rad/s"), ("m", "m^2"), ("bar", "N")):
        with pytest.raises(UnitError, match="or a unit that converts to it, got"):
            factor(unit, si)
    assert base_units("N m s/rad") == {"kg": 1, "m": 2, "rad": -1, "s": -1}
    for other in ("km/h", "deg", "Hz", "furlong"):  # not coherent
        with pytest.raises(UnitError):
            base_units(other)


TOWERS = ("9**9**9**9 m/s", "m" * 41, "m" * 10**6, "(" * 40, "m/(nm6nm6nm6nm6nm6nm6nm6)", "Mm6Mm6Mm6Mm6Mm6Mm6Mm6Mm6Mm6")


@pytest.mark.parametrize(
    "text",
    ["", " ", "furlong", "((", "(m", "m)", "m//s", "m/", "/s", "m^^", "m^99", "m s^7", "2 m", "m;s", "m/0", *TOWERS],
)
def test_a_text_that_is_not_a_unit_is_refused(text: str) -> None:
    """At once, also a tower of powers, and sizes of 0 and infinity."""
    assert not is_unit(text)
    with pytest.raises(UnitError, match="expected a unit such as"):
        factor(text, "m")
    if text.strip():  # a number alone is in the SI unit
        with pytest.raises(UnitError):
            quantity(f"1 {text}", "m")


def test_quantities() -> None:
    assert quantity("200 ms", "s") == pytest.approx(0.2)
    assert quantity("-1e-1deg", "rad") == pytest.approx(-factor("deg", "rad") / 10)
    assert quantity("3", "s") == quantity(3, "s") == 3.0
    for wrong in ("soon", "1 2 s", "1" * 200, None, [1.0], True):
        with pytest.raises(UnitError, match=r"expected a number with a unit such as '1 s'|expected a unit"):
            quantity(wrong, "s")  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("text", "value", "sigma"),
    [
        (5, 5.0, None),
        ("5 t", 5e3, None),
        ("5 t exact", 5e3, 0.0),
        ("-5 +- 2", -5.0, 2.0),
        ("-5 t +- 2 %", -5e3, 100.0),
        ("5 t+-200 kg", 5e3, 200.0),
        ("5 t ±0.2t", 5e3, 200.0),
        ("5 t +/- 2%", 5e3, 100.0),
        ("5 +- 2 kg", 5.0, 2.0),
        ("0 kg +- 3 kg", 0.0, 3.0),
        ("5 kg +- 0 kg", 5.0, 0.0),
    ],
)
def test_uncertain_quantities(text: str | float, value: float, sigma: float | None) -> None:
    assert uncertain_quantity(text, "kg") == (value, sigma if sigma is None else pytest.approx(sigma, rel=1e-15))


def test_a_number_without_a_unit_is_refused_where_one_is_needed() -> None:
    assert uncertain_quantity("8 t +- 2 %", "kg", unit_needed=True) == (8000.0, 160.0)
    assert uncertain_quantity("0", "kg", unit_needed=True) == (0.0, None)
    with pytest.raises(UnitError, match=r"expected a number with a unit such as '1 kg', got '8 exact'; add its unit"):
        uncertain_quantity("8 exact", "kg", unit_needed=True)
    assert uncertain_quantity("0 +- 0.2 t", "kg") == (0.0, 200.0)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("7 kg +- 1e999 kg", r"after '\+-': expected a finite standard deviation"),
        ("7 kg +- 2 % exact", r"expected one '\+- \.\.\.' or 'exact' at the end, .* keep only one"),
        ("7 kg exact 2 %", r"expected one '\+- \.\.\.' or 'exact' at the end"),
        ("7 kg +- ", r"after '\+-': expected a number with a unit such as '1 kg', got ''"),
        ("+- 2 kg", "expected a number with a unit such as '1 kg', got ''"),
        ("5 +- 0.2 t", r"expected a unit of the value too, got '5 \+- 0.2 t'; write '5 t \+- 0.2 t'"),
        *(
            (text, "expected a decimal point, and no separator of thousands, got ")
            for text in ("7,6 kg", "7.6 kg +- 0,1 kg")
        ),
    ],
)
def test_wrong_statements_are_refused(text: str, message: str) -> None:
    with pytest.raises(UnitError, match=message):
        uncertain_quantity(text, "kg")


@settings(max_examples=50)
@given(st.text("+-±/% exact0123456789.kgt", max_size=300))
def test_any_text_is_an_uncertain_quantity_or_refused(text: str) -> None:
    try:
        _, sigma = uncertain_quantity(text, "kg")
    except UnitError:
        return
    assert sigma is None or 0 <= sigma < float("inf")


def test_every_signal_has_a_unit() -> None:
    assert all(factor(channel.unit, channel.unit) == 1.0 for channel in CHANNELS.values())
    assert header("reference.roll.tractor") == "reference.roll.tractor [rad]"
    assert split_header(" yaw_rate.tractor [deg/s] ") == ("yaw_rate.tractor", "deg/s")
    assert split_header("a [b] c") == ("a [b] c", None)
    assert si_unit("yaw_rate") is None
