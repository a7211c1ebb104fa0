"""The linear equations of motion of a chain of units, E x' = A x + B d, with the forward speed u as an input.

The velocity of each unit is a linear function of the chain's generalised velocities w = (lateral velocity of the first
unit, all yaw rates, all roll rates): v_i = J_i w - u (psi_i - psi_1). The couplings determine J; they are equation (A7)
of Cheng and Cebon (2011) before it is differentiated. D'Alembert's principle, sum J_i' (M_i a_i - f_i) = 0, eliminates
all coupling forces, and the mass matrix of the chain, sum J_i' M_i J_i, is symmetric and positive definite.

The state is x = (lateral velocity, yaw rates, articulation angles, roll angles, roll rates, lagged slip angles, bank).
The article's sideslip angles are outputs, v_i / u; as states they would need the derivative of the speed.

An axle group with a relaxation length has its lagged slip angle s as a state: its side force follows the mean slip
angle alpha of its axles with a first-order lag, l s' = u (alpha - s) (H. B. Pacejka, Tyre and Vehicle Dynamics, 2006,
7.1), with the length l of `unit_equations.relaxation_length`. Differences of the slip angles within a group act without
lag.

A bank of the road, positive with the left edge higher, acts on every mass like a lateral acceleration of g times the
bank angle. As a state, the bank is constant except for process noise.

Speed changes. With the derivative u' of the speed, v_i' contains -u' (psi_i - psi_1), and the inertia force -m_s u' of
a rolled body acts beside the roll axis. The brakes of each unit decelerate its own mass. A driven axle, or engine and
retarder with the fraction b of the deceleration, act on the first unit only: the couplings then pull the mass behind
them with s = max(u', 0) + b min(u', 0), across the unit in front at an articulation angle. On a road with a grade,
u' + g sin(grade) takes the place of u'.

Range: small angles, linear tyres, no drag or rolling resistance.

In all functions p has the parameters by path, numbers or symbols; a vehicle gives units, axles and couplings, and its
numbers are not used. `roll`: yaw and roll, or yaw only. `bank`: whether the bank of the road is a state. x is the state
(n,), the speed is in m/s, and `steer` has the angle of the wheels of each steered axle, rad, by the name of its signal.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import casadi as ca

from fifthwheel.base.units import STANDARD_GRAVITY as GRAVITY
from fifthwheel.data.channels import SignalName
from fifthwheel.model.dynamics import unit_equations
from fifthwheel.model.dynamics.steering import SteeringSlopes, linear_slopes, own_states, wheel_signals
from fifthwheel.model.dynamics.symbolic import Expressions, Stages, solve_positive_definite
from fifthwheel.model.dynamics.unit_equations import BANK, SMALL, Motion, angle_rates, beside_roll_axes, group_motion
from fifthwheel.truck import Vehicle

GENERALISED_VELOCITIES = frozenset({"lateral_velocity", "yaw_rate", "roll_rate"})
"""Quantities of the states that are generalised velocities."""


def state_names(vehicle: Vehicle, *, roll: bool, bank: bool = False) -> tuple[str, ...]:
    """Names of the states: 2 n for n units, 4 n with roll, one for each relaxation length, own ones, and the bank.

    Equation (1) of Cheng and Cebon (2011) has both sideslip angles, not the lateral velocity and the articulation.
    """
    units = [unit.name for unit in vehicle.units]
    names = [
        f"lateral_velocity.{units[0]}",
        *[f"yaw_rate.{u}" for u in units],
        *[f"articulation.{u}" for u in units[1:]],
    ]
    if roll:
        names += [f"roll.{u}" for u in units] + [f"roll_rate.{u}" for u in units]
    names += [f"slip_angle.{path}" for path in relaxation_groups(vehicle)]
    names += own_states(vehicle)
    return (*names, BANK) if bank else tuple(names)


def by_name(vehicle: Vehicle, x: ca.SX, *, roll: bool, bank: bool = False) -> dict[str, ca.SX]:
    """The elements of the state x (n,) by name."""
    return dict(zip(state_names(vehicle, roll=roll, bank=bank), ca.vertsplit(x), strict=True))


def relaxation_groups(vehicle: Vehicle) -> tuple[str, ...]:
    """Paths of the axle groups with a relaxation length, front to rear."""
    return tuple(unit.group_path(group) for unit in vehicle.units for group in unit.axle_groups if group.has_relaxation)


class SpeedChange(NamedTuple):
    """How the speed changes, m/s^2."""

    rate: ca.SX  # u'
    pull: ca.SX  # s, by which the couplings pull the mass behind them

    @classmethod
    def of(cls, rate: ca.SX, drive_axle_braking: ca.SX | float) -> "SpeedChange":
        """At u', with the fraction of the braking force by engine and retarder."""
        return cls(rate, ca.fmax(rate, 0) + drive_axle_braking * ca.fmin(rate, 0))


