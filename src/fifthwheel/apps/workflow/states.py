"""States of a known vehicle from logs, with the sensor errors of an earlier identification."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

import fifthwheel
from fifthwheel.base.formatting import with_sigma
from fifthwheel.base.spelling import setting
from fifthwheel.data.checks import raise_errors
from fifthwheel.data.record import Record
from fifthwheel.estimate.identify import Identification
from fifthwheel.estimate.identify.sensor_errors import log_sensors
from fifthwheel.estimate.identify.settings import Progress
from fifthwheel.estimate.observe import Observer, ObserverSettings, States, Status, Uncertainty
from fifthwheel.estimate.time_bases import check_signals
from fifthwheel.results.report import Conclusion, conclude_states
from fifthwheel.truck import Vehicle
from fifthwheel.truck.quantities import FRICTION


@dataclass(frozen=True, kw_only=True)
class StatesRun:
    """States of a known vehicle."""

    vehicle: Vehicle
    records: tuple[Record, ...]
    states: tuple[States, ...]
    """Of every record, in the same order."""
    smoothed: bool
    uncertain: tuple[str, ...]
    """Parameters and sensor errors whose uncertainty is in every sigma."""
    conclusion: Conclusion
    notes: tuple[str, ...]
    """Where the sensor errors of a log come from, if not from the identification."""

    def as_dict(self) -> dict[str, Any]:
        """A summary for JSON, without the time series."""
        return {
            "version": fifthwheel.__version__,
            "smoothed": self.smoothed,
            "uncertain": list(self.uncertain),
            "logs": [_summary(states) for states in self.states],
            "conclusion": self.conclusion.as_dict(),
        }


def run_states(
    records: Sequence[Record],
    vehicle: Vehicle,
    settings: ObserverSettings | None = None,
    *,
    identification: Identification | None = None,
    smooth: bool = False,
    check: bool = True,
    progress: Progress = lambda *_: None,
) -> StatesRun:
    """Estimate the states of a known vehicle.

    Args:
        records: logs of the vehicle.
        vehicle: the vehicle, usually as identified.
        settings: of the observer; with an identification its sensor errors and noise are replaced, and its friction if
            that is None.
        identification: sensor errors, noise and uncertainty. Those of a log that was not identified on are estimated
            from the log itself.
        smooth: use later samples too.
        check: refuse implausible signals.

    Raises:
        SignalError: a log that cannot be used.
    """
    settings = settings or ObserverSettings()
    uncertainty = identification.covariance if identification else None
    states, notes = [], []
    friction = None if settings.friction is None else f"{settings.friction:.3g}"
    if identification and friction and identification.friction is None:
        saturating = setting("tyres", "saturating")
        notes.append(f"The identification had linear tyres: identify again with {saturating} or auto.")
    if not identification and (stated := sorted({name for record in records for name in record.sensors})):
        notes.append(
            f"What is stated of the sensors of {', '.join(stated)} is used with {setting('identification')} only."
        )
    for i, record in enumerate(records):
        progress("states", i, len(records))
        if check:
            raise_errors(check_signals(record, vehicle))
        used, own = settings, uncertainty
        if identification:
            sensors = log_sensors(identification, record, vehicle, settings.friction)
            used, own = replace(settings, **sensors.settings), sensors.uncertainty
            friction = _friction(used, own)
            notes += [sensors.note] if sensors.note else []
        observer = Observer(vehicle, record.signals, used)
        states.append((observer.smooth if smooth else observer.batch)(record, own))
    progress("states", len(records), len(records))
    conclusion = conclude_states(states, records, identification)
    if friction is not None:
        note = f"Tyres saturate at a friction of the road of {friction}."
        conclusion = replace(conclusion, notes=(*conclusion.notes, note))
    return StatesRun(
        vehicle=vehicle,
        records=tuple(records),
        states=tuple(states),
        smoothed=smooth,
        uncertain=() if uncertainty is None else uncertainty.names,
        conclusion=conclusion,
        notes=tuple(notes),
    )


def _friction(settings: ObserverSettings, uncertainty: Uncertainty | None) -> str | None:
    """The friction with its sigma if it was estimated; None with linear tyres."""
    if settings.friction is None:
        return None
    if uncertainty is None or FRICTION not in uncertainty.names:
        return f"{settings.friction:.3g}"
    sigma = float(np.sqrt(uncertainty.among([FRICTION]).covariance[0, 0]))
    return with_sigma(settings.friction, sigma, "1")


def _summary(states: States) -> dict[str, Any]:
    fractions = {status.name.lower(): float((states.status == status).mean()) for status in Status}
    return {"name": states.name, "samples": len(states.time), "status": fractions, "states": list(states.values)}
