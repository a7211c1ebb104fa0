"""Rows of a compiled step from a record, by curves through its samples: a cubic spline, or a smooth one for the speed.

The smooth speed at a time is that of the parabola, and u' that of the line, through the samples around it with Gaussian
weights (J. Fan and I. Gijbels, Local Polynomial Modelling and Its Applications, 1996, chapter 2): both without delay. A
curve through every sample would follow their noise and their steps, so that the cost of an identification would ripple
along the delay of the speed, and a search along it would not converge.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from fifthwheel.base.native import Scan, compiled
from fifthwheel.base.types import Array, Indices
from fifthwheel.base.units import STANDARD_GRAVITY
from fifthwheel.data.channels import GRADE, STEER, names_of
from fifthwheel.data.record import Record
from fifthwheel.estimate.filters.model import sample_rows
from fifthwheel.model import dynamics
from fifthwheel.model.dynamics import ChainModel, simulation
from fifthwheel.truck import Vehicle

WIDTH = 0.28
"""Standard deviation of the weights, s: white noise of 0.1 m/s at 100 Hz gives a u' of 0.025 m/s^2."""
STEP = 0.05
"""Between the points of the curve, s; samples within it are averaged."""
CUT = 4.0
"""Beyond this number of `WIDTH`, samples have no weight."""
SMALLEST_PLAY = 0.002
"""rad; the contact of a smaller play is computed with this one, so that noise of the steer angle does not change it."""
PLAY_STEP = 0.0005
"""rad; the play is rounded to this step, so that small changes of it do not change the contact."""
LARGEST_BEND, BEND_WINDOW = 5e-4, 0.5
"""Change of the steering rate in a long step times that step, rad, times the speed, m/s; the time of its mean, s."""
SHORTEST_STEP = 0.25
"""Over the longest one, where the steering changes fast."""


class Spline:
    """Cubic spline, twice continuously differentiable, with the not-a-knot condition at both ends.

    C. de Boor (2001), A Practical Guide to Splines, chapter 4. The slopes at the samples are the solution of a
    tridiagonal system, by elimination without pivoting.

    Args:
        time: (N,) increasing; N is at least 4.
        values: (N,) finite.
    """

    def __init__(self, time: Array, values: Array) -> None:
        self.time, self.values = time, values
        h, rise = np.diff(time), np.diff(values) / np.diff(time)
        first, last = time[2] - time[0], time[-1] - time[-3]
        below = np.concatenate([[0.0], h[1:], [last]])
        diagonal = np.concatenate([h[1:2], 2 * (h[:-1] + h[1:]), h[-2:-1]])
        above = np.concatenate([[first], h[:-1], [0.0]])
        right = np.concatenate(
            [
                [((h[0] + 2 * first) * h[1] * rise[0] + h[0] ** 2 * rise[1]) / first],
                3 * (h[1:] * rise[:-1] + h[:-1] * rise[1:]),
                [(h[-1] ** 2 * rise[-2] + (2 * last + h[-1]) * h[-2] * rise[-1]) / last],
            ]
        )
        _, eliminated = _elimination()(np.zeros(2), np.column_stack([below, diagonal, above, right]), np.zeros(0))
        _, slopes = _substitution()(np.zeros(1), eliminated[::-1], np.zeros(0))
        self.slopes = slopes[::-1, 0]
        self._bend = (self.slopes[:-1] + self.slopes[1:] - 2 * rise) / h
        self._half_curvature = (rise - self.slopes[:-1]) / h - self._bend

    def __call__(self, time: Array) -> tuple[Array, Array]:
        """Values and derivatives (M,) each at times (M,) from the first sample to the last."""
        i = np.clip(np.searchsorted(self.time, time, side="right") - 1, 0, len(self.time) - 2)
        t = time - self.time[i]
        third, second, first = (
            self._bend[i] / (self.time[i + 1] - self.time[i]),
            self._half_curvature[i],
            self.slopes[i],
        )
        return ((third * t + second) * t + first) * t + self.values[i], (3 * third * t + 2 * second) * t + first


@compiled(Scan)
def _elimination() -> ca.Function:
    """carry = output = [above, right] of the row with diagonal 1; sample = [below, diagonal, above, right]."""
    before, row, nothing = ca.SX.sym("before", 2), ca.SX.sym("row", 4), ca.SX.sym("nothing", 0)
    below, diagonal, above, right = ca.vertsplit(row)
    pivot = diagonal - below * before[0]
    later = ca.vertcat(above / pivot, (right - below * before[1]) / pivot)
    return ca.Function("elimination", [before, row, nothing], [later, later])


