"""What an identification begins with: the vehicle, its settings, and what earlier logs told."""

import datetime
from dataclasses import dataclass, replace
from pathlib import Path

from fifthwheel.errors import SignalError, VehicleError
from fifthwheel.identify import CommonSettings, Identification, OneStage
from fifthwheel.identify.knowledge.information import LogKnowledge, Occasion, load_masses
from fifthwheel.identify.knowledge.knowledge import Knowledge
from fifthwheel.options import IdentifyOptions
from fifthwheel.vehicle import Vehicle
from fifthwheel.workflow.settings import identification_settings

SAME_LOAD = 0.05
"""Fraction by which a mass of the same load may differ from that of the knowledge, as two weighings do."""


@dataclass(frozen=True, kw_only=True)
class Start:
    """What an identification begins with."""

    vehicle: Vehicle
    settings: CommonSettings
    knowledge: Knowledge | None = None
    occasion: Occasion | None = None


def start_of(truck: Vehicle | Identification, chosen: IdentifyOptions) -> Start:
    """What an identification begins with.

    Args:
        truck: the vehicle as known before the logs. An identification stands for the vehicle and the statements that it
            began with, and for what its logs told.
        chosen: what a user chooses; `knowledge` replaces that of `truck`.

    Raises:
        FifthwheelError, SignalError, VehicleError: as `identification_settings`; the knowledge cannot be read, or
            belongs to another truck or, without a name, to another load.
    """
    vehicle, base = (truck, None) if isinstance(truck, Vehicle) else (truck.initial_vehicle, truck.settings)
    vehicle, settings = identification_settings(vehicle, chosen, base=base if isinstance(base, OneStage) else None)
    if chosen.knowledge is not None:
        knowledge: Knowledge | None = Knowledge.load(chosen.knowledge)
    elif isinstance(truck, Identification):
        knowledge = truck.knowledge
    else:
        trailer, load = chosen.trailer or "", chosen.load or ""
        return Start(vehicle=vehicle, settings=settings, occasion=_occasion(settings, trailer, load))
    if knowledge is None or not knowledge.logs:
        raise SignalError(
            "knowledge: the result has none, because two stages or another version wrote it; identify its logs again "
            "in one stage"
        )
    if not isinstance(settings, OneStage):
        raise SignalError("knowledge: only one stage begins with it; leave out --method, or give a vehicle file")
    last = max(knowledge.logs, key=lambda log: log.date)
    trailer = last.trailer if chosen.trailer is None else chosen.trailer
    _require_same_truck(vehicle, last)
    if chosen.load is None and trailer == last.trailer:
        _require_same_load(vehicle, last)
    load = last.load if chosen.load is None else chosen.load
    return Start(vehicle=vehicle, settings=settings, knowledge=knowledge, occasion=_occasion(settings, trailer, load))


def _occasion(settings: CommonSettings, trailer: str, load: str) -> Occasion | None:
    return Occasion(trailer=trailer, load=load) if isinstance(settings, OneStage) else None


def _require_same_truck(vehicle: Vehicle, known: LogKnowledge) -> None:
    """A VehicleError if the tractors have other names."""
    own = vehicle.units[0].name
    if own != known.tractor:
        raise VehicleError(
            f"{own}: the knowledge is of a truck whose first unit is {known.tractor}; give that of this truck, or the "
            "same name"
        )


def _require_same_load(vehicle: Vehicle, known: LogKnowledge) -> None:
    """A SignalError if a mass that depends on the load has changed since a log."""
    for path, value in load_masses(vehicle).items():
        before = known.masses.get(path, value)
        if abs(value - before) > SAME_LOAD * abs(before):
            raise SignalError(
                f"{path}: {value:g} kg, but {before:g} kg in the knowledge: another load? Name it, such as --load "
                "empty; its mass, CoG, yaw inertia and payload then begin from the vehicle file"
            )


def with_date(start: Start, path: Path) -> Start:
    """With the date of a file, for logs whose samples have none; a file that does not exist has none."""
    if start.occasion is None or not path.exists():
        return start
    date = datetime.datetime.fromtimestamp(path.stat().st_mtime, datetime.UTC)
    return replace(start, occasion=replace(start.occasion, date=date))
