"""Static rollover threshold: lateral acceleration at which a truck in a steady turn rolls over.

Every axle group carries the load transfer moment T (half the track times the difference of its wheel loads)

    T = K* phi + h_r F_y,          F_y = N a / g,

with K* of suspension and tyres in series, phi the roll angle of its unit, h_r the height of the roll axis and N its
static load. The roll angles of the units follow from the moments about their roll axes,

    sum K* phi_i = m_s h (a + g phi_i) + moments of the couplings,

where a coupling transmits the side force (its vertical load) a / g at its height, and the roll moment K_12 times the
twist. When T reaches N times half the track, the inner wheels of the group lift; its moment then stays. The threshold
is the acceleration at which the remaining stiffness no longer balances gravity: C. B. Winkler, Rollover of heavy
commercial vehicles, UMTRI Research Review 31 (2000). For a rigid vehicle it is half the track over the CoG height.

Couplings without roll stiffness divide the truck into roll-coupled sets of units, each with its own threshold.

Effective track, after ISO 22135:2023: the tyres yield sideways, so that the load of the outer tyres acts nearer to the
CoG by F_y / (k / 2) when they carry the whole side force. Their lateral stiffness is k = C / sigma, of the cornering
stiffness C and the relaxation length sigma (H. B. Pacejka, Tire and Vehicle Dynamics, 3rd ed., 2012, 5.2). A group then
lifts at T = N (half the track - 2 N a / (g k)). Of the standard only this is implemented.

Range: small angles, linear springs without lash, no separation of a fifth wheel, level road.
"""

from dataclasses import dataclass

import numpy as np

from fifthwheel.base.errors import VehicleError
from fifthwheel.base.types import Array
from fifthwheel.base.units import STANDARD_GRAVITY as GRAVITY
from fifthwheel.results.assess.measures import EFFECTIVE_TRACK, ROLLOVER, STABILITY_FACTOR
from fifthwheel.results.assess.truck import Truck, Values
from fifthwheel.truck import Vehicle, laden
from fifthwheel.truck.loads import unit_cog_height


@dataclass(frozen=True, kw_only=True)
class Rollover:
    """Accelerations of a roll-coupled set of units, as fractions of g."""

    units: tuple[str, ...]
    threshold: float
    lifts: dict[str, float]
    """Acceleration at which the inner wheels of an axle group lift, by its path; without groups that never lift."""
    roll: dict[str, tuple[Array, Array]]
    """Acceleration and roll angle, rad, of each unit at rest, at every lift and at the threshold."""


def rollover(truck: Truck, *, effective_track: bool = False) -> tuple[Rollover, ...]:
    """The rollover of each roll-coupled set, front to rear; with the effective track of tyres that yield sideways.

    Raises:
        VehicleError: the axle loads are not determined, or a set of units does not stand upright, or never rolls over.
    """
    return tuple(_of_set(truck, units, effective_track) for units in roll_coupled(truck.vehicle))


def roll_coupled(vehicle: Vehicle) -> list[list[int]]:
    """Indices of the units of each roll-coupled set, front to rear."""
    sets: list[list[int]] = [[0]]
    for i, coupling in enumerate(vehicle.couplings, 1):
        if coupling.roll_stiffness > 0:
            sets[-1].append(i)
        else:
            sets.append([i])
    return sets


def measure(truck: Truck) -> Values:
    """The threshold of the truck and of each roll-coupled set, and the acceleration at which each axle group lifts."""
    sets = rollover(truck)
    values = {ROLLOVER: min(s.threshold for s in sets)}
    if len(sets) > 1:
        values |= {set_name(s): s.threshold for s in sets}
    return values | {f"wheel_lift.{path}": lift for s in sets for path, lift in s.lifts.items()}


def measure_effective_track(truck: Truck) -> Values:
    """The threshold of the truck with the effective track, and that of a rigid truck."""
    return {
        EFFECTIVE_TRACK: min(s.threshold for s in rollover(truck, effective_track=True)),
        STABILITY_FACTOR: min(stability_factor(truck, units) for units in roll_coupled(truck.vehicle)),
    }


def stability_factor(truck: Truck, units: list[int]) -> float:
    """Half the track over the CoG height of a roll-coupled set of units, g: neither springs nor tyres yield.

    Axles and wheels, the mass of a unit less its sprung mass, count at the height of the roll axis.
    """
    p, members = truck.vehicle.parameters(), [truck.vehicle.units[i] for i in units]
    height = sum(unit.mass * unit_cog_height(p, unit) for unit in members) / sum(unit.mass for unit in members)
    return float(truck.body.half_track / height)


