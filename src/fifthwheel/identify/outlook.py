"""Before any fit: what logs can tell about a truck, what they cannot, why, and what would help.

logs, vehicle -> plausibility of the logs (logs/plausibility.py)
              -> information at the vehicle file's values (forecast.py), verdicts
              -> the sigma that a change would bring (remedies.py)
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

import fifthwheel
from fifthwheel import dynamics
from fifthwheel.errors import SignalError
from fifthwheel.identify.drives import Drives
from fifthwheel.identify.forecast import Forecast, Foreseen
from fifthwheel.identify.information import Verdict
from fifthwheel.identify.remedies import Remedies, Remedy, lane_change
from fifthwheel.identify.settings import OneStage
from fifthwheel.identify.stage import Log
from fifthwheel.logs import Finding, Record, check
from fifthwheel.logs.scatter import scatter
from fifthwheel.observe import noise as variances
from fifthwheel.vehicle import Vehicle, unit_of


@dataclass(frozen=True, kw_only=True)
class Looking:
    """What an outlook dwells on."""

    enough: float = 0.05
    """A parameter that is told to this part of its value needs no help."""
    worth: float = 0.2
    """A change is worth mention when it brings a sigma down by this part."""
    most: int = 2
    """At most so many changes for each parameter, of different kinds."""
    least_speed: float = 15.0
    """m/s; a lane change to be added is driven at the logs' median speed, but not below this."""


@dataclass(frozen=True, kw_only=True)
class Prospect:
    """One parameter before the fit; all sigmas are standard deviations in SI."""

    name: str
    value: float  # the vehicle file's
    unit: str
    prior: float  # sigma that it is given beforehand
    sigma: float  # that the fit would end with: the prior's where the logs do not tell it
    alone: float  # if all other parameters were known, but not the sensors' errors
    verdict: Verdict  # CONVERGED: can be told
    confused_with: tuple[str, ...]
    remedies: tuple[Remedy, ...]


@dataclass(frozen=True, kw_only=True)
class Outlook:
    """What logs can tell, reckoned at the vehicle file's values."""

    vehicle: str
    logs: tuple[str, ...]
    speed: float  # m/s at which a lane change would be added
    findings: tuple[tuple[str, Finding], ...]  # log and what is wrong with it, errors first
    parameters: tuple[Prospect, ...]
    noise: Mapping[str, Mapping[str, float]]  # by log and channel: variance that was reckoned with, SI squared
    cautions: tuple[str, ...]  # why the outlook itself may be off
    notes: tuple[str, ...]
    version: str

    def __getitem__(self, name: str) -> Prospect:
        """The prospect of a parameter by name; KeyError if it is not sought."""
        for prospect in self.parameters:
            if prospect.name == name:
                return prospect
        raise KeyError(name)

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        findings = [
            {"log": log, "signal": f.signal, "fault": f.fault.value, "severity": f.severity, "message": f.message}
            for log, f in self.findings
        ]
        own = {name: getattr(self, name) for name in ("version", "vehicle", "logs", "speed")}
        parameters = [asdict(prospect) for prospect in self.parameters]
        return own | {
            "findings": findings,
            "parameters": parameters,
            "noise": {log: dict(noise) for log, noise in self.noise.items()},
            "cautions": self.cautions,
            "notes": self.notes,
        }

    def to_json(self) -> str:
        """`as_dict` as JSON."""
        return json.dumps(self.as_dict(), indent=2)