@dataclass(frozen=True, kw_only=True)
class Equations:
    """E x' = F x + G d, symbolic in the parameters. With wheels that are steered as measured, F = A0 + A1/u + A2 u +
    A3 u' + A4 s and G = B0 + B2 u; own equations of the steering, linearised, change both.

    The matrices are linear in the symbols `factors`. E^-1 is applied to what each of them multiplies, so that this
    product depends on parameters only, where the values of the factors change from sample to sample.
    """

    mass: ca.SX  # (m, m), of the m generalised velocities, symmetric positive definite
    A0: ca.SX  # (n, n)
    A1: ca.SX
    A2: ca.SX
    A3: ca.SX
    A4: ca.SX
    B0: ca.SX  # (n, m), m axles that are steered
    B2: ca.SX
    velocities: tuple[int, ...]  # (m,) indices of the generalised velocities in the state
    factors: tuple[tuple[ca.SX, ca.SX], ...]  # symbols, each with its value
    steering: Callable[[ca.SX], SteeringSlopes] | None  # own equations at a speed, m/s

    def state_space(self, speed: ca.SX, change: SpeedChange | None = None) -> tuple[ca.SX, ca.SX]:
        """A (n, n) and B (n, k) of x' = A x + B d at a speed, m/s, by default a constant one."""
        return self._at_speed(speed, change, self._solve_E)

    def rates(
        self, speed: ca.SX, x: ca.SX, steer: ca.SX, value: ca.SX, stages: Stages, change: SpeedChange | None = None
    ) -> ca.SX:
        """x' (n,) with the rates of the generalised velocities as a variable of stages; `value` is x' without stages.

        A derivative of A and B contains those of the inverse mass matrix, which the variable avoids.
        """
        F, G = self.implicit(speed, change)
        right, rows = ca.densify(F @ x + G @ steer), list(self.velocities)
        for symbol, factor in self.factors:
            right = ca.substitute(right, symbol, factor)
        right[rows] = stages.solved(self.mass, right[rows], value[rows])
        return right

    def implicit(self, speed: ca.SX, change: SpeedChange | None = None) -> tuple[ca.SX, ca.SX]:
        """F (n, n) and G (n, k) of E x' = F x + G d at a speed, m/s, by default a constant one."""
        return self._at_speed(speed, change, lambda matrix: matrix)

    def _at_speed(self, speed: ca.SX, change: SpeedChange | None, of: Callable[[ca.SX], ca.SX]) -> tuple[ca.SX, ca.SX]:
        A, B = of(self.A0) + of(self.A1) / speed + of(self.A2) * speed, of(self.B0) + of(self.B2) * speed
        if change is not None:
            A += of(self.A3) * change.rate + of(self.A4) * change.pull
        return (A, B) if self.steering is None else self.steering(speed).applied(A, B)

    def E(self) -> ca.SX:
        """E (n, n): the mass matrix in the rows of the generalised velocities, the identity elsewhere."""
        E, rows = ca.SX.eye(self.A0.shape[0]), list(self.velocities)
        E[rows, rows] = self.mass
        return E

    def _solve_E(self, right: ca.SX) -> ca.SX:
        """E^-1 right, with the values of the factors."""
        total = ca.SX(*right.shape)
        for symbol, value in self.factors:
            total += value * self._solved(ca.reshape(ca.jacobian(right, symbol), right.shape))
            right = ca.substitute(right, symbol, 0)
        return ca.sparsify(total + self._solved(right))

    def _solved(self, right: ca.SX) -> ca.SX:
        """E^-1 right, without factors."""
        solved, rows = ca.sparsify(right), list(self.velocities)
        solved[rows, :] = solve_positive_definite(self.mass, solved[rows, :])
        return solved


