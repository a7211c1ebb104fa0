"""What follows from the signals of a record: wheel speed differences, lateral acceleration, noise of sensors."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from fifthwheel.base.types import Array
from fifthwheel.data.channels import ROLL_RATE, WHEEL_SPEED, WHEEL_SPEED_DIFFERENCE, YAW_RATE, names_of
from fifthwheel.data.record.record import Record
from fifthwheel.data.record.timestamps import held_samples

LOWEST_SPEED = 1.0
"""m/s; below it a wheel speed sensor has too few pulses."""
AVERAGING_TIME = 0.5
"""Time over which the lateral acceleration is averaged, s."""
NOISE_BAND = (3.0, 10.0)
"""Hz. Below this band a truck yaws and rolls; above it many sensors filter."""
SEGMENT = 2.0
"""s, length of the segments whose spectra are computed."""


def sides_of(difference: str) -> tuple[str, str]:
    """The wheel speeds, left and right, of a wheel speed difference.

    >>> sides_of("wheel_speed_difference.dolly")
    ('wheel_speed.dolly.left', 'wheel_speed.dolly.right')
    """
    axle = difference.replace(WHEEL_SPEED_DIFFERENCE.quantity, WHEEL_SPEED.quantity, 1)
    return f"{axle}.left", f"{axle}.right"


def all_pairs(names: Iterable[str]) -> tuple[str, ...]:
    """The wheel speed difference of each axle of which both wheel speeds, left and right, are among the names.

    >>> all_pairs(["wheel_speed.dolly.left", "wheel_speed.dolly.right", "wheel_speed.tractor.front.left"])
    ('wheel_speed_difference.dolly',)
    """
    wheels = set(names_of(WHEEL_SPEED, names))
    axles = [name.removesuffix(".left") for name in sorted(wheels) if name.endswith(".left")]
    differences = [axle.replace(WHEEL_SPEED.quantity, WHEEL_SPEED_DIFFERENCE.quantity, 1) for axle in axles]
    return tuple(name for name in differences if wheels.issuperset(sides_of(name)))


def wheel_speed_difference(left: ArrayLike, right: ArrayLike) -> Array:
    """Right less left wheel speed over their mean, of arrays (N,), m/s; NaN where the wheels hardly turn.

    >>> wheel_speed_difference([20.0, 0.1], [20.2, 0.1]).round(4)
    array([0.01,  nan])
    """
    left, right = np.asarray(left, dtype=np.float64), np.asarray(right, dtype=np.float64)
    mean = (left + right) / 2
    return np.asarray((right - left) / np.where(mean > LOWEST_SPEED, mean, np.nan))


def with_differences(record: Record, names: Iterable[str]) -> Record:
    """The record with those of these wheel speed differences that it does not have."""
    pairs = {name: sides_of(name) for name in names if name not in record.signals}
    signals = {name: wheel_speed_difference(*(record.signals[side] for side in pair)) for name, pair in pairs.items()}
    bases = {name: record.time_bases[left] for name, (left, _) in pairs.items() if left in record.time_bases}
    return replace(record.with_signals(signals), time_bases={**record.time_bases, **bases}) if pairs else record


def sample_with_differences(sample: Mapping[str, float | None], names: Collection[str]) -> Mapping[str, float | None]:
    """A sample, "time" and signals by name, with those of these wheel speed differences that it does not have."""
    differences: dict[str, float | None] = {}
    for name in names:
        if name not in sample:
            left, right = (np.nan if value is None else value for value in map(sample.get, sides_of(name)))
            differences[name] = float(wheel_speed_difference(left, right))
    return {**sample, **differences} if differences else sample


def lateral_acceleration(record: Record, unit: str, *, offset: float = 0.0) -> Array:
    """Speed times yaw rate of the first unit, averaged over 0.5 s, m/s^2, (N,); NaN without the signals.

    `offset` is that of the yaw rate, rad/s.
    """
    missing = np.full(len(record), np.nan)
    values = record.signals.get("speed", missing) * (record.signals.get(f"yaw_rate.{unit}", missing) - offset)
    known = np.isfinite(values)
    width = min(max(round(record.rate * AVERAGING_TIME), 1), len(record))  # "same": the length of the longer one
    window = np.ones(width)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = np.convolve(np.where(known, values, 0.0), window, "same") / np.convolve(known, window, "same")
    return np.where(known, mean, np.nan)


def largest_lateral_acceleration(record: Record, unit: str, *, offset: float = 0.0, min_speed: float = 5.0) -> float:
    """Largest magnitude of speed times yaw rate of the first unit, averaged over 0.5 s, m/s^2; NaN without the signals.

    The record's samples are evenly spaced, apart from gaps. `offset` is that of the yaw rate, rad/s; samples slower
    than `min_speed`, m/s, are left out.
    """
    name = f"yaw_rate.{unit}"
    if name not in record.signals or "speed" not in record.signals:
        return float("nan")
    speed = record.signals["speed"]
    lateral = speed * (record.signals[name] - offset)
    with np.errstate(invalid="ignore"):
        valid = (speed >= min_speed) & np.isfinite(lateral)
    return largest_mean(lateral[valid], round(record.rate * AVERAGING_TIME * valid.mean()) if valid.any() else 1)


def largest_mean(values: Array, width: int) -> float:
    """The largest magnitude of a moving mean of `width` values; NaN without values."""
    if not values.size:
        return float("nan")
    width = min(max(width, 1), values.size)
    total = np.concatenate([[0.0], np.cumsum(values)])
    return float(np.abs((total[width:] - total[:-width]) / width).max())


def article_gyro_variance(units: Sequence[str]) -> dict[str, float]:
    """The article's sensors: yaw and roll rate of every unit, front to rear, with their variances, (rad/s)^2."""
    return {
        f"{gyro.quantity}.{unit}": gyro.noise[min(i, 1)]
        for gyro in (ROLL_RATE, YAW_RATE)
        for i, unit in enumerate(units)
        if gyro.noise
    }


