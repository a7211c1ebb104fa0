"""What the page shows: the newest output as JSON ten times per second, and the last minute."""

import json
import math
import threading
from collections import deque
from collections.abc import Mapping

from fifthwheel.apps.live.coach import DrivingAdvice
from fifthwheel.apps.live.node import Output
from fifthwheel.apps.live.session import Session
from fifthwheel.base.formatting import shown, with_sigma
from fifthwheel.estimate.online import LearnedValue
from fifthwheel.results.report.conclusion import spoken_verdict
from fifthwheel.truck import unit_of
from fifthwheel.truck.spoken_names import spoken

PERIOD = 0.1
"""Time between two snapshots, s."""
HISTORY = 600
"""Snapshots that a new page receives: one minute."""


class Snapshots:
    """The newest snapshots; readers wait for the next one. The session gives words and parameters."""

    def __init__(self, session: Session) -> None:
        self._session = session
        self._texts: deque[str] = deque(maxlen=HISTORY)
        self._count = 0
        self.ended = False
        self._new = threading.Condition()
        self._next = -math.inf  # time of the next snapshot, s
        self._steer: dict[str, float] = {}

    def show(self, output: Output) -> None:
        """Take a snapshot if it is time."""
        for sample in output.samples:
            self._steer |= {name: value for name, value in sample.items() if name.startswith(("steer.", "speed"))}
        if output.time < self._next:
            return
        self._next = (self._next if output.time < self._next + PERIOD else output.time) + PERIOD
        text = json.dumps(self._snapshot(output), separators=(",", ":"), allow_nan=False)
        with self._new:
            self._texts.append(text)
            self._count += 1
            self._new.notify_all()

    def close(self) -> None:
        """Wake all readers; there are no more snapshots."""
        with self._new:
            self.ended = True
            self._new.notify_all()

    def history(self) -> tuple[int, str]:
        """Number of snapshots so far, and the last ones as a JSON list."""
        with self._new:
            return self._count, f"[{','.join(self._texts)}]"

    def after(self, count: int, timeout: float) -> tuple[int, str]:
        """The newest snapshot when there are more than `count`; empty after `timeout`, s, or at the end."""
        with self._new:
            self._new.wait_for(lambda: self._count > count or self.ended, timeout)
            return (self._count, self._texts[-1]) if self._count > count else (count, "")

    def _snapshot(self, output: Output) -> Mapping[str, object]:
        learning = self._session.learning
        estimates = learning.parameters if learning else ()
        return {
            "time": round(output.time, 3),
            "status": output.status.name,
            "text": self._session.status_text(output),
            "states": {name: _rounded(value) for name, value in (*output.states.items(), *self._steer.items())},
            "trailer": learning.learner.trailer if learning else "",
            "change": learning.change if learning else "",
            "parameters": [_parameter(e) for e in estimates],
            "coach": _advice(self._session.coach.advice) if self._session.coach else None,
        }


def _advice(advice: DrivingAdvice) -> Mapping[str, object]:
    """An advice; of each target its text, and sigma in units of the target."""
    return {
        "headline": advice.headline,
        "text": advice.text.removeprefix(advice.headline).strip(" ()"),
        "obstacle": bool(advice.obstacle),
        "targets": [
            {"name": spoken(p.name), "text": p.text, "ratio": _rounded(p.sigma / p.target), "reached": p.reached}
            for p in advice.progress
        ],
    }


def _parameter(estimate: LearnedValue) -> Mapping[str, object]:
    """An estimate in words, and its numbers in the display unit for the plot."""
    unit = unit_of(estimate.name)
    return {
        "path": estimate.name,
        "name": spoken(estimate.name),
        "text": f"{with_sigma(estimate.value, estimate.sigma, unit)}, {spoken_verdict(estimate.verdict)}",
        "verdict": estimate.verdict.value,
        "value": _rounded(estimate.value * shown(unit).factor),
        "sigma": _rounded(estimate.sigma * shown(unit).factor),
    }


def _rounded(value: float) -> float | None:
    """Six digits; None for a value that is not finite."""
    return float(f"{value:.6g}") if math.isfinite(value) else None
