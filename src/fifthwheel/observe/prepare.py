"""From a record to the rows that a compiled step reads."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fifthwheel.dynamics import ChainModel, steps
from fifthwheel.errors import SignalError
from fifthwheel.filters.model import sample_rows
from fifthwheel.logs import Record
from fifthwheel.observe.noise import initial
from fifthwheel.vehicle import Vehicle

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Rows:
    """A record cut into steps that the model can take; M of them for N samples."""

    rows: Array  # (M, 1 + n_d + 2 n_y), for a compiled step
    time: Array  # (M,) s
    places: NDArray[np.int64]  # (N,) which of the M are samples
    x0: Array  # (n,) where the state may start
    P0: Array  # (n, n) and how well that is known


def steered_as_logged(vehicle: Vehicle, record: Record) -> Vehicle:
    """The vehicle with the axles locked whose steer angle the record does not have.

    Raises:
        SignalError: the record has no steer angle at all.
    """
    logged = [name for name in vehicle.steer_signals() if name in record.signals]
    if not logged:
        wanted = vehicle.steer_signals()
        raise SignalError(f"{wanted[0]}: not in {record.name}; map the road-wheel angle of a steered axle to it")
    units = tuple(
        unit.model_copy(
            update={
                "axle_groups": tuple(
                    group.model_copy(
                        update={
                            "axles": tuple(
                                axle.model_copy(update={"steerable": f"steer.{unit.name}.{axle.name}" in logged})
                                for axle in group.axles
                            )
                        }
                    )
                    for group in unit.axle_groups
                )
            }
        )
        for unit in vehicle.units
    )
    return vehicle.model_copy(update={"units": units})


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
    return [section for piece in pieces for section in piece.sections()]


def prepare(
    model: ChainModel, vehicle: Vehicle, record: Record, *, delays: Mapping[str, float] | None = None
) -> Rows:
    """Rows of a record for a model.

    Args:
        vehicle: whose numbers say how long a step may be.
        delays: s by which an input's channel is late.

    Raises:
        SignalError: an input is missing, or has a gap that is too long.
    """
    delays = delays or {}
    inputs = {}
    for name in model.inputs:
        values = record.input(name)
        late = delays.get(name, 0.0)
        inputs[name] = np.interp(record.time + late, record.time, values) if late else values
    fine, places = steps.subdivide(record.time, steps.longest(vehicle, inputs["speed"], roll=model.roll))
    dt, d = steps.input_rows(record.time, inputs, fine)
    measured = np.full((len(fine), len(model.outputs)), np.nan)
    for i, name in enumerate(model.outputs):
        if name in record.signals:
            measured[places, i] = record.signals[name]
    x0, P0 = initial(vehicle, {name: float(values[0]) for name, values in inputs.items()}, roll=model.roll)
    return Rows(rows=sample_rows(dt, d, measured), time=fine, places=places, x0=x0, P0=P0)