def velocity_indices(vehicle: Vehicle, *, roll: bool) -> list[int]:
    """Indices of the generalised velocities in the state."""
    names = state_names(vehicle, roll=roll)
    return [i for i, name in enumerate(names) if SignalName.of(name).quantity in GENERALISED_VELOCITIES]


def coupling_moments(p: Expressions, vehicle: Vehicle, motion: Motion, *, roll: bool) -> ca.SX:
    """Generalised forces (m,) of the yaw moments of all couplings, and with roll of their roll moments, N m."""
    n = len(vehicle.units)
    force = ca.SX(1 + (2 if roll else 1) * n, 1)
    for i, coupling in enumerate(vehicle.couplings):
        twists = [("yaw", 1 + i, motion.articulation[i + 1], motion.r[i + 1] - motion.r[i])]
        if roll:
            angle, rate = motion.roll[i + 1] - motion.roll[i], motion.roll_rate[i + 1] - motion.roll_rate[i]
            twists.append(("roll", 1 + n + i, angle, rate))
        for axis, front, angle, rate in twists:
            stiffness, damping = (p.get(f"{coupling.name}.{axis}_{key}", ca.SX(0)) for key in ("stiffness", "damping"))
            moment = stiffness * angle + damping * rate
            force[front] += moment
            force[front + 1] -= moment
    return force


def linear_wheels(
    p: Expressions, vehicle: Vehicle, states: Expressions, speed: ca.SX, steer: ca.SX
) -> dict[str, ca.SX]:
    """Steer angle of each steered axle by its signal, rad, from measured angles (k,); own equations are linear."""
    if vehicle.steering is not None:
        by_state, by_steer, *_ = linear_slopes(p, vehicle, tuple(states), speed)
        steer = by_state @ ca.vertcat(*states.values()) + by_steer @ steer
    names = wheel_signals(vehicle)
    return dict(zip(names, ca.vertsplit(steer), strict=True)) if names else {}


LINEAR_TYRES: Expressions = {}
"""No factors of cornering stiffnesses."""


