"""Cautions: what makes the results of an identification or of a state estimation doubtful, and what to do."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from fifthwheel.base.formatting import approximate, digits, enumerated, percent, with_sigma
from fifthwheel.base.names import PAYLOAD_HEIGHT, ends_with, split_log
from fifthwheel.data.channels import (
    LOAD_TRANSFER,
    STEER,
    SensorErrorName,
    SignalName,
    is_of,
    si_unit,
)
from fifthwheel.data.checks.findings import Fault, Finding
from fifthwheel.estimate.identify import Estimate, Identification, SensorError, Verdict
from fifthwheel.estimate.identify.doubts import NONLINEAR_ACCELERATION, UNUSUAL_ESTIMATE, Doubt, DoubtKind
from fifthwheel.estimate.observe import States
from fifthwheel.results.diagnose import messages, thresholds
from fifthwheel.results.diagnose.doubt_cautions import (
    assumption_cautions,
    contradiction_cautions,
    unstable_cautions,
    validation_cautions,
)
from fifthwheel.results.diagnose.messages import Caution, CautionKind, CautionText, is_filtered, sensor_error_words
from fifthwheel.results.diagnose.residuals import fit_quality
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
        *[messages.UNUSUAL_MASSES.of(masses=text) for text in unusual_masses(identification.initial_vehicle)],
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
        row = CautionText(_KINDS.get(first.fault, CautionKind.SIGNAL), "{logs}: {fault}.", severity=first.severity)
        yield row.of(
            log=first.log if not more else None,
            signals=(first.signal, *first.others),
            logs=enumerated([str(finding.log) for finding in (first, *more)]),
            fault=first.message,
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
    far = abs(error.value - mean) > thresholds.UNUSUAL_ERROR * sigma
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
        if ratio > 0 and abs(np.log(ratio)) > UNUSUAL_ESTIMATE * prior:
            yield messages.UNUSUAL_ESTIMATE.of(
                ratio, parameters=(e.name,), parameter=e.name, ratio=digits(ratio, 2), prior=percent(prior)
            )


def sensor_cautions(identification: Identification) -> Iterator[Caution]:
    """Sensors with a significant delay or an unusual error."""
    for error in identification.sensors:
        signal, kind = SensorErrorName.of(error.name) or (error.name, "")
        significant = max(thresholds.SIGNIFICANT * error.sigma, thresholds.NEGLIGIBLE_DELAY)
        expected = identification.prior_of_sensor_error(error.name)[0]
        delayed = kind == "delay" and not is_filtered(signal) and abs(error.value - expected) > significant
        doubts = [d for d in identification.doubts if d.kind is DoubtKind.SENSOR and _concerns(d, error.name)]
        tested = identification.covariance is not None  # then a doubt says whether it is unusual
        if not doubts and (tested or not (delayed or is_unusual(identification, error))):
            continue
        words = sensor_error_words(signal, kind)
        of = CautionKind(kind) if kind in list(CautionKind) else CautionKind.OFFSET
        yield CautionText(of, f"{{place}}: {words.caution}", words.cure).of(
            error.value,
            log=error.log,
            place=f"{signal} in {error.log}" if error.log else signal,
            parameters=tuple(dict.fromkeys(name for doubt in doubts for name in doubt.parameters)),
            signals=(signal,),
            kind=kind.replace("_", " "),
            value=with_sigma(error.value, error.sigma, error.unit),
            expected=with_sigma(expected, None, error.unit),
        )


def _concerns(doubt: Doubt, name: str) -> bool:
    """Whether an unknown is a cause of a doubt, in any log."""
    return any(split_log(cause.name)[0] == name for cause in doubt.causes)


def fit_cautions(identification: Identification) -> Iterator[Caution]:
    """Channels that the identified truck predicts poorly, and channels with many rejected samples."""
    excited = {fit.log for fit in identification.fits if fit.explained > thresholds.EXCITED_CHANNEL}
    for fit in identification.fits:
        quality, unit = fit_quality(fit, identification.settings.stated_noise), si_unit(fit.signal)
        if fit.log in excited and quality.unrelated:
            row = messages.UNRELATED_CHANNEL
        elif not quality.good:
            row = messages.POOR_FIT
        else:
            continue
        yield row.of(
            fit.explained,
            log=fit.log,
            signals=(fit.signal,),
            place=f"{fit.signal} in {fit.log}" if fit.identified_on else f"{fit.signal}, validation log {fit.log}",
            explained=percent(max(fit.explained, 0.0), round_down=True),
            rms=approximate(fit.rms, unit),
            noise=f", sensor noise about {approximate(quality.noise, unit)}" if np.isfinite(quality.noise) else "",
        )
    for log in identification.logs:
        yield from _rejected_samples(log.name, log.rejected, thresholds.REJECTED_SAMPLES, "identification")


def run_cautions(runs: Sequence[RunSummary]) -> Iterator[Caution]:
    """Runs outside the range of the linear model."""
    for run in runs:
        if run.acceleration > NONLINEAR_ACCELERATION:
            yield messages.NONLINEAR_RANGE.of(
                run.acceleration, log=run.name, acceleration=run.acceleration, limit=NONLINEAR_ACCELERATION
            )


def state_cautions(states: States, blamed: str) -> Iterator[Caution]:
    """Wheels that lift, and innovations that do not fit the filter's expectation, as they do after a lift.

    Args:
        blamed: what may be wrong besides the noise: "vehicle file" or "identified vehicle".
    """
    yield from _wheel_lifts(states)
    sizes = {name: innovation_size(states, name) for name in states.innovation}
    large = {name: size.rms for name, size in sizes.items() if size.rms > thresholds.LARGE_INNOVATION}
    if large:
        is_file = blamed == "vehicle file"
        row = messages.LARGE_INNOVATIONS_OF_A_FILE if is_file else messages.LARGE_INNOVATIONS
        channels = enumerated([f"{name} ({rms:.1f})" for name, rms in large.items()])
        yield row.of(max(large.values()), log=states.name, signals=tuple(large), channels=channels, blamed=blamed)
    rejected = {name: size.rejected for name, size in sizes.items()}
    yield from _rejected_samples(states.name, rejected, thresholds.REJECTED_INNOVATIONS, "state filter")


def _wheel_lifts(states: States) -> Iterator[Caution]:
    ratios = {n: np.abs(v) for n, v in states.values.items() if is_of(n, LOAD_TRANSFER)}
    lifted = {name: ratio >= thresholds.LIFTED for name, ratio in ratios.items()}
    starts = {name: float(states.time[rows.argmax()]) for name, rows in lifted.items() if rows.any()}
    if starts:
        first = min(starts, key=starts.__getitem__)
        largest, group = float(np.nanmax(ratios[first])), SignalName.of(first).place
        yield messages.WHEEL_LIFT.of(
            largest, log=states.name, group=group, time=starts[first], limit=thresholds.LIFTED, largest=largest
        )


def _rejected_samples(log: str, rejected: Mapping[str, float], limit: float, stage: str) -> Iterator[Caution]:
    """Channels of a log of which a larger fraction than the limit was rejected."""
    for signal, fraction in rejected.items():
        if fraction > limit:
            yield messages.REJECTED_SAMPLES.of(
                fraction, log=log, signals=(signal,), signal=signal, stage=stage, fraction=percent(fraction)
            )
