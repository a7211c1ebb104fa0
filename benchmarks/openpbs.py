"""The measures of `fifthwheel assess` beside those of OpenPBS, on the vehicles of OpenPBS.

    python benchmarks/openpbs.py PATH_OF_OPENPBS

OpenPBS (https://github.com/performance-based-standards/OpenPBS) is a Modelica library by Chalmers, VTI and Volvo. It
publishes no results and has no licence, so this script reads its vehicles from a local copy. Two columns:

    OpenPBS    its definitions, on a single-track model with large angles that is written here: units of a chain, tyre
               force in proportion to slip angle and static load, no roll, no relaxation
    fifthwheel `fifthwheel assess`, linear, with a roll suspension so stiff that it does not matter
"""

import argparse
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fifthwheel.base.types import Array
from fifthwheel.base.units import STANDARD_GRAVITY as GRAVITY
from fifthwheel.model.dynamics import linear_system
from fifthwheel.results.assess import lane_change, low_speed_turn
from fifthwheel.results.assess.truck import Body, Truck
from fifthwheel.truck import Axle, AxleGroup, Coupling, SprungMass, Unit, Vehicle

FILES = {"A-double": "Adouble6x4.mo", "truck, dolly and semitrailer": "NordicCombination.mo"}
FOLDER = Path("OpenPBS/VehicleParameters/Vehicles")
SPEED, FREQUENCY, WIDTH = 80 / 3.6, 0.4, 4.5
"""Of the lane change of OpenPBS: m/s, Hz and m."""
RADIUS, SLOW = 12.5, 1.0
"""Of its low-speed turn: m and m/s."""


@dataclass(frozen=True)
class Train:
    """Parameters of the single-track model; positions from the CoG of each unit, m."""

    mass: Array  # (n,) kg
    inertia: Array  # (n,) kg m^2
    front: Array  # (n,) coupling in front; unused for the first unit
    rear: Array  # (n,) coupling behind; unused for the last unit
    axles: tuple[Array, ...]  # positions of the axles of each unit
    stiffness: tuple[Array, ...]  # N/rad of each axle
    groups: tuple[tuple[int, ...], ...]  # index of the group of each axle
    track: float  # m

    def accelerations(self, motion: Array, speed: float, steer: float) -> tuple[Array, Array]:
        """Derivatives of the velocities (v, r_1 ... r_n), and acceleration of the first axle, m/s^2, world axes.

        Args:
            motion: v, r_1 ... r_n, and the headings, (2 n + 1,).
            speed: longitudinal, of the first unit.
            steer: of its first axle, rad.
        """
        n = len(self.mass)
        w, heading = motion[: n + 1], motion[n + 1 :]
        along = np.column_stack([np.cos(heading), np.sin(heading)])
        across = np.column_stack([-along[:, 1], along[:, 0]])
        J, velocity = np.zeros((2, n + 1)), speed * along[0] + w[0] * across[0]
        J[:, 0] = across[0]
        bias = w[1] * (speed * across[0] - w[0] * along[0])  # of the acceleration: all but J w'
        M, force = np.zeros((n + 1, n + 1)), np.zeros(n + 1)
        first = None
        for i in range(n):
            if i:
                J, r, q = J.copy(), w[i], w[i + 1]
                J[:, i] += self.rear[i - 1] * across[i - 1]
                J[:, i + 1] -= self.front[i] * across[i]
                velocity = velocity + self.rear[i - 1] * r * across[i - 1] - self.front[i] * q * across[i]
                bias = bias - self.rear[i - 1] * r**2 * along[i - 1] + self.front[i] * q**2 * along[i]
            M += self.mass[i] * J.T @ J
            M[i + 1, i + 1] += self.inertia[i]
            force -= self.mass[i] * J.T @ bias
            u, v = along[i] @ velocity, across[i] @ velocity
            for k, (x, C) in enumerate(zip(self.axles[i], self.stiffness[i], strict=True)):
                delta = steer if i == k == 0 else 0.0
                side = -C * ((v + x * w[i + 1]) / u - delta)
                direction = across[i] * np.cos(delta) - along[i] * np.sin(delta)
                force += J.T @ direction * side
                force[i + 1] += x * np.cos(delta) * side
            if not i:
                x = self.axles[0][0]
                first = (J + x * np.outer(across[0], np.eye(n + 1)[1]), bias - x * w[1] ** 2 * along[0])
        rates = np.linalg.solve(M, force)
        assert first is not None
        return rates, first[0] @ rates + first[1]

    def drive(
        self, duration: float, step: float, speed: float, steer: Callable[[float, Array, Array], float]
    ) -> tuple[Array, Array]:
        """Time (N,) and states v, r, headings, x and y of the first CoG, (N, 2 n + 3), by Runge-Kutta steps.

        Args:
            duration, step: s.
            speed: m/s.
            steer: angle by time, motion, and position of the first CoG.
        """
        n = len(self.mass)

        def rates(t: float, z: Array) -> Array:
            motion, place = z[: 2 * n + 1], z[2 * n + 1 :]
            dw, _ = self.accelerations(motion, speed, steer(t, motion, place))
            c, s = np.cos(motion[n + 1]), np.sin(motion[n + 1])
            return np.concatenate([dw, motion[1 : n + 1], [speed * c - motion[0] * s, speed * s + motion[0] * c]])

        time = np.arange(0, duration, step)
        z, states = np.zeros(2 * n + 3), []
        for t in time:
            states.append(z)
            k1 = rates(t, z)
            k2 = rates(t + step / 2, z + step / 2 * k1)
            k3 = rates(t + step / 2, z + step / 2 * k2)
            k4 = rates(t + step, z + step * k3)
            z = z + step / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        return time, np.array(states)

    def points(self, states: Array, offset: float = 0.0) -> list[list[Array]]:
        """Position of every axle of every unit, moved to the left by an offset, (N,) complex."""
        n = len(self.mass)
        place = states[:, 2 * n + 1] + 1j * states[:, 2 * n + 2]
        result = []
        for i in range(n):
            axis = np.exp(1j * states[:, n + 1 + i])
            if i:
                place = place + self.rear[i - 1] * np.exp(1j * states[:, n + i]) - self.front[i] * axis
            result.append([place + (x + 1j * offset) * axis for x in self.axles[i]])
        return result

    def vehicle(self, name: str) -> Vehicle:
        """The same chain as a vehicle, with a stiff suspension."""
        units, couplings = [], []
        n = len(self.mass)
        for i in range(n):
            groups = []
            for g in sorted(set(self.groups[i])):
                members = [k for k, group in enumerate(self.groups[i]) if group == g]
                groups.append(
                    AxleGroup(
                        name=f"group_{g}",
                        axles=tuple(
                            Axle(name=f"axle_{k}", position=float(self.axles[i][k]), steerable=i == k == 0)
                            for k in members
                        ),
                        cornering_stiffness=float(sum(self.stiffness[i][k] for k in members)),
                        roll_stiffness=1e9,
                        tyre_roll_stiffness=1e9,
                        roll_damping=1e7,
                    )
                )
            sprung = SprungMass(mass=0.8 * float(self.mass[i]), cog_height=1.0, roll_inertia=float(self.mass[i]))
            units.append(
                Unit(
                    name=f"unit_{i + 1}",
                    mass=float(self.mass[i]),
                    cog=0.0,
                    yaw_inertia=float(self.inertia[i]),
                    roll_axis_height=0.5,
                    sprung=sprung,
                    axle_groups=tuple(groups),
                )
            )
            if i:
                couplings.append(
                    Coupling(
                        name=f"coupling_{i}",
                        leading_position=float(self.rear[i - 1]),
                        trailing_position=float(self.front[i]),
                        height=0.5,
                        roll_stiffness=0.0,
                    )
                )
        return Vehicle(name=name, units=tuple(units), couplings=tuple(couplings))


