"""Learning while driving: parameters for each trailer, and a change of load or trailer that nobody reports.

Load and trailer can change only at a standstill. After one, a second learner begins with the tractor's estimates and
the priors of the trailer, beside the first one, which continues. If the two disagree, the vehicle has changed: the
second one takes over, and the estimates from before the standstill are kept under their name. If they agree, the second
one ends.
"""

import copy
import math
from collections.abc import Mapping

from fifthwheel.apps.live.status import LiveFault
from fifthwheel.estimate.identify.doubts import DoubtKind
from fifthwheel.estimate.identify.verdict import Verdict
from fifthwheel.estimate.online import LearnedValue, Learner
from fifthwheel.estimate.stream import VALID, Status
from fifthwheel.truck import Vehicle
from fifthwheel.truck.spoken_names import named

STANDSTILL = 60.0
"""After this time without a valid state, s, load or trailer may have changed."""
PERIOD = 1.0
"""Time between two looks at the estimates, s."""
SIGNIFICANT = 5.0
"""Standard deviations of the difference of two estimates that show a change."""
CONFIRMED_BY = 3
"""Consecutive looks that must show it."""
RELEVANT = 0.15
"""Fraction of a parameter below which a difference is no change."""
INFORMED = 0.5
"""The second learner ends when it would have found a change of every parameter by this fraction."""
REPORTED = 60.0
"""A change is reported as a fault for this time, s."""

_KNOWN = (Verdict.CONVERGED, Verdict.DOUBTFUL)
_WRONG = (Verdict.DOUBTFUL, Verdict.AT_BOUND)


class Learning:
    """An estimator for a node: states and parameters of the coupled trailer.

    `vehicle` is that of every trailer that is coupled. With `restored`, the estimates are from an earlier run; load or
    trailer may have changed since.
    """

    def __init__(self, learner: Learner, vehicle: Vehicle, *, restored: bool = False) -> None:
        self.learner, self.vehicle = learner, vehicle
        self.learned = 0
        """Samples from which it learned."""
        self.change = ""
        """The last change, as a sentence; empty before the first one."""
        self.parameters: tuple[LearnedValue, ...] = learner.parameters
        """The estimates, at most `PERIOD` old."""
        self._before: Learner | None = None  # as before the standstill
        self._second: Learner | None = None
        self._compared: dict[str, float] = {}  # magnitudes of the trailer's parameters before the standstill
        self._disagreed = 0
        self._valid = -math.inf if restored else math.nan  # time of the last valid state, s
        self._looked, self._changed = -math.inf, -math.inf

    @property
    def faults(self) -> LiveFault:
        """`LiveFault.CHANGED` for some time after a change."""
        return LiveFault.CHANGED if self._looked - self._changed < REPORTED else LiveFault.NONE

    def reset(self) -> None:
        """A learner starts its states again by itself."""

    def push(self, sample: Mapping[str, float | None]) -> dict[str, float]:
        """The states at a sample; see `Learner.push`. They are INCONSISTENT also while an estimate is doubtful."""
        answer = self.learner.push(sample)
        time = answer["time"]
        if self._second is not None:
            self._second.push(sample)
        if answer["status"] in VALID:
            if time - self._valid > STANDSTILL:
                self._begin()
            self._valid = time
        elif math.isnan(self._valid):
            self._valid = time
        self.learned += answer["learning"] > 0
        if not time - self._looked < PERIOD:
            self._looked = time
            self.parameters = self.learner.present_parameters
            if self._before is not None and self._second is not None:
                self._compare(self._before, self._second)
        if answer["status"] == Status.OK and any(e.verdict in _WRONG for e in self.parameters):
            answer["status"] = Status.INCONSISTENT
        return answer

    def couple(self, trailer: str) -> None:
        """Another trailer is coupled, or one from before; nothing happens if it is coupled already."""
        if trailer == self.learner.trailer:
            return
        self.learner.couple(trailer, self.vehicle)
        self._before = self._second = None
        self.parameters = self.learner.parameters
        self.change = f"trailer {trailer} coupled"

    def _begin(self) -> None:
        """Begin the second learner, if there is something to compare it with."""
        tractor = self.vehicle.units[0].name
        known = [e for e in self.learner.parameters if e.verdict in _KNOWN]
        self._compared = {e.name: abs(e.value) for e in known if not e.name.startswith(f"{tractor}.")}
        self._second, self._disagreed = None, 0
        if self._compared:
            self._before, self._second = copy.copy(self.learner), copy.copy(self.learner)
            self._second.couple(_next_name(self.learner.trailer), self.vehicle)

    def _compare(self, before: Learner, second: Learner) -> None:
        changes = {name: change for name, change in second.change_since(before).items() if name in self._compared}
        moved = {
            name: difference / self._compared[name]
            for name, (difference, sigma) in changes.items()
            if abs(difference) > max(SIGNIFICANT * sigma, RELEVANT * self._compared[name])
        }
        informed = all(SIGNIFICANT * sigma < INFORMED * self._compared[name] for name, (_, sigma) in changes.items())
        unlikely = informed and _inconsistent(self.learner) and not _inconsistent(second)
        self._disagreed = self._disagreed + 1 if moved or unlikely else 0
        if self._disagreed >= CONFIRMED_BY:
            words = ", ".join(f"{named(name)} by {fraction:+.0%}" for name, fraction in moved.items())
            self.change = f"load or trailer changed ({words or 'innovations'}); learning as {second.trailer!r}"
            self.learner, self._before, self._second, self._changed = second, None, None, self._looked
            self.parameters = second.parameters
        elif informed and not self._disagreed:
            self._before = self._second = None


def _inconsistent(learner: Learner) -> bool:
    return any(doubt.kind is DoubtKind.NOISE for doubt in learner.doubts)


def _next_name(trailer: str) -> str:
    """Name of the next load of a trailer: "depot 12" -> "depot 12 (load 2)"."""
    name, _, count = trailer.removesuffix(")").partition(" (load ")
    return f"{name} (load {int(count) + 1 if count.isdigit() else 2})"
