"""Knowledge as tables: the estimate of each unknown from all logs, and what each log added."""

from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from fifthwheel.base.errors import FifthwheelError
from fifthwheel.base.names import ParameterPath
from fifthwheel.base.types import Array
from fifthwheel.data.channels import SensorErrorName
from fifthwheel.estimate.identify.knowledge.combination import Combined
from fifthwheel.estimate.identify.knowledge.information import OUTLIER, LogKnowledge, Owned
from fifthwheel.estimate.identify.knowledge.knowledge import Knowledge
from fifthwheel.estimate.identify.knowledge.states import State
from fifthwheel.truck import unit_of
from fifthwheel.truck.quantities import MASS_SCALE, TIME_BASE

PRIOR_SIGMAS = "prior sigma"
"""Unit of an unknown that moves several numbers of the vehicle file: standard deviations of its prior."""
CHANGED = {"tyres": "tyres of {} changed", "load": "load of {} changed", "sensor": "sensor {} changed"}
"""A change by its kind."""
DIFFERS = "differs from the logs before and after it, and is not used"
"""Of an outlier."""


@dataclass(frozen=True, kw_only=True)
class SharedEstimate:
    """The estimate of an unknown from all logs, at the last log with it."""

    name: str
    value: float  # SI, or in standard deviations of its prior
    sigma: float
    unit: str
    owner: dict[str, str]  # the labels of the logs that share it, by `SCOPES`
    estimated: bool  # whether it is an estimated parameter; else an uncertain number or a sensor error
    log: str  # the last log with it
    date: str  # of this log, ISO 8601

    @property
    def belongs_to(self) -> str:
        """The truck, a trailer, a load or a road, in words."""
        labels = [label for label in reversed(self.owner) if label != "tractor"]
        named = [label for label in labels if label == labels[0] or self.owner[label]]
        return " of ".join(f"{label} {self.owner[label]}".rstrip() for label in named) or "truck"

    def as_dict(self) -> dict[str, Any]:
        """The fields, for JSON."""
        return {**asdict(self), "belongs_to": self.belongs_to}


@dataclass(frozen=True, kw_only=True, eq=False)
class EstimateHistory:
    """An estimated parameter at each of the N logs with it, from all logs."""

    last: SharedEstimate
    time: Array  # dates of the logs (N,), s since 1970
    value: Array  # (N,), SI
    sigma: Array  # (N,)
    changes: Array  # dates at which it begins again, s since 1970


@dataclass(frozen=True, kw_only=True)
class LogEntry:
    """A log in the history of a truck."""

    log: LogKnowledge
    sigmas: Mapping[str, tuple[float, float]]
    """Of each estimated parameter: sigma before and after this log, by the logs up to it, SI."""
    changes: tuple[str, ...]  # what changed before this log, in words
    unused: str  # why the log is not used; empty if it is

    def as_dict(self) -> dict[str, Any]:
        """The entry, for JSON."""
        log = self.log
        added = [
            {"name": name, "sigma_before": before, "sigma_after": after, "unit": unit_of(name)}
            for name, (before, after) in self.sigmas.items()
        ]
        texts = {name: getattr(log, name) for name in ("name", "trailer", "load", "digest")}
        lists = {"changes": list(self.changes), "doubts": list(log.doubts), "added": added}
        return {**texts, "date": log.date.isoformat(), **lists, "unused": self.unused}


def shared_estimates(knowledge: Knowledge) -> list[SharedEstimate]:
    """The unknowns with their estimates from all logs: the estimated parameters first.

    An unknown that cannot be negative and that all logs together determine as 0 is left out.
    """
    combined = knowledge.combined
    last = {place: k for k, trip in enumerate(combined.observations) for place in trip.places.tolist()}
    places = {unknown: place for unknown, place in combined.layout.unknowns.items() if place in last}
    found = [_shared_estimate(combined, unknown, last[place]) for unknown, place in places.items()]
    return sorted(found, key=lambda estimate: not estimate.estimated)


def estimate_histories(knowledge: Knowledge) -> list[EstimateHistory]:
    """The estimated parameters over the dates of the logs, by the smoother."""
    combined, found = knowledge.combined, []
    seconds = np.array([log.date.timestamp() for log in combined.logs])
    for unknown, logs in combined.trips_with.items():
        value, sigma = np.array([combined.estimate(k, unknown) for k in logs]).T
        place = combined.layout.unknowns[unknown]
        found.append(
            EstimateHistory(
                last=_shared_estimate(combined, unknown, logs[-1]),
                time=seconds[logs],
                value=value,
                sigma=sigma,
                changes=seconds[[k for k, members in combined.walk.resets.items() if place in members]],
            )
        )
    return found


def _shared_estimate(combined: Combined, unknown: Owned, k: int) -> SharedEstimate:
    value, sigma = combined.estimate(k, unknown)
    return SharedEstimate(
        name=unknown.name,
        value=value,
        sigma=sigma,
        unit=unit_of_shared(unknown),
        owner=dict(unknown.owner),
        estimated=unknown in combined.layout.estimated,
        log=combined.logs[k].name,
        date=combined.logs[k].date.isoformat(),
    )


def unit_of_shared(unknown: Owned) -> str:
    """Unit of a shared unknown."""
    if error := SensorErrorName.of(unknown.name):
        return error.unit or ""
    if unknown.origin or unknown.name == MASS_SCALE:
        return PRIOR_SIGMAS
    if unknown.name == TIME_BASE:
        return "1"
    try:
        return unit_of(unknown.name)
    except FifthwheelError:  # moves several numbers
        return PRIOR_SIGMAS


def history(knowledge: Knowledge) -> list[LogEntry]:
    """The logs in the order of their dates, with what each added."""
    used = list(_used(knowledge.combined)) if knowledge.used else []
    aside = [LogEntry(log=log, sigmas={}, changes=(), unused=log.set_aside) for log in knowledge.logs if log.set_aside]
    return sorted([*used, *aside], key=lambda entry: (entry.log.date, entry.log.name))


def _used(combined: Combined) -> Iterator[LogEntry]:
    """The logs that are not set aside, by the filter in the order of time."""
    state = State.prior(len(combined.layout.unknowns))
    for k, log in enumerate(combined.logs):
        found = [change for change in combined.changes if change.trip == k]
        outlier = any(change.kind.name == OUTLIER for change in found)
        before = combined.walk.predict(state, combined.observations, k)
        state = before if outlier else before.updated(combined.observations[k])
        texts = [CHANGED[c.kind.name].format(c.kind.subject) for c in found if c.kind.name != OUTLIER]
        estimated = combined.parameters(k)
        yield LogEntry(
            log=log,
            sigmas={u.name: (combined.sigma(k, before, u), combined.sigma(k, state, u)) for u in estimated},
            changes=tuple(dict.fromkeys([*changes_in_words(log), *texts])),
            unused=DIFFERS if outlier else "",
        )


def changes_in_words(log: LogKnowledge) -> Iterator[str]:
    """What is known to have changed before a log, from the names of the unknowns."""
    unknowns = [log.owned(name) for name in log.changed]
    of_load = any(u.of("load") is not None for u in unknowns)
    if of_load:
        yield CHANGED["load"].format(log.trailer or "trailer")
    for u in unknowns:
        path = ParameterPath.of(u.name)
        if error := SensorErrorName.of(u.name):
            yield CHANGED["sensor"].format(error.signal)
        elif path.quantity == "cornering_stiffness" and not (of_load and u.of("trailer") is not None):
            yield CHANGED["tyres"].format(path.owner)
