"""Tyre laws of a user's own: which functions are refused, and how a law is identified, saved and found again."""

import math

import casadi as ca
import numpy as np
import pytest

from fifthwheel.apps.studies.estimators import Identified
from fifthwheel.apps.studies.monte_carlo import _digest
from fifthwheel.base.errors import SignalError
from fifthwheel.estimate.identify import OneStage
from fifthwheel.estimate.observe import ObserverSettings
from fifthwheel.model.dynamics import tyre_law
from fifthwheel.model.dynamics.tyre_law import SLIPS, force_fraction, identity, require_law, restored, stored
from fifthwheel.model.dynamics.tyres import root_law

N, C, MU = 50e3, 400e3, 0.5


def tanh_law(slip, load, stiffness, friction):
    return friction * load * ca.tanh(stiffness * slip / (friction * load))


def brush(slip, load, stiffness, friction):
    """Fiala (1954): C s (1 - |s| / 3 + s^2 / 27), s = C a / (mu N), up to |s| = 3."""
    s = ca.fmin(ca.fmax(stiffness * slip / (friction * load), -3), 3)
    return friction * load * s * (1 - ca.fabs(s) / 3 + s * s / 27)


def brush_of_magnitude(slip, load, stiffness, friction):
    """The same force, of which CasADi takes the slope at 0 as 0."""
    z = ca.fmin(stiffness * ca.fabs(slip) / (3 * friction * load), 1)
    return ca.sign(slip) * friction * load * (3 * z - 3 * z**2 + z**3)


def two_arguments(slip, stiffness):
    return stiffness * slip


def other_order(slip, stiffness, load, friction):
    return tanh_law(slip, load, stiffness, friction)


def with_math(slip, load, stiffness, friction):
    return friction * load * math.tanh(stiffness * slip / (friction * load))


def number(slip, load, stiffness, friction):
    return "a force"


def pair(slip, load, stiffness, friction):
    return ca.vertcat(slip, slip)


def undefined_at_zero(slip, load, stiffness, friction):
    return tanh_law(slip, load, stiffness, friction) * ca.fabs(slip) / slip


def ply_steer(slip, load, stiffness, friction):
    return tanh_law(slip + 0.001, load, stiffness, friction)


def half_slope(slip, load, stiffness, friction):
    return tanh_law(slip, load, stiffness / 2, friction)


def half_slope_on_one_side(slip, load, stiffness, friction):
    return tanh_law(slip, load, stiffness, friction) * (1 - 0.1 * ca.fmax(slip, 0))


def of_load(slip, load, stiffness, friction):
    limit = friction * load * 50e3 / (50e3 + load)
    return limit * ca.tanh(stiffness * slip / limit)


def linear(slip, load, stiffness, friction):
    return stiffness * slip


def with_power(slip, load, stiffness, friction):
    return stiffness * slip / (1 + ca.fabs(stiffness * slip / (friction * load)) ** 2.3) ** (1 / 2.3)


@pytest.mark.parametrize("law", [tanh_law, brush, root_law])
def test_laws_are_accepted_and_equal_to_their_fraction(law) -> None:
    require_law(law)
    for slip in (*SLIPS, *-SLIPS):
        fraction = float(force_fraction(law)(slip, N, C, MU))
        assert fraction * C * slip == pytest.approx(float(law(ca.DM(slip), N, C, MU)), rel=1e-8)
    assert float(force_fraction(law)(0, N, C, MU)) == pytest.approx(1, abs=1e-5)
    slip = ca.SX.sym("slip")
    fraction = force_fraction(law)(slip, N, C, MU)
    slopes = ca.Function("slopes", [slip], list(ca.hessian(fraction, slip)))
    assert np.isfinite(np.array([float(x) for a in (0.0, 1e-9, 0.1) for x in slopes(a)])).all()


