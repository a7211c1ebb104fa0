"""Frequency response, ISO 14793:2011 and ISO 14791:2000: gain, phase and coherence by random or swept steering.

Welch's method (IEEE Trans. Audio Electroacoust. 15, 1967): responses are means over n segments with Hann windows that
overlap by half. Each output is moved by its lag behind the steer angle, so that both lie in the same window,

    H = S_xy / S_xx,    coherence c = |S_xy|^2 / (S_xx S_yy),    sigma of |H| = |H| sqrt((1 - c) / (2 c (n' - 1))),

n' = n / `OVERLAP` is the number of independent segments (J. Bendat and A. Piersol, Random Data, 4th ed., 2010, 9.2).
The sigma of the phase is that of |H| / |H|. Only frequencies at which the truck is steered and the coherence is at
least `COHERENT` are evaluated.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fifthwheel._types import Array
from fifthwheel.channels import ARTICULATION, LATERAL_ACCELERATION, ROLL, YAW_RATE
from fifthwheel.errors import SignalError
from fifthwheel.evaluate.evaluation import EvaluatedMeasure, Findings
from fifthwheel.evaluate.lane_change import amplified
from fifthwheel.evaluate.motion import Motion
from fifthwheel.evaluate.repetitions import ACTIVE, GAIN_UNITS
from fifthwheel.formatting import percent
from fifthwheel.spoken_names import named

SHORTEST = 30.0
"""Least duration of a log, s."""
SEGMENT = 30.0
"""Longest segment, s."""
LONGEST_LAG = 4.0
"""Of an output behind the steer angle, s."""
LEAST_SEGMENTS = 5
"""Segments that a short log is divided into, with overlap."""
OVERLAP = 1.056
"""1 + 2 (1/6)^2: variance of the mean over Hann windows that overlap by half, as a multiple of independent ones."""
HIGHEST = 3.0
"""Highest frequency, Hz; heavy vehicles are tested up to 2 Hz."""
CONTINUOUS = 0.4
"""Least fraction of the time in which the truck is steered."""
STEERED = 1e-3
"""Least power of the steer angle as a fraction of the largest one."""
COHERENT = 0.8
"""Least coherence."""
NEAR_PEAK = 0.95
"""Gains above this fraction of the largest one determine the peak."""


@dataclass(frozen=True, kw_only=True)
class Responses:
    """Responses of the outputs by name to the steer angle, (f,) each."""

    frequency: Array
    """Hz."""
    segments: int
    steered: NDArray[np.bool_]
    """Frequencies at which the truck is steered."""
    gains: Mapping[str, NDArray[np.complex128]]
    coherences: Mapping[str, Array]

    def relative_sigma(self, name: str) -> Array:
        """Sigma of the gain divided by the gain, and of the phase, rad, (f,)."""
        c = np.clip(self.coherences[name], 1e-9, 1.0)
        return np.asarray(np.sqrt((1 - c) / (2 * c * (self.segments / OVERLAP - 1))))

    def coherent(self, *names: str) -> NDArray[np.bool_]:
        """Frequencies at which the truck is steered and the outputs are coherent, (f,)."""
        return np.asarray(self.steered & np.all([self.coherences[n] >= COHERENT for n in names], axis=0))


def evaluate(motion: Motion) -> Findings:
    """The frequency responses of a motion, and its rearward amplification.

    Raises:
        SignalError: the log has no yaw rate of the first unit, that is not coherent with the steer angle, or the truck
            is not steered continuously.
    """
    first = f"yaw_rate.{motion.units[0]}"
    motion.output(first)
    _require_continuous_steering(motion)
    quantities = (YAW_RATE, LATERAL_ACCELERATION, ARTICULATION, ROLL)
    responses = _responses(motion, [name for q in quantities for name in motion.outputs(q.quantity)])
    if responses.coherent(first).sum() < 3:
        raise SignalError(
            f"{first}: coherence with the steer angle of {COHERENT:g} or more at {responses.coherent(first).sum()} "
            f"frequencies of {motion.name}, at least 3 needed; steer at random or by a sweep, over a longer time"
        )
    measures = [m for name in responses.gains for m in _of_output(responses, name)]
    measures += [m for pair in amplified(motion) if (m := _amplification(responses, *pair))]
    segments = f"{responses.segments} segments of {1 / (responses.frequency[1] - responses.frequency[0]):.0f} s."
    arrays = _arrays(responses)
    noise = {f"phase.{name}": responses.relative_sigma(name) for name in responses.gains}
    noise |= {f"gain.{name}": arrays[f"gain_sigma.{name}"] for name in responses.gains}
    return Findings(measures=tuple(measures), arrays=arrays, start=None, noise=noise, notes=(segments,))


def _require_continuous_steering(motion: Motion) -> None:
    """Raise for single manoeuvres: their segments differ in what they contain, and sigma would be too small."""
    deviation = np.abs(motion.steer - np.median(motion.steer))
    fraction = float(np.mean(deviation > ACTIVE * deviation.max()))
    if fraction < CONTINUOUS:
        raise SignalError(
            f"{motion.steer_name}: the truck is steered for {percent(fraction)} of {motion.name}, at least "
            f"{percent(CONTINUOUS)} needed; steer continuously, at random or by a sweep, or cut the record to it"
        )


def _responses(motion: Motion, names: list[str]) -> Responses:
    """The responses by overlapping segments."""
    from scipy import signal  # slow to import

    duration = len(motion.time) / motion.rate
    size = round(min(SEGMENT, 2 * duration / (LEAST_SEGMENTS + 1)) * motion.rate)
    frequency = np.arange(size // 2 + 1) * motion.rate / size
    used = (frequency > 0) & (frequency <= min(HIGHEST, motion.rate / 4))
    frequency = frequency[used]

    def density(x: Array, y: Array) -> NDArray[np.complex128]:
        return np.asarray(signal.csd(x, y, motion.rate, nperseg=size, noverlap=size - size // 2)[1][used])

    power = density(motion.steer, motion.steer).real
    gains, coherences = dict[str, NDArray[np.complex128]](), dict[str, Array]()
    for name in names:
        lag = _lag(motion, name)
        steer, output = motion.steer[: len(motion.time) - lag], motion.signals[name][lag:]
        cross, own = density(steer, output), density(steer, steer).real
        gains[name] = cross / own * np.exp(-2j * np.pi * frequency * lag / motion.rate)
        both = own * density(output, output).real
        coherences[name] = np.divide(np.abs(cross) ** 2, both, out=np.zeros_like(both), where=both > 0)
    return Responses(
        frequency=frequency,
        segments=(len(motion.time) - size) // (size // 2) + 1,
        steered=power > STEERED * power.max(),
        gains=gains,
        coherences=coherences,
    )


def _lag(motion: Motion, name: str) -> int:
    """Samples by which an output follows the steer angle: those of the largest correlation within `LONGEST_LAG`."""
    from scipy.signal import correlate  # slow to import

    steer, output = motion.steer - motion.steer.mean(), motion.signals[name] - motion.signals[name].mean()
    correlation = np.abs(correlate(output, steer, method="fft")[len(steer) - 1 :])
    return int(np.argmax(correlation[: round(LONGEST_LAG * motion.rate) + 1]))


def _of_output(responses: Responses, name: str) -> list[EvaluatedMeasure]:
    """Gain at the lowest evaluated frequency, and the frequency at which the output lags by 45 degrees."""
    used = np.flatnonzero(responses.coherent(name))
    if not used.size:
        return []
    gain, sigma, f = np.abs(responses.gains[name]), responses.relative_sigma(name), responses.frequency
    lowest = used[0]
    of = named(name).removeprefix("the ")
    measures = [
        EvaluatedMeasure(
            name=f"gain.{name}",
            title=f"gain at {f[lowest]:.2f} Hz, {of}",
            unit=GAIN_UNITS.get(name.partition(".")[0], "1"),
            value=float(gain[lowest]),
            sigma=float(gain[lowest] * sigma[lowest]),
        )
    ]
    response = responses.gains[name][used]
    lag = -np.unwrap(np.angle(response * np.sign(response[0].real)))  # an articulation angle has a negative gain
    behind = np.flatnonzero(lag >= np.pi / 4)
    if behind.size and 0 < behind[0] == used[behind[0]] - lowest:  # no frequency is left out before it
        k = behind[0]
        slope = (lag[k] - lag[k - 1]) / (f[used[k]] - f[used[k - 1]])
        at = f[used[k]] - (lag[k] - np.pi / 4) / slope
        measures.append(
            EvaluatedMeasure(
                name=f"bandwidth.{name}",
                title=f"frequency of a lag of 45 deg, {of}",
                unit="Hz",
                value=float(at),
                sigma=float(sigma[used[k]] / abs(slope)),
            )
        )
    return measures


def _amplification(responses: Responses, first: str, last: str) -> EvaluatedMeasure | None:
    """Largest gain from the first to the last unit: a weighted parabola through the gains near it."""
    used = np.flatnonzero(responses.coherent(first, last))
    if used.size < 3:
        return None
    ratio = np.abs(responses.gains[last][used] / responses.gains[first][used])
    sigma = ratio * np.hypot(responses.relative_sigma(first)[used], responses.relative_sigma(last)[used])
    f, top = responses.frequency[used], int(np.argmax(ratio))
    near = (ratio > NEAR_PEAK * ratio[top]) & (np.abs(np.arange(ratio.size) - top) <= max(3, ratio.size // 6))
    value, error, at = float(ratio[top]), float(sigma[top]), float(f[top])
    if near.sum() >= 4 and 0 < top < ratio.size - 1:
        x, weight = f[near] - f[near].mean(), 1 / np.maximum(sigma[near], 1e-6 * value)
        parabola, covariance = np.polyfit(x, ratio[near], 2, w=weight, cov="unscaled")
        bent, slope, _ = parabola
        if bent < 0 and abs(slope / (2 * bent)) <= np.ptp(x) / 2:
            peak = -slope / (2 * bent)
            row = np.array([peak**2, peak, 1.0])
            value, at = float(row @ parabola), float(f[near].mean() + peak)
            error = float(np.sqrt(row @ covariance @ row))
    quantity = first.partition(".")[0]
    words = quantity.replace("_", " ")
    edge = "largest at the end of the evaluated frequencies" if top in (0, ratio.size - 1) else ""
    return EvaluatedMeasure(
        name=f"rearward_amplification_{quantity}",
        title=f"rearward amplification, {words}, at {at:.2f} Hz",
        unit="1",
        value=value,
        sigma=error,
        reason=edge,
    )


def _arrays(responses: Responses) -> dict[str, Array]:
    """Gain, its sigma, phase and coherence of each output; NaN where it is not evaluated."""
    arrays = {"frequency": responses.frequency}
    for name in responses.gains:
        used, gain = responses.coherent(name), responses.gains[name]
        phase = np.full(used.size, np.nan)
        phase[used] = np.unwrap(np.angle(gain[used]))
        arrays |= {
            f"gain.{name}": np.where(used, np.abs(gain), np.nan),
            f"gain_sigma.{name}": np.where(used, np.abs(gain) * responses.relative_sigma(name), np.nan),
            f"phase.{name}": phase,
            f"coherence.{name}": responses.coherences[name],
        }
    return arrays
