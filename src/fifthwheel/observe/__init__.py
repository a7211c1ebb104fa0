"""States of a known truck from the sensors that it has: off-line by the record, live by the sample."""

from fifthwheel.observe.observer import Observer
from fifthwheel.observe.settings import ObserverSettings
from fifthwheel.observe.states import States, Status, save
from fifthwheel.observe.uncertainty import Uncertainty

__all__ = ["Observer", "ObserverSettings", "States", "Status", "Uncertainty", "save"]
