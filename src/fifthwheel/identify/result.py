"""The result of an identification: values, sigmas and verdicts, and the data to judge or repeat it."""

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from fifthwheel._atomic import atomic_write
from fifthwheel._types import Array
from fifthwheel.identify.doubts import Doubt
from fifthwheel.identify.history import ParameterHistory
from fifthwheel.identify.parameters import TIME_BASE
from fifthwheel.identify.settings import CommonSettings
from fifthwheel.identify.verdict import Verdict
from fifthwheel.observe import ObserverSettings
from fifthwheel.observe.uncertainty import Uncertainty
from fifthwheel.vehicle import Vehicle


@dataclass(frozen=True, kw_only=True)
class Estimate:
    """One parameter: mean and standard deviation given logs and prior. Not excited: value and sigma of the prior."""

    name: str
    value: float  # SI
    sigma: float | None  # None if fixed, or if no channel of the logs contains information on it
    unit: str
    initial: float
    verdict: Verdict
    stage: int
    settling_time: float | None = None  # s of data until it stayed within the tolerance; None if it did not
    prior: float | None = None  # prior standard deviation, SI
    correlated_with: tuple[str, ...] = ()  # unknowns from which it is hardly separable, the strongest first


@dataclass(frozen=True, kw_only=True)
class SensorError:
    """Estimated offset, gain or delay of a sensor."""

    name: str
    value: float
    sigma: float
    unit: str
    log: str | None  # None if all logs share it


@dataclass(frozen=True, kw_only=True)
class Fit:
    """One channel of one log and the free-running model: after the initial state no measurement corrects it."""

    log: str
    signal: str
    explained: float  # fraction of variance explained: 1 - variance of the residual / variance of the signal
    rms: float  # of the residual, SI
    time: Array  # (N,)
    measured: Array
    predicted: Array
    identified_on: bool  # False for a log that was only predicted


@dataclass(frozen=True, kw_only=True)
class LogSummary:
    """What was used of a log."""

    name: str
    span: tuple[float, float]  # s
    samples: int
    used: float  # s of data above the minimum speed
    speed: tuple[float, float]  # m/s, lowest and highest in the used segments
    rejected: dict[str, float]  # fraction of the samples of each channel that the gate rejected
    noise: dict[str, float]  # estimated noise variance of each channel, SI squared
    notes: tuple[str, ...]
    bank: tuple[float, float] | None = None  # of the road in the first segment and sigma, rad, left edge higher


@dataclass(frozen=True, kw_only=True)
class Identification:
    """The result of an identification."""

    method: str
    vehicle: Vehicle  # as identified, for the next command
    initial_vehicle: Vehicle
    parameters: tuple[Estimate, ...]
    derived: tuple[Estimate, ...]
    sensors: tuple[SensorError, ...]
    uncertain: tuple[Estimate, ...] = ()  # uncertain parameters of the vehicle file, estimated too or considered
    covariance: Uncertainty | None = None  # of all unknowns; the sensor errors of a log as "name@log"
    doubts: tuple[Doubt, ...] = ()
    """Evidence against an assumption; the estimates that it concerns are `doubtful`."""
    variance_budget: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    """Of each parameter: the fraction of its variance that each considered unknown causes, the largest first."""
    histories: Mapping[str, ParameterHistory]  # "one stage", or "stage 1" and "stage 2" over all rounds
    logs: tuple[LogSummary, ...]
    fits: tuple[Fit, ...]
    settings: CommonSettings
    rounds: int  # of both stages; one stage: steps
    notes: tuple[str, ...]
    version: str

    def __getitem__(self, name: str) -> Estimate:
        """The estimate of a parameter or derived quantity by name; KeyError if there is none."""
        for estimate in (*self.parameters, *self.derived):
            if estimate.name == name:
                return estimate
        raise KeyError(name)

    def observer_settings(self, log: str | None = None, **changes: Any) -> ObserverSettings:
        """Settings for an `Observer` of this vehicle with the estimated sensor errors and noise.

        Args:
            log: its sensor errors and noise; None for the errors that all logs share and the noise of the first.
            changes: further settings.
        """
        return ObserverSettings(**sensor_settings(self.as_dict(), log) | changes)

    def uncertainty(self, log: str | None = None) -> Uncertainty | None:
        """Joint uncertainty of parameters and sensor errors for an `Observer`, with the sensor errors of one log; with
        their priors for None or another log."""
        return None if self.covariance is None else self.covariance.of_log(log or "")

    def as_dict(self) -> dict[str, Any]:
        """The content of identification.json: no histories, no arrays."""
        return {
            "version": self.version,
            "method": self.method,
            "preset": self.settings.preset,
            "vehicle": self.initial_vehicle.name,
            "parameters": [asdict(estimate) for estimate in self.parameters],
            "derived": [asdict(estimate) for estimate in self.derived],
            "uncertain": [asdict(estimate) for estimate in self.uncertain],
            "uncertainty": None if self.covariance is None else self.covariance.as_dict(),
            "doubts": [asdict(doubt) for doubt in self.doubts],
            "variance_budget": {name: dict(terms) for name, terms in self.variance_budget.items()},
            "sensors": [asdict(error) for error in self.sensors],
            "logs": [asdict(log) for log in self.logs],
            "fit": [
                {name: getattr(fit, name) for name in ("log", "signal", "explained", "rms", "identified_on")}
                for fit in self.fits
            ],
            "rounds": self.rounds,
            "notes": list(self.notes),
            "settings": self.settings.as_dict(),
        }

    def to_json(self) -> str:
        """`as_dict` as JSON; a number that is not finite becomes null."""
        return json.dumps(_finite(self.as_dict()), indent=2)

    def save(self, path: Path) -> None:
        """Write identification.json."""
        with atomic_write(path) as temporary:
            temporary.write_text(self.to_json() + "\n", encoding="utf-8")


def sensor_settings(identification: Mapping[str, Any], log: str | None) -> dict[str, Any]:
    """Sensor errors and noise for `ObserverSettings`.

    Args:
        identification: from `Identification.as_dict`.
        log: its sensor errors and noise, besides the errors that all logs share; None or another log for the latter
            only and the noise of the first log.
    """
    sensors = [error for error in identification["sensors"] if not error["name"].startswith(f"{TIME_BASE}.")]
    errors = {error["name"]: error["value"] for error in sensors if error["log"] in (None, log)}
    logs = identification["logs"]
    noise = next((summary["noise"] for summary in logs if summary["name"] == log), logs[0]["noise"])
    return {"sensor_errors": errors, "noise": noise}


def _finite(value: Any) -> Any:
    """Nested data with None for every number that is not finite."""
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
