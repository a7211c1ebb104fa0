"""Tyre laws as functions of slip angle, load, cornering stiffness and friction, also those of a user's own module.

`tyres.saturating` makes of such a law the forces of an axle group, with load transfer, load sensitivities and
longitudinal force. A law is a module-level function, so that processes and saved results find it by its name:

    def tanh_law(slip, load, stiffness, friction):
        return friction * load * ca.tanh(stiffness * slip / (friction * load))

It gets expressions of CasADi: slip angle (rad), static load (N) and cornering stiffness (N/rad) of an axle group, and
friction coefficient. It returns the side force (N), which

- is odd in the slip angle, with the slope `stiffness` at 0;
- is positive at a positive slip angle and at most friction times load;
- doubles with load and stiffness: two equal tyres have twice the force of one. What a tyre loses with its load is in
  the stiffness and in the friction, which the law receives.
"""

import math
from collections.abc import Callable, Iterator, Mapping
from typing import Annotated, Any, cast, get_args

import casadi as ca
import numpy as np
from pydantic import PlainValidator

from fifthwheel.base.errors import SignalError
from fifthwheel.base.native import own_function
from fifthwheel.base.native.own_function import TOLERANCE, Fault, name_of
from fifthwheel.base.options import TyreChoice, TyreLaw
from fifthwheel.base.settings import Stored

SideForce = Callable[[ca.SX, ca.SX, ca.SX, ca.SX], ca.SX]
"""From slip angle, rad, load, N, cornering stiffness, N/rad, and friction to the side force, N."""
Tyres = TyreLaw | SideForce
"""The law of a model: linear, saturating, or a user's own."""
ARGUMENTS = ("slip", "load", "stiffness", "friction")
SMALLEST_SLIP = 1e-6
"""rad; smooths secants that are 0 / 0 at the slip angle 0, with a relative error below 1e-8 from 1 mrad on."""
SLIPS = np.array([1e-3, 0.01, 0.03, 0.1, 0.3, 1.0])
"""At which a law is checked, rad."""
GROUPS = np.array([[60e3, 600e3, 0.75], [20e3, 300e3, 0.2], [100e3, 700e3, 1.0]])
"""Load, N, stiffness, N/rad, and friction of axle groups for which a law is checked."""
CHOICES = get_args(TyreChoice)


def side_force(law: SideForce) -> ca.Function:
    """(slip, load, stiffness, friction) -> side force, N."""
    symbols = [ca.SX.sym(name) for name in ARGUMENTS]
    return ca.Function("side_force", symbols, [law(*symbols)], [*ARGUMENTS], ["side_force"])


def force_fraction(law: SideForce) -> ca.Function:
    """(slip, load, stiffness, friction) -> side force over that of a linear tyre, 1 at the slip angle 0.

    Where the division is 0 / 0 at 0, the slip angle a is replaced by sqrt(a^2 + SMALLEST_SLIP^2).
    """
    symbols = slip, load, stiffness, friction = [ca.SX.sym(name) for name in ARGUMENTS]
    fraction = ca.Function("fraction", symbols, [law(*symbols) / (stiffness * slip)])
    if math.isfinite(float(fraction(0, 1, 1, 1))):
        return fraction
    away = ca.sqrt(slip * slip + SMALLEST_SLIP**2)
    return ca.Function("fraction", symbols, [fraction(away, load, stiffness, friction)])


def identity(tyres: Tyres) -> str:
    """All that determines a law: machine code of one is never that of another."""
    if isinstance(tyres, str):
        return tyres
    return own_function.digest(force_fraction(tyres))


def require_law(law: Any) -> None:
    """A SignalError for what is no tyre law; it names the law, the property that it lacks, and the cure."""
    for expected, got, cure in _faults(law):
        raise SignalError(f"tyres, {name_of(law)}: expected {expected}, got {got}; {cure}")