def outlook(
    records: Sequence[Record], vehicle: Vehicle, settings: OneStage | None = None, looking: Looking | None = None
) -> Outlook:
    """What logs can tell about a truck, before any fit, and what would help.

    The Cramer-Rao bound with the priors at the vehicle file's values, so the better the file, the better the outlook.
    It takes the model and the logs for right: what either errs comes on top, and it sees nothing of what is wrong with
    a log but what `findings` says. Each channel's noise is its own spectral density between 3 and 10 Hz
    (`logs.scatter`), but not below a tenth of the article's variance; the article's where the log is too short to tell,
    and where `settings` say that the noise is known.

    Args:
        records: the logs that would be fitted together.
        vehicle: what is known of the truck.
        settings: of the fit; it is reckoned in the output-error form, and payload heights at the file's value.
        looking: what the outlook dwells on.

    Raises:
        SignalError: a log that no fit could use, with all that is wrong with the logs.
        VehicleError: a parameter that cannot be sought or held; a truck that runs away at the logs' speeds.
    """
    settings, looking = settings or OneStage(), looking or Looking()
    findings = [(r.name, finding) for r in records for finding in check(r, wheelbase=vehicle.wheelbase)]
    findings.sort(key=lambda found: found[1].severity)
    try:
        drives = Drives(records, vehicle, replace(settings, check=False))
    except SignalError as error:
        raise SignalError("\n".join(dict.fromkeys([*[f.message for _, f in findings], str(error)]))) from error
    speeds = np.concatenate([section.input("speed") for log in drives.logs for section in log.sections])
    speed = max(float(np.median(speeds)), looking.least_speed)
    forecast = Forecast(drives.vehicle, settings, [float(speeds.min()), float(speeds.max()), speed])
    for log in drives.logs:
        log.noise |= _noise(forecast, log)
    told = [forecast.drive(log) for log in drives.logs]
    common = {name: variance for log in drives.logs for name, variance in log.noise.items()}
    rate = drives.logs[0].sections[0].rate
    extra = lane_change(forecast, speed=speed, rate=rate, channels=tuple(common), noise=common)
    names = tuple(record.name for record in records)
    now, remedies = forecast.fit(told), Remedies(forecast, told, extra)
    known = {f"{log}: {finding.message}" for log, finding in findings}
    notes = [note for note in drives.notes if note not in known]
    return Outlook(
        vehicle=vehicle.name,
        logs=names,
        speed=speed,
        findings=tuple(findings),
        parameters=tuple(_prospect(forecast, name, now, remedies, looking, names) for name in forecast.sought),
        noise={
            log.name: {name: log.noise[name] for name in forecast.channels if name in log.noise} for log in drives.logs
        },
        cautions=(_unstable(forecast),) if forecast.start else (),
        notes=tuple(dict.fromkeys(notes)),
        version=fifthwheel.__version__,
    )


def _prospect(
    forecast: Forecast, name: str, now: Foreseen, remedies: Remedies, looking: Looking, logs: Sequence[str]
) -> Prospect:
    value, prior = forecast.vehicle.parameters()[name], forecast.prior(name)
    sigma, enough = now.sigma(name) * prior, looking.enough * abs(value)
    poor = name in now.idle or sigma > enough
    best = remedies.best(name, sigma, enough=enough, worth=looking.worth, most=looking.most) if poor else ()
    return Prospect(
        name=name,
        value=value,
        unit=unit_of(name),
        prior=prior,
        sigma=sigma,
        alone=now.alone(name) * prior,
        verdict=now.idle.get(name, Verdict.CONVERGED),
        confused_with=tuple(_of_log(other, logs) for other in now.confused(name)),
        remedies=best,
    )


def _of_log(name: str, logs: Sequence[str]) -> str:
    """An unknown's name, with the log that it belongs to in the place of the log's number."""
    base, at, number = name.partition("@")
    return f"{base}@{logs[int(number.partition('.')[0])]}" if at else base


def _noise(forecast: Forecast, log: Log) -> dict[str, float]:
    """Variance of each channel that a log holds."""
    found = {}
    for name in forecast.channels:
        there = [s for s in log.sections if name in s.signals and np.isfinite(s.signals[name]).any()]
        if not there:
            continue
        if not forecast.settings.adapt_noise:
            found[name] = variances.sensor(forecast.vehicle, name, forecast.settings.noise)
            continue
        table = variances.sensor(forecast.vehicle, name, {})
        seen = [scatter(section.time, section.signals[name]) for section in there]
        weights = [len(section) for section, one in zip(there, seen, strict=True) if one is not None]
        told = np.average([one for one in seen if one is not None], weights=weights) if weights else table
        found[name] = max(float(told), table / 10)
    return found


def _unstable(forecast: Forecast) -> str:
    first, *_ = forecast.start
    axles = " and ".join(name.removesuffix(".cornering_stiffness") for name in forecast.start)
    times = forecast.steadied.parameters()[first] / forecast.vehicle.parameters()[first]
    from_speed = dynamics.critical_speed(forecast.vehicle) or float("nan")
    return (
        f"{forecast.vehicle.name}: by its file unstable from {3.6 * from_speed:.0f} km/h on; check the file. This is "
        f"the outlook with {axles} {times:.2g} times as stiff, from where a fit would start."
    )
