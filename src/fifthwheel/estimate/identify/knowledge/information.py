"""The information of one log on what logs of one truck share; made by `identify.one_stage.shared_information`."""

import datetime
import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated, Any, Self

import numpy as np
from pydantic import BeforeValidator

from fifthwheel.base.arguments import expect_optional
from fifthwheel.base.names import ParameterPath
from fifthwheel.base.types import ComparedByContents
from fifthwheel.data.channels import SensorErrorName
from fifthwheel.data.record import Record
from fifthwheel.data.record.timestamps import utc_date
from fifthwheel.estimate.identify.stored import Flags, Positive, Symmetric, Vector
from fifthwheel.estimate.identify.unknowns.parameters import unit_of_unknown
from fifthwheel.estimate.identify.unknowns.unknown import Unknown
from fifthwheel.truck import Vehicle
from fifthwheel.truck.quantities import SCOPES, Scope, quantity_of

OUTLIER = "outlier"
"""Kind of a trip that differs from those before and after it."""


@dataclass(frozen=True, kw_only=True)
class Occasion:
    """What logs were driven with, and when.

    Example:
        >>> import fifthwheel as fw
        >>> fw.Occasion(trailer="T 17", load="steel").load
        'steel'
    """

    trailer: str = ""
    """Name of the trailer."""
    load: str = ""
    """Name of its load."""
    road: str = ""
    """Name of the road, whose friction all logs on it share; empty: only the logs of one identification do."""
    date: datetime.datetime | None = None
    """UTC; None takes that of the log, or today if it has none."""

    def __post_init__(self) -> None:
        expect_optional("date", self.date, datetime.datetime)

    def date_of(self, records: Sequence[Record]) -> datetime.datetime:
        """The date of the first sample, if the logs have one; else its own, or today."""
        started = min((record.started for record in records if record.started), default=self.date)
        return started or datetime.datetime.now(datetime.UTC)

    def date_at(self, time: float) -> datetime.datetime:
        """The date of a sample at a time, s, if it has one; else its own, or today."""
        return utc_date(time) or self.date or datetime.datetime.now(datetime.UTC)


@dataclass(frozen=True)
class Owned:
    """An unknown, and the labels of the logs that share it."""

    name: str
    owner: tuple[tuple[str, str], ...]  # pairs of label and name, by `SCOPES`
    origin: str = ""
    """Of a change of the vehicle file: the numbers that it changes. A number that is stated anew has a new error."""

    def of(self, label: str) -> str | None:
        """The trailer, load or other label that it belongs to; None if it belongs to none."""
        return dict(self.owner).get(label)


@dataclass(frozen=True, kw_only=True, eq=False)
class SharedInformation(ComparedByContents):
    """What one log contributes to the cost of n shared unknowns, z ~ N(0, I)."""

    names: tuple[str, ...]
    centre: Vector  # prior mean (n,), SI; median of a logarithmic unknown
    scale: Vector  # prior standard deviation (n,), SI; of the logarithm of a logarithmic unknown
    logarithmic: Flags  # (n,): value = centre exp(scale z); the others: value = centre + scale z
    non_negative: Flags
    """(n,): z is not below 0, such as that of a play. A combination below 0 means that the unknown is 0."""
    vector: Vector  # v (n,)
    information: Symmetric  # H_s (n, n) of the shared unknowns
    score_covariance: Symmetric
    """Long-run covariance (n, n) of the sum of the scores; equal to the information if the model is right."""
    origins: tuple[str, ...]  # `Owned.origin` of each unknown
    factors: Mapping[str, Positive] = field(default_factory=dict)
    """Value in this log over the shared value, by name; 1 for others. See `load.load_factors`."""


def _date(value: Any) -> datetime.datetime:
    """The date of a log in a file."""
    if not isinstance(value, str):
        raise TypeError(f"expected a text, got {type(value).__name__}")
    date = datetime.datetime.fromisoformat(value)
    if date.tzinfo is None or not 1900 <= date.year <= 2200:
        raise ValueError(f"date {value}: expected one with its time zone, such as 2026-01-01T08:00:00+00:00")
    return date.astimezone(datetime.UTC)


