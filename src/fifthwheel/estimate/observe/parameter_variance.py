"""The variance of reported signals that uncertain parameters cause: of a filter by its sensitivities, of a smoother by
sigma points.

The variance of a signal is the sum of the squares of its changes along the columns of a square root of the covariance
of the parameters.
"""

from collections.abc import Callable, Iterator, Mapping
from typing import NamedTuple, Self

import numpy as np

from fifthwheel.base.native import Scan
from fifthwheel.base.types import Array, Indices
from fifthwheel.estimate.observe.observer_model import ObserverModel
from fifthwheel.estimate.observe.observer_step import (
    ObserverLayout,
    TrackedLayout,
    report_step,
    step_with_gains,
)
from fifthwheel.estimate.observe.uncertainty import Uncertainty, positive_parameters
from fifthwheel.model.dynamics.unit_equations import BANK

SPACING = 0.04
"""Time in which the derivatives of a step are taken as constant, s; changes are interpolated within it."""
SETTLED = 1.0
"""Time after a start in which the derivatives are those of each row, s: the gain changes from row to row."""
STEP = 1e-6
"""Of the differences: a fraction of the standard deviations of the parameters, SI of the states."""

Pass = Callable[[Array, Array], Iterator[tuple[slice, Array]]]
"""(carry (B, n), constant (B, n)) -> reported signals of B vehicles, and their variances, (B, M, 2 n), for M of N rows
at a time."""


class SigmaPoints(NamedTuple):
    """Vehicles at the c pairs of sigma points of the uncertain parameters.

    They start at the state of the given vehicle: P0 is wide enough for all of them, and the steady state of a vehicle
    near its critical speed is very sensitive to the parameters.
    """

    constants: Array  # of the compiled step, (2 c, n): plus and minus of each pair
    steps: Array  # distance from the given vehicle, as a fraction of the column, (c,)
    unknowns: Array  # slopes of the bank and of the offsets of the steer angles, (c, u)
    with_bank: bool  # whether the bank is uncertain

    @classmethod
    def of(cls, observer: ObserverModel, uncertainty: Uncertainty) -> Self:
        """The sigma points of an observer's vehicle, for names of `ObserverModel.uncertain`."""
        pairs = uncertainty.pairs(observer.values(), positive_parameters(observer.vehicle.parameters()))
        constants = [observer.constant(values, gate=np.inf) for pair in pairs for values in (pair.plus, pair.minus)]
        slopes = [
            [(pair.plus.get(n, 0.0) - pair.minus.get(n, 0.0)) / (2 * pair.step) for n in observer.model.unknowns]
            for pair in pairs
        ]
        steps = np.array([pair.step for pair in pairs])
        return cls(np.array(constants), steps, np.array(slopes), BANK in uncertainty.names)


class Sensitivities:
    """Changes of a filter's state and reported signals along the uncertain directions, from its start on.

    Args:
        observer: whose filter it is.
        points: of its uncertain parameters.
        inputs: speed and steer angles at the start, by name.
        start: state (n_x,) there. It does not depend on parameters but bank and offsets, because P is wide enough.
        time: of the start, s.
    """

    def __init__(
        self, observer: ObserverModel, points: SigmaPoints, inputs: Mapping[str, float], start: Array, time: float
    ) -> None:
        self._models, self._with_bank = (observer.model, observer.report), points.with_bank
        layout = ObserverLayout.of(*self._models)
        n_c, *between, n_report, _ = layout.constant
        of_report = slice(n_c + sum(between), n_c + sum(between) + n_report)
        constant = observer.constant()
        directions = (points.constants[::2] - points.constants[1::2]) / (2 * points.steps[:, None])
        n, k = len(start), len(directions)
        self._constants = constant[:n_c], constant[of_report]
        self._directions = np.vstack([directions[:, :n_c], np.zeros((n, n_c))]), directions[:, of_report]
        self._of_state = np.vstack([np.zeros((k, n)), np.eye(n)])[:, None]  # along the directions, and each state
        self._state, self._change = start, (points.unknowns @ observer.effects(inputs)).T
        self._settled = time + SETTLED
        self._last = np.empty(0), np.empty((0, len(observer.report.outputs), k))  # time and slopes of the last group

    def variance(self, time: Array, samples: Array, output: Array) -> Array:
        """Variance (M, n) of the n reported signals, as a filter gives them, over the parameters.

        With the bank among them, it is without the variance of the filter, which considers the bank itself. `time` (M,)
        and `samples` are M rows after those of the last call, and `output` that of `observer_step`.
        """
        _, n_d, n_y, _ = ObserverLayout.of(*self._models).sample
        begins = _row_groups(time, self._settled)
        counts = np.diff(begins, append=len(time))
        after, gains, bank, _ = np.split(output, np.cumsum(TrackedLayout.of(*self._models)), axis=1)
        before, self._state = np.vstack([self._state, after[:-1]]), after[-1]
        middle, last = begins + counts // 2, begins + counts - 1
        dt, gains = (np.add.reduceat(a, begins) / counts[:, None] for a in (samples[:, :1], gains))
        sample = np.hstack([dt, samples[middle, 1 : 1 + n_d + n_y], gains])
        k = self._change.shape[1]
        slopes = _slopes(
            step_with_gains(self._models[0]),
            sample,
            before[middle],
            self._of_state,
            self._constants[0],
            self._directions[0],
        )
        b, A, changes = slopes[..., :k], slopes[..., k:], np.empty_like(slopes[..., :k])
        for i, count in enumerate(counts.tolist()):
            for _ in range(count):
                self._change = A[i] @ self._change + b[i]
            changes[i] = self._change
        d, moved = samples[last, 1 : 1 + n_d], np.moveaxis(changes, 2, 0)
        slopes = _slopes(report_step(*self._models), d, after[last], moved, self._constants[1], self._directions[1])
        at, slopes = np.append(self._last[0], time[last]), np.concatenate([self._last[1], slopes])
        self._last = at[-1:], slopes[-1:]
        return _interpolated_squares(slopes, at, time) - self._with_bank * bank


