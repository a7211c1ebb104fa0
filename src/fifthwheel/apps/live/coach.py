"""The coach: what to drive next so that a learner reaches its targets, how near it is, and what prevents it."""

import copy
import math
from collections.abc import Mapping
from concurrent.futures import BrokenExecutor, Executor, Future
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from fifthwheel.apps.live.learning import Learning
from fifthwheel.apps.live.node import Output
from fifthwheel.apps.live.status import NodeStatus, in_words
from fifthwheel.base.errors import FifthwheelError, suggestion
from fifthwheel.base.formatting import percent
from fifthwheel.estimate.design.experiment import default_targets
from fifthwheel.estimate.design.next_manoeuvre import (
    DRIVEN,
    WORTHWHILE,
    InformativeManoeuvre,
    manoeuvre_information,
    plan_manoeuvres,
)
from fifthwheel.estimate.identify.verdict import Verdict
from fifthwheel.estimate.online import LearnedValue
from fifthwheel.estimate.stream import VALID
from fifthwheel.results.report.conclusion import STATUSES, counted, spoken_verdict
from fifthwheel.truck.spoken_names import named

PERIOD = 1.0
"""Time between two looks at the learner, s."""
STANDING = 0.5
"""Below this speed the truck stands, m/s."""
SHORTEST = 2.0
"""A manoeuvre has at least this time of learning, s; it has ended when nothing was learned for `PERIOD`."""
PATIENCE = 3
"""Coaching ends after so many consecutive manoeuvres without effect, whatever is predicted."""
MOVED = 0.5
"""Change of an estimate, in its standard deviations, after which the manoeuvres are computed again."""
_PREVENTS = ("TOO_SLOW", "INPUT_MISSING", "COASTING", "INCONSISTENT")
"""Statuses at which nothing useful is learned."""


@dataclass(frozen=True, kw_only=True)
class Progress:
    """How near a parameter is to its target."""

    name: str
    sigma: float
    """Relative to the value, as the target."""
    target: float
    reached: bool
    note: str = ""
    """What limits it, if driving does not reach the target."""

    @property
    def text(self) -> str:
        """ "7.1 % of 5 %: limited by ..."."""
        note = f": {self.note}" if self.note else ""
        return f"{percent(self.sigma)}, target {percent(self.target)}{note}"


@dataclass(frozen=True, kw_only=True)
class DrivingAdvice:
    """What the driver does next, and how far the learner is."""

    next: str
    """The next manoeuvre; or that the truck is calibrated."""
    obstacle: str
    """Why nothing is learned now; empty if nothing prevents it."""
    worthwhile: int
    """Predicted number of manoeuvres that are worthwhile: the next one and those after it."""
    remaining: float
    """Their duration, s: without pauses, and of an ideal driver."""
    driven: float
    """Time with valid states, s; until the end of coaching."""
    manoeuvres: int
    """Number of manoeuvres driven."""
    progress: tuple[Progress, ...]
    done: bool

    @property
    def headline(self) -> str:
        """The obstacle, or what to do next."""
        return self.obstacle or self.next

    @property
    def text(self) -> str:
        """One line."""
        reached = sum(p.reached for p in self.progress)
        words = [
            f"{reached} of {counted(len(self.progress), 'target')}",
            f"{counted(self.manoeuvres, 'manoeuvre')} driven",
        ]
        if not self.done:
            words.append(f"at least {self.worthwhile} left, {self.remaining:.0f} s")
        return f"{self.headline} ({', '.join(words)})"