@dataclass(frozen=True, kw_only=True, eq=False)
class Labels(ComparedByContents):
    """The names of a log and of what was driven, which decide what it shares with other logs."""

    name: str = ""  # of the log
    tractor: str  # name of the first unit
    trailer: str
    load: str
    road: str = ""  # empty: no other log was driven on it
    units: Mapping[str, str] = field(default_factory=dict)  # labels of units in the vehicle file, by path
    estimated: tuple[str, ...] = ()
    """Names of the estimated parameters; the others are uncertain, or errors of sensors."""

    @classmethod
    def of(cls, vehicle: Vehicle, occasion: Occasion, estimated: Sequence[str] = ()) -> Self:
        """Those of a log of a vehicle."""
        known = {label for sharing in SCOPES.values() for label in (*sharing.first, *sharing.others)}
        units = {f"{u.name}.{label}": text for u in vehicle.units for label in known if (text := getattr(u, label, ""))}
        names = {"trailer": occasion.trailer, "load": occasion.load, "road": occasion.road}
        return cls(tractor=vehicle.units[0].name, **names, units=units, estimated=tuple(estimated))

    def owned(self, name: str, origin: str = "") -> Owned:
        """An unknown of this log with its owner. An estimated body is that with its payload; a sensor without a unit is
        one of the truck."""
        scope, unit = quantity_of(name).scope, unit_of_unknown(name)
        if SensorErrorName.of(name):
            scope = "unit" if unit else "truck"
        elif name in self.estimated and ParameterPath.of(name).component == "sprung":
            scope = "load"
        return Owned(name, self._owner(scope, unit), origin)

    def _owner(self, scope: Scope, unit: str) -> tuple[tuple[str, str], ...]:
        """The owner of a number of a unit."""
        sharing = SCOPES[scope]
        wanted = sharing.first if unit == self.tractor else sharing.others
        paths = {ParameterPath.of(path): name for path, name in self.units.items()}
        known = {path.quantity: name for path, name in paths.items() if path.unit == unit}
        known |= {"tractor": self.tractor, "trailer": self.trailer, "load": self.load, "log": self.name}
        known |= {"road": self.road} if self.road else {}
        if not known.keys() >= set(wanted):
            return self._owner(sharing.otherwise, unit)
        return tuple((label, known[label]) for label in wanted)


@dataclass(frozen=True, kw_only=True, eq=False)
class LogKnowledge(Labels):
    """The information of one log, and where it belongs."""

    date: Annotated[datetime.datetime, BeforeValidator(_date)]  # UTC
    information: SharedInformation
    digest: str = ""  # of the log, by `record_digest`
    masses: Mapping[str, Positive] = field(default_factory=dict)  # given masses that depend on the load, kg, by path
    changed: tuple[str, ...] = ()
    """Names of unknowns that differ from those of the logs before it, such as the stiffness of new tyres."""
    set_aside: str = ""  # why it is not used; empty if it is
    doubts: tuple[str, ...] = ()  # evidence in the log against an assumption, in words

    @property
    def unknowns(self) -> tuple[Owned, ...]:
        """The shared unknowns with their owners."""
        return tuple(map(self.owned, self.information.names, self.information.origins))


def masses_of_load(vehicle: Vehicle) -> dict[str, float]:
    """Masses that depend on the load, kg, by path."""
    labels = Labels.of(vehicle, Occasion())
    values = {path: value for path, value in vehicle.parameters().items() if quantity_of(path).unit == "kg"}
    return {path: value for path, value in values.items() if labels.owned(path).of("load") is not None}


def origin(unknown: Unknown, given: Mapping[str, float]) -> str:
    """`Owned.origin`: the numbers of the vehicle file that an unknown changes, without a relative one's."""
    if quantity_of(unknown.name).scope == "truck" or not unknown.moves:
        return ""
    return ", ".join(f"{name} = {given[name]:.9g}" for name in unknown.moves if name in given)


def record_digest(record: Record) -> str:
    """Digest of the samples of a log."""
    digest = hashlib.sha256(np.ascontiguousarray(record.time).tobytes())
    for name in sorted(record.signals):
        digest.update(name.encode())
        digest.update(np.ascontiguousarray(record.signals[name]).tobytes())
    return digest.hexdigest()
