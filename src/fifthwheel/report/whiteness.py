"""Whether what is left over is noise: does a residual hang together, is it normal, is it as large as it should be?"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fifthwheel.report.numbers import digits, percent

Array = NDArray[np.float64]

SHOWN = 2.0
"""An autocorrelation is shown up to this lag, s."""
MOST_LAGS = 300
FEW = 30
"""With fewer samples nothing is said."""
WHITE = 0.2
"""A correlation below this part does not matter, however many samples show it."""
STRETCHES = 24
"""So many stretches of a log, of `FEW` samples or more, are judged one by one."""
FAR = 3.0
NORMAL_FAR = 0.0027
"""Part of a normal law beyond `FAR` standard deviations."""
LOUD, QUIET = 1.5, 0.6
"""Innovations that are so many times what the filter expects: its bands are too narrow, or wider than need be."""


@dataclass(frozen=True, kw_only=True)
class Correlation:
    """A residual against itself, some time later."""

    lag: Array  # (L,) s, from the first lag on
    value: Array  # (L,)
    limit: float  # 95 % of white noise lie within
    together: float | None  # s until it is within the limit for the first time; None where it is as good as white


def correlation(time: Array, values: Array) -> Correlation | None:
    """Autocorrelation of a residual (N,), on its own usual step; pairs with a missing sample are left out.

    None where there is too little of it to tell.
    """
    seen = np.isfinite(values)
    count = int(seen.sum())
    if count < FEW or not np.ptp(values[seen]) > 0:
        return None
    step = float(np.median(np.diff(time[seen])))
    place = np.round((time[seen] - time[seen][0]) / step).astype(np.int64)
    if place[-1] > 20 * count:  # mostly holes; take it as it comes
        place = np.arange(count)
    lags = min(max(round(SHOWN / step), 20), MOST_LAGS, count // 3)
    size = 1 << int(np.ceil(np.log2(place[-1] + 1 + lags)))
    rows, there = np.zeros(size), np.zeros(size)
    rows[place] = values[seen] - values[seen].mean()
    there[place] = 1.0
    both, pairs = (np.fft.irfft(np.abs(np.fft.rfft(of)) ** 2, size)[: lags + 1] for of in (rows, there))
    with np.errstate(divide="ignore", invalid="ignore"):
        value = both / np.where(pairs > 0.5, pairs, np.nan)
    value = value[1:] / value[0]
    limit = 1.96 / float(np.sqrt(count))
    lag = step * np.arange(1.0, lags + 1.0, dtype=np.float64)
    together = None
    if np.abs(value[: max(lags // 4, 5)]).max(initial=0.0) > max(WHITE, 1.5 * limit):
        inside = np.flatnonzero(np.abs(value) < max(limit, WHITE / 2))
        together = float(lag[inside[0]] if inside.size and inside[0] else lag[0] if inside.size else lag[-1])
    return Correlation(lag=lag, value=value, limit=limit, together=together)


def beyond(values: Array) -> float:
    """Part of the values (N,) beyond three of their own standard deviations."""
    seen = values[np.isfinite(values)]
    return float(np.mean(np.abs(seen - seen.mean()) > FAR * seen.std())) if seen.size >= FEW else float("nan")


def expected(count: int) -> tuple[float, float]:
    """Within which the rms of so many normalised innovations lies in 95 % of all cases (Wilson and Hilferty 1931)."""
    low, high = (max(1 - 2 / (9 * count) + z * np.sqrt(2 / (9 * count)), 0.0) ** 1.5 for z in (-1.96, 1.96))
    return float(low), float(high)


@dataclass(frozen=True, kw_only=True)
class Stretches:
    """The rms of normalised innovations, stretch by stretch."""

    time: Array  # (K,) s, its middle
    rms: Array
    low: Array  # expected
    high: Array

    @property
    def inside(self) -> float:
        """Part of the stretches that are as expected."""
        return float(np.mean((self.rms >= self.low) & (self.rms <= self.high)))


def stretches(time: Array, normalised: Array) -> Stretches | None:
    """Judge normalised innovations (N,) in stretches of as many samples each; None where there are too few."""
    seen = np.isfinite(normalised)
    count = int(seen.sum())
    if count < FEW:
        return None
    rows = np.array_split(np.flatnonzero(seen), int(np.clip(count // FEW, 1, STRETCHES)))
    bounds = [expected(len(part)) for part in rows]
    return Stretches(
        time=np.array([time[part].mean() for part in rows]),
        rms=np.array([np.sqrt(np.mean(normalised[part] ** 2)) for part in rows]),
        low=np.array([low for low, _ in bounds]),
        high=np.array([high for _, high in bounds]),
    )


def in_words(found: Correlation | None, far: float, *, free_run: bool) -> str:
    """What to see in a residual, a sentence or two."""
    if found is None:
        return "too few samples to tell noise from a pattern."
    if found.together is None:
        text = "as good as white noise: nothing is left in it that the model could explain"
    else:
        more = " or more" if found.together >= found.lag[-1] else ""
        text = f"not white, it hangs together for about {digits(found.together, 1)} s{more}: "
        text += (
            "the truck, the road or a sensor does something that the model does not have. The sigma of the parameters "
            "counts that"
            if free_run
            else "the truck of the vehicle file, or the noise that was assumed, does not fit"
        )
    if far > 4 * NORMAL_FAR:
        text += f"; {percent(far)} beyond 3 sigma where a normal law has 0.27 %, so it has outliers"
    return text + "."


def size_in_words(size: float, count: int) -> str:
    """What to think of the rms of normalised innovations."""
    if count < FEW or not np.isfinite(size):
        return "innovations: too few to judge."
    low, high = expected(count)
    told = f"innovations of the state filter: rms {size:.2f}, chance alone gives {low:.2f} to {high:.2f}"
    if size > LOUD:
        return f"{told}; far more than it expects, its bands are too narrow."
    if size < QUIET:
        return f"{told}; far less than it expects, its bands are wider than need be."
    if low <= size <= high:
        return f"{told}: as expected."
    return f"{told}: a little off, which does no harm."
