"""What a log tells of its own sensors where the truck is known already."""

from typing import Any

import numpy as np
from scipy.linalg import block_diag

from fifthwheel.identify.one_stage import OneStageFit
from fifthwheel.identify.parameters import one_stage_sought
from fifthwheel.identify.result import sensors_told
from fifthwheel.identify.settings import OneStage
from fifthwheel.logs import Record
from fifthwheel.observe import Uncertainty
from fifthwheel.observe.uncertainty import of_sensor
from fifthwheel.vehicle import Vehicle


def sensors_of(
    record: Record, vehicle: Vehicle, known: Uncertainty | None
) -> tuple[dict[str, Any], Uncertainty | None]:
    """Zeros and noise for `ObserverSettings`, and how uncertain truck and sensors are, of a log that is new.

    One stage with every parameter of the vehicle held: steer zero, gain and delay, the gyros' zeros and gains, and the
    bank are found from this log alone. `known` is what the truck is uncertain by; what other logs said of their sensors
    is left out of it, and the sensors' errors here are taken for independent of the truck's. None stays None.

    Raises:
        SignalError: the log cannot be used for that: too short, too slow, or without a channel that is needed.
    """
    plain = OneStage(priors={}, consider={}, check=False)
    held = OneStage(held=tuple(one_stage_sought(vehicle, plain)), priors={}, consider={}, check=False)
    found = OneStageFit([record], vehicle, held, (), lambda *_: None).run()
    own = found.uncertainty(record.name)
    together = None
    if known is not None and own is not None:
        truck = known.among([name for name in known.names if not of_sensor(name)])
        covariance = block_diag(truck.covariance, own.covariance)
        together = Uncertainty(names=(*truck.names, *own.names), covariance=np.asarray(covariance, dtype=np.float64))
    return sensors_told(found.as_dict(), record.name), together
