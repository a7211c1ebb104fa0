"""Sensors: classes of them with the usual size of their errors, and what a user states of one."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from math import radians
from typing import Annotated, Self

from fifthwheel.base.errors import SignalError, suggestion
from fifthwheel.base.settings import Cure, Finite, FiniteNonNegative, FinitePositive, Settings
from fifthwheel.data.channels import IDENTIFIED, WEIGHTS, SignalName, error_kinds, is_of

Errors = Annotated[
    Mapping[str, tuple[Finite, FiniteNonNegative | None]], Cure("give a prior mean and a standard deviation, or None")
]


@dataclass(frozen=True, kw_only=True)
class SensorClass:
    """Prior standard deviations of the errors of a kind of sensor, SI."""

    gain: float
    delay: float
    misalignment: float = 0.0
    """Of gyros."""
    play: float = 0.0
    """Of steer angles."""
    offset: Mapping[str, float]
    """By quantity; the class has these quantities."""
    noise: Mapping[str, float] = field(default_factory=dict)
    """Standard deviation of the noise by quantity, in a driving truck: its vibration is part of it."""

    def sigma(self, signal: str, kind: str) -> float | None:
        """The standard deviation of an error or of the noise of a signal, SI; None where the class does not say."""
        found = getattr(self, kind, None)
        return found.get(SignalName.of(signal).quantity) if isinstance(found, Mapping) else found


SENSOR_CLASSES: Mapping[str, SensorClass] = {
    # Ratio of the steering gear over its travel, and wind-up of the column: 3 to 5 %, 50 ms. Play of a sound gear and
    # linkage: 0.2 deg at the wheels. Offset: the steering wheel straightened by eye, 10 deg of its angle.
    "steering wheel": SensorClass(gain=0.04, delay=0.05, play=radians(0.2), offset={"steer": 0.01}),
    # A sensor on the kingpin measures behind gear and play; toe and the mean of both wheels remain: 1 to 2 %. Delay:
    # the filter of the sensor and a CAN cycle.
    "wheel angle": SensorClass(gain=0.015, delay=0.02, play=0.0, offset={"steer": 0.005}),
    # The gyro of the stability control on SAE J1939, PGN 61449: gain 2 to 3 %, latency of filter, control unit and
    # cycle 20 to 30 ms. Its noise is that of the article's gyros. The other numbers are the defaults of one stage.
    "vdc2": SensorClass(
        gain=0.025,
        delay=0.025,
        misalignment=radians(1),
        offset={"yaw_rate": 0.004, "lateral_acceleration": 0.3},
        noise={"yaw_rate": radians(0.2), "lateral_acceleration": 0.2},
    ),
    # A calibrated MEMS unit on a bracket: gain 0.5 to 1 %, bracket square to 1 deg, latency of its filter 10 ms.
    # Bias over temperature 0.25 deg/s; of the accelerometer 10 mg and 1 deg of tilt. Noise: mostly vibration.
    "mems": SensorClass(
        gain=0.0075,
        delay=0.01,
        misalignment=radians(1),
        offset={"yaw_rate": 0.004, "roll_rate": 0.004, "lateral_acceleration": 0.2},
        noise={"yaw_rate": radians(0.15), "roll_rate": radians(0.5), "lateral_acceleration": 0.2},
    ),
    # An inertial navigation system estimates its biases; 0.02 deg/s is ten times those of data sheets. It is aligned to
    # 0.3 deg, which is also the tilt in the offset of the acceleration. Gain 0.1 %, latency 5 ms. Noise: vibration.
    "ins": SensorClass(
        gain=0.001,
        delay=0.005,
        misalignment=radians(0.3),
        offset={"yaw_rate": radians(0.02), "roll_rate": radians(0.02), "lateral_acceleration": 0.05},
        noise={"yaw_rate": radians(0.1), "roll_rate": radians(0.4), "lateral_acceleration": 0.15},
    ),
}
"""By the name in signals.toml. Where the comment gives no other source, the number is engineering judgement."""


def fitting_classes(quantity: str) -> list[str]:
    """The classes of sensors of a quantity."""
    return [name for name, kind in SENSOR_CLASSES.items() if quantity in kind.offset]


@dataclass(frozen=True, kw_only=True)
class SensorPrior(Settings):
    """What is stated of the sensor of a signal, beyond what its log is corrected by.

    Raises:
        SignalError: a number is not possible.

    Example:
        >>> import fifthwheel as fw
        >>> gyro = fw.SensorPrior(sensor_class="mems", errors={"gain": (1.0, 0.002)})
        >>> record = fw.Record(time=[0, 1], signals={"yaw_rate.tractor": [0, 0]}, sensors={"yaw_rate.tractor": gyro})
        >>> print(record.cut().sensors["yaw_rate.tractor"])
        mems, gain 1 +- 0.002
    """

    sensor_class: str = ""
    """One of `SENSOR_CLASSES`, which gives the standard deviations that are not stated; empty for none."""
    errors: Errors = field(default_factory=dict)
    """Prior mean and standard deviation by kind of error, SI; without the latter, that of the class or of the settings.
    An ideal sensor has a gain of 1, and 0 for all others."""
    noise: FinitePositive | None = None
    """Standard deviation of the noise, SI."""

    def __str__(self) -> str:
        errors = [f"{kind} {m:g}{'' if s is None else f' +- {s:g}'}" for kind, (m, s) in self.errors.items()]
        noise = [] if self.noise is None else [f"noise {self.noise:g}"]
        return ", ".join([self.sensor_class or "no class", *errors, *noise])

    @classmethod
    def loads(cls, text: str) -> Self:
        """The sensor of a text that `dumps` gives; a SignalError where it is another text."""
        try:
            fields = json.loads(text)
            return cls(**{**fields, "errors": {kind: tuple(error) for kind, error in fields["errors"].items()}})
        except (AttributeError, KeyError, RecursionError, TypeError, ValueError) as error:
            raise SignalError(f"expected the statements on a sensor, got {text[:80]!r} ({error})") from None

    def dumps(self) -> str:
        """The sensor as a text, for a file."""
        return json.dumps(self.as_dict())

    def updated(self, other: "SensorPrior") -> "SensorPrior":
        """The sensor with what the other one states."""
        return SensorPrior(
            sensor_class=other.sensor_class or self.sensor_class,
            errors={**self.errors, **other.errors},
            noise=self.noise if other.noise is None else other.noise,
        )

    def require_fits(self, signal: str) -> None:
        """Refuse what no estimation uses.

        Raises:
            SignalError: the signal has no such error or noise, or no such class of sensors.
        """
        kinds = ("gain",) if is_of(signal, *WEIGHTS) else error_kinds(signal)
        known = (*kinds, "noise") if is_of(signal, *IDENTIFIED) else kinds
        for key in (*self.errors, *(() if self.noise is None else ("noise",))):
            if key not in known:
                cure = f"remove {key}" if key in ("misalignment", "play", "noise") else f"remove the '+-' of its {key}"
                expected = f"expected {', '.join(known)}" if known else "no error of this signal is estimated"
                raise SignalError(f"{signal}: {key}: no identification uses its uncertainty, {expected}; {cure}")
        if self.errors.get("play", (0.0, None))[0] < 0:
            raise SignalError(f"{signal}: play: expected 0 or more; give its magnitude")
        quantity = SignalName.of(signal).quantity
        fitting = fitting_classes(quantity)
        if self.sensor_class and self.sensor_class not in fitting:
            cure = suggestion(self.sensor_class, fitting) if fitting else "no class has this quantity; remove it"
            raise SignalError(f"{signal}: sensor: expected a class of {quantity}, got {self.sensor_class!r}; {cure}")

    def usual_sigma(self, signal: str, kind: str) -> float | None:
        """The standard deviation of an error or of the noise by the class, SI; None where there is none."""
        known = SENSOR_CLASSES.get(self.sensor_class)
        return known.sigma(signal, kind) if known else None
