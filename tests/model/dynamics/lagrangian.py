"""Equations of motion of a chain by Lagrange's method: an oracle that shares no formula with the library.

Unit i yaws by psi_i about the vertical, its sprung body rolls by phi_i about the unit's x-axis. The first unit moves as
X = u t + u' t^2 / 2, Y = y; every axle may brake along its unit. Each other unit is pinned, in plan view, at a point
that is fixed to the sprung body in front and to its own. Positions are exact to second order in the small coordinates,
so the equations are exact to first order.

Sympy gives the motion under a side force and its moment about the vertical at every axle, and the slip angle at every
axle. The relation of force and slip angle is added numerically: without lag, or with a relaxation length l. Then the
force F of a group (not its lagged slip angle, as in the library) is a state, F = C (alpha - d' / u) with the sideways
displacement d = F (l / C + c) of the road contact under the body: of the tyres, and c of the axles that roll on them
(`axle_compliance`). Each axle has an equal share of F and, without lag, the difference of its C_k alpha_k from the
mean.

Three numbers that the library does not need, and that therefore must have no effect, have arbitrary values: the
distance of the sprung CoG ahead of the unit's CoG, the sprung pitch inertia, and the yaw inertia of the sprung body.
"""

from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import sympy as sp
from scipy.linalg import block_diag
from sympy.physics.mechanics import LagrangesMethod, Point, ReferenceFrame, RigidBody, Vector, dynamicsymbols, inertia

from fifthwheel.base.types import Array
from fifthwheel.truck import AxleGroup, Unit, Vehicle

S = sp.Symbol
EPS = sp.Symbol("eps")
GRAVITY = 9.80665
NONE: Mapping[str, float] = {}
IRRELEVANT = {"ahead": 0.37, "Iyy": 23456.0, "Izz_sprung": 7654.0}


class Linear(NamedTuple):
    """E x' = F x + G d for the state with the names `states`."""

    states: tuple[str, ...]
    E: Array
    F: Array
    G: Array

    @property
    def A(self) -> Array:
        return np.asarray(np.linalg.solve(self.E, self.F), dtype=np.float64)

    @property
    def B(self) -> Array:
        return np.asarray(np.linalg.solve(self.E, self.G), dtype=np.float64)

    def ordered(self, states: Sequence[str]) -> "Linear":
        """The same system with its states, and the equation of each state, in another order."""
        assert sorted(states) == sorted(self.states)
        i = [self.states.index(name) for name in states]
        return Linear(tuple(states), self.E[np.ix_(i, i)], self.F[np.ix_(i, i)], self.G[i])


