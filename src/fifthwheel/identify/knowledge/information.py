"""The information of one log on what logs of one truck share; made by `identify.one_stage.shared_information`."""

import datetime
import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated, Any

import numpy as np
from pydantic import BeforeValidator

from fifthwheel._arguments import expect_optional
from fifthwheel._types import ComparedByContents
from fifthwheel.channels import SensorErrorName
from fifthwheel.identify.stored import Flags, Positive, Symmetric, Vector
from fifthwheel.identify.unknowns.parameters import unit_of_unknown
from fifthwheel.identify.unknowns.unknown import Unknown
from fifthwheel.names import ParameterPath
from fifthwheel.record import Record
from fifthwheel.record.record import EARLIEST_DATE
from fifthwheel.vehicle import Vehicle
from fifthwheel.vehicle.quantities import FRICTION, TIME_BASE, quantity_of

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
    """Name of the road, whose friction all logs on it share; empty: that of each log is its own."""
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
        if time >= EARLIEST_DATE:
            return datetime.datetime.fromtimestamp(time, datetime.UTC)
        return self.date or datetime.datetime.now(datetime.UTC)


@dataclass(frozen=True)
class Owned:
    """An unknown, and the trailer and the load that it belongs to; None for one of the truck, or of every load. The
    friction belongs to a road."""

    name: str
    trailer: str | None = None
    load: str | None = None
    origin: str = ""
    """Of a change of the vehicle file: the numbers that it changes. A number that is stated anew has a new error."""
    road: str | None = None


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
    origins: tuple[str, ...] = ()  # `Owned.origin` of each unknown; empty if all are those of one vehicle file
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
class LogKnowledge(ComparedByContents):
    """The information of one log, and where it belongs."""

    name: str
    date: Annotated[datetime.datetime, BeforeValidator(_date)]  # UTC
    tractor: str  # name of the first unit
    trailer: str
    load: str
    road: str = ""
    information: SharedInformation
    estimated: tuple[str, ...]  # names of the estimated parameters; the others are uncertain, or errors of sensors
    digest: str = ""  # of the log, by `record_digest`
    masses: Mapping[str, Positive] = field(default_factory=dict)  # given masses that depend on the load, kg, by path
    changed: tuple[str, ...] = ()
    """Names of unknowns that differ from those of the logs before it, such as the stiffness of new tyres."""
    set_aside: str = ""  # why it is not used; empty if it is
    doubts: tuple[str, ...] = ()  # evidence in the log against an assumption, in words

    @property
    def unknowns(self) -> tuple[Owned, ...]:
        """The shared unknowns with their owners."""
        origins = self.information.origins or ("",) * len(self.information.names)
        return tuple(self.owned(name, origin) for name, origin in zip(self.information.names, origins, strict=True))

    def owned(self, name: str, origin: str = "") -> Owned:
        """An unknown of this log with its owner."""
        if name == FRICTION:
            return Owned(name, road=self.road)
        return owner(name, self.tractor, self.trailer, self.load, origin=origin, lumped=name in self.estimated)


def masses_of_load(vehicle: Vehicle) -> dict[str, float]:
    """Masses that depend on the load, kg, by path."""
    tractor = vehicle.units[0].name
    values = {path: value for path, value in vehicle.parameters().items() if quantity_of(path).unit == "kg"}
    return {path: value for path, value in values.items() if owner(path, tractor, "", "load").load}


def owner(name: str, tractor: str, trailer: str, load: str, *, origin: str = "", lumped: bool = False) -> Owned:
    """An unknown of a log with the trailer and the load that it belongs to.

    `lumped`: a body is that with its payload.
    """
    scope = quantity_of(name).scope
    if scope == "axle load":
        return Owned(name, trailer, load, origin)
    if scope == "truck" or unit_of_unknown(name) == tractor:
        return Owned(name, origin=origin)
    of_load = scope == "load" or (lumped and ParameterPath.of(name).component == "sprung")
    return Owned(name, trailer, load if of_load and of_vehicle(name) else None, origin)


def of_vehicle(name: str) -> bool:
    """Whether an unknown is one of the vehicle, and not of a sensor or of a time base."""
    return name != TIME_BASE and SensorErrorName.of(name) is None


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
