"""The linear equations of motion of any chain of units: E x' = A x + B d, forward speed u an input.

Every unit's velocity is a linear function of the chain's generalised velocities w = (lateral velocity of the first
unit, all yaw rates, all roll rates), v_i = J_i w - u (psi_i - psi_1). The couplings write J (the article's A7, before
it is differentiated); d'Alembert's principle, sum J_i' (M_i a_i - f_i) = 0, then removes every coupling force, and the
chain's mass matrix sum J_i' M_i J_i is symmetric and positive definite.

The state is x = (w without roll, articulation angles, roll angles, roll rates). The article's sideslip angles are
outputs, v_i / u: as states they would need the derivative of the speed.

Where an axle group has a relaxation length sigma, its side force follows the mean slip angle alpha of its axles late,
sigma s' = u (alpha - s), and s is one more state (first-order lag: H. B. Pacejka, Tyre and Vehicle Dynamics, 2006,
7.1); what the axles' slip angles differ by acts at once.

A road that leans sideways by an angle, its left edge higher, pulls every mass to the right with g times that angle, as
a lateral acceleration would. Unknown, it is a state more: one that nothing moves but process noise.

Range: small angles, linear tyres, speed that changes slowly, each unit braked or driven in proportion to its own mass
(no longitudinal force through the couplings).
"""

from collections.abc import Mapping
from dataclasses import dataclass

import casadi as ca

from fifthwheel.dynamics import unit as one
from fifthwheel.vehicle import Vehicle
from fifthwheel.vehicle.statics import STANDARD_GRAVITY as GRAVITY

BANK = "bank.road"
"""Name of the state that is the road's lean, rad, left edge higher."""


def state_names(vehicle: Vehicle, *, roll: bool, bank: bool = False) -> tuple[str, ...]:
    """The state's signals in order: 2 n of them for n units, 4 n with roll, one for each group with a lag, the bank."""
    units = [unit.name for unit in vehicle.units]
    names = [
        f"lateral_velocity.{units[0]}",
        *[f"yaw_rate.{u}" for u in units],
        *[f"articulation.{u}" for u in units[1:]],
    ]
    if roll:
        names += [f"roll.{u}" for u in units] + [f"roll_rate.{u}" for u in units]
    names += [f"slip_angle.{path}" for path in lagging_groups(vehicle)]
    return (*names, BANK) if bank else tuple(names)


def lagging_groups(vehicle: Vehicle) -> tuple[str, ...]:
    """Paths of the axle groups whose side force builds up on the way, front to rear."""
    return tuple(unit.group_path(group) for unit in vehicle.units for group in unit.axle_groups if group.lagging)


@dataclass(frozen=True, kw_only=True)
class Motion:
    """What every unit is doing, as expressions of the state: one entry a unit."""

    v: tuple[ca.SX, ...]  # m/s, lateral velocity on the roll axis under the CoG
    across: tuple[ca.SX, ...]  # m/s, the same in the axes of the first unit: v + u heading
    r: tuple[ca.SX, ...]  # rad/s
    heading: tuple[ca.SX, ...]  # rad, psi_i - psi_1
    roll: tuple[ca.SX, ...]  # rad, zeros without roll
    roll_rate: tuple[ca.SX, ...]  # rad/s
    jacobian: tuple[ca.SX, ...]  # J_i: (v, r[, p]) of unit i per generalised velocity
    slip: Mapping[str, ca.SX]  # rad, that the side forces have reached, by group; none where they have no lag
    bank: ca.SX  # rad, of the road; zero where it is no state


@dataclass(frozen=True, kw_only=True)
class Equations:
    """E x' = A x + B d with A = A0 + A1/u + A2 u, B = B0 + B2 u; everything symbolic in the parameters."""

    mass: ca.SX  # (m, m) of the generalised velocities, symmetric positive definite
    A0: ca.SX  # (n, n), rows in the order of E x'
    A1: ca.SX
    A2: ca.SX
    B0: ca.SX  # (n, steered axles)
    B2: ca.SX
    velocities: tuple[int, ...]  # places of the generalised velocities in the state

    def state_space(self, speed: ca.SX) -> tuple[ca.SX, ca.SX]:
        """x' = A x + B d: A (n, n) and B (n, steered axles), at `speed` m/s."""
        A0, A1, A2, B0, B2 = (self._solved(matrix) for matrix in (self.A0, self.A1, self.A2, self.B0, self.B2))
        return A0 + A1 / speed + A2 * speed, B0 + B2 * speed

    def E(self) -> ca.SX:
        """The left-hand side, (n, n): the mass matrix at the velocities, ones elsewhere."""
        n = self.A0.shape[0]
        E = ca.SX.eye(n)
        for i, row in enumerate(self.velocities):
            for j, column in enumerate(self.velocities):
                E[row, column] = self.mass[i, j]
        return E

    def _solved(self, right: ca.SX) -> ca.SX:
        solved = ca.SX(right)
        solution = solve_positive(self.mass, right[list(self.velocities), :])
        for i, row in enumerate(self.velocities):
            solved[row, :] = solution[i, :]
        return ca.sparsify(solved)


