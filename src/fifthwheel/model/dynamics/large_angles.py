"""Equations of motion with tyres that saturate and articulation angles that are not small.

The forward speed u of the first unit and its derivative u' are given. With the generalised velocities w of `chain`
and the velocities of `unit_equations`, Kane's equations

    sum J_i' (M_i a_i - f_i) = 0,        J_i = d(u_i, v_i, r_i, p_i) / dw,

with the accelerations u_i' - r_i v_i and v_i' + r_i u_i, have no forces of the couplings and no driving force, because
the first unit drives (T. R. Kane and D. A. Levinson, Dynamics, 1985, chapter 6). With side slip, the units behind pull
back at the first coupling, by the force that keeps them at the speed of the first unit,

    X = sum_i e_i' (M_i a_i - f_i),        e_i = (cos psi_i, -sin psi_i, 0, 0),

with the headings psi_i from that of the first unit. Roll angles are small. For small angles, linear tyres and u' = 0
the equations are those of `chain`.

The axle groups have the longitudinal forces of `tyres.longitudinal_forces`. The first unit supplies what these forces
lack for u', such as the drag of side forces. The drag of the air acts on the first unit, `AIR_HEIGHT` above the road,
and moves load from its front to its rear axle group. On a rolled body the inertia force -m_s u' acts beside the roll
axis: its yaw moment is -m_s h phi u' cos psi, with the heading psi of the unit from that of the first. So do the
longitudinal forces of the couplings.

The load of an axle group changes by -m_b u', from the balance of moments in pitch (`Vehicle.axle_loads`), with the
braking load m_b of a truck whose groups all brake in proportion to their static loads. X without what it is in such a
truck, at the height of the coupling, moves load from the front to the rear axle group of the first unit. Where the
wheels of the units behind brake less or more than in such a truck, that difference, on the road, also turns these units
in pitch and so loads the coupling; rolling resistance acts on the hubs, near the height of the coupling. Of the pull of
side slip only that part counts which is larger than the braking forces of the units behind: it relieves their brakes.
On a road with a grade, u' + g sin(grade) takes the place of u' in all of this, because u' occurs in forces only.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import casadi as ca

from fifthwheel.base.units import STANDARD_GRAVITY as GRAVITY
from fifthwheel.model.dynamics import chain, unit_equations
from fifthwheel.model.dynamics.symbolic import Expressions, Stages, solve_positive_definite
from fifthwheel.model.dynamics.tyres import (
    NO_CHANGE,
    Contact,
    Law,
    Longitudinal,
    axle_forces,
    longitudinal_forces,
    saturating,
)
from fifthwheel.model.dynamics.unit_equations import (
    LARGE,
    Motion,
    angle_rates,
    beside_roll_axes,
    group_motion,
    suspension_moment,
)
from fifthwheel.truck import Unit, Vehicle
from fifthwheel.truck.driveline import drag
from fifthwheel.truck.loads import group_position
from fifthwheel.truck.quantities import DRAG_AREA

AIR_HEIGHT = 1.5
"""m; half the height of a cab with its deflector, and less because part of the drag is under the floor."""


@dataclass(frozen=True, kw_only=True)
class LargeAngles:
    """Rates of the state and motion of the units: expressions of state, speed, steer angles and the stages."""

    stages: Stages
    rates: ca.SX  # x' (n,)
    motion: Motion
    acceleration: tuple[ca.SX, ...]  # of each unit in its axes: (v' + u r, r'[, p']), m/s^2 and rad/s^2
    side_force: Expressions  # of the tyres of each axle group by its path, N
    load_change: Expressions  # of axle groups, by their path, from the static load, N
    pull: ca.SX  # X without what it is in a truck that brakes by its static loads, N; its derivatives are neglected


def large_angles(
    p: Expressions,
    vehicle: Vehicle,
    x: ca.SX,
    speed: ca.SX,
    steer: Expressions,
    *,
    roll: bool,
    bank: bool = False,
    speed_rate: ca.SX = NO_CHANGE,
    law: Law = saturating,
) -> LargeAngles:
    """The equations; arguments as in `chain`, with u' in m/s^2 and the law of the tyres.

    The parameters are also those of `tyres.saturation_parameters`.
    """
    states, n, stages = chain.by_name(vehicle, x, roll=roll, bank=bank), len(vehicle.units), Stages()
    index = {name: i for i, name in enumerate(states)}
    motion = Motion.of(p, vehicle, states, speed, LARGE)
    velocities = chain.velocity_indices(vehicle, roll=roll)
    rate = ca.SX(len(index), 1)
    for name, of_angle in angle_rates(vehicle, motion).items():
        if name in index:
            rate[index[name]] = of_angle
    M, force = ca.SX(len(velocities), len(velocities)), ca.SX(len(velocities), 1)
    convective, jacobians, beside = list[ca.SX](), list[ca.SX](), beside_roll_axes(p, vehicle, motion)
    tyres: dict[str, _Tyres] = {}
    pull, pull_rate = ca.SX(0), ca.SX(1, len(velocities))  # X = pull + pull_rate w'
    lateral = [u * r for u, r in zip(motion.u, motion.r, strict=True)]
    brakes_behind, longitudinal = ca.SX(0), longitudinal_forces(p, vehicle, speed, speed_rate, lateral)
    changes = _known_load_changes(p, vehicle, speed, speed_rate, longitudinal)
    for i, unit in enumerate(vehicle.units):
        planar = ca.vertcat(motion.u[i], motion.v[i])
        turn = ca.jtimes(planar, x, rate)  # by the articulation angles, at constant w
        forward = ca.vertcat(ca.cos(motion.heading[i]), -ca.sin(motion.heading[i]))
        along = speed_rate * forward
        convective.append(turn + motion.r[i] * ca.vertcat(-motion.v[i], motion.u[i]) + along)
        J = ca.jacobian(ca.vertcat(motion.u[i], motion.velocity[i]), x[velocities])
        jacobians.append(J)
        inertia = ca.diagcat(p[f"{unit.name}.mass"], unit_equations.mass_matrix(p, unit, roll=roll))
        applied, of_unit = _tyre_forces(p, unit, stages, motion, i, steer, longitudinal, changes, law)
        tyres |= of_unit
        for path, group in of_unit.items():
            if path in motion.lagged_slip:
                length = unit_equations.relaxation_length(p, unit, path)
                rate[index[f"slip_angle.{path}"]] = motion.u[i] * group.lag / length
        if roll:
            body = unit_equations.roll_body(p, unit)
            applied[2] -= body.moment * motion.roll[i] * along[0]
            applied = ca.vertcat(applied, unit_equations.roll_moment(body, motion.roll[i], motion.roll_rate[i]))
        forward_force = sum((longitudinal[path].total for path in of_unit), ca.SX(0))
        force += ca.jacobian(beside[i], x[velocities]).T @ (
            ca.vertcat(forward_force, 0) - p[f"{unit.name}.mass"] * along
        )
        known = ca.vertcat(convective[i], ca.SX(2 if roll else 1, 1))
        known[1] += GRAVITY * motion.bank
        M += ca.mtimes([J.T, inertia, J])
        force += J.T @ (applied - inertia @ known)
        if i:
            pull += forward.T @ (inertia @ known - applied)[:2]
            pull_rate += forward.T @ (inertia @ J)[:2, :]
            on_coupling = p[f"{unit.name}.mass"] - sum(p[f"{path}.static_load"] for path in of_unit) / GRAVITY
            pull -= on_coupling * speed_rate  # the braking loads contain it
            brakes_behind += sum((longitudinal[path].braking for path in of_unit), ca.SX(0))
    force += chain.coupling_moments(p, vehicle, motion, roll=roll)
    arms = _coupling_arms(p, vehicle)
    by_pull = _by_load(arms, tyres, force)
    free, slope = ca.horzsplit(solve_positive_definite(M, ca.horzcat(force, by_pull)))
    alone = (pull + pull_rate @ free) / (1 - pull_rate @ slope - _by_load(arms, tyres, pull))
    of_coupling = stages.held(ca.fmin(alone, 0) + ca.fmax(alone + brakes_behind, 0))
    solved = stages.solved(M, force + by_pull * of_coupling, free + slope * of_coupling)
    for row, k in enumerate(velocities):
        rate[k] = solved[row]
    acceleration = tuple(
        (jacobians[i] @ solved)[1:] + ca.vertcat(convective[i][1], ca.SX(2 if roll else 1, 1)) for i in range(n)
    )
    load_change = {path: arms.get(path, 0.0) * of_coupling for path in tyres}
    return LargeAngles(
        stages=stages,
        rates=ca.densify(rate),
        motion=motion,
        acceleration=acceleration,
        side_force={path: t.side_force(load_change[path]) for path, t in tyres.items()},
        load_change={path: load_change[path] + known for path, known in changes.items()},
        pull=of_coupling,
    )


def _wheelbase(p: Expressions, vehicle: Vehicle) -> ca.SX:
    """Distance between the means of the first and of the last axle group of the first unit, m."""
    unit = vehicle.units[0]
    front, rear = (group_position(p, unit, unit.axle_groups[end]) for end in (0, -1))
    length: ca.SX = front - rear
    return length


def _coupling_arms(p: Expressions, vehicle: Vehicle) -> dict[str, ca.SX]:
    """Load that an axle group of the first unit gains by a pull of its coupling, as a fraction of the pull."""
    unit, height = vehicle.units[0], p[f"{vehicle.couplings[0].name}.height"] if vehicle.couplings else ca.SX(0)
    arm = height / _wheelbase(p, vehicle)
    return {unit.group_path(unit.axle_groups[0]): -arm, unit.group_path(unit.axle_groups[-1]): arm}


def _known_load_changes(
    p: Expressions, vehicle: Vehicle, speed: ca.SX, speed_rate: ca.SX, longitudinal: Mapping[str, Longitudinal]
) -> dict[str, ca.SX]:
    """Change of the load of each axle group by its path, N, by u', by the pitch of the units behind where their wheels
    do not brake like all, and by the drag of the air; without `_coupling_arms` times X."""
    paths = [(i, unit.group_path(group)) for i, unit in enumerate(vehicle.units) for group in unit.axle_groups]
    lacking = sum(
        (
            p[f"{path}.static_load"] / GRAVITY * speed_rate - longitudinal[path].braking - longitudinal[path].driving
            for i, path in paths
            if i
        ),
        NO_CHANGE,
    )
    arms, air = _coupling_arms(p, vehicle), AIR_HEIGHT / _wheelbase(p, vehicle) * drag(p[DRAG_AREA], speed)
    changes = {}
    for _, path in paths:
        arm = arms.get(path, NO_CHANGE)
        changes[path] = (p[f"{path}.pull_load"] - arm) * lacking - p[f"{path}.braking_load"] * speed_rate
    unit = vehicle.units[0]
    changes[unit.group_path(unit.axle_groups[0])] -= air
    changes[unit.group_path(unit.axle_groups[-1])] += air
    return changes


class _Tyres(NamedTuple):
    """Tyres of an axle group."""

    slip: ca.SX  # rad, of each axle (a,), lagged if the group has a relaxation length
    lag: ca.SX  # rad, by which the mean slip of its axles is ahead
    secants: tuple[ca.SX, ...]  # variables: of each axle, see `tyres.Law`; without the load by the pull
    by_load: tuple[ca.SX, ...]  # variables: their derivatives with respect to the load of the group

    def side_force(self, load_change: ca.SX | float) -> ca.SX:
        """Side force of the group, N, with a change of its load, N."""
        each = zip(self.secants, self.by_load, ca.vertsplit(self.slip), strict=True)
        return sum(((secant[0] + load_change * slope[0]) * slip for secant, slope, slip in each), ca.SX(0))


def _by_load(gains: Expressions, tyres: Mapping[str, _Tyres], forces: ca.SX) -> ca.SX:
    """Derivative of forces by the loads that axle groups gain, by the path of the group."""
    return sum(
        (
            gain * ca.jacobian(forces, secant) @ slope
            for path, gain in gains.items()
            for secant, slope in zip(tyres[path].secants, tyres[path].by_load, strict=True)
        ),
        ca.SX(*forces.shape),
    )


def _tyre_forces(
    p: Expressions,
    unit: Unit,
    stages: Stages,
    motion: Motion,
    i: int,
    steer: Expressions,
    longitudinal: Mapping[str, Longitudinal],
    changes: Mapping[str, ca.SX],
    law: Law,
) -> tuple[ca.SX, dict[str, _Tyres]]:
    """Longitudinal and side force, N, and yaw moment, N m, on unit i without the load by the pull; the tyres by
    group. `changes` of the loads, N, by the path of the group."""
    total, tyres = ca.SX(3, 1), dict[str, _Tyres]()
    for group in unit.axle_groups:
        path, count = unit.group_path(group), len(group.on_road)
        axles = group_motion(p, unit, group, motion, i, steer).axles
        each = stages.variable(ca.vertcat(*[axle.slip for axle in axles]))
        mean = ca.sum1(each) / count
        slip = motion.lagged_slip.get(path, mean) + (each - mean)
        suspension = stages.variable(suspension_moment(p, path, motion.roll[i], motion.roll_rate[i]))
        load, forward = ca.SX.sym("load"), longitudinal[path].total
        change = load + changes[path]
        height = p[f"{unit.name}.roll_axis_height"]
        each_forces = [
            law(p, path, Contact(own, suspension, height, change, forward)) / count for own in ca.vertsplit(slip)
        ]
        secants, by_load = (
            tuple(stages.variable(ca.substitute(e, load, 0)) for e in expressions)
            for expressions in (each_forces, [ca.jacobian(forces, load) for forces in each_forces])
        )
        tyres[path] = _Tyres(slip, mean - motion.lagged_slip.get(path, mean), secants, by_load)
        forward /= count
        for axle, own, secant in zip(axles, ca.vertsplit(slip), secants, strict=True):
            side, aligning = axle_forces(secant, own)
            cos, sin = ca.cos(axle.steer), ca.sin(axle.steer)
            lateral = side * cos + forward * sin
            total += ca.vertcat(forward * cos - side * sin, lateral, axle.arm * lateral + aligning)
    return total, tyres