@pytest.mark.parametrize(
    ("law", "message"),
    [
        (lambda slip, load, stiffness, friction: stiffness * slip, "expected a function at the top level of a module"),
        (ca.tanh, "expected the arguments slip, load, stiffness, friction, got args"),
        (two_arguments, "expected the arguments slip, load, stiffness, friction, got slip, stiffness; name them so"),
        (other_order, "got slip, stiffness, load, friction; name them so, in this order"),
        (with_math, "expected 0 N at the slip angle 0 .*, got nan; use functions of casadi, not of math"),
        (number, "expected an expression of CasADi"),
        (pair, "expected one side force, got an array"),
        (
            undefined_at_zero,
            "expected 0 N at the slip angle 0 .*, got nan; use functions of casadi, not of math, and avoid 0 / 0",
        ),
        (ply_steer, "expected 0 N at the slip angle 0 for 60000 N, .*, got 599"),
        (half_slope, "expected the slope 600000 at the slip angle 0 .*, got 300000; let the slope be the stiffness"),
        (
            brush_of_magnitude,
            "expected the slope 600000 .*, got 0; CasADi takes the slopes of sign and fabs as 0; write",
        ),
        (half_slope_on_one_side, "expected -.* N at -0.001 rad .*; make it odd in the slip angle"),
        (of_load, "with twice the load and the stiffness at 0.001 rad .*; let load matter only by stiffness / load"),
        (linear, "expected up to 45000 N at 0.1 rad .*, got 60000; let friction times load limit the force"),
        (with_power, "expected sqrt, fabs, exp, log, sin, cos, atan, tanh and arithmetic, got another function"),
    ],
)
def test_what_is_no_law_is_refused_by_its_name(law, message: str) -> None:
    with pytest.raises(SignalError, match=rf"tyres, \S+:{law.__qualname__}: ".replace("<", ".").replace(">", ".")) as e:
        OneStage(tyres=law)
    assert e.match(message)


def test_settings_name_the_choices() -> None:
    with pytest.raises(SignalError, match="tyres: expected 'linear', 'saturating', 'auto' or a tyre law, got 3"):
        OneStage(tyres=3)
    with pytest.raises(SignalError, match="tyres: expected the friction of the road, got none"):
        ObserverSettings(tyres=tanh_law)


def test_other_laws_have_other_machine_code() -> None:
    laws = ["linear", "saturating", tanh_law, brush, root_law]
    assert len({identity(law) for law in laws}) == len(laws)


def test_a_constant_is_part_of_the_identity(monkeypatch: pytest.MonkeyPatch) -> None:
    """Also in its last digit, and if it changes in the same process."""
    models, studies = set(), set()
    for factor in (1.0, 1.0 + 3e-16):
        monkeypatch.setitem(globals(), "FACTOR", factor)
        models.add(identity(scaled))
        studies.add(_digest(Identified(OneStage(tyres=scaled))))
    assert len(models) == len(studies) == 2


FACTOR = 1.0


def scaled(slip, load, stiffness, friction):
    return tanh_law(slip, load, stiffness, friction) * FACTOR


def test_a_saved_law_is_found_if_imported(monkeypatch: pytest.MonkeyPatch) -> None:
    saved = stored(tanh_law)
    assert restored(saved) is tanh_law
    assert OneStage(tyres=saved).tyres is tanh_law
    assert OneStage(tyres=tanh_law).as_dict()["tyres"] == saved
    with pytest.raises(
        SignalError, match="expected the function elsewhere:law, which is not imported; import elsewhere"
    ):
        restored(saved | {"law": "elsewhere:law"})
    with pytest.raises(
        SignalError, match=r"expected the function of this result, with .* N at 0.001 rad, got another one"
    ):
        restored(saved | {"law": f"{__name__}:brush"})
    for other in ("os:system", "builtins:print"):  # a file calls no other function
        with pytest.raises(SignalError, match="expected"):
            restored(saved | {"law": other})
    assert tyre_law.stored("auto") == "auto"
