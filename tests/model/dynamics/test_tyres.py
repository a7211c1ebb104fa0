"""Side forces of an axle, and tyre laws of a user's own: which are refused, and how one is saved and found again."""

import casadi as ca
import numpy as np
import pytest

from fifthwheel.apps.studies.estimators import Identified
from fifthwheel.apps.studies.monte_carlo import _digest
from fifthwheel.base.errors import SignalError
from fifthwheel.base.units import STANDARD_GRAVITY as GRAVITY
from fifthwheel.estimate.identify import OneStage
from fifthwheel.model.dynamics.tyres import (
    LAW_SLIPS,
    NOMINAL_LOAD,
    Contact,
    axle_forces,
    force_fraction,
    law_identity,
    require_law,
    restored_law,
    root_law,
    saturating,
    saturation_parameters,
    stored_law,
)
from fifthwheel.model.dynamics.unit_equations import suspension_moment
from fifthwheel.model.plant.properties import MagicFormula
from fifthwheel.truck import get
from fifthwheel.truck.quantities import (
    FRICTION,
    FRICTION_SENSITIVITY,
    SHAPE,
    STIFFNESS_SENSITIVITY,
    TYRES,
)

TRUCK = get("cheng_cebon_2011")
DEFAULTS = {name: parameter.default for name, parameter in TYRES.items()}


TRAIL = {"semitrailer.pneumatic_trail": 0.05}


def aligning_moment(slip: float, **changes: float) -> float:
    """Aligning moment of the trailer's axle group over its side force, m, without load transfer."""
    p = TRUCK.parameters() | saturation_parameters(TRUCK) | TRAIL | {"body.half_track": 1e9} | changes
    side, moment = axle_forces(saturating(p, "semitrailer", Contact(ca.SX(slip))), ca.SX(slip))
    return float(ca.evalf(moment)) / float(ca.evalf(side))


@pytest.mark.slow
@pytest.mark.parametrize(("degrees", "limit"), [(3, 0.007), (12, 0.045)])
def test_the_aligning_moment_is_that_of_the_magic_formula(degrees: float, limit: float) -> None:
    """Of the tyre of the nonlinear truck at 0.5 to 1.5 times a load of 28 kN: 0.6 and 4 % of the peak."""
    tyre, errors, peak = MagicFormula(), [], 0.0
    for load in 28e3 * np.array([0.5, 0.75, 1, 1.25, 1.5]):
        own = {
            "semitrailer.cornering_stiffness": 6 * float(tyre.cornering_stiffness(load)),
            "semitrailer.static_load": 6 * load,
            "semitrailer.pneumatic_trail": float(tyre.pneumatic_trail(0.0, load)),
            FRICTION: tyre.PDY1 + tyre.PDY2 * (load / tyre.FNOMIN - 1),
            FRICTION_SENSITIVITY: 0.0,
        }
        for slip in np.radians(np.linspace(0.1, degrees, 12)):
            force = 6 * float(tyre.side_force(np.tan(slip), load))
            trail = float(tyre.pneumatic_trail(np.tan(slip), load))
            errors.append(force * (trail + aligning_moment(slip, **own)))
            peak = max(peak, force * trail)
    assert np.sqrt(np.mean(np.square(errors))) < limit * peak


def force(slip: float, roll: float = 0.0, **changes: float) -> float:
    """Side force of the trailer's axle group, N, with the nominal load on each tyre."""
    number = TRUCK.axle_loads()["semitrailer"] / NOMINAL_LOAD
    p = TRUCK.parameters() | saturation_parameters(TRUCK) | {"semitrailer.tyres": number} | changes
    suspension, height = suspension_moment(p, "semitrailer", ca.SX(roll), ca.SX(0)), p["semitrailer.roll_axis_height"]
    return slip * float(ca.evalf(saturating(p, "semitrailer", Contact(ca.SX(slip), suspension, height))))


def test_the_force_tends_to_friction_times_load() -> None:
    load = TRUCK.axle_loads()["semitrailer"]
    no_transfer = {"body.half_track": 1e9}
    assert force(100.0, **no_transfer) == pytest.approx(DEFAULTS[SHAPE] * DEFAULTS[FRICTION] * load, rel=1e-3)
    assert force(-0.1) == -force(0.1)
    slope = TRUCK.parameters()["semitrailer.cornering_stiffness"]
    assert force(1e-5, **no_transfer) == pytest.approx(1e-5 * slope, rel=1e-6)
    assert force(0.1, **{FRICTION: 0.3}) < force(0.1) < force(0.1, roll=0.0, **no_transfer)