def linear(
    vehicle: Vehicle, speed: float, *, roll: bool = True, speed_rate: float = 0.0, brakes: Mapping[str, float] = NONE
) -> Linear:
    """The linear equations of a vehicle at a speed, m/s.

    Args:
        vehicle: with all its numbers.
        speed: m/s.
        roll: whether the suspensions are not rigid.
        speed_rate: u', m/s^2.
        brakes: longitudinal force of each axle group by its path, N; their sum is the mass of the vehicle times u'.
    """
    units, n = vehicle.units, len(vehicle.units)
    values: dict[str, float] = {"u": speed, "g": GRAVITY, "a": speed_rate}
    braking: list[float] = []  # of every axle
    groups: list[tuple[str, AxleGroup, list[int]]] = []  # path, group, indices of its axles
    steer: list[int] = []  # indices of the steered axles
    count = 0
    for i, unit in enumerate(units):
        values |= {f"{word}{i}": value for word, value in (_numbers(vehicle, unit) | IRRELEVANT).items()}
        values |= {f"x{i}_{k}": axle.position - unit.cog for k, axle in enumerate(unit.axles)}
        steer += [count + k for k, axle in enumerate(unit.axles) if axle.steerable]
        for group in unit.axle_groups:
            groups.append((unit.group_path(group), group, list(range(count, count + len(group.axles)))))
            count += len(group.axles)
            braking += [brakes.get(unit.group_path(group), 0.0) / len(group.axles)] * len(group.axles)
        values |= {f"b{i}_{k}": braking[count - len(unit.axles) + k] for k in range(len(unit.axles))}
        trails = [group.pneumatic_trail or 0.0 for group in unit.axle_groups for _ in group.axles]
        values |= {f"t{i}_{k}": trail for k, trail in enumerate(trails)}
    for i, coupling in enumerate(vehicle.couplings):
        values |= {
            f"lead{i}": coupling.leading_position - units[i].cog,
            f"lead_up{i}": coupling.height - units[i].roll_axis_height,
            f"trail{i + 1}": coupling.trailing_position - units[i + 1].cog,
            f"trail_up{i + 1}": coupling.height - units[i + 1].roll_axis_height,
            f"Kc{i + 1}": coupling.roll_stiffness,
            f"Cc{i + 1}": coupling.roll_damping,
            f"Kz{i + 1}": coupling.yaw_stiffness or 0.0,
            f"Cz{i + 1}": coupling.yaw_damping or 0.0,
        }
    function, arguments = lagrangian(tuple(len(unit.axles) for unit in units))
    M, D, K, H, P, R = (np.array(m, dtype=float) for m in function(*(values[name] for name in arguments)))
    if not roll:  # Lagrange's equations of the coordinates that are left
        M, D, K = (matrix[: n + 1, : n + 1] for matrix in (M, D, K))
        H, P, R = H[: n + 1], P[:, : n + 1], R[:, : n + 1]
    heights = [unit.roll_axis_height for unit in units for _ in unit.axle_groups]
    compliances = [axle_compliance(group, height) for (_, group, _), height in zip(groups, heights, strict=True)]
    T = side_forces([(group, indices) for _, group, indices in groups], compliances, speed)
    relaxation = [(path, group.cornering_stiffness) for path, group, _ in groups if group.relaxation_length]
    g = len(relaxation)

    # M q'' + D q' + K q = H f, slip angles P q' + R q + S d, and (f, F') = T (slip angles, F). f is inserted in the
    # first equation, and F' is appended to it
    by_slip, by_force = np.split(block_diag(H, np.eye(g)) @ T, [count], axis=1)
    M, D, K = (np.vstack([matrix, np.zeros((g, len(M)))]) for matrix in (M, D, K))
    braked = np.vstack([H @ np.diag(braking), np.zeros((g, count))])  # a steered axle brakes along its wheels
    D, K, driven = D - by_slip @ P, K - by_slip @ R, (by_slip + braked)[:, steer]

    # q = y, psi, phi, with y' = v + u psi_0, y'' = v' + u r_0 + u' psi_0, psi_i = psi_0 + their sum
    yaw, rolls = slice(1, n + 1), slice(n + 1, None)
    by_heading = D[:, 0] * speed + M[:, 0] * speed_rate + K[:, yaw].sum(axis=1)
    assert not K[:, 0].any()
    assert np.abs(by_heading).max() < 1e-12 * np.abs(K[:, yaw]).max(), "the equations depend on the heading"
    sums = np.tril(np.ones((n, n)))[:, 1:]
    D_yaw = D[:, yaw].copy()
    D_yaw[:, 0] += speed * M[:, 0]
    dynamic = [f"lateral_velocity.{units[0].name}", *(f"yaw_rate.{unit.name}" for unit in units)]
    angles = [f"articulation.{unit.name}" for unit in units[1:]]
    damping, stiffness = np.column_stack([D[:, 0], D_yaw, D[:, rolls]]), K[:, yaw] @ sums
    rates = np.column_stack([np.zeros(n - 1), np.diff(np.eye(n), axis=0)])  # articulation' per (v, r)
    if roll:
        dynamic += [f"roll_rate.{unit.name}" for unit in units]
        angles += [f"roll.{unit.name}" for unit in units]
        stiffness = np.column_stack([stiffness, K[:, rolls]])
        rates = np.block([[rates, np.zeros((n - 1, n))], [np.zeros((n, n + 1)), np.eye(n)]])
    m, a = len(dynamic), len(angles)
    right = np.column_stack([-damping, -stiffness, by_force])
    E = block_diag(M[:m], np.eye(a + g))
    F = np.vstack([right[:m], np.column_stack([rates, np.zeros((a, a + g))]), right[m:]])
    G = np.vstack([driven[:m], np.zeros((a, len(steer))), driven[m:]])
    unit_of_force = np.r_[np.ones(m + a), [C for _, C in relaxation]]  # F = C s
    F, G = F * unit_of_force / unit_of_force[:, None], G / unit_of_force[:, None]
    return Linear((*dynamic, *angles, *(f"slip_angle.{path}" for path, _ in relaxation)), E, F, G)


