"""What an identification begins with: the vehicle, its settings, and the information of earlier logs."""

import datetime
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from fifthwheel.apps.workflow.inputs import read_knowledge, read_vehicle
from fifthwheel.apps.workflow.note import Note
from fifthwheel.apps.workflow.settings import identification_settings
from fifthwheel.base.errors import FifthwheelError, SignalError, suggestion
from fifthwheel.base.options import IdentifyOptions
from fifthwheel.base.spelling import setting
from fifthwheel.base.units import quantity
from fifthwheel.estimate.identify import CommonSettings, Identification, OneStage
from fifthwheel.estimate.identify.knowledge.information import Occasion
from fifthwheel.estimate.identify.knowledge.knowledge import Knowledge
from fifthwheel.estimate.identify.knowledge.load import with_payload
from fifthwheel.estimate.identify.one_stage.prior import Earlier, nothing
from fifthwheel.truck import Vehicle


@dataclass(frozen=True, kw_only=True)
class Start:
    """What the identification of logs with one load begins with."""

    logs: tuple[Path, ...]
    vehicle: Vehicle
    settings: CommonSettings
    knowledge: Knowledge | None = None
    occasion: Occasion | None = None
    note: Note | None = None

    @property
    def folder(self) -> str:
        """Name of the folder for the results, if the load is not the last."""
        load = self.occasion.load if self.occasion else ""
        return f"load_{re.sub('[^0-9A-Za-z]+', '_', Path(load).stem)}"

    @property
    def one_stage(self) -> OneStage:
        """The settings, if they are of one stage."""
        if self.settings.one_stage is None:
            raise SignalError(f"method: only one stage predicts; leave out {setting('method')}")
        return self.settings.one_stage

    @property
    def earlier(self) -> Earlier:
        """The information of earlier logs on the unknowns of a setup."""
        if self.knowledge is None or self.occasion is None:
            return nothing
        self.knowledge.require_same_load(self.vehicle, self.occasion)
        return partial(self.knowledge.prior, occasion=self.occasion)


def starts_of(truck: Vehicle | Identification, chosen: IdentifyOptions, logs: Sequence[Path] = ()) -> list[Start]:
    """What the identification of logs begins with, for each load; that of the last log, or of the options, last.

    Args:
        truck: the vehicle as known before the logs. An identification stands for the vehicle and the statements that it
            began with, and for the information of its logs.
        chosen: what a user chooses; `knowledge` replaces that of `truck`.
        logs: none before a run is driven.

    Raises:
        FifthwheelError, SignalError, VehicleError: as `identification_settings`; the knowledge cannot be read, has no
            log that is used, or belongs to another truck; a load is of no log, or cannot be read, or is another one
            without a name.
    """
    loads = _loads(chosen.load, logs)
    given, base = (truck, None) if isinstance(truck, Vehicle) else (truck.initial_vehicle, truck.settings)
    knowledge = _knowledge(truck) if isinstance(truck, Identification) and chosen.knowledge is None else None
    if chosen.knowledge is not None:
        knowledge = read_knowledge(chosen.knowledge)
        knowledge.require_used()
    starts, note = [], Note.of(chosen)
    final = loads[logs[-1]] if logs else _common(chosen.load)
    for load in sorted({*loads.values(), final}, key=lambda load: (load == final, load)):
        vehicle = _with_load(given, load)
        vehicle, settings = identification_settings(vehicle, chosen, base=base.one_stage if base else None)
        own = tuple(path for path in logs if loads[path] == load)
        if settings.one_stage is None:
            starts.append(Start(logs=own, vehicle=vehicle, settings=settings, note=note))
            continue
        earlier, date = knowledge or Knowledge(), _date(own[0]) if own else None
        last = earlier.occasion(vehicle, chosen.trailer)
        occasion = replace(last, load=load or last.load, road=chosen.road or "", date=date)
        earlier.require_same_truck(vehicle, occasion)
        start = Start(logs=own, vehicle=vehicle, settings=settings, knowledge=knowledge, occasion=occasion, note=note)
        starts.append(start)
    return starts


def _loads(texts: Sequence[str], logs: Sequence[Path]) -> Mapping[Path, str]:
    """The load of each log, empty if none is given; a SignalError for a load of no log, or several for all."""
    names = {str(path): path for path in logs} | {path.name: path for path in logs} | {path.stem: path for path in logs}
    own = dict[Path, str]()
    for text in texts:
        log, equals, load = text.partition("=")
        if equals and log not in names:
            raise SignalError(f"{setting('load', text)}: no log {log}; {suggestion(log, [path.name for path in logs])}")
        if equals:
            own[names[log]] = load.strip()
    return {path: own.get(path, _common(texts)) for path in logs}


def _common(texts: Sequence[str]) -> str:
    """The load of all logs without one of their own; empty if none is given, a SignalError for several."""
    common = [text.strip() for text in texts if "=" not in text]
    if len(common) > 1:
        raise SignalError(f"{setting('load', common[1])}: {common[0]} is the load of all logs already; write LOG=LOAD")
    return "".join(common)


def _with_load(vehicle: Vehicle, load: str) -> Vehicle:
    """The vehicle with a load: a payload mass, a vehicle file, or a name, which leaves the vehicle as it is."""
    if load.endswith(".toml"):
        return read_vehicle(load)
    try:
        mass = quantity(load, "kg") if load[:1].isdigit() and load[-1:].isalpha() else None
    except FifthwheelError:
        return vehicle
    return vehicle if mass is None else with_payload(vehicle, mass)


def _knowledge(kept: Identification) -> Knowledge:
    """A SignalError if the identification keeps none."""
    if kept.knowledge is None or not kept.knowledge.logs:
        raise SignalError(
            "knowledge: the result has none, because two stages or another version wrote it; identify its logs again "
            "in one stage"
        )
    return kept.knowledge


def _date(path: Path) -> datetime.datetime | None:
    """Of a file, for logs whose samples have none; None if there is no such file."""
    return datetime.datetime.fromtimestamp(path.stat().st_mtime, datetime.UTC) if path.exists() else None
