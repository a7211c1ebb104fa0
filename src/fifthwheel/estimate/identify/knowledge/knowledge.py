"""What is known of a truck, its trailers, loads and sensors from logs."""

import functools
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Self

import numpy as np

from fifthwheel.base.arguments import expect_each
from fifthwheel.base.errors import SignalError, VehicleError, suggestion
from fifthwheel.base.names import ParameterPath
from fifthwheel.base.options import FleetSettings
from fifthwheel.base.spelling import setting
from fifthwheel.base.types import ComparedByContents
from fifthwheel.data.record import Record
from fifthwheel.estimate.identify.knowledge.information import (
    OUTLIER,
    Labels,
    LogKnowledge,
    Occasion,
    masses_of_load,
    origin,
    record_digest,
)
from fifthwheel.estimate.identify.knowledge.load import load_factors
from fifthwheel.estimate.identify.one_stage.prior import JointPrior
from fifthwheel.estimate.identify.setup import Setup
from fifthwheel.truck import Vehicle
from fifthwheel.truck.quantities import FRICTION

if TYPE_CHECKING:
    from fifthwheel.estimate.identify.knowledge.changes import TripChange
    from fifthwheel.estimate.identify.knowledge.combination import Combined

SAME_LOAD = 0.05
"""Fraction by which a given mass of one load may differ from log to log, as two weighings do."""
OUTLYING = "contradicts the logs after it"
"""Why a log is set aside."""
UNSURE = "must be identified again: its search did not end, or the model does not explain it"
"""The same; no other log changes that."""
FALSE_ALARM = 0.01
"""Probability of a false change by one log."""
SHORTEST_DIGEST = 12
"""Characters of a digest that name a log."""


@dataclass(frozen=True, kw_only=True)
class LogChange:
    """What a log shows that differs from the logs before it."""

    kind: str  # "tyres", "load", "sensor" or `OUTLIER`
    unknowns: tuple[str, ...]  # names of those that it alters
    text: str  # a sentence
    log: str = ""  # digest of the log from which on it is; of the log itself for an outlier


