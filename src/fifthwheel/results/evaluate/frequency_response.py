"""Frequency response, ISO 14793:2011 and ISO 14791:2000: gain, phase and coherence by random or swept steering.

Local polynomial method (R. Pintelon, J. Schoukens, G. Vandersteen, K. Barbe, Mech. Syst. Signal Process. 24, 2010):
in the discrete Fourier transforms X of the steer angle and Y of an output over the whole log, a response H and the
transients T of its ends are smooth, and quadratic in the 2 n + 1 frequencies around each one:

    Y(k + r) = H(r) X(k + r) + T(r) + V(r),    H(r) = H + h_1 r + h_2 r^2,    T(r) = t_0 + t_1 r + t_2 r^2.     (1)

Least squares give H without leakage, and the variance s^2 of the noise V from the residuals, with 2 n + 1 - 6 degrees
of freedom; sigma of |H| is that of least squares and of `PARABOLA`, and that of the phase is sigma / |H|. The coherence
is the fraction of the output's power that the steer angle explains, apart from transients; m = 4 (2 n + 1) / 9 is the
number of independent frequencies in a quadratic fit:

    c = |H|^2 / (|H|^2 + 2 m sigma^2).                                                                         (2)

Each output is moved by its lag behind the steer angle, so that the phase of H changes slowly. Only frequencies at which
the truck is steered and the coherence is at least `COHERENT` are evaluated.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fifthwheel.base.errors import SignalError
from fifthwheel.base.formatting import percent
from fifthwheel.base.types import Array
from fifthwheel.data.channels import ARTICULATION, LATERAL_ACCELERATION, ROLL, YAW_RATE, SignalName
from fifthwheel.results.evaluate.evaluation import EvaluatedMeasure, MethodResult
from fifthwheel.results.evaluate.manoeuvres import amplified, compared
from fifthwheel.results.evaluate.motion import MeasuredMotion, gain_unit
from fifthwheel.results.evaluate.repetitions import ACTIVE
from fifthwheel.truck.spoken_names import named

RESOLUTION = 1 / 30
"""Least distance of evaluated frequencies, Hz."""
NEIGHBOURS = 6
"""Least number n of frequencies of equation (1) on each side: seven degrees of freedom for sigma."""
BANDWIDTH = 0.05
"""Half of the band of equation (1) in a long log, Hz."""
INDEPENDENT = 4 / 9
"""Distance of independent estimates, as a fraction of the band: that of a local quadratic polynomial."""
PARABOLA = 1e-3
"""Standard deviation of a response from the parabola of equation (1), as a fraction of it, where the band has the half
width `BANDWIDTH`; it grows with the square of the band, and is part of sigma."""
LONGEST_LAG = 4.0
"""Of an output behind the steer angle, s."""
HIGHEST = 3.0
"""Highest frequency, Hz; heavy vehicles are tested up to 2 Hz."""
CONTINUOUS = 0.4
"""Least fraction of the time in which the truck is steered."""
STEERED = 1e-3
"""Least power of the steer angle as a fraction of the largest one."""
INFLATION = 5.0
"""Largest variance of a response by least squares, as a multiple of that of even steering without transients: at the
edge of the steered frequencies a response is not distinct from the transients."""
COHERENT = 0.95
"""Least coherence."""
NEAR_PEAK = 0.95
"""Gains above this fraction of the largest one determine the peak."""


@dataclass(frozen=True, kw_only=True)
class LocalFit:
    """One output at the evaluated frequencies, (f,) each."""

    gain: NDArray[np.complex128]
    sigma: Array
    """Of the magnitude of the gain."""
    coherence: Array
    steered: NDArray[np.bool_]
    """Frequencies at which the truck is steered, and apart from the transients."""


@dataclass(frozen=True, kw_only=True)
class Responses:
    """Responses of the outputs to the steer angle."""

    frequency: Array
    """Hz, (f,)."""
    band: float
    """Band of frequencies from which each response is estimated, Hz."""
    steered: NDArray[np.bool_]
    """Frequencies at which the truck is steered, (f,)."""
    fits: Mapping[str, LocalFit]
    """By output."""

    def relative_sigma(self, name: str) -> Array:
        """Sigma of the gain divided by the gain, and of the phase, rad, (f,)."""
        parabola = PARABOLA * (self.band / (2 * BANDWIDTH)) ** 2
        return np.asarray(np.hypot(self.fits[name].sigma / np.abs(self.fits[name].gain), parabola))

    def coherent(self, *names: str) -> NDArray[np.bool_]:
        """Frequencies at which the truck is steered and the outputs are coherent, (f,)."""
        return np.asarray(self.steered & np.all([self.fits[n].coherence >= COHERENT for n in names], axis=0))


def evaluate(motion: MeasuredMotion) -> MethodResult:
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
    measures = [m for name in responses.fits for m in _of_output(responses, name)]
    measures += [m for pair in amplified(motion) if (m := _amplification(responses, *pair))]
    band, arrays = f"Each response is a mean over {responses.band:.2f} Hz, along a parabola.", _arrays(responses)
    noise = {f"phase.{name}": responses.relative_sigma(name) for name in responses.fits}
    noise |= {f"gain.{name}": arrays[f"gain_sigma.{name}"] for name in responses.fits}
    return MethodResult(measures=tuple(measures), arrays=arrays, noise=noise, notes=(band, compared(motion)))


def _require_continuous_steering(motion: MeasuredMotion) -> None:
    """Raise for single manoeuvres: they are short in a long log, most of which is noise."""
    deviation = np.abs(motion.steer - np.median(motion.steer))
    fraction = float(np.mean(deviation > ACTIVE * deviation.max()))
    if fraction < CONTINUOUS:
        raise SignalError(
            f"{motion.steer_name}: the truck is steered for {percent(fraction)} of {motion.name}, at least "
            f"{percent(CONTINUOUS)} needed; steer continuously, at random or by a sweep, or cut the record to it"
        )


def _responses(motion: MeasuredMotion, names: list[str]) -> Responses:
    """The responses by the local polynomial method, of each output behind its lag."""
    fits = {name: _fit(motion, name) for name in names}
    frequency, band = _frequencies(motion)
    return Responses(frequency=frequency, band=band, steered=fits[f"yaw_rate.{motion.units[0]}"].steered, fits=fits)


def _frequencies(motion: MeasuredMotion) -> tuple[Array, float]:
    step = motion.rate / len(motion.time)
    half = max(NEIGHBOURS, round(BANDWIDTH / step)) * step
    distance = max(RESOLUTION, step)
    return np.asarray(distance * np.arange(1, int(min(HIGHEST, motion.rate / 4) / distance) + 1)), 2 * half


def _fit(motion: MeasuredMotion, name: str) -> LocalFit:
    """The least squares of equation (1) at each frequency; at the lowest ones the band is not symmetric."""
    lag = _lag(motion, name)
    size = len(motion.time) - lag
    X, Y = (np.fft.rfft(v - v.mean())[1:] for v in (motion.steer[:size], motion.signals[name][lag:]))
    frequency, band = _frequencies(motion)
    step = motion.rate / size
    n = round(band / 2 / step)
    centre = np.maximum(np.round(frequency / step).astype(int) - 1, n)
    rows = centre[:, None] + np.arange(-n, n + 1)  # (f, 2n + 1)
    power = np.mean(np.abs(X[rows]) ** 2, axis=1)
    r = ((rows + 1) * step - frequency[:, None]) / (n * step)
    shape = r[..., None] ** np.arange(3)
    scale = np.sqrt(np.maximum(power, np.finfo(float).tiny))
    regressors = np.concatenate([(X[rows] / scale[:, None])[..., None] * shape, shape], axis=2)
    inverse = np.linalg.pinv(regressors)
    coefficients = inverse @ Y[rows][..., None]
    residual = (Y[rows][..., None] - regressors @ coefficients)[..., 0]
    noise = np.sum(np.abs(residual) ** 2, axis=1) / (2 * n + 1 - 6)
    length = np.linalg.norm(inverse[:, 0], axis=1)
    explained, sigma = np.abs(coefficients[:, 0, 0]) ** 2, np.sqrt(noise / 2) * length
    total = explained + 2 * INDEPENDENT * (2 * n + 1) * sigma**2
    return LocalFit(
        gain=coefficients[:, 0, 0] / scale * np.exp(-2j * np.pi * frequency * lag / motion.rate),
        sigma=sigma / scale,
        coherence=np.divide(explained, total, out=np.zeros_like(total), where=total > 0),
        steered=(power > STEERED * power.max()) & (INDEPENDENT * (2 * n + 1) * length**2 < INFLATION),
    )


def _lag(motion: MeasuredMotion, name: str) -> int:
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
    gain, sigma, f = np.abs(responses.fits[name].gain), responses.relative_sigma(name), responses.frequency
    lowest = used[0]
    of, unit, value = named(name).removeprefix("the "), gain_unit(name), float(gain[lowest])
    title = f"gain at {f[lowest]:.2f} Hz, {of}"
    measures = [EvaluatedMeasure(f"gain.{name}", title, unit, value, float(value * sigma[lowest]), (name,))]
    response = responses.fits[name].gain[used]
    lag = -np.unwrap(np.angle(response * np.sign(response[0].real)))  # an articulation angle has a negative gain
    behind = np.flatnonzero(lag >= np.pi / 4)
    if behind.size and 0 < behind[0] == used[behind[0]] - lowest:  # no frequency is left out before it
        k = behind[0]
        slope = (lag[k] - lag[k - 1]) / (f[used[k]] - f[used[k - 1]])
        at, error = float(f[used[k]] - (lag[k] - np.pi / 4) / slope), float(sigma[used[k]] / abs(slope))
        title = f"frequency of a lag of 45 deg, {of}"
        measures.append(EvaluatedMeasure(f"bandwidth.{name}", title, "Hz", at, error, (name,)))
    return measures


def _amplification(responses: Responses, first: str, last: str) -> EvaluatedMeasure | None:
    """Largest gain from the first to the last unit: a weighted parabola through the gains near it."""
    used = np.flatnonzero(responses.coherent(first, last))
    if used.size < 3:
        return None
    ratio = np.abs(responses.fits[last].gain[used] / responses.fits[first].gain[used])
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
            distance = responses.frequency[1] - responses.frequency[0]
            together = max(1.0, INDEPENDENT * responses.band / distance)  # neighbours have common errors
            error = float(np.sqrt(together * row @ covariance @ row))
    quantity = SignalName.of(first).quantity
    title = f"rearward amplification, {quantity.replace('_', ' ')}, at {at:.2f} Hz"
    edge = "largest at the end of the evaluated frequencies" if top in (0, ratio.size - 1) else ""
    return EvaluatedMeasure(f"rearward_amplification_{quantity}", title, "1", value, error, (first, last), edge)


def _arrays(responses: Responses) -> dict[str, Array]:
    """Gain, its sigma, phase and coherence of each output; NaN where it is not evaluated."""
    arrays = {"frequency": responses.frequency}
    for name in responses.fits:
        used, gain = responses.coherent(name), responses.fits[name].gain
        phase = np.full(used.size, np.nan)
        phase[used] = np.unwrap(np.angle(gain[used]))
        arrays |= {
            f"gain.{name}": np.where(used, np.abs(gain), np.nan),
            f"gain_sigma.{name}": np.where(used, np.abs(gain) * responses.relative_sigma(name), np.nan),
            f"phase.{name}": phase,
            f"coherence.{name}": responses.fits[name].coherence,
        }
    return arrays
