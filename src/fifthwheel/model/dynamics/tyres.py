"""The law of the tyres of an axle group: side force and aligning moment from slip angle, load and longitudinal force.

`linear` and `saturating` have one interface: the secants of the side force F and of the aligning moment M, which the
equations of motion multiply by the slip angle of each axle (`axle_forces`). The linear law is F = C alpha, with the
cornering stiffness C > 0, equation (7) of Cheng and Cebon (2011), and M = -t_0 F with the pneumatic trail t_0. The
saturating law tends to it for a high friction; docs/limits.md compares it with others.

Saturation. The side force of a group with the static load N at a slip angle alpha is the sum over both sides, whose
loads are n = 1 + lambda and 1 - lambda times the static ones, plus the change of the group's load:

    F = (C alpha / 2) sum n k / sqrt(1 + s^2),        s = C alpha k / (N mu),
    k = 1 - s_C q^2 (n - 1),        mu = c g mu_0 (1 - s_mu (q n - 1))

with the load sensitivities s_C of the stiffness and s_mu of the friction at the nominal load of a tyre, and the static
load q of a tyre of the group as a fraction of it: twin tyres carry half the load each. mu_0 is the peak friction of the
road, g that of the group's tyres relative to it, and c the shape: the law tends to c times the peak of a Magic Formula.
In PAC2002 the friction is linear in the load, and the sensitivity of the stiffness K = K_max sin(2 atan(F_z / F_K)) is
1 - (F_z / K) dK/dF_z = 2 F_z^2 / (F_K^2 + F_z^2), about in proportion to q^2 (H. B. Pacejka, Tyre and Vehicle Dynamics,
2006, chapter 4). At small slip angles F / (C alpha) tends to 1 - s_C q^2 lambda^2.

The side force of a side acts t = t_0 / (1 + s^2) behind the middle of the contact: t_0 at small slip angles, 0 at full
sliding. The cosine of the arctangent of the slip is that of Pacejka's trail; its square also has the second limit.

Own laws. The function `root_law` gives 1 / sqrt(1 + s^2). A user's own function replaces it: then the factor of C alpha
is F / (C alpha) of that function for the stiffness C k and the friction of a side, its square is that of the trail, and
c is 1, so that mu_0 is the peak friction of the law. It is a module-level function, so that processes and saved results
find it by its name:

    def tanh_law(slip, load, stiffness, friction):
        return friction * load * ca.tanh(stiffness * slip / (friction * load))

It gets expressions of CasADi: slip angle (rad), static load (N) and cornering stiffness (N/rad) of an axle group, and
friction coefficient. It returns the side force (N), which

- is odd in the slip angle, with the slope `stiffness` at 0;
- is positive at a positive slip angle and at most friction times load;
- doubles with load and stiffness: two equal tyres have twice the force of one. What a tyre loses with its load is in
  the stiffness and in the friction, which the law receives.

The load transfer ratio lambda of a group is T / (N half_track) with T = K* phi + C* phi' + h_r F, the moment of its
suspension and tyres, and of the side force at the height h_r of the roll axis.

Longitudinal forces. At the speed u and its derivative u', the wheels of a truck of the mass m need the force

    X = m u' + (rho / 2) A u^2 + c_r sum N + sum (N u r / g)^2 / C

for the drag of the air on the drag area A (drag coefficient times frontal area), for the rolling resistance c_r N of
each group (J. Y. Wong, Theory of Ground Vehicles, 2008, chapter 3), and for its side force N u r / g in a turn with the
yaw rate r, at most that of `LARGEST_TURN`, which acts at its slip angle. Where X > 0, the driven group (the last of
`Vehicle.driven_groups`) drives with it. Where X < 0, engine and retarder brake that group with b X, b from 0 to 1, up
to `AUXILIARY` m, and the brakes of all groups give the rest in proportion to the static loads. The longitudinal force
F_x of a group is that of drive and brakes less c_r N, equally on both sides. `large_angles` has the change of the
loads, by which n = 1 + dN / N + lambda and 1 + dN / N - lambda. It leaves a side less stiffness and friction for its
side force:

    C k sqrt(1 - b (F_x / (mu N))^2),        mu sqrt(1 - (F_x / (mu N))^2),

the latter because both forces together tend to at most mu N. So the shape c and the friction mu_0 act by their product
alone: a log far from the limit says nothing of either. b is 1 for a tyre with the same curve along and
across the wheel, and less for tyres that are stiffer along it. The trail is t_0 (1 - f^2), with the fraction f of the
friction that both forces use.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from typing import Annotated, Any, NamedTuple, cast, get_args

import casadi as ca
import numpy as np
from pydantic import PlainValidator

from fifthwheel.base.errors import SignalError
from fifthwheel.base.native import own_function
from fifthwheel.base.native.own_function import TOLERANCE, Fault, name_of
from fifthwheel.base.options import TyreChoice, TyreLaw
from fifthwheel.base.settings import Stored
from fifthwheel.base.units import STANDARD_GRAVITY as GRAVITY
from fifthwheel.model.dynamics.symbolic import Expressions
from fifthwheel.truck import Vehicle
from fifthwheel.truck.driveline import drag
from fifthwheel.truck.quantities import (
    COMBINED_SLIP,
    DRAG_AREA,
    DRIVE_AXLE_BRAKING,
    FRICTION,
    FRICTION_SENSITIVITY,
    GROUP_TYRES,
    HALF_TRACK,
    ROLLING_RESISTANCE,
    SHAPE,
    STIFFNESS_SENSITIVITY,
    TYRES,
)

SideForce = Callable[[ca.SX, ca.SX, ca.SX, ca.SX], ca.SX]
"""From slip angle, rad, load, N, cornering stiffness, N/rad, and friction to the side force, N."""
Tyres = TyreLaw | SideForce
"""The law of a model: linear, saturating, or a user's own."""
LAW_ARGUMENTS = ("slip", "load", "stiffness", "friction")
SMALLEST_SLIP = 1e-6
"""rad; smooths secants that are 0 / 0 at the slip angle 0, with a relative error below 1e-8 from 1 mrad on."""
LAW_SLIPS = np.array([1e-3, 0.01, 0.03, 0.1, 0.3, 1.0])
"""At which a law is checked, rad."""
LAW_GROUPS = np.array([[60e3, 600e3, 0.75], [20e3, 300e3, 0.2], [100e3, 700e3, 1.0]])
"""Load, N, stiffness, N/rad, and friction of axle groups for which a law is checked."""
CHOICES = get_args(TyreChoice)
NO_CHANGE = ca.SX(0)
"""Of a load, N, or of the speed, m/s^2."""
NOMINAL_LOAD = 35e3
"""Of a tyre, N: of 315/80 R 22.5."""
LOCKED = 0.1
"""Least factor e of the side force: that of a wheel that slides without turning, mu N / C."""
LOCKING = 0.1
"""Width of the smooth transition to it, of e^2: at a kink, the derivatives of a step would jump."""
SMALL_LOAD = 0.01
"""Load of a lifted side, over the static one, below which its wheels are locked in any case."""
SLOPE = 0.1
"""u' / g for the braking loads, which hardly depend on it."""
AUXILIARY = 1.5
"""Largest deceleration by engine and retarder, m/s^2: their 600 kW give 20 to 40 kN at 15 to 30 m/s."""
LARGEST_TURN = 5.0
"""Largest lateral acceleration whose drag drive or brakes make up for, m/s^2: a truck that spins slows down."""
SMOOTHING = 0.001
"""Slip angle below which softening is smooth, rad."""


