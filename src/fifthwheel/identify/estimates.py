"""From what the filter and the information say to estimates with a verdict."""

from collections.abc import Collection, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fifthwheel.identify.information import Verdict
from fifthwheel.identify.parameters import Unknown, scaling, stage_1_names, stage_2_names
from fifthwheel.identify.result import Estimate, Fit, LogSummary, SensorError
from fifthwheel.identify.settings import Common, TwoStage
from fifthwheel.identify.stage import Log, Trace
from fifthwheel.logs import Record
from fifthwheel.observe import noise as variances
from fifthwheel.observe.uncertainty import Uncertainty
from fifthwheel.vehicle import Vehicle, unit_of

Array = NDArray[np.float64]

SETTLED_PART = 0.1
"""How much of a trace must lie within the tolerance, at its end, to speak of an average."""


def settled_since(values: Array, tolerance: float) -> int:
    """First sample from which all values (N,) stay within `tolerance` of their own average (the article's 2.2.3)."""
    backwards = values[::-1]
    count = np.arange(1, len(values) + 1)
    mean = np.cumsum(backwards) / count
    spread = np.maximum(np.maximum.accumulate(backwards) - mean, mean - np.minimum.accumulate(backwards))
    return len(values) - 1 - int(np.flatnonzero(spread <= tolerance * np.abs(mean)).max())


def of_parameters(
    vehicle: Vehicle,
    sought: Sequence[Unknown],
    values: Mapping[str, float],
    sigma_z: Mapping[str, float],
    settled: Mapping[str, bool],
    idle: Collection[str],
    traces: Mapping[str, Trace],
    settings: TwoStage,
) -> list[Estimate]:
    """An estimate for every parameter that the stages seek or that was held."""
    unknowns = {u.name: u for u in sought}
    first, given = stage_1_names(vehicle), vehicle.parameters()
    found = []
    for name in (*first, *stage_2_names(vehicle)):
        stage = 1 if name in first else 2
        common: Any = {"name": name, "unit": unit_of(name), "stage": stage}
        if name not in unknowns:
            held = name in settings.held
            verdict = Verdict.HELD if held else Verdict.NOT_EXCITED
            found.append(Estimate(value=given[name], sigma=None, initial=given[name], verdict=verdict, **common))
            continue
        unknown, value, spread = unknowns[name], values[name], sigma_z[name]
        if name in idle:
            value, spread = given[name], 1.0
        sigma = spread * float(np.abs(scaling([unknown]).slope(np.array([value])))[0])
        known = settled.get(name, False) and spread < 1  # a sigma wider than the prior's is no finding
        verdict = Verdict.NOT_EXCITED if name in idle else _verdict(unknown, value, sigma, known)
        found.append(
            Estimate(
                value=value,
                sigma=sigma,
                initial=given[name] if name in idle else unknown.centre,
                verdict=verdict,
                settled=_settled_at(traces, name, settings),
                prior=unknown.scale * (unknown.centre if unknown.logarithmic else 1.0),
                **common,
            )
        )
    return found


def unexplained(fit: Fit, vehicle: Vehicle, settings: Common) -> bool:
    """Whether a channel that is well above its sensor's noise is explained by less than half.

    A roll rate must be further above, as roads roll a truck that drives straight.
    """
    noise = variances.sensor(vehicle, fit.signal, settings.noise)
    above = float(np.nanvar(fit.measured)) / noise
    if fit.signal.startswith("roll"):
        return not fit.explained > 0.5 and above > 20
    return above > 4 and not fit.explained > 0.5 * (1 - 1 / above)


def _verdict(unknown: Unknown, value: float, sigma: float, settled: bool) -> Verdict:
    """At a bound means closer to it than a tenth of sigma: the prior keeps an estimate from lying on it exactly."""
    if min(value - unknown.lower, unknown.upper - value) < 0.1 * sigma:
        return Verdict.AT_BOUND
    return Verdict.CONVERGED if settled else Verdict.NOT_CONVERGED


def _settled_at(traces: Mapping[str, Trace], name: str, settings: TwoStage) -> float | None:
    """Seconds of driving until the parameter stayed within the tolerance.

    Passes that restart are estimates of their own: the last one counts. Passes that carry on are one long run.
    """
    for trace in traces.values():
        if name in trace.names:
            begin = trace.starts[-1] if settings.restart else 0
            values = trace.values[begin:, trace.names.index(name)]
            since = settled_since(values, settings.tolerance)
            late = since > (1 - SETTLED_PART) * len(values)
            return None if late else float(trace.time[begin + since] - trace.time[begin])
    return None


