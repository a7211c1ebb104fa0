"""Settings of an observer."""

import math
import numbers
from collections.abc import Mapping
from dataclasses import dataclass, field

from fifthwheel.channels import LATERAL_ACCELERATION, is_of
from fifthwheel.dynamics.speed_rate import TIME_CONSTANT
from fifthwheel.dynamics.tyres import TyreLaw
from fifthwheel.errors import SignalError
from fifthwheel.filters.initial_state import INITIAL_SIGMA
from fifthwheel.vehicle.parameters import FRICTION_RANGE, HALF_TRACK, TYRE_PARAMETERS


@dataclass(frozen=True, kw_only=True)
class ObserverSettings:
    """Settings of an observer.

    Raises:
        SignalError: a value is outside its range.

    Example:
        >>> import fifthwheel as fw
        >>> fw.ObserverSettings(min_speed=7.0, bank=0.0).coast
        1.0
    """

    min_speed: float = 5.0
    """Lowest speed of the linear tyre model, m/s; below it the states are NaN and the status is TOO_SLOW."""
    hold: float = 0.5
    """Longest time for which a missing speed or steer angle keeps its value, s; then the status is INPUT_MISSING."""
    max_steer_rate: float = 3.0
    """A steer angle that changes faster than this, rad/s, counts as missing; no driver steers so fast."""
    max_acceleration: float = 20.0
    """A speed that changes faster than this, m/s^2, counts as missing."""
    coast: float = 1.0
    """Longest time without an accepted measurement, s; then the status is COASTING."""
    max_gap: float = 1.0
    """Longest gap between samples, s; after a longer gap the filter starts again."""
    gate: float = 6.0
    """Largest accepted innovation, in standard deviations."""
    restart_after: float = 0.1
    """Time for which most channels must be outside the gate (see `monitor`), s; then the filter restarts with a wide
    sigma."""
    max_nis: float = 4.0
    """Normalised innovation squared, 1 is expected, above which the status is INCONSISTENT."""
    nis_window: float = 1.0
    """Time constant of its average, s."""
    noise: Mapping[str, float] = field(default_factory=dict)
    """Noise variance of measured signals, SI squared; by default the article's R."""
    process_noise: float = 1.0
    """Factor of the process noise `filters.variances.OBSERVER_PROCESS_VARIANCE`, equation (14) of the article."""
    bank: float = INITIAL_SIGMA["bank"]
    """Standard deviation of the bank of the road, rad; 0 if it is exact. Every sigma contains it."""
    bank_mean: float = 0.0
    """Mean of the bank of the road, rad, positive with the left edge higher."""
    estimate_bank: bool = False
    """Correct the bank by measurements and report it as "bank.road". By default it is considered (Schmidt): it keeps
    its mean, because errors of the vehicle look like a bank."""
    steer_offset: float = 0.01
    """Prior standard deviation of the offset of every steer angle about that of `sensor_errors`, rad. The observer
    estimates the offset; 0 if it is exact."""
    acceleration_offset: float = 0.3
    """The same for the offset of every lateral accelerometer, m/s^2. It contains gravity by the tilt of the mounting:
    1 deg gives 0.17 m/s^2."""
    friction: float | None = None
    """Peak friction of the road, at which tyres saturate, for lateral accelerations above 3 m/s^2, braking in a turn
    and slippery roads: 0.75 dry, 0.6 wet, 0.3 snow; None: linear tyres."""
    half_track: float = TYRE_PARAMETERS[HALF_TRACK].default
    """Lateral distance from the centre line to the middle of the tyres of one side, m, for load transfer ratios; with
    twin tyres about 0.92 m."""
    brakes: Mapping[str, float] = field(default_factory=dict)
    """Fraction of the braking force on axle groups, by path, such as {"tractor.drive": 1.0} for a retarder; groups that
    it does not name do not brake. Empty: all groups brake in proportion to their static loads."""
    speed_smoothing: float = TIME_CONSTANT
    """Time constant of the derivative of the speed, s, from which braking is known to saturating tyres (see
    `dynamics.speed_rate`); longer for a noisier speed. Infinite: the speed changes slowly."""
    sensor_errors: Mapping[str, float] = field(default_factory=dict)
    """Known offsets, gains and delays of sensors, such as "steer.tractor.front.offset"; none by default. The correction
    of a delay of the steer angle uses its slope, which amplifies its noise: use a smooth steer signal."""
    positions: Mapping[str, float] = field(default_factory=dict)
    """Position of a reported sideslip, x on the unit in m, such as "sideslip.semitrailer": -2.34 for a sensor at the
    landing legs; by default under the CoG."""

    def __post_init__(self) -> None:
        times = ("coast", "max_gap", "nis_window", "speed_smoothing")
        for name in ("min_speed", "gate", "max_steer_rate", "max_acceleration", "max_nis", *times):
            if not getattr(self, name) > 0:
                raise SignalError(f"{name}: expected above 0, got {getattr(self, name)}; give a positive number")
        low, high = FRICTION_RANGE
        if self.friction is not None and not (_is_finite(self.friction) and low <= self.friction <= high):
            raise SignalError(
                f"friction: expected between {low} and {high}, or None for linear tyres, got {self.friction}; a dry "
                "road has 0.75"
            )
        if not (_is_finite(self.half_track) and 0.3 <= self.half_track <= 2):
            raise SignalError(f"half_track: expected 0.3 to 2 m, got {self.half_track}; give half the track width in m")
        for name in ("hold", "process_noise", "restart_after", "acceleration_offset"):
            if not getattr(self, name) >= 0:
                raise SignalError(f"{name}: expected 0 or more, got {getattr(self, name)}; give 0 to switch it off")
        for name, smallest in (("bank", 0.0), ("bank_mean", -1.0), ("steer_offset", 0.0)):
            value = getattr(self, name)
            if not _is_finite(value) or not smallest <= value < 1:
                raise SignalError(
                    f"{name}: expected between {smallest:g} and 1 rad, got {value}; convert degrees to rad"
                )
        if self.estimate_bank and not self.bank:
            raise SignalError("estimate_bank: expected a sigma of the bank above 0, got 0; give it as bank")
        for values, meaning in ((self.sensor_errors, "a sensor error"), (self.positions, "a position")):
            for name, value in values.items():
                if not _is_finite(value):
                    raise SignalError(f"{name}: expected {meaning} in SI, got {value}; give a finite number")
        for path, fraction in self.brakes.items():
            if not _is_finite(fraction) or fraction < 0 or not sum(self.brakes.values()) > 0:
                raise SignalError(
                    f"brakes, {path}: expected fractions of 0 or more, one above 0, got {fraction}; correct it"
                )
        for name, variance in self.noise.items():
            if not _is_finite(variance) or variance <= 0:
                raise SignalError(
                    f"{name}: expected a finite variance above 0, got {variance}; give the noise variance in SI"
                )

    def offset_sigma(self, name: str) -> float:
        """Prior standard deviation of the offset of a steer angle or accelerometer, SI."""
        return self.acceleration_offset if is_of(name, LATERAL_ACCELERATION) else self.steer_offset

    @property
    def tyres(self) -> TyreLaw:
        """Law of the side forces."""
        return "linear" if self.friction is None else "saturating"


def _is_finite(value: object) -> bool:
    """Whether a value, maybe from a file, is a finite number."""
    return isinstance(value, numbers.Real) and math.isfinite(value)
