"""From a record to the rows that a compiled step reads."""

from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fifthwheel.dynamics import ChainModel, steps
from fifthwheel.errors import SignalError, VehicleError
from fifthwheel.filters.model import sample_rows
from fifthwheel.logs import Record
from fifthwheel.vehicle import Vehicle

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Rows:
    """A record cut into steps that the model can take; M of them for N samples."""

    rows: Array  # (M, 1 + n_d + 2 n_y), for a compiled step
    time: Array  # (M,) s
    places: NDArray[np.int64]  # (N,) which of the M are samples
    first: dict[str, float]  # the inputs at the first sample
    swing: float  # standard deviation of the steer angles, rad


def steered_as_logged(vehicle: Vehicle, record: Record) -> Vehicle:
    """`locked_but` for the steer angles of a record."""
    return locked_but(vehicle, record.signals, record.name)


def locked_but(vehicle: Vehicle, signals: Container[str], source: str) -> Vehicle:
    """The vehicle with the axles locked whose steer angle is not among the signals.

    Raises:
        SignalError: there is no steer angle at all.
    """
    wanted = vehicle.steer_signals()
    if not wanted:
        raise VehicleError(f"{vehicle.name}: no axle is steerable; set steerable = true on the front axle")
    if not any(name in signals for name in wanted):
        raise SignalError(f"{wanted[0]}: not in {source}; map the road-wheel angle of a steered axle to it")
    fields = vehicle.model_dump()
    for unit in fields["units"]:
        for axle in (axle for group in unit["axle_groups"] for axle in group["axles"]):
            axle["steerable"] &= f"steer.{unit['name']}.{axle['name']}" in signals
    return Vehicle(**fields)


def fast_enough(record: Record, min_speed: float) -> list[Record]:
    """The stretches of a record, without gaps in time, at `min_speed` (m/s) or above.

    Raises:
        SignalError: there is none.
    """
    speed = record.input("speed")
    fast = speed >= min_speed
    if not fast.any():
        raise SignalError(
            f"speed: at most {speed.max():.1f} m/s in {record.name}, {min_speed:g} m/s needed; "
            "the linear tyre needs a rolling wheel: map the right channel (m/s?) or drive faster"
        )
    edges = np.flatnonzero(np.diff(fast.astype(int))) + 1
    pieces = [
        record.cut(record.time[rows[0]], record.time[rows[-1]])
        for rows in np.split(np.arange(len(fast)), edges)
        if fast[rows[0]] and len(rows) > 1
    ]
    if not pieces:
        raise SignalError(
            f"speed: never at {min_speed:g} m/s or above for two samples running in {record.name}; "
            "smooth it, or drive faster"
        )
    return [section for piece in pieces for section in piece.sections()]


def swing(inputs: Mapping[str, Array]) -> float:
    """The greatest standard deviation of the steer angles among a model's inputs, rad."""
    return max(float(np.std(values)) for name, values in inputs.items() if name != "speed")


def in_time(record: Record, names: Sequence[str], errors: Mapping[str, float]) -> dict[str, Array]:
    """Inputs (N,) by name, each moved by its "<name>.delay" in `errors`, s, if that is there."""
    moved = {}
    for name in names:
        values, late = record.input(name), errors.get(f"{name}.delay", 0.0)
        moved[name] = np.interp(record.time + late, record.time, values) if late else values
    return moved


def prepare(model: ChainModel, vehicle: Vehicle, record: Record, *, errors: Mapping[str, float] | None = None) -> Rows:
    """Rows of a record for a model.

    Args:
        vehicle: whose numbers say how long a step may be.
        errors: of the steer sensors as far as they are known; a delay moves the channel.

    Raises:
        SignalError: an input is missing, or has a gap that is too long.
    """
    errors = errors or {}
    inputs = in_time(record, model.inputs, errors)
    columns = steps.stacked(inputs, model.inputs)
    limit = steps.longest(vehicle, columns[:, 0], roll=model.roll)
    fine, columns, places = steps.subdivide(record.time, columns, limit)
    dt, d = steps.step_inputs(fine, columns)
    measured = np.full((len(fine), len(model.outputs)), np.nan)
    for i, name in enumerate(model.outputs):
        if name in record.signals:
            measured[places, i] = record.signals[name]
    first = {name: float(values[0]) for name, values in inputs.items()}
    return Rows(rows=sample_rows(dt, d, measured), time=fine, places=places, first=first, swing=swing(inputs))
