"""Settings of an observer."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated

from pydantic import AfterValidator

from fifthwheel.base.errors import SignalError
from fifthwheel.base.names import ParameterPath
from fifthwheel.base.options import ObserverOptions
from fifthwheel.base.settings import Cure, Finite, Limits, NonNegative, Positive
from fifthwheel.data.channels import (
    LATERAL_ACCELERATION,
    SPEED,
    WHEEL_SPEED_DIFFERENCE,
    SensorErrorName,
    checked_name,
    is_of,
)
from fifthwheel.estimate.filters.initial_state import initial_sigma
from fifthwheel.estimate.filters.variances import Variances
from fifthwheel.model.dynamics.speed_rate import TIME_CONSTANT
from fifthwheel.model.dynamics.tyres import ChosenTyres, Tyres
from fifthwheel.truck.quantities import DRIVE_AXLE_BRAKING, TYRES


def _checked_error(name: str) -> str:
    error = SensorErrorName.of(name)
    if error is None:
        raise SignalError(f"{name}: not the name of a sensor error; expected one such as 'steer.tractor.front.offset'")
    checked_name(error.signal)
    if is_of(error.signal, SPEED):
        raise SignalError(f"{name}: an observer corrects no error of the speed; correct it in the signal map")
    return name


SensorErrorKey = Annotated[str, AfterValidator(_checked_error)]
SignalKey = Annotated[str, AfterValidator(checked_name)]
InSI = Annotated[Finite, Cure("give a finite number in SI")]
_RADIANS = Cure("convert degrees to rad")


@dataclass(frozen=True, kw_only=True)
class ObserverSettings(ObserverOptions):
    """Settings of an observer.

    Raises:
        SignalError: a value is outside its range.

    Example:
        >>> import fifthwheel as fw
        >>> fw.ObserverSettings(min_speed=7.0, bank=0.0).coast
        1.0
    """

    hold: NonNegative = 0.5
    """Longest time for which a missing speed or steer angle keeps its value, s; then the status is INPUT_MISSING."""
    max_steer_rate: Positive = 3.0
    """A steer angle that changes faster than this, rad/s, counts as missing; no driver steers so fast."""
    max_acceleration: Positive = 20.0
    """A speed that changes faster than this, m/s^2, counts as missing."""
    coast: Positive = 1.0
    """Longest time without an accepted measurement, s; then the status is COASTING."""
    max_gap: Positive = 1.0
    """Longest gap between samples, s; after a longer gap the filter starts again."""
    gate: Positive = 6.0
    """Largest accepted innovation, in standard deviations."""
    restart_after: NonNegative = 0.1
    """Time for which most channels must be outside the gate (see `monitor`), s; then the filter restarts with a wide
    sigma."""
    max_nis: Positive = 4.0
    """Normalised innovation squared, 1 is expected, above which the status is INCONSISTENT."""
    nis_window: Positive = 1.0
    """Time constant of its average, s."""
    noise: Variances = field(default_factory=dict)
    """Noise variance of measured signals, SI squared; by default the article's R."""
    process_noise: NonNegative = 1.0
    """Factor of the process noise `filters.variances.OBSERVER_PROCESS_VARIANCE`, equation (14) of the article."""
    bank: Annotated[float, Limits(ge=0, lt=1), _RADIANS] = initial_sigma("bank.road")
    """Standard deviation of the bank of the road, rad; 0 if it is exact. Every sigma contains it."""
    bank_mean: Annotated[float, Limits(ge=-1, lt=1), _RADIANS] = 0.0
    """Mean of the bank of the road, rad, positive with the left edge higher."""
    steer_offset: Annotated[float, Limits(ge=0, lt=1), _RADIANS] = 0.01
    """Prior standard deviation of the offset of every steer angle about that of `sensor_errors`, rad. The observer
    estimates the offset; 0 if it is exact."""
    acceleration_offset: NonNegative = 0.3
    """The same for the offset of every lateral accelerometer, m/s^2. It contains gravity by the tilt of the mounting:
    1 deg gives 0.17 m/s^2."""
    wheel_speed_offset: NonNegative = 0.005
    """The same for the offset of every wheel speed difference, 1: the relative difference of the rolling radii."""
    surroundings: Mapping[str, InSI] = field(default_factory=dict)
    """Parameters that neither the vehicle file nor a sensor has, by name, such as "tyre.shape",
    "tractor.front.relative_friction", "semitrailer.softening" or "brakes.drive_axle"; by default those of
    `dynamics.all_parameters`."""
    tyres: ChosenTyres = "auto"
    """Law of the side forces: linear, saturating, an own function (`model.dynamics.tyres`), or auto: saturating with a
    friction, else linear."""
    roll: bool = True
    """Model roll if a signal contains it. False: yaw only, without signals that contain roll."""
    speed_smoothing: Positive = TIME_CONSTANT
    """Time constant of the derivative of the speed, s, from which braking is known to saturating tyres (see
    `model.dynamics.speed_rate`); longer for a noisier speed. Infinite: the speed changes slowly."""
    sensor_errors: Mapping[SensorErrorKey, InSI] = field(default_factory=dict)
    """Known offsets, gains and delays of sensors, such as "steer.tractor.front.offset"; none by default. The correction
    of a delay of the steer angle uses its slope, which amplifies its noise: use a smooth steer signal."""
    positions: Mapping[SignalKey, InSI] = field(default_factory=dict)
    """Position of a reported sideslip, x on the unit in m, such as "sideslip.semitrailer": -2.34 for a sensor at the
    landing legs; by default under the CoG."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.estimate_bank and not self.bank:
            raise SignalError("estimate_bank: expected a sigma of the bank above 0, got 0; give it as bank")
        for name, value in self.surroundings.items():
            positive = name in TYRES or ParameterPath.of(name).quantity in ("static_load", "relative_friction")
            least, largest = (0.0 if positive else -math.inf), 1.0 if name == DRIVE_AXLE_BRAKING else math.inf
            if not least <= value <= largest:
                raise SignalError(f"surroundings, {name}: expected {least:g} to {largest:g}, got {value:g}; correct it")
        if self.friction is None and self.tyre_law != "linear":
            raise SignalError("tyres: expected the friction of the road, got none; give it, or linear tyres")

    def offset_sigma(self, name: str) -> float:
        """Prior standard deviation of the offset of a steer angle, accelerometer or wheel speed difference, SI."""
        if is_of(name, WHEEL_SPEED_DIFFERENCE):
            return self.wheel_speed_offset
        return self.acceleration_offset if is_of(name, LATERAL_ACCELERATION) else self.steer_offset

    @property
    def tyre_law(self) -> Tyres:
        """Law of the side forces."""
        return self.tyres if self.tyres != "auto" else "linear" if self.friction is None else "saturating"
