"""Rows of a compiled step from a record."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from fifthwheel.base.native import Scan, compiled
from fifthwheel.base.types import Array, Indices
from fifthwheel.base.units import STANDARD_GRAVITY
from fifthwheel.data.channels import GRADE, STEER, names_of
from fifthwheel.data.record import Record
from fifthwheel.estimate.filters.curves import SpeedCurve, Spline
from fifthwheel.estimate.filters.model import sample_rows
from fifthwheel.model import dynamics
from fifthwheel.model.dynamics import ChainModel, simulation
from fifthwheel.truck import Vehicle


@dataclass(frozen=True, kw_only=True)
class SampleRows:
    """M samples of a compiled step. A slice gives L of them (L, 1 + n_d + 2 n_y), see `model.sample_rows`.

    They are built when they are needed: those of a long record would be its largest array. No step leads to the first.
    """

    time: Array  # (M,) s
    inputs: Array  # (M, n_d / 2)
    measured: Array  # (M, n_y), NaN where missing

    def __len__(self) -> int:
        return len(self.time)

    def __getitem__(self, rows: slice) -> Array:
        first, stop, _ = rows.indices(len(self))
        before = max(first - 1, 0)  # where the first step begins
        dt, d = simulation.step_inputs(self.time[before:stop], self.inputs[before:stop])
        return sample_rows(dt, d, self.measured[before:stop])[first - before :]

    def part(self, first: int, stop: int) -> "SampleRows":
        """The rows from `first` to before `stop`, as rows of their own."""
        rows = slice(first, stop)
        return SampleRows(time=self.time[rows], inputs=self.inputs[rows], measured=self.measured[rows])


@dataclass(frozen=True, kw_only=True)
class StepRows(SampleRows):
    """A record of N samples as M rows, with additional rows where the model needs several steps between two samples."""

    sample_indices: Indices  # (N,) indices of the samples among the rows
    first: dict[str, float]  # speed and steer angles at the first sample, by name
    steer_sigma: float  # standard deviation of the steer angles, rad


def steer_sigma(inputs: Mapping[str, Array]) -> float:
    """Largest standard deviation of the steer angles among the inputs, rad."""
    others = ("speed", dynamics.SPEED_RATE, *dynamics.SLOPES.values())
    return max(float(np.std(values)) for name, values in inputs.items() if name not in others)


SMALLEST_PLAY = 0.002
"""rad; the contact of a smaller play is computed with this one, so that noise of the steer angle does not change it."""
PLAY_STEP = 0.0005
"""rad; the play is rounded to this step, so that small changes of it do not change the contact."""


def play_contact(steer: Array, play: float) -> Array:
    """On which side the play of a steering is in contact (N,), -0.5 to 0.5; the wheels are at steer - play * contact.

    `steer` (N,) is the angle of the steering, `play` the angle between both contacts, rad.
    """
    width = max(round(play / PLAY_STEP) * PLAY_STEP, SMALLEST_PLAY)
    _, contacts = _contact_step()(np.zeros(1), np.diff(steer)[:, None], np.array([width]))
    return np.concatenate([[0.0], contacts[:, 0]])


@compiled(Scan)
def _contact_step() -> ca.Function:
    """carry = the contact; sample = the change of the steer angle; constant = the play."""
    contact, change, width = (ca.SX.sym(name) for name in ("contact", "change", "width"))
    later = ca.fmin(0.5, ca.fmax(-0.5, contact + change / width))
    return ca.Function("contact", [contact, change, width], [later, later])


def corrected_inputs(record: Record, names: Sequence[str], errors: Mapping[str, float]) -> dict[str, Array]:
    """Inputs of a record by name, (N,) each, shifted by their delays.

    The play of a steering changes its angle, unless its contact is an input of its own. The derivative of the speed, if
    it is an input, is shifted with the speed, is not late itself, and contains gravity along the road where the record
    has the grade. Of the errors of the sensors, "<name>.delay" is the delay of an input, s, "<name>.play" the play of a
    steering, rad at the wheels; the others only convert the play to the measured angle.

    Raises:
        SignalError: an input is missing, or has a gap that is too long.
    """
    late = record.time + errors.get(dynamics.SPEED_DELAY, 0.0)
    speed, slope, rate, change = SpeedCurve(record.time, record.input("speed"))(late)
    inputs = {"speed": speed, dynamics.SPEED_RATE: rate + _along_road(record)}
    inputs |= dict(zip(dynamics.SLOPES.values(), (slope, change), strict=True))
    for name in names_of(STEER, names):
        delay, play = (errors.get(f"{name}.{kind}", 0.0) for kind in ("delay", "play"))
        inputs[name], contact_name = record.input(name), dynamics.contact_input(name)
        if contact_name not in names and not delay and not play:
            continue
        play /= float(dynamics.steer_angle(name, 0.0, errors).slope)  # of the measured angle
        contact, contact_rate = _shifted(record.time, play_contact(inputs[name], play), delay)
        inputs[name], rate = _shifted(record.time, inputs[name], delay)
        if contact_name in names:
            inputs[contact_name] = contact
            inputs[dynamics.rate_input(name)] = rate - play * contact_rate
        else:
            inputs[name] = inputs[name] - play * contact
    return {name: inputs[name] for name in names}


def _along_road(record: Record) -> Array | float:
    """Component of gravity against the direction of motion (N,), m/s^2, if the record has the grade."""
    grade = record.signals.get(GRADE.quantity, np.empty(0))
    present = np.isfinite(grade)
    if not present.any():
        return 0.0
    slope = np.interp(record.time, record.time[present], grade[present])
    return np.asarray(STANDARD_GRAVITY * slope / np.hypot(1.0, slope))


def _shifted(time: Array, values: Array, delay: float) -> tuple[Array, Array]:
    """The values (N,) of a signal at time + delay, and their derivatives; constant outside the log.

    A cubic spline is differentiable with respect to the delay; linear interpolation has kinks, at which a search stops.
    """
    if len(time) < 4:
        return np.interp(time + delay, time, values), np.zeros_like(time)
    at = time + delay
    inside = (at >= time[0]) & (at <= time[-1])
    shifted, rate = Spline(time, values)(np.clip(at, time[0], time[-1]))
    return (values if delay == 0 else shifted), np.where(inside, rate, 0.0)


def step_rows(
    model: ChainModel, vehicle: Vehicle, record: Record, *, errors: Mapping[str, float] | None = None
) -> StepRows:
    """Rows of a record for a model; `errors` as in `corrected_inputs`. The numbers of the vehicle determine the longest
    step.

    Raises:
        SignalError: an input is missing, or has a gap that is too long.
    """
    errors = errors or {}
    inputs = corrected_inputs(record, model.inputs, errors)
    columns = simulation.input_columns(inputs, model.inputs)
    # of the measured speed: with one that is shifted by its delay, the number of steps would jump, and the cost with it
    limit = simulation.step_limit(vehicle, model.roll)(record.input("speed"))
    fine, columns, indices = simulation.subdivide(record.time, columns, limit)
    measured = np.full((len(fine), len(model.outputs)), np.nan)
    for i, name in enumerate(model.outputs):
        if name in record.signals:
            measured[indices, i] = record.signals[name]
    first = {name: float(values[0]) for name, values in inputs.items()}
    return StepRows(
        time=fine,
        inputs=columns,
        measured=measured,
        sample_indices=indices,
        first=first,
        steer_sigma=steer_sigma(inputs),
    )
