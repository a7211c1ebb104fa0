"""States of a vehicle with known parameters: sample by sample, or for a record, filtered or smoothed."""

from typing import TYPE_CHECKING

from fifthwheel._lazy import lazy_names

if TYPE_CHECKING:
    from fifthwheel.observe.observer import Observer as Observer
    from fifthwheel.observe.settings import ObserverSettings as ObserverSettings
    from fifthwheel.observe.states import States as States
    from fifthwheel.observe.states import time_to_lift as time_to_lift
    from fifthwheel.observe.states import write_states as write_states
    from fifthwheel.observe.uncertainty import Uncertainty as Uncertainty
    from fifthwheel.stream import Status as Status
else:
    __getattr__, __dir__, __all__ = lazy_names(__name__)
