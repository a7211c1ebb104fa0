"""Learning while driving: parameters for each trailer, and a change of load or trailer that nobody reports.

Load and trailer can change only at a standstill. After one, a second learner begins with the tractor's estimates and
the priors of the trailer, beside the first one, which continues. If the two disagree, the vehicle has changed: the
second one takes over, and the estimates from before the standstill are kept under their name. If they agree, the second
one ends.
"""

import copy
import math
from collections.abc import Mapping

from fifthwheel.identify.doubts import DoubtKind
from fifthwheel.identify.online import LearnedValue, Learner
from fifthwheel.identify.verdict import Verdict
from fifthwheel.live.status import Fault
from fifthwheel.observe import Status
from fifthwheel.vehicle import Vehicle

STANDSTILL = 60.0
"""After this time without a valid state, s, load or trailer may have changed."""
PERIOD = 1.0
"""Time between two looks at the estimates, s."""
SIGNIFICANT = 5.0
"""Standard deviations between two independent estimates of a parameter that show a change."""
CONFIRMED_BY = 3
"""Consecutive looks that must show it."""
INFORMED = 2.0
"""The second learner knows enough when no sigma is larger than so many times that of the first one."""
REPORTED = 60.0
"""A change is reported as a fault for this time, s."""

_VALID = (Status.OK, Status.COASTING, Status.INCONSISTENT)
_KNOWN = (Verdict.CONVERGED, Verdict.DOUBTFUL)


class Learning:
    """An estimator for a node: states and parameters of the coupled trailer.

    Args:
        learner: with its estimates so far.
        vehicle: of every trailer that is coupled.
        restored: the estimates are from an earlier run; load or trailer may have changed since.
    """

    def __init__(self, learner: Learner, vehicle: Vehicle, *, restored: bool = False) -> None:
        self.learner, self.vehicle = learner, vehicle
        self.learned = 0
        """Samples from which it learned."""
        self.change = ""
        """The last change, as a sentence; empty before the first one."""
        self.parameters: tuple[LearnedValue, ...] = learner.parameters
        """The estimates, at most `PERIOD` old."""
        self._reference: dict[str, LearnedValue] = {}  # estimates before the standstill
        self._second: Learner | None = None
        self._disagreed = 0
        self._valid = -math.inf if restored else math.nan  # time of the last valid state, s
        self._looked, self._changed = -math.inf, -math.inf

    @property
    def faults(self) -> Fault:
        """`Fault.CHANGED` for some time after a change."""
        return Fault.CHANGED if self._looked - self._changed < REPORTED else Fault.NONE

    def reset(self) -> None:
        """A learner starts its states again by itself."""

    def push(self, sample: Mapping[str, float | None]) -> dict[str, float]:
        """The states at a sample; see `Learner.push`."""
        answer = self.learner.push(sample)
        time = answer["time"]
        if self._second is not None:
            self._second.push(sample)
        if answer["status"] in _VALID:
            if time - self._valid > STANDSTILL:
                self._begin()
            self._valid = time
        elif math.isnan(self._valid):
            self._valid = time
        self.learned += answer["learning"] > 0
        if not time - self._looked < PERIOD:
            self._looked = time
            self.parameters = self.learner.parameters
            if self._second is not None:
                self._compare(self._second)
        return answer

    def couple(self, trailer: str) -> None:
        """Another trailer is coupled, or one from before; nothing happens if it is coupled already."""
        if trailer == self.learner.trailer:
            return
        self.learner.couple(trailer, self.vehicle)
        self._second = None
        self.parameters = self.learner.parameters
        self.change = f"trailer {trailer} coupled"

    def _begin(self) -> None:
        """Begin the second learner, if there is something to compare it with."""
        tractor = self.vehicle.units[0].name
        known = [e for e in self.learner.parameters if e.verdict in _KNOWN]
        self._reference = {e.name: e for e in known if not e.name.startswith(f"{tractor}.")}
        self._second, self._disagreed = None, 0
        if self._reference:
            self._second = copy.copy(self.learner)
            self._second.couple(_next_name(self.learner.trailer), self.vehicle)

    def _compare(self, second: Learner) -> None:
        estimates = {e.name: e for e in second.parameters}
        compared = [(old, estimates[name]) for name, old in self._reference.items()]
        moved = [
            (old, new)
            for old, new in compared
            if new.verdict in _KNOWN and abs(new.value - old.value) > SIGNIFICANT * math.hypot(new.sigma, old.sigma)
        ]
        unlikely = _inconsistent(self.learner) and not _inconsistent(second)
        informed = all(new.sigma <= INFORMED * old.sigma for old, new in compared)
        self._disagreed = self._disagreed + 1 if moved or (unlikely and informed) else 0
        if self._disagreed >= CONFIRMED_BY:
            names = ", ".join(f"{old.name} {old.value:.4g} -> {new.value:.4g}" for old, new in moved)
            self.change = f"load or trailer changed ({names or 'innovations'}); learning as {second.trailer!r}"
            self.learner, self._second, self._changed = second, None, self._looked
            self.parameters = second.parameters
        elif informed and not self._disagreed:
            self._second = None


def _inconsistent(learner: Learner) -> bool:
    """Whether the innovations contradict the estimates."""
    return any(doubt.kind is DoubtKind.NOISE for doubt in learner.doubts)


def _next_name(trailer: str) -> str:
    """Name of the next load of a trailer: "depot 12" -> "depot 12 (load 2)"."""
    name, _, count = trailer.removesuffix(")").partition(" (load ")
    return f"{name} (load {int(count) + 1 if count.isdigit() else 2})"
