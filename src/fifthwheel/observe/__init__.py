"""States of a known truck from the sensors that it has: off-line by the record, live by the sample."""

from fifthwheel.observe.observer import Observer, ObserverSettings
from fifthwheel.observe.states import States, Status, save

__all__ = ["Observer", "ObserverSettings", "States", "Status", "save"]
