"""What happened to a node and when, as lines of JSON beside its record: for the question months later."""

import json
import os
from collections import Counter
from collections.abc import Mapping
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any

from fifthwheel import __version__
from fifthwheel.apps.live.node import Output
from fifthwheel.apps.live.outputs.recorder import BackgroundWriter
from fifthwheel.apps.live.session import Session
from fifthwheel.apps.live.status import LiveFault, NodeStatus

KIND = "journal"
"""Kind of the jobs of the writer."""
LEAST = 1.0
"""Time between two lines on status and faults, s: a fault that comes and goes does not fill the disk."""
LEARNED = 60.0
"""Time between two lines with the estimates while it learns, s."""


class Journal:
    """A view that writes the events of a session to a file, to which it appends.

    Each line has "at" (UTC), "bus_time" in s and "event": start, status, learned, changed, advice, not recorded, end.
    The lines learned and end count what came since the last of them: "outputs" by status, and "refused", the outputs at
    which a signal had a fault, such as "yaw_rate.tractor: frozen". A process that is killed may leave a part of the
    last line.
    """

    def __init__(self, path: Path, session: Session, about: Mapping[str, Any]) -> None:
        self.path, self._session = path, session
        self._writer: BackgroundWriter = session.writer
        self._shown: tuple[NodeStatus, LiveFault] | None = None
        self._status_time = self._learned_time = -1e9
        self._learned, self._change, self._advice = 0, "", ""
        self._errors: dict[str, str] = {}
        self._outputs, self._refused = Counter[str](), Counter[str]()  # since the last counts
        self._lines: list[str] = []  # that are not yet written
        self._write("start", None, version=__version__, **about)

    def show(self, output: Output) -> None:
        """Write what has changed."""
        self._outputs[output.status.name] += 1
        self._refused.update(f"{name}: {str(fault.name).lower()}" for name, fault in output.problems.items())
        if (shown := (output.status, output.faults)) != self._shown and output.time - self._status_time >= LEAST:
            self._shown, self._status_time = shown, output.time
            names = [str(fault.name).lower() for fault in output.faults]
            self._write("status", output, status=output.status.name, faults=names, signals=sorted(output.problems))
        errors = {kind: text for kind, text in self._writer.errors.items() if kind != KIND}
        if errors != self._errors:
            self._errors = errors
            self._write("not recorded", output, reasons=sorted(errors.values()))
        coach = self._session.coach
        if coach is not None and coach.advice.text != self._advice:
            self._advice = coach.advice.text
            self._write("advice", output, advice=self._advice)
        learning = self._session.learning
        if learning is None:
            return
        if learning.change != self._change:
            self._change = learning.change
            self._write("changed", output, change=learning.change, trailer=learning.learner.trailer)
        if learning.learned > self._learned and output.time - self._learned_time >= LEARNED:
            self._write_estimates(output)

    def close(self) -> None:
        """Write the last estimates and the end."""
        learning = self._session.learning
        if learning is not None and learning.learned > self._learned:
            self._write_estimates(None)
        self._write("end", None, **self._counts())

    def _counts(self) -> dict[str, Any]:
        counts = {"outputs": dict(self._outputs), "refused": dict(self._refused)}
        self._outputs.clear()
        self._refused.clear()
        return counts

    def _write_estimates(self, output: Output | None) -> None:
        learning = self._session.learning
        assert learning is not None
        self._learned, self._learned_time = learning.learned, output.time if output else self._learned_time
        estimates = {e.name: [e.value, e.sigma, str(e.verdict)] for e in learning.parameters}
        about = {"samples": learning.learned, "trailer": learning.learner.trailer, "estimates": estimates}
        self._write("learned", output, **about, **self._counts())

    def _write(self, event: str, output: Output | None, **details: Any) -> None:
        at = datetime.now(UTC).isoformat(timespec="milliseconds")
        line = {"at": at, **({"bus_time": output.bus_time} if output else {}), "event": event, **details}
        self._lines.append(json.dumps(line) + "\n")
        if self._writer.submit(KIND, partial(_append, self.path, "".join(self._lines)), wait=event == "end"):
            self._lines = []  # else they wait for the next event


def _append(path: Path, text: str) -> None:
    file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)
    try:
        os.write(file, text.encode())
    finally:
        os.close(file)
