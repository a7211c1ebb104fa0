"""What an identification found: values, sigmas, verdicts, and all that is needed to believe or repeat them."""

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fifthwheel.identify.information import Verdict
from fifthwheel.identify.settings import Common
from fifthwheel.identify.stage import Trace
from fifthwheel.observe import ObserverSettings
from fifthwheel.observe.uncertainty import Uncertainty
from fifthwheel.vehicle import Vehicle
from fifthwheel.whole import whole

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Estimate:
    """One parameter: mean and standard deviation given the logs and the prior; the prior's where not excited."""

    name: str
    value: float
    sigma: float | None  # None for one that was held, or that no channel of the logs could tell
    unit: str
    initial: float
    verdict: Verdict
    stage: int
    settled: float | None = None  # s of driving until it stayed within the tolerance, None if it never did
    prior: float | None = None  # standard deviation that it was given beforehand, SI
    confused_with: tuple[str, ...] = ()  # what it can hardly be told apart from, the worst first


@dataclass(frozen=True, kw_only=True)
class SensorError:
    """A zero, gain or delay of a sensor, estimated beside the parameters."""

    name: str
    value: float
    sigma: float
    unit: str
    log: str | None  # None where all logs share it


@dataclass(frozen=True, kw_only=True)
class Fit:
    """One channel of one log against the free-running model: no measurement corrects it after its start."""

    log: str
    signal: str
    explained: float  # 1 - variance of the residual / variance of the signal
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
    used: float  # s of driving fast enough
    speed: tuple[float, float]  # m/s, lowest and highest of what was used
    rejected: dict[str, float]  # part of each channel's samples outside the gate
    noise: dict[str, float]  # variance of each channel's noise as found, SI squared
    notes: tuple[str, ...]
    bank: tuple[float, float] | None = None  # of the road in its first stretch, rad, left edge higher, and sigma


@dataclass(frozen=True, kw_only=True)
class Identification:
    """The result of an identification."""

    method: str
    vehicle: Vehicle  # as identified, ready for the next command
    initial_vehicle: Vehicle
    parameters: tuple[Estimate, ...]
    derived: tuple[Estimate, ...]
    sensors: tuple[SensorError, ...]
    rough: tuple[Estimate, ...] = ()  # what was known roughly and estimated beside, or only considered
    covariance: Uncertainty | None = None  # of all that was estimated; a log's own sensor errors as "name@log"
    traces: Mapping[str, Trace]  # "stage 1", "stage 2": all rounds, one behind the other
    logs: tuple[LogSummary, ...]
    fits: tuple[Fit, ...]
    settings: Common
    rounds: int
    notes: tuple[str, ...]
    version: str

    def __getitem__(self, name: str) -> Estimate:
        """The estimate of a parameter or derived quantity by name; KeyError if there is none."""
        for estimate in (*self.parameters, *self.derived):
            if estimate.name == name:
                return estimate
        raise KeyError(name)

    def observer_settings(self, log: str | None = None, **changes: Any) -> ObserverSettings:
        """Settings for an `Observer` of this truck: the sensors' zeros and noise as found, a log's own if named."""
        return ObserverSettings(**sensors_told(self.as_dict(), log) | changes)

    def uncertainty(self, log: str | None = None) -> Uncertainty | None:
        """What the truck and the sensors are uncertain by, for an `Observer`: a log's own sensor errors if named."""
        return None if self.covariance is None else self.covariance.of_log(log or "")

    def as_dict(self) -> dict[str, Any]:
        """What identification.json holds: no histories, no arrays."""
        return {
            "version": self.version,
            "method": self.method,
            "preset": self.settings.preset,
            "vehicle": self.initial_vehicle.name,
            "parameters": [asdict(estimate) for estimate in self.parameters],
            "derived": [asdict(estimate) for estimate in self.derived],
            "rough": [asdict(estimate) for estimate in self.rough],
            "uncertainty": None if self.covariance is None else self.covariance.as_dict(),
            "sensors": [asdict(error) for error in self.sensors],
            "logs": [asdict(log) for log in self.logs],
            "fit": [
                {
                    "log": f.log,
                    "signal": f.signal,
                    "explained": f.explained,
                    "rms": f.rms,
                    "identified_on": f.identified_on,
                }
                for f in self.fits
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
        with whole(path) as part:
            part.write_text(self.to_json() + "\n", encoding="utf-8")


def sensors_told(told: Mapping[str, Any], log: str | None) -> dict[str, Any]:
    """Zeros and noise for `ObserverSettings` from `Identification.as_dict`: all logs', and those of one if named."""
    zeros = {error["name"]: error["value"] for error in told["sensors"] if error["log"] in (None, log)}
    noise = next((one["noise"] for one in told["logs"] if one["name"] == log), told["logs"][0]["noise"])
    return {"zeros": zeros, "noise": noise}


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