@dataclass(frozen=True, kw_only=True, eq=False)
class Knowledge(ComparedByContents):
    """The information of logs on one truck, of each by itself, so that they can be combined, removed and merged.

    Example:
        >>> import fifthwheel as fw
        >>> truck = fw.vehicle("cheng_cebon_2011")
        >>> settings = fw.OneStage(given={"*": "exact", "tractor.front.cornering_stiffness": "free"}, tyres="linear")
        >>> first, second = (fw.simulate(truck, count=1, seed=seed, name=f"run {seed}") for seed in (1, 2))
        >>> once = fw.identify([first], truck, settings)
        >>> twice = fw.identify([second], truck, settings, knowledge=once.knowledge)
        >>> [log.name for log in twice.knowledge.logs]
        ['run 1', 'run 2']
        >>> front = "tractor.front.cornering_stiffness"
        >>> twice[front].sigma < once[front].sigma
        True
    """

    logs: tuple[LogKnowledge, ...] = ()
    """In the order in which they were added."""

    def __post_init__(self) -> None:
        expect_each("logs", self.logs, LogKnowledge)

    @property
    def used(self) -> tuple[LogKnowledge, ...]:
        """The logs that are not set aside."""
        return tuple(log for log in self.logs if not log.set_aside)

    def occasion(self, vehicle: Vehicle, trailer: str | None) -> Occasion:
        """Trailer and load of the latest log of a truck, or of its latest one with this trailer."""
        logs = [log for log in self.logs if log.tractor == vehicle.units[0].name and trailer in (None, log.trailer)]
        last = max(logs, key=lambda log: log.date, default=None)
        return Occasion(trailer=last.trailer, load=last.load) if last else Occasion(trailer=trailer or "")

    @functools.cached_property
    def combined(self) -> "Combined":
        """The logs together, with the changes between them."""
        from fifthwheel.estimate.identify.knowledge.changes import WINDOWS
        from fifthwheel.estimate.identify.knowledge.combination import combine

        self.require_used()
        tests = len(self.used) * len(WINDOWS)
        combined = None
        with suppress(np.linalg.LinAlgError):
            combined = combine(self.used, tyre_walk=FleetSettings().tyre_walk, false_alarm=FALSE_ALARM / tests)
        if combined is None or not np.isfinite([combined.z, combined.variance]).all():
            raise SignalError("knowledge: its numbers are impossible and cannot be combined; identify the logs again")
        return combined

    @functools.cached_property
    def changes(self) -> tuple[LogChange, ...]:
        """Between the logs, in the order of time."""
        return tuple(_change(self.combined, change) for change in self.combined.changes)

    def changes_by(self, logs: Sequence[LogKnowledge]) -> tuple[LogChange, ...]:
        """The changes that more logs show, besides those that these already state."""
        before = self.changes if self.used else ()
        return tuple(change for change in self.with_logs(logs).changes if change not in before)

    def earlier_changes_by(self, logs: Sequence[LogKnowledge]) -> tuple[LogChange, ...]:
        """The changes at these logs that only later logs show; none if the others are not later than all of these."""
        dates = [[(log.date, log.name) for log in group] for group in (self.used, logs)]
        if max(dates[0]) >= min(dates[1]):
            return ()
        digests = {log.digest for log in self.used}
        return tuple(change for change in self.changes_by(logs) if change.log in digests)

    def prior(self, setup: Setup, occasion: Occasion, given: Vehicle | None = None) -> JointPrior | None:
        """The information of the logs on the unknowns of a setup; None if nothing.

        `given` is the vehicle as stated, where that of the setup is identified.
        """
        if not self.used:
            return None
        stated = (given or setup.vehicle).parameters()
        labels = Labels.of(setup.vehicle, occasion, setup.estimated)
        owners = {labels.owned(u.name, origin(u, stated)): u for u in setup.unknowns if not u.per_log}
        date = occasion.date or self.combined.logs[-1].date
        return self.combined.prior(owners, date, load_factors(setup.vehicle))

    @property
    def _owners(self) -> set[tuple[tuple[str, str], ...]]:
        """The owners of all that the logs inform on."""
        return {unknown.owner for log in self.logs for unknown in log.unknowns}

    def require_used(self) -> None:
        """A SignalError if there is no log, or all are set aside."""
        if not self.used:
            reasons = "".join(dict.fromkeys(f" ({log.name} {log.set_aside})" for log in self.logs[:1]))
            raise SignalError(
                f"knowledge: no log that is used{reasons}; identify one, or give the result folder of another run"
            )

    def require_same_truck(self, vehicle: Vehicle, occasion: Occasion) -> None:
        """A VehicleError if all logs are of trucks with another name of the first unit, and share nothing with this."""
        labels, trucks = Labels.of(vehicle, occasion), {log.tractor for log in self.logs}
        own = {labels.owned(name).owner for name in (*vehicle.parameters(), FRICTION)}
        if trucks and labels.tractor not in trucks and own.isdisjoint(self._owners):
            raise VehicleError(
                f"{labels.tractor}: the knowledge is of a truck whose first unit is {', '.join(sorted(trucks))}; give "
                "that of this truck, or the same name"
            )

    def require_same_load(self, vehicle: Vehicle, occasion: Occasion) -> None:
        """A SignalError if the given masses are those of another load."""
        labels = Labels.of(vehicle, occasion)
        known = {log.owned(path): (of_log, log.name) for log in self.used for path, of_log in log.masses.items()}
        for path, mass in masses_of_load(vehicle).items():
            before, name = known.get(labels.owned(path), (mass, ""))
            if abs(mass - before) > SAME_LOAD * before:
                raise SignalError(
                    f"{path}: {mass:g} kg, but {before:g} kg with the same load in {name}: another load? Name it "
                    f"({setting('load', 'half')}); what depends on it then begins from the vehicle file"
                )

    def with_logs(self, logs: Sequence[LogKnowledge]) -> "Knowledge":
        """With more logs; one with the same samples replaces the former."""
        digests = {log.digest for log in logs if log.digest}
        return Knowledge(logs=(*(log for log in self.logs if log.digest not in digests), *logs))

    def with_changes(self, changes: Sequence[LogChange]) -> "Knowledge":
        """With changes that later logs show: an outlier is set aside, other unknowns begin again with their log."""
        logs = []
        for log in self.logs:
            own = [change for change in changes if log.digest and change.log == log.digest]
            if any(change.kind == OUTLIER for change in own):
                log = replace(log, set_aside=OUTLYING)
            members = {name for change in own if change.kind != OUTLIER for name in change.unknowns}
            logs.append(replace(log, changed=tuple(sorted({*log.changed, *members}))))
        return Knowledge(logs=tuple(logs))

    def majority(self, logs: Sequence[LogKnowledge]) -> "Knowledge | None":
        """The logs that were set aside instead of those in use, if together with these logs they are more, and agree;
        None if not."""
        aside = [log for log in self.logs if log.set_aside not in ("", UNSURE)]
        if not aside or len(aside) + len(logs) <= len(self.used):
            return None
        if Knowledge(logs=(*(replace(log, set_aside="") for log in aside), *logs)).changes:
            return None
        swapped = {"": OUTLYING, UNSURE: UNSURE}
        return Knowledge(logs=tuple(replace(log, set_aside=swapped.get(log.set_aside, "")) for log in self.logs))

    def without_records(self, records: Sequence[Record]) -> "Knowledge":
        """Without these logs: a log counts once."""
        digests = {record_digest(record) for record in records} if self.logs else set()
        return Knowledge(logs=tuple(log for log in self.logs if log.digest not in digests))

    def without(self, name: str) -> "Knowledge":
        """Without a log; logs that are set aside are used if they do not contradict the others any more.

        Args:
            name: of the log, or the beginning of its digest.

        Raises:
            SignalError: there is no such log, several have this name, or it is the last one.
        """
        found = [log for log in self.logs if log.name == name] or [
            log for log in self.logs if len(name) >= SHORTEST_DIGEST and log.digest.startswith(name)
        ]
        if not found:
            raise SignalError(f"{name}: no such log; {suggestion(name, dict.fromkeys(log.name for log in self.logs))}")
        if len(found) > 1:
            digests = " or ".join(log.digest[:SHORTEST_DIGEST] for log in found)
            raise SignalError(f"{name}: {len(found)} logs have this name; give the beginning of a digest: {digests}")
        if len(self.logs) == 1:
            raise SignalError(f"{name}: the last log, without which nothing is known; delete the file instead")
        return Knowledge(logs=tuple(log for log in self.logs if log is not found[0]))._reconsidered()

    def _reconsidered(self) -> "Knowledge":
        """With the logs used that are set aside and do not contradict those that are used, the earliest first."""
        accepted = Knowledge(logs=self.used)
        aside = [log for log in self.logs if log.set_aside not in ("", UNSURE)]
        for log in sorted(aside, key=lambda log: log.date):
            again = replace(log, set_aside="")
            if not any(change.kind == OUTLIER for change in accepted.changes_by([again])):
                accepted = accepted.with_logs([again])
        used = {id(log.information): log for log in accepted.logs}
        return Knowledge(logs=tuple(used.get(id(log.information), log) for log in self.logs))

    def merged(self, other: "Knowledge") -> "Knowledge":
        """With the logs of another knowledge of the truck; a log counts once.

        Raises:
            SignalError: it is of another truck.
        """
        own, others = ({log.tractor for log in knowledge.logs} for knowledge in (self, other))
        if own and not others <= own and self._owners.isdisjoint(other._owners):
            raise SignalError(
                f"{', '.join(sorted(others - own))}: the first unit of another truck than {', '.join(sorted(own))}; "
                "merge results of one truck, or give both vehicle files the same name of the first unit"
            )
        known = {log.digest for log in self.logs if log.digest}
        return Knowledge(logs=(*self.logs, *(log for log in other.logs if log.digest not in known)))

    def save(self, path: str | Path) -> None:
        """Write a file, complete or not at all; `load` reads an equal one."""
        from fifthwheel.estimate.identify.knowledge import storage

        storage.write(Path(path), self.logs)

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """The knowledge in a file, or of a folder or an identification.json of `fifthwheel identify`.

        Raises:
            SignalError: the file cannot be read, or is not one of `save`.
        """
        from fifthwheel.estimate.identify.knowledge import storage

        return cls(logs=storage.read(Path(path)))


_CHANGES = {
    "tyres": "The tyres of {subject} in {log} differ from those in the logs before it: their stiffness begins again",
    "load": "The load of the {subject} in {log} differs from that in the logs before it, and begins again: name it",
    "sensor": "{subject} in {log} differs from the logs before it, and its errors begin again",
    OUTLIER: "{log} differs from the logs before and after it",
}
"""Sentences without their end."""


def tyre_change(stiffness: str, log: str) -> LogChange:
    """The change of a cornering stiffness by its path."""
    text = _CHANGES["tyres"].format(subject=ParameterPath.of(stiffness).owner, log=log)
    return LogChange(kind="tyres", unknowns=(stiffness,), text=f"{text}.")


def _change(combined: "Combined", change: "TripChange") -> LogChange:
    log, names = combined.logs[change.trip], [u.name for u in combined.layout.unknowns]
    text = _CHANGES[change.kind.name].format(subject=change.kind.subject, log=log.name)
    members = tuple(names[i] for i in change.kind.members)
    return LogChange(kind=change.kind.name, unknowns=members, text=f"{text}.", log=log.digest)
