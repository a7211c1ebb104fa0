"""States of a vehicle with known parameters: sample by sample, or for a record, filtered or smoothed."""

from typing import TYPE_CHECKING

from fifthwheel.base.lazy import lazy_names

if TYPE_CHECKING:
    from fifthwheel.estimate.observe.observer import Observer as Observer
    from fifthwheel.estimate.observe.settings import ObserverSettings as ObserverSettings
    from fifthwheel.estimate.observe.states import States as States
    from fifthwheel.estimate.observe.states import time_to_lift as time_to_lift
    from fifthwheel.estimate.observe.states import write_states as write_states
    from fifthwheel.estimate.observe.uncertainty import Uncertainty as Uncertainty
    from fifthwheel.estimate.stream import Status as Status
else:
    __getattr__, __dir__, __all__ = lazy_names(__name__)
