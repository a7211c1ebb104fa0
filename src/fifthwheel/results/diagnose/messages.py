"""Cautions: their kinds, the sentences of each, and their order; causes first, and what they explain apart.

A row is a kind of caution with its sentences. The conditions are in `cautions` and `doubt_cautions`.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import NamedTuple

from fifthwheel.base.names import split_log
from fifthwheel.base.spelling import setting
from fifthwheel.data.channels import (
    LATERAL_ACCELERATION,
    PLACE_KINDS,
    SPEED,
    STEER,
    WHEEL_SPEED_DIFFERENCE,
    SensorErrorName,
    is_of,
)
from fifthwheel.data.checks.findings import Severity
from fifthwheel.estimate.identify.doubts import Doubt


class CautionKind(StrEnum):
    """Kinds of cautions."""

    SIGNAL = "signal"  # a fault of a signal that its samples show
    UNSTABLE = "unstable"  # the truck is unstable at the speed of the logs
    CONTRADICTION = "contradiction"  # a log differs from earlier ones, or from the identified truck
    ASSUMPTION = "assumption"  # the residuals contradict a number of the vehicle file or of a sensor
    MASS = "mass"  # masses of the vehicle file that are unusual for such a truck, or differ from that by the forces
    UNUSUAL_ESTIMATE = "unusual estimate"  # a stiffness or an inertia far from its prior mean
    DELAY = "delay"  # a significant or unusual delay of a sensor
    GAIN = "gain"  # an unusual gain of a sensor
    POSITION = "position"  # an unusual position of an accelerometer
    HEIGHT = "height"  # an unusual height of an accelerometer
    MISALIGNMENT = "misalignment"  # an unusual misalignment of a gyro
    LOAD_SENSITIVITY = "load_sensitivity"  # an unusual effect of the load transfer on wheel speeds
    PLAY = "play"  # an unusual play of the steering
    OFFSET = "offset"  # an unusual offset or another error of a sensor
    UNRELATED_CHANNEL = "unrelated channel"  # no relation to the motion of the truck
    POOR_FIT = "poor fit"  # the identified truck predicts the channel poorly
    REJECTED_SAMPLES = "rejected samples"  # many samples of a channel are outside the gate
    NONLINEAR_RANGE = "nonlinear range"  # a run beyond the range of the linear model
    WHEEL_LIFT = "wheel lift"  # the wheels of a side of an axle group leave the road
    LARGE_INNOVATIONS = "large innovations"  # of a state filter, larger than it expects


@dataclass(frozen=True)
class Caution:
    """One reason to doubt a result."""

    kind: CautionKind
    message: str  # what was estimated or measured, and what was expected
    cure: str  # what to do
    value: float  # the number that exceeds its threshold, SI
    severity: Severity = "warning"  # an error makes results wrong that depend on the signal; a warning is a doubt
    parameters: tuple[str, ...] = ()  # whose estimates it concerns
    signals: tuple[str, ...] = ()
    log: str | None = None

    def __str__(self) -> str:
        return f"{self.message} {self.cure}".rstrip()


ORDER = (
    CautionKind.SIGNAL,
    CautionKind.UNSTABLE,
    CautionKind.CONTRADICTION,
    CautionKind.DELAY,
    CautionKind.ASSUMPTION,
    CautionKind.UNRELATED_CHANNEL,
    CautionKind.MASS,
    CautionKind.WHEEL_LIFT,
    CautionKind.NONLINEAR_RANGE,
)
"""Kinds of causes, the one that explains most first. All other kinds are effects, unless no cause is present."""
INDEPENDENT = (CautionKind.MASS, CautionKind.WHEEL_LIFT, CautionKind.NONLINEAR_RANGE)
"""Causes that no other one explains, and that explain no other one."""


def ranked(cautions: Sequence[Caution], doubts: Sequence[Doubt] = ()) -> tuple[list[Caution], list[Caution]]:
    """The causes, the most important first, and the consequences: what the causes probably explain.

    A fault of a signal explains a contradiction, since it distorts all estimates. A delay that the samples show is the
    cause if the fits, which the doubts are from, name it too; otherwise the causes that they name explain it.
    """
    explained = set[CautionKind]()
    if any(c.kind is CautionKind.SIGNAL for c in cautions):
        explained = {CautionKind.ASSUMPTION, CautionKind.DELAY}
    elif any(c.kind is CautionKind.ASSUMPTION for c in cautions):
        late = {
            e.signal
            for d in doubts
            for c in d.causes
            if (e := SensorErrorName.of(split_log(c.name)[0])) and e.kind == "delay"
        }
        confirmed = any(c.kind is CautionKind.DELAY and late & {*c.signals} for c in cautions)
        explained = {CautionKind.ASSUMPTION if confirmed else CautionKind.DELAY}
    causes = [c for c in cautions if c.kind in ORDER and c.kind not in explained]
    effects = [c for c in cautions if c not in causes]
    if all(c.kind in INDEPENDENT for c in causes):
        causes, effects = [*causes, *effects], []
    return sorted(causes, key=_rank), effects


def _rank(caution: Caution) -> tuple[bool, int]:
    return caution.severity != "error", (*ORDER, caution.kind).index(caution.kind)


class CautionText(NamedTuple):
    """A row: a kind of caution, and its sentences with the names of their data in braces."""

    kind: CautionKind
    message: str
    cure: str = ""
    severity: Severity = "warning"

    def of(
        self,
        value: float = 0.0,
        /,
        *,
        log: str | None = None,
        parameters: tuple[str, ...] = (),
        signals: tuple[str, ...] = (),
        **data: object,
    ) -> Caution:
        """The caution with its data; `log` is a datum of the sentences too."""
        message, cure = (text.format(log=log, setting=_Settings(), **data) for text in (self.message, self.cure))
        return Caution(self.kind, message, cure, value, self.severity, parameters, signals, log)


class _Settings:
    """Settings in a sentence as the front end in use spells them: "{setting[tyres saturating]}"."""

    def __getitem__(self, words: str) -> str:
        name, _, value = words.partition(" ")
        return setting(name, *filter(None, [value]))


UNSTABLE = CautionText(
    CautionKind.UNSTABLE,
    "{truck} is unstable above {critical:.0f} km/h, and the logs reach {highest:.0f} km/h.",
    "{damper}Check the cornering stiffness, the masses and the axle positions of the vehicle file, or identify from "
    "prediction errors ({setting[form prediction-error]}).",
)
LOG_DIFFERS = CautionText(
    CautionKind.CONTRADICTION,
    "{log} differs from the earlier logs: {changes}. What this alters begins again there.",
    "New tyres, another pressure, another load or a sensor that was moved are possible. If nothing was changed, check "
    "{log}.",
)
LOG_SET_ASIDE = CautionText(
    CautionKind.CONTRADICTION,
    "{log} {reason}. It is set aside, and these estimates are of it alone.",
    "Check whether it is of this truck and trailer, and its signals; with another load, name it ({setting[load]}).",
)
VALIDATION_CONTRADICTS = CautionText(
    CautionKind.CONTRADICTION,
    "{log} (validation log) contradicts the identified truck: {changes}.",
    "Check whether it is of this truck and trailer with this load, and its signals.",
)
NOTHING_EXPLAINS = CautionText(
    CautionKind.ASSUMPTION,
    "The vehicle file or the signal map does not fit the logs: no single number of the file and no error of one sensor "
    "explains them.",
    "Check that the vehicle file is of this truck and trailer with this load: wheelbases, masses, steered axles. Then "
    "check column, unit and sign of each signal.",
)
WRONG_ASSUMPTION = CautionText(
    CautionKind.ASSUMPTION,
    "The logs contradict the vehicle file or an assumption on a sensor. {cause}.",
    "Check {these}, correct the vehicle file or the signal map, and identify again.{options}",
)
UNUSUAL_MASSES = CautionText(CautionKind.MASS, "{masses}.")
UNUSUAL_ESTIMATE = CautionText(
    CautionKind.UNUSUAL_ESTIMATE,
    "{parameter} is {ratio} times its prior value, whose sigma is ±{prior}.",
    "Check masses, axle positions and the steer angle. Confirm the estimate with another log.",
)
UNRELATED_CHANNEL = CautionText(
    CautionKind.UNRELATED_CHANNEL,
    "{place}: speed and steer angle explain almost none of this channel.",
    "Check that the column is mapped to the right signal. Do not use results that depend on it.",
    "error",
)
POOR_FIT = CautionText(
    CautionKind.POOR_FIT,
    "{place}: the model explains {explained} of the variance; residual {rms} rms{noise}.",
    "Check sign, unit and position of the sensor, and the vehicle file.",
)
REJECTED_SAMPLES = CautionText(
    CautionKind.REJECTED_SAMPLES,
    "{signal} in {log}: the {stage} rejected {fraction} of the samples as outliers, because their innovation is larger "
    "than the gate.",
    "Check the channel for spikes; if it has none, the vehicle file or the identified vehicle is wrong.",
)
NONLINEAR_RANGE = CautionText(
    CautionKind.NONLINEAR_RANGE,
    "{log}: the lateral acceleration reaches {acceleration:.1f} m/s². The model of tyres and suspensions is linear, "
    "which holds up to about {limit:g} m/s².",
    "Use tyres that saturate ({setting[tyres saturating]}), or a log with a smaller lateral acceleration.",
)
WHEEL_LIFT = CautionText(
    CautionKind.WHEEL_LIFT,
    "{log}: a wheel of {group} lifts at {time:.1f} s, where the load transfer ratio exceeds {limit}; it reaches "
    "{largest:.2f}. In the model no wheel lifts.",
    "Do not rely on what follows: end the log there, with stop in [time] of signals.toml.",
)
LARGE_INNOVATIONS = CautionText(
    CautionKind.LARGE_INNOVATIONS,
    "{log}: the rms of the normalised innovations is above 1: {channels}. The {blamed} or the assumed noise is wrong, "
    "and the sigma of the states may be too small.",
    "Check the vehicle file against this truck, and the noise of these channels.",
)
LARGE_INNOVATIONS_OF_A_FILE = LARGE_INNOVATIONS._replace(
    cure="Check the vehicle file, or identify this truck from {log}. If the vehicle file comes from an identification, "
    "also give its identification.json (-i); it contains the sensor errors."
)


class SensorErrorWords(NamedTuple):
    """A row: the sentences on a kind of sensor error, with the names of their data in braces."""

    caution: str
    """What is unusual, behind the name of the signal."""
    cure: str
    cause: str = "the {kind} of {signal} is {difference} {larger}"
    """What contradicts the logs."""


_PLACE = SensorErrorWords(
    "the estimated {kind} is {value}; {expected} is expected.",
    "Check the {kind} of the accelerometer in the vehicle file, and which point the signal belongs to.",
)
_DELAY = SensorErrorWords(
    "the estimated delay of {value} is unusual. If it is wrong, the stiffness estimates are wrong too.",
    "Check the delay. If all channels have a common time base, set the prior sigma of the delay to 5 ms "
    "({setting[statements steer.*.delay=+- 5 ms]}) and identify again.",
    "{signal} is {size} {late}",
)
_OTHER = SensorErrorWords(
    "the estimated {kind} is {value}, more than such a sensor usually has.",
    "Check the mounting and the calibration of the sensor.",
)
SENSOR_ERRORS: Mapping[str, SensorErrorWords] = {
    "delay": _DELAY,
    "delay of a filtered signal": _DELAY._replace(
        caution="the estimated delay is {value}.",
        cure="Check its timestamps, or set its delay in the signal map.",
    ),
    "gain": SensorErrorWords(
        "the estimated gain is {value}; 1 is expected.",
        "Check the unit, calibrate the sensor, and correct its gain in the signal map.",
        "{signal} is {factor} times the true value",
    ),
    "gain of a steer angle": SensorErrorWords(
        "the road wheels turn by {value} times the logged angle. A wrong steering ratio has the same effect as wrong "
        "tyre stiffnesses, so the stiffness estimates depend on this gain.",
        "Measure the ratio of the road-wheel angle to the logged angle, and correct it in the signal map.",
        "the road wheels turn by {factor} times {signal}",
    ),
    "offset": _OTHER._replace(cause="{signal} has an offset of {value}"),
    "play": SensorErrorWords(
        "the estimated play between this angle and the road wheels is {value}.",
        "Check the steering linkage, or measure the angle at the wheels.",
    ),
    "misalignment": SensorErrorWords(
        "the estimated misalignment is {value}: the gyro also measures another axis.",
        "Check how the gyro is mounted, and whether its axes are exchanged.",
        "the gyro of {signal} is turned by {size}, so that it measures another axis too",
    ),
    "load_sensitivity": SensorErrorWords(
        "the estimated load sensitivity is {value}: wheel speeds change with the load transfer.",
        "Check that both wheel speeds are of the same axle, and the tyre pressures.",
    ),
    **dict.fromkeys(PLACE_KINDS, _PLACE),
}
"""By the kind of an error; two kinds depend on the signal too."""


def is_filtered(signal: str) -> bool:
    """Whether a signal is filtered, so that it is always late."""
    return is_of(signal, SPEED, LATERAL_ACCELERATION, WHEEL_SPEED_DIFFERENCE)


def sensor_error_words(signal: str, kind: str) -> SensorErrorWords:
    """The row of an error of a signal."""
    if kind == "delay" and is_filtered(signal):
        kind = "delay of a filtered signal"
    elif kind == "gain" and is_of(signal, STEER):
        kind = "gain of a steer angle"
    return SENSOR_ERRORS.get(kind, _OTHER)
