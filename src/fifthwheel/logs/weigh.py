"""Static axle loads in a log, from what the truck weighs on board."""

from dataclasses import dataclass

import numpy as np

from fifthwheel.errors import SignalError
from fifthwheel.logs.record import Array, Record

PREFIX = "axle_load."
_STRAIGHT = 0.01
"""rad/s; turns that are quicker load one axle more than another."""
_AT_REST = 0.3
"""m/s"""
_ENOUGH = 5


@dataclass(frozen=True, kw_only=True)
class Load:
    """What one axle group bears."""

    value: float
    """N, the median."""
    scatter: float
    """N, by the median deviation, as one standard deviation."""
    samples: int


def static_loads(record: Record) -> dict[str, Load]:
    """Load by the path of the axle group, from signals called axle_load.<path>.

    Of the samples at rest where there are some, else of those while the truck drives straight on. Raises SignalError
    where the record has no axle load, or one that hardly ever is there.
    """
    rest = np.ones(len(record), dtype=bool)
    rates = [v for name, v in record.signals.items() if name.startswith("yaw_rate.")]
    if rates:
        rest &= ~(np.abs(_filled(record, rates[0])) > _STRAIGHT)
    if "speed" in record.signals:
        still = rest & (np.abs(_filled(record, record.signals["speed"])) < _AT_REST)
        if all(np.isfinite(v[still]).sum() >= _ENOUGH for n, v in record.signals.items() if n.startswith(PREFIX)):
            rest = still
    found = {}
    for name, values in record.signals.items():
        if not name.startswith(PREFIX):
            continue
        seen = values[rest & np.isfinite(values)]
        if seen.size < _ENOUGH:
            raise SignalError(
                f"{name}: {seen.size} samples at rest or straight on, {_ENOUGH} expected; map another one"
            )
        middle = float(np.median(seen))
        scatter = 1.4826 * float(np.median(np.abs(seen - middle)))
        found[name.removeprefix(PREFIX)] = Load(value=middle, scatter=scatter, samples=seen.size)
    if not found:
        raise SignalError(
            f"{record.name}: no axle load; map the columns that hold them:\n"
            f'[signals."axle_load.tractor.drive"]\ncolumn = "..."\nunit = "kg"'
        )
    return found


def _filled(record: Record, values: Array) -> Array:
    """A channel on every row, linear between its samples; zero where it has none."""
    seen = np.isfinite(values)
    return np.interp(record.time, record.time[seen], values[seen]) if seen.any() else np.zeros(len(record))