def solve_positive(M: ca.SX, right: ca.SX) -> ca.SX:
    """M^-1 right by L D L' without pivoting; M symmetric positive definite."""
    n = M.shape[0]
    L, D = ca.SX.eye(n), [ca.SX(0)] * n
    for j in range(n):
        D[j] = M[j, j] - sum((L[j, k] ** 2 * D[k] for k in range(j)), ca.SX(0))
        for i in range(j + 1, n):
            L[i, j] = (M[i, j] - sum((L[i, k] * L[j, k] * D[k] for k in range(j)), ca.SX(0))) / D[j]
    rows = [right[i, :] for i in range(n)]
    for i in range(n):
        for k in range(i):
            rows[i] = rows[i] - L[i, k] * rows[k]
    rows = [row / D[i] for i, row in enumerate(rows)]
    for i in reversed(range(n)):
        for k in range(i + 1, n):
            rows[i] = rows[i] - L[k, i] * rows[k]
    return ca.vertcat(*rows)


def motion(
    p: Mapping[str, ca.SX], vehicle: Vehicle, x: ca.SX, speed: ca.SX, *, roll: bool, bank: bool = False
) -> Motion:
    """Kinematics of every unit from the chain's state, coupling by coupling from the front.

    A coupling's point has one lateral velocity whichever of its two units it is reckoned from:
    v + (x_c - x_cog) r - (h_c - h_r) p on the unit in front, less u times the articulation, equals the same behind.
    """
    units = vehicle.units
    n = len(units)
    places = {name: i for i, name in enumerate(state_names(vehicle, roll=roll, bank=bank))}
    m = 1 + (2 if roll else 1) * n
    basis = ca.SX.eye(m)
    yaw, rolling = [basis[1 + i, :] for i in range(n)], [basis[1 + n + i, :] if roll else ca.SX(1, m) for i in range(n)]
    lateral, heading = [basis[0, :]], [ca.SX(0)]
    for i, coupling in enumerate(vehicle.couplings):
        front, rear = units[i].name, units[i + 1].name
        ahead = p[f"{coupling.name}.leading_position"] - p[f"{front}.cog"]
        behind = p[f"{coupling.name}.trailing_position"] - p[f"{rear}.cog"]
        above_front = p[f"{coupling.name}.height"] - p[f"{front}.roll_axis_height"]
        above_rear = p[f"{coupling.name}.height"] - p[f"{rear}.roll_axis_height"]
        lateral.append(
            lateral[i] + ahead * yaw[i] - above_front * rolling[i] - behind * yaw[i + 1] + above_rear * rolling[i + 1]
        )
        heading.append(heading[i] + x[places[f"articulation.{rear}"]])
    w = x[velocity_places(vehicle, roll=roll)]
    return Motion(
        v=tuple(lateral[i] @ w - speed * heading[i] for i in range(n)),
        across=tuple(lateral[i] @ w for i in range(n)),
        r=tuple(x[places[f"yaw_rate.{u.name}"]] for u in units),
        heading=tuple(heading),
        roll=tuple(x[places[f"roll.{u.name}"]] if roll else ca.SX(0) for u in units),
        roll_rate=tuple(x[places[f"roll_rate.{u.name}"]] if roll else ca.SX(0) for u in units),
        jacobian=tuple(ca.vertcat(lateral[i], yaw[i], *([rolling[i]] if roll else [])) for i in range(n)),
        slip={path: x[places[f"slip_angle.{path}"]] for path in lagging_groups(vehicle)},
        bank=x[places[BANK]] if bank else ca.SX(0),
    )