def derived(vehicle: Vehicle, parameters: Sequence[Estimate]) -> list[Estimate]:
    """Laden CoG height and roll inertia (8), (9) of every unit with a payload, with sigma by their derivatives."""
    found = []
    by_name = {e.name: e for e in parameters}
    for unit in vehicle.units:
        height = by_name.get(f"{unit.name}.payload.height")
        if height is None:
            continue
        step = 1e-4
        higher = vehicle.replace({height.name: height.value + step}).derived()
        started = vehicle.replace({height.name: height.initial}).derived()
        for word, si in (("cog_height", "m"), ("roll_inertia", "kg m^2")):
            name = f"{unit.name}.{word}"
            value = vehicle.derived()[name]
            slope = (higher[name] - value) / step
            found.append(
                Estimate(
                    name=name,
                    value=value,
                    sigma=None if height.sigma is None else abs(slope) * height.sigma,
                    unit=si,
                    initial=started[name],
                    verdict=height.verdict,
                    stage=2,
                    settled=height.settled,
                )
            )
    return found


def derived_together(
    before: Vehicle, vehicle: Vehicle, parameters: Sequence[Estimate], covariance: Uncertainty
) -> list[Estimate]:
    """CoG height and roll inertia (8), (9) of every unit of which something was sought, with the sigma of all that they
    depend on and that was estimated."""
    words = (".payload.height", ".sprung.cog_height", ".sprung.roll_inertia")
    found, values = [], vehicle.parameters()
    # central differences of a closed form, for all that it depends on
    slopes: dict[str, dict[str, float]] = {}
    for name in covariance.names:
        if name in values and values[name] > 0:
            step = 1e-4 * values[name]
            up, down = (vehicle.replace({name: values[name] + s}).derived() for s in (step, -step))
            slopes[name] = {key: (up[key] - down[key]) / (2 * step) for key in up}
    for unit in vehicle.units:
        sought = [
            e
            for e in parameters
            if e.name.startswith(f"{unit.name}.") and e.name.endswith(words) and e.name in covariance.names
        ]
        if not sought:
            continue
        for word, si in (("cog_height", "m"), ("roll_inertia", "kg m^2")):
            name = f"{unit.name}.{word}"
            row = np.array([slopes[n][name] if n in slopes else 0.0 for n in covariance.names])
            owing = [e for e in sought if row[covariance.names.index(e.name)]] if row.any() else []
            worst = max(owing, key=lambda e: e.verdict != Verdict.CONVERGED, default=None)
            found.append(
                Estimate(
                    name=name,
                    value=vehicle.derived()[name],
                    sigma=float(np.sqrt(row @ covariance.covariance @ row)) if row.any() else None,
                    unit=si,
                    initial=before.derived()[name],
                    verdict=worst.verdict if worst else Verdict.HELD,
                    stage=2,
                )
            )
    return found


def of_sensors(
    unknowns: Sequence[Unknown], logs: Sequence[Log], shared: Mapping[str, float], sigma_z: Mapping[str, float]
) -> list[SensorError]:
    """The nuisances: those of the truck, then those of each log."""
    found = []
    for u in unknowns:
        if not u.nuisance:
            continue
        places = [(log.name, log.errors.get(u.name, u.centre), f"{u.name}@{i}") for i, log in enumerate(logs)]
        for log, value, key in places if u.each_log else [(None, shared[u.name], u.name)]:
            found.append(
                SensorError(name=u.name, value=value, sigma=sigma_z[key] * u.scale, unit=unit_of_error(u.name), log=log)
            )
    return found


def unit_of_error(name: str) -> str:
    signal, _, word = name.rpartition(".")
    if word == "delay":
        return "s"
    if word == "gain":
        return "1"
    return "rad/s" if "rate" in signal else "rad"


def summary(record: Record, log: Log, outputs: Sequence[str], accepted: Array) -> LogSummary:
    """What was used of a record."""
    speed = np.concatenate([section.input("speed") for section in log.sections])
    seen = np.concatenate(
        [
            np.column_stack([np.isfinite(s.signals.get(name, np.full(len(s), np.nan))) for name in outputs])
            for s in log.sections
        ]
    )
    rejected = 1 - accepted.sum(axis=0) / np.maximum(seen.sum(axis=0), 1)
    return LogSummary(
        name=record.name,
        span=record.span,
        samples=len(record),
        used=sum(s.span[1] - s.span[0] for s in log.sections),
        speed=(float(speed.min()), float(speed.max())),
        rejected={name: float(part) for name, part in zip(outputs, rejected, strict=True) if name in record.signals},
        noise={name: log.noise[name] for name in outputs if name in record.signals},
        notes=record.notes,
    )
