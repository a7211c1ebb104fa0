"""Channels predicted by the linear model for several values of what is uncertain in it, and lags behind them.

The lag of a measured channel behind its prediction has a sigma.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np
from numpy.typing import NDArray

from fifthwheel.base.errors import FifthwheelError
from fifthwheel.base.names import ParameterPath
from fifthwheel.base.types import Array
from fifthwheel.data.channels import MEASURED, SignalName, is_of, measured_signals
from fifthwheel.data.checks.kinematics import is_mostly_gaps, without_gaps
from fifthwheel.data.checks.plausibility import MIN_SPEED
from fifthwheel.data.checks.samples import MAX_SPEED
from fifthwheel.data.record import Record
from fifthwheel.data.record.record import segments_above
from fifthwheel.data.record.resample import decimate
from fifthwheel.estimate.filters.initial_state import steady_initial_state
from fifthwheel.model import dynamics
from fifthwheel.model.dynamics.simulation import free_response
from fifthwheel.truck import Vehicle, catalogue

RATE = 25.0
"""Hz, rate of the comparison; a truck yaws and rolls below 3 Hz."""
MAX_LAG = 2.2
"""s, largest lag that is searched; beyond 2 s only to find the maximum at 2 s."""
_BLOCK = 4.0
"""s; residuals of different blocks count as independent."""
_MIN_SAMPLES = 100
_INVERTED_LAG = 0.3
"""s; an inverted signal lags its prediction by less."""
_AMBIGUITY = 1.05
"""Of several maxima, the smallest lag is used that leaves at most this multiple of the smallest residual variance."""
_KNOWN_STIFFNESS = ((1.0, 1.0), (0.7, 0.7), (1.4, 1.4), (1.0, 0.7), (1.0, 1.4))
"""Factors of the cornering stiffness of the first unit and of the other units; a vehicle file is wrong by 30 %."""
_UNKNOWN_STIFFNESS = (0.6, 1.0, 1.7)
"""Factors of the cornering stiffness of all units without a vehicle file, laden or unladen."""
_UNKNOWN_LENGTH = (0.8, 1.0, 1.3, 1.7)
"""Factors of the length of the semitrailer without a vehicle file: 6.4 to 13.6 m."""
_START = 1.0
"""s at the start of a segment that depend on its unknown initial state."""


@dataclass(frozen=True, kw_only=True, eq=False)
class LagCurve:
    """How well a channel is explained by its prediction, delayed by each lag, with free gain and bias.

    For each lag k the model is m(t) = g p(t - k) + b, with g > 0. All lags are compared on the same samples.
    """

    measured: Array
    """(N,) SI, NaN where missing."""
    predicted: Array
    """(N,) SI, NaN where unknown."""
    rows: NDArray[np.intp]
    """(n,) rows that are compared: measured, and predicted at all lags."""
    inverted: float
    """Largest fraction of the variance that is explained with a negative gain, at lags up to 0.3 s."""
    explained: Array
    """(k,) fraction of the variance that is explained, by lag in steps of 1 / RATE, 0 in the middle; 0 for a negative
    gain."""

    @property
    def lags(self) -> Array:
        """(k,) s."""
        steps = self.explained.size // 2
        return np.arange(-steps, steps + 1) / RATE

    def explained_at(self, lag: float) -> float:
        """Explained fraction of the variance at a lag, s."""
        return float(np.interp(lag, self.lags, self.explained))

    def best(self) -> tuple[float, float] | None:
        """Lag of the best explanation and its sigma, s; None without a maximum within the searched range,
        and where the inverted signal is explained better.

        The lag is refined by a parabola. Sigma is that of least squares with the scores summed over blocks of 4 s, so
        that autocorrelated residuals do not make it too small:

            sigma^2 = sum_b (sum_{i in b} s_i)^2 / (sum_i (g p'_i)^2)^2,   s_i = g p'_i e_i,

        with p' the slope of the prediction less what gain and bias explain, and e the residual.
        """
        value, steps = self.explained, self.explained.size // 2
        maxima = np.flatnonzero((value[1:-1] >= value[:-2]) & (value[1:-1] > value[2:])) + 1
        if not maxima.size or self.inverted > value[maxima].max():
            return None
        near = maxima[1 - value[maxima] <= _AMBIGUITY * (1 - value[maxima].max())]
        k = int(near[np.argmin(np.abs(near - steps))])
        before, at, after = value[k - 1 : k + 2]
        lag = (k - steps + 0.5 * (before - after) / (before - 2 * at + after)) / RATE
        gain, slope, residual = self._least_squares(k - steps)
        scores = self._block_sums(gain * slope * residual)
        return float(lag), float(np.sqrt(scores @ scores) / (gain**2 * (slope @ slope)))

    def gain(self) -> tuple[float, float, float] | None:
        """Gain at the best lag, its sigma from the same sums, and the explained fraction of the variance."""
        k = int(self.explained.argmax())
        if not 0 < k < self.explained.size - 1:
            return None
        rows = self.rows - (k - self.explained.size // 2)
        p = self.predicted[rows] - self.predicted[rows].mean()
        gain, _, residual = self._least_squares(k - self.explained.size // 2)
        scores = self._block_sums(p * residual)
        return gain, float(np.sqrt(scores @ scores) / (p @ p)), float(self.explained[k])

    def _least_squares(self, lag: int) -> tuple[float, Array, Array]:
        """Gain, slope p' less what gain and bias explain (n,), and residual (n,) at a lag in steps."""
        rows = self.rows - lag
        m, p = (x - x.mean() for x in (self.measured[self.rows], self.predicted[rows]))
        slope = (self.predicted[rows + 1] - self.predicted[rows - 1]) * RATE / 2
        slope -= slope.mean()
        slope -= p * (p @ slope) / (p @ p)
        gain = float(p @ m / (p @ p))
        residual = m - gain * p
        return gain, slope, residual - slope * (slope @ residual) / (slope @ slope)

    def _block_sums(self, scores: Array) -> Array:
        """Sums (b,) of the scores (n,) over blocks, with a factor for few of them."""
        blocks = np.flatnonzero(np.diff((self.rows / (_BLOCK * RATE)).astype(int), prepend=-1))
        return np.asarray(np.add.reduceat(scores, blocks) * np.sqrt(blocks.size / max(blocks.size - 3, 1)))


def lag_curve(measured: Array, predicted: Array) -> LagCurve | None:
    """The curve of a channel (N,) at RATE, in SI, and its prediction (N,); None for too few samples or no variance."""
    steps = round(MAX_LAG * RATE)
    if measured.size <= 2 * steps + 2:
        return None
    count = np.concatenate([[0], np.cumsum(np.isfinite(predicted))])
    whole = count[2 * steps + 3 :] - count[: -2 * steps - 3] == 2 * steps + 3  # one more row on each side for slopes
    rows = np.flatnonzero(np.pad(whole, steps + 1) & np.isfinite(measured))
    if rows.size < _MIN_SAMPLES:
        return None
    m = measured[rows] - measured[rows].mean()
    correlation = _correlation(m, np.nan_to_num(predicted - np.nanmean(predicted)), rows, steps)
    near = round(_INVERTED_LAG * RATE)
    inverted = -float(correlation[steps - near : steps + near + 1].min())
    return LagCurve(
        measured=measured,
        predicted=predicted,
        rows=rows,
        inverted=max(inverted, 0.0) ** 2,
        explained=np.clip(correlation, 0.0, 1.0) ** 2,  # rounding may give more than 1
    )


def _correlation(m: Array, p: Array, rows: NDArray[np.int64], steps: int) -> Array:
    """Correlation (2 steps + 1,) of m (n,), at `rows`, with p (N,) at row - k, |k| <= steps; by Fourier transforms."""
    size = 1 << (p.size + steps).bit_length()
    at_rows = np.zeros((2, p.size))
    at_rows[0, rows], at_rows[1, rows] = m, 1.0
    transforms = np.fft.rfft(np.stack([*at_rows, p, p**2]), size)
    products = transforms[[0, 1, 1]] * transforms[[2, 2, 3]].conj()
    covariance, total, squares = np.fft.irfft(products, size)[:, np.arange(-steps, steps + 1)]
    variances = (squares - total**2 / rows.size) * (m @ m)
    usable = variances > 1e-12 * squares.max() * (m @ m)
    return np.where(usable, covariance / np.sqrt(np.where(usable, variances, 1.0)), 0.0)


@dataclass(frozen=True, kw_only=True, eq=False)
class Prediction:
    """Measured and predicted channels on the multiples of 1 / RATE; of a gap above 10 s, 10 s remain."""

    time: Array
    """(N,) s"""
    steer: str
    """The first steer angle, front to rear."""
    names: tuple[str, ...]
    """(c,) channels"""
    measured: Array
    """(N, c) SI; NaN where missing."""
    predicted: Array
    """(v, N, c) SI, by variant of the vehicle; NaN outside the usable segments."""

    generic: bool
    """Whether the vehicle is unknown and the variants are usual ones."""

    @property
    def leading(self) -> str:
        """The yaw rate of the steered unit, whether measured or not."""
        return f"yaw_rate.{SignalName.of(self.steer).unit}"

    @cached_property
    def curves(self) -> list[list[LagCurve | None]]:
        """(v, c) how well each channel is explained by its own prediction at each lag."""
        pairs = [zip(self.measured.T, variant.T, strict=True) for variant in self.predicted]
        return [[lag_curve(measured, predicted) for measured, predicted in pair] for pair in pairs]


def predict_channels(record: Record, vehicle: Vehicle | None = None) -> Prediction | None:
    """The prediction of every channel that the vehicle has, for each variant of the vehicle that is stable.

    The cornering stiffness of a given vehicle varies by 30 %; by default, stiffness and length of a tractor and
    semitrailer vary over the range of usual ones; of a log with signals of other units, only those of the tractor are
    predicted. None where the record has no speed or steer angle that can be used,
    no such channel, or almost only gaps.
    """
    if vehicle is None:
        typical, factors = catalogue.get("cheng_cebon_2011"), product(_UNKNOWN_STIFFNESS, _UNKNOWN_LENGTH)
        variants = [_scaled(typical, leading=tyres, towed=tyres, length=length) for tyres, length in factors]
    else:
        variants = [_scaled(vehicle, leading=leading, towed=towed) for leading, towed in _KNOWN_STIFFNESS]
    measured_names = measured_signals(record.signals, [unit.name for unit in variants[0].units], MEASURED)
    names = tuple(name for name in record.signals if name in measured_names)
    units = {unit.name for unit in variants[0].units}
    if vehicle is None and not {SignalName.of(n).unit for n in record.signals if is_of(n, *MEASURED)} <= units:
        names = tuple(name for name in names if SignalName.of(name).unit == variants[0].units[0].name)
    try:
        segments = segments_above(record, MIN_SPEED)
        variants = [variant.with_logged_steering(record.signals, record.name) for variant in variants]
        steers = variants[0].steer_signals()
        inputs = [{name: segment.input(name) for name in ("speed", *steers)} for segment in segments]
    except FifthwheelError:
        return None
    fastest = max(float(columns["speed"].max()) for columns in inputs)
    roll = any(is_of(name, *[c for c in MEASURED if c.model and c.model.needs_roll]) for name in names)
    variants = [variant for variant in variants if dynamics.is_stable(variant, fastest, roll=roll)]
    if not names or not variants or fastest > MAX_SPEED or len(record) < _START * RATE:
        return None
    if is_mostly_gaps(record):
        return None
    time, values = decimate(record.time, np.column_stack([record.signals[name] for name in names]), RATE)
    instants = without_gaps(np.arange(np.rint(time[0] * RATE), np.rint(time[-1] * RATE) + 1) / RATE, time)
    rows = np.rint(instants * RATE)
    measured = np.full((rows.size, len(names)), np.nan)
    measured[np.searchsorted(rows, np.rint(time * RATE))] = values
    predicted = np.full((len(variants), *measured.shape), np.nan)
    for segment, columns in zip(segments, inputs, strict=True):
        first, last = np.searchsorted(rows, [np.ceil(segment.time[0] * RATE), np.floor(segment.time[-1] * RATE) + 1])
        grid = instants[first:last]
        if grid.size > _START * RATE:
            on_grid = {name: np.interp(grid, segment.time, column) for name, column in columns.items()}
            for variant, response in zip(variants, predicted, strict=True):
                response[first:last] = _response(variant, names, grid, on_grid, roll=roll)
    return Prediction(
        time=instants,
        steer=steers[0],
        names=names,
        measured=measured,
        predicted=predicted,
        generic=vehicle is None,
    )


def _response(vehicle: Vehicle, names: Sequence[str], time: Array, inputs: dict[str, Array], *, roll: bool) -> Array:
    """Outputs (N, c) from the steady state of the first inputs; NaN in the first second."""
    first = {name: float(column[0]) for name, column in inputs.items()}
    x0, _ = steady_initial_state(vehicle, first, {}, roll=roll)
    model = dynamics.model(vehicle, names, roll=roll)
    outputs = free_response(model, dynamics.all_parameters(vehicle, names), time, inputs, x0)[1]
    outputs[: round(_START * RATE)] = np.nan
    return outputs


def _scaled(vehicle: Vehicle, *, leading: float, towed: float, length: float = 1.0) -> Vehicle:
    """The vehicle with factors of the cornering stiffness of its first and its other units, and of their length."""
    first = vehicle.units[0].name
    of_towed = {"cornering_stiffness": towed, "position": length, "cog": length, "yaw_inertia": length**2}
    changed = {}
    for name, value in vehicle.parameters().items():
        path = ParameterPath.of(name)
        factors = {"cornering_stiffness": leading} if path.unit == first else of_towed
        if path.quantity in factors:
            changed[name] = value * factors[path.quantity]
    return vehicle.replace(changed)
