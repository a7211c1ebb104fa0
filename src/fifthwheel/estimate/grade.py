"""The grade of the road under a vehicle of known mass, by the balance of its longitudinal forces.

On a grade, wheels and couplings transmit what they would transmit on a level road at the acceleration u' + g sin(grade)
(D'Alembert). At an articulation angle, the pull of a trailer has a lateral component on the unit in front. In bends of
a hilly road it is as large as the side forces by which the tyres of an axle group resist a tight turn.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fifthwheel.base.errors import SignalError, VehicleError
from fifthwheel.base.formatting import enumerated
from fifthwheel.base.types import Array
from fifthwheel.base.units import STANDARD_GRAVITY
from fifthwheel.data.channels import GRADE, YAW_RATE, missing_for_mass
from fifthwheel.data.record import Record
from fifthwheel.estimate.longitudinal import (
    MEAN_GRADE,
    NOISE_PRIOR,
    SHORTEST,
    STEP,
    force_balance,
    step_means,
    unbraked,
)
from fifthwheel.truck import Vehicle

SHORTEST_MOVE = 1e-3
"""Distance over which the grade may change at standstill, m."""
ITERATIONS = 10
"""For the steps where the bound of the brakes is reached."""


def with_grade(record: Record, vehicle: Vehicle) -> Record:
    """The record with the signal "grade", if it has none and has what the mass by driving needs.

    The record is the same where the force is known for less than `longitudinal.SHORTEST`, or the brakes are never on
    although the vehicle brakes. The head wind counts as a grade.
    """
    if np.isfinite(record.signals.get(GRADE.quantity, np.nan)).any() or missing_for_mass(record.signals):
        return record
    mass = sum(unit.mass for unit in vehicle.units)
    bare = replace(record, signals={name: v for name, v in record.signals.items() if name != GRADE.quantity})
    try:
        rows = force_balance(bare, vehicle, mass, mass, 0.0, braked=False)
        cornering = _cornering(record, vehicle, rows[:, 2])
    except (SignalError, VehicleError):  # such as axle loads that are not determined
        return record
    moved, distance, speed, present, without_force, by_force = rows.T[:6]
    usable = (moved > 0) & (present > 0) & np.append(False, present[:-1] > 0)
    known = usable & unbraked(bare)
    if STEP * known.sum() < SHORTEST:
        return record
    lost = without_force + by_force - np.diff(speed, prepend=speed[0]) / STEP - cornering
    lost = np.where(usable, lost / np.where(usable, moved, 1.0), 0.0)
    slope = _smoothed(lost, known, distance)
    for _ in range(ITERATIONS):  # brakes take energy: where they act, the slope is at most the one without them
        slope = _smoothed(lost, known | (usable & (slope > lost)), distance)
    time = record.time[0] + STEP * np.arange(slope.size)  # between the means of two steps
    sine = np.clip(np.interp(record.time, time, slope) / STANDARD_GRAVITY, -0.5, 0.5)
    return replace(record, signals=dict(record.signals) | {GRADE.quantity: sine / np.sqrt(1 - sine**2)})


def grade_notes(records: Sequence[Record], unit: str) -> list[str]:
    """Where the grade of the road comes from, on which the parameters of a unit without sensors depend."""
    grades = [record.signals.get(GRADE.quantity, np.full(1, np.nan)) for record in records]
    without = [record for record, grade in zip(records, grades, strict=True) if not np.isfinite(grade).any()]
    notes = []
    if len(without) < len(records):
        low, high = (100 * function(np.concatenate(grades)) for function in (np.nanmin, np.nanmax))
        notes.append(f"The pull of the {unit} follows the grade of the road, {low:.1f} to {high:.1f} %.")
    if without:
        missing = missing_for_mass(without[0].signals)
        cure = enumerated(missing) if missing else "20 s of driving without brakes"
        notes.append(
            f"{enumerated([record.name for record in without])}: no signal shows the grade of the road. On hills, the "
            f"pull of the {unit} then makes all estimates wrong, and no sigma contains it. If the road was not level, "
            f"log the grade, or {cure}, from which it follows."
        )
    return notes


def _cornering(record: Record, vehicle: Vehicle, speed: Array) -> Array | float:
    """Deceleration (N,) by the side forces of a turn, m/s^2: each acts at the slip angle of its axle group.

    sum (N a / g)^2 / C / m, with the lateral acceleration a; 0 without the yaw rate of the first unit.
    """
    name, p = f"{YAW_RATE.quantity}.{vehicle.units[0].name}", vehicle.parameters()
    if name not in record.signals:
        return 0.0
    loads = {path: load / STANDARD_GRAVITY for path, load in vehicle.axle_loads().items()}
    compliance = sum(load**2 / p[f"{path}.cornering_stiffness"] for path, load in loads.items()) / sum(loads.values())
    return np.asarray(compliance * (speed * np.nan_to_num(step_means(record, name))) ** 2)


def _smoothed(slope: Array, known: NDArray[np.bool_], distance: Array) -> Array:
    """The most probable slope (N,), m/s^2, by that of each known step: a random walk over the distance (N,), m."""
    from scipy.linalg import solveh_banded  # slow to import

    medians = {key: median for key, (median, _) in NOISE_PRIOR.items()}
    variance = 2 * (medians["speed"] / STEP) ** 2 + medians["acceleration"] ** 2 / STEP
    walk = 2 * medians["slope"] ** 2 * np.maximum(distance[1:], SHORTEST_MOVE) / medians["hill"]
    bands = np.zeros((2, slope.size))
    bands[0] = known / variance
    bands[0, 0] += 1 / (medians["slope"] ** 2 + (STANDARD_GRAVITY * MEAN_GRADE) ** 2)
    bands[0, 1:] += 1 / walk
    bands[0, :-1] += 1 / walk
    bands[1, :-1] = -1 / walk
    return np.asarray(solveh_banded(bands, known * slope / variance, lower=True))
