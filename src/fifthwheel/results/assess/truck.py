"""What is assessed: a vehicle at a speed, with the dimensions that a vehicle file does not have."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace

import numpy as np
from numpy.typing import NDArray

from fifthwheel.base.errors import UnitError, VehicleError, suggestion
from fifthwheel.base.lazy import lazy
from fifthwheel.base.types import Array
from fifthwheel.base.units import uncertain_quantity
from fifthwheel.model.dynamics import matrices
from fifthwheel.truck import Axle, AxleGroup, Unit, Vehicle
from fifthwheel.truck.driveline import require_shares
from fifthwheel.truck.steering import require_no_steering

HALF_TRACK = "half_track"
"""Name of the one dimension that has a sigma."""
BRAKES = "brakes."
"""Begins the name of the fraction of an axle group in the braking force: "brakes.tractor.drive"."""
OVERHANGS = ("front_overhang", "rear_overhang")
"""Names of the overhangs; those between two units begin with the name of their unit."""


@dataclass(frozen=True, kw_only=True)
class Body:
    """Dimensions that a vehicle file does not have, m, and its brakes; the default values are assumptions.

    Raises:
        VehicleError: a dimension or a fraction of the brakes is out of its range.

    Example:
        >>> from fifthwheel.results.assess import Body
        >>> Body.of({"half_track": "0.93 m +- 1 %", "rear_overhang": "2.7 m"}).half_track
        0.93
    """

    half_track: float = 1.0
    """Distance from the centre line to the middle of the tyres of one side, of every axle."""
    half_track_sigma: float = 0.03
    """Standard deviation of the half track: single wide tyres have about 1.02 m, twin tyres 0.92 m."""
    width: float = 2.55
    """Over the sides of the bodies and over the outer walls of the front tyres."""
    front_overhang: float = 1.4
    """From the first axle to the front end of the first unit."""
    rear_overhang: float | None = None
    """From the last axle to the rear end of the last unit; None: unknown, the swept paths then end at the last axle."""
    between: Mapping[str, float] = field(default_factory=dict)
    """Overhangs of the other ends, such as "semitrailer.front_overhang", from the kingpin to the front end (of a dolly,
    from its first axle), or "lead.rear_overhang"; an end that is not given is at the kingpin or axle."""
    brakes: Mapping[str, float] = field(default_factory=dict)
    """Share of axle groups in the braking force by path, in proportion to each other; groups that it does not name do
    not brake. Empty: all brake in proportion to their static loads."""

    def __post_init__(self) -> None:
        limits = {
            HALF_TRACK: (0.3, 2.0),
            "width": (0.5, 6.0),
            "front_overhang": (0.0, 6.0),
            "rear_overhang": (0.0, 12.0),
        }
        limits |= {name: limits[name.rpartition(".")[2]] for name in self.between}
        for name, (low, high) in limits.items():
            value = self.between[name] if name in self.between else getattr(self, name)
            if value is not None and not low <= value <= high:
                raise VehicleError(f"{name}: expected {low:g} to {high:g} m, got {value:g} m; correct it")
        require_shares(self.brakes)
        if not 0 <= self.half_track_sigma < self.half_track / 3:
            raise VehicleError(
                f"half_track: expected a standard deviation below a third of its value, got {self.half_track_sigma:g} m"
            )

    @classmethod
    def of(cls, values: Mapping[str, float | str]) -> "Body":
        """The body with some dimensions changed.

        Args:
            values: by name; numbers in m, or texts with a unit such as "1.02 m" or "1.02 m +- 2 %". Only the half track
                may have a standard deviation; without one it is exact. Names in `between` have a unit before the dot;
                fractions of the brakes are "brakes.tractor.drive".

        Raises:
            VehicleError: a name or a value is not valid.
        """
        names = [f.name for f in fields(cls) if f.name not in ("half_track_sigma", "between", "brakes")]
        given, between, brakes = dict[str, float](), dict[str, float](), dict[str, float]()
        for name, value in values.items():
            unit, _, dimension = name.rpartition(".")
            is_brake = name.startswith(BRAKES)
            if not is_brake and dimension not in (OVERHANGS if unit else names):
                raise VehicleError(f"{name}: no such dimension of the body; {suggestion(name, names)}")
            try:
                number, sigma = uncertain_quantity(value, "1" if is_brake else "m")
            except UnitError as error:
                raise VehicleError(f"{name}: {error}") from None
            if name == HALF_TRACK:
                given["half_track_sigma"] = sigma or 0.0
            elif sigma:
                raise VehicleError(f"{name}: expected no standard deviation; only the half track has one")
            target = brakes if is_brake else between if unit else given
            target[name.removeprefix(BRAKES)] = number
        return cls(**given, between=between, brakes=brakes)


@dataclass(frozen=True, kw_only=True)
class Truck:
    """A vehicle with its body at a speed."""

    vehicle: Vehicle
    body: Body = field(default_factory=Body)
    speed: float = 88 / 3.6
    """m/s."""

    def __post_init__(self) -> None:
        require_no_steering(self.vehicle.steering, "assess")
        units = [unit.name for unit in self.vehicle.units]
        names = [f"{unit}.{end}" for unit in units for end in OVERHANGS][1:-1]
        for name in self.body.between:
            if name in (f"{units[0]}.{OVERHANGS[0]}", f"{units[-1]}.{OVERHANGS[1]}"):
                raise VehicleError(f"{name}: expected {name.rpartition('.')[2]}, that of the whole truck; rename it")
            if name not in names:
                raise VehicleError(f"{name}: no such end between two units; {suggestion(name, names)}")
        groups = [path for *_, path in self.groups()]
        for path in self.body.brakes:
            if path not in groups:
                raise VehicleError(f"{BRAKES}{path}: no such axle group; {suggestion(path, groups)}")

    def changed(self, values: Mapping[str, float]) -> "Truck":
        """The truck with other values of parameters by path, and of `HALF_TRACK`."""
        parameters = {name: value for name, value in values.items() if name != HALF_TRACK}
        body = replace(self.body, half_track=values[HALF_TRACK]) if HALF_TRACK in values else self.body
        return replace(self, vehicle=self.vehicle.replace(parameters), body=body)

    @lazy
    def modes(self) -> tuple[NDArray[np.complex128], NDArray[np.complex128], tuple[str, ...]]:
        """Eigenvalues (n,), 1/s, and eigenvectors (n, n) of the linear model at this speed, and its states (n,)."""
        m = matrices(self.vehicle, self.speed, roll=True)
        values, vectors = np.linalg.eig(m.A)
        return values.astype(np.complex128), vectors.astype(np.complex128), m.states

    @property
    def is_stable(self) -> bool:
        """Whether the linear model is stable at this speed."""
        return bool(self.modes[0].real.max() < 0)

    def require_stable(self) -> None:
        """Raise a VehicleError if the linear model is unstable at this speed."""
        if not self.is_stable:
            raise VehicleError(
                f"{self.vehicle.name}: unstable at {3.6 * self.speed:.0f} km/h; choose a speed below its critical speed"
            )

    @property
    def front_axle(self) -> Axle:
        """The first axle of the first unit."""
        return self.vehicle.units[0].axles[0]

    @property
    def rear_axle(self) -> Axle:
        """The last axle of the last unit on the road."""
        return min(self.vehicle.units[-1].on_road, key=lambda axle: axle.position)

    def overhang(self, i: int, end: str) -> float | None:
        """Overhang of unit i at an end of `OVERHANGS`, m; None if it is not given."""
        if (i, end) in ((0, OVERHANGS[0]), (len(self.vehicle.units) - 1, OVERHANGS[1])):
            return self.body.front_overhang if end == OVERHANGS[0] else self.body.rear_overhang
        return self.body.between.get(f"{self.vehicle.units[i].name}.{end}")

    def ends(self) -> list[tuple[float, float]]:
        """x of the rear and of the front end of the body of every unit, m: the front end of a dolly is at its first
        axle, as a drawbar is narrow."""
        rear = [min(axle.position for axle in unit.axles) for unit in self.vehicle.units]
        front = [self.front_axle.position]
        for coupling, unit in zip(self.vehicle.couplings, self.vehicle.units[1:], strict=True):
            is_dolly = coupling.kind == "drawbar_eye"
            front.append(max(axle.position for axle in unit.axles) if is_dolly else coupling.trailing_position)
        overhangs = [[self.overhang(i, end) or 0.0 for i in range(len(rear))] for end in OVERHANGS]
        return [(r - after, f + before) for r, f, before, after in zip(rear, front, *overhangs, strict=True)]

    def semitrailers(self) -> list[int]:
        """Indices of the units on a fifth wheel."""
        return [i for i, coupling in enumerate(self.vehicle.couplings, 1) if coupling.kind == "fifth_wheel"]

    def groups(self) -> list[tuple[int, Unit, AxleGroup, str]]:
        """Index of the unit, unit, axle group and its path, front to rear."""
        return [
            (i, unit, group, unit.group_path(group))
            for i, unit in enumerate(self.vehicle.units)
            for group in unit.axle_groups
        ]


Values = dict[str, float]
"""Measures by name, SI."""
Series = dict[str, Array]
"""Signals over time by name, SI."""