class Coach:
    """Gives the advice for a learner.

    Args:
        learning: the learner.
        targets: wanted sigma by parameter, relative to its value; by default those of `design_experiment`.
        max_speed: highest speed of a manoeuvre, m/s.
        pool: computes what each manoeuvre contributes again when the estimates have changed, which takes seconds; by
            default `update` does, and its caller waits.

    Raises:
        FifthwheelError: a target is of no parameter that is learned, or zero; or a speed out of range.
        VehicleError: the truck is unstable at every speed, or has no parameter with a default target.
    """

    def __init__(
        self,
        learning: Learning,
        targets: Mapping[str, float] | None = None,
        *,
        max_speed: float = 88 / 3.6,
        pool: Executor | None = None,
    ) -> None:
        self._learning, self._pool, live = learning, pool, learning.learner.live
        learned = [estimate.name for estimate in learning.parameters]
        self.targets = dict(targets or default_targets(live.setup.vehicle, live.setup.settings))
        for name, target in self.targets.items():
            if name not in learned:
                raise FifthwheelError(f"--target {name}: not a parameter that is learned; {suggestion(name, learned)}")
            if not target > 0:
                raise FifthwheelError(f"--target {name}: expected a sigma above 0, got {target:g}; give one such as 5%")
        self._settings = DRIVEN.up_to(max_speed)
        self._point = live.filter.estimate(finished=False).z  # at which the manoeuvres were computed
        self._candidates = manoeuvre_information(learning.learner, self._settings)
        self._computed: Future[tuple[InformativeManoeuvre, ...]] | None = None
        self._manoeuvres, self._without_effect, self._driven, self._last = 0, 0, 0.0, math.nan
        self._learned, self._learned_at = 0.0, -math.inf  # of the present manoeuvre: duration and last time, s
        self._looked, self._change = -math.inf, learning.change
        self._done = False
        self._replan()
        self.advice = self._advice("")
        """The present advice, at most `PERIOD` old."""

    def update(self, output: Output) -> None:
        """Take up an output of the node."""
        now = output.time
        step, self._last = (now - self._last if now - self._last < PERIOD else 0.0), now
        if int(output.status) in VALID or output.status is NodeStatus.DEGRADED:
            self._driven += 0.0 if self._done else step
        if output.states.get("learning"):
            self._learned, self._learned_at = self._learned + step, now
        if now - self._looked < PERIOD:
            return
        self._looked = now
        if self._learning.change != self._change:
            self._change, self._done, self._without_effect = self._learning.change, False, 0
            self._replan()
        if self._learned and now - self._learned_at > PERIOD:
            if self._learned >= SHORTEST and not self._done:
                self._end_manoeuvre()
            self._learned = 0.0
        if self._computed is not None and self._computed.done():
            if self._computed.exception() is None:
                self._candidates = self._computed.result()
                self._replan()
            self._computed = None
        self.advice = self._advice(self._obstacle(output))

    def _end_manoeuvre(self) -> None:
        """Judge its effect, and plan again."""
        self._manoeuvres += 1
        estimate = self._learning.learner.live.filter.estimate(finished=False)
        moved = (abs(estimate.z - self._point) > MOVED * np.sqrt(np.diag(estimate.Pz))).any()
        if moved and self._computed is None:
            self._point = estimate.z
            if self._pool is None:
                self._candidates = manoeuvre_information(self._learning.learner, self._settings)
            else:
                with suppress(BrokenExecutor):  # without a worker, the manoeuvres stay as they are
                    snapshot = copy.copy(self._learning.learner)  # it is sent while learning goes on
                    self._computed = self._pool.submit(manoeuvre_information, snapshot, self._settings)
        before = self.plan.excess
        self._replan()
        self._without_effect = 0 if before - self.plan.excess > WORTHWHILE else self._without_effect + 1
        self._done = self._done or self._without_effect >= PATIENCE

    def _replan(self) -> None:
        self.plan = plan_manoeuvres(self._learning.learner, self._candidates, self.targets)
        """The manoeuvres that are worthwhile, and what they reach."""
        self._done = self._done or not self.plan.steps

    def _advice(self, obstacle: str) -> DrivingAdvice:
        progress = tuple(self._progress(e) for e in self._learning.parameters if e.name in self.targets)
        if self._done:
            reached = all(p.reached for p in progress)
            text = f"done: {max(1, round(self._driven / 60))} min" + ("" if reached else "; more driving does not help")
        else:
            step = self.plan.steps[0]
            text = step.manoeuvre.instruction(step.size, left=self._manoeuvres % 2 == 0)
        return DrivingAdvice(
            next=text,
            obstacle="" if self._done else obstacle,
            worthwhile=len(self.plan.steps),
            remaining=self.plan.duration,
            driven=self._driven,
            manoeuvres=self._manoeuvres,
            progress=progress,
            done=self._done,
        )

    def _progress(self, estimate: LearnedValue) -> Progress:
        name, sigma = estimate.name, estimate.sigma / abs(estimate.value)
        target, plan, note = self.targets[name], self.plan, ""
        if name in plan.uninformed:
            note = "no manoeuvre with these sensors informs it"
        elif sigma > target and name in plan.limits and (self._done or plan.sigma[name] > target):
            predicted = "" if self._done else f"driving reaches {percent(plan.sigma[name])}, "
            note = f"{predicted}limited by {named(plan.limits[name])}"
        elif sigma <= target and estimate.verdict is not Verdict.CONVERGED:
            note = spoken_verdict(estimate.verdict)
        return Progress(name=name, sigma=sigma, target=target, reached=sigma <= target and not note, note=note)

    def _obstacle(self, output: Output) -> str:
        speed = next(
            (s["speed"] for s in reversed(output.samples) if math.isfinite(s.get("speed", math.nan))), math.nan
        )
        if output.problems:
            column, fault = next(iter(output.problems.items()))
            return f"{column}: {in_words(str(fault.name))}"
        if output.status is NodeStatus.TOO_SLOW and speed < STANDING:
            return "standing"
        if self._learning.learner.live.is_beyond_model:
            return "steer less: the lateral acceleration is too large for the model"
        if output.status.name in _PREVENTS:
            return STATUSES[output.status.name]
        return ""