def axle_compliance(group: AxleGroup, roll_axis_height: float) -> float:
    """Sideways displacement of the road contact under a fixed body per side force of an axle group, m/N.

    The axle rolls on its tyres about the road contact by theta, the body on the axle about the roll centre of the
    suspension at the height h. The roll axis is at the height of the body that does not move when only the body rolls.
    """
    both = group.roll_stiffness + group.tyre_roll_stiffness  # of the axle, with the body fixed
    theta = group.roll_stiffness / both  # of the axle, per roll angle of the body: equal moments of the springs
    h = roll_axis_height / (1 - theta)  # the roll centre moves h theta to one side, and h - h_r to the other below it
    return h * h / both


def side_forces(groups: Sequence[tuple[AxleGroup, list[int]]], compliances: Sequence[float], speed: float) -> Array:
    """(side force of every axle, F' of every group with relaxation) by (slip angle of every axle, F of these groups).

    Without a relaxation length each axle has the force C alpha. With one, F tends to the sum of C alpha over the axles;
    each axle has an equal share of F, and the difference of its C alpha from the mean.
    """
    count = sum(len(indices) for _, indices in groups)
    T = np.zeros((count, count))
    for group, indices in groups:
        T[indices, indices] = group.cornering_stiffness / len(indices)
    for (group, indices), of_axles in zip(groups, compliances, strict=True):
        if not group.relaxation_length:
            continue
        k, n = len(T), len(indices)
        direct, compliance = T[indices, :].copy(), group.relaxation_length / group.cornering_stiffness + of_axles
        rate = speed / (group.cornering_stiffness * compliance)
        T = block_diag(T, np.array([[-rate]]))
        T[k, :k] = rate * direct.sum(axis=0)
        T[indices, :k] -= direct.mean(axis=0)
        T[indices, k] = 1 / n
    return T


def _numbers(vehicle: Vehicle, unit: Unit) -> dict[str, float]:
    """Numbers of a unit by their symbols: heights from the roll axis, the laden sprung body."""
    derived, sprung = vehicle.derived(), unit.laden_sprung_mass
    up = derived[f"{unit.name}.cog_height"] - unit.roll_axis_height
    return {
        "m": unit.mass,
        "Izz": unit.yaw_inertia,
        "ms": sprung,
        "up": up,
        "Ixx": derived[f"{unit.name}.roll_inertia"] - sprung * up**2,
        "Ixz": unit.sprung.roll_yaw_product,
        "K": sum(1 / (1 / group.roll_stiffness + 1 / group.tyre_roll_stiffness) for group in unit.axle_groups),
        "C": sum(  # to first order in frequency: see test_damper_in_series_with_the_tyres
            group.roll_damping / (1 + group.roll_stiffness / group.tyre_roll_stiffness) ** 2
            for group in unit.axle_groups
        ),
    }