def law_function(law: SideForce) -> ca.Function:
    """(slip, load, stiffness, friction) -> side force, N."""
    symbols = [ca.SX.sym(name) for name in LAW_ARGUMENTS]
    return ca.Function("law_function", symbols, [law(*symbols)], [*LAW_ARGUMENTS], ["law_function"])


def force_fraction(law: SideForce) -> ca.Function:
    """(slip, load, stiffness, friction) -> side force over that of a linear tyre, 1 at the slip angle 0.

    Where the division is 0 / 0 at 0, the slip angle a is replaced by sqrt(a^2 + SMALLEST_SLIP^2).
    """
    symbols = slip, load, stiffness, friction = [ca.SX.sym(name) for name in LAW_ARGUMENTS]
    fraction = ca.Function("fraction", symbols, [law(*symbols) / (stiffness * slip)])
    if math.isfinite(float(fraction(0, 1, 1, 1))):
        return fraction
    away = ca.sqrt(slip * slip + SMALLEST_SLIP**2)
    return ca.Function("fraction", symbols, [fraction(away, load, stiffness, friction)])


def law_identity(tyres: Tyres) -> str:
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
    yield from own_function.definition_faults(law, LAW_ARGUMENTS)
    try:
        force = law_function(law)
    except Exception as error:
        yield own_function.expression_fault(error)
        raise
    if force.size1_out(0) * force.size2_out(0) != 1:
        yield "one side force", f"an array {force.size_out(0)}", "return the force of one slip angle"
    slip, *_ = symbols = [ca.SX.sym(name) for name in LAW_ARGUMENTS]
    slope = ca.jacobian(force(*symbols), slip)
    for load, stiffness, friction in LAW_GROUPS.tolist():
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
        for a in LAW_SLIPS:
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


