"""Static axle loads and weights from on-board weighing."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fifthwheel.base.errors import SignalError
from fifthwheel.base.types import Array
from fifthwheel.data.channels import AXLE_LOAD, WEIGHTS, YAW_RATE, Channel, SignalName, channel_of, is_of, names_of
from fifthwheel.data.record.record import Record

PREFIX = "axle_load."
_MAX_YAW_RATE = 0.01
"""rad/s; faster turns transfer load between axles."""
_REST_SPEED = 0.3
"""m/s; slower counts as rest."""
_MIN_SAMPLES = 5


@dataclass(frozen=True, kw_only=True)
class StaticLoad:
    """Static load of one axle group, or weight of a unit or of the vehicle."""

    value: float
    """N, median."""
    scatter: float
    """N, standard deviation from the median absolute deviation."""
    samples: int


def static_loads(record: Record) -> dict[str, StaticLoad]:
    """Load of each axle group by its path, from the signals axle_load.<path>; see `static_weights`.

    A SignalError if there is no axle load, or one has too few samples.
    """
    loads = static_weights(record, (AXLE_LOAD,))
    if not loads and (weights := sorted(name for name in record.signals if is_of(name, *WEIGHTS))):
        raise SignalError(
            f"{record.name}: no axle load, only {', '.join(weights)}; `fifthwheel mass` uses such weights, or map the"
            " axle loads too"
        )
    if not loads:
        raise SignalError(
            f"{record.name}: no axle load; map the columns with axle loads in signals.toml:\n"
            f'[signals."axle_load.tractor.drive"]\ncolumn = "..."\nunit = "kg"'
        )
    return {SignalName.of(name).place: load for name, load in loads.items()}


def static_weights(record: Record, channels: Sequence[Channel] = WEIGHTS) -> dict[str, StaticLoad]:
    """Axle loads and weights by the names of their signals.

    Samples at rest are used if every one has enough of them, otherwise those of driving straight. A SignalError if one
    has fewer than 5 usable samples.
    """
    loads = {name: values for name, values in record.signals.items() if is_of(name, *channels)}
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
        result[name] = StaticLoad(value=median, scatter=scatter, samples=samples.size)
    return result


def mean_weights(records: Sequence[Record]) -> dict[str, tuple[float, float]]:
    """Mean and standard deviation, N, of the axle loads and weights in logs of one load, by signal.

    The error of the scale is the same in all logs: it is the `scale` of the channel, or the sigma of the `gain` that
    the signal map states. The scatter counts in full, because the samples of a log are not independent. A SignalError
    if a signal has too few samples, or weighs nothing, or the logs state different things of its sensor.
    """
    found: dict[str, list[tuple[Record, StaticLoad]]] = {}
    for record in records:
        for name, load in static_weights(record).items():
            found.setdefault(name, []).append((record, load))
    means = {}
    for name, loads in found.items():
        scale, *others = {_scale(record, name) for record, _ in loads}
        value = float(np.mean([load.value for _, load in loads]))
        if others:
            raise SignalError(f"{name}: expected one gain in all logs; read them with the same signals.toml")
        if not value > 0:
            raise SignalError(f"{name}: expected above 0 N, got {value:.0f} N; check column and unit in signals.toml")
        means[name] = value, math.hypot(scale * value, *(load.scatter / len(loads) for _, load in loads))
    return means


def _scale(record: Record, name: str) -> float:
    """Standard deviation of the scale of a sensor that weighs, as a fraction."""
    channel, sensor = channel_of(name), record.sensors.get(name)
    stated = sensor.errors.get("gain", (1.0, None))[1] if sensor else None
    assert channel is not None
    assert channel.scale is not None
    return channel.scale if stated is None else stated


def _filled(record: Record, values: Array) -> Array:
    """A channel on every row, linear between its samples; zero where it has none."""
    present = np.isfinite(values)
    if not present.any():
        return np.zeros(len(record))
    return np.interp(record.time, record.time[present], values[present])
