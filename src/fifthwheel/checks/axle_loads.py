"""Static axle loads from on-board weighing."""

from dataclasses import dataclass

import numpy as np

from fifthwheel._types import Array
from fifthwheel.channels import AXLE_LOAD, YAW_RATE, SignalName, names_of
from fifthwheel.errors import SignalError
from fifthwheel.record.record import Record

PREFIX = "axle_load."
_MAX_YAW_RATE = 0.01
"""rad/s; faster turns transfer load between axles."""
_REST_SPEED = 0.3
"""m/s; slower counts as rest."""
_MIN_SAMPLES = 5


@dataclass(frozen=True, kw_only=True)
class StaticLoad:
    """Static load of one axle group."""

    value: float
    """N, median."""
    scatter: float
    """N, standard deviation from the median absolute deviation."""
    samples: int


def static_loads(record: Record) -> dict[str, StaticLoad]:
    """Load of each axle group by its path, from the signals axle_load.<path>.

    Samples at rest are used if every axle load has enough of them, otherwise those of driving straight. A SignalError
    if there is no axle load, or one has fewer than 5 usable samples.
    """
    loads = {name: record.signals[name] for name in names_of(AXLE_LOAD, record.signals)}
    if not loads:
        raise SignalError(
            f"{record.name}: no axle load; map the columns with axle loads in signals.toml:\n"
            f'[signals."axle_load.tractor.drive"]\ncolumn = "..."\nunit = "kg"'
        )
    used = np.ones(len(record), dtype=bool)
    yaw_rates = names_of(YAW_RATE, record.signals)
    if yaw_rates:
        used &= ~(np.abs(_filled(record, record.signals[yaw_rates[0]])) > _MAX_YAW_RATE)
    if "speed" in record.signals:
        at_rest = used & (np.abs(_filled(record, record.signals["speed"])) < _REST_SPEED)
        if all(np.isfinite(values[at_rest]).sum() >= _MIN_SAMPLES for values in loads.values()):
            used = at_rest
    result = {}
    for name, values in loads.items():
        samples = values[used & np.isfinite(values)]
        if samples.size < _MIN_SAMPLES:
            raise SignalError(
                f"{name}: {samples.size} samples at rest or driving straight, at least {_MIN_SAMPLES} expected; "
                "map another column"
            )
        median = float(np.median(samples))
        scatter = 1.4826 * float(np.median(np.abs(samples - median)))
        result[SignalName.of(name).place] = StaticLoad(value=median, scatter=scatter, samples=samples.size)
    return result


def _filled(record: Record, values: Array) -> Array:
    """A channel on every row, linear between its samples; zero where it has none."""
    present = np.isfinite(values)
    if not present.any():
        return np.zeros(len(record))
    return np.interp(record.time, record.time[present], values[present])