def test_a_lifted_wheel_carries_nothing() -> None:
    """With all load on one side, more roll does not change the force, and the group has the load of that side."""
    lifted = force(0.1, roll=0.5)
    assert force(0.1, roll=1.0) == lifted
    load = TRUCK.axle_loads()["semitrailer"]
    mu = DEFAULTS[SHAPE] * DEFAULTS[FRICTION] * (1 - DEFAULTS[FRICTION_SENSITIVITY])
    C = TRUCK.parameters()["semitrailer.cornering_stiffness"] * (1 - DEFAULTS[STIFFNESS_SENSITIVITY])
    assert lifted == pytest.approx(0.1 * C / np.sqrt(1 + (0.1 * C / (load * mu)) ** 2), rel=1e-12)


@pytest.mark.parametrize("tyres", [6, 12])
def test_the_force_is_that_of_the_magic_formula(tyres: int) -> None:
    """Of the tyre of the nonlinear truck, at up to 12 deg and 0.1 to 1.9 times its static load; 0.5 % of the peak."""
    tyre, load = MagicFormula(), TRUCK.axle_loads()["semitrailer"]
    static = load / tyres
    own = {"semitrailer.cornering_stiffness": tyres * float(tyre.cornering_stiffness(static))}
    own |= {FRICTION: 0.74, SHAPE: 1.15, "semitrailer.tyres": tyres}
    slips, errors = np.radians(np.linspace(0.2, 12, 20)), []
    for transfer in np.linspace(0, 0.9, 4):
        for slip in slips:
            p = TRUCK.parameters() | saturation_parameters(TRUCK) | own
            suspension = ca.SX(transfer * load)
            law = slip * float(ca.evalf(saturating(p, "semitrailer", Contact(ca.SX(slip), suspension, ca.SX(0)))))
            sides = [float(tyre.side_force(np.tan(slip), n * static)) for n in (1 + transfer, 1 - transfer)]
            errors.append((law - tyres / 2 * abs(sum(sides))) / (0.74 * load))
    assert np.sqrt(np.mean(np.square(errors))) < 0.007


@pytest.mark.slow
@pytest.mark.parametrize(("used", "limit"), [(0.0, 0.004), (0.2, 0.02), (0.4, 0.07)])
def test_the_force_while_braking_is_that_of_the_magic_formula(used: float, limit: float) -> None:
    """F_x / N as given, at up to 12 deg and 0.5 to 1.6 times the static load: 0.3 to 6.9 % of the peak."""
    tyre, load = MagicFormula(), TRUCK.axle_loads()["semitrailer"]
    still, errors = (ca.SX(0), ca.SX(0), ca.SX(0)), []
    for n in (0.5, 0.8, 1.0, 1.3, 1.6):
        own = {
            "semitrailer.cornering_stiffness": 6 * float(tyre.cornering_stiffness(n * load / 6)),
            "semitrailer.static_load": n * load,
            "semitrailer.tyres": 6.0,
            FRICTION: 0.74,
            SHAPE: 1.15,
        }
        p = TRUCK.parameters() | saturation_parameters(TRUCK) | own | {"body.half_track": 1e9}
        for slip in np.radians([0.25, 0.5, 1, 2, 3, 4, 6, 8, 10, 12]):
            contact = Contact(ca.SX(slip), *still, ca.SX(-used * n * load))
            law = slip * float(ca.evalf(saturating(p, "semitrailer", contact)))
            expected = side_force_while_braking(tyre, slip, n * load / 6, used)
            errors.append((law / (n * load) - expected) / 0.73)
    assert np.sqrt(np.mean(np.square(errors))) < limit


def side_force_while_braking(tyre: MagicFormula, slip: float, load: float, used: float) -> float:
    """Side force over load at the least longitudinal slip with a braking force of `used` times the load."""
    kappa = np.linspace(0.0, -0.5, 10_001)
    braking = np.array(ca.DM(tyre.longitudinal_force(ca.DM(kappa), load, lateral=np.tan(slip)))).ravel()
    enough = braking <= -used * load
    assert enough.any()
    return float(tyre.side_force(np.tan(slip), load, longitudinal=kappa[np.argmax(enough)])) / load


@pytest.mark.parametrize(("path", "locking"), [("tractor.front", -25.0), ("semitrailer", -9.0)])
def test_locked_wheels_keep_a_small_side_force(path: str, locking: float) -> None:
    """Also at a change of the speed that no truck has."""
    p = TRUCK.parameters() | saturation_parameters(TRUCK)

    def secant(rate: float) -> float:
        change, braking = -p[f"{path}.braking_load"] * rate, p[f"{path}.static_load"] / GRAVITY * rate
        contact = Contact(ca.SX(0.05), load_change=ca.SX(change), longitudinal=ca.SX(braking))
        return float(ca.evalf(saturating(p, path, contact)))

    rolling, locked, beyond = map(secant, (0.0, locking, -200.0))
    assert 0.05 * rolling < locked < 0.2 * rolling
    assert 0 <= beyond < 0.3 * rolling