def stored_law(tyres: TyreChoice | SideForce) -> Any:
    """A law for JSON: the word, or the name of a function with side forces and a digest that identify it."""
    if isinstance(tyres, str):
        return tyres
    return {"law": name_of(tyres), "side_forces": _law_forces(tyres), "digest": law_identity(tyres)}


def _law_forces(law: SideForce) -> list[float]:
    return [float(law_function(law)(a, *LAW_GROUPS[0])) for a in LAW_SLIPS]


def restored_law(stored_law: Mapping[str, Any]) -> SideForce:
    """The law that `stored_law` describes, if the module that has it is imported: a file must not import code.

    Raises:
        SignalError: it is not imported, or has other side forces.
    """

    def by_slip(forces: list[float]) -> dict[str, float]:
        return {f"N at {a:g} rad": force for a, force in zip(LAW_SLIPS, forces, strict=True)}

    return cast(
        SideForce,
        own_function.restored(
            "tyres",
            str(stored_law.get("law")),
            by_slip(stored_law["side_forces"]),
            require_law,
            lambda law: by_slip(_law_forces(law)),
        ),
    )


def _checked(value: Any) -> Any:
    """A valid setting, also from what `stored_law` gives."""
    if isinstance(value, Mapping):
        return restored_law(value)
    if callable(value):
        require_law(value)
    elif value not in CHOICES:
        listed = ", ".join(map(repr, CHOICES))
        raise SignalError(f"tyres: expected {listed} or a tyre law, got {value!r}; correct it")
    return value


ChosenTyres = Annotated[TyreChoice | SideForce, PlainValidator(_checked), Stored(stored_law)]
"""A setting: the law of the tyres, or "auto"."""


def saturation_names(paths: Iterable[str]) -> tuple[str, ...]:
    """Names of the parameters of saturating tyres on axle groups with these paths."""
    return (*TYRES, *[f"{path}.{quantity}" for path in paths for quantity in GROUP_TYRES])


def saturation_parameters(vehicle: Vehicle, tyres: Tyres = "saturating") -> dict[str, float]:
    """Parameters of saturating tyres by name, with their defaults, SI.

    A user's own law has no shape: it tends to the peak friction. A VehicleError where the static axle loads are not
    determined.
    """
    loads, numbers = vehicle.axle_loads(), vehicle.tyres()
    braking, driving = vehicle.axle_loads(-SLOPE), vehicle.axle_loads(SLOPE)
    pulled, pull = vehicle.axle_loads(0.0, _pull(vehicle)), sum(_pull(vehicle).values(), 0.0)
    names = [name for name in TYRES if name != SHAPE or tyres == "saturating"]
    values = {name: TYRES[name].default for name in names}
    for path, load in loads.items():
        values |= {
            f"{path}.static_load": load,
            f"{path}.relative_friction": 1.0,
            f"{path}.tyres": float(numbers[path]),
            f"{path}.braking_load": (braking[path] - driving[path]) / (2 * SLOPE * GRAVITY),
            f"{path}.pull_load": (pulled[path] - load) / -pull if pull else 0.0,
        }
    return values


