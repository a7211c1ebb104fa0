"""What happens with the outputs of a node: frames, record, estimates, page."""

import math
from dataclasses import dataclass, field
from typing import Protocol

from fifthwheel.apps.live.checkpoint import Checkpoint
from fifthwheel.apps.live.coach import Coach
from fifthwheel.apps.live.learning import Learning
from fifthwheel.apps.live.node import Node, Output
from fifthwheel.apps.live.outputs.frames_out import FrameEncoder
from fifthwheel.apps.live.outputs.recorder import BackgroundWriter, Recorder
from fifthwheel.apps.live.sources.bus import LiveBus
from fifthwheel.apps.live.status import LiveFault, in_words
from fifthwheel.data.channels import SPEED
from fifthwheel.estimate.identify.verdict import Verdict

PARAMETER_PERIOD = 0.1
"""Time between two frames with a parameter, s."""


class View(Protocol):
    """Something that shows outputs, such as the page."""

    def show(self, output: Output) -> None:
        """Show an output."""

    def close(self) -> None:
        """Show nothing more."""


@dataclass(kw_only=True)
class Session:
    """Everything that receives the outputs of a node."""

    node: Node
    writer: BackgroundWriter
    learning: Learning | None = None
    coach: Coach | None = None  # of the learning
    checkpoint: Checkpoint | None = None
    recorder: Recorder | None = None
    messages: Recorder | None = None  # of ROS 2
    encoder: FrameEncoder | None = None
    bus: LiveBus | None = None  # on which frames are sent
    send_period: float = 0.01  # time between two outputs that are sent, s
    trailer_column: str = ""  # column with the number of the trailer; empty for none
    views: list[View] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._sent = self._sent_parameter = -1e9
        self._next = 0
        self._speed = math.nan  # last measured one, m/s

    def handle(self, output: Output) -> None:
        """Process an output."""
        if self.learning is not None:
            self._learn(self.learning)
        if self.coach is not None:
            self.coach.update(output)
        if self.encoder is not None and self.bus is not None:
            self._send(self.encoder, self.bus, output)
        if self.recorder is not None:
            self.recorder.add(self.row(output))
        if self.messages is not None:
            for sample in output.samples:
                self._speed = sample.get(SPEED.quantity, self._speed)
            self.messages.add(self.row(output) | {SPEED.quantity: self._speed})
        self.node.set_fault(LiveFault.NOT_RECORDED, bool(self.writer.errors))
        for view in self.views:
            view.show(output)

    def close(self) -> None:
        """Write the last estimates and complete the record."""
        for view in self.views:
            view.close()
        if self.checkpoint is not None:
            self.checkpoint.write()
        for recorder in filter(None, (self.recorder, self.messages)):
            recorder.close()
        self.writer.close()

    def row(self, output: Output) -> dict[str, float]:
        """An output as numbers by name, for a record."""
        row = {
            "time": output.time,
            "bus_time": output.bus_time,
            "status": float(output.status),
            "faults": float(output.faults),
            **output.states,
        }
        for estimate in self.learning.parameters if self.learning else ():
            row[estimate.name] = estimate.value
            row[f"{estimate.name}.sigma"] = estimate.sigma
        return row

    def status_text(self, output: Output) -> str:
        """Status and faults in words, with the columns and files that they concern."""
        words = [in_words(output.status.name)]
        for fault in output.faults:
            columns = [column for column, of_column in output.problems.items() if of_column == fault]
            words.append(": ".join([in_words(str(fault.name)), *([", ".join(columns)] if columns else [])]))
        return "  ".join([*words, *self.writer.errors.values()])

    def state_text(self, output: Output) -> str:
        """The sideslip of the last unit, and how many parameters are known."""
        sideslips = [n for n in output.states if n.startswith("sideslip.") and not n.endswith(".sigma")]
        name = sideslips[-1]
        value, sigma = (math.degrees(output.states.get(key, math.nan)) for key in (name, f"{name}.sigma"))
        words = [f"{name} {value:.2f} ± {sigma:.2f} deg" if math.isfinite(value) else f"{name} -"]
        if self.learning is not None:
            known = sum(e.verdict is Verdict.CONVERGED for e in self.learning.parameters)
            words.append(f"{known} of {len(self.learning.parameters)} parameters")
        return "  ".join(words)

    def _learn(self, learning: Learning) -> None:
        self.node.set_fault(LiveFault.CHANGED, bool(learning.faults))
        if (number := self.node.extra.get(self.trailer_column)) is not None:
            learning.couple(f"{number:.0f}")
        if self.checkpoint is not None:
            self.checkpoint.update()

    def _send(self, encoder: FrameEncoder, bus: LiveBus, output: Output) -> None:
        frames = []
        parameters = self.learning.parameters if self.learning else ()
        if output.time - self._sent >= self.send_period - 1e-4:
            self._sent = output.time
            known = sum(estimate.verdict is Verdict.CONVERGED for estimate in parameters)
            frames = encoder.encode(output, known=known)
        if parameters and output.time - self._sent_parameter >= PARAMETER_PERIOD:
            self._sent_parameter = output.time
            self._next = (self._next + 1) % len(parameters)
            frames.append(encoder.encode_parameter(parameters[self._next], output.bus_time))
        self.node.set_fault(LiveFault.NOT_SENT, bool(frames and bus.send(frames)))