def set_name(rollover: Rollover) -> str:
    """Name of the measure of one roll-coupled set: "rollover_threshold.dolly+trailer"."""
    return f"{ROLLOVER}.{'+'.join(rollover.units)}"


def _of_set(truck: Truck, units: list[int], effective_track: bool) -> Rollover:
    """Increase the acceleration from lift to lift until the set is unstable."""
    index = {unit: k for k, unit in enumerate(units)}
    groups = [entry for entry in truck.groups() if entry[0] in index]
    loads = truck.vehicle.axle_loads()
    weight, by_acceleration = _moments(truck, units)
    stiffness = np.array([group.total_roll_stiffness for _, _, group, _ in groups])
    load = np.array([loads[path] for *_, path in groups])
    compliance = np.array([g.relaxation_length / g.cornering_stiffness * effective_track for _, _, g, _ in groups])
    side = (np.array([u.roll_axis_height for _, u, _, _ in groups]) + 2 * load * compliance) * load  # per a / g
    row = np.array([index[i] for i, *_ in groups])
    on_ground = np.ones(len(groups), dtype=bool)
    limit, lifts = load * truck.body.half_track, dict[str, float]()
    reached, history = 0.0, [(0.0, np.zeros(len(units)))]
    names = ", ".join(truck.vehicle.units[i].name for i in units)
    while True:
        S, slope, constant = weight.copy(), by_acceleration.copy(), np.zeros(len(units))
        np.add.at(S, (row[on_ground], row[on_ground]), stiffness[on_ground])
        np.add.at(slope, row[~on_ground], side[~on_ground])  # a lifted group: K* phi becomes limit - h_r F_y
        np.add.at(constant, row[~on_ground], -limit[~on_ground])
        if np.linalg.eigvalsh(S).min() <= 0:
            if on_ground.all():
                raise VehicleError(
                    f"{names}: its suspension does not keep it upright at rest; raise roll_stiffness of an axle group"
                )
            accelerations = np.array([a for a, _ in history])
            angles = np.array([phi for _, phi in history])
            roll = {truck.vehicle.units[i].name: (accelerations, angles[:, k]) for i, k in index.items()}
            return Rollover(units=tuple(roll), threshold=reached, lifts=lifts, roll=roll)
        by_a, at_rest = np.linalg.solve(S, slope), np.linalg.solve(S, constant)
        rate = stiffness * by_a[row] + side
        with np.errstate(divide="ignore"):
            lift = np.where(on_ground & (rate > 0), (limit - stiffness * at_rest[row]) / rate, np.inf)
        first = int(np.argmin(lift))
        if not np.isfinite(lift[first]):
            raise VehicleError(
                f"{names}: no acceleration lifts its inner wheels; compare the heights of CoG, roll axis and couplings"
            )
        reached = max(float(lift[first]), reached)
        history.append((reached, by_a * reached + at_rest))
        on_ground[first] = False
        lifts[groups[first][-1]] = reached


def _moments(truck: Truck, units: list[int]) -> tuple[Array, Array]:
    """Stiffness (n, n) of gravity and couplings, N m/rad, and moment (n,) per a / g, N m, about the roll axes."""
    vehicle, n = truck.vehicle, len(units)
    p, loads, supported = vehicle.parameters(), vehicle.axle_loads(), 0.0
    weight, moment = np.zeros((n, n)), np.zeros(n)
    coupling_loads = [0.0] * len(vehicle.couplings)  # vertical load of the unit behind on the unit in front, N
    for i in reversed(range(1, len(vehicle.units))):
        unit = vehicle.units[i]
        supported += unit.mass * GRAVITY - sum(loads[unit.group_path(group)] for group in unit.axle_groups)
        coupling_loads[i - 1] = supported
    for k, i in enumerate(units):
        unit = vehicle.units[i]
        body = laden(p, unit)
        first_moment = body.mass * GRAVITY * (body.cog_height - unit.roll_axis_height)
        weight[k, k] -= first_moment
        moment[k] += first_moment
        if i < len(vehicle.couplings):
            moment[k] += coupling_loads[i] * (vehicle.couplings[i].height - unit.roll_axis_height)
        if i:
            moment[k] -= coupling_loads[i - 1] * (vehicle.couplings[i - 1].height - unit.roll_axis_height)
        if k:
            twist = vehicle.couplings[i - 1].roll_stiffness
            weight[k - 1 : k + 1, k - 1 : k + 1] += twist * np.array([[1.0, -1.0], [-1.0, 1.0]])
    return weight, moment
