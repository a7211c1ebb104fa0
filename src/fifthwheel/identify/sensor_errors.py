"""Sensor errors of a log of an identified vehicle."""

from typing import Any

import numpy as np

from fifthwheel.identify.one_stage.estimator import identify_one_stage
from fifthwheel.identify.parameters import estimated_parameters
from fifthwheel.identify.result import sensor_settings
from fifthwheel.identify.settings import OneStage
from fifthwheel.names import is_sensor_error
from fifthwheel.observe import Uncertainty
from fifthwheel.record import Record
from fifthwheel.vehicle import Vehicle


def estimate_sensor_errors(
    record: Record, vehicle: Vehicle, known: Uncertainty | None
) -> tuple[dict[str, Any], Uncertainty | None]:
    """Sensor errors and noise of a new log, and the joint uncertainty of vehicle and sensors.

    One stage with every parameter of the vehicle fixed estimates the offset, gain and delay of the steering, the biases
    and gains of the gyros, and the bank of the road from this log alone.

    Args:
        record: the new log.
        vehicle: as identified.
        known: joint uncertainty from the identification. Its sensor errors are dropped; those of the new log are taken
            as independent of the parameters of the vehicle. None if not known.

    Returns:
        Keyword arguments for `ObserverSettings`, and the joint uncertainty; None if `known` is None.

    Raises:
        SignalError: the log cannot be used: it is too short or too slow, or a signal is missing.
    """
    exact = OneStage(priors={}, consider={}, check=False)
    fixed = OneStage(fixed=tuple(estimated_parameters(vehicle, exact)), priors={}, consider={}, check=False)
    identification = identify_one_stage([record], vehicle, fixed)
    settings = sensor_settings(identification.as_dict(), record.name)
    sensors = identification.uncertainty(record.name)
    if known is None or sensors is None:
        return settings, None
    parameters = known.among([name for name in known.names if not is_sensor_error(name)])
    k, m = len(parameters.names), len(sensors.names)
    covariance = np.block([[parameters.covariance, np.zeros((k, m))], [np.zeros((m, k)), sensors.covariance]])
    return settings, Uncertainty(names=(*parameters.names, *sensors.names), covariance=covariance)
