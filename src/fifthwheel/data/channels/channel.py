"""`Channel`: everything that the package knows of one measured or computed quantity. The names of signals."""

from collections.abc import Callable, Collection, Mapping
from dataclasses import KW_ONLY, dataclass, field
from functools import lru_cache, partial
from typing import Any, Literal, NamedTuple, Self

import numpy as np

from fifthwheel.base.types import Array

Symbol = Any
"""A symbolic expression (`casadi.SX`)."""
Instant = Any
"""What a model provides at one instant, symbolic: `model.dynamics.sensors.SensorInputs`."""


class SignalName(NamedTuple):
    """The parts of a signal's name, quantity.unit[.part]; signals are in SI and ISO 8855 (y left, z up).

    >>> SignalName.of("steer.tractor.front")
    SignalName(quantity='steer', unit='tractor', part='front')
    """

    quantity: str
    unit: str
    """Empty for a signal of the whole vehicle."""
    part: str
    """Axle or axle group, or which of several sensors of the quantity on a unit; may hold several words, such as
    "front.left"; empty where the name has none."""

    @classmethod
    @lru_cache(maxsize=4096)
    def of(cls, name: str) -> Self:
        """Parse a name; any text is accepted."""
        quantity, _, place = name.partition(".")
        unit, _, part = place.partition(".")
        return cls(quantity, unit, part)

    def fits(self, units: Collection[str]) -> bool:
        """Whether it is a signal of one of the units, or of the whole vehicle."""
        return self.unit in ("", *units)

    @property
    def place(self) -> str:
        """Unit and part: "tractor.front"."""
        return f"{self.unit}.{self.part}" if self.part else self.unit


@dataclass(frozen=True, kw_only=True)
class SensorModel:
    """What a sensor measures, as an expression of the motion; without the errors of the sensor."""

    value: Callable[[Instant, int, str], Symbol]
    """From the instant, the index of the unit and the name of the signal, SI."""
    has_place: bool = False
    """Whether it depends on the place of the sensor: parameters <signal>.position, x on the unit, and <signal>.height
    above the ground, m."""
    rate: Callable[[Instant, int, Symbol], Symbol] | None = None
    """Derivative of the value with respect to time, for the delay of a sensor; None: such a sensor has no delay."""
    sensitivities: Mapping[str, Callable[[Instant, int, str], Symbol]] = field(default_factory=dict)
    """What it measures too, by the kind of the error that is its factor: the misalignment of a gyro."""
    needs_track: bool = False
    """Whether it depends on the half track, `Instant.half_track`."""
    behind_coupling: bool = False
    """Whether only units behind a coupling have the quantity."""
    needs_roll: bool = False
    """Whether only the yaw-roll model has the quantity."""


@dataclass(frozen=True, kw_only=True)
class SignalLimits:
    """What a heavy vehicle can do, SI."""

    magnitude: float
    """Never exceeded."""
    jump: float
    """Never exceeded within 0.1 s; a larger change is a spike."""
    turn: float = np.inf
    """Change within a second that distinguishes a turn from straight-line driving."""
    may_be_constant: bool = False
    """Whether the value may be constant in a turn."""


class Turn(NamedTuple):
    """The motion of a vehicle at N regular instants, from its speed and the yaw rate of the leading unit."""

    speed: Array
    """(N,) m/s"""
    yaw_rate: Array
    """(N,) rad/s, of the leading unit."""
    own_yaw_rate: Array
    """(N,) rad/s, of the unit of the signal, if it is measured."""
    is_towed: bool
    """Whether the unit of the signal is not the leading one."""
    towed_length: float
    """m, typical, of a towed unit from coupling to axles."""
    wheelbase: float
    """m, of the leading unit."""
    step: float
    """s"""

    @property
    def towed_yaw_rate(self) -> Array:
        """(N,) rad/s, of a typical towed unit: L/u r2' + r2 = r."""
        return self.lagged(self.yaw_rate, self.towed_length / self.speed)

    @property
    def unit_yaw_rate(self) -> Array:
        """(N,) rad/s, expected of the unit of the signal."""
        return self.towed_yaw_rate if self.is_towed else self.yaw_rate

    def lagged(self, values: Array, time_constant: Array | float) -> Array:
        """First-order lag of values (N,) with a time constant, (N,) or one, s."""
        state, result = float(values[0]), np.empty(values.size)
        weights = np.broadcast_to(self.step / (time_constant + self.step), values.size)
        for k, (value, weight) in enumerate(zip(values.tolist(), weights.tolist(), strict=True)):
            state += weight * (value - state)
            result[k] = state
        return result


class GainFault(NamedTuple):
    """A fault that a ratio of the signal to the expected one between two numbers indicates."""

    fault: str
    """One of `checks.Fault`."""
    above: float
    below: float
    if_excited: bool = False
    """Whether both must vary clearly."""


DEGREES = (GainFault("degrees", -1, 1 / 20), GainFault("degrees", 20, np.inf))
"""A gain below 1 means that the leading yaw rate is in degrees."""


@dataclass(frozen=True, kw_only=True)
class TurnRelation:
    """How a signal follows from the leading yaw rate in a turn, and which deviations from it are faults."""

    expected: Callable[[Turn], Array]
    """The signal (N,), SI."""
    least_sigma: float
    """Standard deviation above which the signal shows turns and not only noise, SI."""
    gain_faults: tuple[GainFault, ...]
    """The first that applies counts, if both are correlated."""
    largest_offset: float = np.inf
    """Offset above which a warning is given, SI."""
    longest_lead: float = np.inf
    """s; a signal that leads the expected one by more is that of another unit."""
    lag: float = 0.0
    """s, by which the expected signal lags this one."""
    part: str | None = None
    """The part of a unit to which the relation applies; None for all."""
    has_other_causes: bool = False
    """Whether more than turns excites the signal: then only an inverted sign and a wrong gain are faults."""
    derivative: bool = False
    """Whether the expected value is that of the derivative of the signal."""
    sign_only: bool = False
    """Whether only an inverted sign is a fault, of a signal of the expected size that no delay explains as well: it may
    be as small as its noise, and nothing else finds its delay."""


