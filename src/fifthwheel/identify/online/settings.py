"""Settings of a learner: when it learns, and how it treats faults of the signals."""

from dataclasses import dataclass, field

from fifthwheel.errors import SignalError
from fifthwheel.filters.relinearised import RelinearisationSettings


@dataclass(frozen=True, kw_only=True)
class LearnerSettings:
    """When a `Learner` learns, and how it treats faults of the signals."""

    start_excitation: float = 0.25
    """Learning starts when the excitation exceeds this rms lateral acceleration, m/s^2."""
    stop_excitation: float = 0.1
    """Learning stops when the excitation falls to this rms lateral acceleration, m/s^2."""
    excitation_window: float = 0.5
    """Time constant of the excitation's mean square, s."""
    high_pass_time: float = 4.0
    """Time constant of the high-pass filter of the excitation, s: it removes bends and the offset of the steering."""
    settling_time: float = 1.0
    """Nothing is learned for this time, s, after a start, a gap in time or a long dropout of a steer angle."""
    relinearisation: RelinearisationSettings = field(default_factory=RelinearisationSettings)
    """How often the samples of a segment with excitation are repeated."""
    max_innovation_ratio: float = 2.0
    """No parameter has the verdict converged while the innovations of a channel have a mean square, relative to the
    variance that the filter predicts, above this."""
    innovation_window: float = 10.0
    """Time constant of that mean, in seconds of learning."""
    max_steer_dropout: float = 0.1
    """A longer dropout of a steer angle, s, makes the state inaccurate: nothing is learned for `settling_time`."""
    hold: float = 0.5
    """A missing speed or steer angle keeps its last value for at most this time, s."""
    max_steer: float = 1.0
    """A steer angle beyond this, rad, counts as missing; no road wheel turns so far."""
    max_steer_rate: float = 3.0
    """A steer angle that changes faster than this, rad/s, counts as missing; no driver steers so fast."""
    max_speed_change: float = 2.0
    """A speed that differs from the last one by more than this, m/s, counts as missing."""
    coast: float = 1.0
    """After this time without an accepted measurement, s, the state starts again at the next measurement; without any
    measurement the status is COASTING."""
    max_gap: float = 1.0
    """After a longer gap in time, s, the state starts again; the estimates stay."""

    def __post_init__(self) -> None:
        for name in (
            "start_excitation",
            "stop_excitation",
            "excitation_window",
            "high_pass_time",
            "max_innovation_ratio",
            "innovation_window",
            "max_steer",
            "max_steer_rate",
            "max_speed_change",
            "coast",
            "max_gap",
        ):
            if not getattr(self, name) > 0:
                raise SignalError(f"{name}: expected above 0, got {getattr(self, name)}; correct it")
        for name in ("settling_time", "max_steer_dropout", "hold"):
            if not getattr(self, name) >= 0:
                raise SignalError(f"{name}: expected 0 or more, got {getattr(self, name)}; correct it")
        if self.stop_excitation > self.start_excitation:
            raise SignalError(
                f"stop_excitation: expected at most start_excitation, {self.start_excitation:g} m/s^2, got "
                f"{self.stop_excitation:g}; correct one of both"
            )
