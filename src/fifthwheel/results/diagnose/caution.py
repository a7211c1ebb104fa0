"""A caution: one reason to doubt a result, and what to do; causes first, and what they explain apart."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

from fifthwheel.base.names import split_log
from fifthwheel.data.channels import SensorErrorName
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