@dataclass(frozen=True, kw_only=True)
class Exchange:
    """When the same quantity of two units counts as exchanged."""

    margin: float
    """Least gain in the logarithm of the residual variances, summed over both channels."""
    least_explained: float
    """Least fraction of the variance of each channel that the prediction of the other one explains."""


@dataclass(frozen=True, kw_only=True)
class StateNoise:
    """Noise of a quantity that is a state of the model, SI."""

    process: float
    """Variance per second of the process noise, for the estimation of parameters."""
    observer_process: float
    """The same for the observation of states: equation (14) of Cheng and Cebon (2011), 1e-8 rad^2 per step of 10 ms,
    with sideslip converted to lateral velocity."""
    initial_sigma: float
    """Standard deviation about the steady value at the first sample, without steering."""


@dataclass(frozen=True, kw_only=True)
class ErrorKind:
    """One kind of error of a sensor, <signal>.<kind>, which an identification estimates."""

    kind: str
    """Such as "offset", "gain" or "delay"; "position" and "height" are those of the place of the sensor."""
    unit: str = ""
    """SI; empty for that of the channel."""
    prior: float
    """Prior standard deviation, SI, where neither a user nor the class of the sensor states another one."""
    per_log: bool = False
    """Whether each log has its own."""
    positive: bool = False
    """Whether it is not below 0."""
    uncertain: bool = False
    """Whether it counts as a part of the model: a learner keeps it at its prior mean."""
    gross: float = 0.0
    """Standard deviation of a gross error, SI, such as a gain of another unit; 0 if it is not usual."""
    weight: float = 1.0
    """How common a gross error is, relative to others."""
    linear: bool = True
    """Whether its effect on the signals is a part that is linear in the steer angle, or independent of it; a delay acts
    through the slope of a spline, so that of a signal that follows the steer angle at once is not."""

    @property
    def ideal(self) -> float:
        """Its value for a sensor without errors."""
        return 1.0 if self.kind == "gain" else 0.0


GAIN = partial(ErrorKind, kind="gain", unit="1", gross=0.4, weight=2.0)
DELAY = partial(ErrorKind, kind="delay", unit="s", gross=0.3, weight=2.0)


@dataclass(frozen=True)
class NamePattern:
    """A regular expression for names of columns, in small letters with "_" before, between and after the words."""

    pattern: str
    _: KW_ONLY
    excluded: str = ""
    """What must not occur in the name."""
    own: str = ""
    """Words of the quantity that elsewhere belong to other channels, such as torque."""
    part: str = ""
    """The part of the signal that such a name has."""
    generic: bool = False
    """Whether it is tried only after the patterns of all channels, because other names contain it too."""


def named(pattern: str, **options: Any) -> tuple[NamePattern]:
    """The only pattern of a channel; `options` are fields of `NamePattern`."""
    return (NamePattern(pattern, **options),)


@dataclass(frozen=True, kw_only=True, eq=False)
class Channel:
    """One quantity."""

    quantity: str
    """First word of the names of its signals, quantity.unit[.part]."""
    unit: str
    """SI unit."""
    of: Literal["vehicle", "unit", "part"] = "unit"
    """What has the quantity: the whole vehicle, a unit, or an axle or axle group of a unit. A unit may have several
    sensors; then their names differ by the part."""
    patterns: tuple[NamePattern, ...] = ()
    """Of names of columns in English and German."""
    proposed: Literal["signal", "reference"] | None = None
    """Whether a proposed signal map has it, and where."""
    percent: Literal["fraction", "reference"] | None = None
    """What a column in % is: a fraction, or relative to a reference value that the log does not have."""
    limit: SignalLimits | None = None
    turn: TurnRelation | None = None
    noise: tuple[float, float] | None = None
    """Variance of a sensor's noise on the first unit, and on the units behind it, SI squared."""
    discrepancy: float = 0.0
    """Standard deviation of the part of the signal that the linear model does not describe, SI, with the time constant
    of some seconds: of the nonlinear truck (`plant`) in everyday driving, by the noise model that an identification
    fits (`estimate.filters.noise_model`)."""
    shows_clock: bool = False
    """Whether the drift of its clock is measured (`estimate.time_bases.findings`)."""
    large_offset: bool = False
    """Whether its offset is large, and its noise different on every truck. The offset would decide if nothing else were
    measured, so observers estimate it, and use the channel only beside others."""
    scale: float | None = None
    """Standard deviation of the scale of a sensor that weighs, as a fraction; the signal map may state another one."""
    of_roll: bool = False
    """Whether it contains the roll of the body: an observer then uses the yaw-roll model. An uneven road moves it on a
    vehicle that drives straight."""
    exchange: Exchange | None = None
    state: StateNoise | None = None
    model: SensorModel | None = None
    true_value: Callable[[Symbol, Mapping[str, Symbol]], Symbol] = lambda measured, _: measured
    """Of a steer angle: the true one from the measured one and the errors of its sensor by kind. It increases with the
    measured one, from which it subtracts the offset. A delay is corrected before, a play afterwards."""
    errors: tuple[ErrorKind, ...] = ()
    """Of its sensors, in the order in which they are estimated."""

    def __repr__(self) -> str:
        return f"Channel({self.quantity!r})"

    def error(self, kind: str) -> ErrorKind | None:
        """The kind of error with this name."""
        return next((error for error in self.errors if error.kind == kind), None)