@lru_cache
def lagrangian(axles: tuple[int, ...]) -> tuple[Any, tuple[str, ...]]:
    """M, D, K, H, P, R for a chain of units with these numbers of axles, and the names of the arguments.

    M q'' + D q' + K q = H f with f the side force of every axle; the slip angle is P q' + R q plus the steer angle.

    q: y of the first unit's CoG, all yaw angles, and all roll angles.
    """
    n, t = len(axles), dynamicsymbols._t
    ground, origin = ReferenceFrame("N"), Point("O")
    origin.set_vel(ground, 0)
    y, psi = dynamicsymbols("y"), dynamicsymbols(f"psi:{n}")
    phi = dynamicsymbols(f"phi:{n}")
    q = [y, *psi, *phi]
    small = [*q, *(x.diff(t) for x in q)]

    def second_order(r: Vector) -> Vector:
        xyz = (truncated(component, q, 2) for component in r.to_matrix(ground))
        return sum((c * e for c, e in zip(xyz, (ground.x, ground.y, ground.z), strict=True)), Vector(0))

    def point(name: str, r: Vector) -> Point:
        p = origin.locatenew(name, r)
        p.set_vel(ground, second_order(r).dt(ground))
        return p

    energy, loads, forces, slips = sp.Integer(0), [], [], []
    axis = (S("u") * t + S("a") * t**2 / 2) * ground.x + y * ground.y  # roll axis under the CoG of the unit
    yawed, rolled = [], []
    for i in range(n):
        m, Izz, ms, up, Ixx, Ixz, K, C = (S(f"{word}{i}") for word in ("m", "Izz", "ms", "up", "Ixx", "Ixz", "K", "C"))
        ahead, Iyy, Izs = (S(f"{word}{i}") for word in IRRELEVANT)
        unit = ground.orientnew(f"unit{i}", "Axis", [psi[i], ground.z])
        body = unit.orientnew(f"body{i}", "Axis", [phi[i], unit.x])
        yawed.append(unit)
        rolled.append(body)
        if i:  # from the coupling point to this unit
            axis = second_order(axis - S(f"trail{i}") * unit.x + S(f"trail_up{i}") * sp.sin(phi[i]) * unit.y)

        behind = ms * ahead / (m - ms)  # of the unsprung mass, m
        sprung_cog = point(f"sprung{i}", axis + ahead * body.x + up * body.z)
        central = inertia(body, Ixx, Iyy, Izs, izx=-(Ixz - ms * ahead * up))  # product: minus the integral of x z
        sprung = RigidBody(f"sprung{i}", sprung_cog, body, ms, (central, sprung_cog))
        rest_cog = point(f"rest{i}", axis - behind * unit.x)
        rest_yaw = Izz - Izs - ms * ahead**2 - (m - ms) * behind**2
        rest = RigidBody(f"rest{i}", rest_cog, unit, m - ms, (inertia(unit, 0, 0, rest_yaw), rest_cog))
        energy += truncated(sprung.kinetic_energy(ground) + rest.kinetic_energy(ground), small, 2)
        energy -= truncated(ms * S("g") * up * sp.cos(phi[i]) + K * phi[i] ** 2 / 2, q, 2)
        loads.append((body, -C * phi[i].diff(t) * unit.x))
        if i:
            energy -= S(f"Kc{i}") * (phi[i] - phi[i - 1]) ** 2 / 2
            moment = S(f"Cc{i}") * (phi[i] - phi[i - 1]).diff(t)
            loads += [(body, -moment * unit.x), (rolled[i - 1], moment * yawed[i - 1].x)]
            energy -= S(f"Kz{i}") * (psi[i] - psi[i - 1]) ** 2 / 2
            moment = S(f"Cz{i}") * (psi[i] - psi[i - 1]).diff(t)
            loads += [(unit, -moment * ground.z), (yawed[i - 1], moment * ground.z)]

        for k in range(axles[i]):
            axle, force = point(f"axle{i}_{k}", axis + S(f"x{i}_{k}") * unit.x), S(f"f{i}_{k}")
            v = axle.vel(ground)
            slips.append(truncated(-sp.atan(v.dot(unit.y) / v.dot(unit.x)), small, 1))
            loads.append((axle, force * unit.y + S(f"b{i}_{k}") * unit.x))
            loads.append((unit, -S(f"t{i}_{k}") * force * unit.z))
            forces.append(force)
        if i + 1 < n:
            axis = second_order(axis + S(f"lead{i}") * unit.x - S(f"lead_up{i}") * sp.sin(phi[i]) * unit.y)

    equations = LagrangesMethod(energy, q, forcelist=loads, frame=ground).form_lagranges_equations()
    orders = [[x.diff(t, 2) for x in q], [x.diff(t) for x in q], q, forces]
    plain = {x: sp.Dummy() for order in orders for x in order}  # so that no derivative contains a coordinate
    scaled = equations.xreplace({x: EPS * symbol for x, symbol in plain.items()})
    linearised = scaled.diff(EPS).xreplace({EPS: sp.Integer(0), t: sp.Integer(0)})
    actual = [linearised.jacobian([plain[x] for x in order]) for order in orders]
    actual[3] = -actual[3]
    angles = sp.Matrix(slips).xreplace(plain).xreplace({t: sp.Integer(0)})
    actual += [angles.jacobian([plain[x] for x in order]) for order in orders[1:3]]
    arguments = sorted(set().union(*(m.free_symbols for m in actual)), key=str)
    return sp.lambdify(arguments, actual, modules="numpy", cse=True), tuple(str(a) for a in arguments)


def truncated(expression: Any, small: Sequence[Any], order: int) -> Any:
    """Taylor polynomial in the small quantities up to an order."""
    derivative = sp.sympify(expression).xreplace({x: EPS * x for x in small})
    total = sp.Integer(0)
    for k in range(order + 1):
        total += derivative.xreplace({EPS: sp.Integer(0)}) / sp.factorial(k)
        derivative = derivative.diff(EPS)
    return sp.expand(total)
