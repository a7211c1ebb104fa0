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

from fifthwheel.channels import SignalName
from fifthwheel.dynamics import unit_equations
from fifthwheel.dynamics.steering import SteeringSlopes, linear_slopes, own_states, wheel_signals
from fifthwheel.dynamics.symbolic import Expressions, Stages, solve_positive_definite
from fifthwheel.units import STANDARD_GRAVITY as GRAVITY
from fifthwheel.vehicle import Vehicle

BANK = "bank.road"
"""Name of the state that is the bank of the road, rad, positive with the left edge higher."""
GENERALISED_VELOCITIES = frozenset({"lateral_velocity", "yaw_rate", "roll_rate"})
"""Quantities of the states that are generalised velocities."""


def state_names(vehicle: Vehicle, *, roll: bool, bank: bool = False) -> tuple[str, ...]:
    """Names of the states: 2 n for n units, 4 n with roll, one for each relaxation length, own ones, and the bank."""
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


def relaxation_groups(vehicle: Vehicle) -> tuple[str, ...]:
    """Paths of the axle groups with a relaxation length, front to rear."""
    return tuple(unit.group_path(group) for unit in vehicle.units for group in unit.axle_groups if group.has_relaxation)


@dataclass(frozen=True, kw_only=True)
class Motion:
    """Motion of every unit as expressions of the state; tuples have one entry for each unit."""

    u: tuple[ca.SX, ...]  # m/s, forward speed
    v: tuple[ca.SX, ...]  # m/s, lateral velocity on the roll axis under the CoG
    across: tuple[ca.SX, ...]  # m/s, lateral velocity across the heading of the first unit, v + u heading
    r: tuple[ca.SX, ...]  # rad/s, yaw rate
    heading: tuple[ca.SX, ...]  # rad, psi_i - psi_1
    articulation: tuple[ca.SX, ...]  # rad, psi_i - psi_(i-1), zero of the first unit
    roll: tuple[ca.SX, ...]  # rad, zeros without roll
    roll_rate: tuple[ca.SX, ...]  # rad/s, zeros without roll
    jacobian: tuple[ca.SX, ...]  # J_i, (2 or 3, m): (v, r[, p]) of unit i by the m generalised velocities
    lagged_slip: Expressions  # rad, by the path of each group with a relaxation length
    bank: ca.SX  # rad, of the road; zero if it is not a state

    def of_axles(self, i: int) -> tuple[ca.SX, ca.SX, ca.SX, ca.SX]:
        """What the slip angles of unit i depend on: across, heading, articulation, r."""
        return self.across[i], self.heading[i], self.articulation[i], self.r[i]


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


class CouplingArms(NamedTuple):
    """Place of a coupling from the points under the CoG on the roll axes of both units, m."""

    ahead: ca.SX  # of the unit in front, along x
    behind: ca.SX  # of the unit behind, along x
    above_front: ca.SX  # the roll axis of the unit in front
    above_rear: ca.SX  # the roll axis of the unit behind


def coupling_arms(p: Expressions, vehicle: Vehicle, i: int) -> CouplingArms:
    """The arms of the coupling between units i and i + 1."""
    coupling, front, rear = vehicle.couplings[i].name, vehicle.units[i].name, vehicle.units[i + 1].name
    return CouplingArms(
        ahead=p[f"{coupling}.leading_position"] - p[f"{front}.cog"],
        behind=p[f"{coupling}.trailing_position"] - p[f"{rear}.cog"],
        above_front=p[f"{coupling}.height"] - p[f"{front}.roll_axis_height"],
        above_rear=p[f"{coupling}.height"] - p[f"{rear}.roll_axis_height"],
    )