def _slopes(step: Scan, sample: Array, x: Array, x_dot: Array, constant: Array, constant_dot: Array) -> Array:
    """Derivatives (M, n_output, k) of the outputs of a step without carry at M samples, by differences.

    The arguments of the step are the samples with the states x (M, n) behind, and the constant; their derivatives along
    k directions are x_dot (k, M or 1, n) and constant_dot (k, n_constant).
    """
    moves, constants = (STEP * np.concatenate([np.zeros_like(dot[:1]), dot]) for dot in (x_dot, constant_dot))
    states = np.broadcast_to(x + moves, (len(moves), *x.shape))
    lanes = np.concatenate([np.broadcast_to(sample, (len(moves), *sample.shape)), states], axis=2)
    _, output = step.batch(np.empty((len(moves), 0)), lanes, constant + constants)
    return np.asarray(np.moveaxis(output[1:] - output[0], 0, 2) / STEP)


def _row_groups(time: Array, settled: float) -> Indices:
    """The first of the M rows of each group of about `SPACING`; until the filter has settled, a group is one row."""
    single = int(np.searchsorted(time, settled))
    size = max(int(SPACING * (len(time) - 1) / max(np.ptp(time), 1e-9)), 1)  # of a single row 1
    return np.concatenate([np.arange(single), np.arange(single, len(time), size)])


def _interpolated_squares(slopes: Array, at: Array, time: Array) -> Array:
    """Squared lengths (M, n) at times (M,) of the slopes (N, n, k) at times (N,), linear between these."""
    squares = np.einsum("rnk,rnk->rn", slopes, slopes)
    if len(at) == 1:
        return np.asarray(squares)
    products = np.einsum("rnk,rnk->rn", slopes[:-1], slopes[1:])
    before = np.clip(np.searchsorted(at, time, side="right") - 1, 0, len(at) - 2)
    f = ((time - at[before]) / (at[before + 1] - at[before]))[:, None]
    return np.asarray((1 - f) ** 2 * squares[before] + f**2 * squares[before + 1] + 2 * f * (1 - f) * products[before])


def sigma_point_variance(
    points: SigmaPoints, effects: Array, start: Array, run: Pass, lanes: int, shape: tuple[int, int]
) -> Array:
    """Variance of `Sensitivities` for N rows at once (N, n), which is `shape`, as a smoother gives them.

    `start` is [x, P] before the first row, `run` the smoother, with an even number of vehicles in a pass.
    """
    total: Array = np.zeros(shape)
    moved = np.zeros((len(points.constants), len(start)))
    shifts = points.steps[:, None] * (points.unknowns @ effects)
    moved[::2, : effects.shape[1]], moved[1::2, : effects.shape[1]] = shifts, -shifts
    for first in range(0, len(points.constants), lanes):
        step = points.steps[first // 2 : (first + lanes) // 2, None, None]
        for rows, result in run(start + moved[first : first + lanes], points.constants[first : first + lanes]):
            reported = result[..., : result.shape[2] // 2]
            total[rows] += (((reported[::2] - reported[1::2]) / (2 * step)) ** 2).sum(axis=0)
    return total