def softening_parameters(vehicle: Vehicle) -> dict[str, float]:
    """Parameters of linear tyres by name, with their defaults: the softening of each group, 1/rad; see
    `softening_factor`."""
    return {f"{path}.softening": 0.0 for path in vehicle.group_paths()}


def stiffness_at_load(vehicle: Vehicle) -> dict[str, float]:
    """Cornering stiffness of each axle group by path, as a fraction of that at the nominal load of its tyres.

    K = K_max sin(2 atan(F_z / F_K)) of PAC2002, with the F_K that gives the load sensitivity at the nominal load. A
    VehicleError where the static axle loads are not determined.
    """
    values = saturation_parameters(vehicle)
    square = values[STIFFNESS_SENSITIVITY] / (2 - values[STIFFNESS_SENSITIVITY])  # (nominal load / F_K)^2
    fractions = {}
    for path, load in vehicle.axle_loads().items():
        q = load / values[f"{path}.tyres"] / NOMINAL_LOAD
        fractions[path] = q * (1 + square) / (1 + square * q**2)
    return fractions


class Contact(NamedTuple):
    """What acts on the tyres of an axle group."""

    slip: ca.SX  # slip angle, rad
    suspension: ca.SX = NO_CHANGE  # moment K* phi + C* phi', N m; see `unit_equations.suspension_moment`
    roll_axis_height: ca.SX = NO_CHANGE  # of the unit, m
    load_change: ca.SX = NO_CHANGE  # load of the group less the static one, N
    longitudinal: ca.SX = NO_CHANGE  # longitudinal force of the group, N


Law = Callable[[Expressions, str, Contact], ca.SX]
"""From parameters by name, the path of an axle group and its contact to the secants: F / alpha, N/rad, (1,), or if the
group has a pneumatic trail, also -M / alpha, N m/rad, (2,)."""


