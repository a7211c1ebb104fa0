"""Channels predicted from speed and steer angles by the linear model, for several values of what is uncertain in it."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np

from fifthwheel.base.errors import FifthwheelError
from fifthwheel.base.names import ParameterPath
from fifthwheel.base.types import Array
from fifthwheel.data.channels import MEASURED, SignalName, is_of, measured_signals
from fifthwheel.data.checks.kinematics import is_mostly_gaps, without_gaps
from fifthwheel.data.checks.plausibility import MIN_SPEED
from fifthwheel.data.checks.samples import MAX_SPEED
from fifthwheel.data.record import Record
from fifthwheel.data.record.record import segments_above
from fifthwheel.data.record.resample import decimate
from fifthwheel.estimate.filters.initial_state import steady_initial_state
from fifthwheel.estimate.time_bases.lags import RATE, LagCurve, lag_curve
from fifthwheel.model import dynamics
from fifthwheel.model.dynamics.simulation import free_response
from fifthwheel.truck import Vehicle, catalogue

_KNOWN_STIFFNESS = ((1.0, 1.0), (0.7, 0.7), (1.4, 1.4), (1.0, 0.7), (1.0, 1.4))
"""Factors of the cornering stiffness of the first unit and of the other units; a vehicle file is wrong by 30 %."""
_UNKNOWN_STIFFNESS = (0.6, 1.0, 1.7)
"""Factors of the cornering stiffness of all units without a vehicle file, laden or unladen."""
_UNKNOWN_LENGTH = (0.8, 1.0, 1.3, 1.7)
"""Factors of the length of the semitrailer without a vehicle file: 6.4 to 13.6 m."""
_START = 1.0
"""s at the start of a segment that depend on its unknown initial state."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Prediction:
    """Measured and predicted channels on the multiples of 1 / RATE; of a gap above 10 s, 10 s remain."""

    time: Array
    """(N,) s"""
    steer: str
    """The first steer angle, front to rear."""
    names: tuple[str, ...]
    """(c,) channels"""
    measured: Array
    """(N, c) SI; NaN where missing."""
    predicted: Array
    """(v, N, c) SI, by variant of the vehicle; NaN outside the usable segments."""

    generic: bool
    """Whether the vehicle is unknown and the variants are usual ones."""

    @property
    def leading(self) -> str:
        """The yaw rate of the steered unit, whether measured or not."""
        return f"yaw_rate.{SignalName.of(self.steer).unit}"

    @cached_property
    def curves(self) -> list[list[LagCurve | None]]:
        """(v, c) how well each channel is explained by its own prediction at each lag."""
        pairs = [zip(self.measured.T, variant.T, strict=True) for variant in self.predicted]
        return [[lag_curve(measured, predicted) for measured, predicted in pair] for pair in pairs]


def predict_channels(record: Record, vehicle: Vehicle | None = None) -> Prediction | None:
    """The prediction of every channel that the vehicle has, for each variant of the vehicle that is stable.

    The cornering stiffness of a given vehicle varies by 30 %; by default, stiffness and length of a tractor and
    semitrailer vary over the range of usual ones. None where the record has no speed or steer angle that can be used,
    no such channel, or almost only gaps.
    """
    if vehicle is None:
        typical, factors = catalogue.get("cheng_cebon_2011"), product(_UNKNOWN_STIFFNESS, _UNKNOWN_LENGTH)
        variants = [_scaled(typical, leading=tyres, towed=tyres, length=length) for tyres, length in factors]
    else:
        variants = [_scaled(vehicle, leading=leading, towed=towed) for leading, towed in _KNOWN_STIFFNESS]
    measured_names = measured_signals(record.signals, [unit.name for unit in variants[0].units], MEASURED)
    names = tuple(name for name in record.signals if name in measured_names)
    try:
        segments = segments_above(record, MIN_SPEED)
        variants = [variant.with_logged_steering(record.signals, record.name) for variant in variants]
        steers = variants[0].steer_signals()
        inputs = [{name: segment.input(name) for name in ("speed", *steers)} for segment in segments]
    except FifthwheelError:
        return None
    fastest = max(float(columns["speed"].max()) for columns in inputs)
    roll = any(is_of(name, *[c for c in MEASURED if c.model and c.model.needs_roll]) for name in names)
    variants = [variant for variant in variants if dynamics.is_stable(variant, fastest, roll=roll)]
    if not names or not variants or fastest > MAX_SPEED or len(record) < _START * RATE:
        return None
    if is_mostly_gaps(record):
        return None
    time, values = decimate(record.time, np.column_stack([record.signals[name] for name in names]), RATE)
    instants = without_gaps(np.arange(np.rint(time[0] * RATE), np.rint(time[-1] * RATE) + 1) / RATE, time)
    rows = np.rint(instants * RATE)
    measured = np.full((rows.size, len(names)), np.nan)
    measured[np.searchsorted(rows, np.rint(time * RATE))] = values
    predicted = np.full((len(variants), *measured.shape), np.nan)
    for segment, columns in zip(segments, inputs, strict=True):
        first, last = np.searchsorted(rows, [np.ceil(segment.time[0] * RATE), np.floor(segment.time[-1] * RATE) + 1])
        grid = instants[first:last]
        if grid.size > _START * RATE:
            on_grid = {name: np.interp(grid, segment.time, column) for name, column in columns.items()}
            for variant, response in zip(variants, predicted, strict=True):
                response[first:last] = _response(variant, names, grid, on_grid, roll=roll)
    return Prediction(
        time=instants,
        steer=steers[0],
        names=names,
        measured=measured,
        predicted=predicted,
        generic=vehicle is None,
    )


def _response(vehicle: Vehicle, names: Sequence[str], time: Array, inputs: dict[str, Array], *, roll: bool) -> Array:
    """Outputs (N, c) from the steady state of the first inputs; NaN in the first second."""
    first = {name: float(column[0]) for name, column in inputs.items()}
    x0, _ = steady_initial_state(vehicle, first, {}, roll=roll)
    model = dynamics.model(vehicle, names, roll=roll)
    outputs = free_response(model, dynamics.all_parameters(vehicle, names), time, inputs, x0)[1]
    outputs[: round(_START * RATE)] = np.nan
    return outputs


def _scaled(vehicle: Vehicle, *, leading: float, towed: float, length: float = 1.0) -> Vehicle:
    """The vehicle with factors of the cornering stiffness of its first and its other units, and of their length."""
    first = vehicle.units[0].name
    of_towed = {"cornering_stiffness": towed, "position": length, "cog": length, "yaw_inertia": length**2}
    changed = {}
    for name, value in vehicle.parameters().items():
        path = ParameterPath.of(name)
        factors = {"cornering_stiffness": leading} if path.unit == first else of_towed
        if path.quantity in factors:
            changed[name] = value * factors[path.quantity]
    return vehicle.replace(changed)