def read(path: Path) -> Train:
    """The train of a record of OpenPBS. An axle of an axle group 0 does not exist."""
    text = path.read_text(encoding="utf-8")

    def matrix(key: str) -> list[list[float]]:
        found = re.search(rf"\b{key}\s*=\s*(?:([\d.e]+)\s*\*\s*)?[\[{{]([^\]}}]*)[\]}}]", text)
        assert found, f"{key}: not in {path}"
        factor = float(found[1] or 1)
        return [[factor * float(x) for x in row.split(",")] for row in found[2].split(";")]

    cog, front, rear, mass, inertia = (np.array(matrix(key)[0]) for key in ("X", "A", "B", "m", "I"))
    groups = [[int(g) for g in row] for row in matrix("axlegroups")]
    positions, coefficients = matrix("L"), matrix("Cc")
    used = [[k for k, g in enumerate(row) if g] for row in groups]
    axles = tuple(np.array([positions[i][k] for k in ks]) - cog[i] for i, ks in enumerate(used))
    loads = _loads(mass, front - cog, rear - cog, axles, [[groups[i][k] for k in ks] for i, ks in enumerate(used)])
    return Train(
        mass=mass,
        inertia=inertia,
        front=front - cog,
        rear=rear - cog,
        axles=axles,
        stiffness=tuple(np.array([coefficients[i][k] for k in ks]) * loads[i] for i, ks in enumerate(used)),
        groups=tuple(tuple(groups[i][k] for k in ks) for i, ks in enumerate(used)),
        track=matrix("w")[0][0],
    )