def equations(
    p: Expressions, vehicle: Vehicle, *, roll: bool, bank: bool = False, stiffness_factors: Expressions = LINEAR_TYRES
) -> Equations:
    """The equations of motion of the chain: those of each unit, coupled by equation (A7) of Cheng and Cebon (2011).

    Two units have the article's 5 degrees of freedom with roll, and 3 without. `stiffness_factors` are factors of
    cornering stiffnesses, by the names of these, that may depend on the state.
    """
    symbols, without_factors = {name: ca.SX.sym(name) for name in stiffness_factors}, p
    p = {**p, **{name: p[name] * symbol for name, symbol in symbols.items()}}
    names = state_names(vehicle, roll=roll, bank=bank)
    x, u, inverse_speed = ca.SX.sym("x", len(names)), ca.SX.sym("u"), ca.SX.sym("inverse_speed")
    rate, pull, states = ca.SX.sym("rate"), ca.SX.sym("pull"), by_name(vehicle, x, roll=roll, bank=bank)
    steer = {name: ca.SX.sym(name) for name in wheel_signals(vehicle)}
    # with a symbol for 1 / u the equations are polynomials, whose terms `_by_speed` separates
    motion = Motion.of(p, vehicle, states, u, SMALL._replace(direction=lambda _, v: v * inverse_speed))
    velocities, right = velocity_indices(vehicle, roll=roll), angle_rates(vehicle, motion)
    w, along, beside = x[velocities], ca.SX(0), beside_roll_axes(p, vehicle, motion)
    M, force = ca.SX(len(velocities), len(velocities)), ca.SX(len(velocities), 1)
    for i, unit in enumerate(vehicle.units):
        inertia = unit_equations.mass_matrix(p, unit, roll=roll)
        J = ca.jacobian(motion.velocity[i], w)
        M += ca.mtimes([J.T, inertia, J])
        applied = ca.SX(2, 1)
        for group in unit.axle_groups:
            path, moving = unit.group_path(group), group_motion(p, unit, group, motion, i, steer)
            applied += unit_equations.tyre_forces(p, path, moving)
            length = unit_equations.relaxation_length(without_factors, unit, path)
            right[f"slip_angle.{path}"] = u * (moving.mean - moving.slip) / length
        if roll:
            body = unit_equations.roll_body(p, unit)
            applied = ca.vertcat(applied, unit_equations.roll_moment(body, motion.roll[i], motion.roll_rate[i]))
            applied[1] -= body.moment * motion.roll[i] * rate
        if i:
            along += motion.articulation[i] * motion.at_coupling[i - 1]  # of the forward velocity, to second order
            force -= ca.jacobian(along + beside[i][0], w).T * (p[f"{unit.name}.mass"] * pull)
        # a_i = J_i w' + u r_1 - u' (psi_i - psi_1): v_i' contains -u (r_i - r_1), and the rotating axes add u r_i
        force += J.T @ (applied - inertia[:, 0] * (u * motion.r[0] - rate * motion.heading[i] + GRAVITY * motion.bank))
    force += coupling_moments(p, vehicle, motion, roll=roll)
    right |= {names[index]: force[row] for row, index in enumerate(velocities)}
    right_side = ca.vertcat(*[right.get(name, ca.SX(0)) for name in names])
    by_state = ca.jacobian(right_side, x)
    by_steer = ca.jacobian(right_side, ca.vertcat(*steer.values())) if steer else ca.SX(len(names), 0)
    A3, A4 = (ca.sparsify(ca.simplify(_slope(by_state, symbol))) for symbol in (rate, pull))
    constant = (ca.substitute(matrix, ca.vertcat(rate, pull), ca.DM.zeros(2)) for matrix in (by_state, by_steer))
    (A0, A1, A2), (B0, _, B2) = (_by_speed(matrix, u, inverse_speed) for matrix in constant)
    return Equations(
        mass=M,
        A0=A0,
        A1=A1,
        A2=A2,
        A3=A3,
        A4=A4,
        B0=B0,
        B2=B2,
        velocities=tuple(velocities),
        factors=tuple((symbol, stiffness_factors[name]) for name, symbol in symbols.items()),
        steering=partial(linear_slopes, without_factors, vehicle, names) if vehicle.steering else None,
    )


def _slope(matrix: ca.SX, symbol: ca.SX) -> ca.SX:
    return ca.reshape(ca.jacobian(matrix, symbol), matrix.shape)


def _by_speed(matrix: ca.SX, u: ca.SX, inverse_speed: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
    """M0, M1 and M2 of M0 + M1 / u + M2 u, from a matrix with u, 1 / u and their products up to u^2 / u."""
    over_u = _slope(matrix, inverse_speed)
    terms = matrix + _slope(over_u, u), over_u, _slope(matrix, u) + _slope(_slope(over_u, u), u) / 2
    at_zero = [ca.substitute(term, ca.vertcat(u, inverse_speed), ca.DM.zeros(2)) for term in terms]
    M0, M1, M2 = (ca.sparsify(ca.simplify(term)) for term in at_zero)
    return M0, M1, M2
