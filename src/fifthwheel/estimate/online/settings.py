"""Settings of a learner: when it learns, and how it treats faults of the signals."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from fifthwheel.base.errors import SignalError
from fifthwheel.base.settings import FiniteNonNegative, NonNegative, Positive, Settings
from fifthwheel.data.channels import LEARNED
from fifthwheel.estimate.filters.relinearised import RelinearisationSettings
from fifthwheel.estimate.identify.doubts import NONLINEAR_ACCELERATION, NONLINEAR_SPEED_RATE


@dataclass(frozen=True, kw_only=True)
class LearnerSettings(Settings):
    """When a `Learner` learns, and how it treats faults of the signals.

    Example:
        >>> import fifthwheel as fw
        >>> settings = fw.LearnerSettings()
    """

    start_excitation: Positive = 0.25
    """Learning starts when the excitation exceeds this rms lateral acceleration, m/s^2."""
    stop_excitation: Positive = 0.1
    """Learning stops when the excitation falls to this rms lateral acceleration, m/s^2."""
    excitation_window: Positive = 0.5
    """Time constant of the excitation's mean square, s."""
    high_pass_time: Positive = 4.0
    """Time constant of the high-pass filter of the excitation, s: it removes bends and the offset of the steering."""
    settling_time: NonNegative = 1.0
    """Nothing is learned for this time, s, after a start, a gap in time or a long dropout of a steer angle."""
    relinearisation: RelinearisationSettings = field(default_factory=RelinearisationSettings)
    """How often the samples of a segment with excitation are repeated."""
    max_speed_rate: Positive = NONLINEAR_SPEED_RATE
    """Acceleration or deceleration beyond which nothing is learned, m/s^2, except of tyres that saturate: it moves the
    loads of the axles, which linear tyres lack."""
    max_lateral_acceleration: Positive = NONLINEAR_ACCELERATION
    """Nothing is learned while the steer angle corresponds to a larger steady lateral acceleration, m/s^2: the model is
    linear. Tyres that saturate have no such limit."""
    discrepancy: Mapping[str, FiniteNonNegative] = field(
        default_factory=lambda: {channel.quantity: channel.discrepancy for channel in LEARNED}
    )
    """Standard deviation of the discrepancy of a channel by quantity, SI: the part of its signal that the linear model
    does not describe, a first-order process. The model has none if `OneStage.given` has "discrepancy" as exact."""
    discrepancy_time: Positive = 3.0
    """Time constant of the discrepancies, s."""
    offset_time: Positive = 3600.0
    """After this time without information, s, the offset of a sensor is about as uncertain as its prior."""
    parameter_time: Positive = 30 * 86400.0
    """The same for all other unknowns, s (30 days): tyres wear, and their pressure changes."""
    max_innovation_ratio: Positive = 2.0
    """All parameters are doubtful while the innovations of a channel have a mean square, relative to the variance that
    the filter predicts, above this."""
    max_autocorrelation: Positive = 5.0
    """The same for the autocorrelation of the innovations: for the variance of their average over one second, relative
    to that of white innovations."""
    innovation_window: Positive = 10.0
    """Time constant of that mean square, in seconds of learning; ten times as long for the autocorrelation."""
    max_steer_dropout: NonNegative = 0.1
    """A longer dropout of a steer angle, s, makes the state inaccurate: nothing is learned for `settling_time`."""
    hold: NonNegative = 0.5
    """A missing speed or steer angle keeps its last value for at most this time, s."""
    max_steer: Positive = 1.0
    """A steer angle beyond this, rad, counts as missing; no road wheel turns so far."""
    max_steer_rate: Positive = 3.0
    """A steer angle that changes faster than this, rad/s, counts as missing; no driver steers so fast."""
    max_speed_change: Positive = 2.0
    """A speed that differs from the last one by more than this, m/s, counts as missing."""
    coast: Positive = 1.0
    """After this time without an accepted measurement, s, the state starts again at the next measurement; without any
    measurement the status is COASTING."""
    max_gap: Positive = 1.0
    """After a longer gap in time, s, the state starts again; the estimates stay."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.stop_excitation > self.start_excitation:
            raise SignalError(
                f"stop_excitation: expected at most start_excitation, {self.start_excitation:g} m/s^2, got "
                f"{self.stop_excitation:g}; correct one of both"
            )
