"""Cautions: what makes the results of an identification or of a state estimation doubtful, and what to do."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from fifthwheel.channels import (
    LATERAL_ACCELERATION,
    LOAD_TRANSFER,
    PLACE_KINDS,
    STEER,
    SensorErrorName,
    SignalName,
    is_of,
    is_sensor_error,
    si_unit,
)
from fifthwheel.checks.findings import Severity
from fifthwheel.diagnose import thresholds
from fifthwheel.diagnose.fit_quality import fit_quality
from fifthwheel.diagnose.summaries import RunSummary, innovation_size
from fifthwheel.dynamics import TIME_SCALE
from fifthwheel.formatting import approximate, digits, enumerated, percent, with_sigma
from fifthwheel.identify import Estimate, Identification, SensorError, Verdict
from fifthwheel.identify.doubts import NONLINEAR_ACCELERATION, Cause, DoubtKind
from fifthwheel.identify.knowledge.history import changes_in_words
from fifthwheel.identify.knowledge.knowledge import NOT_CONVERGED
from fifthwheel.identify.unknowns.parameters import prior_of_sensor_error
from fifthwheel.names import ParameterPath, split_log
from fifthwheel.observe import States
from fifthwheel.vehicle import Vehicle, unit_of
from fifthwheel.vehicle.parameters import FRICTION, POSITIONS
from fifthwheel.vehicle.uncertainty import MASS_SCALE


class CautionKind(StrEnum):
    """Kinds of cautions."""

    CONTRADICTION = "contradiction"  # a log differs from earlier ones
    ASSUMPTION = "assumption"  # the residuals contradict a number of the vehicle file or of a sensor
    UNUSUAL_ESTIMATE = "unusual estimate"  # a stiffness or an inertia far from its prior mean
    DELAY = "delay"  # a significant or unusual delay of a sensor
    GAIN = "gain"  # an unusual gain of a sensor
    POSITION = "position"  # an unusual position of an accelerometer
    HEIGHT = "height"  # an unusual height of an accelerometer
    MISALIGNMENT = "misalignment"  # an unusual misalignment of a gyro
    PLAY = "play"  # an unusual play of the steering
    OFFSET = "offset"  # an unusual offset of a sensor
    UNRELATED_CHANNEL = "unrelated channel"  # no relation to the motion of the truck
    POOR_FIT = "poor fit"  # the identified truck predicts the channel poorly
    REJECTED_SAMPLES = "rejected samples"  # many samples of a channel are outside the gate
    NONLINEAR_RANGE = "nonlinear range"  # a run beyond the range of the linear model
    WHEEL_LIFT = "wheel lift"  # the wheels of a side of an axle group leave the road
    LARGE_INNOVATIONS = "large innovations"  # of a state filter, larger than it expects


@dataclass(frozen=True)
class Caution:
    """One reason to doubt a result."""

    kind: CautionKind
    message: str  # what was estimated or measured, and what was expected
    cure: str  # what to do
    value: float  # the number that exceeds its threshold, SI
    severity: Severity = "warning"  # an error makes results wrong that depend on the signal; a warning is a doubt
    parameters: tuple[str, ...] = ()  # whose estimates it concerns
    signals: tuple[str, ...] = ()
    log: str | None = None

    def __str__(self) -> str:
        return f"{self.message} {self.cure}"


def identification_cautions(
    identification: Identification, runs: Sequence[RunSummary] = (), states: Sequence[States] = ()
) -> list[Caution]:
    """All cautions of an identification.

    Args:
        runs: how the logs were driven.
        states: of the identified truck.
    """
    return [
        *contradiction_cautions(identification),
        *assumption_cautions(identification),
        *estimate_cautions(identification),
        *sensor_cautions(identification),
        *fit_cautions(identification),
        *(run_cautions(runs) if identification.friction is None else ()),
        *[caution for s in states for caution in state_cautions(s, "identified truck")],
    ]


def has_wide_sigma(estimate: Estimate) -> bool:
    """Whether an estimate converged, but to a sigma that is a large fraction of its value."""
    if estimate.verdict is not Verdict.CONVERGED or estimate.sigma is None:
        return False
    return estimate.sigma > thresholds.WIDE_SIGMA * abs(estimate.value)


def is_unusual(identification: Identification, error: SensorError) -> bool:
    """Whether a sensor error is far from its prior mean, or a steer gain far from 1."""
    mean, sigma = sensor_error_prior(identification, error.name)
    signal, kind = SensorErrorName.of(error.name) or (error.name, "")
    if kind == "gain" and is_of(signal, STEER):
        return abs(error.value - mean) > max(thresholds.UNUSUAL_GAIN, 2 * error.sigma)
    far = abs(error.value - mean) > thresholds.UNUSUAL_DEVIATION * sigma
    return far and (kind != "misalignment" or abs(error.value - mean) > 2 * error.sigma)


def sensor_error_prior(identification: Identification, name: str) -> tuple[float, float]:
    """Prior mean and standard deviation of a sensor error, SI."""
    prior = prior_of_sensor_error(identification.initial_vehicle, name, identification.settings)
    return prior or (0.0, identification.settings.steer_delay_prior)  # the delay of a time base


def contradiction_cautions(identification: Identification) -> Iterator[Caution]:
    """Logs that differ from the information of earlier logs."""
    own = {log.name for log in identification.logs}
    for log in identification.knowledge.logs if identification.knowledge else ():
        if log.name not in own:
            continue
        kind, name = CautionKind.CONTRADICTION, log.name
        if log.set_aside not in ("", NOT_CONVERGED):  # the verdicts show the latter
            message = f"{name} {log.set_aside}. It is set aside, and these estimates are of it alone."
            cure = (
                "Check whether it is of this truck and trailer, and its signals; with another load, name it (--load)."
            )
            yield Caution(kind, message, cure, 0.0, log=name)
        elif log.changed:
            changes = enumerated([*changes_in_words(log)] or log.changed)
            message = f"{name} differs from the earlier logs: {changes}. What this alters begins again there."
            cure = (
                "New tyres, another pressure, another load or a sensor that was moved are possible. If nothing was "
                f"changed, check {name}."
            )
            yield Caution(kind, message, cure, 0.0, parameters=log.changed, log=name)


def assumption_cautions(identification: Identification) -> Iterator[Caution]:
    """Numbers of the vehicle file and assumptions on the sensors that the residuals contradict."""
    for doubt in identification.doubts:
        if doubt.kind is not DoubtKind.ASSUMPTION:
            continue
        logs = [log.name for log in identification.logs]
        texts = [describe_cause(cause, identification.initial_vehicle, logs) for cause in doubt.causes]
        one = len(texts) == 1
        message = (
            "The logs contradict the vehicle file or an assumption on a sensor. They imply that "
            f"{texts[0] if one else 'one of these holds: ' + '; '.join(texts)}."
        )
        cure = "Check this, correct it in the vehicle file or the signal map, and identify again."
        yield Caution(
            CautionKind.ASSUMPTION,
            message,
            cure,
            doubt.statistic,
            parameters=doubt.parameters,
            signals=tuple(cause.name.rpartition(".")[0] for cause in doubt.causes if is_sensor_error(cause.name)),
        )


def describe_cause(cause: Cause, vehicle: Vehicle, logs: Sequence[str] = ()) -> str:
    """What is different: "yaw_rate.tractor is 52 ms late (5 times the assumed uncertainty)"; `logs` are names."""
    values = vehicle.parameters()
    _, log = split_log(cause.name)
    times = f"{abs(cause.prior_sigmas):.1f} times the assumed uncertainty"
    own = {path: change for path, change in cause.changes.items() if path in values}  # loads of tyres follow from them
    (path, change), *others = (own or cause.changes).items()
    error = SensorErrorName.of(path)
    if path == TIME_SCALE:
        return f"the time base runs {percent(abs(change))} too {'slow' if change > 0 else 'fast'} (timestamps)"
    if cause.name == MASS_SCALE:
        return f"all masses are {percent(abs(change / values[path]))} {'larger' if change > 0 else 'smaller'} ({times})"
    if error and error.kind == "delay":
        return f"{error.signal} is {with_sigma(abs(change), None, 's')} {'late' if change > 0 else 'early'} ({times})"
    if path.endswith(".softening"):
        group = path.removesuffix(".softening")
        return f"the tyres of {group} soften more with the slip angle: use --tyres saturating ({times})"
    if path.endswith(".self_steering") and not values.get(path):
        axle = path.removesuffix(".self_steering")
        size = f"self_steering = {min(change, 1.0):.1f}"
        return f"{axle} steers itself, as a castor axle does: give it {size} in the vehicle file ({times})"
    if cause.name.endswith(".axle_positions"):
        largest = max(map(abs, own.values()))
        side = "closer to" if change > 0 else "further from"
        return f"the axles of {ParameterPath.of(path).unit} are up to {digits(largest, 2)} m {side} its front ({times})"
    if path not in values:
        return f"{cause.name} is different ({times})"
    direction = "larger" if change > 0 else "smaller"
    if ParameterPath.of(path).quantity in POSITIONS or not values[path]:
        side = "front" if change > 0 else "rear"
        size = f"{digits(abs(change), 2)} {unit_of(path)} further to the {side}"
    else:
        size = f"{percent(abs(change / values[path]))} {direction}"
    if log is not None:  # its variation from log to log
        return f"{path} is {size} in {logs[int(log)]} than in all logs together ({times})"
    also = f" with {len(others)} other numbers that belong to it" if others else ""
    return f"{path} is {size}{also} ({times})"


def estimate_cautions(identification: Identification) -> Iterator[Caution]:
    """Stiffnesses and inertias much further from the vehicle file than their prior sigma."""
    for e in identification.parameters:
        if e.verdict not in (Verdict.CONVERGED, Verdict.DOUBTFUL) or ParameterPath.of(e.name).is_payload_height:
            continue
        if e.name == FRICTION:  # roads differ
            continue
        prior = e.prior / abs(e.initial) if e.prior and e.initial else identification.settings.prior
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
        significant = max(thresholds.SIGNIFICANT_DELAY * error.sigma, thresholds.NEGLIGIBLE_DELAY)
        filtered = is_of(signal, LATERAL_ACCELERATION)  # always late
        expected = sensor_error_prior(identification, error.name)[0]
        delayed = kind == "delay" and not filtered and abs(error.value - expected) > significant
        doubts = [d for d in identification.doubts if any(split_log(c.name)[0] == error.name for c in d.causes)]
        doubts = [d for d in doubts if d.kind is DoubtKind.SENSOR]
        if not delayed and not doubts and not is_unusual(identification, error):
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
                "(--set steer_delay='+- 5 ms') and identify again."
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
        elif kind == "gain":
            text = f"the estimated gain is {value}; 1 is expected."
            cure = "Check the unit, calibrate the sensor, and correct its gain in the signal map."
        else:
            text = f"the estimated offset is {value}, more than such a sensor usually has."
            cure = "Check the mounting and the calibration of the sensor."
        message = f"{signal} in {error.log}: {text}" if error.log else f"{signal}: {text}"
        parameters = tuple(dict.fromkeys(name for doubt in doubts for name in doubt.parameters))
        yield Caution(
            CautionKind(kind), message, cure, error.value, parameters=parameters, signals=(signal,), log=error.log
        )


def fit_cautions(identification: Identification) -> Iterator[Caution]:
    """Channels that the identified truck predicts poorly, and channels with many rejected samples."""
    excited = {fit.log for fit in identification.fits if fit.explained > thresholds.EXCITED_CHANNEL}
    for fit in identification.fits:
        quality, unit = fit_quality(fit, identification.settings.noise), si_unit(fit.signal)
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
    """Innovations that do not fit the filter's expectation, and wheels that lift.

    Args:
        blamed: what may be wrong besides the noise: "vehicle file" or "identified vehicle".
    """
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
    yield from _wheel_lifts(states)


def _wheel_lifts(states: States) -> Iterator[Caution]:
    """The axle group of which a wheel lifts first."""
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