def motion(p: Expressions, vehicle: Vehicle, x: ca.SX, speed: ca.SX, *, roll: bool, bank: bool = False) -> Motion:
    """Kinematics of every unit, coupling by coupling from the front.

    The lateral velocity of a coupling point is the same on both units: v + (x_c - x_cog) r - (h_c - h_r) p of the unit
    in front, less u times the articulation angle, equals v + (x_c - x_cog) r - (h_c - h_r) p of the unit behind.
    """
    units = vehicle.units
    n = len(units)
    index = {name: i for i, name in enumerate(state_names(vehicle, roll=roll, bank=bank))}
    m = 1 + (2 if roll else 1) * n
    basis = ca.SX.eye(m)
    yaw, rolling = [basis[1 + i, :] for i in range(n)], [basis[1 + n + i, :] if roll else ca.SX(1, m) for i in range(n)]
    lateral, heading, articulation = [basis[0, :]], [ca.SX(0)], [ca.SX(0)]
    for i in range(n - 1):
        arms, rear = coupling_arms(p, vehicle, i), units[i + 1].name
        lateral.append(
            lateral[i]
            + arms.ahead * yaw[i]
            - arms.above_front * rolling[i]
            - arms.behind * yaw[i + 1]
            + arms.above_rear * rolling[i + 1]
        )
        articulation.append(x[index[f"articulation.{rear}"]])
        heading.append(heading[i] + articulation[i + 1])
    w = x[velocity_indices(vehicle, roll=roll)]
    return Motion(
        u=tuple(speed for _ in units),
        v=tuple(lateral[i] @ w - speed * heading[i] for i in range(n)),
        across=tuple(lateral[i] @ w for i in range(n)),
        r=tuple(x[index[f"yaw_rate.{u.name}"]] for u in units),
        heading=tuple(heading),
        articulation=tuple(articulation),
        roll=tuple(x[index[f"roll.{u.name}"]] if roll else ca.SX(0) for u in units),
        roll_rate=tuple(x[index[f"roll_rate.{u.name}"]] if roll else ca.SX(0) for u in units),
        jacobian=tuple(ca.vertcat(lateral[i], yaw[i], *([rolling[i]] if roll else [])) for i in range(n)),
        lagged_slip={path: x[index[f"slip_angle.{path}"]] for path in relaxation_groups(vehicle)},
        bank=x[index[BANK]] if bank else ca.SX(0),
    )


def forward_row(p: Expressions, vehicle: Vehicle, motions: Motion, i: int, front: ca.SX) -> ca.SX:
    """Derivative (1, m) of the forward velocity of unit i > 0 by the generalised velocities, from that of the unit in
    front, to first order in angles: the velocity of the coupling across the unit in front, and couplings that are
    beside the roll axes of rolled units."""
    arms, before, after = coupling_arms(p, vehicle, i - 1), motions.jacobian[i - 1], motions.jacobian[i]
    rolling = before[2, :] if before.shape[0] > 2 else ca.SX(1, before.shape[1])
    across = before[0, :] + arms.ahead * before[1, :] - arms.above_front * rolling
    beside = arms.above_front * motions.roll[i - 1] * before[1, :] - arms.above_rear * motions.roll[i] * after[1, :]
    return front + motions.articulation[i] * across + beside


def slip_angles(
    p: Expressions, vehicle: Vehicle, x: ca.SX, speed: ca.SX, steer: Expressions, *, roll: bool
) -> dict[str, ca.SX]:
    """Slip angle of each axle group by its path, rad: the lagged one, or the mean of its axles."""
    motions, angles = motion(p, vehicle, x, speed, roll=roll), {}
    for i, unit in enumerate(vehicle.units):
        for group in unit.axle_groups:
            path = unit.group_path(group)
            mean = unit_equations.mean_slip_angle(p, unit, group, *motions.of_axles(i), steer)
            angles[path] = motions.lagged_slip.get(path, mean.direction - mean.drift / speed)
    return angles


def velocity_indices(vehicle: Vehicle, *, roll: bool) -> list[int]:
    """Indices of the generalised velocities in the state."""
    names = state_names(vehicle, roll=roll)
    return [i for i, name in enumerate(names) if SignalName.of(name).quantity in GENERALISED_VELOCITIES]


def angle_rates(vehicle: Vehicle, motions: Motion) -> dict[str, ca.SX]:
    """Derivatives of articulation angles and roll angles by the names of the states."""
    names = [unit.name for unit in vehicle.units]
    articulations = {f"articulation.{name}": motions.r[i] - motions.r[i - 1] for i, name in enumerate(names) if i}
    return articulations | {f"roll.{name}": rate for name, rate in zip(names, motions.roll_rate, strict=True)}


def coupling_moments(p: Expressions, vehicle: Vehicle, motions: Motion) -> ca.SX:
    """Generalised forces (m,) of the roll moments of all couplings, N m; with roll."""
    n = len(vehicle.units)
    force = ca.SX(1 + 2 * n, 1)
    for i, coupling in enumerate(vehicle.couplings):
        twist, rate = motions.roll[i + 1] - motions.roll[i], motions.roll_rate[i + 1] - motions.roll_rate[i]
        moment = p[f"{coupling.name}.roll_stiffness"] * twist + p[f"{coupling.name}.roll_damping"] * rate
        front = 1 + n + i
        force[front] += moment
        force[front + 1] -= moment
    return force


def own_values(vehicle: Vehicle, x: ca.SX, *, roll: bool, bank: bool) -> dict[str, ca.SX]:
    """The own states of the steering in x (n,), by name."""
    names = state_names(vehicle, roll=roll, bank=bank)
    return {name: x[names.index(name)] for name in own_states(vehicle)}


