"""States of a vehicle with known parameters: sample by sample, or for a record, filtered or smoothed."""

from fifthwheel.observe.observer import Observer
from fifthwheel.observe.settings import ObserverSettings
from fifthwheel.observe.states import States, time_to_lift, write_states
from fifthwheel.observe.uncertainty import Uncertainty
from fifthwheel.stream import Status

__all__ = ["Observer", "ObserverSettings", "States", "Status", "Uncertainty", "time_to_lift", "write_states"]
