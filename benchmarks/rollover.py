"""Why the nonlinear truck rolls over below the threshold of the linear springs.

    python benchmarks/rollover.py

A static model between the two: units roll by phi, and axles by psi about the middle of their tyres on the ground, with
the roll centre of the nonlinear truck, so that a lifted axle turns about its outer tyres and moves its roll centre
outwards. The stiffness has gravity to second order. Its threshold is computed with the static axle loads, and with
those of the nonlinear truck 0.02 g before it rolls over, when the drive axles pull the units through the turn.
"""

import math
from collections.abc import Mapping

import numpy as np

from fifthwheel.base.types import Array
from fifthwheel.base.units import STANDARD_GRAVITY as GRAVITY
from fifthwheel.model.manoeuvres import constant_radius
from fifthwheel.model.plant import Plant, Properties
from fifthwheel.results.assess.nonlinear import GRIP, RATE, ROLLOVER_RADIUS, ROLLOVER_RANGE, ROLLOVER_RATE
from fifthwheel.results.assess.rollover import rollover
from fifthwheel.results.assess.truck import Truck
from fifthwheel.truck import AxleGroup, Vehicle, get, laden

NAMES = ("cheng_cebon_2011", "auburn_6x4", "b_double", "a_double", "truck_dolly_semitrailer")
HALF_TRACK, WHEEL_RADIUS = 1.0, 0.5
"""m"""
BEFORE = 0.02
"""Lateral acceleration before the rollover at which the axle loads are taken, g."""


class Stack:
    """Lateral position and fall of points of a vehicle as functions of its roll angles q = (phi, psi)."""

    def __init__(self, vehicle: Vehicle) -> None:
        self.vehicle = vehicle
        self.groups = [(i, g, u.group_path(g)) for i, u in enumerate(vehicle.units) for g in u.axle_groups]
        self.n = len(vehicle.units)
        self.unit = np.eye(self.n + len(self.groups))

    def roll_centre(self, i: int, group: AxleGroup) -> float:
        """Height of the roll centre of the nonlinear truck, m."""
        return self.vehicle.units[i].roll_axis_height * (1 + group.roll_stiffness / group.tyre_roll_stiffness)

    def point(self, i: int, x: float, z: float) -> tuple[Array, Array]:
        """Row a of the lateral position a q, and matrix D of the fall q' D q, of a point of a unit."""
        supports = []
        if i:
            coupling = self.vehicle.couplings[i - 1]
            place = self.point(i - 1, coupling.leading_position, coupling.height)
            supports.append((coupling.trailing_position, coupling.height, *place))
        for k, (j, group, _) in enumerate(self.groups):
            if j == i:
                height, psi = self.roll_centre(i, group), self.unit[self.n + k]
                supports.append((group.position, height, height * psi, height / 2 * np.outer(psi, psi)))
        (x1, *first), (x2, *second) = supports[:2]
        phi, weight = self.unit[i], (x - x2) / (x1 - x2)
        square = np.outer(phi, phi) / 2
        row, fall = z * phi, z * square
        for share, (height, a, D) in ((weight, first), (1 - weight, second)):
            row, fall = row + share * (a - height * phi), fall + share * (D - height * square)
        return row, fall

    def matrices(self) -> tuple[Array, Array]:
        """Stiffness without tyres, N m, and moment per a / g, N m."""
        p, size = self.vehicle.parameters(), len(self.unit)
        H, F = np.zeros((size, size)), np.zeros(size)
        for i, unit in enumerate(self.vehicle.units):
            body = laden(p, unit)
            unsprung = (unit.mass - body.mass) / len(unit.on_road)
            moment = unit.mass * unit.cog - unsprung * sum(axle.position for axle in unit.on_road)
            row, fall = self.point(i, moment / body.mass, body.cog_height)
            H, F = H - 2 * body.mass * GRAVITY * fall, F + body.mass * GRAVITY * row
        for k, (i, group, _) in enumerate(self.groups):
            psi, unit = self.unit[self.n + k], self.vehicle.units[i]
            weight = (unit.mass - laden(p, unit).mass) * GRAVITY * len(group.on_road) / len(unit.on_road)
            twist = self.unit[i] - psi
            H += group.roll_stiffness * np.outer(twist, twist) - weight * WHEEL_RADIUS * np.outer(psi, psi)
            F += weight * WHEEL_RADIUS * psi
        for k, coupling in enumerate(self.vehicle.couplings):
            twist = self.unit[k] - self.unit[k + 1]
            H += coupling.roll_stiffness * np.outer(twist, twist)
        return H, F

    def threshold(self, loads: Mapping[str, float]) -> float:
        """Lateral acceleration, g, at which the stiffness is not positive any more."""
        H, F = self.matrices()
        on_ground, reached = [True] * len(self.groups), 0.0
        while True:
            A, constant = H.copy(), np.zeros(len(H))
            for k, (_, group, path) in enumerate(self.groups):
                if on_ground[k]:
                    A[self.n + k, self.n + k] += group.tyre_roll_stiffness
                else:
                    constant[self.n + k] -= loads[path] * HALF_TRACK
            if np.linalg.eigvalsh(A).min() <= 0:
                return reached
            rate, rest = np.linalg.solve(A, F)[self.n :], np.linalg.solve(A, constant)[self.n :]
            angles = [loads[path] * HALF_TRACK / group.tyre_roll_stiffness for _, group, path in self.groups]
            lifts = [
                (angle - at_rest) / by_a if ground and by_a > 0 else math.inf
                for angle, at_rest, by_a, ground in zip(angles, rest, rate, on_ground, strict=True)
            ]
            k = int(np.argmin(lifts))
            reached, on_ground[k] = max(reached, lifts[k]), False


