"""The content of identification.json, and the sensor errors that it gives for any log of the vehicle."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from fifthwheel.errors import FifthwheelError, SignalError
from fifthwheel.identify.result import sensor_settings
from fifthwheel.identify.sensor_errors import estimate_sensor_errors
from fifthwheel.input_files import read_json
from fifthwheel.observe import ObserverSettings, Uncertainty
from fifthwheel.record import Record
from fifthwheel.vehicle import Vehicle


class LogSensors(NamedTuple):
    """The sensors of one log."""

    settings: dict[str, Any]
    """Sensor errors and noise, as arguments of `ObserverSettings`."""
    uncertainty: Uncertainty | None
    """Joint uncertainty of vehicle and sensors."""
    note: str
    """Where the sensor errors come from, if not from the identification; else empty."""


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

    def sensors(self, record: Record, vehicle: Vehicle) -> LogSensors:
        """The sensors of a log; those of a log that was not identified on are estimated from the log itself.

        Args:
            vehicle: as identified.
        """
        note = ""
        if record.name not in self.logs:
            note = f"{record.name}: not a log of the identification; its sensor errors are "
            try:
                estimated = estimate_sensor_errors(record, vehicle, self.uncertainty)
                return LogSensors(*estimated, f"{note}estimated from the log itself")
            except SignalError as error:
                note += f"unknown, and sigma includes their prior ({error})"
        return LogSensors(sensor_settings(self.contents, record.name), self.uncertainty, note)


def load_identification(path: Path) -> StoredIdentification:
    """Read an identification.json.

    Raises:
        SignalError: the file cannot be read, is something else, a sensor error or noise is not a number, or the
            uncertainty is not a covariance.
    """
    try:
        contents = read_json(path)
    except FifthwheelError as error:
        raise SignalError(f"{error}; give the identification.json that `fifthwheel identify` wrote") from None
    try:
        for name in (None, *[log["name"] for log in contents["logs"]]):
            ObserverSettings(**sensor_settings(contents, name))
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
