"""What speaks for the map of a record: each signal beside what speed and steer angle predict for it."""

from dataclasses import dataclass

import numpy as np

from fifthwheel.base.plots import downsample
from fifthwheel.base.types import Array
from fifthwheel.data.checks import Finding
from fifthwheel.data.record import Record
from fifthwheel.estimate.time_bases.findings import check_signals
from fifthwheel.estimate.time_bases.offsets import MIN_EXPLAINED, TimeOffset, offsets_of
from fifthwheel.estimate.time_bases.predictions import LagCurve, Prediction, predict_channels
from fifthwheel.truck import Vehicle

BETTER = 0.05
"""Fraction of the variance by which the inverted signal must fit better for the sign to be doubted."""
MIN_LATE = 0.1
"""s; an identification estimates smaller delays."""
MAX_FACTOR = 2.5
"""Largest factor between a signal and its prediction: a wrong unit or a missing steering ratio gives more, uncertain
tyres and lengths less."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ChannelEvidence:
    """A measured signal and its prediction on a common time base."""

    measured: Array
    """(N,) SI, NaN where missing."""
    predicted: Array
    """(N,) SI, by the variant of the truck that explains all signals best; NaN where unknown."""
    lowest: Array
    highest: Array
    """(N,) of the variants: stiffness, and without a vehicle file also lengths, are uncertain."""
    explained: float | None
    """Fraction of the variance that the prediction explains with a free positive gain and a bias; None if it cannot be
    compared."""
    inverted: float | None
    """The same of the inverted signal, at lags up to 0.3 s."""
    offset: TimeOffset | None
    """How late its timestamps are, where that can be measured."""
    gain: float | None
    """The signal over the prediction at the best lag, where that can be measured."""
    is_scaled: bool
    """Whether the signal has the course of the prediction, and another size than any variant has."""

    @property
    def is_inverted(self) -> bool:
        """Whether the inverted signal fits better."""
        return self.explained is not None and (self.inverted or 0.0) > self.explained + BETTER

    @property
    def is_late(self) -> bool:
        """Whether the timestamps are late or early by more than an identification estimates."""
        return self.offset is not None and abs(self.offset.offset) > max(2 * self.offset.sigma, MIN_LATE)


@dataclass(frozen=True, kw_only=True, eq=False)
class SignalEvidence:
    """What speaks for the signals of a record, and what against them."""

    time: Array
    """(N,) s, of the predictions."""
    channels: dict[str, ChannelEvidence]
    """By signal; only those that are predicted."""
    others: dict[str, tuple[Array, Array]]
    """Time (n,) s and values (n,) SI to draw of the signals that are not predicted."""
    findings: tuple[Finding, ...]
    """Of `check_signals`."""


def signal_evidence(record: Record, vehicle: Vehicle | None = None) -> SignalEvidence:
    """Compare the signals of a record with what kinematics and the linear model of the truck predict.

    Nothing is predicted without speed and a steer angle. The default vehicle is any usual tractor and semitrailer.
    """
    findings = check_signals(record, vehicle)
    prediction = predict_channels(record, vehicle)
    predicted = () if prediction is None else prediction.names
    others = {
        name: downsample.course(record.time, values) for name, values in record.signals.items() if name not in predicted
    }
    if prediction is None:
        return SignalEvidence(time=np.empty(0), channels={}, others=others, findings=findings)
    offsets = {offset.name: offset for offset in offsets_of(record, prediction)}
    best = _best_variant(prediction)
    channels = {}
    for k, name in enumerate(prediction.names):
        curve = prediction.curves[best][k]
        gains = [gain for row in prediction.curves if (gain := _gain(row[k])) is not None]
        variants = prediction.predicted[:, :, k]
        known = np.isfinite(variants).all(axis=0)
        lowest, highest = np.full((2, known.size), np.nan)
        lowest[known], highest[known] = variants[:, known].min(axis=0), variants[:, known].max(axis=0)
        channels[name] = ChannelEvidence(
            measured=prediction.measured[:, k],
            predicted=variants[best],
            lowest=lowest,
            highest=highest,
            explained=None if curve is None else curve.explained_at(0.0),
            inverted=None if curve is None else curve.inverted,
            offset=offsets.get(name),
            gain=_gain(curve),
            is_scaled=bool(gains) and not any(1 / MAX_FACTOR < gain < MAX_FACTOR for gain in gains),
        )
    return SignalEvidence(time=prediction.time, channels=channels, others=others, findings=findings)


def _gain(curve: LagCurve | None) -> float | None:
    """Measured over predicted; None where the prediction does not explain the signal."""
    gain, _, explained = (None if curve is None else curve.gain()) or (0.0, 0.0, 0.0)
    return gain if explained >= MIN_EXPLAINED else None


def _best_variant(prediction: Prediction) -> int:
    """The variant that leaves the smallest part of the signals unexplained at their best lags."""
    misfits = [
        float(np.mean([np.log(max(1 - curve.explained.max(), 1e-4)) for curve in row if curve is not None] or [0.0]))
        for row in prediction.curves
    ]
    return int(np.argmin(misfits))