def _faults(law: Any) -> Iterator[Fault]:
    """What was expected of a law, what it has, and the cure; the first one makes others likely."""
    yield from own_function.definition_faults(law, ARGUMENTS)
    try:
        force = side_force(law)
    except Exception as error:
        yield own_function.expression_fault(error)
        raise
    if force.size1_out(0) * force.size2_out(0) != 1:
        yield "one side force", f"an array {force.size_out(0)}", "return the force of one slip angle"
    slip, *_ = symbols = [ca.SX.sym(name) for name in ARGUMENTS]
    slope = ca.jacobian(force(*symbols), slip)
    for load, stiffness, friction in GROUPS.tolist():
        place = f"for {load:g} N, {stiffness:g} N/rad and the friction {friction:g}"
        at_zero = float(force(0, load, stiffness, friction))
        if at_zero != 0:
            yield (
                f"0 N at the slip angle 0 {place}",
                f"{at_zero:g}",
                "use functions of casadi, not of math, and avoid 0 / 0",
            )
        steep = float(ca.Function("slope", symbols, [slope])(0, load, stiffness, friction))
        if not math.isclose(steep, stiffness, rel_tol=TOLERANCE):
            secant = float(force(SMALLEST_SLIP, load, stiffness, friction)) / SMALLEST_SLIP
            cure = "let the slope be the stiffness"
            if steep == 0 and math.isclose(secant, stiffness, rel_tol=1e-3):
                cure = "CasADi takes the slopes of sign and fabs as 0; write slip, not sign(slip) * fabs(slip)"
            yield f"the slope {stiffness:g} at the slip angle 0 {place}", f"{steep:g}", cure
        for a in SLIPS:
            at, value = f"at {a:g} rad {place}", float(force(a, load, stiffness, friction))
            if not 0 < value <= friction * load * (1 + TOLERANCE):
                yield f"up to {friction * load:g} N {at}", f"{value:g}", "let friction times load limit the force"
            opposite = float(force(-a, load, stiffness, friction))
            if not math.isclose(value, -opposite, rel_tol=TOLERANCE):
                yield f"{-value:g} N {at.replace('at ', 'at -')}", f"{opposite:g}", "make it odd in the slip angle"
            twice = float(force(a, 2 * load, 2 * stiffness, friction))
            if not math.isclose(2 * value, twice, rel_tol=TOLERANCE):
                got, cure = f"{twice:.9g}", "let load matter only by stiffness / load and as a factor of the force"
                yield f"{2 * value:.9g} N with twice the load and the stiffness {at}", got, cure
    rates = ca.hessian(force_fraction(law)(*symbols), slip)  # a filter needs the derivatives, too
    yield from own_function.code_faults(symbols, [slope, *rates])


def stored(tyres: TyreChoice | SideForce) -> Any:
    """A law for JSON: the word, or the name of a function with side forces and a digest that identify it."""
    if isinstance(tyres, str):
        return tyres
    return {"law": name_of(tyres), "side_forces": _side_forces(tyres), "digest": identity(tyres)}


def _side_forces(law: SideForce) -> list[float]:
    return [float(side_force(law)(a, *GROUPS[0])) for a in SLIPS]


def restored(stored: Mapping[str, Any]) -> SideForce:
    """The law that `stored` describes, if the module that has it is imported: a file must not import code.

    Raises:
        SignalError: it is not imported, or has other side forces.
    """

    def by_slip(forces: list[float]) -> dict[str, float]:
        return {f"N at {a:g} rad": force for a, force in zip(SLIPS, forces, strict=True)}

    return cast(
        SideForce,
        own_function.restored(
            "tyres",
            str(stored.get("law")),
            by_slip(stored["side_forces"]),
            require_law,
            lambda law: by_slip(_side_forces(law)),
        ),
    )


def _checked(value: Any) -> Any:
    """A valid setting, also from what `stored` gives."""
    if isinstance(value, Mapping):
        return restored(value)
    if callable(value):
        require_law(value)
    elif value not in CHOICES:
        listed = ", ".join(map(repr, CHOICES))
        raise SignalError(f"tyres: expected {listed} or a tyre law, got {value!r}; correct it")
    return value


ChosenTyres = Annotated[TyreChoice | SideForce, PlainValidator(_checked), Stored(stored)]
"""A setting: the law of the tyres, or "auto"."""
