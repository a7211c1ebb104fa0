"""Time offsets of channels and time bases, from the lags of the channels behind their predictions."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fifthwheel.base.types import Array
from fifthwheel.data.record import Record
from fifthwheel.estimate.time_bases.predictions import LagCurve, Prediction

MIN_EXPLAINED = 0.3
"""Channels of which the prediction explains less are not measured."""
MIN_OFFSET = 0.2
"""s; smaller offsets of measured channels are not reported. Real logs with a wrong vehicle file reach 0.19 s."""
MIN_STEER_OFFSET = 0.25
"""s; smaller offsets of a steer angle are not reported, an identification estimates them."""
MIN_GENERIC_OFFSET = 0.3
"""s; smaller offsets are not reported without a vehicle file."""
MIN_GAIN = 0.01
"""Fraction of the variance: offsets whose correction explains less of it are not reported. In a turn with a slowly
rising steer angle, the softening of the tyres looks like a large offset, but explains less than that."""
_SAME_OFFSET = 0.1
"""s; channels whose offsets differ by less are reported together."""
_MODEL_SIGMA = 0.015
"""s, error of the model besides that of the tyre stiffness, by comparison with the nonlinear truck."""


@dataclass(frozen=True, kw_only=True)
class TimeOffset:
    """How late the timestamps of a channel, or of all channels of a time base, are."""

    name: str
    """The signal, or the time base."""
    signals: tuple[str, ...]
    """The signal, or those of the time base."""
    offset: float
    """s, positive if late: `delay` in signals.toml."""
    sigma: float
    """s, with the error of tyre stiffness unknown by 30 % and of autocorrelated residuals."""
    explained_at_0: float
    """Fraction of the variance that the prediction explains without a correction."""
    explained: float
    """The same with the offset corrected."""
    smallest: float
    """Smaller offsets are not reported, s."""

    @property
    def significant(self) -> bool:
        """Whether it exceeds three sigma and the smallest offset that is reported, and explains the channel better."""
        better = self.explained - self.explained_at_0 > MIN_GAIN
        return better and abs(self.offset) > max(3 * self.sigma, self.smallest)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Lags:
    """Lags of the channels behind their predictions, by variant of the vehicle."""

    names: tuple[str, ...]
    """(c,) channels that the prediction explains."""
    curves: Sequence[LagCurve]
    """(c,) of the best variant."""
    lag: Array
    """(v, c) s"""
    sigma: Array
    """(c,) s, of the best variant, without the uncertainty of the vehicle."""
    weight: Array
    """(v,) of the variants, from how well they explain all channels; their sum is 1."""
    generic: bool
    """Whether the vehicle is unknown."""

    def mean(self, lags: Array) -> tuple[float, float]:
        """Mean and standard deviation over the variants of some lags (v,), s."""
        mean = float(self.weight @ lags)
        return mean, float(np.sqrt(self.weight @ (lags - mean) ** 2))


def offsets_of(record: Record, prediction: Prediction) -> tuple[TimeOffset, ...]:
    """Time offsets of the time bases and of the channels of a record, by what speed and steer angle predict.

    A channel is predicted by the linear model, and the lag is searched at which the prediction explains most of the
    channel's variance with free gain and bias. The offset is relative to the yaw rate of the first unit. If that yaw
    rate and the steer angle do not agree, the other channels decide which of the two is late. The reference has no
    entry. Channels are left out that the vehicle does not have, or that vary too little or too irregularly. The
    offsets of time bases come first, then those of single channels, each in the order of the record.
    """
    lags = _measure_lags(prediction)
    if lags is None:
        return ()
    channels = _channel_offsets(lags, prediction, record)
    bases: dict[str, list[TimeOffset]] = {}
    for channel in channels:
        if base := record.time_bases.get(channel.name):
            bases.setdefault(base, []).append(channel)
    groups = [
        _joined(base, members, tuple(n for n in record.signals if record.time_bases.get(n) == base))
        for base, members in bases.items()
    ]
    return (*groups, *channels)


def _measure_lags(prediction: Prediction) -> _Lags | None:
    """Lags of all channels that some variant explains; variants without a lag of one of them are left out."""
    curves = prediction.curves
    best = np.array([[(curve.best() if curve else None) or (np.nan, np.nan) for curve in row] for row in curves])
    explained = np.zeros(best.shape[:2])
    for v, c in np.argwhere(np.isfinite(best[:, :, 0])):
        if (curve := curves[v][c]) is not None:
            explained[v, c] = curve.explained_at(best[v, c, 0])
    used = np.flatnonzero(explained[0] >= MIN_EXPLAINED)
    complete = np.flatnonzero((explained[:, used] > 0).all(axis=1))
    if not used.size:
        return None
    misfit = np.log(np.maximum(1 - explained[np.ix_(complete, used)], 1e-4)).mean(axis=1)
    weight = np.exp(2 * (misfit.min() - misfit))
    first = int(complete[misfit.argmin()])
    return _Lags(
        names=tuple(prediction.names[c] for c in used),
        curves=[curve for c in used if (curve := curves[first][c]) is not None],
        lag=best[np.ix_(complete, used)][:, :, 0],
        sigma=best[first, used, 1],
        weight=weight / weight.sum(),
        generic=prediction.generic,
    )


def _channel_offsets(lags: _Lags, prediction: Prediction, record: Record) -> list[TimeOffset]:
    """Offsets of the channels, and of the steer angle if a yaw rate of the first unit is the reference."""
    steer, leading = prediction.steer, prediction.leading
    if leading in record.signals and leading not in lags.names:
        return []  # what steers the truck is unknown, or does not show
    reference: int | None = lags.names.index(leading) if leading in lags.names else None
    if reference is not None and _leading_is_wrong(lags, reference, record.time_bases, steer):
        reference = None
    origin = np.zeros(len(lags.weight)) if reference is None else lags.lag[:, reference]
    origin_sigma = 0.0 if reference is None else float(lags.sigma[reference])

    def offset(name: str, c: int, lag: Array, sigma: float, at: float, sign: float, smallest: float) -> TimeOffset:
        """By the lags (v,) of a signal; the curve of channel c moves from the lag `at` by sign times the offset."""
        mean, spread = lags.mean(lag)
        return TimeOffset(
            name=name,
            signals=(name,),
            offset=mean,
            sigma=float(np.sqrt(spread**2 + sigma**2 + origin_sigma**2 + _MODEL_SIGMA**2)),
            explained_at_0=lags.curves[c].explained_at(at),
            explained=lags.curves[c].explained_at(at + sign * mean),
            smallest=MIN_GENERIC_OFFSET if lags.generic else smallest,
        )

    base, _ = lags.mean(origin)
    channels = [
        offset(name, c, lags.lag[:, c] - origin, float(lags.sigma[c]), base, 1.0, MIN_OFFSET)
        for c, name in enumerate(lags.names)
        if c != reference
    ]
    if reference is None:
        return channels
    return [offset(steer, reference, -origin, 0.0, 0.0, -1.0, MIN_STEER_OFFSET), *channels]


def _leading_is_wrong(lags: _Lags, leading: int, time_bases: Mapping[str, str], steer: str) -> bool:
    """Whether the yaw rate of the first unit and the steer angle disagree, and the steer angle is right."""
    lag, spread = lags.mean(lags.lag[:, leading])
    others = np.array([lags.mean(lags.lag[:, c])[0] for c in range(len(lags.names)) if c != leading])
    distance = np.abs(others - lag)
    if abs(lag) < max(3 * float(np.hypot(spread, lags.sigma[leading])), MIN_STEER_OFFSET):
        with_steer = np.abs(others) < distance / 2
        return bool(others.size) and with_steer.mean() > 0.5 and float(np.median(distance)) > MIN_OFFSET
    if lag > 0 or time_bases.get(lags.names[leading]) != time_bases.get(steer):
        return True  # it is late, perhaps with others
    # it seems early: the steer angle is late, unless most other channels agree with that
    return bool(np.mean(distance < np.abs(others)) < 0.5) if others.size else False


def common_offsets(offsets: Sequence[TimeOffset]) -> list[TimeOffset]:
    """The significant offsets, joined where those of time bases or channels are similar."""
    late = [offset for offset in offsets if offset.significant]
    common: list[list[TimeOffset]] = []
    for offset in late:
        same = next((c for c in common if abs(c[0].offset - offset.offset) < _SAME_OFFSET), None)
        if same is None:
            common.append([offset])
        else:
            same.append(offset)
    return [
        _joined(members[0].name, members, tuple(dict.fromkeys(name for o in members for name in o.signals)))
        for members in common
    ]


def _joined(name: str, offsets: Sequence[TimeOffset], signals: tuple[str, ...]) -> TimeOffset:
    """The common offset of several channels: their mean, weighted by sigma."""
    weight = np.array([1 / max(o.sigma, 1e-3) ** 2 for o in offsets])
    weight /= weight.sum()
    averaged = ("offset", "sigma", "explained_at_0", "explained")  # the error of the vehicle is common to all channels
    means = {key: float(weight @ np.array([getattr(o, key) for o in offsets])) for key in averaged}
    return TimeOffset(name=name, signals=signals, smallest=max(o.smallest for o in offsets), **means)