def _loads(mass: Array, front: Array, rear: Array, axles: tuple[Array, ...], groups: list[list[int]]) -> list[Array]:
    """Static load of every axle, N; the axles of a group share their load equally."""
    loads: list[Array] = [np.zeros(0)] * len(mass)
    down, at = 0.0, 0.0  # load of the unit behind, and its position on the unit
    for i in reversed(range(len(mass))):
        members = {g: [k for k, group in enumerate(groups[i]) if group == g] for g in sorted(set(groups[i]))}
        places = [float(np.mean(axles[i][ks])) for ks in members.values()]
        supports = [float(front[i]), *places] if i else places
        weight = mass[i] * GRAVITY
        first, second = np.linalg.solve([[1.0, 1.0], supports], [weight + down, down * at])
        carried = [second] if i else [first, second]
        loads[i] = np.zeros(len(axles[i]))
        for load, ks in zip(carried, members.values(), strict=True):
            loads[i][ks] = load / len(ks)
        down, at = (first, float(rear[i - 1])) if i else (0.0, 0.0)
    return loads


def lane_change_of(train: Train, speed: float, amplitude: float) -> tuple[float, float]:
    """Ratio of the largest yaw rates of last and first unit, and the largest y of any axle less that of the first, m.

    The first axle follows one sine of lateral acceleration in the world, m/s^2.
    """
    n = len(train.mass)

    def steer(t: float, motion: Array, place: Array) -> float:
        target = amplitude * np.sin(2 * np.pi * FREQUENCY * (t - 1)) if 1 <= t < 1 + 1 / FREQUENCY else 0.0
        angle = 0.0
        for _ in range(3):
            here, there = (train.accelerations(motion, speed, angle + d)[1][1] for d in (0.0, 1e-4))
            angle += (target - here) * 1e-4 / (there - here)
        return angle

    _, states = train.drive(12.0, 0.01, speed, steer)
    peaks = np.abs(states[:, 1 : n + 1]).max(axis=0)
    y = [max(point.imag.max() for point in unit) for unit in train.points(states)]
    return float(peaks[-1] / peaks[0]), float(max(y) - train.points(states)[0][0].imag.max())


def swept_path_of(train: Train) -> float:
    """Largest distance, m, of a left wheel from the path of the right front wheel in a left turn of 90 degrees."""
    n, half = len(train.mass), train.track / 2
    angle = np.zeros(1)

    def steer(t: float, motion: Array, place: Array) -> float:
        wheel = complex(*place) + (train.axles[0][0] - 1j * half) * np.exp(1j * motion[n + 1]) + 1j * half
        station, offset = (float(v[0]) for v in low_speed_turn._road(np.array([wheel - straight])))
        wanted = min(max(station / RADIUS, 0.0), np.pi / 2) - np.arctan(offset)
        travel = motion[n + 1] + np.arctan2(motion[0] + train.axles[0][0] * motion[1], SLOW + half * motion[1])
        angle[0] += 0.05 * (wanted - travel)
        return float(np.clip(angle[0], -0.8, 0.8))

    straight = 5.0 + train.axles[0][0]
    _, states = train.drive(5 + 1.6 * RADIUS + 40, 0.02, SLOW, steer)
    worst = []
    for unit in train.points(states, half):
        for point in unit:
            station, offset = low_speed_turn._road(point + 1j * half - straight)
            worst.append(offset[station > 0].max())
    return float(max(worst))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="folder of a copy of OpenPBS")
    folder = parser.parse_args().folder
    print("| vehicle | measure | OpenPBS | fifthwheel |", "|---|---|---|---|", sep="\n")
    for name, file in FILES.items():
        train = read(folder / FOLDER / file)
        vehicle = train.vehicle("openpbs")
        body = Body(width=train.track, front_overhang=0.0)
        truck = Truck(vehicle=vehicle, body=body, speed=SPEED)
        run = lane_change.linear(truck)
        ours, ends = lane_change.measures(run), (vehicle.units[0].name, vehicle.units[-1].name)
        system = linear_system(vehicle, SPEED, [f"yaw_rate.{unit}" for unit in ends])
        rates = system.response(run.time, {system.inputs[0]: run.steer})
        first, last = (float(np.abs(rates[f"yaw_rate.{unit}"]).max()) for unit in ends)
        gentle, overshoot = lane_change_of(train, SPEED, lane_change.ACCELERATION)
        severe, severe_overshoot = lane_change_of(train, SPEED, FREQUENCY**2 * WIDTH * 2 * np.pi)
        swept = low_speed_turn.measure(truck)["swept_path"]
        for title, theirs, value in (
            ("yaw rate of last and first unit, 0.15 g", f"{gentle:.3f}", f"{last / first:.3f}"),
            ("the same, 4.5 m, as OpenPBS drives it", f"{severe:.3f}", ""),
            ("acceleration of last unit and front axle, 0.15 g", "", f"{ours['rearward_amplification']:.3f}"),
            ("transient off-tracking, 0.15 g", f"{overshoot:.3f} m", f"{ours['transient_off_tracking']:.3f} m"),
            ("the same, 4.5 m, as OpenPBS drives it", f"{severe_overshoot:.2f} m", ""),
            ("low-speed swept path", f"{swept_path_of(train):.2f} m", f"{swept:.2f} m"),
        ):
            print(f"| {name} | {title} | {theirs} | {value} |", flush=True)


if __name__ == "__main__":
    main()
