"""Sensor errors of a log of an identified vehicle."""

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from fifthwheel.base.errors import SignalError
from fifthwheel.base.names import split_log
from fifthwheel.data.channels import GYROS, is_sensor_error
from fifthwheel.data.record import Record
from fifthwheel.estimate.filters.model import block_diagonal
from fifthwheel.estimate.identify.one_stage.identify import identify_one_stage
from fifthwheel.estimate.identify.result.identification import Identification
from fifthwheel.estimate.identify.settings import OneStage
from fifthwheel.estimate.identify.statement import prior_of
from fifthwheel.estimate.identify.unknowns.parameters import given_parameters
from fifthwheel.estimate.observe import Uncertainty
from fifthwheel.model.dynamics.unit_equations import BANK
from fifthwheel.truck import Vehicle, toml_format
from fifthwheel.truck.quantities import BANK_VARIATION, FRICTION, TIME_BASE, unit_of

OTHER_ROAD = 0.7
"""Standard deviation of ln friction from one road to another: half or twice as large."""
HARDLY_KNOWN = 0.9
"""Largest fraction of a value that its standard deviation has, also after an identification that contradicts itself."""
OF_ROAD = (BANK, FRICTION)
"""Unknowns of the road, which another log has of its own."""


def estimate_sensor_errors(
    record: Record, vehicle: Vehicle, identification: Identification, friction: float | None = None
) -> tuple[dict[str, Any], Uncertainty | None]:
    """Sensor errors and noise of a new log, and the joint uncertainty of vehicle and sensors.

    One stage with every parameter of the vehicle fixed estimates the offset, gain and delay of the steering, the biases
    and gains of the gyros, and the bank of the road from this log alone.

    Of the uncertainty of the identification, sensor errors and banks are dropped; those of the new log are taken as
    independent of the parameters of the vehicle. `friction` is as in `log_sensors`: that of the identification is a
    prior median and estimated too, because another log may be of another road.

    Returns:
        Keyword arguments for `ObserverSettings`, and the joint uncertainty; None if that of the vehicle is not known.

    Raises:
        SignalError: the log cannot be used: it is too short or too slow, or a signal is missing.
    """
    law, known = identification.settings.tyre_law, _uncertainty(identification, friction)
    variation = prior_of(identification.settings.given, BANK_VARIATION)[1]
    given: dict[str, str | float] = {"truck": "exact", BANK_VARIATION: f"+- {variation!r} rad"}
    given |= dict.fromkeys((TIME_BASE, *[f"{gyro.quantity}.*.delay" for gyro in GYROS]), "exact")  # small, to save time
    given |= identification.surroundings
    settings = OneStage(given=given, tyres="linear", check=False)
    if (peak := identification.friction if friction is None else friction) is not None:
        given[FRICTION] = f"{peak!r} +- {OTHER_ROAD:.0%}" if friction is None else f"{peak!r} exact"
        settings = replace(settings, tyres="saturating" if isinstance(law, str) else law, given=given)
        settings = replace(settings, given=given | (_known_within(vehicle, known, settings) if known else {}))
    new = identify_one_stage([record], vehicle, settings)
    estimated, sensors = new.sensor_settings(record.name), new.uncertainty(record.name)
    if known is None or sensors is None:
        return estimated, None
    parameters = known.among([n for n in known.names if not is_sensor_error(n) and split_log(n)[0] not in OF_ROAD])
    sensors = sensors.among([n for n in sensors.names if n not in parameters.names])
    covariance = block_diagonal(parameters.covariance, sensors.covariance)
    return estimated, Uncertainty(names=(*parameters.names, *sensors.names), covariance=covariance)


def _uncertainty(identification: Identification, friction: float | None) -> Uncertainty | None:
    """That of an identification, without that of a friction that is known."""
    known = identification.covariance
    if known is None or friction is None:
        return known
    return known.among([name for name in known.names if name != FRICTION])


def _known_within(vehicle: Vehicle, known: Uncertainty, settings: OneStage) -> dict[str, str]:
    """Statements on the uncertain parameters that the sensor errors depend on.

    If tyres saturate, a log informs the offset of the steering and the bank by the curvature of the tyre law, as far as
    the law is known.
    """
    values = given_parameters(vehicle, settings)
    sigma = dict(zip(known.names, np.sqrt(np.diag(known.covariance)).tolist(), strict=True))
    uncertain = {n: s for n, s in sigma.items() if values.get(n, 0.0) > 0 and s > 0 and n not in OF_ROAD}
    fractions = {n: min(s / values[n], HARDLY_KNOWN) for n, s in uncertain.items()}
    return {n: toml_format.text(values[n], unit_of(n), f * values[n]) for n, f in fractions.items()}


class LogSensors(NamedTuple):
    """The sensors of one log."""

    settings: dict[str, Any]  # sensor errors, noise and bank, as arguments of `ObserverSettings`
    uncertainty: Uncertainty | None  # joint uncertainty of vehicle and sensors
    note: str  # where the sensor errors come from, if not from the identification; else empty


def log_sensors(
    identification: Identification, record: Record, vehicle: Vehicle, friction: float | None = None
) -> LogSensors:
    """The sensors of a log; those of a log that was not identified on are estimated from the log itself.

    `vehicle` is the identified one. `friction` is the known peak friction of the road; None: as identified, and if
    tyres saturate, that of another log is estimated too.
    """
    note = ""
    if record.name not in {log.name for log in identification.logs}:
        note = f"{record.name}: not a log of the identification; its sensor errors are "
        try:
            estimated = estimate_sensor_errors(record, vehicle, identification, friction)
            return LogSensors(*estimated, f"{note}estimated from the log itself")
        except SignalError as error:
            note += f"unknown, and sigma includes their prior ({error})"
    peak = identification.friction if friction is None else friction
    settings = identification.sensor_settings(record.name) | {"friction": peak}
    return LogSensors(settings, _uncertainty(identification, friction), note)