@compiled(Scan)
def _substitution() -> ca.Function:
    """carry = output = the unknown of the row; sample = [above, right], from the last row to the first."""
    after, row, nothing = ca.SX.sym("after"), ca.SX.sym("row", 2), ca.SX.sym("nothing", 0)
    unknown = row[1] - row[0] * after
    return ca.Function("substitution", [after, row, nothing], [unknown, unknown])


class SpeedCurve:
    """Speed and its rate between the first and the last sample; outside, the rate is constant.

    Args:
        time: (N,) increasing, s.
        speed: (N,) m/s, finite.
    """

    def __init__(self, time: Array, speed: Array) -> None:
        self._first, self._last = float(time[0]), float(time[-1])
        points = max(round((self._last - self._first) / STEP), 3) + 1
        grid = np.linspace(self._first, self._last, points)
        step = grid[1] - grid[0]
        place = np.rint((time - self._first) / step).astype(np.int64)
        samples = [np.bincount(place, weights, points) for weights in (np.ones(time.size), time - grid[place], speed)]
        present = samples[0] > 0
        offset, mean = (values[present] / samples[0][present] for values in samples[1:])
        knots = grid[present] + offset
        level = np.interp(grid, knots, mean)
        for end, inner in ((0, 1), (-1, -2)) if knots.size > 1 else ():
            level[end] += (mean[end] - mean[inner]) / (knots[end] - knots[inner]) * (grid[end] - knots[end])
        half = np.arange(-round(CUT * WIDTH / step), round(CUT * WIDTH / step) + 1) * step
        weights = np.exp(-0.5 * (half / WIDTH) ** 2)

        def moment(values: Array, power: int) -> Array:
            """Sum of w t^power times the values (N,) about each point, with t from there."""
            return np.convolve(values, weights * (-half) ** power, "full")[half.size // 2 :][:points]

        M, right = [moment(np.ones(points), k) for k in range(5)], np.stack([moment(level, k) for k in range(3)], -1)
        gram = np.stack([np.stack(M[k : k + 3], -1) for k in range(3)], -1)
        parabola, line = (
            np.asarray(np.linalg.solve(gram[:, :n, :n], right[:, :n, None])[..., 0], np.float64) for n in (3, 2)
        )
        self._speed, self._rate = Spline(grid, parabola[:, 0]), Spline(grid, line[:, 1])

    def __call__(self, time: Array) -> tuple[Array, Array, Array, Array]:
        """Speed, m/s, the slope of its curve, m/s^2, u', m/s^2, and the slope of u', m/s^3, at times (M,)."""
        inside = np.clip(time, self._first, self._last)
        (speed, slope), (rate, change) = self._speed(inside), self._rate(inside)
        within = inside == time
        return speed + rate * (time - inside), np.where(within, slope, rate), rate, np.where(within, change, 0.0)


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


def _bend(time: Array, values: Array) -> Array:
    """Second derivative of values (N,) times the square of the step (N,); 0 at both ends."""
    bend, steps, rise = np.zeros_like(values), np.diff(time), np.diff(values)
    bend[1:-1] = 2 * (rise[1:] * steps[:-1] - rise[:-1] * steps[1:]) / (steps[1:] + steps[:-1])
    return bend


def _shorter_steps(record: Record, steers: Sequence[str]) -> Array:
    """The fraction (N,) of a long step that is short enough for the steering at each sample.

    It is that of the mean bend over `BEND_WINDOW`, because noise bends too.
    """
    window = np.ones(2 * round(BEND_WINDOW * record.rate / 2) + 1)
    bends = [np.convolve(_bend(record.time, record.input(name)), window, "same") / window.size for name in steers]
    largest = np.abs(bends).max(axis=0, initial=0.0) * record.input("speed")
    return np.asarray(np.clip(np.sqrt(LARGEST_BEND / np.maximum(largest, LARGEST_BEND)), SHORTEST_STEP, 1.0))


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
    limit = simulation.step_limit(vehicle, model.roll, model.long_steps)(record.input("speed"))
    if model.long_steps:
        limit *= _shorter_steps(record, steers := names_of(STEER, inputs))
        # a line through these has the same mean over each step as the curve through the given ones
        inputs |= {name: inputs[name] - _bend(record.time, inputs[name]) / 12 for name in steers}
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
