"""Mean square and autocorrelation of the innovations of each channel while learning."""

from collections.abc import Mapping, Sequence

AVERAGING_TIME = 1.0
"""Time constant of the average whose variance shows an autocorrelation of the innovations, s."""
WINDOWS = 10.0
"""Innovation windows over which that variance is averaged: it has fewer independent values than the mean square."""


class InnovationStatistics:
    """Recursive statistics of normalised innovations, which are white with variance 1 if the model is correct.

    Args:
        channels: their names.
        window: time constant of the mean square, s of learning.
        limit: larger innovations count as this.
    """

    def __init__(self, channels: Sequence[str], window: float, limit: float) -> None:
        count, self.channels = len(channels), tuple(channels)
        self.window, self.limit = window, limit
        self.mean_square = [1.0] * count
        """Of each channel; 1 is expected."""
        self.autocorrelation = [1.0] * count
        """Variance inflation factor of each channel: the variance of an average over that of white innovations."""
        self._average = [0.0] * count

    def update(self, dt: float, innovations: Sequence[float], present: Sequence[float]) -> None:
        """Take up the normalised innovations of a sample, dt seconds after the last one; 0 in `present` if missing."""
        if dt <= 0:
            return
        limit, fraction, slow = self.limit, dt / (self.window + dt), dt / (WINDOWS * self.window + dt)
        weight = dt / (AVERAGING_TIME + dt)
        expected = weight / (2 - weight)  # variance of the average of white innovations
        for i, innovation in enumerate(innovations):
            if present[i]:
                innovation = min(max(innovation, -limit), limit)
                self.mean_square[i] += fraction * (innovation * innovation - self.mean_square[i])
                self._average[i] = average = self._average[i] + weight * (innovation - self._average[i])
                self.autocorrelation[i] += slow * (average * average / expected - self.autocorrelation[i])

    @property
    def measured(self) -> tuple[str, ...]:
        """The channels that had a sample while learning."""
        pairs = zip(self.channels, self.mean_square, strict=True)
        return tuple(name for name, mean_square in pairs if mean_square != 1.0)  # the first sample changes it

    def as_dict(self) -> dict[str, dict[str, float]]:
        """Both statistics by channel."""
        return {
            "mean_square": dict(zip(self.channels, self.mean_square, strict=True)),
            "autocorrelation": dict(zip(self.channels, self.autocorrelation, strict=True)),
        }

    def restore(self, mean_square: Mapping[str, float], autocorrelation: Mapping[str, float]) -> None:
        """Continue from those of `as_dict`; a channel that is not among them starts."""
        self.mean_square[:] = [mean_square.get(name, 1.0) for name in self.channels]
        self.autocorrelation[:] = [autocorrelation.get(name, 1.0) for name in self.channels]
