"""Units, against pint."""

import pint
import pytest
from hypothesis import given
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


@pytest.mark.parametrize("symbol", sorted(set(_SYMBOLS) - DIFFERENT))
def test_symbols_agree_with_pint(symbol: str) -> None:
    size, powers = _SYMBOLS[symbol]
    unit = " * ".join(f"{BASE[name]}**{power}" for name, power in powers.items() if BASE[name]) or "dimensionless"
    if "Hz" in symbol:
        unit = "Hz"
    registry = pint.application_registry
    expected = registry.Quantity(1.0, symbol).to("V" if unit == "V**1" else unit).magnitude
    assert size == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(
    ("unit", "si"),
    [
        ("km/h", "m/s"),
        ("m/s**2", "m/s^2"),
        ("deg/s**2", "rad/s^2"),
        ("kN*m*s/rad", "N m s/rad"),
        ("t*m**2", "kg m^2"),
        ("kN*m/(rad/s)", "N m s/rad"),
        ("1/km", "1/m"),
        ("m/s/min", "m/s^2"),
        ("kN/(deg/(m/s))/m", "N/rad/s"),
    ],
)
def test_products_agree_with_pint(unit: str, si: str) -> None:
    registry = pint.application_registry
    expected = registry.Quantity(1.0, unit).to(si.replace(" ", " * ")).magnitude
    assert factor(unit, si) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(
    ("unit", "si", "expected"),
    [
        ("°/s", "rad/s", "deg/s"),
        ("deg/sec", "rad/s", "deg/s"),
        ("Grad/s", "rad/s", "deg/s"),
        ("m/s²", "m/s^2", "m/s^2"),
        ("m/s2", "m/s^2", "m/s^2"),
        ("kg·m²", "kg m^2", "kg m^2"),
        ("kNm/rad", "N m/rad", "kN m/rad"),
        ("kph", "m/s", "km/h"),
        ("knot", "m/s", "kn"),
        ("kts", "m/s", "kn"),
        ("Km/h", "m/s", "km/h"),
        ("Mph", "m/s", "mph"),
        ("G", "m/s^2", "g"),
        (" km / h ", "m/s", "km/h"),
        ("N/rad m", "N m/rad", "N m/rad"),
    ],
)
def test_other_spellings(unit: str, si: str, expected: str) -> None:
    assert factor(unit, si) == factor(expected, si)


@pytest.mark.parametrize(
    ("unit", "si", "size"), [("g", "m/s^2", 9.80665), ("mg", "m/s^2", 9.80665e-3), ("%", "1", 0.01), ("-", "1", 1.0)]
)
def test_symbols_of_vehicle_logs(unit: str, si: str, size: float) -> None:
    assert factor(unit, si) == pytest.approx(size, rel=1e-15)


@pytest.mark.parametrize(("unit", "weight"), [("kg", 9.80665), ("t", 9806.65), ("daN", 10.0)])
def test_a_mass_is_a_weight_where_a_force_is_expected(unit: str, weight: float) -> None:
    assert factor(unit, "N") == pytest.approx(weight, rel=1e-15)


def test_an_angle_may_be_left_out_unless_strict() -> None:
    assert factor("1/s", "rad/s") == 1.0
    with pytest.raises(UnitError, match=r"expected rad/s or .*, got '1/s'"):
        factor("1/s", "rad/s", strict=True)


@pytest.mark.parametrize(("unit", "si"), [("deg", "m/s"), ("kg", "s"), ("Hz", "rad/s"), ("m", "m^2"), ("bar", "N")])
def test_a_unit_of_another_dimension_is_refused(unit: str, si: str) -> None:
    with pytest.raises(UnitError, match="or a unit that converts to it, got"):
        factor(unit, si)


@pytest.mark.parametrize(
    "text",
    [
        "",
        " ",
        "furlong",
        "((",
        "(m",
        "m)",
        "m//s",
        "m/",
        "/s",
        "m^^",
        "m^99",
        "m s^7",
        "9**9**9**9 m/s",
        "2 m",
        "m;s",
        "m" * 41,
        "m" * 10**6,
        "(" * 40,
        "m/0",
        "m/(nm6nm6nm6nm6nm6nm6nm6)",
        "Mm6Mm6Mm6Mm6Mm6Mm6Mm6Mm6Mm6",
    ],
)
def test_a_text_that_is_not_a_unit_is_refused(text: str) -> None:
    """At once, also a tower of powers, and sizes of 0 and infinity."""
    assert not is_unit(text)
    with pytest.raises(UnitError, match="expected a unit such as"):
        factor(text, "m")
    if text.strip():  # a number alone is in the SI unit
        with pytest.raises(UnitError):
            quantity(f"1 {text}", "m")


@pytest.mark.slow
@given(st.text(max_size=60))
def test_any_text_is_a_unit_or_refused(text: str) -> None:
    if is_unit(text):
        assert factor(text, text) == 1.0
    else:
        with pytest.raises(UnitError, match=r"(?s)^.{1,200}$"):
            factor(text, "m/s")


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
    assert uncertain_quantity("8 +- 2 kg", "kg", unit_needed=True) == (8.0, 2.0)


def test_a_unit_behind_the_standard_deviation_only_is_refused_where_it_could_be_that_of_both() -> None:
    with pytest.raises(UnitError, match=r"expected a unit of the value too, got '5 \+- 0.2 t'; write '5 t \+- 0.2 t'"):
        uncertain_quantity("5 +- 0.2 t", "kg")
    assert uncertain_quantity("0 +- 0.2 t", "kg") == (0.0, 200.0)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("7 kg +- 1e999 kg", r"after '\+-': expected a finite standard deviation"),
        ("7 kg +- 2 % exact", r"expected one '\+- \.\.\.' or 'exact' at the end, .* keep only one"),
        ("7 kg exact 2 %", r"expected one '\+- \.\.\.' or 'exact' at the end"),
        ("7 kg +- ", r"after '\+-': expected a number with a unit such as '1 kg', got ''"),
        ("+- 2 kg", "expected a number with a unit such as '1 kg', got ''"),
    ],
)
def test_wrong_statements_are_refused(text: str, message: str) -> None:
    with pytest.raises(UnitError, match=message):
        uncertain_quantity(text, "kg")


@pytest.mark.parametrize("text", ["7,6 m", "6,900 m", "7.6 m +- 0,1 m"])
def test_a_comma_in_a_number_is_named(text: str) -> None:
    with pytest.raises(UnitError, match=r"expected a decimal point, and no separator of thousands, got "):
        uncertain_quantity(text, "m")


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


def test_base_units_of_coherent_units_only() -> None:
    assert base_units("N m s/rad") == {"kg": 1, "m": 2, "rad": -1, "s": -1}
    assert base_units("1") == {}
    for other in ("km/h", "deg", "Hz", "furlong"):
        with pytest.raises(UnitError):
            base_units(other)
