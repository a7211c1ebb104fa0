"""Cautions: what makes the results of an identification or of a state estimation doubtful, and what to do."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from fifthwheel.base.formatting import approximate, digits, enumerated, percent, with_sigma
from fifthwheel.base.names import PAYLOAD_HEIGHT, ends_with, split_log
from fifthwheel.data.channels import (
    LATERAL_ACCELERATION,
    LOAD_TRANSFER,
    PLACE_KINDS,
    SPEED,
    STEER,
    WHEEL_SPEED_DIFFERENCE,
    SensorErrorName,
    SignalName,
    is_of,
    si_unit,
)
from fifthwheel.data.checks.findings import Fault, Finding, Severity
from fifthwheel.estimate.identify import Estimate, Identification, SensorError, Verdict
from fifthwheel.estimate.identify.doubts import NONLINEAR_ACCELERATION, Doubt, DoubtKind
from fifthwheel.estimate.observe import States
from fifthwheel.results.diagnose import thresholds
from fifthwheel.results.diagnose.caution import Caution, CautionKind
from fifthwheel.results.diagnose.doubt_cautions import (
    assumption_cautions,
    contradiction_cautions,
    unstable_cautions,
    validation_cautions,
)
from fifthwheel.results.diagnose.fit_quality import fit_quality
from fifthwheel.results.diagnose.summaries import RunSummary, innovation_size
from fifthwheel.truck.quantities import FRICTION, quantity_of
from fifthwheel.truck.weighing import unusual_masses

_KINDS = {Fault.TIME_OFFSET: CautionKind.DELAY, Fault.CLOCK_RATE: CautionKind.DELAY, Fault.MASS: CautionKind.MASS}
"""Kinds of cautions by the fault of a signal; others are `CautionKind.SIGNAL`."""


def identification_cautions(
    identification: Identification,
    runs: Sequence[RunSummary] = (),
    states: Sequence[States] = (),
    validated: Sequence[Identification] = (),
) -> list[Caution]:
    """All cautions of an identification; `ranked` puts the causes first.

    Args:
        runs: how the logs were driven.
        states: of the identified truck.
        validated: validation logs, each identified with the knowledge of the identification.
    """
    findings = identification.findings
    if any(doubt.kind is DoubtKind.NOISE for doubt in identification.doubts):  # then no delay explains the logs
        findings = tuple(finding for finding in findings if finding.fault is not Fault.TIME_OFFSET)
    return [
        *signal_cautions(findings),
        *unstable_cautions(identification),
        *contradiction_cautions(identification),
        *validation_cautions(validated),
        *[Caution(CautionKind.MASS, f"{text}.", "", 0.0) for text in unusual_masses(identification.initial_vehicle)],
        *assumption_cautions(identification),
        *estimate_cautions(identification),
        *sensor_cautions(identification),
        *fit_cautions(identification),
        *(run_cautions(runs) if identification.friction is None else ()),
        *[caution for s in states for caution in state_cautions(s, "identified truck")],
    ]


def is_repaired(finding: Finding) -> bool:
    """Whether an identification repairs, tolerates or estimates the fault, so that it is a note and no caution."""
    return finding.severity != "error" and finding.fault in thresholds.REPAIRED


def signal_cautions(findings: Sequence[Finding]) -> Iterator[Caution]:
    """Faults of signals that an estimation does not repair, each once for all logs that have it."""
    groups: dict[tuple[str, str, str], list[Finding]] = {}
    for finding in findings:
        if not is_repaired(finding):
            groups.setdefault((finding.severity, finding.signal, finding.fault), []).append(finding)
    for first, *more in groups.values():
        logs = enumerated([str(finding.log) for finding in (first, *more)])
        yield Caution(
            _KINDS.get(first.fault, CautionKind.SIGNAL),
            f"{logs}: {first.message}.",
            "",
            0.0,
            severity=first.severity,
            signals=(first.signal, *first.others),
            log=first.log if not more else None,
        )


def has_wide_sigma(estimate: Estimate) -> bool:
    """Whether an estimate converged, but to a sigma that is a large fraction of its value."""
    return estimate.verdict is Verdict.CONVERGED and estimate.relative_sigma > thresholds.WIDE_SIGMA


def is_unusual(identification: Identification, error: SensorError) -> bool:
    """Whether a sensor error is far from its prior mean, or a steer gain far from 1."""
    mean, sigma = identification.prior_of_sensor_error(error.name)
    signal, kind = SensorErrorName.of(error.name) or (error.name, "")
    if kind == "gain" and is_of(signal, STEER):
        return abs(error.value - mean) > max(thresholds.UNUSUAL_GAIN, 2 * error.sigma)
    far = abs(error.value - mean) > thresholds.UNUSUAL_DEVIATION * sigma
    return far and (kind != "misalignment" or abs(error.value - mean) > 2 * error.sigma)


def estimate_cautions(identification: Identification) -> Iterator[Caution]:
    """Stiffnesses and inertias much further from the vehicle file than their prior sigma."""
    for e in identification.parameters:
        if e.verdict not in (Verdict.CONVERGED, Verdict.DOUBTFUL) or ends_with(e.name, PAYLOAD_HEIGHT):
            continue
        doubts = [d for d in identification.doubts if d.kind is DoubtKind.ESTIMATE and _concerns(d, e.name)]
        if identification.covariance is not None and not doubts:
            continue
        if e.name == FRICTION:  # roads differ
            continue
        prior = e.prior / abs(e.initial) if e.prior and e.initial else quantity_of(e.name).guess
        ratio = e.value / e.initial
        if ratio > 0 and abs(np.log(ratio)) > thresholds.UNUSUAL_DEVIATION * prior:
            message = (
                f"{e.name} is {digits(ratio, 2)} times the value of the vehicle file; ±{percent(prior)} was assumed."
            )
            cure = "Check masses, axle positions and the steer angle. Confirm the estimate with another log."
            yield Caution(CautionKind.UNUSUAL_ESTIMATE, message, cure, ratio, parameters=(e.name,))


def sensor_cautions(identification: Identification) -> Iterator[Caution]:
    """Sensors with a significant delay or an unusual error."""
    for error in identification.sensors:
        signal, kind = SensorErrorName.of(error.name) or (error.name, "")
        significant = max(thresholds.SIGNIFICANT * error.sigma, thresholds.NEGLIGIBLE_DELAY)
        filtered = is_of(signal, SPEED, LATERAL_ACCELERATION, WHEEL_SPEED_DIFFERENCE)  # always late
        expected = identification.prior_of_sensor_error(error.name)[0]
        delayed = kind == "delay" and not filtered and abs(error.value - expected) > significant
        doubts = [d for d in identification.doubts if d.kind is DoubtKind.SENSOR and _concerns(d, error.name)]
        tested = identification.covariance is not None  # then a doubt says whether it is unusual
        if not doubts and (tested or not (delayed or is_unusual(identification, error))):
            continue
        steer_gain = kind == "gain" and is_of(signal, STEER)
        value = with_sigma(error.value, error.sigma, error.unit)
        if kind == "delay" and filtered:
            text, cure = f"the estimated delay is {value}.", "Check its timestamps, or set its delay in the signal map."
        elif kind in PLACE_KINDS:
            text = f"the estimated {kind} is {value}; {with_sigma(expected, None, error.unit)} is expected."
            cure = f"Check the {kind} of the accelerometer in the vehicle file, and which point the signal belongs to."
        elif kind == "delay":
            text = f"the estimated delay of {value} is unusual. If it is wrong, the stiffness estimates are wrong too."
            cure = (
                "Check the delay. If all channels have a common time base, set the prior sigma of the delay to 5 ms "
                "(--set 'steer.*.delay=+- 5 ms') and identify again."
            )
        elif steer_gain:
            text = (
                f"the road wheels turn by {value} times the logged angle. A wrong steering ratio has the same effect "
                "as wrong tyre stiffnesses, so the stiffness estimates depend on this gain."
            )
            cure = "Measure the ratio of the road-wheel angle to the logged angle, and correct it in the signal map."
        elif kind == "play":
            text = f"the estimated play between this angle and the road wheels is {value}."
            cure = "Check the steering linkage, or measure the angle at the wheels."
        elif kind == "misalignment":
            text = f"the estimated misalignment is {value}: the gyro also measures another axis."
            cure = "Check how the gyro is mounted, and whether its axes are exchanged."
        elif kind == "load_sensitivity":
            text = f"the estimated load sensitivity is {value}: wheel speeds change with the load transfer."
            cure = "Check that both wheel speeds are of the same axle, and the tyre pressures."
        elif kind == "gain":
            text = f"the estimated gain is {value}; 1 is expected."
            cure = "Check the unit, calibrate the sensor, and correct its gain in the signal map."
        else:
            text = f"the estimated {kind.replace('_', ' ')} is {value}, more than such a sensor usually has."
            cure = "Check the mounting and the calibration of the sensor."
        message = f"{signal} in {error.log}: {text}" if error.log else f"{signal}: {text}"
        parameters = tuple(dict.fromkeys(name for doubt in doubts for name in doubt.parameters))
        of = CautionKind(kind) if kind in list(CautionKind) else CautionKind.OFFSET
        yield Caution(of, message, cure, error.value, parameters=parameters, signals=(signal,), log=error.log)


def _concerns(doubt: Doubt, name: str) -> bool:
    """Whether an unknown is a cause of a doubt, in any log."""
    return any(split_log(cause.name)[0] == name for cause in doubt.causes)


def fit_cautions(identification: Identification) -> Iterator[Caution]:
    """Channels that the identified truck predicts poorly, and channels with many rejected samples."""
    excited = {fit.log for fit in identification.fits if fit.explained > thresholds.EXCITED_CHANNEL}
    for fit in identification.fits:
        quality, unit = fit_quality(fit, identification.settings.stated_noise), si_unit(fit.signal)
        place = f"{fit.signal} in {fit.log}" if fit.identified_on else f"{fit.signal}, validation log {fit.log}"
        severity: Severity = "warning"
        if fit.log in excited and quality.unrelated:
            kind, severity = CautionKind.UNRELATED_CHANNEL, "error"
            text = "speed and steer angle explain almost none of this channel."
            cure = "Check that the column is mapped to the right signal. Do not use results that depend on it."
        elif not quality.good:
            kind, explained = CautionKind.POOR_FIT, percent(max(fit.explained, 0.0), round_down=True)
            noise = f", sensor noise about {approximate(quality.noise, unit)}" if np.isfinite(quality.noise) else ""
            text = f"the model explains {explained} of the variance; residual {approximate(fit.rms, unit)} rms{noise}."
            cure = "Check sign, unit and position of the sensor, and the vehicle file."
        else:
            continue
        message = f"{place}: {text}"
        yield Caution(kind, message, cure, fit.explained, severity=severity, signals=(fit.signal,), log=fit.log)
    for log in identification.logs:
        yield from _rejected_samples(log.name, log.rejected, thresholds.REJECTED_SAMPLES, "identification")


def run_cautions(runs: Sequence[RunSummary]) -> Iterator[Caution]:
    """Runs outside the range of the linear model."""
    for run in runs:
        if run.acceleration > NONLINEAR_ACCELERATION:
            message = (
                f"{run.name}: the lateral acceleration reaches {run.acceleration:.1f} m/s². The model of tyres and "
                f"suspensions is linear, which holds up to about {NONLINEAR_ACCELERATION:g} m/s²."
            )
            cure = "Use tyres that saturate (--tyres saturating), or a log with a smaller lateral acceleration."
            yield Caution(CautionKind.NONLINEAR_RANGE, message, cure, run.acceleration, log=run.name)


def state_cautions(states: States, blamed: str) -> Iterator[Caution]:
    """Wheels that lift, and innovations that do not fit the filter's expectation, as they do after a lift.

    Args:
        blamed: what may be wrong besides the noise: "vehicle file" or "identified vehicle".
    """
    yield from _wheel_lifts(states)
    sizes = {name: innovation_size(states, name) for name in states.innovation}
    large = {name: size.rms for name, size in sizes.items() if size.rms > thresholds.LARGE_INNOVATION}
    if large:
        channels = enumerated([f"{name} ({rms:.1f})" for name, rms in large.items()])
        cure = "Check the vehicle file against this truck, and the noise of these channels."
        if blamed == "vehicle file":
            cure = (
                f"Check the vehicle file, or identify this truck from {states.name}. If the vehicle file comes from an "
                "identification, also give its identification.json (-i); it contains the sensor errors."
            )
        message = (
            f"{states.name}: the rms of the normalised innovations is above 1: {channels}. The {blamed} or the assumed "
            "noise is wrong, and the sigma of the states may be too small."
        )
        value = max(large.values())
        yield Caution(CautionKind.LARGE_INNOVATIONS, message, cure, value, signals=tuple(large), log=states.name)
    rejected = {name: size.rejected for name, size in sizes.items()}
    yield from _rejected_samples(states.name, rejected, thresholds.REJECTED_INNOVATIONS, "state filter")


def _wheel_lifts(states: States) -> Iterator[Caution]:
    ratios = {n: np.abs(v) for n, v in states.values.items() if is_of(n, LOAD_TRANSFER)}
    lifted = {name: ratio >= thresholds.LIFTED for name, ratio in ratios.items()}
    starts = {name: float(states.time[rows.argmax()]) for name, rows in lifted.items() if rows.any()}
    if starts:
        first = min(starts, key=starts.__getitem__)
        largest = float(np.nanmax(ratios[first]))
        message = (
            f"{states.name}: a wheel of {SignalName.of(first).place} lifts at {starts[first]:.1f} s, where the load "
            f"transfer ratio exceeds {thresholds.LIFTED}; it reaches {largest:.2f}. In the model no wheel lifts."
        )
        cure = "Do not rely on what follows: end the log there, with stop in [time] of signals.toml."
        yield Caution(CautionKind.WHEEL_LIFT, message, cure, largest, log=states.name)


def _rejected_samples(log: str, rejected: Mapping[str, float], limit: float, stage: str) -> Iterator[Caution]:
    """Channels of a log of which a larger fraction than the limit was rejected."""
    for signal, fraction in rejected.items():
        if fraction > limit:
            message = (
                f"{signal} in {log}: the {stage} rejected {percent(fraction)} of the samples as outliers, because "
                "their innovation is larger than the gate."
            )
            cure = "Check the channel for spikes; if it has none, the vehicle file or the identified vehicle is wrong."
            yield Caution(CautionKind.REJECTED_SAMPLES, message, cure, fraction, signals=(signal,), log=log)
