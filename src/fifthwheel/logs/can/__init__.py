"""CAN: frames of any bus log, decoded by the user's databases and by J1939."""

from fifthwheel.logs.can.frames import Batches, Frames
from fifthwheel.logs.can.log import CanLog

__all__ = ["Batches", "CanLog", "Frames"]
