"""The result of a live run at its end."""

import math
from collections import Counter
from collections.abc import Iterator

from fifthwheel.apps.live.node import Output
from fifthwheel.apps.live.session import Session
from fifthwheel.apps.live.status import NodeStatus, in_words
from fifthwheel.base import pages
from fifthwheel.base.formatting import percent
from fifthwheel.estimate.identify.result.display import estimates_table
from fifthwheel.estimate.identify.result.parts import Estimate
from fifthwheel.estimate.online import LearnedValue
from fifthwheel.truck import unit_of
from fifthwheel.truck.spoken_names import spoken


class Summary:
    """A view that counts the outputs of a session."""

    def __init__(self, session: Session) -> None:
        self._session = session
        self._first = self._last = math.nan  # times of outputs, s
        self._outputs = Counter[NodeStatus]()

    def show(self, output: Output) -> None:
        """Count an output."""
        if not self._outputs:
            self._first = output.time
        self._last = output.time
        self._outputs[output.status] += 1

    def close(self) -> None:
        """Nothing is open."""

    def document(self) -> pages.Document:
        """Time, fractions of the samples by status, and the estimates of a learner."""
        return pages.Document("Live run", list(self._blocks()))

    def _blocks(self) -> Iterator[pages.Block]:
        total = self._outputs.total()
        if not total:
            yield pages.Paragraph("No states: no frame was received.")
            return
        fractions = ", ".join(f"{percent(n / total)} {in_words(s.name)}" for s, n in self._outputs.most_common())
        yield pages.Paragraph(f"{self._last - self._first:.1f} s of bus time, {total} samples: {fractions}.")
        learning = self._session.learning
        if learning is None:
            return
        if (coach := self._session.coach) is not None:
            advice = coach.advice
            yield pages.Paragraph(f"Coach: {advice.text}.")
            yield pages.Items(
                [f"{spoken(p.name)}: {p.text}" for p in advice.progress if not p.reached], "Missed targets"
            )
        yield estimates_table(map(_estimate, learning.learner.parameters))
        if self._session.checkpoint is None and self._session.recorder is None:
            yield pages.Paragraph("The estimates are not kept. Add --state FILE to keep them for the next run.")


def _estimate(learned: LearnedValue) -> Estimate:
    return Estimate(**vars(learned), unit=unit_of(learned.name), initial=learned.value, stage=1)
