"""Low-speed turns: swept path, frontal and tail swing, friction demand of the steer tyres, European turning circle.

The outer wall of the outer front tyre follows a straight line, a quarter of a circle of 12.5 m and a straight line; in
the turning circle the outer front corner follows a straight line and a whole circle of 12.5 m. At
low speed the axles of a unit roll without side force in the sum: with distances L_j of its axles behind its coupling
(or the first axle of the first unit) and cornering stiffnesses C_j, it turns like a unit with one axle at

    L = sum C_j L_j^2 / sum C_j L_j,

so that the heading psi follows psi' = w / L, w the lateral velocity of the point in front per distance. Of a
self-steering axle C_j is the part 1 - s of its cornering stiffness. Where the articulation angle g steers axles by
k_j g, the axle at L moves in the direction of its wheels, k g with k = sum C_j L_j k_j / sum C_j L_j. The turn is
integrated over the distance by Runge-Kutta steps.

Friction demand: the axles of a group slip, because they turn about one centre. The forces of their saturating tyres
(`dynamics.tyres`) act on the unit in front at its coupling; the moment about the first unit's drive axles is balanced
by the steered tyres. The demand is their side force divided by the available friction mu N. Free rolling, no drive
thrust.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from fifthwheel.base.errors import VehicleError
from fifthwheel.base.types import Array
from fifthwheel.model.dynamics import tyres
from fifthwheel.model.dynamics.symbolic import Expressions
from fifthwheel.results.assess.truck import OVERHANGS, Truck, Values
from fifthwheel.truck import Unit
from fifthwheel.truck import quantities as names

RADIUS = 12.5
"""Of the circle, m."""
STEP, CIRCLE_STEP = 0.2, 0.5
"""Distance from one step to the next, m, of the turn of 90 degrees and of the whole circle."""
FRICTION = 0.8
"""Coefficient of friction of tyre and road."""
TYRES = {names.FRICTION: FRICTION, names.SHAPE: 1.0, names.STIFFNESS_SENSITIVITY: 0.0, names.FRICTION_SENSITIVITY: 0.0}
"""Parameters of tyres whose side force tends to mu N."""
STATION = 0.25
"""Length of road in which inner and outer edge are compared, m."""


@dataclass(frozen=True, kw_only=True)
class LowSpeedTurn:
    """A turn to the left, (N,) samples; the circle begins at x = 0, with its centre at (0, RADIUS)."""

    origins: NDArray[np.complex128]
    """(N, n) complex: origin of each unit, x + 1j y, m."""
    headings: Array
    """(N, n) rad."""
    steer: Array
    """Angle from the heading of the first unit to the direction of motion of its point on the line, (N,) rad."""
    slips: Array
    """Slip angle of the wheels of every axle on the road, front to rear, (N, axles); that of the steered axle is 0,
    rad."""


def unstated(truck: Truck) -> dict[str, tuple[str, ...]]:
    """Names of dimensions of the body that a truck lacks, by the measure that needs them.

    The tail of the last unit swings, and that of a unit that draws another by a drawbar; a fifth wheel is near the last
    axle, so that the tail of a unit below it may be unknown.
    """
    front = [truck.vehicle.units[i].name for i in truck.semitrailers() if truck.overhang(i, OVERHANGS[0]) is None]
    couplings = zip(truck.vehicle.units, truck.vehicle.couplings, strict=False)
    tails = [f"{unit.name}.{OVERHANGS[1]}" for unit, behind in couplings if behind.kind == "drawbar_eye"]
    missing = {
        "frontal_swing_difference": tuple(f"{unit}.{OVERHANGS[0]}" for unit in front),
        "tail_swing": tuple(name for name in tails if name not in truck.body.between),
    }
    if truck.body.rear_overhang is None:
        missing["tail_swing"] += (OVERHANGS[1],)
    return {measure: names for measure, names in missing.items() if names}


def measure(truck: Truck) -> Values:
    """Swept path, m, friction demand, and the `swings`, m."""
    run = turn(truck)
    values = {"swept_path": swept_path(truck, run), "friction_demand": friction_demand(truck, run)}
    return values | swings(truck, run)


def measure_circle(truck: Truck) -> Values:
    """Inner radius of the ring that the truck sweeps in a whole turn, m, whose outer radius is `RADIUS`; 0 if a unit
    sweeps its centre."""
    run = turn(truck, angle=2 * math.pi, ahead=truck.body.front_overhang, beyond=0.0, step=CIRCLE_STEP)
    if np.abs(np.diff(run.headings)).max(initial=0.0) > math.pi / 2:  # a unit folds, across the centre
        return {"turning_circle": 0.0}
    nearest = []
    for i, (rear, front) in enumerate(truck.ends()):
        centre = (1j * RADIUS - run.origins[:, i]) * np.exp(-1j * run.headings[:, i])  # in the frame of the unit
        across = np.maximum(np.abs(centre.imag) - truck.body.width / 2, 0.0)
        nearest.append(np.hypot(centre.real - np.clip(centre.real, rear, front), across).min())
    return {"turning_circle": float(min(nearest))}


def turn(
    truck: Truck, angle: float = math.pi / 2, ahead: float = 0.0, beyond: float | None = None, step: float = STEP
) -> LowSpeedTurn:
    """Drive a turn.

    Args:
        angle: of the circle, rad.
        ahead: distance of the outer point of the first unit that follows the line before its first axle, m.
        beyond: distance that this point drives after the circle, m; default: until all units are straight.
        step: of the integration, m.
    """
    units, references, outer = truck.vehicle.units, _references(truck), truck.body.width / 2
    axles = [equivalent_axle(unit, reference) for unit, reference in zip(units, references, strict=True)]
    lengths, commands = ([*values] for values in zip(*axles, strict=True))
    effective = [reference - length for reference, length in zip(references, lengths, strict=True)]
    lengths[0] += ahead
    joints = [c.leading_position for c in truck.vehicle.couplings]
    arms = [joint - e for joint, e in zip(joints, effective, strict=False)]

    def motion(s: float, headings: Sequence[float]) -> tuple[list[float], list[float]]:
        """Yaw rate of each unit and forward velocity of its effective axle, per distance."""
        direction = min(max(s / RADIUS, 0.0), angle) - headings[0]
        rates = [math.sin(direction) / lengths[0]]
        along = [math.cos(direction) - rates[0] * outer]
        for i, arm in enumerate(arms):
            articulation = headings[i + 1] - headings[i]
            c, s, across = math.cos(articulation), math.sin(articulation), rates[i] * arm
            along.append(along[i] * c + across * s)
            sideways = along[i + 1] * math.tan(commands[i + 1] * articulation)  # of the effective axle
            rates.append((across * c - along[i] * s - sideways) / lengths[i + 1])
        return rates, along

    if beyond is None:
        beyond = 2.5 * (sum(lengths) + sum(map(abs, arms))) + RADIUS
    stations = np.arange(-step, RADIUS * angle + beyond, step)
    headings, motions, now = [], [], [0.0] * len(units)
    for station in stations.tolist():
        k1 = motion(station, now)
        headings.append(now)
        motions.append(k1)
        k2, _ = motion(station + step / 2, [h + step / 2 * r for h, r in zip(now, k1[0], strict=True)])
        k3, _ = motion(station + step / 2, [h + step / 2 * r for h, r in zip(now, k2, strict=True)])
        k4, _ = motion(station + step, [h + step * r for h, r in zip(now, k3, strict=True)])
        now = [h + step / 6 * (a + 2 * b + 2 * c + d) for h, a, b, c, d in zip(now, k1[0], k2, k3, k4, strict=True)]
    psi = np.array(headings)
    rates, along = np.array(motions).transpose(1, 0, 2)
    turned = np.clip(stations / RADIUS, 0.0, angle)
    line = RADIUS * (np.sin(turned) + 1j * (1 - np.cos(turned))) + (stations - RADIUS * turned) * np.exp(1j * turned)
    origins, slips = np.zeros(psi.shape, dtype=np.complex128), []
    for i, unit in enumerate(units):
        axis = np.exp(1j * psi[:, i])
        if i:
            joint = origins[:, i - 1] + joints[i - 1] * np.exp(1j * psi[:, i - 1])
            origins[:, i] = joint - truck.vehicle.couplings[i - 1].trailing_position * axis
        else:
            origins[:, 0] = line - (truck.front_axle.position + ahead - 1j * outer) * axis
        articulation = psi[:, i] - psi[:, i - 1] if i else np.zeros(len(stations))
        sideways = along[:, i] * np.tan(commands[i] * articulation)
        for axle in unit.on_road:
            steered = not i and axle in unit.axle_groups[0].axles
            across = rates[:, i] * (axle.position - effective[i]) + sideways
            slip = (axle.command_steering or 0.0) * articulation - np.arctan2(across, along[:, i])
            slips.append(np.zeros(len(stations)) if steered else (1 - (axle.self_steering or 0.0)) * slip)
    return LowSpeedTurn(origins=origins, headings=psi, steer=turned - psi[:, 0], slips=np.column_stack(slips))


def swings(truck: Truck, run: LowSpeedTurn) -> Values:
    """Swing of the outer corners of a turn of 90 degrees whose overhang is known, m.

    Tail swing: beyond the straight line before the turn, the largest of all units; left out if the tail of a unit that
    swings is unknown. Frontal swing: of the first unit, beyond the line after the turn. Of a semitrailer and the unit
    in front of it, dollies left out, the largest difference of both at one place along that line, and the difference of
    their largest values; of several the largest.
    """
    ends, half = truck.ends(), truck.body.width / 2

    def corner(i: int, x: float) -> NDArray[np.complex128]:
        return np.asarray(run.origins[:, i] + (x - 1j * half) * np.exp(1j * run.headings[:, i]))

    def known(end: str) -> list[int]:
        return [i for i in range(len(ends)) if truck.overhang(i, end) is not None]

    values = Values()
    if "tail_swing" not in unstated(truck):
        values["tail_swing"] = max(0.0, *[-float(corner(i, ends[i][0]).imag.min()) for i in known(OVERHANGS[1])])
    path = {i: corner(i, ends[i][1]) for i in known(OVERHANGS[0])}
    values["frontal_swing"] = max(0.0, float(path[0].real.max()) - RADIUS)
    pairs = [(path[max(j for j in path if j < i)], path[i]) for i in truck.semitrailers() if i in path]
    if pairs:
        beyond = [semi.real - np.interp(semi.imag, front.imag, front.real) for front, semi in pairs]
        values["frontal_swing_difference"] = float(max(map(np.max, beyond)))
        values["frontal_swing_maxima"] = max(float(semi.real.max() - front.real.max()) for front, semi in pairs)
    return values


def equivalent_axle(unit: Unit, reference: float) -> tuple[float, float]:
    """Distance L, m, behind a point of a unit at which one axle turns it like all of its axles behind that point, and
    the steer angle of that axle over the articulation angle, k."""
    arms = [  # C_j, N/rad, L_j, m, and k_j
        (
            (1 - (axle.self_steering or 0.0)) * (group.cornering_stiffness / len(group.on_road)),
            reference - axle.position,
            axle.command_steering or 0.0,
        )
        for group in unit.axle_groups
        for axle in group.on_road
        if axle.position < reference
    ]
    if not any(c for c, _, _ in arms):
        raise VehicleError(f"{unit.name}: no axle behind its front end has a side force; the low-speed turn needs one")
    moment = sum(c * arm for c, arm, _ in arms)
    return sum(c * arm**2 for c, arm, _ in arms) / moment, sum(c * arm * k for c, arm, k in arms) / moment


def _references(truck: Truck) -> list[float]:
    """x on each unit of the point that leads it: the first axle, or the coupling in front."""
    return [truck.front_axle.position, *(c.trailing_position for c in truck.vehicle.couplings)]


def swept_path(truck: Truck, run: LowSpeedTurn) -> float:
    """Largest width between the outermost and the innermost edge of all units at one station of the road, m."""
    inner, outer = edges(truck, run)
    count = int(max(inner[0].max(), outer[0].max()) / STATION) + 1
    widest = []
    for stations, offsets in (inner, outer):
        edge = np.full(count, -np.inf)
        kept = stations >= 0
        np.maximum.at(edge, (stations[kept] / STATION).astype(int), offsets[kept])
        widest.append(edge)
    total = widest[0] + widest[1]
    return float(total[np.isfinite(total)].max())


def edges(truck: Truck, run: LowSpeedTurn) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
    """Station and distance from the road line, m, of points on the inner side (to the left) and the outer side."""
    inner, outer = [], []
    for i, (rear, front) in enumerate(truck.ends()):
        axis = np.exp(1j * run.headings[:, i : i + 1])
        points = run.origins[:, i : i + 1] + np.linspace(rear, front, 12) * axis
        inner.append((points + 0.5j * truck.body.width * axis).ravel())
        outer.append((points - 0.5j * truck.body.width * axis).ravel())
    left, right = _road(np.concatenate(inner)), _road(np.concatenate(outer))
    return left, (right[0], -right[1])


def _road(points: Array) -> tuple[Array, Array]:
    """Station along the line that the outer tyre follows, and distance to its left, m, of points (complex)."""
    x, y = points.real, points.imag
    angle = np.arctan2(x, RADIUS - y)
    station, offset = RADIUS * angle, RADIUS - np.hypot(x, RADIUS - y)
    entry, leaving = (x <= 0) & (y < RADIUS), (y >= RADIUS) & (x > 0)
    station = np.where(entry, x, np.where(leaving, RADIUS * math.pi / 2 + y - RADIUS, station))
    return station, np.where(entry, y, np.where(leaving, RADIUS - x, offset))


def friction_demand(truck: Truck, run: LowSpeedTurn) -> float:
    """Largest fraction of the available friction that the tyres of the first axle group use."""
    vehicle = truck.vehicle
    loads, axle = vehicle.axle_loads(), run.slips.shape[1]
    values = vehicle.parameters() | tyres.saturation_parameters(vehicle) | TYRES
    p = {name: ca.SX(value) for name, value in values.items()}
    coupling = np.zeros(len(run.steer))  # side force of the unit behind on the unit in front, N
    for i in reversed(range(len(vehicle.units))):
        unit = vehicle.units[i]
        forces, moment = np.zeros(len(run.steer)), np.zeros(len(run.steer))
        reference = _references(truck)[i] - (0.0 if i else equivalent_axle(unit, truck.front_axle.position)[0])
        if i < len(vehicle.couplings):
            articulation = run.headings[:, i + 1] - run.headings[:, i]
            forces = forces + coupling * np.cos(articulation)
            moment = moment + (vehicle.couplings[i].leading_position - reference) * coupling * np.cos(articulation)
        for group in reversed(unit.axle_groups):
            law = _axle_law(p, unit.group_path(group), len(group.on_road)).map(len(run.steer))
            for member in reversed(group.on_road):
                axle -= 1
                force, aligning = (values.full()[0] for values in law(run.slips[None, :, axle]))
                forces, moment = forces + force, moment + (member.position - reference) * force + aligning
        coupling = forces
    front = vehicle.units[0].axle_groups[0]
    arm = front.position - reference
    side = np.abs(moment) / arm / np.cos(run.steer)
    return float(side.max() / (FRICTION * loads[vehicle.units[0].group_path(front)]))


def _axle_law(p: Expressions, path: str, axles: int) -> ca.Function:
    """Side force, N, and aligning moment, N m, of one axle of a group by its slip angle, rad."""
    slip = ca.SX.sym("slip")
    secants = tyres.saturating(p, path, tyres.Contact(slip)) / axles
    return ca.Function("axle", [slip], tyres.axle_forces(secants, slip))
