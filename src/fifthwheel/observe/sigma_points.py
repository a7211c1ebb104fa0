"""Vehicles with changed parameters, at the sigma points of their uncertainty."""

from collections.abc import Callable, Sequence
from typing import NamedTuple, Self

import numpy as np

from fifthwheel._types import Array
from fifthwheel.observe.observer_model import ObserverModel
from fifthwheel.observe.uncertainty import SigmaPointPair

Pass = Callable[[Array, Array], Array]
"""(carry (B, n), constant (B, n)) -> reported signals of B vehicles on N rows, and their variances, (B, N, 2 n)."""


class SigmaPoints(NamedTuple):
    """Vehicles at the c pairs of sigma points of the uncertain parameters.

    They start at the state of the given vehicle: P0 is wide enough for all of them, and the steady state of a vehicle
    near its critical speed is very sensitive to the parameters.
    """

    constants: Array  # of the compiled step, (2 c, n): plus and minus of each pair
    steps: Array  # distance from the given vehicle, as a fraction of the column, (c,)
    unknowns: Array  # slopes of the bank and of the offsets of the steer angles, (c, u)

    @classmethod
    def of(cls, observer: ObserverModel, pairs: Sequence[SigmaPointPair]) -> Self:
        """The sigma points of an observer's vehicle."""
        constants = [observer.constant(values, gate=np.inf) for pair in pairs for values in (pair.plus, pair.minus)]
        slopes = [
            [(pair.plus.get(n, 0.0) - pair.minus.get(n, 0.0)) / (2 * pair.step) for n in observer.model.unknowns]
            for pair in pairs
        ]
        return cls(np.array(constants), np.array([pair.step for pair in pairs]), np.array(slopes))


def sigma_point_variance(points: SigmaPoints, effects: Array, start: Array, run: Pass, lanes: int) -> Array:
    """Variance (N, n) of the n reported signals over the parameters.

    Args:
        points: of the uncertain parameters.
        effects: change (u, n_x) of the first state per unit of each unknown.
        start: [x, P] before the first row.
        run: the smoother over a segment of N rows.
        lanes: number of vehicles in one pass, even.
    """
    total: Array | float = 0.0
    moved = np.zeros((len(points.constants), len(start)))
    shifts = points.steps[:, None] * (points.unknowns @ effects)
    moved[::2, : effects.shape[1]], moved[1::2, : effects.shape[1]] = shifts, -shifts
    for first in range(0, len(points.constants), lanes):
        constants = points.constants[first : first + lanes]
        result = run(start + moved[first : first + lanes], constants)
        reported = result[..., : result.shape[2] // 2]
        step = points.steps[first // 2 : (first + lanes) // 2, None, None]
        total = total + (((reported[::2] - reported[1::2]) / (2 * step)) ** 2).sum(axis=0)
    return np.asarray(total)
