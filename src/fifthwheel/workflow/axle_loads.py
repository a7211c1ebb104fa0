"""Axle loads in logs: compared with the vehicle file, and taken as its masses and CoG positions."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from fifthwheel.checks.axle_loads import PREFIX, StaticLoad, static_loads
from fifthwheel.errors import SignalError
from fifthwheel.record import Record
from fifthwheel.vehicle import Vehicle, with_axle_loads


@dataclass(frozen=True, kw_only=True)
class AxleLoadDifference:
    """An axle group whose load in a log is not that of the vehicle file."""

    log: str
    group: str
    """Path of the axle group."""
    measured: float
    """N"""
    expected: float
    """N, the static load by the vehicle file."""

    def __str__(self) -> str:
        return (
            f"{self.log}: {PREFIX}{self.group} is {self.measured / 1e3:.1f} kN, the vehicle file gives "
            f"{self.expected / 1e3:.1f} kN; `fifthwheel weigh` takes masses and CoG from the log"
        )


@dataclass(frozen=True, kw_only=True)
class WeighedVehicle:
    """A vehicle with masses and CoG positions from the axle loads of a log."""

    vehicle: Vehicle
    loads: Mapping[str, StaticLoad]
    """By the path of the axle group."""

    def as_dict(self) -> dict[str, Any]:
        """Loads, masses and CoG positions, for JSON."""
        return {
            "loads": {group: asdict(load) for group, load in self.loads.items()},
            "units": {unit.name: {"mass": unit.mass, "cog": unit.cog} for unit in self.vehicle.units},
        }


def axle_load_differences(
    vehicle: Vehicle, records: Sequence[Record], *, tolerance: float = 0.05
) -> tuple[AxleLoadDifference, ...]:
    """Axle loads in the logs that differ from the vehicle file by more than a fraction of its load.

    Args:
        tolerance: by default the accuracy of on-board weighing.

    Raises:
        SignalError: an axle load with too few samples at rest or on a straight.
    """
    expected = vehicle.axle_loads()
    return tuple(
        AxleLoadDifference(log=record.name, group=group, measured=load.value, expected=expected[group])
        for record in records
        if any(name.startswith(PREFIX) for name in record.signals)
        for group, load in static_loads(record).items()
        if group in expected and abs(load.value / expected[group] - 1) > tolerance
    )


def weigh_vehicle(record: Record, vehicle: Vehicle, *, tolerance: float = 0.02) -> WeighedVehicle:
    """Masses and CoG positions from the axle loads of a log; yaw and roll inertias stay.

    Args:
        tolerance: allowed difference of the front axle's load from the expected one, as a fraction of the tractor's
            load.

    Raises:
        SignalError: the log has no axle load, or one of a group that the vehicle does not have.
        VehicleError: the loads contradict each other.
    """
    loads, groups = static_loads(record), vehicle.axle_loads()
    for group in loads:
        if group not in groups:
            raise SignalError(
                f"{PREFIX}{group}: {vehicle.name} has no axle group {group}; it has {', '.join(groups)}; correct the "
                "name in signals.toml"
            )
    weighed = with_axle_loads(vehicle, {group: load.value for group, load in loads.items()}, tolerance=tolerance)
    source = f"{vehicle.source}; weighed by {record.name}".removeprefix("; ")
    return WeighedVehicle(vehicle=weighed.model_copy(update={"source": source}), loads=loads)
