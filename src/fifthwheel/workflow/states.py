"""States of a known vehicle from logs, with the sensor errors of an earlier identification."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import fifthwheel
from fifthwheel.checks import raise_errors
from fifthwheel.errors import SignalError
from fifthwheel.identify.result import sensor_settings
from fifthwheel.identify.sensor_errors import estimate_sensor_errors
from fifthwheel.observe import Observer, ObserverSettings, States, Status, Uncertainty
from fifthwheel.record import Record
from fifthwheel.report import Conclusion, conclude_states
from fifthwheel.vehicle import Vehicle
from fifthwheel.workflow.inputs import Progress, check_record


@dataclass(frozen=True, kw_only=True)
class StoredIdentification:
    """An identification.json: sensor errors, noise, and the uncertainty of the vehicle."""

    contents: Mapping[str, Any]
    """As `Identification.as_dict` gives them."""
    uncertainty: Uncertainty | None

    @property
    def logs(self) -> frozenset[str]:
        """Names of the logs that were identified on."""
        return frozenset(log["name"] for log in self.contents["logs"])


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


def load_identification(path: Path) -> StoredIdentification:
    """Read an identification.json.

    Raises:
        OSError: the file cannot be read.
        SignalError: the file is something else, or its uncertainty is not a covariance.
    """
    try:
        contents = json.loads(path.read_text(encoding="utf-8"))
        for name in (None, *[log["name"] for log in contents["logs"]]):
            sensor_settings(contents, name)
        uncertainty = contents.get("uncertainty")
        return StoredIdentification(
            contents=contents, uncertainty=None if uncertainty is None else Uncertainty.from_dict(uncertainty)
        )
    except SignalError as error:
        raise SignalError(f"{path}: {error}") from None
    except (ValueError, LookupError, TypeError, AttributeError):
        raise SignalError(
            f"{path}: not an identification.json; give the file that `fifthwheel identify` wrote"
        ) from None


def run_states(
    records: Sequence[Record],
    vehicle: Vehicle,
    settings: ObserverSettings | None = None,
    *,
    identification: StoredIdentification | None = None,
    smooth: bool = False,
    check: bool = True,
    progress: Progress = lambda *_: None,
) -> StatesRun:
    """Estimate the states of a known vehicle.

    Args:
        records: logs of the vehicle.
        vehicle: the vehicle, usually as identified.
        settings: of the observer; with an identification its sensor errors and noise are replaced.
        identification: sensor errors, noise and uncertainty. Those of a log that was not identified on are estimated
            from the log itself.
        smooth: use later samples too.
        check: refuse implausible signals.
        progress: called with a title, the records done and their number.

    Raises:
        SignalError: a log that cannot be used.
    """
    settings = settings or ObserverSettings()
    uncertainty = identification.uncertainty if identification else None
    states, notes = [], []
    for i, record in enumerate(records):
        progress("states", i, len(records))
        if check:
            raise_errors(check_record(record, vehicle))
        used, own = settings, uncertainty
        if identification:
            sensors, own, note = _sensor_errors(identification, record, vehicle)
            used = replace(settings, **sensors)
            notes += [note] if note else []
        observer = Observer(vehicle, record.signals, used)
        states.append((observer.smooth if smooth else observer.batch)(record, own))
    progress("states", len(records), len(records))
    return StatesRun(
        vehicle=vehicle,
        records=tuple(records),
        states=tuple(states),
        smoothed=smooth,
        uncertain=() if uncertainty is None else uncertainty.names,
        conclusion=conclude_states(states, records),
        notes=tuple(notes),
    )


def _sensor_errors(
    identification: StoredIdentification, record: Record, vehicle: Vehicle
) -> tuple[dict[str, Any], Uncertainty | None, str]:
    """Observer settings for the sensors of a log, the uncertainty of vehicle and sensors, and a note if they are not
    those of the identification."""
    uncertainty, note = identification.uncertainty, ""
    if record.name not in identification.logs:
        note = f"{record.name}: not a log of the identification; its sensor errors are "
        try:
            return *estimate_sensor_errors(record, vehicle, uncertainty), f"{note}estimated from the log itself"
        except SignalError as error:
            note += f"unknown, and sigma includes their prior ({error})"
    return sensor_settings(identification.contents, record.name), uncertainty, note


def _summary(states: States) -> dict[str, Any]:
    fractions = {status.name.lower(): float((states.status == status).mean()) for status in Status}
    return {"name": states.name, "samples": len(states.time), "status": fractions, "states": list(states.values)}
