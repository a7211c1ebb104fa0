"""The variance of reported signals that uncertain parameters cause: of a filter by its sensitivities, of a smoother by
sigma points.

The variance of a signal is the sum of the squares of its changes along the columns of a square root of the covariance
of the parameters.
"""

import os
from collections.abc import Callable, Iterator
from typing import NamedTuple, Self

import numpy as np

from fifthwheel.base.types import Array
from fifthwheel.estimate.filters.step_rows import SampleRows
from fifthwheel.estimate.observe.observer_model import ObserverModel
from fifthwheel.estimate.observe.observer_step import ObserverLayout, TrackedLayout, sensitivity_step, tracked_step
from fifthwheel.estimate.observe.uncertainty import Uncertainty, positive_parameters
from fifthwheel.model.dynamics.unit_equations import BANK

CHUNK = 1_000
"""Number of rows in one pass; it bounds the memory for long records."""

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


def parameter_variance(
    observer: ObserverModel, points: SigmaPoints, effects: Array, start: Array, rows: SampleRows
) -> Iterator[tuple[slice, Array]]:
    """Variance (M, n) of the n reported signals, as a filter gives them, over the parameters: M of N rows at a time.

    With the bank among them, it is without the variance of the filter, which considers the bank itself. `effects` is
    the change (u, n_x) of the first state per unit of bank and offsets; `start`, [x, P, s] before the first row, does
    not depend on the other parameters, because P is wide enough.
    """
    models = observer.model, observer.report
    layout, of_bank = ObserverLayout.of(*models), TrackedLayout.of(*models).of_bank
    n_c, *between, n_report, _ = layout.constant
    slopes = (points.constants[::2] - points.constants[1::2]) / (2 * points.steps[:, None])
    first_report = n_c + sum(between)
    directions = np.hstack([slopes[:, :n_c], slopes[:, first_report : first_report + n_report]])
    constant = observer.constant(gate=np.inf)[: sum(layout.constant)]
    known = np.concatenate([constant[:n_c], constant[first_report : first_report + n_report]])
    carry, carry_dot, nothing = start, points.unknowns @ effects, np.empty(0)
    for first in range(0, len(rows), CHUNK):
        chunk = slice(first, min(first + CHUNK, len(rows)))
        samples = rows[chunk]
        carry, tracked = tracked_step(*models)(carry, samples, constant)
        samples = np.hstack([samples[:, : sum(layout.sample[:2])], tracked[:, :-of_bank]])
        result = sensitivity_step(*models)(nothing, samples, known, carry_dot, directions, threads=os.cpu_count() or 1)
        squares = np.einsum("rnk,rnk->rn", result.output_dot, result.output_dot)
        yield chunk, squares - points.with_bank * tracked[:, -of_bank:]
        carry_dot = result.carry_dot


def sigma_point_variance(
    points: SigmaPoints, effects: Array, start: Array, run: Pass, lanes: int, shape: tuple[int, int]
) -> Array:
    """The same for N rows (N, n), which is `shape`, as a smoother gives them.

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