def test_the_effect_of_the_braking_force_is_smooth() -> None:
    """Its slope does not jump where wheels lock; at a high friction it vanishes."""
    p = TRUCK.parameters() | saturation_parameters(TRUCK)
    rate, slip, none = ca.SX.sym("u'"), ca.SX(0.05), ca.SX(0)
    contact = Contact(slip, none, ca.SX(1.0), none, p["semitrailer.static_load"] / GRAVITY * rate)
    law = saturating(p, "semitrailer", contact)
    slope = ca.Function("slope", [rate], [ca.jacobian(law, rate)])
    rates = np.linspace(-12, -0.01, 2000)
    slopes = np.array(slope(rates[None])).ravel()
    assert np.abs(np.diff(slopes)).max() < 0.02 * np.abs(slopes).max()
    law = ca.Function("law", [rate], [saturating(p | {FRICTION: 1e6}, "semitrailer", contact)])
    np.testing.assert_allclose(np.array(law(rates[None])).ravel(), float(law(0.0)), rtol=1e-10)


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


def undefined_at_zero(slip, load, stiffness, friction):
    return tanh_law(slip, load, stiffness, friction) * ca.fabs(slip) / slip


def ply_steer(slip, load, stiffness, friction):
    return tanh_law(slip + 0.001, load, stiffness, friction)


def half_slope_on_one_side(slip, load, stiffness, friction):
    return tanh_law(slip, load, stiffness, friction) * (1 - 0.1 * ca.fmax(slip, 0))


def of_load(slip, load, stiffness, friction):
    limit = friction * load * 50e3 / (50e3 + load)
    return limit * ca.tanh(stiffness * slip / limit)


def with_power(slip, load, stiffness, friction):
    return stiffness * slip / (1 + ca.fabs(stiffness * slip / (friction * load)) ** 2.3) ** (1 / 2.3)


@pytest.mark.parametrize("law", [tanh_law, brush, root_law])
def test_laws_are_accepted_and_equal_to_their_fraction(law) -> None:
    require_law(law)
    for slip in (*LAW_SLIPS, *-LAW_SLIPS):
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
        (
            undefined_at_zero,
            "expected 0 N at the slip angle 0 .*, got nan; use functions of casadi, not of math, and avoid 0 / 0",
        ),
        (ply_steer, "expected 0 N at the slip angle 0 for 60000 N, .*, got 599"),
        (
            brush_of_magnitude,
            "expected the slope 600000 .*, got 0; CasADi takes the slopes of sign and fabs as 0; write",
        ),
        (half_slope_on_one_side, "expected -.* N at -0.001 rad .*; make it odd in the slip angle"),
        (of_load, "with twice the load and the stiffness at 0.001 rad .*; let load matter only by stiffness / load"),
        (with_power, "expected sqrt, fabs, exp, log, sin, cos, atan, tanh and arithmetic, got another function"),
    ],
)
def test_what_is_no_law_is_refused_by_its_name(law, message: str) -> None:
    with pytest.raises(SignalError, match=rf"tyres, \S+:{law.__qualname__}: ".replace("<", ".").replace(">", ".")) as e:
        OneStage(tyres=law)
    assert e.match(message)


def test_a_constant_is_part_of_the_identity(monkeypatch: pytest.MonkeyPatch) -> None:
    """Also in its last digit, and if it changes in the same process."""
    laws = ["linear", "saturating", tanh_law, brush, root_law]
    assert len({law_identity(law) for law in laws}) == len(laws)
    models, studies = set(), set()
    for factor in (1.0, 1.0 + 3e-16):
        monkeypatch.setitem(globals(), "FACTOR", factor)
        models.add(law_identity(scaled))
        studies.add(_digest(Identified(OneStage(tyres=scaled))))
    assert len(models) == len(studies) == 2


FACTOR = 1.0


def scaled(slip, load, stiffness, friction):
    return tanh_law(slip, load, stiffness, friction) * FACTOR


def test_a_saved_law_is_found_if_imported(monkeypatch: pytest.MonkeyPatch) -> None:
    saved = stored_law(tanh_law)
    assert restored_law(saved) is tanh_law
    assert OneStage(tyres=saved).tyres is tanh_law
    assert OneStage(tyres=tanh_law).as_dict()["tyres"] == saved
    with pytest.raises(
        SignalError, match="expected the function elsewhere:law, which is not imported; import elsewhere"
    ):
        restored_law(saved | {"law": "elsewhere:law"})
    with pytest.raises(
        SignalError, match=r"expected the function of this result, with .* N at 0.001 rad, got another one"
    ):
        restored_law(saved | {"law": f"{__name__}:brush"})
    for other in ("os:system", "builtins:print"):  # a file calls no other function
        with pytest.raises(SignalError, match="expected"):
            restored_law(saved | {"law": other})
    assert stored_law("auto") == "auto"
