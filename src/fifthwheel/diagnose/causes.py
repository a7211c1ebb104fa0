"""The cause first: cautions in order, those that another one explains apart."""

from collections.abc import Sequence

from fifthwheel.channels import SensorErrorName
from fifthwheel.diagnose.caution import Caution, CautionKind
from fifthwheel.identify.doubts import Doubt
from fifthwheel.names import split_log

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
    place = ORDER.index(caution.kind) if caution.kind in ORDER else len(ORDER)
    return caution.severity != "error", place