def estimate_noise_variance(time: Array, values: Array) -> float | None:
    """Variance of the white noise whose spectral density is that of a channel between 3 and 10 Hz, SI squared.

    The estimate is the median over Hann-windowed segments of 2 s and over frequencies, so that disturbances in less
    than half of the segments, such as bumps, do not change it. It holds for low-pass filtered channels too: their
    samples have a smaller variance, but they are autocorrelated and count as fewer white samples. The same applies to a
    channel that repeats each sample until the next one. Below a sampling rate of 20 Hz the upper third of the spectrum
    is used, which contains some vehicle motion. A sensor filter below 5 Hz attenuates most of the band: the estimate is
    then too small by a factor of several. The time (N,), s, need not be regular; a step above three median steps ends a
    segment. None for fewer than four segments.
    """
    present = np.isfinite(values)
    time, values = time[present], values[present]
    held = held_samples(time, values)
    repetitions = held.repetitions if held else 1.0
    time, values = (held.time, held.values) if held else (time, values)
    if time.size < 8:
        return None
    steps = np.diff(time)
    step = float(np.median(steps))
    size = max(round(SEGMENT / step), 12)
    frequency = np.fft.rfftfreq(size, step)
    low, high = NOISE_BAND
    band = (frequency >= low) & (frequency <= high)
    if frequency[-1] < high:
        band = frequency >= 2 / 3 * frequency[-1]
    window, ramp = np.hanning(size + 1)[:-1], np.linspace(-1.0, 1.0, size)
    densities = []
    for part in np.split(values, np.flatnonzero(steps > 3 * step) + 1):
        if part.size < size:
            continue
        segments = np.lib.stride_tricks.sliding_window_view(part, size)[:: size // 2]
        detrended = segments - segments.mean(axis=1, keepdims=True)
        detrended = detrended - np.outer(detrended @ ramp / (ramp @ ramp), ramp)
        densities.append(np.abs(np.fft.rfft(detrended * window, axis=1)[:, band]) ** 2 / (window @ window))
    if sum(len(density) for density in densities) < 4:
        return None
    # ordinates of a periodogram are exponentially distributed: their median is ln 2 times their mean
    return repetitions * float(np.median(np.concatenate(densities)) / np.log(2))