def linear_wheels(
    p: Expressions, vehicle: Vehicle, x: ca.SX, speed: ca.SX, steer: ca.SX, *, roll: bool, bank: bool = False
) -> dict[str, ca.SX]:
    """Steer angle of each steered axle by its signal, rad, from measured angles (k,); own equations are linear."""
    if vehicle.steering is not None:
        by_state, by_steer, *_ = linear_slopes(p, vehicle, state_names(vehicle, roll=roll, bank=bank), speed)
        steer = by_state @ x + by_steer @ steer
    names = wheel_signals(vehicle)
    return dict(zip(names, ca.vertsplit(steer), strict=True)) if names else {}


LINEAR_TYRES: Expressions = {}
"""No factors of cornering stiffnesses."""


def equations(
    p: Expressions, vehicle: Vehicle, *, roll: bool, bank: bool = False, stiffness_factors: Expressions = LINEAR_TYRES
) -> Equations:
    """The equations of motion of the chain.

    Two units have the article's 5 degrees of freedom with roll, and 3 without. `stiffness_factors` are factors of
    cornering stiffnesses, by the names of these, that may depend on the state.
    """
    symbols, without_factors = {name: ca.SX.sym(name) for name in stiffness_factors}, p
    p = {**p, **{name: p[name] * symbol for name, symbol in symbols.items()}}
    names = state_names(vehicle, roll=roll, bank=bank)
    x, u, inverse_speed = ca.SX.sym("x", len(names)), ca.SX.sym("u"), ca.SX.sym("inverse_speed")
    rate, pull, forward = ca.SX.sym("rate"), ca.SX.sym("pull"), ca.SX(1, 1 + (2 if roll else 1) * len(vehicle.units))
    steer = {name: ca.SX.sym(name) for name in wheel_signals(vehicle)}
    motions = motion(p, vehicle, x, u, roll=roll, bank=bank)
    size = 3 if roll else 2
    m = 1 + (2 if roll else 1) * len(vehicle.units)
    M, force = ca.SX(m, m), ca.SX(m, 1)
    speed_times_slip: dict[str, ca.SX] = {}  # u times the mean slip angle of each axle group
    for i, unit in enumerate(vehicle.units):
        J, inertia = motions.jacobian[i], unit_equations.mass_matrix(p, unit, roll=roll)
        M += ca.mtimes([J.T, inertia, J])
        kinematics = (*motions.of_axles(i), steer)
        applied = unit_equations.tyre_forces(p, unit, *kinematics, inverse_speed, motions.lagged_slip)
        if roll:
            body = unit_equations.roll_body(p, unit)
            applied = ca.vertcat(applied, unit_equations.roll_moment(body, motions.roll[i], motions.roll_rate[i]))
            applied[1] -= body.moment * motions.roll[i] * rate
        if i:
            forward = forward_row(p, vehicle, motions, i, forward)
            force -= forward.T * (p[f"{unit.name}.mass"] * pull)
        for group in unit.axle_groups:
            slip = unit_equations.mean_slip_angle(p, unit, group, *kinematics)
            speed_times_slip[unit.group_path(group)] = u * slip.direction - slip.drift
        # a_i = J_i w' + u r_1 - u' (psi_i - psi_1): v_i' contains -u (r_i - r_1), and the rotating axes add u r_i
        convective = inertia[:, 0] * (u * motions.r[0] - rate * motions.heading[i] + GRAVITY * motions.bank)
        force += J.T @ (applied - convective[:size])
    if roll:
        force += coupling_moments(p, vehicle, motions)
    velocities = velocity_indices(vehicle, roll=roll)
    right = angle_rates(vehicle, motions) | {names[index]: force[row] for row, index in enumerate(velocities)}
    units = {unit.group_path(group): unit for unit in vehicle.units for group in unit.axle_groups}
    for path, lagged in motions.lagged_slip.items():
        length = unit_equations.relaxation_length(without_factors, units[path], path)
        right[f"slip_angle.{path}"] = (speed_times_slip[path] - u * lagged) / length
    right_side = ca.vertcat(*[right.get(name, ca.SX(0)) for name in names])
    by_state = ca.jacobian(right_side, x)
    by_steer = ca.jacobian(right_side, ca.vertcat(*steer.values())) if steer else ca.SX(len(names), 0)
    factors = ca.vertcat(inverse_speed, u, rate, pull)
    A1, A2, A3, A4 = (ca.reshape(ca.jacobian(by_state, s), by_state.shape) for s in ca.vertsplit(factors))
    B2 = ca.reshape(ca.jacobian(by_steer, u), by_steer.shape)
    A0, B0 = (ca.substitute(matrix, factors, ca.DM.zeros(4)) for matrix in (by_state, by_steer))
    A0, A1, A2, A3, A4, B0, B2 = (ca.sparsify(ca.simplify(matrix)) for matrix in (A0, A1, A2, A3, A4, B0, B2))
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