def velocity_places(vehicle: Vehicle, *, roll: bool) -> list[int]:
    """Where the generalised velocities stand in the state."""
    names = state_names(vehicle, roll=roll)
    return [i for i, name in enumerate(names) if name.split(".")[0] in ("lateral_velocity", "yaw_rate", "roll_rate")]


def equations(p: Mapping[str, ca.SX], vehicle: Vehicle, *, roll: bool, bank: bool = False) -> Equations:
    """The chain's equations of motion.

    Args:
        p: every path of `vehicle.parameters()`, each a number or a symbol.
        vehicle: units, axles and couplings; its numbers are not used.
        roll: yaw and roll (the article's 5 degrees of freedom for two units) or yaw only (3).
        bank: the road's lean is a state.
    """
    names = state_names(vehicle, roll=roll, bank=bank)
    x, u, slowness = ca.SX.sym("x", len(names)), ca.SX.sym("u"), ca.SX.sym("slowness")
    steer = {name: ca.SX.sym(name) for name in vehicle.steer_signals()}
    moving = motion(p, vehicle, x, u, roll=roll, bank=bank)
    size = 3 if roll else 2
    m = 1 + (2 if roll else 1) * len(vehicle.units)
    M, force = ca.SX(m, m), ca.SX(m, 1)
    slipping: dict[str, ca.SX] = {}  # u times the slip angle that a group's forces tend to
    for i, unit in enumerate(vehicle.units):
        J, inertia = moving.jacobian[i], one.mass_matrix(p, unit, roll=roll)
        M += ca.mtimes([J.T, inertia, J])
        going = (moving.across[i], moving.heading[i], moving.r[i], steer)
        applied = one.tyre_forces(p, unit, *going, slowness, moving.slip)
        if roll:
            own = one.roll_moment(one.roll_body(p, unit), moving.roll[i], moving.roll_rate[i])
            applied = ca.vertcat(applied, own)
        for group in unit.axle_groups:
            towards = one.mean_slip(p, unit, group, *going)
            slipping[unit.group_path(group)] = u * towards.turned - towards.drift
        # a_i = J_i w' + u r_1 for every unit: v_i' holds -u (r_i - r_1), the turning axes add u r_i
        carried = inertia[:, 0] * (u * moving.r[0] + GRAVITY * moving.bank)
        force += J.T @ (applied - carried[:size])
    if roll:
        for i, coupling in enumerate(vehicle.couplings):
            twist, rate = moving.roll[i + 1] - moving.roll[i], moving.roll_rate[i + 1] - moving.roll_rate[i]
            moment = p[f"{coupling.name}.roll_stiffness"] * twist + p[f"{coupling.name}.roll_damping"] * rate
            front = 1 + len(vehicle.units) + i
            force[front] += moment
            force[front + 1] -= moment
    places = velocity_places(vehicle, roll=roll)
    right = [ca.SX(0)] * len(names)
    for row, place in enumerate(places):
        right[place] = force[row]
    for k, name in enumerate(names):
        quantity, unit_name = name.split(".")[:2]
        if quantity == "articulation":
            i = [unit.name for unit in vehicle.units].index(unit_name)
            right[k] = moving.r[i] - moving.r[i - 1]
        elif quantity == "roll":
            right[k] = moving.roll_rate[[unit.name for unit in vehicle.units].index(unit_name)]
    for path, reached in moving.slip.items():
        right[names.index(f"slip_angle.{path}")] = (slipping[path] - u * reached) / p[f"{path}.relaxation_length"]
    whole = ca.vertcat(*right)
    none = ca.vertcat(u, slowness), ca.DM([0, 0])
    by_state = ca.jacobian(whole, x)
    by_steer = ca.jacobian(whole, ca.vertcat(*steer.values())) if steer else ca.SX(len(names), 0)
    A1, A2 = (ca.reshape(ca.jacobian(by_state, s), by_state.shape) for s in (slowness, u))
    B2 = ca.reshape(ca.jacobian(by_steer, u), by_steer.shape)
    A0, B0 = (ca.substitute(matrix, *none) for matrix in (by_state, by_steer))
    A0, A1, A2, B0, B2 = (ca.sparsify(ca.simplify(matrix)) for matrix in (A0, A1, A2, B0, B2))
    return Equations(mass=M, A0=A0, A1=A1, A2=A2, B0=B0, B2=B2, velocities=tuple(places))