def driven(vehicle: Vehicle) -> tuple[float, dict[str, float], float]:
    """Threshold of the nonlinear truck, g; its axle loads before, over the static ones; force of its drive axles, N."""
    low, high = (f * min(s.threshold for s in rollover(Truck(vehicle=vehicle))) for f in ROLLOVER_RANGE)
    start, end = (math.sqrt(a * GRAVITY * ROLLOVER_RADIUS) for a in (low, high))
    rise = (high - low) / ROLLOVER_RATE
    duration = 2 + start**2 / ROLLOVER_RADIUS + rise
    course = constant_radius(radius=ROLLOVER_RADIUS, speed=start, acceleration=(end - start) / rise, duration=duration)
    properties = Properties(half_track=HALF_TRACK, wheel_radius=WHEEL_RADIUS, friction=GRIP)
    truth = Plant(vehicle, properties).drive(course, rate=RATE, until_rollover=True).truth
    a = truth["speed"] ** 2 / ROLLOVER_RADIUS / GRAVITY
    k = int(np.argmax(a >= a[-1] - BEFORE))
    loads, static, thrust = {}, vehicle.axle_loads(), 0.0
    for unit in vehicle.units:
        for group in unit.axle_groups:
            path, axles = unit.group_path(group), [f"{unit.name}.{axle.name}" for axle in group.on_road]
            loads[path] = sum(float(truth[f"vertical_force.{axle}"][k]) for axle in axles) / static[path]
            if path.endswith(".drive"):
                thrust = sum(float(truth[f"longitudinal_force.{axle}"][k]) for axle in axles)
    return float(a[-1]), loads, thrust


def main() -> None:
    """Print the table."""
    print("| vehicle | linear | axles turn | with the loads of the turn | nonlinear | front load | thrust |")
    print("|---" * 7 + "|")
    for name in NAMES:
        vehicle = get(name)
        nonlinear, change, thrust = driven(vehicle)
        stack, static = Stack(vehicle), vehicle.axle_loads()
        moved = {path: change[path] * load for path, load in static.items()}
        front = change[vehicle.units[0].group_path(vehicle.units[0].axle_groups[0])]
        linear = min(s.threshold for s in rollover(Truck(vehicle=vehicle)))
        thresholds = (linear, stack.threshold(static), stack.threshold(moved), nonlinear)
        cells = [f"{value:.3f} g" for value in thresholds]
        print(f"| `{name}` | {' | '.join(cells)} | {100 * front:.0f} % | {thrust / 1e3:.0f} kN |", flush=True)


if __name__ == "__main__":
    main()