def axle_forces(secants: ca.SX, slip: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Side force, N, and aligning moment, N m, of an axle at its slip angle, rad, with its fraction of the secants."""
    forces = secants * slip
    return forces[0], -forces[1] if forces.shape[0] > 1 else ca.SX(0)


def linear(p: Expressions, path: str, _: Contact) -> ca.SX:
    """The linear law; see `Law`."""
    C, trail = p[f"{path}.cornering_stiffness"], p.get(f"{path}.pneumatic_trail")
    return ca.vertcat(C) if trail is None else ca.vertcat(C, trail * C)


def softening_factor(rate: ca.SX, slip: ca.SX) -> ca.SX:
    """1 / (1 + rate |slip|), a factor of the cornering stiffness of an axle group; rate in 1/rad, slip in rad."""
    return 1 / (1 + rate * (ca.sqrt(slip * slip + SMOOTHING**2) - SMOOTHING))


class Longitudinal(NamedTuple):
    """The longitudinal forces of an axle group, N."""

    driving: ca.SX  # 0 or more
    braking: ca.SX  # 0 or less
    rolling: ca.SX  # 0 or less: rolling resistance

    @property
    def total(self) -> ca.SX:
        """Their sum."""
        return self.driving + self.braking + self.rolling


def longitudinal_forces(
    p: Expressions, vehicle: Vehicle, speed: ca.SX, speed_rate: ca.SX, lateral: Sequence[ca.SX] = ()
) -> Mapping[str, Longitudinal]:
    """The longitudinal forces of each axle group by its path, at a speed, m/s, its derivative and the lateral
    acceleration of each unit, m/s^2, by default 0."""
    paths = vehicle.group_paths()
    driven = vehicle.driven_groups()[-1]
    rolling = {path: -p[ROLLING_RESISTANCE] * p[f"{path}.static_load"] for path in paths}
    mass = sum((p[f"{unit.name}.mass"] for unit in vehicle.units), ca.SX(0))
    side = sum(
        (
            (p[f"{path}.static_load"] / GRAVITY) ** 2
            * ca.fmin(a * a, LARGEST_TURN**2)
            / p[f"{path}.cornering_stiffness"]
            for unit, a in zip(vehicle.units, lateral, strict=False)
            for path in map(unit.group_path, unit.axle_groups)
        ),
        ca.SX(0),
    )
    needed = mass * speed_rate + drag(p[DRAG_AREA], speed) - sum(rolling.values(), ca.SX(0)) + side
    brakes = ca.fmin(needed, 0)
    alone = p[DRIVE_AXLE_BRAKING] * ca.fmax(brakes, -AUXILIARY * mass)
    per_load = (brakes - alone) / sum(p[f"{path}.static_load"] for path in paths)
    return {
        path: Longitudinal(
            driving=ca.fmax(needed, 0) if path == driven else NO_CHANGE,
            braking=p[f"{path}.static_load"] * per_load + (alone if path == driven else NO_CHANGE),
            rolling=rolling[path],
        )
        for path in paths
    }


def _pull(vehicle: Vehicle) -> dict[str, float]:
    """Longitudinal forces of axle groups, N, by which only the first coupling pulls more: a force against the motion
    on the first axle group of the second unit."""
    return {vehicle.units[1].group_path(vehicle.units[1].axle_groups[0]): -1e3} if len(vehicle.units) > 1 else {}


def root_law(slip: ca.SX, load: ca.SX, stiffness: ca.SX, friction: ca.SX) -> ca.SX:
    """C alpha / sqrt(1 + s^2), s = C alpha / (mu N); see `TyreLaw`."""
    return stiffness * slip / ca.sqrt(1 + (stiffness * slip / (load * friction)) ** 2)


def saturating(p: Expressions, path: str, contact: Contact, side_force: SideForce = root_law) -> ca.SX:
    """The saturating law, or with the side force of another one; see `Law`."""
    fraction = force_fraction(side_force)
    slip, suspension, roll_axis_height, load_change, longitudinal = contact
    C, N = p[f"{path}.cornering_stiffness"], p[f"{path}.static_load"]
    mu = p.get(SHAPE, 1) * p[f"{path}.relative_friction"] * p[FRICTION]
    q = N / p[f"{path}.tyres"] / NOMINAL_LOAD
    stiffness_sensitivity, friction_sensitivity = p[STIFFNESS_SENSITIVITY] * q**2, p[FRICTION_SENSITIVITY]
    even = fraction(slip, N, C, mu)  # without load transfer
    moment = suspension + roll_axis_height * even * C * slip
    forward = ca.fmax(ca.fmin(load_change / N, 1), -1)
    transfer = ca.fmax(ca.fmin(moment / (N * p[HALF_TRACK]), 1 + forward), -1 - forward)
    trail, secants = p.get(f"{path}.pneumatic_trail"), ca.SX(0)
    for side in (1, -1):
        change = side * transfer + forward
        k = 1 - stiffness_sensitivity * change
        limit = N * mu * (1 - friction_sensitivity * (q * (1 + change) - 1))  # mu N, for the static load
        used = (longitudinal / (limit * ca.fmax(1 + change, SMALL_LOAD))) ** 2
        stiffness = C * k * _braked_factor(p[COMBINED_SLIP] * used)
        grip, friction = _braked_factor(used), limit / N
        reduction = 1 / fraction(slip, 1 / friction, stiffness / (limit * grip), friction)  # at 1 N, for any load
        secant = stiffness / 2 * (1 + change) / reduction
        secants += ca.vertcat(secant) if trail is None else ca.vertcat(secant, trail * grip**2 / reduction**2 * secant)
    return secants


LAWS: Mapping[TyreLaw, Law] = {"linear": linear, "saturating": saturating}


def law_of(tyres: Tyres) -> Law:
    """The law of a model."""
    return LAWS[tyres] if isinstance(tyres, str) else partial(saturating, side_force=tyres)


def _braked_factor(loss: ca.SX) -> ca.SX:
    """sqrt(1 - loss), with a smooth transition to `LOCKED`; exactly 1 at a loss of 0."""

    def ramp(x: ca.SX | float) -> ca.SX:
        return (x + ca.sqrt(x * x + LOCKING**2)) / 2

    free = 1 - LOCKED**2
    return ca.sqrt(LOCKED**2 + free * ramp(free - loss) / ramp(free))
