"""A bus of python-can that is opened again after an error, and its frames in a queue."""

import queue
import re
import threading
import time
from collections.abc import Sequence
from typing import Any, NamedTuple

from fifthwheel.base.errors import FifthwheelError
from fifthwheel.base.lazy import require
from fifthwheel.data.logs.can.database import Frame

LONGEST_QUEUE = 20_000
"""Frames that may wait; further ones are dropped."""
RETRY = 0.5
"""Time between two attempts to open a bus, s."""
_POLL = 0.1
"""Longest time until a reader sees that it shall end, s."""
_BUS_OFF, _RESTARTED = 0x40, 0x100
"""Bits of the id of an error frame of SocketCAN."""


class Arrival(NamedTuple):
    """A frame and when it was read."""

    frame: Frame
    at: float  # by `time.monotonic`, s


def frame_queue() -> "queue.Queue[Arrival]":
    """A queue for the frames of all buses."""
    return queue.Queue(LONGEST_QUEUE)


class LiveBus:
    """Reads the frames of one bus in a thread, those that a filter of python-can accepts.

    The name is INTERFACE:CHANNEL as in python-can, such as "socketcan:can0", "virtual:truck" or
    "udp_multicast:239.0.0.1"; any other is a FifthwheelError. `number` counts where the channel has none at its end.
    `options` are further arguments of `can.Bus`, such as bitrate.
    """

    def __init__(
        self,
        name: str,
        number: int,
        filters: Sequence[dict[str, int | bool]],
        frames: "queue.Queue[Arrival]",
        options: dict[str, Any] | None = None,
    ) -> None:
        self._can = require("can", "live")
        interface, _, channel = name.partition(":")
        if not channel or interface not in self._can.VALID_INTERFACES:
            raise FifthwheelError(
                f"--bus {name}: expected INTERFACE:CHANNEL, such as socketcan:can0, with an interface of python-can: "
                f"{', '.join(sorted(self._can.VALID_INTERFACES))}"
            )
        if interface == "udp_multicast":
            require("msgpack", "live")
        self.name = name
        digits = re.search(r"\d{1,6}$", channel)
        self.number = int(digits[0]) if digits and interface != "udp_multicast" else number
        self.off = ""
        """Why the bus cannot be used; empty while it can."""
        self.dropped = 0
        """Frames that found the queue full."""
        self._arguments = {"interface": interface, "channel": channel, "can_filters": list(filters), **(options or {})}
        self._frames = frames
        self._bus: Any = None
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, name=f"fifthwheel {name}", daemon=True)

    def start(self) -> None:
        """Open the bus, or raise a FifthwheelError, and read; later errors are repaired by opening it again."""
        try:
            self._open()
        except Exception as error:  # drivers raise many kinds
            raise FifthwheelError(f"--bus {self.name}: cannot be opened ({error}); check the interface") from error
        self._thread.start()

    def send(self, frames: Sequence[Frame]) -> str:
        """Send frames; returns why it failed, empty where all are sent."""
        bus = self._bus
        if bus is None:
            return self.off
        try:
            for frame in frames:
                bus.send(
                    self._can.Message(
                        arbitration_id=frame.id, data=frame.data, is_extended_id=frame.extended, check=False
                    )
                )
        except Exception as error:  # drivers raise many kinds
            return str(error) or type(error).__name__
        return ""

    def close(self) -> None:
        """End the thread and close the bus."""
        self._ended.set()
        if self._thread.is_alive():
            self._thread.join()
        self._shut_down()

    def _open(self) -> None:
        self._bus = self._can.Bus(**self._arguments)
        self.off = ""

    def _shut_down(self) -> None:
        bus, self._bus = self._bus, None
        if bus is not None:
            try:
                bus.shutdown()
            except Exception:  # a device that was pulled out cannot be closed properly
                self.off = self.off or "cannot be closed"

    def _run(self) -> None:
        while not self._ended.is_set():
            try:
                if self._bus is None:
                    self._open()
                self._read(self._bus)
            except Exception as error:  # drivers raise many kinds
                self.off = str(error) or type(error).__name__
                self._shut_down()
                self._ended.wait(RETRY)

    def _read(self, bus: Any) -> None:
        while not self._ended.is_set():
            message = bus.recv(_POLL)
            if message is None:
                continue
            if message.is_error_frame:
                if message.arbitration_id & _BUS_OFF:
                    self.off = "bus-off"
                elif message.arbitration_id & _RESTARTED:
                    self.off = ""
                continue
            if message.is_remote_frame:
                continue
            self.off = ""
            frame = Frame(
                message.timestamp, message.arbitration_id, bytes(message.data), message.is_extended_id, self.number
            )
            try:
                self._frames.put_nowait(Arrival(frame, time.monotonic()))
            except queue.Full:
                self.dropped += 1
